//! Triggers: the states of the group from which the time of a fault is counted.

use std::sync::atomic::{AtomicU64, Ordering};

use takt_rt::{Nanoseconds, Phase, Snapshot};

/// The trigger from which a fault's time is counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Trigger {
    /// The opening of the bus, before the drives are brought up.
    Start,
    /// The first cycle in which every axis is enabled.
    #[default]
    Enabled,
    /// The first cycle of the first move or stream.
    Moving,
    /// The first cycle of the first stop on a trajectory.
    Stopping,
}

const NOT_YET: Nanoseconds = Nanoseconds::MAX;

/// The first time of each trigger. The thread that sees the snapshots writes it, the faulty ports read it in the
/// real-time thread; neither waits for the other.
#[derive(Debug)]
pub struct TriggerTimes {
    enabled_ns: AtomicU64,
    moving_ns: AtomicU64,
    stopping_ns: AtomicU64,
}

impl Default for TriggerTimes {
    fn default() -> Self {
        let not_yet = || AtomicU64::new(NOT_YET);
        Self { enabled_ns: not_yet(), moving_ns: not_yet(), stopping_ns: not_yet() }
    }
}

impl TriggerTimes {
    /// Takes the snapshot of a cycle.
    pub fn observe(&self, snapshot: &Snapshot) {
        let note = |trigger: &AtomicU64| {
            // There is only one writer, so nothing is stored between load and store.
            if trigger.load(Ordering::Relaxed) == NOT_YET {
                trigger.store(snapshot.at_ns, Ordering::Relaxed);
            }
        };
        for group in snapshot.groups() {
            match group.phase {
                Phase::Holding => note(&self.enabled_ns),
                Phase::Moving | Phase::Streaming => {
                    note(&self.enabled_ns);
                    note(&self.moving_ns);
                }
                Phase::Stopping => note(&self.stopping_ns),
                Phase::Passive | Phase::Disabled | Phase::Enabling | Phase::Disabling => {}
            }
        }
    }

    /// When the trigger occurred, in the time of the snapshots. [`Trigger::Start`] is not known here.
    pub fn at_ns(&self, trigger: Trigger) -> Option<Nanoseconds> {
        let at_ns = match trigger {
            Trigger::Start => NOT_YET,
            Trigger::Enabled => self.enabled_ns.load(Ordering::Relaxed),
            Trigger::Moving => self.moving_ns.load(Ordering::Relaxed),
            Trigger::Stopping => self.stopping_ns.load(Ordering::Relaxed),
        };
        (at_ns != NOT_YET).then_some(at_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_first_occurrence_of_a_trigger_counts() {
        let trigger_times = TriggerTimes::default();
        let seen = |phase, at_ns| {
            let mut snapshot = Snapshot { at_ns, ..Snapshot::default() };
            snapshot.groups[0].phase = phase;
            snapshot
        };
        trigger_times.observe(&seen(Phase::Enabling, 1));
        assert_eq!(trigger_times.at_ns(Trigger::Enabled), None);
        for (phase, at_ns) in
            [(Phase::Holding, 2), (Phase::Moving, 3), (Phase::Holding, 4), (Phase::Moving, 5)]
        {
            trigger_times.observe(&seen(phase, at_ns));
        }
        assert_eq!(
            (trigger_times.at_ns(Trigger::Enabled), trigger_times.at_ns(Trigger::Moving)),
            (Some(2), Some(3))
        );
        assert_eq!(trigger_times.at_ns(Trigger::Stopping), None);
    }
}
