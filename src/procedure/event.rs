//! Events of a running procedure.

use takt_rt::Nanoseconds;

/// An event for the operator.
#[derive(Clone, Debug, PartialEq)]
pub enum ProcedureEvent {
    /// A step has begun.
    Step(&'static str),
    /// A note.
    Note(String),
    /// A reading of the axis.
    Reading(AxisReading),
    /// So much of the work is done.
    Progress {
        /// What is done, in units of the procedure's own.
        done: u32,
        /// What there is to do, as far as that is known now.
        of: u32,
    },
}

/// One reading of an axis, in SI units: rad (m) and seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisReading {
    /// Time of the reading on the procedure's clock.
    pub at_ns: Nanoseconds,
    /// Position: rad (m).
    pub position: f64,
    /// Position in counts, as the drive reports it.
    pub position_counts: i64,
    /// Velocity: rad/s (m/s).
    pub velocity: f64,
    /// Torque in N·m (N), if the drive reports it.
    pub torque: Option<f64>,
    /// Motor current in A, if the drive reports it.
    pub current_a: Option<f64>,
    /// Temperature in °C, if the drive reports it and it was asked for.
    pub temperature_c: Option<f64>,
    /// The statusword, if the drive has one.
    pub statusword: Option<u16>,
    /// The state of the drive, as a name.
    pub state: &'static str,
}

impl AxisReading {
    /// The bits of the statusword; 0 where the drive has none.
    pub fn status_bits(&self) -> u16 {
        self.statusword.unwrap_or(0)
    }
}
