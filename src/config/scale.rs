//! The conversion between SI units and the units of a drive, as far as a configuration knows them.

use takt_rt::{Scale, ScaleError, ScaleParameters};

use super::model::Axis;

impl Axis {
    /// The conversion of SI units to the drive units of this axis. The rated torque is the configured one until the drive has
    /// reported its own.
    ///
    /// # Errors
    /// An impossible parameter.
    pub fn scale(&self) -> Result<Scale, ScaleError> {
        Scale::new(ScaleParameters {
            counts_per_turn: self.counts_per_turn,
            velocity_units_per_turn: self.drive.velocity_units_per_turn(self.counts_per_turn),
            gear_ratio: self.gear_ratio,
            travel_per_turn: self.travel.per_turn(),
            reversed: self.reversed,
            zero_counts: self.zero_counts.into(),
            rated_torque: self.rated_torque(),
        })
    }
}
