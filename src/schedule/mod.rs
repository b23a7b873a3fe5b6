//! Whether the buses can carry what a configuration asks of them, in the worst case, before anything moves.
//!
//! Two questions are answered for each bus. How long can any message take, with everything else queued at the worst
//! moment (`response_time`)? And does the slot hold: all feedback there before the command phase, all set-points
//! sent before the next SYNC (`slot`)? The second decides about process data, since their moments in the slot are
//! known; the first about all else.
//!
//! Emergency messages are not part of the sums. A drive that sends one has stopped obeying or is about to, the group
//! stops, and one such frame does no harm: feedback that misses the command phase is one missed cycle of the several
//! that `missed_feedback_cycles` allows, and set-points that are pushed beyond the slot are sent before the SYNC that
//! then leaves late. To demand room for an emergency in every slot would cost every third drive its place on a bus at
//! 1 ms. What one does to a slot is shown beside the regular case ([`EmergencyEffect`]).
//!
//! The sums are those of a punctual controller, and what they leave is shown as its reserve; a fit with less than
//! [`WAKE_UP_RESERVE_NS`] (and [`COMPUTE_RESERVE_NS`] before the set-points) is called narrow, not refused, since what
//! is enough depends on the machine: `takt jitter` measures it.

mod bound;
mod command_phase;
mod loading;
mod messages;
mod remedy;
#[doc(hidden)]
pub mod response_time;
mod send_phase;
mod slot;
#[doc(hidden)]
pub mod text;

use serde::Serialize;
use thiserror::Error;

use crate::config::{Axis, Config, Cycle, Protocol};
use crate::family;
use bound::Traffic;
use messages::BusMessage;

pub use command_phase::{NoCommandPhase, automatic_command_phase};
pub use messages::MessageKind;
pub use remedy::Remedy;
pub use send_phase::send_phase_ns;
pub use slot::Slot;
pub(crate) use takt_wire::frame_time::{BitRates, worst_case_bits};

/// The result of the analysis of one bus. Times are in ns.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
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
    /// What one emergency message does to that slot; `None` on a bus without drives.
    pub emergency: Option<EmergencyEffect>,
    /// What does not fit; empty when all does.
    pub shortfalls: Vec<Shortfall>,
    /// What would make it fit; empty when it does.
    pub remedies: Vec<Remedy>,
}

impl BusSchedule {
    /// Returns `true` if the bus carries everything in time.
    pub fn fits(&self) -> bool {
        self.shortfalls.is_empty()
    }

    /// Returns `true` if it fits with less reserve than a controller can be expected to need.
    pub fn is_narrow(&self) -> bool {
        let is_sync_narrow = self.slot.sync_reserve_ns < WAKE_UP_RESERVE_NS;
        let is_rest_narrow = self.slot.set_points_reserve_ns < WAKE_UP_RESERVE_NS + COMPUTE_RESERVE_NS;
        self.fits() && (is_sync_narrow || is_rest_narrow)
    }
}

/// The wake-up latency that a slot should allow for: somewhat more than the worst of a PREEMPT_RT kernel on a machine
/// that is set up for it.
pub const WAKE_UP_RESERVE_NS: u64 = 20_000;
/// What a slot should allow for between the second wake-up and the set-points in the queue: receiving, computing and
/// the system calls.
pub const COMPUTE_RESERVE_NS: u64 = 20_000;

/// What one emergency message does to the worst slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct EmergencyEffect {
    /// How long it is on the wire.
    pub transmission_ns: u64,
    /// By how much feedback can then miss the command phase; 0 where it is still in time.
    pub feedback_late_ns: u64,
    /// By how much the next SYNC can then be late, behind the last of what was queued before it; 0 where it is not.
    pub next_sync_late_ns: u64,
}

impl EmergencyEffect {
    /// Returns `true` if it finds room in the slot.
    pub fn fits(self) -> bool {
        self.feedback_late_ns == 0 && self.next_sync_late_ns == 0
    }

    fn on(slot: &Slot, command_phase_ns: u64) -> Option<Self> {
        let transmission_ns = slot.emergency_ns;
        (transmission_ns > 0).then(|| Self {
            transmission_ns,
            feedback_late_ns: (slot.feedback_done_ns + transmission_ns).saturating_sub(command_phase_ns),
            next_sync_late_ns: (slot.held_ns + transmission_ns).saturating_sub(slot.set_points_reserve_ns),
        })
    }
}

/// The result of the analysis of one message. Times are in ns.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
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
    /// True if it is sent while the axes are enabled, and counted.
    pub is_sent_while_enabled: bool,
    /// The longest time from the event that queues it until it has been received; `None` where there is no bound, or
    /// where it is not sent while the axes are enabled.
    pub response_ns: Option<u64>,
    /// The latest moment, counted from the start of the slot, at which it has arrived; `None` where it is not tied to
    /// a moment in the slot.
    pub in_slot_ns: Option<u64>,
    /// What `in_slot_ns`, or the response time where that is `None`, must not exceed; `None` where being late does no
    /// harm.
    pub deadline_ns: Option<u64>,
}

/// Something that does not fit. Times are in ns.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", tag = "what")]
#[non_exhaustive]
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
    /// Replies of drives of bit fields can arrive after the next requests have been made.
    RepliesLate {
        /// When all of them have arrived, counted from the start of the slot of their requests.
        done_ns: u64,
        /// When they must have: at the command phase of the next slot.
        next_command_phase_ns: u64,
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
    let cycle = config.bus_cycle(index);
    let rates = bit_rates(config, index);
    let all = messages::messages(config, index);
    let enabled = while_enabled(&all, config, index);
    let slot = worst_slot(config, index, &enabled).held(send_phase::held_ns(config));
    let is_queue_empty_at_sync = slot.is_queue_empty_at_sync;
    let response_ns = |at: usize| {
        let (messages, place) = beside(&enabled, at);
        Traffic { messages: &messages, is_queue_empty_at_sync, rates }.response_time(place)
    };
    let messages: Vec<MessageSchedule> = all
        .iter()
        .map(|message| {
            let bits = worst_case_bits(message.shape);
            let at = enabled.iter().position(|other| std::ptr::eq(*other, message));
            let (in_slot_ns, deadline_ns) = in_slot(message, &enabled, &slot, cycle, rates);
            MessageSchedule {
                kind: message.kind,
                axis: message.axis.and_then(|axis| config.axes.get(axis)).map(|axis| axis.name.clone()),
                id: message.id.value(),
                length: message.shape.length,
                bits: bits.nominal + bits.data,
                period_ns: message.period_ns,
                jitter_ns: message.jitter_ns,
                transmission_ns: rates.duration_ns(bits),
                is_sent_while_enabled: at.is_some(),
                response_ns: at.and_then(response_ns),
                in_slot_ns,
                deadline_ns,
            }
        })
        .collect();
    BusSchedule {
        name: bus.map(|bus| bus.name.clone()).unwrap_or_default(),
        bit_rate: rates.nominal,
        period_ns: cycle.period_ns,
        command_phase_ns: cycle.command_phase_ns,
        load_percent: load_percent(&messages) + line_load_percent(config, index),
        shortfalls: shortfalls(&messages, &slot, cycle),
        messages,
        slot,
        emergency: EmergencyEffect::on(&slot, cycle.command_phase_ns),
        remedies: vec![],
    }
}

fn bit_rates(config: &Config, bus: usize) -> BitRates {
    let bus = config.buses.get(bus);
    let nominal = bus.map_or(0, |bus| bus.bit_rate);
    BitRates { nominal, data: bus.and_then(|bus| bus.data_bit_rate).unwrap_or(nominal) }
}

/// Those of the messages of a bus that are sent while the axes are enabled.
fn while_enabled<'a>(all: &'a [BusMessage], config: &Config, bus: usize) -> Vec<&'a BusMessage> {
    let allows_sdo = config.buses.get(bus).is_some_and(|bus| bus.sdo_while_enabled);
    all.iter().filter(|message| allows_sdo || !message.kind.is_sdo()).collect()
}

/// The worst slot of a bus with these messages, whose set-points leave as soon as they are made.
fn worst_slot(config: &Config, bus: usize, enabled: &[&BusMessage]) -> Slot {
    let cycles = config.buses.get(bus).map_or(1, |bus| u64::from(bus.divider.max(1)));
    let is_timed = |axis: &&Axis| axis.bus == bus && axis.drive.protocol != Protocol::BitFields;
    let timed = config.axes.iter().filter(is_timed);
    let feedback_delay_ns = timed.map(|axis| axis.feedback_delay_ns).max().unwrap_or(0);
    slot::worst_slot(enabled, feedback_delay_ns, config.bus_cycle(bus), cycles, bit_rates(config, bus))
}

/// When a message has arrived in the slot, if it has a moment there, and when it must have.
fn in_slot(
    message: &BusMessage,
    all: &[&BusMessage],
    slot: &Slot,
    cycle: Cycle,
    rates: BitRates,
) -> (Option<u64>, Option<u64>) {
    match message.kind {
        // Its lateness is part of the feedback's.
        MessageKind::Sync => (Some(slot.wait_before_sync_ns + slot.sync_ns), None),
        MessageKind::Feedback => (Some(slot.feedback_done_ns), Some(cycle.command_phase_ns)),
        MessageKind::SetPoint => {
            let counts = |kind| matches!(kind, MessageKind::SetPoint | MessageKind::Answer);
            let up_to = all.iter().filter(|other| counts(other.kind) && other.axis <= message.axis);
            let sent_ns: u64 = up_to.map(|other| rates.duration_ns(worst_case_bits(other.shape))).sum();
            let done_ns = cycle.command_phase_ns + slot.held_ns + slot.wait_before_set_points_ns + sent_ns;
            (Some(done_ns), Some(cycle.period_ns))
        }
        MessageKind::Answer => (Some(slot.set_points_done_ns), Some(cycle.period_ns)),
        MessageKind::Reply => (Some(slot.replies_done_ns), Some(cycle.period_ns + cycle.command_phase_ns)),
        _ => (None, message.deadline_ns),
    }
}

fn load_percent(messages: &[MessageSchedule]) -> f64 {
    messages
        .iter()
        .filter(|message| message.is_sent_while_enabled && message.kind != MessageKind::Emergency)
        .map(|message| 100.0 * message.transmission_ns as f64 / message.period_ns as f64)
        .sum()
}

/// The share of the time that bytes are on a serial line; 0 for a CAN bus.
fn line_load_percent(config: &Config, bus: usize) -> f64 {
    let on_line = config.axes_of_bus(bus).filter(|axis| axis.drive.protocol.is_of_serial_line());
    let budgets = on_line.filter_map(|axis| family::of(&axis.drive).off_cycle_budget(axis, config));
    100.0 * budgets.map(|budget| budget.bus_share).sum::<f64>()
}

fn shortfalls(messages: &[MessageSchedule], slot: &Slot, cycle: Cycle) -> Vec<Shortfall> {
    let (period_ns, command_phase_ns) = (cycle.period_ns, cycle.command_phase_ns);
    let feedback = (slot.feedback_done_ns > command_phase_ns)
        .then_some(Shortfall::FeedbackLate { done_ns: slot.feedback_done_ns, command_phase_ns });
    let set_points = (slot.set_points_done_ns > period_ns)
        .then_some(Shortfall::SetPointsLate { done_ns: slot.set_points_done_ns, period_ns });
    let next_command_phase_ns = period_ns + command_phase_ns;
    let replies = (slot.replies_done_ns > next_command_phase_ns)
        .then_some(Shortfall::RepliesLate { done_ns: slot.replies_done_ns, next_command_phase_ns });
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
    feedback.into_iter().chain(set_points).chain(replies).chain(others).collect()
}

/// The messages that count for the response time of one message, and the place of that message among them. An emergency
/// message is analysed as the only one of its kind; all others are analysed without emergency messages.
fn beside<'a>(all: &[&'a BusMessage], at: usize) -> (Vec<&'a BusMessage>, usize) {
    let counts = |index: usize, message: &BusMessage| index == at || message.kind != MessageKind::Emergency;
    let counted = || all.iter().enumerate().filter(|(index, message)| counts(*index, message));
    let place = counted().take_while(|(index, _)| *index < at).count();
    (counted().map(|(_, message)| *message).collect(), place)
}
