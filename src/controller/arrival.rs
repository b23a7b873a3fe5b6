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

    /// The first joint that is farther off its target than it may be, as an outcome.
    pub fn missed(&self, targets: &[Option<f64>], snapshot: &Snapshot) -> Option<Outcome> {
        let joints = self.tolerances.iter().zip(targets).zip(&snapshot.axes).enumerate();
        joints.into_iter().find_map(|(axis, ((tolerance, target), joint))| {
            let (tolerance, distance) = ((*tolerance)?, joint.position - (*target)?);
            // A position that is no number is nowhere near.
            let is_there = distance.abs() <= tolerance;
            (!is_there).then_some(Outcome::OffTarget { axis, distance, tolerance })
        })
    }
}
