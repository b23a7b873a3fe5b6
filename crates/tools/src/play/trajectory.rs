//! The rows of a file as one trajectory.

use takt_rt::plan::State;

use super::error::{FileProblem, PlayFileError};
use super::groups::PlayedGroup;
use super::points::{JointPoint, PlayFile, PlayRow};
use takt::config::{Axis, Config};
use takt::trajectory::{AxisPoints, Interpolation, Trajectory, TrajectoryConditions, TrajectoryError};

/// The rows of a file by the times that they are meant for.
#[derive(Clone, Debug)]
pub struct FileTrajectory {
    /// Since the first point.
    times_s: Vec<f64>,
    /// When the first point is meant for.
    begins_s: f64,
    /// The lines of the rows.
    lines: Vec<usize>,
    /// The points of each axis of the controller; `None` for one that the file does not name.
    axes: Vec<Option<AxisPoints>>,
    /// The group of the axes that it names.
    group: PlayedGroup,
}

impl FileTrajectory {
    /// Takes the rows of a file.
    ///
    /// # Errors
    /// A column of torques, which no trajectory has, joints of several groups, or a row without a velocity or acceleration that
    /// others have.
    pub fn new(file: &PlayFile, config: &Config) -> Result<Self, PlayFileError> {
        if file.torque_column.is_some() {
            let words = "a trajectory takes no torques; play the file without --trajectory".to_owned();
            let problem = FileProblem::Rows { joint: None, words };
            return Err(PlayFileError { line: 1, column: file.torque_column, problem });
        }
        let named: Vec<usize> = file.joints.iter().map(|joint| joint.axis).collect();
        let group = match &PlayedGroup::of(config, &named)[..] {
            [group] => group.clone(),
            groups => return Err(several_groups(config, groups, &named)),
        };
        let mut rows: Vec<&PlayRow> = file.rows.iter().collect();
        rows.sort_by(|one, other| one.at_s.total_cmp(&other.at_s));
        let begins_s = rows.first().map_or(0.0, |row| row.at_s);
        let mut of_axes = vec![None; config.axes.len()];
        for (joint, columns) in file.joints.iter().enumerate() {
            let values = |of: fn(&JointPoint) -> Option<f64>| -> Vec<f64> {
                // One that is missing is none that is finite: the check of the trajectory names its point.
                rows.iter().map(|row| row.points.get(joint).and_then(of).unwrap_or(f64::NAN)).collect()
            };
            let points = AxisPoints {
                positions: values(|point| Some(point.position)),
                velocities: columns.has_velocity.then(|| values(|point| point.velocity)),
                accelerations: columns.has_acceleration.then(|| values(|point| point.acceleration)),
            };
            if let Some(place) = of_axes.get_mut(columns.axis) {
                *place = Some(points);
            }
        }
        Ok(Self {
            times_s: rows.iter().map(|row| row.at_s - begins_s).collect(),
            begins_s,
            lines: rows.iter().map(|row| row.line).collect(),
            axes: of_axes,
            group,
        })
    }

    /// The group of its axes.
    pub fn group(&self) -> &PlayedGroup {
        &self.group
    }

    /// When its first point is meant for.
    pub fn begins_s(&self) -> f64 {
        self.begins_s
    }

    /// The first position of each axis that the file names.
    pub fn first(&self) -> Vec<Option<f64>> {
        let first = |points: &Option<AxisPoints>| points.as_ref()?.positions.first().copied();
        self.axes.iter().map(first).collect()
    }

    /// The trajectory of the group from where its axes are. Axes that the file does not name stay.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn trajectory(&self, conditions: &TrajectoryConditions<'_>) -> Result<Trajectory, TrajectoryError> {
        let own = self.group.axes.iter().map(|axis| self.axes.get(*axis).and_then(Option::as_ref));
        let points = own.zip(conditions.start).map(|(points, start)| {
            let standing = || AxisPoints::standing(start.position, self.times_s.len());
            points.cloned().unwrap_or_else(standing)
        });
        let points: Vec<_> = points.collect();
        Trajectory::of_axes(&self.times_s, &points, Interpolation::default(), conditions)
    }

    /// Checks the file before anything moves: the axes that it names will begin at its first point, and the others do not move.
    ///
    /// # Errors
    /// The first thing that is wrong, at its line.
    pub fn check(&self, axes: &[Axis], period_s: f64) -> Result<(), PlayFileError> {
        let inside = |axis: &Axis| 0.5 * (axis.limits.position_min + axis.limits.position_max);
        let own: Vec<&Axis> = self.group.axes.iter().filter_map(|axis| axes.get(*axis)).collect();
        let first = self.group.pick(&self.first());
        let start =
            first.iter().zip(&own).map(|(first, axis)| State::rest(first.unwrap_or_else(|| inside(axis))));
        let start: Vec<State> = start.collect();
        let limits: Vec<_> = own.iter().map(|axis| axis.limits).collect();
        let conditions = TrajectoryConditions { start: &start, limits: &limits, period_s };
        self.trajectory(&conditions).map(drop).map_err(|error| self.problem(&error, &own))
    }

    fn problem(&self, error: &TrajectoryError, axes: &[&Axis]) -> PlayFileError {
        // What concerns no point concerns the end.
        let point = error.point().unwrap_or(self.lines.len().saturating_sub(1));
        let line = self.lines.get(point).copied().unwrap_or(1);
        let joint = error.axis().and_then(|axis| axes.get(axis)).map(|axis| axis.name.clone());
        let words = match *error {
            TrajectoryError::NotFinite { quantity, .. } => {
                format!("its {quantity} is missing, and other rows have one")
            }
            TrajectoryError::TimeOrder { time_s, .. } => {
                format!("another row is meant for {} s too", time_s + self.begins_s)
            }
            TrajectoryError::Limit { broken, time_s, value, limit, .. } => {
                let at_s = time_s + self.begins_s;
                format!("the {broken} {value:.6} at {at_s:.6} s is beyond the limit of {limit:.6}")
            }
            TrajectoryError::Start { quantity, given, .. } => {
                format!("the trajectory begins at rest, and this row has the {quantity} {given}")
            }
            _ => error.words(),
        };
        PlayFileError { line, column: None, problem: FileProblem::Rows { joint, words } }
    }
}

/// The joints of one trajectory are of one group: those of several would not begin in the same cycle, nor stop together.
fn several_groups(config: &Config, groups: &[PlayedGroup], named: &[usize]) -> PlayFileError {
    let name = |group: &PlayedGroup| {
        config.groups.get(usize::from(group.number)).map_or("", |group| group.name.as_str())
    };
    let [first, second] = [0, 1].map(|number: usize| groups.get(number));
    let joint = second.and_then(|group| named.iter().find(|axis| group.axes.contains(axis)));
    let joint = joint.and_then(|axis| config.axes.get(*axis)).map(|axis| axis.name.clone());
    let words = format!(
        "a trajectory is for one group: this joint is of \"{}\", and another one of \"{}\"; play the file without --trajectory, or \
         a file for each group",
        second.map_or("", name),
        first.map_or("", name),
    );
    PlayFileError { line: 1, column: None, problem: FileProblem::Rows { joint, words } }
}
