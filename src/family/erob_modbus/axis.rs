//! An axis of a configuration: its keys, and what its follower is made with.

use takt_rt::Nanoseconds;

use super::follower::FollowerParameters;
use crate::config::{Axis, FamilyKeys, Quantity};
use crate::family::erob::following::STEEPER;
use crate::family::simulated_joint::counts_per_unit;

/// The longest communication time-out that register 0x0002 takes: ms.
const LONGEST_TIMEOUT_MS: u16 = 4_000;
/// The communication time-out where the configuration says none: ms.
const USUAL_TIMEOUT_MS: u16 = 500;
/// Velocity for one unit of position error: 1/s, at most.
const GAIN: f64 = 8.0;
/// The same in a round: so little is far from where the joint would swing, since what is known of it is up to two rounds old.
const GAIN_PER_ROUND: f64 = 0.2;

/// What an axis says of its drive beside what every axis says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineKeys {
    /// Register 0x0002: ms, 0 for none.
    pub communication_timeout_ms: u16,
}

impl Default for LineKeys {
    fn default() -> Self {
        Self { communication_timeout_ms: USUAL_TIMEOUT_MS }
    }
}

impl LineKeys {
    /// Reads the keys.
    pub fn read(keys: &mut FamilyKeys<'_, '_>) -> Self {
        let longest_s = f64::from(LONGEST_TIMEOUT_MS) * 1e-3;
        let given = keys.quantity("communication_timeout", Quantity::DURATION, 0.0..=longest_s);
        // A time-out below 1 ms is none.
        let milliseconds = given.map(|seconds| (seconds * 1e3).round() as u16);
        milliseconds.map_or(Self::default(), |communication_timeout_ms| Self { communication_timeout_ms })
    }

    /// Those of an axis.
    pub fn of(axis: &Axis) -> Self {
        axis.drive.description::<Self>().copied().unwrap_or_default()
    }
}

/// What the follower of an axis is made with, on a line whose rounds take so long.
pub fn follower_parameters(axis: &Axis, round_ns: Nanoseconds) -> FollowerParameters {
    let round_s = round_ns.max(1) as f64 * 1e-9;
    FollowerParameters {
        counts_per_unit: counts_per_unit(axis),
        zero_counts: axis.zero_counts.into(),
        velocity_limit: axis.limits.velocity,
        acceleration: STEEPER * axis.limits.acceleration,
        deceleration: STEEPER * axis.limits.deceleration,
        position_gain: (GAIN_PER_ROUND / round_s).min(GAIN),
        rated_torque: axis.joint.rated_torque,
        communication_timeout_ms: LineKeys::of(axis).communication_timeout_ms,
    }
}
