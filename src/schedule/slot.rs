//! When, within a slot, what has arrived in the worst case.
//!
//! The response-time analysis lets everything be queued at the worst moment. In a slot the moments are known: SYNC at
//! its start, feedback when the drives have heard SYNC, set-points at the command phase, one after the other from a
//! queue. What remains unknown is when the background comes: heartbeats, and SDO frames where they are allowed. A
//! frame on the wire cannot be interrupted, so each of the three can have to wait for one background frame.
//!
//! The controller's own background frames follow its set-points in the same queue. Where the command phase leaves
//! room for all of them before the next SYNC, that SYNC and the feedback meet background frames of the drives alone;
//! where it does not, they stand in the queue before SYNC and wait there for everything else.
//!
//! A drive of bit fields replies to each request, some time after it: mostly in the next slot. Its replies are due when the next requests are
//! made. They may meet SYNC and feedback, which then wait for them.
//!
//! The sums are those of a punctual controller. What is left of the slot is its reserve: for SYNC that leaves late,
//! and for waking up, computing and handing over the set-points. Within it everything
//! is in time.

use serde::Serialize;
use takt_wire::frame_time::{BitRates, worst_case_bits};

use super::messages::{BusMessage, MessageKind, bit_rates};
use crate::config::{Axis, Config, Cycle, Protocol};

/// The worst slot of a bus. All times are counted from the start of the slot or are lengths, in ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
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
    /// How long after the beginning of the command phase the set-points are held, so that they leave at the same moment of every slot; 0
    /// where they leave as soon as they are made.
    pub held_ns: u64,
    /// What the first set-point may have to wait for.
    pub wait_before_set_points_ns: u64,
    /// All set-point frames together.
    pub set_points_ns: u64,
    /// When all set-points have been sent.
    pub set_points_done_ns: u64,
    /// The longest time that a drive of bit fields takes to have its reply ready.
    pub reply_delay_ns: u64,
    /// All replies of drives of bit fields together.
    pub replies_ns: u64,
    /// When all of them have arrived, which is after the end of the slot. They must be there before the command phase of the next one;
    /// 0 without such drives.
    pub replies_done_ns: u64,
    /// The longest emergency message: what one of them delays all this by.
    pub emergency_ns: u64,
    /// SYNC, feedback and set-points alone.
    pub process_data_ns: u64,
    /// How late SYNC may leave with the feedback still in time: for the latency of the first wake-up and for the
    /// SYNCs of other buses before it. 0 where the feedback is late anyway.
    pub sync_reserve_ns: u64,
    /// How late after the command phase the set-points may be handed over: for the latency of the second wake-up and for
    /// computing, which the time that they are held is a part of. 0 where the set-points are late anyway.
    pub set_points_reserve_ns: u64,
    /// The earliest command phase at which the feedback is in time.
    pub earliest_command_phase_ns: u64,
    /// What may have to be sent between the command phase and the next SYNC.
    pub after_command_phase_ns: u64,
    /// The command phases, from the earliest to the latest, at which feedback and set-points are in time; `None` if
    /// there is none.
    pub command_phases_ns: Option<(u64, u64)>,
    /// True if everything that the controller has queued in a slot leaves before the next SYNC.
    pub is_queue_empty_at_sync: bool,
}

impl Slot {
    /// The same slot with set-points that are held for so long.
    pub(super) fn held(self, held_ns: u64) -> Self {
        let replies_done_ns = if self.replies_ns > 0 { self.replies_done_ns + held_ns } else { 0 };
        Self { held_ns, set_points_done_ns: self.set_points_done_ns + held_ns, replies_done_ns, ..self }
    }
}

/// What is sent beside the process data within one slot, at the most.
struct Background {
    /// The longest frame of a drive, and the next longest.
    longest_ns: u64,
    second_ns: u64,
    all_ns: u64,
    has_ours: bool,
}

impl Background {
    /// Of a slot that is so many cycles of the controller long.
    fn of(messages: &[&BusMessage], period_ns: u64, cycles: u64, rates: BitRates) -> Self {
        let frames = |is_ours: bool| -> Vec<u64> {
            let of_sender = messages
                .iter()
                .filter(|message| message.kind.is_background() && message.kind.is_ours() == is_ours);
            let instances = |message: &BusMessage| {
                let instances = (period_ns + message.jitter_ns).div_ceil(message.period_ns);
                (0..instances).map(|_| time(message, rates)).collect::<Vec<u64>>()
            };
            let (guarding, others): (Vec<&BusMessage>, Vec<&BusMessage>) =
                of_sender.partition(|message| message.kind.is_guarding());
            // One request in each cycle of the controller; one more reply, which may belong to the slot before.
            let guard_frames = usize::try_from(cycles).unwrap_or(usize::MAX) + usize::from(!is_ours);
            let mut guard_times: Vec<u64> = guarding.into_iter().flat_map(instances).collect();
            guard_times.sort_unstable_by(|a, b| b.cmp(a));
            guard_times.truncate(guard_frames);
            let mut frames: Vec<u64> = others.into_iter().flat_map(instances).chain(guard_times).collect();
            frames.sort_unstable_by(|a, b| b.cmp(a));
            frames
        };
        let drives = frames(false);
        let ours_ns: u64 = frames(true).iter().sum();
        let at = |at: usize| drives.get(at).copied().unwrap_or(0);
        Self {
            longest_ns: at(0),
            second_ns: at(1),
            all_ns: ours_ns + drives.iter().sum::<u64>(),
            has_ours: ours_ns > 0,
        }
    }
}

fn time(message: &BusMessage, rates: BitRates) -> u64 {
    rates.duration_ns(worst_case_bits(message.shape))
}

/// What decides when things arrive, depending on whether the controller's queue is empty at SYNC.
#[derive(Clone, Copy)]
struct Timeline {
    before_sync_ns: u64,
    before_feedback_ns: u64,
    /// The command phase at which the feedback is just in time.
    earliest_ns: u64,
    /// What must be sent between the command phase and the next SYNC.
    rest_ns: u64,
}

impl Timeline {
    fn phases_ns(self, period_ns: u64) -> Option<(u64, u64)> {
        let latest_ns = period_ns.checked_sub(self.rest_ns)?;
        (self.earliest_ns <= latest_ns).then_some((self.earliest_ns, latest_ns))
    }
}

/// The replies of drives of bit fields.
struct Replies {
    all_ns: u64,
    /// The longest time from a request until its reply is ready.
    delay_ns: u64,
    /// What may get onto the wire between the requests.
    between_requests_ns: u64,
    /// From when the last reply is ready until it has arrived.
    last_ns: u64,
}

impl Replies {
    /// A reply that is no longer than a request is gone before the next one is ready: requests come no closer after each other than they
    /// are long. Where replies are longer than that, or come while requests are still being sent, all of them may be before the last.
    fn of(messages: &[&BusMessage], requests_ns: u64, rates: BitRates) -> Self {
        let of_kind = |kind| messages.iter().filter(move |message| message.kind == kind);
        let times: Vec<u64> = of_kind(MessageKind::Reply).map(|message| time(message, rates)).collect();
        let (all_ns, longest_ns) = (times.iter().sum(), times.iter().copied().max().unwrap_or(0));
        let delays = || of_kind(MessageKind::Reply).map(|message| message.jitter_ns);
        let shortest_request_ns =
            of_kind(MessageKind::SetPoint).map(|message| time(message, rates)).min().unwrap_or(0);
        let are_between = requests_ns > delays().min().unwrap_or(u64::MAX);
        let are_apart = longest_ns <= shortest_request_ns && !are_between;
        Self {
            all_ns,
            delay_ns: delays().max().unwrap_or(0),
            between_requests_ns: if are_between { all_ns } else { 0 },
            last_ns: if are_apart { longest_ns } else { all_ns },
        }
    }
}

/// The worst slot of a bus with these messages, whose set-points leave as soon as they are made.
pub(super) fn worst_slot(config: &Config, bus: usize, enabled: &[&BusMessage]) -> Slot {
    let cycles = config.buses.get(bus).map_or(1, |bus| u64::from(bus.divider.max(1)));
    let is_timed = |axis: &&Axis| axis.bus == bus && axis.drive.protocol != Protocol::BitFields;
    let timed = config.axes.iter().filter(is_timed);
    let feedback_delay_ns = timed.map(|axis| axis.feedback_delay_ns).max().unwrap_or(0);
    slot_of(enabled, feedback_delay_ns, config.bus_cycle(bus), cycles, bit_rates(config, bus))
}

/// The worst slot, given the messages that are sent while the axes are enabled. It is so many cycles of the controller long.
fn slot_of(
    messages: &[&BusMessage],
    feedback_delay_ns: u64,
    cycle: Cycle,
    cycles: u64,
    rates: BitRates,
) -> Slot {
    let times = |selects: &dyn Fn(&BusMessage) -> bool| -> Vec<u64> {
        messages.iter().filter(|message| selects(message)).map(|message| time(message, rates)).collect()
    };
    let total = |kind| times(&|message| message.kind == kind).iter().sum::<u64>();
    let (sync_ns, feedback_ns) = (total(MessageKind::Sync), total(MessageKind::Feedback));
    // What answers a set-point must be sent in the same time, and has precedence over the set-points behind it.
    let set_points_ns = total(MessageKind::SetPoint) + total(MessageKind::Answer);
    let replies = Replies::of(messages, set_points_ns, rates);
    let emergency_ns =
        times(&|message| message.kind == MessageKind::Emergency).into_iter().max().unwrap_or(0);
    let background = Background::of(messages, cycle.period_ns, cycles, rates);

    // Feedback that comes on events of the drives has precedence over set-points by its identifier.
    let asynchronous = times(&|message| message.kind == MessageKind::Feedback && message.is_asynchronous);
    let asynchronous_ns: u64 = asynchronous.iter().sum();
    let wait_before_set_points_ns = background.longest_ns + asynchronous_ns + replies.between_requests_ns;

    let timeline = |before_sync_ns: u64, before_feedback_ns: u64, rest_ns: u64| Timeline {
        before_sync_ns,
        before_feedback_ns,
        earliest_ns: before_sync_ns + sync_ns + feedback_delay_ns + before_feedback_ns + feedback_ns,
        rest_ns,
    };
    let set_points_rest_ns = wait_before_set_points_ns + set_points_ns;
    let queue_rest_ns = set_points_ns + asynchronous_ns + background.all_ns;
    let empty_rest_ns = if background.has_ours { queue_rest_ns } else { set_points_rest_ns };
    // On a bus without SYNC nothing waits for the replies of the slot before.
    let beside_sync_ns = if sync_ns + feedback_ns > 0 { replies.all_ns } else { 0 };
    let empty_queue = timeline(background.longest_ns + beside_sync_ns, background.second_ns, empty_rest_ns);
    let full_queue = timeline(background.all_ns + beside_sync_ns, 0, set_points_rest_ns);

    let (period_ns, phase_ns) = (cycle.period_ns, cycle.command_phase_ns);
    // Set-points that are queued before all feedback has arrived leave after it.
    let is_queue_empty_at_sync = phase_ns.max(empty_queue.earliest_ns) + empty_rest_ns <= period_ns;
    let actual = if is_queue_empty_at_sync { empty_queue } else { full_queue };
    let (possible, command_phases_ns) =
        match (empty_queue.phases_ns(period_ns), full_queue.phases_ns(period_ns)) {
            (None, Some(phases)) => (full_queue, Some(phases)),
            (phases, _) => (empty_queue, phases),
        };
    Slot {
        wait_before_sync_ns: actual.before_sync_ns,
        sync_ns,
        feedback_delay_ns,
        wait_before_feedback_ns: actual.before_feedback_ns,
        feedback_ns,
        feedback_done_ns: actual.earliest_ns,
        held_ns: 0,
        wait_before_set_points_ns,
        set_points_ns,
        set_points_done_ns: phase_ns + set_points_rest_ns,
        reply_delay_ns: replies.delay_ns,
        replies_ns: replies.all_ns,
        replies_done_ns: match replies.all_ns {
            0 => 0,
            _ => {
                let others_ns = sync_ns + feedback_ns + background.longest_ns;
                phase_ns + set_points_rest_ns + replies.delay_ns + replies.last_ns + others_ns
            }
        },
        emergency_ns,
        process_data_ns: sync_ns + feedback_ns + set_points_ns + replies.all_ns,
        sync_reserve_ns: phase_ns.saturating_sub(actual.earliest_ns),
        set_points_reserve_ns: period_ns.saturating_sub(phase_ns + actual.rest_ns),
        earliest_command_phase_ns: possible.earliest_ns,
        after_command_phase_ns: possible.rest_ns,
        command_phases_ns,
        is_queue_empty_at_sync,
    }
}
