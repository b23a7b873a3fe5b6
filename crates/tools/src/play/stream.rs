//! The rows of a file as a stream: each handed over when it arrives, stamped with the time that it is meant for.

use std::collections::HashMap;

use takt_rt::{AxisPoint, MAX_AXES, Nanoseconds, PointRole, PositionPoint, Snapshot, StreamPoint};

use super::error::{FileProblem, PlayFileError};
use super::groups::PlayedGroup;
use super::points::{JointPoint, PlayFile, PlayRow};
use takt::channels::GroupAxes;
use takt::command::check_point;
use takt::config::{Axis, Config};

/// Nanoseconds in a second, to and from the seconds of a file.
const NANOSECONDS: f64 = 1e9;

/// The rows of a file in the order of their arrival.
#[derive(Clone, Debug)]
pub struct FileStream {
    /// The axis of each joint that the file names.
    axes: Vec<usize>,
    groups: Vec<PlayedGroup>,
    batches: Vec<Batch>,
    /// When everything has arrived, and the time of every row has come, in seconds after the start.
    end_s: f64,
    first: Vec<Option<f64>>,
}

/// Points that arrive together: one by itself, or a chunk.
#[derive(Clone, Debug)]
struct Batch {
    /// Since the start, in seconds.
    arrive_s: f64,
    is_chunk: bool,
    /// Since the start, and a point for each joint.
    points: Vec<(f64, Vec<AxisPoint>)>,
}

impl FileStream {
    /// Takes the rows of a file. A chunk arrives with its last row.
    ///
    /// # Errors
    /// A point that its axis does not take, as one with a torque where none is fed forward, or a first point outside the
    /// position limits.
    pub fn new(file: &PlayFile, config: &Config) -> Result<Self, PlayFileError> {
        for row in &file.rows {
            for (joint, point) in file.joints.iter().zip(&row.points) {
                check(row, config.axes.get(joint.axis), point)?;
            }
        }
        let mut first = vec![None; config.axes.len()];
        let earliest = file.rows.iter().min_by(|one, other| one.at_s.total_cmp(&other.at_s));
        if let Some(row) = earliest {
            for (joint, point) in file.joints.iter().zip(&row.points) {
                check_first(row, config.axes.get(joint.axis), point.position)?;
                if let Some(place) = first.get_mut(joint.axis) {
                    *place = Some(point.position);
                }
            }
        }
        let axes: Vec<usize> = file.joints.iter().map(|joint| joint.axis).collect();
        let groups = PlayedGroup::of(config, &axes);
        Ok(Self { axes, groups, batches: batches(&file.rows), end_s: end_s(&file.rows), first })
    }

    /// The first position of each axis that the file names: that of the row that is meant for the earliest time.
    pub(super) fn first(&self) -> &[Option<f64>] {
        &self.first
    }

    /// When everything has arrived, and the time of every row has come, in seconds after the start.
    pub(super) const fn end_s(&self) -> f64 {
        self.end_s
    }

    /// How many batches have arrived so long after the start.
    pub(super) fn arrived(&self, since_start_s: f64) -> usize {
        self.batches.partition_point(|batch| batch.arrive_s <= since_start_s)
    }

    /// The groups that it plays.
    pub fn groups(&self) -> &[PlayedGroup] {
        &self.groups
    }

    /// The points of a batch for every axis of a group. Axes that the file does not name stay where `snapshot` has them.
    pub(super) fn batch(
        &self,
        number: usize,
        group: &PlayedGroup,
        start_ns: Nanoseconds,
        snapshot: &Snapshot,
    ) -> Option<Vec<StreamPoint>> {
        let Batch { is_chunk, points, .. } = self.batches.get(number)?;
        let standing: [AxisPoint; MAX_AXES] =
            std::array::from_fn(|axis| AxisPoint::position(snapshot.axes[axis].position_set));
        let (count, places) = (points.len(), GroupAxes::new(group.axes.clone()));
        let stamped = points.iter().enumerate().map(|(index, (at_s, joints))| {
            let mut axes = standing;
            for (axis, point) in self.axes.iter().zip(joints) {
                if let Some(place) = axes.get_mut(*axis) {
                    *place = *point;
                }
            }
            let role = if *is_chunk {
                PointRole::Chunk { is_first: index == 0, is_last: index + 1 == count }
            } else {
                PointRole::Single
            };
            let since_start_ns = (at_s * NANOSECONDS).round() as i64;
            let axes = places.pick(&axes);
            StreamPoint { at_ns: start_ns.saturating_add_signed(since_start_ns), role, axes }
        });
        Some(stamped.collect())
    }
}

fn check(row: &PlayRow, axis: Option<&Axis>, point: &JointPoint) -> Result<(), PlayFileError> {
    let Some(axis) = axis else { return Ok(()) };
    check_point(axis, &axis.control, &point_of(point)).map_err(|reason| {
        let problem = FileProblem::Rows { joint: Some(axis.name.clone()), words: reason.to_string() };
        PlayFileError { line: row.line, column: None, problem }
    })
}

/// What a stream gets of a row for a joint. Its torque is fed forward.
fn point_of(point: &JointPoint) -> AxisPoint {
    let JointPoint { position, velocity, acceleration, torque } = *point;
    AxisPoint::motion(PositionPoint { position, velocity, acceleration }).with_torque(torque.unwrap_or(0.0))
}

/// The arm is led to the first point, so that it must be within the limits.
fn check_first(row: &PlayRow, axis: Option<&Axis>, position: f64) -> Result<(), PlayFileError> {
    let Some(axis) = axis.filter(|axis| !axis.limits.contain(position)) else { return Ok(()) };
    let (lowest, highest) = (axis.limits.position_min, axis.limits.position_max);
    let words = format!(
        "the arm is led to this point first, and the position {position} is not within the limits, {lowest} to {highest}"
    );
    let problem = FileProblem::Rows { joint: Some(axis.name.clone()), words };
    Err(PlayFileError { line: row.line, column: None, problem })
}

fn end_s(rows: &[PlayRow]) -> f64 {
    rows.iter().map(|row| row.at_s.max(row.arrive_s)).fold(0.0, f64::max)
}

/// The rows by arrival; those of a chunk together, in the order of their stamps.
fn batches(rows: &[PlayRow]) -> Vec<Batch> {
    let mut batches: Vec<Batch> = Vec::new();
    let mut places: HashMap<u64, usize> = HashMap::new();
    for row in rows {
        let place = match row.chunk {
            Some(chunk) => *places.entry(chunk).or_insert(batches.len()),
            None => batches.len(),
        };
        if place == batches.len() {
            batches.push(Batch { arrive_s: row.arrive_s, is_chunk: row.chunk.is_some(), points: Vec::new() });
        }
        if let Some(batch) = batches.get_mut(place) {
            batch.arrive_s = row.arrive_s;
            batch.points.push((row.at_s, row.points.iter().map(point_of).collect()));
        }
    }
    for batch in &mut batches {
        batch.points.sort_by(|one, other| one.0.total_cmp(&other.0));
    }
    batches.sort_by(|one, other| one.arrive_s.total_cmp(&other.arrive_s));
    batches
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(arrive_s: f64, at_s: f64, chunk: Option<u64>) -> PlayRow {
        let points = vec![JointPoint { position: at_s, ..Default::default() }];
        PlayRow { line: 2, arrive_s, at_s, chunk, points }
    }

    #[test]
    fn rows_that_share_a_chunk_arrive_with_the_last_of_them_in_the_order_of_their_stamps() {
        let rows = [
            row(0.0, 0.1, None),
            row(0.1, 0.5, Some(4)),
            row(0.2, 0.4, Some(4)),
            row(0.2, 0.3, None),
            row(0.3, 0.6, Some(5)),
        ];
        let batches = batches(&rows);
        let arrivals: Vec<f64> = batches.iter().map(|batch| batch.arrive_s).collect();
        assert_eq!(arrivals, [0.0, 0.2, 0.2, 0.3]);
        let chunk: Vec<f64> = batches[1].points.iter().map(|(at_s, _)| *at_s).collect();
        assert_eq!((batches[1].is_chunk, chunk), (true, vec![0.4, 0.5]));
        assert!(!batches[0].is_chunk && !batches[2].is_chunk && batches[3].is_chunk);
        let end_s = end_s(&rows);
        let stream = FileStream { axes: vec![1], groups: vec![], batches, end_s, first: vec![] };
        let group = PlayedGroup { number: 0, axes: vec![0, 1] };
        assert_eq!((stream.arrived(0.1), stream.arrived(0.2), stream.end_s()), (1, 3, 0.6));
        let mut snapshot = Snapshot::default();
        snapshot.axes[0].position_set = 7.0;
        let points = stream.batch(1, &group, 1_000_000_000, &snapshot).unwrap();
        let stamps: Vec<u64> = points.iter().map(|point| point.at_ns).collect();
        assert_eq!(stamps, [1_400_000_000, 1_500_000_000]);
        assert_eq!(points[0].role, PointRole::Chunk { is_first: true, is_last: false });
        assert_eq!((points[0].axes[0], points[0].axes[1]), (7.0.into(), 0.4.into()));
    }

    /// Search through all earlier chunks for each row, or through all rows in each cycle, would take days.
    #[test]
    fn the_work_for_a_row_and_for_a_cycle_does_not_grow_with_the_rows_of_the_file() {
        const ROWS: u64 = 1_000_000;
        let at_s = |number: u64| number as f64 * 1e-3;
        let row = |number| PlayRow { points: vec![], ..row(at_s(number), at_s(number), Some(number)) };
        let rows: Vec<PlayRow> = (0..ROWS).map(row).collect();
        let (batches, end_s) = (batches(&rows), end_s(&rows));
        assert_eq!(batches.len() as u64, ROWS);
        let stream = FileStream { axes: vec![], groups: vec![], batches, end_s, first: vec![] };
        assert_eq!((0..ROWS).filter(|cycle| at_s(*cycle) < stream.end_s()).count() as u64, ROWS - 1);
    }
}
