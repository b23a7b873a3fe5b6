//! What the group is doing, as far as faults wait for it.

use std::sync::atomic::{AtomicU64, Ordering};

use takt_rt::{Nanoseconds, Phase, Snapshot};

/// What a fault waits for before its time counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Cue {
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

/// When the group did each of these things for the first time. Written by whoever sees the snapshots, read by the
/// wrapped ports in the real-time thread; neither waits for the other.
#[derive(Debug)]
pub struct Cues {
    enabled_ns: AtomicU64,
    moving_ns: AtomicU64,
    stopping_ns: AtomicU64,
}

impl Default for Cues {
    fn default() -> Self {
        let not_yet = || AtomicU64::new(NOT_YET);
        Self { enabled_ns: not_yet(), moving_ns: not_yet(), stopping_ns: not_yet() }
    }
}

impl Cues {
    /// Takes the state of the group after a cycle.
    pub fn observe(&self, snapshot: &Snapshot) {
        let note = |cue: &AtomicU64| {
            // Only one thread writes, so between the two nobody else does.
            if cue.load(Ordering::Relaxed) == NOT_YET {
                cue.store(snapshot.at_ns, Ordering::Relaxed);
            }
        };
        match snapshot.phase {
            Phase::Holding => note(&self.enabled_ns),
            Phase::Moving | Phase::Streaming => {
                note(&self.enabled_ns);
                note(&self.moving_ns);
            }
            Phase::Stopping => note(&self.stopping_ns),
            Phase::Passive | Phase::Disabled | Phase::Enabling | Phase::Disabling => {}
        }
    }

    /// When it was, if it has been: in the time of the snapshots. [`Cue::Start`] is not known here.
    pub fn at_ns(&self, cue: Cue) -> Option<Nanoseconds> {
        let at_ns = match cue {
            Cue::Start => NOT_YET,
            Cue::Enabled => self.enabled_ns.load(Ordering::Relaxed),
            Cue::Moving => self.moving_ns.load(Ordering::Relaxed),
            Cue::Stopping => self.stopping_ns.load(Ordering::Relaxed),
        };
        (at_ns != NOT_YET).then_some(at_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_time_counts() {
        let cues = Cues::default();
        let seen = |phase, at_ns| Snapshot { phase, at_ns, ..Snapshot::default() };
        cues.observe(&seen(Phase::Enabling, 1));
        assert_eq!(cues.at_ns(Cue::Enabled), None);
        for (phase, at_ns) in
            [(Phase::Holding, 2), (Phase::Moving, 3), (Phase::Holding, 4), (Phase::Moving, 5)]
        {
            cues.observe(&seen(phase, at_ns));
        }
        assert_eq!((cues.at_ns(Cue::Enabled), cues.at_ns(Cue::Moving)), (Some(2), Some(3)));
        assert_eq!(cues.at_ns(Cue::Stopping), None);
    }
}
