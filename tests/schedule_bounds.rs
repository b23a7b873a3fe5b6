//! The bounds against a bus: no simulated response is ever later than its bound, and constructed cases come close.

use std::collections::VecDeque;

use proptest::prelude::*;
use takt::bus::schedule::{self, BusSchedule, Message, MessageKind, response_time};
use takt::config::Config;

/// A frame that waits.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    priority: u32,
    queued_ns: u64,
    length_ns: u64,
}

/// A frame that has been sent.
#[derive(Clone, Copy, Debug)]
struct Sent {
    priority: u32,
    queued_ns: u64,
    done_ns: u64,
}

/// Sends messages that are queued at these times, each under its own priority, and gives what was sent when.
fn arbitrate(mut waiting: Vec<Waiting>) -> Vec<Sent> {
    waiting.sort_by_key(|frame| frame.queued_ns);
    let (mut now_ns, mut sent) = (0, vec![]);
    while !waiting.is_empty() {
        let earliest = waiting[0].queued_ns;
        now_ns = now_ns.max(earliest);
        let candidates = waiting.iter().enumerate().take_while(|(_, frame)| frame.queued_ns <= now_ns);
        let (winner, _) = candidates.min_by_key(|(_, frame)| (frame.priority, frame.queued_ns)).unwrap();
        let frame = waiting.remove(winner);
        now_ns += frame.length_ns;
        sent.push(Sent { priority: frame.priority, queued_ns: frame.queued_ns, done_ns: now_ns });
    }
    sent
}

/// Every instance of the messages within a window, the first of each queued at its offset.
fn instances(messages: &[Message], offsets_ns: &[u64], window_ns: u64) -> Vec<Waiting> {
    let mut waiting = vec![];
    for ((message, &offset), priority) in messages.iter().zip(offsets_ns).zip(0..) {
        waiting.extend((0..window_ns / message.period_ns).map(|instance| Waiting {
            priority,
            queued_ns: offset + instance * message.period_ns,
            length_ns: message.transmission_ns,
        }));
    }
    waiting
}

fn longest_response(sent: &[Sent], priority: u32) -> u64 {
    let of = sent.iter().filter(|frame| frame.priority == priority);
    of.map(|frame| frame.done_ns - frame.queued_ns).max().unwrap_or(0)
}

const BIT_NS: u64 = 1_000;

proptest! {
    #[test]
    fn no_simulated_response_exceeds_its_bound(
        set in prop::collection::vec((2u64..20, 50u64..140, 0u64..10_000), 2..8),
    ) {
        let messages: Vec<_> = set.iter()
            .map(|(period, length, _)| Message {
                period_ns: period * 100_000, jitter_ns: 0, transmission_ns: length * 1_000,
            })
            .collect();
        let offsets: Vec<_> = set.iter().map(|(_, _, offset)| offset * 100).collect();
        let sent = arbitrate(instances(&messages, &offsets, 40_000_000));
        for index in 0..messages.len() {
            if let Some(bound) = response_time(&messages, index, BIT_NS) {
                let longest = longest_response(&sent, index as u32);
                prop_assert!(longest <= bound, "message {index}: {longest} > {bound}");
            }
        }
    }

    /// Everything of higher priority queued at once, just after the longest lower message has won the bus.
    #[test]
    fn the_worst_moment_comes_within_15_percent_of_the_bound(
        set in prop::collection::vec((8u64..40, 50u64..140), 2..8),
    ) {
        let messages: Vec<_> = set.iter()
            .map(|(period, length)| Message {
                period_ns: period * 100_000, jitter_ns: 0, transmission_ns: length * 1_000,
            })
            .collect();
        for index in 0..messages.len() {
            let Some(bound) = response_time(&messages, index, BIT_NS) else { continue };
            let blocker = (index + 1..messages.len()).max_by_key(|&lower| messages[lower].transmission_ns);
            let offsets: Vec<_> = (0..messages.len()).map(|at| u64::from(Some(at) != blocker)).collect();
            // Of the lower messages only the one that blocks, and once.
            let waiting: Vec<_> = instances(&messages, &offsets, 60_000_000).into_iter()
                .filter(|frame| frame.priority as usize <= index
                    || (Some(frame.priority as usize) == blocker && frame.queued_ns == 0))
                .collect();
            let longest = longest_response(&arbitrate(waiting), index as u32);
            prop_assert!(longest <= bound && longest as f64 >= 0.85 * bound as f64, "{index}: {longest} of {bound}");
        }
    }
}

/// What happens in a slot of a bus: the controller's queue is first in, first out; a drive's own frames go by
/// priority; feedback is queued a delay after SYNC has been sent.
struct SlotSimulation<'a> {
    schedule: &'a BusSchedule,
    /// The controller's frames: when queued, priority, length, kind.
    ours: VecDeque<(Waiting, MessageKind)>,
    drives: Vec<(Waiting, MessageKind)>,
    now_ns: u64,
}

/// The latest arrivals after the start of their slots.
#[derive(Default)]
struct Latest {
    feedback_ns: u64,
    set_points_ns: u64,
}

impl SlotSimulation<'_> {
    /// Runs so many slots. `heartbeats` are the moments at which those of the drives, and the slots in which that of
    /// the controller are queued.
    fn run(
        mut self,
        slots: u64,
        drive_heartbeats: &[(u32, u64)],
        our_heartbeat_slot: u64,
        delays: &[u64],
    ) -> Latest {
        let mut latest = Latest::default();
        let (period, phase) = (self.schedule.period_ns, self.schedule.command_phase_ns);
        for &(priority, queued_ns) in drive_heartbeats {
            let frame = Waiting { priority, queued_ns, length_ns: 65_000 };
            self.drives.push((frame, MessageKind::DriveHeartbeat));
        }
        for slot in 0..slots {
            let start = slot * period;
            self.queue(MessageKind::Sync, start);
            self.queue(MessageKind::SetPoint, start + phase);
            if slot == our_heartbeat_slot {
                self.queue(MessageKind::MasterHeartbeat, start + phase);
            }
        }
        while let Some((frame, kind)) = self.next() {
            self.now_ns = self.now_ns.max(frame.queued_ns) + frame.length_ns;
            let slot_start = frame.queued_ns / period * period;
            match kind {
                MessageKind::Sync => self.answer_sync(delays),
                MessageKind::Feedback => {
                    // Feedback belongs to the slot of its SYNC, which has only just been sent.
                    latest.feedback_ns = latest.feedback_ns.max(self.now_ns - slot_start);
                }
                MessageKind::SetPoint => {
                    latest.set_points_ns = latest.set_points_ns.max(self.now_ns - slot_start);
                }
                _ => {}
            }
        }
        latest
    }

    fn frames(&self, kind: MessageKind) -> Vec<(u32, u64)> {
        let of_kind = self.schedule.messages.iter().filter(|message| message.kind == kind);
        of_kind.map(|message| (message.id, message.transmission_ns)).collect()
    }

    fn queue(&mut self, kind: MessageKind, queued_ns: u64) {
        for (priority, length_ns) in self.frames(kind) {
            self.ours.push_back((Waiting { priority, queued_ns, length_ns }, kind));
        }
    }

    fn answer_sync(&mut self, delays: &[u64]) {
        for ((priority, length_ns), delay) in
            self.frames(MessageKind::Feedback).into_iter().zip(delays.iter().cycle())
        {
            let queued_ns = self.now_ns + delay;
            self.drives.push((Waiting { priority, queued_ns, length_ns }, MessageKind::Feedback));
        }
    }

    /// The frame that wins the bus next.
    fn next(&mut self) -> Option<(Waiting, MessageKind)> {
        let head = self.ours.front().copied();
        let earliest = head.iter().chain(&self.drives).map(|(frame, _)| frame.queued_ns).min()?;
        let now = self.now_ns.max(earliest);
        let drive = self.drives.iter().enumerate().filter(|(_, (frame, _))| frame.queued_ns <= now);
        let best =
            drive.min_by_key(|(_, (frame, _))| frame.priority).map(|(at, (frame, _))| (at, frame.priority));
        match (head.filter(|(frame, _)| frame.queued_ns <= now), best) {
            (Some((ours, _)), Some((at, priority))) if priority < ours.priority => {
                Some(self.drives.swap_remove(at))
            }
            (Some(_), _) => self.ours.pop_front(),
            (None, Some((at, _))) => Some(self.drives.swap_remove(at)),
            (None, None) => None,
        }
    }
}

fn erobs(axes: usize, mode: &str, heartbeat: &str, command_phase: f64) -> BusSchedule {
    let limits = "limits = { position = [-1, 1], velocity = 1, acceleration = 1, torque = 1 }";
    let axis = |node: usize| {
        format!(
            "[[axis]]\nname = \"a{node}\"\nbus = \"b\"\nnode = {node}\ndrive = \"erob-canopen\"\nmode = \"{mode}\"\n\
             heartbeat = \"{heartbeat}\"\n{limits}\n"
        )
    };
    let axes: String = (1..=axes).map(axis).collect();
    let text =
        format!("name = \"n\"\n[cycle]\ncommand_phase = {command_phase}\n[[bus]]\nname = \"b\"\n{axes}");
    schedule::analyse(&Config::parse("erobs.toml", &text).unwrap()).remove(0)
}

fn simulate(schedule: &BusSchedule, heartbeats_ns: &[u64], our_slot: u64, delays_ns: &[u64]) -> Latest {
    let ids: Vec<_> =
        schedule.messages.iter().filter(|m| m.kind == MessageKind::DriveHeartbeat).map(|m| m.id).collect();
    let heartbeats: Vec<_> = ids.into_iter().zip(heartbeats_ns.iter().copied()).collect();
    SlotSimulation { schedule, ours: VecDeque::new(), drives: vec![], now_ns: 0 }.run(
        4,
        &heartbeats,
        our_slot,
        delays_ns,
    )
}

proptest! {
    /// Heartbeats at any moment of the first slots, drives as slow as they may be: when the analysis says that the
    /// slot holds, it does, and its arrivals are not later than the bounds.
    #[test]
    fn no_simulated_slot_is_worse_than_the_worst_slot(
        axes in 1usize..=3, mode in prop::sample::select(vec!["csp", "cst"]), has_heartbeats: bool,
        phase in 0.4f64..0.7, heartbeats in prop::collection::vec(0u64..3_000_000, 3), our_slot in 0u64..3,
        delays in prop::collection::vec(0u64..=20_000, 3),
    ) {
        let schedule = erobs(axes, mode, if has_heartbeats { "100 ms" } else { "off" }, phase);
        if schedule.fits() {
            let latest = simulate(&schedule, &heartbeats, our_slot, &delays);
            prop_assert!(latest.feedback_ns <= schedule.slot.feedback_done_ns);
            prop_assert!(latest.set_points_ns <= schedule.slot.set_points_done_ns);
        }
    }
}

/// A drive's heartbeat wins the bus just before SYNC is due, another one while the drives prepare their feedback, and
/// a third one just before the command phase.
#[test]
fn a_constructed_slot_comes_within_15_percent_of_the_worst() {
    let schedule = erobs(2, "csp", "100 ms", 0.55);
    assert!(schedule.fits());
    let feedback = simulate(&schedule, &[999_999, 1_000_000 + 64_999 + 55_000 + 10_000], 3, &[20_000]);
    let bound = schedule.slot.feedback_done_ns as f64;
    assert!(feedback.feedback_ns as f64 >= 0.85 * bound, "{} of {bound}", feedback.feedback_ns);
    let set_points = simulate(&schedule, &[549_999], 3, &[20_000]);
    let bound = schedule.slot.set_points_done_ns as f64;
    assert!(set_points.set_points_ns as f64 >= 0.85 * bound, "{} of {bound}", set_points.set_points_ns);
}
