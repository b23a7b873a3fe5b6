//! Decodes the messages of a recording.

use takt_rt::{
    AxisRecord, BusHealth, BusState, CycleRecord, CycleTiming, DriveState, EventKind, Frame, GroupRecord, Id,
    OperationMode, Origin, Phase, RecordedStop, RejectReason, RequestError, RequestId, RequestKind, Rule,
    StopCategory, StopCause, StopReason, StreamState, TimingLevel,
};

use super::EventFields;
use crate::link::trace::{TracedFrame, TracedHealth};
use crate::telemetry::cdr::CdrDecoder;
use crate::telemetry::recorded::RecordedEvent;

/// Decodes a [`CYCLE`](super::CYCLE), without its axes.
pub fn decode_cycle(message: &[u8]) -> Option<CycleRecord> {
    let mut fields = CdrDecoder::begin(message)?;
    let timing = CycleTiming {
        slot: fields.u64()?,
        slot_start_ns: fields.u64()?,
        wake_ns: fields.u64()?,
        sync_ns: fields.u64()?,
        compute_ns: fields.u64()?,
        sent_ns: fields.u64()?,
        missed_slots: fields.u64()?,
    };
    let (phase, is_commanded) = (phase(fields.u8()?)?, fields.u8()? != 0);
    let mut record = CycleRecord { timing, is_commanded, ..CycleRecord::default() };
    // Recordings of earlier versions have no messages of the groups.
    record.groups[0].phase = phase;
    Some(record)
}

/// Decodes a [`GROUP`](super::GROUP), with its slot.
pub fn decode_group(message: &[u8]) -> Option<(u64, GroupRecord)> {
    let mut fields = CdrDecoder::begin(message)?;
    let (slot, phase) = (fields.u64()?, phase(fields.u8()?)?);
    let (is_stopped, category, rule) = (fields.u8()? != 0, fields.u8()?, fields.u8()?);
    let stop = match is_stopped {
        true => Some(RecordedStop { category: stop_category(category)?, rule: stop_rule(rule)? }),
        false => None,
    };
    let (is_called, callback_ns) = (fields.u8()? != 0, fields.u64()?);
    Some((slot, GroupRecord { phase, stop, callback_ns: is_called.then_some(callback_ns) }))
}

/// Decodes an [`AXIS`](super::AXIS), with its slot.
pub fn decode_axis(message: &[u8]) -> Option<(u64, AxisRecord)> {
    let mut fields = CdrDecoder::begin(message)?;
    let slot = fields.u64()?;
    let mut axis = AxisRecord {
        position_set: fields.f64()?,
        position: fields.f64()?,
        velocity_set: fields.f32()?,
        acceleration_set: fields.f32()?,
        jerk_set: fields.f32()?,
        velocity: fields.f32()?,
        torque_set: fields.f32()?,
        torque: fields.f32()?,
        following_error: fields.f32()?,
        command_raw: fields.i32()?,
        position_raw: fields.i32()?,
        controlword: fields.u16()?,
        statusword: fields.u16()?,
        error_code: fields.u16()?,
        feedback_age: fields.u16()?,
        ..AxisRecord::default()
    };
    axis.drive_state = drive_state(fields.u8()?)?;
    Some((slot, axis))
}

/// Decodes an [`EVENT`](super::EVENT).
pub fn decode_event(message: &[u8]) -> Option<RecordedEvent> {
    let mut fields = CdrDecoder::begin(message)?;
    let (slot, at_ns, kind, text) = (fields.u64()?, fields.u64()?, fields.u8()?, fields.string()?);
    let of_kind = EventFields {
        kind,
        axis: u8::try_from(fields.i16()?).ok(),
        phase_from: fields.u8()?,
        phase_to: fields.u8()?,
        category: fields.u8()?,
        rule: fields.u8()?,
        value: fields.f64()?,
        limit: fields.f64()?,
        move_id: fields.u32()?,
        missed_slots: fields.u64()?,
        timing_level: fields.u8()?,
        drive_state: fields.u8()?,
        statusword: fields.u16()?,
        error_code: fields.u16()?,
        error_register: fields.u8()?,
        manufacturer: fields.octets()?,
        refusal: match fields.u8() {
            Some(request) => Some((request, fields.u8()?)),
            None => None,
        },
        bus: if fields.is_over() { None } else { u8::try_from(fields.i16()?).ok() },
    };
    let group = if fields.is_over() { None } else { u8::try_from(fields.i16()?).ok() };
    Some(RecordedEvent { slot, at_ns, group, text, kind: of_kind.kind(slot) })
}

/// Decodes a [`FRAME`](super::FRAME).
pub fn decode_frame(message: &[u8]) -> Option<TracedFrame> {
    let mut fields = CdrDecoder::begin(message)?;
    let (at_ns, is_sent, id) = (fields.u64()?, fields.u8()? != 0, fields.u32()?);
    let id = if fields.u8()? != 0 { Id::extended(id) } else { Id::base(id) }.ok()?;
    let (is_remote, is_fd, has_switch) = (fields.u8()? != 0, fields.u8()? != 0, fields.u8()? != 0);
    let length = fields.u8()?;
    let data = fields.octet_sequence()?;
    let frame = match (is_remote, is_fd) {
        (true, _) => Frame::remote(id, length),
        (false, true) => Frame::fd(id, data, has_switch),
        (false, false) => Frame::data(id, data),
    };
    Some(TracedFrame { at_ns, is_sent, frame: frame.ok()? })
}

/// Decodes a [`JOURNAL`](super::JOURNAL).
pub fn decode_journal(message: &[u8]) -> Option<&[u8]> {
    CdrDecoder::begin(message)?.octet_sequence()
}

/// Decodes a [`BUS`](super::BUS).
pub fn decode_bus(message: &[u8]) -> Option<TracedHealth> {
    let mut fields = CdrDecoder::begin(message)?;
    let at_ns = fields.u64()?;
    let state = *BUS_STATES.get(usize::from(fields.u8()?))?;
    let health = BusHealth {
        state,
        errors: fields.u64()?,
        tx_overruns: fields.u64()?,
        rx_overruns: fields.u64()?,
        tx_frames: fields.u64()?,
        rx_frames: fields.u64()?,
        // Recordings of earlier versions do not have it.
        busy_ns: fields.u64().unwrap_or(0),
    };
    Some(TracedHealth { at_ns, health })
}

pub(super) const BUS_STATES: [BusState; 4] =
    [BusState::ErrorActive, BusState::ErrorPassive, BusState::BusOff, BusState::Down];
const CATEGORIES: [StopCategory; 3] = [StopCategory::Zero, StopCategory::One, StopCategory::Two];

fn drive_state(number: u8) -> Option<DriveState> {
    DriveState::ALL.get(usize::from(number)).copied()
}

fn stop_category(number: u8) -> Option<StopCategory> {
    CATEGORIES.get(usize::from(number)).copied()
}

fn stop_rule(number: u8) -> Option<Rule> {
    Rule::ALL.get(usize::from(number)).copied()
}

fn phase(number: u8) -> Option<Phase> {
    Phase::ALL.get(usize::from(number)).copied()
}

impl EventFields {
    fn origin(&self) -> Origin {
        match (self.axis, self.bus) {
            (Some(axis), _) => Origin::Axis(axis),
            (None, Some(bus)) => Origin::Bus(bus),
            (None, None) => Origin::Group,
        }
    }

    /// The event with these fields, if this version knows its kind.
    fn kind(&self, slot: u64) -> Option<EventKind> {
        Some(match self.kind {
            0 => EventKind::PhaseChanged { from: phase(self.phase_from)?, to: phase(self.phase_to)? },
            1 => EventKind::Stop(StopReason {
                category: stop_category(self.category)?,
                cause: StopCause::from_numbers(stop_rule(self.rule)?, self.value, self.limit)?,
                origin: self.origin(),
                slot,
                phase: phase(self.phase_from)?,
            }),
            2 => EventKind::MotionFinished { request: RequestId(self.move_id.into()) },
            3 => EventKind::DriveState {
                axis: self.axis?,
                state: drive_state(self.drive_state)?,
                statusword: self.statusword,
            },
            4 => EventKind::Emergency {
                axis: self.axis?,
                code: self.error_code,
                register: self.error_register,
                manufacturer: self.manufacturer,
            },
            5 => EventKind::MissedSlots { count: self.missed_slots },
            6 => EventKind::Rejected(RequestError {
                request: *RequestKind::ALL.get(usize::from(self.refusal?.0))?,
                reason: RejectReason::from_numbers(self.refusal?.1, self.value, self.limit)?,
                axis: self.axis,
                phase: phase(self.phase_from)?,
            }),
            7 => EventKind::Timing { level: *TimingLevel::ALL.get(usize::from(self.timing_level))? },
            8 => EventKind::Stream { state: *StreamState::ALL.get(self.value as usize)? },
            9 => EventKind::Mode { axis: self.axis?, mode: OperationMode::from_number(self.value as i8)? },
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::telemetry::cdr::CdrEncoder;
    use crate::telemetry::messages::{encode_event, encode_group};
    use takt_rt::{Event, Fault};

    const STOP: StopReason = StopReason {
        category: StopCategory::Two,
        cause: StopCause::Fault(Fault::FollowingError { error: 0.25, limit: -1.5 }),
        origin: Origin::Axis(3),
        slot: 77,
        phase: Phase::Streaming,
    };

    const REFUSAL: RequestError = RequestError {
        request: RequestKind::Move,
        reason: RejectReason::NoRoomToStop { rest: 3.25, limit: 3.0 },
        axis: Some(2),
        phase: Phase::Holding,
    };

    /// The last six bytes are two for the rejection, two for the bus, and two for the group.
    #[test]
    fn an_event_of_an_earlier_version_is_read_without_its_later_fields() {
        let of_a_bus = StopReason { origin: Origin::Bus(1), ..STOP };
        let of_no_bus = StopReason { origin: Origin::Group, ..STOP };
        for (kind, without_bus, without_both) in [
            (EventKind::Rejected(REFUSAL), Some(EventKind::Rejected(REFUSAL)), None),
            (EventKind::Stop(of_a_bus), Some(EventKind::Stop(of_no_bus)), Some(EventKind::Stop(of_no_bus))),
        ] {
            let mut encoder = CdrEncoder::default();
            encode_event(&Event { slot: 77, at_ns: 88, group: Some(1), kind }, "in words", &mut encoder);
            for (missing, kind) in [(2, Some(kind)), (4, without_bus), (6, without_both)] {
                let earlier = decode_event(&encoder.bytes()[..encoder.bytes().len() - missing]);
                let expected =
                    RecordedEvent { slot: 77, at_ns: 88, group: None, text: "in words".to_owned(), kind };
                assert_eq!(earlier, Some(expected), "{missing} bytes less");
            }
        }
    }

    #[test]
    fn a_group_is_read_as_it_was_written() {
        let mut encoder = CdrEncoder::default();
        let stop = Some(RecordedStop { category: StopCategory::One, rule: Rule::CallbackOverrun });
        for (stop, callback_ns) in [(None, None), (stop, None), (stop, Some(0)), (None, Some(70_000))] {
            let group = GroupRecord { phase: Phase::Streaming, stop, callback_ns };
            encode_group(77, &group, &mut encoder);
            assert_eq!(decode_group(encoder.bytes()), Some((77, group)));
        }
    }

    #[test]
    fn every_kind_of_event_is_read_as_it_was_written() {
        let mut encoder = CdrEncoder::default();
        for kind in [
            EventKind::PhaseChanged { from: Phase::Passive, to: Phase::Disabled },
            EventKind::Stop(STOP),
            EventKind::Stop(StopReason { origin: Origin::Group, ..STOP }),
            EventKind::Stop(StopReason { origin: Origin::Bus(1), ..STOP }),
            EventKind::MotionFinished { request: RequestId(9) },
            EventKind::DriveState { axis: 2, state: DriveState::OperationEnabled, statusword: 0x1637 },
            EventKind::Timing { level: TimingLevel::Degraded },
            EventKind::Mode { axis: 1, mode: OperationMode::CyclicSynchronousTorque },
            EventKind::Emergency { axis: 1, code: 0x7305, register: 0x21, manufacturer: [1, 2, 3, 4, 5] },
            EventKind::MissedSlots { count: 30 },
            EventKind::Stream { state: StreamState::Dry },
            EventKind::Rejected(REFUSAL),
        ] {
            encode_event(&Event { slot: 77, at_ns: 88, group: Some(1), kind }, "in words", &mut encoder);
            let expected = RecordedEvent {
                slot: 77,
                at_ns: 88,
                group: Some(1),
                text: "in words".to_owned(),
                kind: Some(kind),
            };
            assert_eq!(decode_event(encoder.bytes()), Some(expected));
            assert_eq!(decode_event(&encoder.bytes()[..encoder.bytes().len() - 1]), None);
        }
    }
}
