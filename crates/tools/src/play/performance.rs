//! A performance: from an arm that is enabled to the end of the file, whatever brings the arm from cycle to cycle.

use takt_rt::{
    Answer, GroupSnapshot, MotionState, Nanoseconds, Phase, RequestError, RequestId, Snapshot, StopReason,
    StreamPoint, StreamState,
};

use super::groups::PlayedGroup;
use super::set_points::ArmedFrom;
use super::stream::FileStream;
use super::trajectory::FileTrajectory;
use takt::trajectory::{Trajectory, TrajectoryConditions, TrajectoryError};

/// The fraction of the limits with which the arm is led to the first point.
pub const APPROACH_SCALE: f64 = 0.3;

/// Makes a trajectory from where the axes are.
pub type MakeTrajectory<'a> = &'a dyn Fn(&TrajectoryConditions<'_>) -> Result<Trajectory, TrajectoryError>;

/// An arm that is enabled.
pub trait Stage {
    /// The state after the newest cycle.
    fn snapshot(&mut self) -> Snapshot;

    /// Lets some time pass. Returns whether the run goes on: it ends by itself, or because it is interrupted.
    fn pass(&mut self) -> bool;

    /// Begins a move of a group to rest, within `APPROACH_SCALE`. The target has an entry for each axis of the controller.
    ///
    /// # Errors
    /// See [`PlayError`].
    fn move_to(&mut self, group: &PlayedGroup, target: &[f64]) -> Result<RequestId, PlayError>;

    /// Begins a trajectory of a group, which is made from where its axes are.
    ///
    /// # Errors
    /// See [`PlayError`].
    fn execute(&mut self, group: &PlayedGroup, make: MakeTrajectory<'_>) -> Result<RequestId, PlayError>;

    /// A group begins to follow its points of [`Stage::push`].
    ///
    /// # Errors
    /// See [`PlayError`].
    fn begin_stream(&mut self, group: &PlayedGroup) -> Result<RequestId, PlayError>;

    /// Hands points with an entry for each axis of a group over, all or none. Returns whether there was room.
    fn push(&mut self, group: &PlayedGroup, points: &[StreamPoint]) -> bool;

    /// Asks for a stop of category 2.
    ///
    /// # Errors
    /// See [`PlayError`].
    fn stop(&mut self) -> Result<(), PlayError>;

    /// The time on the clock of the stamps up to which rows have arrived.
    fn time_ns(&mut self) -> Nanoseconds;
}

/// Why a performance ended before the end of the file.
#[derive(Clone, Debug, PartialEq)]
pub enum PlayError {
    /// The run has ended; its outcome says why.
    Ended,
    /// The group has stopped.
    Stopped(StopReason),
    /// Another client has moved the arm.
    Replaced,
    /// The real-time thread has refused a request.
    Refused(Option<RequestError>),
    /// A command failed; the words say why.
    Command(String),
}

/// Leads the arm to the first point of the file, and executes it.
///
/// # Errors
/// See [`PlayError`].
pub fn execute(stage: &mut impl Stage, file: &FileTrajectory, armed: &ArmedFrom) -> Result<(), PlayError> {
    let group = file.group();
    approach(stage, std::slice::from_ref(group), &file.first())?;
    armed.set(stage.snapshot().slot + 1);
    let motion = stage.execute(group, &|conditions| file.trajectory(conditions))?;
    wait(stage, group, motion)
}

/// How a stream has gone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StreamSummary {
    /// Points that came too late for their time.
    pub late_points: u64,
    /// Points that found no room, or could not be used.
    pub lost_points: u64,
    /// How far the set-points were behind the stamps in the end.
    pub lag_ns: Nanoseconds,
    /// The same at most.
    pub lag_max_ns: Nanoseconds,
}

/// Time from the beginning of the stream to the time 0 of the file.
const START_NS: Nanoseconds = 20_000_000;
/// The arm comes to rest within this time after the last row.
const COMING_TO_REST_S: f64 = 20.0;
/// The arm rests if its set-points have not changed for so many looks.
const RESTING_LOOKS: u32 = 20;

/// Leads the arm to the first point of the file, and hands the rows over as they arrive. Ends with the arm at rest.
///
/// # Errors
/// See [`PlayError`].
pub fn stream(
    stage: &mut impl Stage,
    file: &FileStream,
    armed: &ArmedFrom,
) -> Result<StreamSummary, PlayError> {
    let groups = file.groups();
    approach(stage, groups, file.first())?;
    let standing = stage.snapshot();
    let requests = groups.iter().map(|group| stage.begin_stream(group)).collect::<Result<Vec<_>, _>>()?;
    let start_ns = stage.time_ns() + START_NS;
    armed.set_time(start_ns);
    let mut summary = StreamSummary::default();
    let (mut handed, mut resting, mut last) = (vec![0; groups.len()], 0, standing);
    loop {
        let since_start_s = (stage.time_ns() as f64 - start_ns as f64) / 1e9;
        for (group, handed) in groups.iter().zip(&mut handed) {
            let mut has_room = |number: usize| {
                let points = file.batch(number, group, start_ns, &standing);
                points.is_none_or(|points| stage.push(group, &points))
            };
            while *handed < file.arrived(since_start_s) && has_room(*handed) {
                *handed += 1;
            }
        }
        pass(stage)?;
        let snapshot = stage.snapshot();
        for request in &requests {
            if let Answer::Rejected(refusal) = snapshot.answers.of(*request) {
                return Err(PlayError::Refused(refusal));
            }
        }
        if let Some(stop) = fault_stop(&snapshot, groups) {
            wait_for_rest(stage, groups)?;
            return Err(PlayError::Stopped(stop));
        }
        if snapshot.slot == last.slot {
            continue;
        }
        for stream in of_groups(&snapshot, groups).map(|group| group.stream) {
            summary.late_points = summary.late_points.max(stream.counts.late_points);
            summary.lost_points = summary.lost_points.max(stream.counts.lost_points);
            if stream.state == StreamState::Following {
                summary.lag_ns = stream.counts.lag_ns;
                summary.lag_max_ns = summary.lag_max_ns.max(stream.counts.lag_ns);
            }
        }
        let is_still =
            snapshot.axes.iter().zip(&last.axes).all(|(now, before)| now.position_set == before.position_set);
        resting = if is_still { resting + 1 } else { 0 };
        last = snapshot;
        let is_over = since_start_s > file.end_s();
        let are_dry = of_groups(&snapshot, groups).all(|group| group.stream.state == StreamState::Dry);
        let have_run_dry = are_dry && resting > RESTING_LOOKS;
        if is_over && (have_run_dry || since_start_s > file.end_s() + COMING_TO_REST_S) {
            stage.stop()?;
            wait_for_rest(stage, groups)?;
            return Ok(summary);
        }
    }
}

/// The states of these groups.
fn of_groups<'a>(
    snapshot: &'a Snapshot,
    groups: &'a [PlayedGroup],
) -> impl Iterator<Item = &'a GroupSnapshot> {
    // Before the first cycle, the snapshot counts one group.
    groups.iter().filter_map(|group| snapshot.groups.get(usize::from(group.number)))
}

fn are_resting(snapshot: &Snapshot, groups: &[PlayedGroup]) -> bool {
    let is_resting =
        |group: &GroupSnapshot| matches!(group.phase, Phase::Holding | Phase::Disabled | Phase::Passive);
    of_groups(snapshot, groups).all(is_resting)
}

/// The first stop of these groups that nobody has asked for.
fn fault_stop(snapshot: &Snapshot, groups: &[PlayedGroup]) -> Option<StopReason> {
    let stops = of_groups(snapshot, groups).filter_map(|group| group.stop);
    stops.filter(|stop| !stop.is_requested()).min_by_key(|stop| stop.slot)
}

/// Waits until the groups are enabled, and leads the axes that the file names to their first positions.
fn approach(stage: &mut impl Stage, groups: &[PlayedGroup], first: &[Option<f64>]) -> Result<(), PlayError> {
    while !of_groups(&stage.snapshot(), groups).all(|group| group.phase == Phase::Holding) {
        pass(stage)?;
    }
    let axes = stage.snapshot().axes;
    let target: Vec<f64> =
        first.iter().zip(&axes).map(|(first, axis)| first.unwrap_or(axis.position_set)).collect();
    let motions = groups.iter().map(|group| stage.move_to(group, &target)).collect::<Result<Vec<_>, _>>()?;
    groups.iter().zip(motions).try_for_each(|(group, motion)| wait(stage, group, motion))
}

fn wait_for_rest(stage: &mut impl Stage, groups: &[PlayedGroup]) -> Result<(), PlayError> {
    while !are_resting(&stage.snapshot(), groups) {
        pass(stage)?;
    }
    Ok(())
}

fn pass(stage: &mut impl Stage) -> Result<(), PlayError> {
    if stage.pass() { Ok(()) } else { Err(PlayError::Ended) }
}

/// Waits until a motion of a group has ended, and the group is at rest.
fn wait(stage: &mut impl Stage, group: &PlayedGroup, motion: RequestId) -> Result<(), PlayError> {
    loop {
        let snapshot = stage.snapshot();
        let is_resting = are_resting(&snapshot, std::slice::from_ref(group));
        match (snapshot.motions.of(motion), snapshot.answers.of(motion)) {
            (Some(MotionState::Finished), _) if is_resting => return Ok(()),
            (Some(MotionState::Stopped(stop)), _) if is_resting => return Err(PlayError::Stopped(stop)),
            (Some(MotionState::Replaced { .. }), _) => return Err(PlayError::Replaced),
            (None, Answer::Rejected(refusal)) => return Err(PlayError::Refused(refusal)),
            _ => pass(stage)?,
        }
    }
}
