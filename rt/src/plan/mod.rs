//! Trajectories: from any state to any state in minimum time within limits, for any number of axes at once.

/// Position, velocity and acceleration of an axis (rad or m, per second, per second squared).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Position.
    pub position: f64,
    /// Velocity.
    pub velocity: f64,
    /// Acceleration.
    pub acceleration: f64,
}
