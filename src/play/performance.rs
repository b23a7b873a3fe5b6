//! A performance: from an arm that is enabled to the end of the file, whatever brings the arm from cycle to cycle.

use takt_rt::{Answer, MotionState, Phase, RequestError, RequestId, Snapshot, StopReason};

use super::error::PlayFileError;
use super::set_points::ArmedFrom;
use super::trajectory::FileTrajectory;
use crate::config::Axis;
use crate::trajectory::Trajectory;

/// The fraction of the limits with which the arm is led to the first point.
pub const APPROACH_SCALE: f64 = 0.3;

/// An arm that is enabled.
pub trait Stage {
    /// The state after the newest cycle.
    fn snapshot(&mut self) -> Snapshot;

    /// Lets some time pass. Returns whether the run goes on: it ends by itself, or because it is interrupted.
    fn pass(&mut self) -> bool;

    /// Begins a move of every axis to rest, within [`APPROACH_SCALE`]. `None` if the run has ended.
    fn move_to(&mut self, target: &[f64]) -> Option<RequestId>;

    /// Begins a trajectory. `None` if the run has ended.
    fn execute(&mut self, trajectory: Trajectory) -> Option<RequestId>;
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
    /// From where the arm stands now, the file cannot be executed.
    File(PlayFileError),
}

/// Leads the arm to the first point of the file, and executes it.
///
/// # Errors
/// See [`PlayError`].
pub fn execute(
    stage: &mut impl Stage,
    file: &FileTrajectory,
    axes: &[Axis],
    period_s: f64,
    armed: &ArmedFrom,
) -> Result<(), PlayError> {
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
    let approach = stage.move_to(&target).ok_or(PlayError::Ended)?;
    wait(stage, approach)?;
    let snapshot = stage.snapshot();
    let positions: Vec<f64> = snapshot.axes.iter().take(axes.len()).map(|axis| axis.position_set).collect();
    let trajectory = file.trajectory(&positions, axes, period_s).map_err(PlayError::File)?;
    armed.set(snapshot.slot + 1);
    let motion = stage.execute(trajectory).ok_or(PlayError::Ended)?;
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
