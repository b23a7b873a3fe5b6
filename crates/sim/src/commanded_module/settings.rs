//! What shapes the motions of a module, in one form for all protocols.

use takt_rt::Nanoseconds;

use crate::profile_motions::MotionProfile;

/// What the set-point means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ControlMode {
    /// A current.
    Torque = 1,
    /// A velocity.
    Velocity = 2,
    /// None: motions by commands.
    Position = 3,
}

impl ControlMode {
    /// That of a number on the wire.
    pub const fn of(number: i64) -> Self {
        match number {
            1 => Self::Torque,
            2 => Self::Velocity,
            _ => Self::Position,
        }
    }
}

/// What shapes the motions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModuleSettings {
    /// What the set-point means.
    pub mode: ControlMode,
    /// 0 continuous, 1 to a target, 2 to and fro.
    pub motion_mode: i64,
    /// counts
    pub target: f64,
    /// counts; not 0 makes a move a relative one
    pub distance: f64,
    /// The profile of position and velocity control.
    pub profile: MotionProfile,
    /// counts/s in velocity control, mA in torque control
    pub set_point: f64,
    /// counts/s in torque control, not negative; infinite for no limit
    pub velocity_limit: f64,
    /// counts; a fault beyond it
    pub position_error: f64,
    /// counts
    pub window: f64,
    /// How long the joint must stay in the window.
    pub settling_ns: Nanoseconds,
}

/// A ramp of a profile, of at least 1 count/s²: with 0 no motion would end. The loops do not follow steeper ramps than [`STEEPEST`].
pub fn ramp(rate: f64) -> f64 {
    rate.clamp(1.0, STEEPEST)
}

/// count/s²
pub const STEEPEST: f64 = 1e8;
