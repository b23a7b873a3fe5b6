//! A performance: from an arm that is enabled to the end of the file, whatever brings the arm from cycle to cycle.

use takt_rt::{Answer, MotionState, Phase, RequestError, RequestId, Snapshot, StopReason};

use super::set_points::ArmedFrom;
use super::trajectory::FileTrajectory;
use crate::trajectory::{Trajectory, TrajectoryConditions, TrajectoryError};

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

    /// Begins a move of every axis to rest, within [`APPROACH_SCALE`].
    ///
    /// # Errors
    /// See [`PlayError`].
    fn move_to(&mut self, target: &[f64]) -> Result<RequestId, PlayError>;

    /// Begins a trajectory, which is made from where the axes are.
    ///
    /// # Errors
    /// See [`PlayError`].
    fn execute(&mut self, make: MakeTrajectory<'_>) -> Result<RequestId, PlayError>;
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
    while stage.snapshot().phase != Phase::Holding {
        pass(stage)?;
    }
    let snapshot = stage.snapshot();
    let target: Vec<f64> = file
        .first()
        .iter()
        .zip(&snapshot.axes)
        .map(|(first, axis)| first.unwrap_or(axis.position_set))
        .collect();
    let approach = stage.move_to(&target)?;
    wait(stage, approach)?;
    armed.set(stage.snapshot().slot + 1);
    let motion = stage.execute(&|conditions| file.trajectory(conditions))?;
    wait(stage, motion)
}

fn pass(stage: &mut impl Stage) -> Result<(), PlayError> {
    if stage.pass() { Ok(()) } else { Err(PlayError::Ended) }
}

/// Waits until a motion has ended, and the arm with it.
fn wait(stage: &mut impl Stage, motion: RequestId) -> Result<(), PlayError> {
    loop {
        let snapshot = stage.snapshot();
        let is_resting = matches!(snapshot.phase, Phase::Holding | Phase::Disabled | Phase::Passive);
        match (snapshot.motions.of(motion), snapshot.answers.of(motion)) {
            (Some(MotionState::Finished), _) if is_resting => return Ok(()),
            (Some(MotionState::Stopped(stop)), _) if is_resting => return Err(PlayError::Stopped(stop)),
            (Some(MotionState::Replaced { .. }), _) => return Err(PlayError::Replaced),
            (None, Answer::Rejected(refusal)) => return Err(PlayError::Refused(refusal)),
            _ => pass(stage)?,
        }
    }
}
