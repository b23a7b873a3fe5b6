//! Whether a program has brought the joints to where it ends.

use takt_rt::Snapshot;

use super::outcome::Outcome;
use crate::config::{Config, Control};

/// How long the joints may take to come to their targets after the set-points have.
pub const ARRIVAL_NS: u64 = 3_000_000_000;

/// How far each joint may be off its target; `None` for drives in profile velocity and torque, which have none.
pub struct Arrival {
    tolerances: Vec<Option<f64>>,
}

impl Arrival {
    /// The tolerances of a configuration.
    pub fn of(config: &Config) -> Self {
        let tolerance = |control: &Control, tolerance| {
            (!matches!(control, Control::ProfileVelocity | Control::ProfileTorque)).then_some(tolerance)
        };
        let axes = config.axes.iter();
        Self { tolerances: axes.map(|axis| tolerance(&axis.control, axis.target_tolerance)).collect() }
    }

    /// The first joint that is farther off its target than it may be, or whose drive does not report where it is, as an outcome.
    pub fn missed(&self, targets: &[Option<f64>], snapshot: &Snapshot) -> Option<Outcome> {
        let joints = self.tolerances.iter().zip(targets).zip(&snapshot.axes).enumerate();
        joints.into_iter().find_map(|(axis, ((tolerance, target), joint))| {
            let (tolerance, distance) = ((*tolerance)?, joint.position - (*target)?);
            if joint.is_stale() {
                return Some(Outcome::PositionNotReported { axis, since_slot: joint.feedback_slot });
            }
            // A position that is no number is nowhere near.
            let is_there = distance.abs() <= tolerance;
            (!is_there).then_some(Outcome::OffTarget { axis, distance, tolerance })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::AxisSnapshot;

    #[test]
    fn a_position_that_was_not_reported_is_neither_on_its_target_nor_off_it() {
        let config = Config::parse("arm6-erob.toml", include_str!("../../configs/arm6-erob.toml")).unwrap();
        let arrival = Arrival::of(&config);
        let heard = AxisSnapshot { is_heard: true, feedback_slot: 70, ..AxisSnapshot::default() };
        let mut snapshot = Snapshot { axes: [heard; takt_rt::MAX_AXES], ..Snapshot::default() };
        assert_eq!(arrival.missed(&[Some(0.0); 6], &snapshot), None);
        snapshot.axes[2].position = 0.5;
        assert!(matches!(
            arrival.missed(&[Some(0.0); 6], &snapshot),
            Some(Outcome::OffTarget { axis: 2, .. })
        ));
        for position in [0.0, 0.5] {
            snapshot.axes[2] = AxisSnapshot { position, feedback_age: 1, ..heard };
            let outcome = Outcome::PositionNotReported { axis: 2, since_slot: 70 };
            assert_eq!(arrival.missed(&[Some(0.0); 6], &snapshot), Some(outcome));
        }
    }
}
