//! Carries trajectories out, at once or at their time.

use std::time::{Duration, Instant};

use takt::rt::{RequestTarget, StopCategory};
use takt::{CommandError, MotionId, TrajectoryPoint};
use takt_remote::Client;

use crate::arrival::{Arrival, Discarded, Stops};
use crate::clock::time_of_day_ns;
use crate::inbox::{Inbox, Taken};
use crate::messages::JointTrajectory;
use crate::motion::{AxisPlace, Unfit, Wanted, wanted};

/// Period of the checks for the end and for stops of others.
pub const LOOK: Duration = Duration::from_millis(100);

/// A message of the topic of the trajectories.
pub enum Message {
    /// Points to carry out.
    Trajectory(JointTrajectory, Arrival),
    /// A trajectory without points.
    Stop {
        /// True if the controller was asked for it on its arrival.
        is_sent: bool,
    },
    /// Not a trajectory.
    Unreadable,
}

/// The thread that carries messages out.
pub struct Carrier<'b> {
    controller: &'b Client,
    axes: &'b [AxisPlace],
    inbox: &'b Inbox<Message>,
    stops: &'b mut Stops,
    tell: &'b dyn Fn(&str),
    later: Vec<Later>,
}

/// A trajectory that waits for its time.
struct Later {
    due: Instant,
    pending: Pending,
}

/// A trajectory that has not begun.
struct Pending {
    group: usize,
    trajectory: JointTrajectory,
    arrival: Arrival,
    /// The stops of the topic that had come before it.
    stops: u64,
}

impl<'b> Carrier<'b> {
    /// Of the messages of an inbox.
    pub fn new(
        controller: &'b Client,
        axes: &'b [AxisPlace],
        inbox: &'b Inbox<Message>,
        stops: &'b mut Stops,
        tell: &'b dyn Fn(&str),
    ) -> Self {
        Self { controller, axes, inbox, stops, tell, later: vec![] }
    }

    /// Carries messages out until `is_over`.
    pub fn run(mut self, is_over: &impl Fn() -> bool) {
        while !is_over() {
            let next =
                self.later.iter().map(|later| later.due.saturating_duration_since(Instant::now())).min();
            match self.inbox.take(next.map_or(LOOK, |next| next.min(LOOK))) {
                Some(Taken { message: Message::Trajectory(trajectory, arrival), stops }) => {
                    self.receive(trajectory, arrival, stops);
                }
                Some(Taken { message: Message::Stop { is_sent }, .. }) => self.finish_stop(is_sent),
                Some(Taken { message: Message::Unreadable, .. }) => self.refuse(&Unfit::NotCdr),
                None => {}
            }
            self.discard();
            let now = Instant::now();
            let due: Vec<Later> = self.later.extract_if(.., |later| later.due <= now).collect();
            due.into_iter().for_each(|later| self.begin(&later.pending));
        }
    }

    /// Begins a trajectory, or lets it wait for its time. It takes the place of those of its group that wait.
    fn receive(&mut self, trajectory: JointTrajectory, arrival: Arrival, stops: u64) {
        let (group, delay) = match self.wanted(&trajectory) {
            Ok(Wanted::Execute { group, delay, .. }) => (group, delay),
            Ok(Wanted::Stop) => return,
            Err(reason) => return self.refuse(&reason),
        };
        self.later.retain(|later| later.pending.group != group);
        if let Err(reason) = arrival.check_ready(group) {
            return self.refuse(&reason);
        }
        let pending = Pending { group, trajectory, arrival, stops };
        if delay.is_zero() { self.begin(&pending) } else { self.wait(pending, delay) }
    }

    /// Lets a trajectory wait. It is a command from now on, which needs the lease as every command does.
    fn wait(&mut self, pending: Pending, delay: Duration) {
        if self.is_discarded(&pending) {
            return;
        }
        if let Err(reason) = self.controller.take_lease() {
            return self.refuse(&reason);
        }
        self.say(&format!("a trajectory begins in {:.3} s", delay.as_secs_f64()));
        let arrival = pending.arrival.with_lease_of(self.controller);
        let trajectory = JointTrajectory { at_ns: 0, ..pending.trajectory };
        let due = Instant::now() + delay;
        self.later.push(Later { due, pending: Pending { arrival, trajectory, ..pending } });
    }

    /// Discards what waits and is not to begin any more.
    fn discard(&mut self) {
        for later in std::mem::take(&mut self.later) {
            if !self.is_discarded(&later.pending) {
                self.later.push(later);
            }
        }
    }

    /// Returns `true`, and says why, if a trajectory is not to begin any more.
    fn is_discarded(&mut self, pending: &Pending) -> bool {
        self.stops.update(self.controller);
        let reason = match self.inbox.stops() == pending.stops {
            true => pending.arrival.discarded(pending.group, self.controller, self.stops),
            false => Some(Discarded::Stop),
        };
        if let Some(reason) = reason {
            self.say(&format!("a trajectory was discarded: {reason}"));
        }
        reason.is_some()
    }

    fn begin(&mut self, pending: &Pending) {
        if self.is_discarded(pending) {
            return;
        }
        let (group, points) = match self.wanted(&pending.trajectory) {
            Ok(Wanted::Execute { group, points, .. }) => (group, points),
            Ok(Wanted::Stop) => return,
            Err(reason) => return self.refuse(&reason),
        };
        let begun = self.execute(group, &points);
        match &begun {
            Ok(_) => {
                let seconds = points.last().map_or(0.0, |point| point.time_s);
                self.say(&format!("a trajectory of {} points has begun, {seconds:.3} s", points.len()));
            }
            Err(reason) => self.refuse(&reason.naming(&self.axes_of(group))),
        }
        let may_move = match begun {
            Ok(motion) => self.controller.result_of(motion).is_none(),
            Err(reason) => matches!(reason, CommandError::NoReply { .. }),
        };
        if may_move && self.has_stopped(pending) {
            self.stop_again(group);
        }
    }

    fn execute(&self, group: usize, points: &[TrajectoryPoint]) -> Result<MotionId, CommandError> {
        match self.controller.machine().groups.get(group) {
            Some(group) => self.controller.group(group)?.execute(points),
            None => self.controller.execute(points),
        }
    }

    fn has_stopped(&self, pending: &Pending) -> bool {
        self.inbox.stops() != pending.stops || pending.arrival.has_stopped(pending.group, self.controller)
    }

    /// A stop that came while a trajectory was begun may have come before its first cycle.
    fn stop_again(&self, group: usize) {
        let target = u8::try_from(group).map_or(RequestTarget::All, RequestTarget::Group);
        match self.controller.of(target).stop(StopCategory::Two) {
            Ok(()) => self.say("a trajectory was stopped: its axes were stopped while it began"),
            Err(reason) => {
                self.say(&format!("a trajectory that was to stop has begun, and is not stopped: {reason}"))
            }
        }
    }

    fn finish_stop(&self, is_sent: bool) {
        match if is_sent { Ok(()) } else { self.controller.stop(StopCategory::Two) } {
            Ok(()) => self.say("a trajectory without points: the axes come to rest and hold"),
            Err(reason) => self.refuse(&reason),
        }
    }

    fn wanted(&self, trajectory: &JointTrajectory) -> Result<Wanted, Unfit> {
        let groups = &self.controller.machine().groups;
        wanted(trajectory, self.axes, groups, &self.controller.state(), time_of_day_ns())
    }

    /// The names of the axes of a group.
    fn axes_of(&self, group: usize) -> Vec<&str> {
        let of_group = self.axes.iter().filter(|axis| axis.group == group);
        of_group.map(|axis| axis.name.as_str()).collect()
    }

    fn refuse(&self, reason: &dyn std::fmt::Display) {
        self.say(&format!("a trajectory was refused: {reason}"));
    }

    fn say(&self, words: &str) {
        (self.tell)(words);
    }
}
