//! The messages of a recording: ROS 2 definitions as schemas, and CDR as the encoding. Foxglove, PlotJuggler and the ROS 2
//! tools can read them.

mod decode;

use takt_rt::{
    AxisRecord, CycleRecord, Event, EventKind, FrameKind, GroupRecord, NANOSECONDS_PER_SECOND, Nanoseconds,
};

use super::cdr::CdrEncoder;
use super::severity::Severity;
use crate::link::trace::{TracedFrame, TracedHealth};

pub use decode::{
    decode_axis, decode_bus, decode_cycle, decode_event, decode_frame, decode_group, decode_journal,
};

/// A message type: its name, and its definition in the ROS 2 interface language.
pub struct MessageType {
    pub name: &'static str,
    pub definition: &'static str,
    /// The numbers of last fields that are missing in recordings of earlier versions.
    pub later_fields: &'static [usize],
}

impl MessageType {
    /// Returns `true` if messages with another definition of this type can be read.
    pub fn can_be_read_as(&self, definition: &str) -> bool {
        let (known, other) = (layout(self.definition), layout(definition));
        let is_earlier = self.later_fields.iter().any(|later| known.len() == other.len() + later);
        known == other || is_earlier && known.starts_with(&other)
    }
}

/// The times of a cycle.
pub const CYCLE: MessageType = MessageType {
    name: "takt_msgs/msg/Cycle",
    definition: include_str!("messages/Cycle.msg"),
    later_fields: &[],
};

/// One group in a cycle.
pub const GROUP: MessageType = MessageType {
    name: "takt_msgs/msg/Group",
    definition: include_str!("messages/Group.msg"),
    later_fields: &[],
};

/// One axis in a cycle.
pub const AXIS: MessageType = MessageType {
    name: "takt_msgs/msg/Axis",
    definition: include_str!("messages/Axis.msg"),
    later_fields: &[],
};

/// An event.
pub const EVENT: MessageType = MessageType {
    name: "takt_msgs/msg/Event",
    definition: include_str!("messages/Event.msg"),
    later_fields: &[1, 2, 4],
};

/// A frame on a bus.
pub const FRAME: MessageType = MessageType {
    name: "takt_msgs/msg/Frame",
    definition: include_str!("messages/Frame.msg"),
    later_fields: &[],
};

/// The health of a bus.
pub const BUS: MessageType = MessageType {
    name: "takt_msgs/msg/Bus",
    definition: include_str!("messages/Bus.msg"),
    later_fields: &[1],
};

/// A block of the journal.
pub const JOURNAL: MessageType = MessageType {
    name: "takt_msgs/msg/Journal",
    definition: include_str!("messages/Journal.msg"),
    later_fields: &[],
};

/// All axes at a time, as programs of ROS 2 know them.
pub const JOINT_STATE: MessageType = MessageType {
    name: "sensor_msgs/msg/JointState",
    definition: include_str!("messages/JointState.msg"),
    later_fields: &[],
};

/// An event in words, as programs of ROS 2 know it.
pub const LOG: MessageType = MessageType {
    name: "rcl_interfaces/msg/Log",
    definition: include_str!("messages/Log.msg"),
    later_fields: &[],
};

/// The messages that the reader of recordings knows.
pub const READ: [&MessageType; 5] = [&CYCLE, &GROUP, &AXIS, &EVENT, &BUS];

/// The lines of a definition that determine the layout: all but comments and constants.
fn layout(definition: &str) -> Vec<&str> {
    // Recordings of earlier versions have another name for the field `reason`.
    let renamed = |line| if line == "uint8 objection" { "uint8 reason" } else { line };
    let lines = definition.lines().map(str::trim).map(renamed);
    lines.filter(|line| !line.is_empty() && !line.starts_with('#') && !line.contains('=')).collect()
}

/// Encodes a [`CYCLE`].
pub fn encode_cycle(record: &CycleRecord, encoder: &mut CdrEncoder) {
    let (timing, [first, ..]) = (&record.timing, &record.groups);
    encoder
        .begin()
        .u64(timing.slot)
        .u64(timing.slot_start_ns)
        .u64(timing.wake_ns)
        .u64(timing.sync_ns)
        .u64(timing.compute_ns)
        .u64(timing.sent_ns)
        .u64(timing.missed_slots)
        .u8(first.phase as u8)
        .u8(record.is_commanded.into());
}

/// Encodes a [`GROUP`].
pub fn encode_group(slot: u64, group: &GroupRecord, encoder: &mut CdrEncoder) {
    encoder
        .begin()
        .u64(slot)
        .u8(group.phase as u8)
        .u8(group.stop.is_some().into())
        .u8(group.stop.map_or(0, |stop| stop.category as u8))
        .u8(group.stop.map_or(0, |stop| stop.rule as u8))
        .u8(group.callback_ns.is_some().into())
        .u64(group.callback_ns.unwrap_or(0));
}

/// Encodes an [`AXIS`].
pub fn encode_axis(slot: u64, axis: &AxisRecord, encoder: &mut CdrEncoder) {
    encoder
        .begin()
        .u64(slot)
        .f64(axis.position_set)
        .f64(axis.position)
        .f32(axis.velocity_set)
        .f32(axis.acceleration_set)
        .f32(axis.jerk_set)
        .f32(axis.velocity)
        .f32(axis.torque_set)
        .f32(axis.torque)
        .f32(axis.following_error)
        .i32(axis.command_raw)
        .i32(axis.position_raw)
        .u16(axis.controlword)
        .u16(axis.statusword)
        .u16(axis.error_code)
        .u16(axis.feedback_age)
        .u8(axis.drive_state as u8);
}

/// The fields of an [`EVENT`] that only some kinds use.
#[derive(Default)]
struct EventFields {
    kind: u8,
    axis: Option<u8>,
    phase_from: u8,
    phase_to: u8,
    category: u8,
    rule: u8,
    value: f64,
    limit: f64,
    move_id: u32,
    missed_slots: u64,
    timing_level: u8,
    drive_state: u8,
    statusword: u16,
    error_code: u16,
    error_register: u8,
    manufacturer: [u8; 5],
    /// The numbers of the request and the reason; `None` in a recording of an earlier version.
    refusal: Option<(u8, u8)>,
    /// The bus; also `None` in a recording of an earlier version.
    bus: Option<u8>,
}

impl EventFields {
    fn of(kind: &EventKind) -> Self {
        let none = Self::default();
        match *kind {
            EventKind::PhaseChanged { from, to } => {
                Self { kind: 0, phase_from: from as u8, phase_to: to as u8, ..none }
            }
            EventKind::Stop(stop) => Self {
                kind: 1,
                axis: stop.axis(),
                bus: stop.origin.bus(),
                phase_from: stop.phase as u8,
                category: stop.category as u8,
                rule: stop.rule() as u8,
                value: stop.cause.numbers().0,
                limit: stop.cause.numbers().1,
                ..none
            },
            EventKind::MotionFinished { request } => Self { kind: 2, move_id: request.0 as u32, ..none },
            EventKind::DriveState { axis, state, statusword } => {
                Self { kind: 3, axis: Some(axis), drive_state: state as u8, statusword, ..none }
            }
            EventKind::Mode { axis, mode } => {
                Self { kind: 9, axis: Some(axis), value: f64::from(mode as i8), ..none }
            }
            EventKind::Emergency { axis, code, register, manufacturer } => Self {
                kind: 4,
                axis: Some(axis),
                error_code: code,
                error_register: register,
                manufacturer,
                ..none
            },
            EventKind::Stream { state } => Self { kind: 8, value: f64::from(state as u8), ..none },
            EventKind::MissedSlots { count } => Self { kind: 5, missed_slots: count, ..none },
            EventKind::Timing { level } => Self { kind: 7, timing_level: level as u8, ..none },
            EventKind::Rejected(refused) => Self {
                kind: 6,
                axis: refused.axis,
                phase_from: refused.phase as u8,
                value: refused.reason.numbers().0,
                limit: refused.reason.numbers().1,
                refusal: Some((refused.request as u8, refused.reason.number())),
                ..none
            },
        }
    }
}

/// Encodes an [`EVENT`]; `text` says it in words.
pub fn encode_event(event: &Event, text: &str, encoder: &mut CdrEncoder) {
    let fields = EventFields::of(&event.kind);
    encoder
        .begin()
        .u64(event.slot)
        .u64(event.at_ns)
        .u8(fields.kind)
        .string(text)
        .i16(fields.axis.map_or(-1, i16::from))
        .u8(fields.phase_from)
        .u8(fields.phase_to)
        .u8(fields.category)
        .u8(fields.rule)
        .f64(fields.value)
        .f64(fields.limit)
        .u32(fields.move_id)
        .u64(fields.missed_slots)
        .u8(fields.timing_level)
        .u8(fields.drive_state)
        .u16(fields.statusword)
        .u16(fields.error_code)
        .u8(fields.error_register)
        .octets(fields.manufacturer)
        .u8(fields.refusal.map_or(0, |(request, _)| request))
        .u8(fields.refusal.map_or(0, |(_, objection)| objection))
        .i16(fields.bus.map_or(-1, i16::from))
        .i16(event.group.map_or(-1, i16::from));
}

/// Encodes a [`FRAME`].
pub fn encode_frame(TracedFrame { at_ns, is_sent, frame }: &TracedFrame, encoder: &mut CdrEncoder) {
    encoder
        .begin()
        .u64(*at_ns)
        .u8((*is_sent).into())
        .u32(frame.id().value())
        .u8(frame.id().is_extended().into())
        .u8((frame.kind() == FrameKind::Remote).into())
        .u8(frame.is_fd().into())
        .u8((frame.kind() == FrameKind::FdBitRateSwitch).into())
        .u8(frame.length() as u8)
        .octet_sequence(frame.payload())
        .string(&format!("{frame:?}"));
}

/// Encodes a [`JOURNAL`].
pub fn encode_journal(block: &[u8], encoder: &mut CdrEncoder) {
    encoder.begin().octet_sequence(block);
}

/// Encodes a [`BUS`].
pub fn encode_bus(TracedHealth { at_ns, health }: &TracedHealth, encoder: &mut CdrEncoder) {
    encoder
        .begin()
        .u64(*at_ns)
        .u8(health.state as u8)
        .u64(health.errors)
        .u64(health.tx_overruns)
        .u64(health.rx_overruns)
        .u64(health.tx_frames)
        .u64(health.rx_frames)
        .u64(health.busy_ns);
}

/// Encodes a time of day as `builtin_interfaces/Time`.
fn put_time(unix_ns: Nanoseconds, encoder: &mut CdrEncoder) -> &mut CdrEncoder {
    encoder.i32((unix_ns / NANOSECONDS_PER_SECOND) as i32).u32((unix_ns % NANOSECONDS_PER_SECOND) as u32)
}

/// Encodes a [`JOINT_STATE`] of these axes, each with its name.
pub fn encode_joint_state(unix_ns: Nanoseconds, axes: &[(&str, &AxisRecord)], encoder: &mut CdrEncoder) {
    put_time(unix_ns, encoder.begin()).string("").u32(axes.len() as u32);
    axes.iter().for_each(|(name, _)| {
        encoder.string(name);
    });
    let quantities: [fn(&AxisRecord) -> f64; 3] =
        [|axis| axis.position, |axis| axis.velocity.into(), |axis| axis.torque.into()];
    for quantity in quantities {
        encoder.u32(axes.len() as u32);
        axes.iter().for_each(|(_, axis)| {
            encoder.f64(quantity(axis));
        });
    }
}

/// Encodes a [`LOG`] of an event, told by `name`.
pub fn encode_log(unix_ns: Nanoseconds, kind: &EventKind, name: &str, text: &str, encoder: &mut CdrEncoder) {
    let level = match Severity::of(kind) {
        Severity::Debug => 10,
        Severity::Info => 20,
        Severity::Warning => 30,
        Severity::Error => 40,
    };
    put_time(unix_ns, encoder.begin()).u8(level).string(name).string(text).string("").string("").u32(0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::{
        DriveState, Fault, OperationMode, Origin, Phase, RejectReason, RequestError, RequestId, RequestKind,
        Rule, StopCategory, StopCause, StopReason, StreamState, TimingLevel,
    };

    /// The constants of a definition that stand in front of `field`, with the names as Rust writes them.
    fn constants(message: &MessageType, field: &str) -> Vec<(String, u8)> {
        let mut constants = Vec::new();
        for line in message.definition.lines().filter(|line| !line.starts_with('#')) {
            match line.split_once(' ') {
                Some((_, name)) if name == field => return constants,
                Some(("uint8", constant)) if constant.contains('=') => {
                    let (name, number) = constant.split_once('=').unwrap();
                    let camel = name.split('_').map(|word| {
                        let (first, rest) = word.split_at(1);
                        first.to_owned() + &rest.to_lowercase()
                    });
                    constants.push((camel.collect(), number.parse().unwrap()));
                }
                _ => constants.clear(),
            }
        }
        panic!("{} has no field {field}", message.name);
    }

    #[test]
    fn definitions_that_lack_only_the_later_fields_can_be_read() {
        let earlier = |missing: usize| {
            let fields = layout(EVENT.definition);
            fields[..fields.len() - missing].join("\n")
        };
        assert!([0, 1, 2, 4].iter().all(|missing| EVENT.can_be_read_as(&earlier(*missing))));
        assert!(!EVENT.can_be_read_as(&earlier(3)) && !EVENT.can_be_read_as(&earlier(5)));
        assert!(!EVENT.can_be_read_as(&(earlier(0) + "\nuint8 another")));
        assert!(EVENT.can_be_read_as(&EVENT.definition.replace("uint8 reason", "uint8 objection")));
        let other = earlier(4).replace("uint64 slot", "uint32 slot");
        assert!(!EVENT.can_be_read_as(&other) && !CYCLE.can_be_read_as(""));
    }

    #[test]
    fn the_constants_in_the_schemas_are_those_of_the_records() {
        let phases = Phase::ALL.map(|phase| (format!("{phase:?}"), phase as u8));
        assert_eq!(constants(&CYCLE, "phase"), phases);
        assert_eq!(constants(&GROUP, "phase"), phases);
        let states = DriveState::ALL.map(|state| (format!("{state:?}"), state as u8));
        assert_eq!(constants(&AXIS, "state"), states);
        assert_eq!(
            constants(&BUS, "state"),
            decode::BUS_STATES.map(|state| (format!("{state:?}"), state as u8))
        );
        let rules = Rule::ALL.map(|rule| (format!("{rule:?}"), rule as u8));
        assert_eq!(constants(&EVENT, "rule"), rules);
        let requests = RequestKind::ALL.map(|request| (format!("Request{request:?}"), request as u8));
        assert_eq!(constants(&EVENT, "request"), requests);
        let reasons: Vec<_> = RejectReason::all()
            .map(|reason| {
                let debug = format!("{reason:?}");
                (format!("Reason{}", debug.split(' ').next().unwrap()), reason.number())
            })
            .collect();
        assert_eq!(constants(&EVENT, "reason"), reasons);
    }

    #[test]
    fn the_constants_of_the_event_kinds_are_those_that_are_encoded() {
        let kinds = [
            EventKind::PhaseChanged { from: Phase::Passive, to: Phase::Disabled },
            EventKind::Stop(StopReason {
                category: StopCategory::One,
                cause: StopCause::Fault(Fault::DriveFault { error_code: 0 }),
                origin: Origin::Axis(3),
                slot: 0,
                phase: Phase::Moving,
            }),
            EventKind::MotionFinished { request: RequestId(1) },
            EventKind::DriveState { axis: 0, state: DriveState::NotReadyToSwitchOn, statusword: 0 },
            EventKind::Emergency { axis: 0, code: 0, register: 0, manufacturer: [0; 5] },
            EventKind::MissedSlots { count: 1 },
            EventKind::Rejected(RequestError {
                request: RequestKind::Move,
                reason: RejectReason::Phase,
                axis: None,
                phase: Phase::Moving,
            }),
            EventKind::Timing { level: TimingLevel::Normal },
            EventKind::Stream { state: StreamState::Dry },
            EventKind::Mode { axis: 0, mode: OperationMode::CyclicSynchronousVelocity },
        ];
        let encoded = kinds.map(|kind| {
            let name = format!("{kind:?}");
            let name = name.split([' ', '(']).next().unwrap().to_owned();
            (name, EventFields::of(&kind).kind)
        });
        assert_eq!(constants(&EVENT, "kind"), encoded);
    }
}
