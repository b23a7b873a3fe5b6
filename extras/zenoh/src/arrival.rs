//! The controller at the arrival of a trajectory, and what has happened to it since then.

use takt::rt::RequestTarget;
use takt::telemetry::phase_words;
use takt::{EventKind, Events, Phase, RequestId, Snapshot, Stopped};
use takt_remote::Client;
use thiserror::Error;

/// Reason for which a trajectory that has not begun is discarded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Discarded {
    /// Its group has stopped, whatever the cause.
    #[error("its axes have stopped since it came")]
    Stop,
    /// The lease has changed hands.
    #[error("another client has commanded since it came")]
    Lease,
}

/// Reason for which a group carries out no trajectory.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum NotReady {
    /// It is not in operation.
    #[error("its axes were {} when it came. Enable them first", phase_words(*phase))]
    Phase {
        /// Phase of the group.
        phase: Phase,
    },
    /// A fault has stopped it and has not been reset.
    #[error(transparent)]
    Fault(#[from] Stopped),
}

/// The controller when a trajectory arrived.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Arrival {
    slot: u64,
    lease: u64,
    groups: Vec<GroupAtArrival>,
}

#[derive(Clone, Debug, PartialEq)]
struct GroupAtArrival {
    newest_stop: RequestId,
    fault: Option<Stopped>,
    phase: Phase,
}

impl Arrival {
    /// Returns the controller as it is now.
    pub fn now(controller: &Client) -> Self {
        let (slot, lease) = (controller.state().slot, controller.lease_generation());
        // The phase is read last: a stop that comes in between shows in it, or as one that has come since then.
        let of_group = |target| GroupAtArrival {
            newest_stop: controller.of(target).newest_stop(),
            fault: controller.of(target).fault(),
            phase: phase_in(&controller.state(), target),
        };
        Self { slot, lease, groups: targets(controller).map(of_group).collect() }
    }

    /// The same, after the lease was taken.
    pub fn with_lease_of(self, controller: &Client) -> Self {
        Self { lease: controller.lease_generation(), ..self }
    }

    /// Checks that a group could have carried a trajectory out.
    pub fn check_ready(&self, group: usize) -> Result<(), NotReady> {
        let Some(GroupAtArrival { phase, fault, .. }) = self.groups.get(group) else { return Ok(()) };
        match (fault, phase) {
            (Some(fault), _) => Err(fault.clone().into()),
            (None, Phase::Holding | Phase::Moving | Phase::Streaming) => Ok(()),
            (None, phase) => Err(NotReady::Phase { phase: *phase }),
        }
    }

    /// Returns what has happened since then that discards a trajectory of a group.
    pub fn discarded(&self, group: usize, controller: &Client, stops: &Stops) -> Option<Discarded> {
        if self.has_stopped(group, controller) || stops.came_after(self.slot, group) {
            return Some(Discarded::Stop);
        }
        (!self.is_lease_kept(controller)).then_some(Discarded::Lease)
    }

    /// Returns `true` if a stop of a group was requested since then.
    pub fn has_stopped(&self, group: usize, controller: &Client) -> bool {
        let newest_stop = target_of(group).map(|target| controller.of(target).newest_stop());
        self.groups.get(group).map(|group| group.newest_stop) != newest_stop
    }

    /// The lease may have come to this process by what it carried out meanwhile.
    fn is_lease_kept(&self, controller: &Client) -> bool {
        let now = controller.lease_generation();
        let is_own = || controller.lease().is_some_and(|holder| holder.process == std::process::id());
        now == self.lease || now == self.lease + 1 && is_own()
    }
}

fn target_of(group: usize) -> Option<RequestTarget> {
    u8::try_from(group).ok().map(RequestTarget::Group)
}

fn phase_in(state: &Snapshot, target: RequestTarget) -> Phase {
    let group = match target {
        RequestTarget::All => 0,
        RequestTarget::Group(group) => group.into(),
    };
    state.groups().get(group).map_or(Phase::Passive, |group| group.phase)
}

fn targets(controller: &Client) -> impl Iterator<Item = RequestTarget> {
    (0..controller.state().groups().len()).filter_map(target_of)
}

/// The newest stop of each group, whatever the cause: also by a fault, and with another group.
pub struct Stops {
    events: Events,
    missed: u64,
    newest_slots: Vec<u64>,
}

impl Stops {
    /// The stops from now on.
    pub fn new(controller: &Client) -> Self {
        let newest_slots = targets(controller).map(|_| 0).collect();
        Self { events: controller.events(), missed: 0, newest_slots }
    }

    /// Reads the events that have come. An event that was missed may have been a stop.
    pub fn update(&mut self, controller: &Client) {
        let Self { events, missed, newest_slots } = self;
        for event in events.by_ref() {
            if matches!(event.kind, EventKind::Stop(_)) {
                note(newest_slots, event.group, event.slot);
            }
        }
        if events.missed() != *missed {
            *missed = events.missed();
            note(newest_slots, None, controller.state().slot);
        }
    }

    fn came_after(&self, slot: u64, group: usize) -> bool {
        self.newest_slots.get(group).is_none_or(|newest| *newest > slot)
    }
}

/// Notes a stop of one group, or of all of them.
fn note(newest_slots: &mut [u64], group: Option<u8>, slot: u64) {
    for (number, newest) in newest_slots.iter_mut().enumerate() {
        if group.is_none_or(|group| usize::from(group) == number) {
            *newest = (*newest).max(slot);
        }
    }
}
