//! When, within a slot, what has arrived in the worst case.
//!
//! The response-time analysis lets everything be queued at the worst moment. In a slot the moments are known: SYNC at
//! its start, feedback when the drives have heard SYNC, set-points at the command phase, one after the other from a
//! queue. What remains unknown is when the background comes: heartbeats, and SDO frames where they are allowed. A
//! frame on the wire cannot be interrupted, so each of the three can find one of the background in its way; and the
//! controller's own background frames that have not left by the end of a slot stand in its queue before the next SYNC.

use serde::Serialize;

use super::messages::{BusMessage, MessageKind};
use crate::bus::frame_time::{BitRates, worst_case_bits};
use crate::config::Cycle;

/// The worst slot of a bus. All times are counted from the start of the slot or are lengths, in ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Slot {
    /// What SYNC may have to wait for.
    pub wait_before_sync_ns: u64,
    /// SYNC itself.
    pub sync_ns: u64,
    /// The longest time that a drive takes to have its feedback ready.
    pub feedback_delay_ns: u64,
    /// What may get onto the wire before the feedback.
    pub wait_before_feedback_ns: u64,
    /// All feedback frames together.
    pub feedback_ns: u64,
    /// When all feedback has arrived.
    pub feedback_done_ns: u64,
    /// What the first set-point may have to wait for.
    pub wait_before_set_points_ns: u64,
    /// All set-point frames together.
    pub set_points_ns: u64,
    /// When all set-points have been sent.
    pub set_points_done_ns: u64,
    /// What one emergency message delays all this by.
    pub emergency_ns: u64,
    /// SYNC, feedback and set-points alone.
    pub process_data_ns: u64,
    /// The command phases, from the earliest to the latest, at which feedback and set-points are in time; `None` if
    /// there is none.
    pub command_phases_ns: Option<(u64, u64)>,
}

/// What is sent beside the process data within one slot, at the most.
struct Background {
    /// The longest frame, and the next longest.
    longest_ns: u64,
    second_ns: u64,
    /// The longest that a drive sends.
    longest_of_drives_ns: u64,
    all_ns: u64,
    has_ours: bool,
}

impl Background {
    fn of(messages: &[&BusMessage], service_frames: usize, period_ns: u64, rates: BitRates) -> Self {
        let frames = |is_ours: bool| -> Vec<u64> {
            let mut frames: Vec<u64> = messages
                .iter()
                .filter(|message| message.kind.is_background() && message.kind.is_ours() == is_ours)
                .flat_map(|message| {
                    let instances = (period_ns + message.jitter_ns).div_ceil(message.period_ns);
                    (0..instances).map(|_| time(message, rates))
                })
                .collect();
            frames.sort_unstable_by(|a, b| b.cmp(a));
            frames
        };
        let (ours, drives) = (frames(true), frames(false));
        let ours = ours.get(..service_frames).unwrap_or(&ours);
        let mut both = [ours, &drives].concat();
        both.sort_unstable_by(|a, b| b.cmp(a));
        let at = |frames: &[u64], at: usize| frames.get(at).copied().unwrap_or(0);
        Self {
            longest_ns: at(&both, 0),
            second_ns: at(&both, 1),
            longest_of_drives_ns: at(&drives, 0),
            all_ns: both.iter().sum(),
            has_ours: !ours.is_empty(),
        }
    }
}

fn time(message: &BusMessage, rates: BitRates) -> u64 {
    rates.duration_ns(worst_case_bits(message.shape))
}

/// The worst slot, given the messages that are sent while the axes are enabled, and how many service frames the
/// controller may send in one cycle.
pub(super) fn worst_slot(
    messages: &[&BusMessage],
    feedback_delay_ns: u64,
    service_frames: usize,
    cycle: Cycle,
    rates: BitRates,
) -> Slot {
    let times = |selects: &dyn Fn(&BusMessage) -> bool| -> Vec<u64> {
        messages.iter().filter(|message| selects(message)).map(|message| time(message, rates)).collect()
    };
    let total = |kind| times(&|message| message.kind == kind).iter().sum::<u64>();
    let (sync_ns, feedback_ns) = (total(MessageKind::Sync), total(MessageKind::Feedback));
    let set_points_ns = total(MessageKind::SetPoint);
    let emergency_ns =
        times(&|message| message.kind == MessageKind::Emergency).into_iter().max().unwrap_or(0);
    let background = Background::of(messages, service_frames, cycle.period_ns, rates);

    // Feedback that comes on events of the drives has precedence over set-points by its identifier.
    let asynchronous = times(&|message| message.kind == MessageKind::Feedback && message.is_asynchronous);
    let asynchronous_ns: u64 = asynchronous.iter().sum();
    let wait_before_set_points_ns = background.longest_of_drives_ns + asynchronous_ns;

    // What is sent after the set-points leaves before the next SYNC up to this command phase. Then SYNC and feedback
    // meet the end of one frame each at most. Later, our own frames may stand in the queue before SYNC and wait
    // there for all of the others.
    let phase_before_end = |rest_ns: u64| cycle.period_ns.checked_sub(rest_ns);
    let latest_for_empty_queue = if background.has_ours {
        phase_before_end(set_points_ns + asynchronous_ns + background.all_ns)
    } else {
        Some(cycle.period_ns)
    };
    let is_queue_empty = latest_for_empty_queue.is_some_and(|latest| cycle.command_phase_ns <= latest);
    let waits = |is_queue_empty: bool| {
        if is_queue_empty { (background.longest_ns, background.second_ns) } else { (background.all_ns, 0) }
    };
    let feedback_done = |(before_sync_ns, before_feedback_ns): (u64, u64)| {
        before_sync_ns + sync_ns + feedback_delay_ns + before_feedback_ns + feedback_ns
    };
    let latest = phase_before_end(wait_before_set_points_ns + set_points_ns);
    let phases = |is_queue_empty: bool, latest: Option<u64>| {
        let earliest = feedback_done(waits(is_queue_empty));
        latest.filter(|latest| earliest <= *latest).map(|latest| (earliest, latest))
    };

    let (wait_before_sync_ns, wait_before_feedback_ns) = waits(is_queue_empty);
    Slot {
        wait_before_sync_ns,
        sync_ns,
        feedback_delay_ns,
        wait_before_feedback_ns,
        feedback_ns,
        feedback_done_ns: feedback_done((wait_before_sync_ns, wait_before_feedback_ns)),
        wait_before_set_points_ns,
        set_points_ns,
        set_points_done_ns: cycle.command_phase_ns + wait_before_set_points_ns + set_points_ns,
        emergency_ns,
        process_data_ns: sync_ns + feedback_ns + set_points_ns,
        command_phases_ns: phases(true, latest.min(latest_for_empty_queue)).or_else(|| phases(false, latest)),
    }
}
