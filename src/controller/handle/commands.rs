//! What a handle commands: moves, targets of profile modes, stops, enabling.

use std::time::Duration;

use takt_rt::{
    Answer, AxisSnapshot, ControlLaw, MAX_AXES, ModeChange, Move, OperationMode, ProfileMove, ProfileTarget,
    Request, RequestId, RequestTarget, Snapshot,
};

use super::OwnProcess;
use crate::channels::{MotionEnd, WAITING_AT_MOST};
use crate::command::{Backend, CommandError, MotionId, MoveOptions, Refused, motion, needed};
use crate::config::{Axis, Control};

impl OwnProcess {
    /// Whom a request for the axes of a target is for. What is asked of the only group is asked of all.
    pub(super) fn asked(&self, target: RequestTarget) -> RequestTarget {
        if self.groups.len() > 1 { target } else { RequestTarget::All }
    }

    /// The set-points of the axes with these numbers, and a distance beyond each.
    pub(super) fn beyond_set_points(&self, axes: &[usize], distance: &[f64]) -> Vec<f64> {
        let state = self.observer.snapshot();
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
            let (Some(axis), Some(to)) = (self.axes.get(*index), all.get_mut(*index)) else { continue };
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

    pub(super) fn give_velocity(
        &self,
        axis: usize,
        velocity: f64,
        valid_for: Duration,
    ) -> Result<MotionId, CommandError> {
        let own = self.axis(axis, ControlLaw::ProfileVelocity, needed::PROFILE_VELOCITY)?;
        within(own, velocity, -own.limits.velocity, own.limits.velocity)?;
        self.set_profile_target(axis, ProfileTarget::Velocity(velocity), valid_for)
    }

    pub(super) fn give_torque(
        &self,
        axis: usize,
        torque: f64,
        valid_for: Duration,
    ) -> Result<MotionId, CommandError> {
        let own = self.axis(axis, ControlLaw::ProfileTorque, needed::PROFILE_TORQUE)?;
        within(own, torque, -own.limits.torque, own.limits.torque)?;
        self.set_profile_target(axis, ProfileTarget::Torque(torque), valid_for)
    }

    /// Changes the mode of one axis.
    pub(super) fn change_axis_mode(
        &self,
        axis: usize,
        mode: OperationMode,
    ) -> Result<MotionId, CommandError> {
        if axis >= self.axes.len() {
            return Err(CommandError::NoSuchAxis { axis, axes: self.axes.len() });
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

    pub(super) fn disable(&self, target: RequestTarget) -> Result<(), CommandError> {
        if self.has_ended() {
            return Err(CommandError::Ended);
        }
        let id = self.clients.stop_of(target, MotionEnd::Disable);
        // A later request to disable may have been taken in place of this one. Then its answer counts.
        self.wait_for_answer(|_| Ok(self.clients.taken_as(target, MotionEnd::Disable, id)))
    }

    fn expiry_ns(&self, valid_for: Duration) -> u64 {
        let valid_ns = u64::try_from(valid_for.as_nanos()).unwrap_or(u64::MAX);
        self.now_ns().saturating_add(valid_ns)
    }

    fn axis(&self, axis: usize, mode: ControlLaw, needed: &'static str) -> Result<&Axis, CommandError> {
        let own = self.axes.get(axis).ok_or(CommandError::NoSuchAxis { axis, axes: self.axes.len() })?;
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

    /// Submits a request and waits until it is granted.
    pub(super) fn request(&self, target: RequestTarget, request: Request) -> Result<(), CommandError> {
        let id = self.hand_in(target, request)?;
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
        Ok(MotionId { request: self.hand_in(target, request)?, target })
    }

    /// The group of an axis, by whose stops what is asked of the axis is discarded.
    fn group_of(&self, axis: usize) -> RequestTarget {
        let group = self.groups.iter().position(|group| group.axes.contains(&axis));
        let group = group.and_then(|group| u8::try_from(group).ok());
        group.filter(|_| self.groups.len() > 1).map_or(RequestTarget::All, RequestTarget::Group)
    }

    /// Submits a request. It is taken in the next cycle, unless many others wait.
    pub(super) fn hand_in(&self, target: RequestTarget, request: Request) -> Result<RequestId, CommandError> {
        if self.life.is_ending() {
            return Err(CommandError::Ended);
        }
        self.clients.submit_to(target, request).ok_or(CommandError::Full { waiting: WAITING_AT_MOST })
    }

    /// Returns `true` if a stop has discarded a request that has no answer in this state.
    pub(super) fn is_discarded(&self, target: RequestTarget, request: RequestId, state: &Snapshot) -> bool {
        motion::is_discarded(state, request, self.clients.newest_stop(target))
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
