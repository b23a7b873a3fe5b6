//! What a procedure has to say while it runs.

use takt_rt::Nanoseconds;

/// Something to tell people.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A step has begun.
    Step(&'static str),
    /// Something worth knowing.
    Note(String),
    /// Where the axis is and how it fares.
    Reading(Reading),
}

/// What was read of an axis in one go. Positions and velocities in rad (m) and seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// When, on the clock of the procedure.
    pub at_ns: Nanoseconds,
    /// Position: rad (m).
    pub position: f64,
    /// What the drive calls its position.
    pub position_counts: i64,
    /// Velocity: rad/s (m/s).
    pub velocity: f64,
    /// Torque in N·m (N), where the drive tells.
    pub torque: Option<f64>,
    /// Motor current in A, where the drive tells.
    pub current_a: Option<f64>,
    /// The statusword.
    pub statusword: u16,
    /// What the statusword says, in a word or two.
    pub state: &'static str,
}
