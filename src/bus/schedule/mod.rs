//! Whether the buses can carry what a configuration asks of them, in the worst case, before anything moves.
//!
//! Two questions are answered for each bus. How long can any message take, with everything else queued at the worst
//! moment (`response_time`)? And does the slot hold: all feedback there before the command phase, all set-points
//! sent before the next SYNC (`slot`)? The second decides about process data, since their moments in the slot are
//! known; the first about all else.
//!
//! Emergency messages are not part of the sums: a drive that sends one has stopped obeying, the group stops, and what
//! one such frame delays by a cycle does no harm. The effect of one is shown beside the regular case.

mod messages;
mod remedy;
mod response_time;
mod slot;
pub mod text;

use serde::Serialize;
use thiserror::Error;

use super::frame_time::{BitRates, worst_case_bits};
use crate::config::Config;
use messages::BusMessage;

pub use messages::MessageKind;
pub use remedy::Remedy;
pub use response_time::{Message, response_time};
pub use slot::Slot;

/// What was found out about one bus. Times are in ns.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BusSchedule {
    /// Its name.
    pub name: String,
    /// Its bit rate in bit/s.
    pub bit_rate: u32,
    /// The period of the cycle.
    pub period_ns: u64,
    /// When the command phase begins.
    pub command_phase_ns: u64,
    /// Every message by priority, highest first.
    pub messages: Vec<MessageSchedule>,
    /// Share of the time that the bus is busy in regular operation, with frames of worst-case length.
    pub load_percent: f64,
    /// The worst slot.
    pub slot: Slot,
    /// What does not fit; empty when all does.
    pub shortfalls: Vec<Shortfall>,
    /// What would make it fit; empty when it does.
    pub remedies: Vec<Remedy>,
}

impl BusSchedule {
    /// Whether the bus carries everything in time.
    pub fn fits(&self) -> bool {
        self.shortfalls.is_empty()
    }
}

/// What was found out about one message. Times are in ns.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MessageSchedule {
    /// What it is.
    pub kind: MessageKind,
    /// The axis that sends it or that it is sent to.
    pub axis: Option<String>,
    /// Its identifier; the smaller it is, the more important the message.
    pub id: u32,
    /// Its payload in bytes.
    pub length: usize,
    /// Its longest frame in bits, stuff bits and intermission included.
    pub bits: u32,
    /// Shortest time between two of its kind.
    pub period_ns: u64,
    /// How much later than its period it may be queued.
    pub jitter_ns: u64,
    /// Its longest time on the wire.
    pub transmission_ns: u64,
    /// Whether it is sent while the axes are enabled, and counted.
    pub is_sent_while_enabled: bool,
    /// The longest time from the event that queues it until it has been received; `None` where there is no bound, or
    /// where it is not sent while the axes are enabled.
    pub response_ns: Option<u64>,
    /// The same while one drive sends an emergency message.
    pub response_with_emergency_ns: Option<u64>,
    /// The longest response time that does no harm; `None` where any does none.
    pub deadline_ns: Option<u64>,
}

/// Something that does not fit. Times are in ns.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", tag = "what")]
pub enum Shortfall {
    /// Feedback can arrive after the command phase has begun.
    FeedbackLate {
        /// When all of it has arrived.
        done_ns: u64,
        /// When it must have.
        command_phase_ns: u64,
    },
    /// Set-points can still be waiting when the next SYNC is due.
    SetPointsLate {
        /// When all of them have been sent.
        done_ns: u64,
        /// When they must have been.
        period_ns: u64,
    },
    /// Another message can take longer than it may.
    MessageLate {
        /// What it is.
        kind: MessageKind,
        /// Its axis.
        axis: Option<String>,
        /// How long it can take; `None` where there is no bound.
        response_ns: Option<u64>,
        /// How long it may take.
        deadline_ns: u64,
    },
}

/// Buses that cannot carry what a configuration asks of them. `Display` gives the sums and what would fit.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{}", text::refusal(.buses))]
pub struct ScheduleError {
    /// All buses of the configuration, those that fit too.
    pub buses: Vec<BusSchedule>,
}

/// Analyses every bus, in the order of the configuration.
pub fn analyse(config: &Config) -> Vec<BusSchedule> {
    (0..config.buses.len())
        .map(|index| {
            let mut schedule = analyse_bus(config, index);
            if !schedule.fits() {
                schedule.remedies = remedy::remedies(config, index);
            }
            schedule
        })
        .collect()
}

/// Analyses every bus and refuses a configuration with one that does not fit.
pub fn verify(config: &Config) -> Result<Vec<BusSchedule>, ScheduleError> {
    let buses = analyse(config);
    if buses.iter().all(BusSchedule::fits) { Ok(buses) } else { Err(ScheduleError { buses }) }
}

fn analyse_bus(config: &Config, index: usize) -> BusSchedule {
    let bus = config.buses.get(index);
    let bit_rate = bus.map_or(0, |bus| bus.bit_rate);
    let rates =
        BitRates { nominal: bit_rate, data: bus.and_then(|bus| bus.data_bit_rate).unwrap_or(bit_rate) };
    let allows_sdo = bus.is_some_and(|bus| bus.sdo_while_enabled);
    let all = messages::messages(config, index);
    let is_sent_while_enabled = |message: &BusMessage| allows_sdo || !message.kind.is_sdo();
    let enabled: Vec<&BusMessage> = all.iter().filter(|message| is_sent_while_enabled(message)).collect();

    let feedback_delay_ns = config
        .axes
        .iter()
        .filter(|axis| axis.bus == index)
        .map(|axis| axis.feedback_delay_ns)
        .max()
        .unwrap_or(0);
    let service_frames = bus.map_or(0, |bus| bus.service_frames_per_cycle);
    let slot = slot::worst_slot(&enabled, feedback_delay_ns, service_frames, config.cycle, rates);
    let first_emergency = all.iter().position(|message| message.kind == MessageKind::Emergency);
    let messages: Vec<MessageSchedule> = all
        .iter()
        .enumerate()
        .map(|(at, message)| {
            let bits = worst_case_bits(message.shape);
            MessageSchedule {
                kind: message.kind,
                axis: message.axis.and_then(|axis| config.axes.get(axis)).map(|axis| axis.name.clone()),
                id: message.id.value(),
                length: message.shape.length,
                bits: bits.nominal + bits.data,
                period_ns: message.period_ns,
                jitter_ns: message.jitter_ns,
                transmission_ns: rates.duration_ns(bits),
                is_sent_while_enabled: is_sent_while_enabled(message),
                response_ns: response(&all, at, allows_sdo, None, rates),
                response_with_emergency_ns: response(&all, at, allows_sdo, first_emergency, rates),
                deadline_ns: message.deadline_ns,
            }
        })
        .collect();
    BusSchedule {
        name: bus.map(|bus| bus.name.clone()).unwrap_or_default(),
        bit_rate,
        period_ns: config.cycle.period_ns,
        command_phase_ns: config.cycle.command_phase_ns,
        load_percent: load_percent(&messages),
        shortfalls: shortfalls(&messages, &slot, config),
        messages,
        slot,
        remedies: vec![],
    }
}

fn load_percent(messages: &[MessageSchedule]) -> f64 {
    messages
        .iter()
        .filter(|message| message.is_sent_while_enabled && message.kind != MessageKind::Emergency)
        .map(|message| 100.0 * message.transmission_ns as f64 / message.period_ns as f64)
        .sum()
}

fn shortfalls(messages: &[MessageSchedule], slot: &Slot, config: &Config) -> Vec<Shortfall> {
    let (period_ns, command_phase_ns) = (config.cycle.period_ns, config.cycle.command_phase_ns);
    let feedback = (slot.feedback_done_ns > command_phase_ns)
        .then_some(Shortfall::FeedbackLate { done_ns: slot.feedback_done_ns, command_phase_ns });
    let set_points = (slot.set_points_done_ns > period_ns)
        .then_some(Shortfall::SetPointsLate { done_ns: slot.set_points_done_ns, period_ns });
    let others = messages.iter().filter_map(|message| {
        let deadline_ns = message.deadline_ns.filter(|_| message.kind.is_background())?;
        let is_late = message.response_ns.is_none_or(|response| response > deadline_ns);
        is_late.then(|| Shortfall::MessageLate {
            kind: message.kind,
            axis: message.axis.clone(),
            response_ns: message.response_ns,
            deadline_ns,
        })
    });
    feedback.into_iter().chain(set_points).chain(others).collect()
}

/// The response time of one message among those that are sent while the axes are enabled. An emergency is looked at
/// as the only one of its kind; for the others the one at `emergency` comes in addition.
fn response(
    all: &[BusMessage],
    at: usize,
    allows_sdo: bool,
    emergency: Option<usize>,
    rates: BitRates,
) -> Option<u64> {
    let own = all.get(at)?;
    let is_counted = |index: usize, message: &BusMessage| match message.kind {
        MessageKind::Emergency if own.kind == MessageKind::Emergency => index == at,
        MessageKind::Emergency => emergency == Some(index),
        kind => allows_sdo || !kind.is_sdo(),
    };
    let counted = || all.iter().enumerate().filter(|(index, message)| is_counted(*index, message));
    let set: Vec<Message> = counted()
        .map(|(_, message)| Message {
            period_ns: message.period_ns,
            jitter_ns: message.jitter_ns,
            transmission_ns: rates.duration_ns(worst_case_bits(message.shape)),
        })
        .collect();
    let place = counted().position(|(index, _)| index == at)?;
    response_time(&set, place, rates.bit_ns())
}
