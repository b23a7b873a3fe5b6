//! One group of several: a gripper beside an arm. What is asked of it concerns no other group.

use std::time::Duration;

use takt_rt::{CallbackCycle, GroupSnapshot, OperationMode, Phase, Request, RequestTarget, StopCategory};

use super::Handle;
use super::in_loop::{CallbackHandle, CallbackOptions};
use crate::channels::{CallbackCommand, CallbackState};
use crate::command::{
    CommandError, MotionId, MoveOptions, RecoveryError, RunningController, Stopped, WaitError,
};

/// Commands and observes one group of a running controller, from any thread. Clones are cheap and equal. The drives in profile velocity
/// and profile torque are commanded by [`Handle::velocity`] and [`Handle::torque`]: the axis names its group.
#[derive(Clone)]
pub struct GroupHandle {
    pub(super) handle: Handle,
    pub(super) number: u8,
    pub(super) axes: Vec<usize>,
}

impl Handle {
    /// The group with this name in the configuration.
    ///
    /// # Errors
    /// [`CommandError::NoSuchGroup`].
    pub fn group(&self, name: &str) -> Result<GroupHandle, CommandError> {
        let found = (0..).zip(self.groups()).find(|(_, group)| group.name == name);
        let (number, group) = found.ok_or_else(|| CommandError::NoSuchGroup {
            name: name.to_owned(),
            groups: self.groups().iter().map(|group| group.name.clone()).collect(),
        })?;
        Ok(GroupHandle { handle: self.clone(), number, axes: group.axes.clone() })
    }

    /// The group with this number; all axes, where the configuration has no groups.
    pub fn group_of_number(&self, number: u8) -> GroupHandle {
        let axes = match self.groups().get(usize::from(number)) {
            Some(group) => group.axes.clone(),
            None => (0..self.axes().len()).collect(),
        };
        GroupHandle { handle: self.clone(), number, axes }
    }

    /// The only group that there is.
    pub(super) fn only_group(&self) -> Result<GroupHandle, CommandError> {
        if self.groups().len() > 1 {
            let groups = self.groups().iter().map(|group| group.name.clone()).collect();
            return Err(CommandError::SeveralGroups { groups });
        }
        Ok(self.group_of_number(0))
    }
}

impl GroupHandle {
    /// Its number among the groups of the controller.
    pub fn number(&self) -> u8 {
        self.number
    }

    /// The numbers of its axes, in the order in which the configuration names them in the group.
    pub fn axes(&self) -> &[usize] {
        &self.axes
    }

    /// What it is doing, the time left of its present move, and why it has stopped, after the newest complete cycle.
    pub fn state(&self) -> GroupSnapshot {
        let state = self.handle.state();
        state.groups().get(usize::from(self.number)).copied().unwrap_or_default()
    }

    /// As [`Handle::fault`], for the group.
    pub fn fault(&self) -> Option<Stopped> {
        self.handle.fault_in(RequestTarget::Group(self.number))
    }

    /// As [`Handle::move_to`], with a target for each axis of the group, in the order of [`GroupHandle::axes`].
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn move_to(&self, target: &[f64]) -> Result<MotionId, CommandError> {
        self.move_with(target, MoveOptions::default())
    }

    /// As [`Handle::move_with`], with a target for each axis of the group, in the order of [`GroupHandle::axes`].
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn move_with(&self, target: &[f64], options: MoveOptions) -> Result<MotionId, CommandError> {
        self.handle.move_axes(self.target(), &self.axes, target, options)
    }

    /// As [`Handle::move_by`], with a distance for each axis of the group, in the order of [`GroupHandle::axes`].
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn move_by(&self, distance: &[f64], options: MoveOptions) -> Result<MotionId, CommandError> {
        let target = self.handle.beyond_set_points(&self.axes, distance);
        self.handle.move_axes(self.target(), &self.axes, &target, options)
    }

    /// As [`Handle::in_loop`]: the function sees and commands the axes of the group, in the order of [`GroupHandle::axes`].
    ///
    /// # Errors
    /// See [`Handle::in_loop`].
    pub fn in_loop(
        &self,
        callback: impl FnMut(&CallbackState<'_>, &CallbackCycle, &mut CallbackCommand<'_>) + Send + 'static,
    ) -> Result<CallbackHandle, CommandError> {
        self.in_loop_with(CallbackOptions::default(), callback)
    }

    /// As [`Handle::in_loop_with`].
    ///
    /// # Errors
    /// See [`Handle::in_loop`].
    pub fn in_loop_with(
        &self,
        options: CallbackOptions,
        callback: impl FnMut(&CallbackState<'_>, &CallbackCycle, &mut CallbackCommand<'_>) + Send + 'static,
    ) -> Result<CallbackHandle, CommandError> {
        self.handle.lead_in_loop((self.target(), self.number), &self.axes, options, callback)
    }

    /// As [`Handle::change_mode`], for the axes of the group. [`Handle::change_axis_mode`] changes one of them.
    ///
    /// # Errors
    /// See [`Handle::change_mode`].
    pub fn change_mode(&self, mode: OperationMode) -> Result<MotionId, CommandError> {
        self.handle.change_modes(self.target(), &self.axes, mode)
    }

    /// As [`Handle::stop`]; it discards the waiting requests for this group, and for all of them.
    ///
    /// # Errors
    /// [`CommandError::Ended`].
    pub fn stop(&self, category: StopCategory) -> Result<(), CommandError> {
        self.handle.stop_of(self.target(), category)
    }

    /// As [`Handle::disable`].
    ///
    /// # Errors
    /// [`CommandError::Refused`], [`CommandError::Ended`].
    pub fn disable(&self) -> Result<(), CommandError> {
        self.handle.disable_of(self.target())
    }

    /// As [`Handle::enable`]. The other groups may be in motion.
    ///
    /// # Errors
    /// See [`Handle::enable`].
    pub fn enable(&self) -> Result<(), CommandError> {
        self.handle.request_of(self.target(), Request::Enable)
    }

    /// As [`Handle::reset_faults`].
    ///
    /// # Errors
    /// See [`Handle::reset_faults`].
    pub fn reset_faults(&self) -> Result<(), CommandError> {
        self.handle.request_of(self.target(), Request::ResetFaults)
    }

    /// As [`Handle::bring_up`]. The other groups may be in motion, but for those with axes of the same drives: they must be disabled, and are
    /// brought up with it.
    ///
    /// # Errors
    /// See [`Handle::bring_up`].
    pub fn bring_up(&self, at_most: Duration) -> Result<(), RecoveryError> {
        RunningController::bring_up(&self.handle, self.target(), at_most)
    }

    /// As [`Handle::recover`].
    ///
    /// # Errors
    /// See [`Handle::recover`].
    pub fn recover(&self, at_most: Duration) -> Result<(), RecoveryError> {
        RunningController::recover(&self.handle, self.target(), at_most)
    }

    /// Waits until the group is in a phase.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn wait_for(&self, phase: Phase, at_most: Duration) -> Result<(), WaitError> {
        let number = usize::from(self.number);
        self.handle.wait_until(at_most, |state| {
            state.groups().get(number).is_some_and(|group| group.phase == phase).then_some(())
        })
    }

    /// Whom its requests are for. What is asked of the only group is asked of all.
    pub(super) fn target(&self) -> RequestTarget {
        if self.handle.groups().len() > 1 { RequestTarget::Group(self.number) } else { RequestTarget::All }
    }
}
