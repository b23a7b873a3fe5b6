//! The points of a file, and what it has of each joint.

use super::error::{FileProblem, PlayFileError};
use takt::config::Axis;

/// Longer than thirty years is a slip, and would not fit the clock in nanoseconds.
pub(super) const LONGEST_S: f64 = 1e9;

/// Points in the order of their arrival.
#[derive(Clone, Debug, PartialEq)]
pub struct PlayFile {
    /// The joints that it names.
    pub joints: Vec<JointColumns>,
    /// Its rows; at least one.
    pub rows: Vec<PlayRow>,
    /// The column of the first torque in the header, if there is one.
    pub torque_column: Option<usize>,
    /// True if its times count from its own start (`time_from_start`), as those of a planned trajectory do.
    pub is_trajectory: bool,
}

/// What a file has of a joint, beside its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JointColumns {
    /// The axis.
    pub axis: usize,
    /// True if it has velocities.
    pub has_velocity: bool,
    /// True if it has accelerations.
    pub has_acceleration: bool,
    /// True if it has torques.
    pub has_torque: bool,
}

/// A row of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct PlayRow {
    /// The line in the file, from 1.
    pub line: usize,
    /// When it arrives, in seconds after the start.
    pub arrive_s: f64,
    /// The time that it is meant for, in seconds after the start.
    pub at_s: f64,
    /// The number of the chunk that it belongs to; `None` for a row by itself.
    pub chunk: Option<u64>,
    /// What it wants of each joint that the file names.
    pub points: Vec<JointPoint>,
}

/// What a row wants of a joint. An empty cell is `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointPoint {
    /// rad (m)
    pub position: f64,
    /// rad/s (m/s)
    pub velocity: Option<f64>,
    /// rad/s² (m/s²)
    pub acceleration: Option<f64>,
    /// Feed-forward in N·m (N).
    pub torque: Option<f64>,
}

impl PlayFile {
    /// The time from its first point to its last one, in seconds.
    pub fn duration_s(&self) -> f64 {
        let times = || self.rows.iter().map(|row| row.at_s);
        times().fold(f64::NEG_INFINITY, f64::max) - times().fold(f64::INFINITY, f64::min)
    }

    /// Checks that the drives of all joints that it names follow set-points.
    ///
    /// # Errors
    /// The first joint whose drive plans its own profile.
    pub fn check_modes(&self, axes: &[Axis]) -> Result<(), PlayFileError> {
        let of = |joint: &JointColumns| axes.get(joint.axis).filter(|axis| axis.control.is_profile());
        match self.joints.iter().find_map(of) {
            Some(axis) => {
                let problem = FileProblem::OwnProfile { joint: axis.name.clone() };
                Err(PlayFileError { line: 1, column: None, problem })
            }
            None => Ok(()),
        }
    }
}
