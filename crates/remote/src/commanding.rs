//! What a client commands: the calls of a handle.

use std::time::Duration;

use takt::command::{
    CommandError, MotionId, MoveOptions, RecoveryError, RunningController, TrajectoryProgress,
};
use takt::trajectory::TrajectoryPoint;
use takt_rt::{Frame, OperationMode, RequestTarget, StopCategory};

use crate::client::Client;
use crate::commands::Command;

impl Client {
    /// Takes the lease, or renews it, without a command.
    ///
    /// # Errors
    /// [`CommandError::Lease`] if another client has it, or has taken it from this one.
    pub fn take_lease(&self) -> Result<(), CommandError> {
        self.0.done(Command::Lease { is_taken_over: false })
    }

    /// Takes the lease from whoever has it. What moves goes on.
    ///
    /// # Errors
    /// [`CommandError::Lease`] without write permission, [`CommandError::Ended`].
    pub fn take_over(&self) -> Result<(), CommandError> {
        self.0.done(Command::Lease { is_taken_over: true })
    }

    /// Gives the lease back, so that another client need not wait for its end.
    ///
    /// # Errors
    /// [`CommandError::Ended`].
    pub fn release(&self) -> Result<(), CommandError> {
        self.0.done(Command::Release)
    }

    /// See [`Handle::ask_device`](takt::Handle::ask_device). It needs write permission, and no lease.
    ///
    /// # Errors
    /// As there; [`CommandError::Lease`] without write permission.
    pub fn ask_device(&self, bus: usize, question: Frame) -> Result<(), CommandError> {
        self.0.asked(Command::Question { bus, frame: question })
    }

    /// See [`Handle::move_to`](takt::Handle::move_to).
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then, but for [`CommandError::NoReply`].
    pub fn move_to(&self, target: &[f64]) -> Result<MotionId, CommandError> {
        self.move_with(target, MoveOptions::default())
    }

    /// See [`Handle::move_with`](takt::Handle::move_with).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn move_with(&self, target: &[f64], options: MoveOptions) -> Result<MotionId, CommandError> {
        self.begin_move(RequestTarget::All, target, options)
    }

    /// See [`Handle::move_by`](takt::Handle::move_by). The distances are from the set-points when the process of the controller takes it.
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn move_by(&self, distance: &[f64], options: MoveOptions) -> Result<MotionId, CommandError> {
        self.begin_move_by(RequestTarget::All, distance, options)
    }

    /// See [`Handle::execute`](takt::Handle::execute).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn execute(&self, points: &[TrajectoryPoint]) -> Result<MotionId, CommandError> {
        self.begin_trajectory(RequestTarget::All, points)
    }

    /// See [`Handle::move_through`](takt::Handle::move_through).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn move_through(&self, waypoints: &[Vec<f64>]) -> Result<MotionId, CommandError> {
        self.begin_through(RequestTarget::All, waypoints)
    }

    /// See [`Handle::set_speed`](takt::Handle::set_speed).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn set_speed(&self, motion: MotionId, rate: f64) -> Result<(), CommandError> {
        self.0.done(Command::SetSpeed { motion, rate })
    }

    /// See [`Handle::pause`](takt::Handle::pause).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn pause(&self, motion: MotionId) -> Result<(), CommandError> {
        self.0.done(Command::Pause(motion))
    }

    /// See [`Handle::resume`](takt::Handle::resume).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn resume(&self, motion: MotionId) -> Result<(), CommandError> {
        self.0.done(Command::Resume(motion))
    }

    /// See [`Handle::trajectory_progress`](takt::Handle::trajectory_progress). It needs no lease.
    ///
    /// # Errors
    /// [`CommandError::Lease`] without write permission, [`CommandError::NoReply`], [`CommandError::Ended`].
    pub fn trajectory_progress(&self, motion: MotionId) -> Result<Option<TrajectoryProgress>, CommandError> {
        self.0.progress(motion)
    }

    /// See [`Handle::velocity`](takt::Handle::velocity).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn velocity(
        &self,
        axis: usize,
        velocity: f64,
        valid_for: Duration,
    ) -> Result<MotionId, CommandError> {
        self.0.begun(Command::Velocity { axis, velocity, valid_for })
    }

    /// See [`Handle::torque`](takt::Handle::torque).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn torque(&self, axis: usize, torque: f64, valid_for: Duration) -> Result<MotionId, CommandError> {
        self.0.begun(Command::Torque { axis, torque, valid_for })
    }

    /// See [`Handle::change_mode`](takt::Handle::change_mode).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn change_mode(&self, mode: OperationMode) -> Result<MotionId, CommandError> {
        self.begin_mode_change(RequestTarget::All, mode)
    }

    /// See [`Handle::change_axis_mode`](takt::Handle::change_axis_mode).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn change_axis_mode(&self, axis: usize, mode: OperationMode) -> Result<MotionId, CommandError> {
        self.0.begun(Command::ChangeAxisMode { axis, mode })
    }

    /// See [`Handle::begin_stream`](takt::Handle::begin_stream).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn begin_stream(&self) -> Result<(), CommandError> {
        self.begin_streaming(RequestTarget::All)
    }

    /// See [`Handle::enable`](takt::Handle::enable).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn enable(&self) -> Result<(), CommandError> {
        self.begin_enable(RequestTarget::All)
    }

    /// See [`Handle::disable`](takt::Handle::disable).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn disable(&self) -> Result<(), CommandError> {
        self.begin_disable(RequestTarget::All)
    }

    /// See [`Handle::reset_faults`](takt::Handle::reset_faults).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn reset_faults(&self) -> Result<(), CommandError> {
        self.clear_faults(RequestTarget::All)
    }

    /// See [`Handle::bring_up`](takt::Handle::bring_up).
    ///
    /// # Errors
    /// As there, and as [`Client::move_to`].
    pub fn bring_up(&self, at_most: Duration) -> Result<(), RecoveryError> {
        RunningController::bring_up(self, RequestTarget::All, at_most)
    }

    /// See [`Handle::recover`](takt::Handle::recover).
    ///
    /// # Errors
    /// As there, and as [`Client::move_to`].
    pub fn recover(&self, at_most: Duration) -> Result<(), RecoveryError> {
        RunningController::recover(self, RequestTarget::All, at_most)
    }

    /// Requests a stop of this category, and returns at once. It needs no lease, and is not queued behind any command of this or another
    /// client. What this client asks after it comes after it. See [`Handle::stop`](takt::Handle::stop).
    ///
    /// The call makes two system calls or three that do not wait, allocates nothing and takes no lock. So it may be called in a signal handler.
    ///
    /// # Errors
    /// [`CommandError::Lease`] without write permission, [`CommandError::Ended`], and [`CommandError::NoReply`] if the other process has
    /// taken none of many stops.
    pub fn stop(&self, category: StopCategory) -> Result<(), CommandError> {
        self.request_stop(RequestTarget::All, category)
    }
}
