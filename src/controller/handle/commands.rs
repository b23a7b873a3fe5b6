//! What a handle commands: moves, targets of profile modes, stops, enabling.

use std::time::Duration;

use takt_rt::{
    Answer, ControlLaw, MAX_AXES, Move, ProfileMove, ProfileTarget, Request, RequestId, Snapshot,
    StopCategory,
};

use super::Handle;
use super::error::{CommandError, Refused};
use super::motion::{MotionId, MoveOptions};
use super::waiting::now_ns;
use crate::config::Axis;
use crate::controller::channels::{MotionEnd, WAITING_AT_MOST};

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
        if target.len() != self.axes().len() {
            return Err(CommandError::Count { given: target.len(), axes: self.axes().len() });
        }
        for (axis, value) in self.axes().iter().zip(target) {
            within(axis, *value, axis.limits.position_min, axis.limits.position_max)?;
        }
        let mut all = [0.0; MAX_AXES];
        all.iter_mut().zip(target).for_each(|(to, from)| *to = *from);
        let request = Request::Move(Move {
            target: all,
            target_velocity: [0.0; MAX_AXES],
            velocity_scale: options.velocity_scale,
            acceleration_scale: options.acceleration_scale,
            minimum_duration_s: options.minimum_duration_s,
        });
        self.submit(request).map(MotionId)
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
        let own = self.axis(axis, ControlLaw::ProfileVelocity, "profile velocity, mode = \"pv\"")?;
        within(own, velocity, -own.limits.velocity, own.limits.velocity)?;
        self.set_profile_target(axis, ProfileTarget::Velocity(velocity), valid_for)
    }

    /// Gives a drive in profile torque a torque (N·m or N). Unless it is given again within `valid_for`, the group stops.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn torque(&self, axis: usize, torque: f64, valid_for: Duration) -> Result<MotionId, CommandError> {
        let own = self.axis(axis, ControlLaw::ProfileTorque, "profile torque, mode = \"pt\"")?;
        within(own, torque, -own.limits.torque, own.limits.torque)?;
        self.set_profile_target(axis, ProfileTarget::Torque(torque), valid_for)
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
        if self.has_ended() {
            return Err(CommandError::Ended);
        }
        self.0.clients.stop(MotionEnd::Stop(category));
        Ok(())
    }

    /// Begins to bring the axes to rest and to disable them. It discards waiting requests as [`Handle::stop`] does.
    ///
    /// # Errors
    /// [`CommandError::Refused`], [`CommandError::Ended`].
    pub fn disable(&self) -> Result<(), CommandError> {
        if self.has_ended() {
            return Err(CommandError::Ended);
        }
        let id = self.0.clients.stop(MotionEnd::Disable);
        // A later request to disable may have been taken in place of this one. Then its answer counts.
        self.wait_for_answer(|_| Ok(self.0.clients.taken_as(MotionEnd::Disable, id)))
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

    fn axis(&self, axis: usize, mode: ControlLaw, needed: &'static str) -> Result<&Axis, CommandError> {
        let own = self.axes().get(axis).ok_or(CommandError::NoSuchAxis { axis, axes: self.axes().len() })?;
        if own.control == mode {
            Ok(own)
        } else {
            Err(CommandError::WrongMode { axis: own.name.clone(), needed })
        }
    }

    fn set_profile_target(
        &self,
        axis: usize,
        target: ProfileTarget,
        valid_for: Duration,
    ) -> Result<MotionId, CommandError> {
        // The number of an existing axis fits.
        let wanted = ProfileMove { axis: axis as u8, target, valid_until_ns: expiry_ns(valid_for) };
        self.submit(Request::SetProfileTarget(wanted)).map(MotionId)
    }

    /// Submits a request and waits until it is granted.
    pub(super) fn request(&self, request: Request) -> Result<(), CommandError> {
        let id = self.submit(request)?;
        self.wait_for_grant(id)
    }

    /// Waits until a request that was submitted is granted.
    pub(super) fn wait_for_grant(&self, id: RequestId) -> Result<(), CommandError> {
        self.wait_for_answer(|state| {
            let is_answered = state.answers.of(id) != Answer::None;
            if !is_answered && self.is_discarded(id, state) {
                Err(CommandError::Overtaken)
            } else {
                Ok(Some(id))
            }
        })
    }

    /// Submits a request. It is taken in the next cycle, unless many others wait.
    pub(super) fn submit(&self, request: Request) -> Result<RequestId, CommandError> {
        if self.0.life.is_ending() {
            return Err(CommandError::Ended);
        }
        self.0.clients.submit(request).ok_or(CommandError::Full { waiting: WAITING_AT_MOST })
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

pub(super) fn expiry_ns(valid_for: Duration) -> u64 {
    let valid_ns = u64::try_from(valid_for.as_nanos()).unwrap_or(u64::MAX);
    now_ns().saturating_add(valid_ns)
}
