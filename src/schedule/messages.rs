//! Every message that a configuration puts on a bus.

use std::collections::HashSet;

use serde::Serialize;
use takt_rt::{FrameFormat, FrameKind, Id, TIME_ID, TransmissionType, transparent};
use takt_wire::bit_fields::{DescribedLifeCycle, FieldDevice, ReplyMoment};
use takt_wire::canopen::function_code;
use takt_wire::frame_time::{BitRates, FrameShape};

use crate::config::Interface;
use crate::config::{Axis, Config, Master, Protocol, Supervision};
use crate::family::bring_up::{PdoPlan, ProcessData, Reply};

/// What a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum MessageKind {
    /// SYNC of the controller (CiA 301, 7.2.5).
    Sync,
    /// Emergency of a drive (7.2.7).
    Emergency,
    /// TPDO of a drive.
    Feedback,
    /// RPDO of a drive.
    SetPoint,
    /// TPDO with which a drive answers a set-point at once.
    Answer,
    /// Reply of a drive of bit fields to the request of the cycle, some time after it.
    Reply,
    /// Answer of a drive's SDO server.
    SdoResponse,
    /// Request of the controller's SDO client.
    SdoRequest,
    /// Answer of a drive that speaks a protocol of its own, beside the cycle.
    OwnReply,
    /// Request of the controller in such a protocol.
    OwnRequest,
    /// Heartbeat of a drive (7.2.8).
    DriveHeartbeat,
    /// Request of the controller for the state of a drive: node guarding.
    GuardRequest,
    /// Reply of a drive to that.
    GuardReply,
    /// Heartbeat of the controller.
    MasterHeartbeat,
    /// TIME of the controller (7.2.6).
    Time,
}

impl MessageKind {
    /// Sent besides the process data. What drives send of it is less important by its identifier; the controller's own
    /// follows its set-points in one queue, so that TIME, whose identifier is more important, is none the sooner for it.
    pub(super) fn is_background(self) -> bool {
        match self {
            Self::SdoResponse
            | Self::SdoRequest
            | Self::OwnReply
            | Self::OwnRequest
            | Self::DriveHeartbeat
            | Self::GuardRequest
            | Self::GuardReply
            | Self::MasterHeartbeat
            | Self::Time => true,
            Self::Sync | Self::Emergency | Self::Feedback | Self::SetPoint | Self::Answer | Self::Reply => {
                false
            }
        }
    }

    /// Sent by the controller, so that it stands in the controller's own queue.
    pub(super) fn is_ours(self) -> bool {
        matches!(
            self,
            Self::Sync
                | Self::SetPoint
                | Self::SdoRequest
                | Self::OwnRequest
                | Self::GuardRequest
                | Self::MasterHeartbeat
                | Self::Time
        )
    }

    /// Request or reply of node guarding: the controller sends one request on a bus in each of its cycles at most.
    pub(super) fn is_guarding(self) -> bool {
        matches!(self, Self::GuardRequest | Self::GuardReply)
    }

    pub(super) fn is_sdo(self) -> bool {
        matches!(self, Self::SdoResponse | Self::SdoRequest)
    }
}

/// A message before it is analysed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct BusMessage {
    pub kind: MessageKind,
    /// The index of the axis that sends or is sent to.
    pub axis: Option<usize>,
    pub id: Id,
    pub shape: FrameShape,
    /// Shortest time between two.
    pub period_ns: u64,
    /// How much later than its period it may be queued.
    pub jitter_ns: u64,
    /// The deadline after it was queued; `None` where being late does no harm, or where the slot sets the deadline.
    pub deadline_ns: Option<u64>,
    /// True if the drive sends it on its own events instead of at SYNC.
    pub is_asynchronous: bool,
}

/// Shortest time between two emergency messages: the first one stops the group, so that a later one disturbs nothing.
const EMERGENCY_INTERVAL_NS: u64 = 1_000_000_000;

/// Frames of bit fields with a meaning of their own.
const FIXED_BYTES: usize = 8;
/// A start bit, eight bits, a stop bit.
const LINE_BITS_PER_BYTE: u64 = 10;
const SERVICE_BYTES: usize = 8;
const EMERGENCY_BYTES: usize = 8;
const HEARTBEAT_BYTES: usize = 1;
const TIME_BYTES: usize = 6;
/// Transmission types above this are sent on events of the drive (CiA 301, 7.5.2.38).
const LAST_SYNCHRONOUS_TYPE: u8 = 240;

/// The messages of a bus by priority, highest first.
pub(super) fn messages(config: &Config, bus_index: usize) -> Vec<BusMessage> {
    // A serial line has none.
    let Some(bus) = config.buses.get(bus_index).filter(|_| !config.is_serial_line(bus_index)) else {
        return vec![];
    };
    let period_ns = config.bus_cycle(bus_index).period_ns;
    let axes = || config.axes.iter().enumerate().filter(|(_, axis)| axis.bus == bus_index);
    // What CANopen sends to all nodes is sent where there are nodes.
    let is_node = |(_, axis): (usize, &Axis)| axis.drive.protocol == Protocol::Canopen;
    let is_canopen = axes().next().is_none() || axes().any(is_node);
    let sync = || message(MessageKind::Sync, None, Id::canopen(0x080, 0), 0, period_ns);
    let mut messages: Vec<BusMessage> = is_canopen.then(sync).into_iter().collect();
    let Master { node, heartbeat_ns, time_ns, .. } = config.master;
    let (heartbeat_ns, time_ns) = (heartbeat_ns.filter(|_| is_canopen), time_ns.filter(|_| is_canopen));
    let heartbeat = heartbeat_ns.map(|period_ns| {
        message(
            MessageKind::MasterHeartbeat,
            None,
            Id::canopen(function_code::ERROR_CONTROL, node),
            HEARTBEAT_BYTES,
            period_ns,
        )
    });
    let time = time_ns.map(|period_ns| message(MessageKind::Time, None, TIME_ID, TIME_BYTES, period_ns));
    // They are sent in a cycle of the controller, so up to one cycle late.
    let own = heartbeat.into_iter().chain(time);
    messages.extend(own.map(|message| BusMessage { jitter_ns: config.cycle.period_ns, ..message }));
    let is_guarded = |axis: &Axis| matches!(axis.supervision(&config.master), Supervision::Guarding { .. });
    // What a node sends for all of its axes counts once, with the first of them.
    let nodes = || {
        axes().filter(|(_, axis)| axis.drive.protocol != Protocol::BitFields).filter(|(index, axis)| {
            let is_its = |(_, other): &(usize, &Axis)| other.node == axis.node;
            axes().find(is_its).is_some_and(|(first, _)| first == *index)
        })
    };
    let guarded = nodes().filter(|(_, axis)| is_guarded(axis)).count();
    for (index, axis) in axes() {
        messages.extend(axis_messages(index, axis, config, period_ns));
    }
    for (index, axis) in nodes() {
        messages.extend(emergency(index, axis));
        messages.extend(error_control(index, axis, config, guarded));
    }
    // Drives with a protocol of their own are spoken to while they are enabled, too.
    let has_own = |(_, axis): &(usize, &Axis)| axis.drive.protocol.own_identifiers().is_some();
    let served = nodes().filter(has_own).chain(nodes().filter(|node| !has_own(node)));
    messages.extend(
        served
            .take(bus.service_frames_per_cycle)
            .flat_map(|(i, axis)| service(i, axis, config.cycle.period_ns)),
    );
    // A frame that axes share counts once, with the first of them.
    let mut set_points = HashSet::new();
    messages.retain(|message| message.kind != MessageKind::SetPoint || set_points.insert(message.id));
    messages.sort_by_key(|message| message.id.arbitration_key());
    messages
}

/// The bit rates of a bus.
pub(super) fn bit_rates(config: &Config, bus: usize) -> BitRates {
    let bus = config.buses.get(bus);
    let nominal = bus.map_or(0, |bus| bus.bit_rate);
    BitRates { nominal, data: bus.and_then(|bus| bus.data_bit_rate).unwrap_or(nominal) }
}

/// Those of the messages of a bus that are sent while the axes are enabled.
pub(super) fn while_enabled<'a>(all: &'a [BusMessage], config: &Config, bus: usize) -> Vec<&'a BusMessage> {
    let allows_sdo = config.buses.get(bus).is_some_and(|bus| bus.sdo_while_enabled);
    all.iter().filter(|message| allows_sdo || !message.kind.is_sdo()).collect()
}

fn message(kind: MessageKind, axis: Option<usize>, id: Id, length: usize, period_ns: u64) -> BusMessage {
    BusMessage {
        kind,
        axis,
        id,
        shape: FrameShape::classic(length),
        period_ns,
        jitter_ns: 0,
        deadline_ns: kind.is_background().then_some(period_ns),
        is_asynchronous: false,
    }
}

fn axis_messages(index: usize, axis: &Axis, config: &Config, period_ns: u64) -> Vec<BusMessage> {
    if let Some(device) = axis.drive.description() {
        let line_ns = config.buses.get(axis.bus).map_or(0, |bus| line_ns(&bus.interface));
        return field_messages(index, axis, device, period_ns, line_ns);
    }
    let data = ProcessData::of(axis, config);
    let of_axis =
        |kind, pdo: &PdoPlan, period_ns| message(kind, Some(index), pdo.id, pdo.length(), period_ns);
    let mut messages = vec![];
    messages.extend(data.feedback.iter().map(|pdo| {
        let is_asynchronous = pdo.transmission_type > LAST_SYNCHRONOUS_TYPE;
        let answers_set_points = pdo.reply != Reply::No && is_asynchronous;
        // Which SYNCs a drive answers that answers every second one cannot be known: the slot counts its feedback
        // always.
        let syncs = if is_asynchronous { 1 } else { u64::from(pdo.transmission_type.max(1)) };
        let kind = if answers_set_points { MessageKind::Answer } else { MessageKind::Feedback };
        BusMessage {
            jitter_ns: axis.feedback_delay_ns,
            is_asynchronous: is_asynchronous && !answers_set_points,
            ..of_axis(kind, pdo, syncs * period_ns)
        }
    }));
    messages.extend(data.answer().map(|pdo| BusMessage {
        jitter_ns: axis.feedback_delay_ns,
        ..of_axis(MessageKind::Answer, pdo, period_ns)
    }));
    // A controlword that is sent when it changes goes to one axis in a cycle while they are enabled, and the group
    // stands still then: its delay does no harm, and it is not part of the sums.
    let every_cycle = data.commands.iter().filter(|pdo| pdo.transmission == TransmissionType::EveryCycle);
    messages.extend(every_cycle.map(|pdo| of_axis(MessageKind::SetPoint, pdo, period_ns)));
    messages
}

/// How long a request and its reply are on the line of a converter: ten bits for each byte of their blocks. Over a bus it is no time.
fn line_ns(interface: &Interface) -> u64 {
    let Interface::Converter(line) = interface else { return 0 };
    let bits = 2 * transparent::FRAME_BYTES as u64 * LINE_BITS_PER_BYTE;
    bits * 1_000_000_000 / u64::from(line.baud_rate.max(1))
}

/// The request of each cycle to a drive of bit fields, and what it sends. A frame of its own in place of a command is no longer than that.
///
/// Behind a converter the reply is late by the time that both are on its line, `line_ns`.
fn field_messages(
    index: usize,
    axis: &Axis,
    device: &FieldDevice,
    period_ns: u64,
    line_ns: u64,
) -> Vec<BusMessage> {
    let (command, reply) = (&device.description.command, &device.description.reply);
    let shape = |format: FrameFormat, id: Id, length| FrameShape {
        kind: device.format(format).kind(),
        is_extended: id.is_extended(),
        length,
    };
    let (id, reply_id) = (device.id(&command.id, axis.node), device.reply_id(axis.node));
    let request = BusMessage {
        shape: shape(command.format, id, longest_request(device)),
        ..message(MessageKind::SetPoint, Some(index), id, command.bytes, period_ns)
    };
    let (kind, reply_ns, delay_ns) = match device.description.reply_moment {
        ReplyMoment::AfterCommand { delay_ns } => (MessageKind::Reply, period_ns, delay_ns),
        ReplyMoment::Cyclic { period_ns } => (MessageKind::Feedback, period_ns, 0),
    };
    let delay_ns = delay_ns.saturating_add(line_ns);
    let reply = BusMessage {
        shape: shape(reply.format, reply_id, reply.bytes),
        jitter_ns: delay_ns,
        is_asynchronous: kind == MessageKind::Feedback,
        ..message(kind, Some(index), reply_id, reply.bytes, reply_ns)
    };
    let heartbeat = device.description.heartbeat.map(|heartbeat| {
        let (id, kind) = (device.id(&heartbeat.id, axis.node), MessageKind::DriveHeartbeat);
        message(kind, Some(index), id, heartbeat.bytes, heartbeat.period_ns)
    });
    [request, reply].into_iter().chain(heartbeat).collect()
}

/// The length of the longest frame that may be the request of a cycle.
fn longest_request(device: &FieldDevice) -> usize {
    let bytes = device.description.command.bytes;
    match device.description.life_cycle {
        DescribedLifeCycle::ByFields(_) => bytes,
        DescribedLifeCycle::ByFrames(_) => bytes.max(FIXED_BYTES),
    }
}

fn emergency(index: usize, axis: &Axis) -> Option<BusMessage> {
    let (id, kind) = (Id::canopen(0x080, axis.node), MessageKind::Emergency);
    axis.drive
        .sends_emergencies
        .then(|| message(kind, Some(index), id, EMERGENCY_BYTES, EMERGENCY_INTERVAL_NS))
}

/// Heartbeats of a drive, or the requests and replies of node guarding. A request is sent in a cycle of the controller, and may
/// wait there for those to the other nodes, one in each cycle.
fn error_control(index: usize, axis: &Axis, config: &Config, guarded: usize) -> Vec<BusMessage> {
    let id = Id::canopen(function_code::ERROR_CONTROL, axis.node);
    let of_axis = |kind, period_ns| message(kind, Some(index), id, HEARTBEAT_BYTES, period_ns);
    match axis.supervision(&config.master) {
        Supervision::Feedback => vec![],
        Supervision::Heartbeat { period_ns } => vec![of_axis(MessageKind::DriveHeartbeat, period_ns)],
        Supervision::Guarding { guard_time_ns, .. } => {
            let jitter_ns = config.cycle.period_ns.saturating_mul(guarded as u64);
            let request = of_axis(MessageKind::GuardRequest, guard_time_ns);
            let shape = FrameShape { kind: FrameKind::Remote, ..request.shape };
            let reply = of_axis(MessageKind::GuardReply, guard_time_ns);
            vec![BusMessage { jitter_ns, shape, ..request }, BusMessage { jitter_ns, ..reply }]
        }
    }
}

/// Requests and replies beside the cycle: those of SDO, or of the drive's own protocol, whose frames are no longer.
///
/// One transfer at a time for each node, at most one request in a cycle for each service frame that the bus allows;
/// the controller's heartbeat comes in addition.
/// A drive answers after 0.3 to 1 ms, so two of its answers may follow each other more closely than a cycle.
fn service(index: usize, axis: &Axis, period_ns: u64) -> [BusMessage; 2] {
    let node = axis.node;
    let [(request, request_id), (reply, reply_id)] = match axis.drive.protocol.own_identifiers() {
        Some(own) => {
            [(MessageKind::OwnRequest, own.request_id(node)), (MessageKind::OwnReply, own.reply_id(node))]
        }
        None => [
            (MessageKind::SdoRequest, Id::canopen(function_code::SDO_REQUEST, node)),
            (MessageKind::SdoResponse, Id::canopen(function_code::SDO_RESPONSE, node)),
        ],
    };
    let request = message(request, Some(index), request_id, SERVICE_BYTES, period_ns);
    let response = message(reply, Some(index), reply_id, SERVICE_BYTES, period_ns);
    [
        BusMessage { deadline_ns: None, ..request },
        BusMessage { deadline_ns: None, jitter_ns: period_ns, ..response },
    ]
}
