//! What a handle commands: moves, targets of profile modes, stops, enabling.

use std::time::Duration;

use takt_rt::{
    Answer, AxisSnapshot, ControlLaw, MAX_AXES, ModeChange, Move, OperationMode, ProfileMove, ProfileTarget,
    Request, RequestId, RequestTarget, Snapshot, StopCategory,
};

use super::Handle;
use crate::channels::{MotionEnd, WAITING_AT_MOST};
use crate::command::{
    CommandError, MotionId, MoveOptions, RecoveryError, Refused, RunningController, needed,
};
use crate::config::{Axis, Control};

impl Handle {
    /// Starts a coordinated move of every axis to its target (rad or m), where the axes come to rest. A move in progress is
    /// replanned from the present set-points. A drive in profile position plans its own profile. A drive in profile velocity
    /// or profile torque keeps its velocity or torque.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn move_to(&self, target: &[f64]) -> Result<MotionId, CommandError> {
        self.move_with(target, MoveOptions::default())
    }

    /// The same as [`Handle::move_to`], within fractions of the limits.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn move_with(&self, target: &[f64], options: MoveOptions) -> Result<MotionId, CommandError> {
        let axes: Vec<usize> = (0..self.axes().len()).collect();
        self.move_axes(RequestTarget::All, &axes, target, options)
    }

    /// As [`Handle::move_with`], by a distance (rad or m) from the present set-point of each axis: of an axis in motion, from where it is
    /// to be at this moment.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn move_by(&self, distance: &[f64], options: MoveOptions) -> Result<MotionId, CommandError> {
        let axes: Vec<usize> = (0..self.axes().len()).collect();
        self.move_axes(RequestTarget::All, &axes, &self.beyond_set_points(&axes, distance), options)
    }

    /// The set-points of the axes with these numbers, and a distance beyond each.
    pub(super) fn beyond_set_points(&self, axes: &[usize], distance: &[f64]) -> Vec<f64> {
        let state = self.state();
        let set_point = |axis: usize| state.axes().get(axis).map_or(0.0, |axis| axis.position_set);
        // A distance without an axis stays, so that the count is refused.
        let from = axes.iter().map(|axis| set_point(*axis)).chain(std::iter::repeat(0.0));
        distance.iter().zip(from).map(|(distance, from)| from + distance).collect()
    }

    /// Moves the axes with these numbers, which are those of the group that is asked.
    pub(super) fn move_axes(
        &self,
        group: RequestTarget,
        axes: &[usize],
        target: &[f64],
        options: MoveOptions,
    ) -> Result<MotionId, CommandError> {
        if target.len() != axes.len() {
            return Err(CommandError::Count { given: target.len(), axes: axes.len() });
        }
        let mut all = [0.0; MAX_AXES];
        for (index, value) in axes.iter().zip(target) {
            let (Some(axis), Some(to)) = (self.axes().get(*index), all.get_mut(*index)) else { continue };
            within(axis, *value, axis.limits.position_min, axis.limits.position_max)?;
            *to = *value;
        }
        let request = Request::Move(Move {
            target: all,
            target_velocity: [0.0; MAX_AXES],
            velocity_scale: options.velocity_scale,
            acceleration_scale: options.acceleration_scale,
            minimum_duration_s: options.minimum_duration_s,
        });
        self.begin_motion(group, request)
    }

    /// Gives a drive in profile velocity a velocity (rad/s or m/s). Unless it is given again within `valid_for`, the group
    /// stops.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn velocity(
        &self,
        axis: usize,
        velocity: f64,
        valid_for: Duration,
    ) -> Result<MotionId, CommandError> {
        let own = self.axis(axis, ControlLaw::ProfileVelocity, needed::PROFILE_VELOCITY)?;
        within(own, velocity, -own.limits.velocity, own.limits.velocity)?;
        self.set_profile_target(axis, ProfileTarget::Velocity(velocity), valid_for)
    }

    /// Gives a drive in profile torque a torque (N·m or N). Unless it is given again within `valid_for`, the group stops.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn torque(&self, axis: usize, torque: f64, valid_for: Duration) -> Result<MotionId, CommandError> {
        let own = self.axis(axis, ControlLaw::ProfileTorque, needed::PROFILE_TORQUE)?;
        within(own, torque, -own.limits.torque, own.limits.torque)?;
        self.set_profile_target(axis, ProfileTarget::Torque(torque), valid_for)
    }

    /// Changes the mode of operation of every axis, as far as `modes` of the configuration allow. An axis that is in it already stays.
    ///
    /// The axes keep their places. A drive that takes another mode only while it is disabled must be disabled before
    /// ([`Handle::disable`]), and enabled again after that. [`Handle::wait`] returns when the drives show the new mode. Until then
    /// nothing else is possible but to stop and to disable, which ends the change. Of a stop of category 2, which leaves the change
    /// under way, the wait tells as well. A drive that does not show the mode in time is a fault, which must be reset, and is told its
    /// former mode again.
    ///
    /// With several groups, each changes by [`GroupHandle::change_mode`](super::GroupHandle::change_mode).
    ///
    /// ```no_run
    /// # fn example(arm: &takt::Handle) -> takt::Result {
    /// use std::time::Duration;
    /// use takt::{OperationMode, Phase};
    ///
    /// let patience = Duration::from_secs(5);
    /// arm.disable()?;
    /// arm.wait_for(Phase::Disabled, patience)?;
    /// let change = arm.change_mode(OperationMode::CyclicSynchronousVelocity)?;
    /// arm.wait(change, patience)?;
    /// arm.enable()?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`CommandError::Full`], [`CommandError::Ended`]. That the change is refused says [`Handle::wait`].
    pub fn change_mode(&self, mode: OperationMode) -> Result<MotionId, CommandError> {
        let axes: Vec<usize> = (0..self.axes().len()).collect();
        self.change_modes(RequestTarget::All, &axes, mode)
    }

    /// As [`Handle::change_mode`], for one axis. The others of its group hold, or stay disabled, meanwhile.
    ///
    /// # Errors
    /// [`CommandError::NoSuchAxis`], and as [`Handle::change_mode`].
    pub fn change_axis_mode(&self, axis: usize, mode: OperationMode) -> Result<MotionId, CommandError> {
        if axis >= self.axes().len() {
            return Err(CommandError::NoSuchAxis { axis, axes: self.axes().len() });
        }
        self.change_modes(self.group_of(axis), &[axis], mode)
    }

    /// Changes the mode of these axes, which are of the group that is asked.
    pub(super) fn change_modes(
        &self,
        group: RequestTarget,
        axes: &[usize],
        mode: OperationMode,
    ) -> Result<MotionId, CommandError> {
        let mut modes = [None; MAX_AXES];
        for axis in axes {
            if let Some(own) = modes.get_mut(*axis) {
                *own = Some(mode);
            }
        }
        self.begin_motion(group, Request::ChangeMode(ModeChange { modes }))
    }

    /// How an axis is commanded at present, by a state.
    pub(super) fn present_control(axis: &Axis, shown: &AxisSnapshot) -> Control {
        let present = axis.controls().find(|control| control.operation_mode() as i8 == shown.mode_set);
        *present.unwrap_or(&axis.control)
    }

    /// Requests a stop of this category, and returns at once. A stop is never refused. The real-time thread takes it in its next cycle. It
    /// discards all requests of handles that are still waiting, so that they neither delay the stop nor begin after it.
    ///
    /// The call is wait-free, allocates nothing and takes no lock. So no other thread can hold it up, and it may be called in a
    /// signal handler.
    ///
    /// # Errors
    /// [`CommandError::Ended`].
    pub fn stop(&self, category: StopCategory) -> Result<(), CommandError> {
        self.stop_of(RequestTarget::All, category)
    }

    pub(super) fn stop_of(&self, target: RequestTarget, category: StopCategory) -> Result<(), CommandError> {
        if self.has_ended() {
            return Err(CommandError::Ended);
        }
        self.0.clients.stop_of(target, MotionEnd::Stop(category));
        Ok(())
    }

    /// Begins to bring the axes to rest and to disable them. It discards waiting requests as [`Handle::stop`] does.
    ///
    /// # Errors
    /// [`CommandError::Refused`], [`CommandError::Ended`].
    pub fn disable(&self) -> Result<(), CommandError> {
        self.disable_of(RequestTarget::All)
    }

    pub(super) fn disable_of(&self, target: RequestTarget) -> Result<(), CommandError> {
        if self.has_ended() {
            return Err(CommandError::Ended);
        }
        let id = self.0.clients.stop_of(target, MotionEnd::Disable);
        // A later request to disable may have been taken in place of this one. Then its answer counts.
        self.wait_for_answer(|_| Ok(self.0.clients.taken_as(target, MotionEnd::Disable, id)))
    }

    /// Begins to enable the axes again: after [`Handle::disable`], or after a fault and [`Handle::reset_faults`].
    ///
    /// # Errors
    /// [`CommandError::Refused`] unless the axes are disabled and no fault is latched, [`CommandError::Full`],
    /// [`CommandError::Ended`].
    pub fn enable(&self) -> Result<(), CommandError> {
        self.request(Request::Enable)
    }

    /// Clears latched faults.
    ///
    /// # Errors
    /// [`CommandError::Refused`] in motion, [`CommandError::Full`], [`CommandError::Ended`].
    pub fn reset_faults(&self) -> Result<(), CommandError> {
        self.request(Request::ResetFaults)
    }

    /// Brings the drives up again, which must be disabled: after one has lost its power or was reset, or after its interface was down. Returns
    /// when they report. The axes stay disabled, and a latched fault stays.
    ///
    /// # Errors
    /// [`RecoveryError::Command`] unless the axes are disabled, [`RecoveryError::NotBroughtUp`], [`RecoveryError::Wait`] after `at_most`. A
    /// bring-up that takes longer continues. After one that has failed, enabling is refused until a bring-up has succeeded.
    pub fn bring_up(&self, at_most: Duration) -> Result<(), RecoveryError> {
        RunningController::bring_up(self, RequestTarget::All, at_most)
    }

    /// Takes the axes out of what has stopped them: waits until they are still, clears the fault, brings drives up that do not report any
    /// more or whose last bring-up has failed, and enables. Returns when the axes hold their position; at once where they are in operation without a fault.
    ///
    /// # Errors
    /// As [`Handle::bring_up`]; [`RecoveryError::Stopped`] where a fault stops the axes again. A stop that comes meanwhile ends the call with
    /// [`CommandError::Overtaken`], and the axes are not enabled.
    pub fn recover(&self, at_most: Duration) -> Result<(), RecoveryError> {
        RunningController::recover(self, RequestTarget::All, at_most)
    }

    fn expiry_ns(&self, valid_for: Duration) -> u64 {
        let valid_ns = u64::try_from(valid_for.as_nanos()).unwrap_or(u64::MAX);
        self.now_ns().saturating_add(valid_ns)
    }

    fn axis(&self, axis: usize, mode: ControlLaw, needed: &'static str) -> Result<&Axis, CommandError> {
        let own = self.axes().get(axis).ok_or(CommandError::NoSuchAxis { axis, axes: self.axes().len() })?;
        if own.control == mode {
            Ok(own)
        } else {
            Err(CommandError::WrongMode { axis: own.name.clone(), needed: needed.to_owned() })
        }
    }

    fn set_profile_target(
        &self,
        axis: usize,
        target: ProfileTarget,
        valid_for: Duration,
    ) -> Result<MotionId, CommandError> {
        // The number of an existing axis fits.
        let wanted = ProfileMove { axis: axis as u8, target, valid_until_ns: self.expiry_ns(valid_for) };
        self.begin_motion(self.group_of(axis), Request::SetProfileTarget(wanted))
    }

    /// Submits a request for all groups and waits until it is granted.
    pub(super) fn request(&self, request: Request) -> Result<(), CommandError> {
        self.request_of(RequestTarget::All, request)
    }

    /// Submits a request and waits until it is granted.
    pub(super) fn request_of(&self, target: RequestTarget, request: Request) -> Result<(), CommandError> {
        let id = self.submit(target, request)?;
        self.wait_for_grant(target, id)
    }

    /// Waits until a request that was submitted is granted.
    pub(super) fn wait_for_grant(&self, target: RequestTarget, id: RequestId) -> Result<(), CommandError> {
        self.wait_for_answer(|state| {
            let is_answered = state.answers.of(id) != Answer::None;
            if !is_answered && self.is_discarded(target, id, state) {
                Err(CommandError::Overtaken)
            } else {
                Ok(Some(id))
            }
        })
    }

    fn begin_motion(&self, target: RequestTarget, request: Request) -> Result<MotionId, CommandError> {
        Ok(MotionId { request: self.submit(target, request)?, target })
    }

    /// The group of an axis, by whose stops what is asked of the axis is discarded.
    fn group_of(&self, axis: usize) -> RequestTarget {
        let group = self.groups().iter().position(|group| group.axes.contains(&axis));
        let group = group.and_then(|group| u8::try_from(group).ok());
        group.filter(|_| self.groups().len() > 1).map_or(RequestTarget::All, RequestTarget::Group)
    }

    /// Submits a request. It is taken in the next cycle, unless many others wait.
    pub(super) fn submit(&self, target: RequestTarget, request: Request) -> Result<RequestId, CommandError> {
        if self.0.life.is_ending() {
            return Err(CommandError::Ended);
        }
        self.0.clients.submit_to(target, request).ok_or(CommandError::Full { waiting: WAITING_AT_MOST })
    }

    /// Waits until a request is granted. `taken` is the request whose answer counts, once that is known.
    fn wait_for_answer(
        &self,
        taken: impl Fn(&Snapshot) -> Result<Option<RequestId>, CommandError>,
    ) -> Result<(), CommandError> {
        let answer = self.wait_until(Duration::MAX, |state| {
            let id = match taken(state) {
                Ok(id) => id?,
                Err(error) => return Some(Err(error)),
            };
            match state.answers.of(id) {
                Answer::Granted => Some(Ok(())),
                Answer::Rejected(refusal) => Some(Err(Refused::new(refusal, self.machine()).into())),
                Answer::None if state.answers.have_forgotten(id) => Some(Err(CommandError::Unanswered)),
                Answer::None => None,
            }
        });
        answer.unwrap_or(Err(CommandError::Ended))
    }
}

fn within(axis: &Axis, value: f64, lowest: f64, highest: f64) -> Result<(), CommandError> {
    if (lowest..=highest).contains(&value) {
        Ok(())
    } else {
        Err(CommandError::OutsideLimits { axis: axis.name.clone(), value, lowest, highest })
    }
}
