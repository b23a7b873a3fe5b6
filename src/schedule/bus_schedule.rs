//! What the analysis says of a bus.

use serde::Serialize;

use super::messages::MessageKind;
use super::slot::Slot;
use crate::config::Feedback;

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

    pub(super) fn on(slot: &Slot, command_phase_ns: u64) -> Option<Self> {
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

/// One change that makes a bus fit without any other.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", tag = "change")]
#[non_exhaustive]
pub enum Remedy {
    /// Another command phase, within this range.
    CommandPhase {
        /// The earliest.
        earliest_ns: u64,
        /// The latest.
        latest_ns: u64,
    },
    /// Fewer service frames in a cycle.
    ServiceFrames {
        /// How many fit.
        frames: usize,
    },
    /// No SDO transfers while the axes are enabled.
    SdoWhileDisabled,
    /// No heartbeats of the drives; their feedback shows that they are alive.
    DriveHeartbeatsOff,
    /// No time of day.
    TimeOff,
    /// Command frames that several axes share.
    SharedCommandFrames,
    /// No answers to SYNC: the drives' answers to set-points are feedback enough, a cycle older.
    NoAnswersToSync,
    /// Less feedback.
    SmallerFeedback {
        /// What to leave out: as few objects as possible, and the smallest of them.
        without: Vec<Feedback>,
    },
    /// No heartbeat of the controller, by which drives notice that it has died.
    MasterHeartbeatOff,
    /// Fewer axes on this bus.
    MoreBuses {
        /// How many of its axes share a bus then, at the most.
        axes_per_bus: usize,
        /// How many buses that makes of this one.
        buses: usize,
    },
    /// A longer cycle.
    LongerPeriod {
        /// The period.
        period_ns: u64,
    },
}
