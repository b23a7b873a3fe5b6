//! One group of a controller in another process.

use std::time::Duration;

use takt::command::{
    CommandError, MotionId, MoveOptions, RecoveryError, RunningController, Stopped, WaitError, groups_in,
};
use takt::trajectory::TrajectoryPoint;
use takt_rt::{GroupSnapshot, OperationMode, Phase, RequestTarget, StopCategory};

use crate::client::Client;
use crate::stream::ClientStream;

/// Commands and observes one group of a controller of another process. It has the calls of a [`GroupHandle`](takt::GroupHandle), with the
/// same meaning; the errors of all commands are those of [`Client::move_to`].
#[derive(Clone, Debug)]
pub struct ClientGroup {
    client: Client,
    target: RequestTarget,
}

impl Client {
    /// The group with this name in the configuration of the controller.
    ///
    /// # Errors
    /// [`CommandError::NoSuchGroup`].
    pub fn group(&self, name: &str) -> Result<ClientGroup, CommandError> {
        Ok(ClientGroup { client: self.clone(), target: self.group_named(name)? })
    }
}

impl ClientGroup {
    /// The numbers of its axes, in the order in which the configuration names them in the group.
    pub fn axes(&self) -> Vec<usize> {
        self.client.axes_of(self.target)
    }

    /// See [`GroupHandle::number`](takt::GroupHandle::number).
    pub const fn number(&self) -> u8 {
        match self.target {
            RequestTarget::Group(number) => number,
            RequestTarget::All => 0,
        }
    }

    /// See [`GroupHandle::state`](takt::GroupHandle::state).
    pub fn state(&self) -> GroupSnapshot {
        groups_in(&self.client.state(), self.target).first().copied().unwrap_or_default()
    }

    /// See [`GroupHandle::fault`](takt::GroupHandle::fault).
    pub fn fault(&self) -> Option<Stopped> {
        self.client.fault_in(self.target)
    }

    /// See [`GroupHandle::move_to`](takt::GroupHandle::move_to).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn move_to(&self, target: &[f64]) -> Result<MotionId, CommandError> {
        self.move_with(target, MoveOptions::default())
    }

    /// See [`GroupHandle::move_with`](takt::GroupHandle::move_with).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn move_with(&self, target: &[f64], options: MoveOptions) -> Result<MotionId, CommandError> {
        self.client.begin_move(self.target, target, options)
    }

    /// See [`GroupHandle::move_by`](takt::GroupHandle::move_by).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn move_by(&self, distance: &[f64], options: MoveOptions) -> Result<MotionId, CommandError> {
        self.client.begin_move_by(self.target, distance, options)
    }

    /// See [`GroupHandle::execute`](takt::GroupHandle::execute).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn execute(&self, points: &[TrajectoryPoint]) -> Result<MotionId, CommandError> {
        self.client.begin_trajectory(self.target, points)
    }

    /// See [`GroupHandle::move_through`](takt::GroupHandle::move_through).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn move_through(&self, waypoints: &[Vec<f64>]) -> Result<MotionId, CommandError> {
        self.client.begin_through(self.target, waypoints)
    }

    /// See [`GroupHandle::change_mode`](takt::GroupHandle::change_mode).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn change_mode(&self, mode: OperationMode) -> Result<MotionId, CommandError> {
        self.client.begin_mode_change(self.target, mode)
    }

    /// See [`GroupHandle::begin_stream`](takt::GroupHandle::begin_stream).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn begin_stream(&self) -> Result<(), CommandError> {
        self.client.begin_streaming(self.target)
    }

    /// See [`GroupHandle::stream`](takt::GroupHandle::stream).
    pub fn stream(&self) -> ClientStream {
        ClientStream::new(self.client.clone(), self.target)
    }

    /// As [`Client::stop`], of this group alone.
    ///
    /// # Errors
    /// See [`Client::stop`].
    pub fn stop(&self, category: StopCategory) -> Result<(), CommandError> {
        self.client.request_stop(self.target, category)
    }

    /// See [`GroupHandle::enable`](takt::GroupHandle::enable).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn enable(&self) -> Result<(), CommandError> {
        self.client.begin_enable(self.target)
    }

    /// See [`GroupHandle::disable`](takt::GroupHandle::disable).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn disable(&self) -> Result<(), CommandError> {
        self.client.begin_disable(self.target)
    }

    /// See [`GroupHandle::reset_faults`](takt::GroupHandle::reset_faults).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn reset_faults(&self) -> Result<(), CommandError> {
        self.client.clear_faults(self.target)
    }

    /// See [`GroupHandle::bring_up`](takt::GroupHandle::bring_up).
    ///
    /// # Errors
    /// As there, and as [`Client::move_to`].
    pub fn bring_up(&self, at_most: Duration) -> Result<(), RecoveryError> {
        RunningController::bring_up(&self.client, self.target, at_most)
    }

    /// See [`GroupHandle::recover`](takt::GroupHandle::recover).
    ///
    /// # Errors
    /// As there, and as [`Client::move_to`].
    pub fn recover(&self, at_most: Duration) -> Result<(), RecoveryError> {
        RunningController::recover(&self.client, self.target, at_most)
    }

    /// Waits until the group is in a phase.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn wait_for(&self, phase: Phase, at_most: Duration) -> Result<(), WaitError> {
        self.client.wait_for_phase(self.target, phase, at_most)
    }
}
