//! An axis in a profile mode: targets instead of set-points.

use super::profile_mode::TimedTarget;
use super::{Axis, AxisParameters};
use crate::cia402_codec::ProfileRamps;
use crate::control::ControlLaw;
use crate::fault::Fault;
use crate::plan::State;
use crate::profile::ProfileTarget;
use crate::time::Nanoseconds;

/// Cycles of the bus from the position that is reported to a drive that acts on what was made of it: one for which a
/// drive's answer to a command has waited, one on the way, and one that the drive may take.
const REACTION_CYCLES: u32 = 3;

impl Axis {
    /// Returns `true` if the drive makes its own way to a target.
    pub fn is_profile(&self) -> bool {
        self.parameters.law.is_profile()
    }

    /// Returns `true` if the drive must bring the joint to rest by its own quick stop (object 6085). In profile torque a torque of 0 lets
    /// the joint coast: nothing but friction slows it.
    pub fn stops_by_itself(&self) -> bool {
        self.parameters.law == ControlLaw::ProfileTorque
    }

    /// Returns `true` if a target is of the kind that the axis' mode takes, and within its limits.
    pub fn accepts(&self, target: ProfileTarget) -> bool {
        let limits = &self.parameters.limits;
        match (self.parameters.law, target) {
            (ControlLaw::ProfilePosition, ProfileTarget::Position(position)) => limits.contain(position),
            (ControlLaw::ProfileVelocity, ProfileTarget::Velocity(velocity)) => {
                velocity.abs() <= limits.velocity
            }
            (ControlLaw::ProfileTorque, ProfileTarget::Torque(torque)) => torque.abs() <= limits.torque,
            _ => false,
        }
    }

    /// Takes a target that [`Axis::accepts`]. A velocity or a torque that is not zero expires.
    pub fn set_profile_target(&mut self, target: ProfileTarget, valid_until_ns: Nanoseconds) {
        let AxisParameters { scale, limits, .. } = &self.parameters;
        let (raw, needs_handshake) = match target {
            ProfileTarget::Position(position) => {
                (scale.position_command(position, limits), self.parameters.codec.acknowledges_set_points())
            }
            ProfileTarget::Velocity(velocity) => (scale.velocity_command(velocity, limits), false),
            ProfileTarget::Torque(torque) => (scale.torque_command(torque, limits), false),
        };
        self.profile.set(raw, needs_handshake, TimedTarget { target, valid_until_ns });
    }

    /// Makes rest the target of a drive in a profile mode: the nearest position at which the joint can stand, no velocity, no
    /// torque. See [`Axis::stops_by_itself`] for the latter.
    pub(super) fn stop_profile(&mut self) {
        let target = match self.parameters.law {
            ControlLaw::ProfilePosition => ProfileTarget::Position(self.nearest_rest()),
            ControlLaw::ProfileVelocity => ProfileTarget::Velocity(0.0),
            ControlLaw::ProfileTorque => ProfileTarget::Torque(0.0),
            _ => return,
        };
        self.set_profile_target(target, Nanoseconds::MAX);
    }

    /// How the drive decelerates.
    fn deceleration(&self) -> f64 {
        let limits = &self.parameters.limits;
        match self.parameters.codec.ramps {
            ProfileRamps::Separate => limits.deceleration,
            ProfileRamps::Common => limits.deceleration.min(limits.acceleration),
        }
    }

    /// The least distance in which the drive can stop.
    fn braking_distance(&self) -> f64 {
        self.velocity() * self.velocity() / (2.0 * self.deceleration())
    }

    /// How far the joint goes on, in its direction, when it is told to come to rest now: until the drive has heard that,
    /// which in profile position waits for the handshake, and while it decelerates.
    fn way_to_rest(&self) -> f64 {
        let limits = &self.parameters.limits;
        let reaction_s =
            f64::from(REACTION_CYCLES + self.profile.command.cycles_to_offer()) * self.reception.cycle_s();
        // It may still be speeding up.
        let speed = self.velocity().abs();
        let highest = (speed + limits.acceleration * reaction_s).min(limits.velocity.max(speed));
        let distance = highest * reaction_s + highest * highest / (2.0 * self.deceleration());
        if self.velocity() == 0.0 { 0.0 } else { distance.copysign(self.velocity()) }
    }

    /// Where the joint comes to rest if it is told to now: on its target, if that is on its way and it can stop there; never
    /// beyond its limits.
    fn nearest_rest(&self) -> f64 {
        let limits = &self.parameters.limits;
        let (position, velocity) = (self.position(), self.velocity());
        let (lowest, highest) = (limits.position_min.min(position), limits.position_max.max(position));
        let rest = (position + self.way_to_rest()).clamp(lowest, highest);
        let Some(ProfileTarget::Position(target)) = self.profile.target() else { return rest };
        let ahead = (target - position) * velocity.signum();
        if velocity == 0.0 || ahead <= 0.0 {
            return rest;
        }
        // A drive that is told to stop nearer than it can swings back. Its target is too near, so it does not speed up.
        let braking = self.braking_distance();
        let reaction = velocity.abs() * f64::from(REACTION_CYCLES) * self.reception.cycle_s();
        let nearest = if ahead < braking { reaction + braking } else { ahead };
        rest.max(position - nearest).min(position + nearest)
    }

    /// Returns `true` if the drive has its target and says that it has reached it; an axis that follows set-points always has. A joint
    /// that coasts has reached its target when it stands.
    pub fn is_target_reached(&self) -> bool {
        let is_there = || self.profile.command.is_reached(self.statusword());
        !self.is_profile() || !self.is_coasting() && is_there()
    }

    /// Returns `true` if the joint moves and its drive does not drive it: with a profile torque of zero it coasts, or a load pulls it.
    pub fn is_coasting(&self) -> bool {
        self.parameters.law == ControlLaw::ProfileTorque
            && !self.is_moving_on_command()
            && !self.is_standing()
    }

    /// Returns `true` if the drive is commanded to go on moving without end: by a velocity or a torque that is not zero.
    pub fn is_moving_on_command(&self) -> bool {
        self.profile.is_moving_on_command()
    }

    /// For how long the velocity or torque that the drive is asked for has been expired; 0 if it is valid or there is
    /// none.
    #[inline]
    pub fn expired_ns(&self, now_ns: Nanoseconds) -> Nanoseconds {
        self.profile.expired_ns(now_ns)
    }

    /// Cycles that the drive has left a set-point unacknowledged.
    pub fn unacknowledged_cycles(&self) -> u32 {
        self.profile.command.waiting_cycles()
    }

    /// Counts for how long a drive in profile position has stood still before its target.
    #[inline]
    pub(super) fn watch_stall(&mut self) {
        let is_under_way = self.parameters.law == ControlLaw::ProfilePosition
            && self.profile.target().is_some()
            && self.is_enabled()
            && self.unacknowledged_cycles() == 0
            && !self.is_target_reached();
        self.profile.count_stall(is_under_way && self.is_standing());
    }

    /// Watches what the drive makes of its target, since no set-point passes the guard: the joint must be able to come
    /// to rest before a position limit.
    #[inline]
    pub fn check_profile(&self) -> Result<(), Fault> {
        let limits = &self.parameters.limits;
        if !self.is_profile() || self.feedback_age() > 0 {
            return Ok(());
        }
        if self.profile.is_stalled(self.parameters.following_error_cycles) {
            let value = self.shown_set_point().position - self.position();
            return Err(Fault::FollowingError { error: value, limit: self.parameters.following_error_limit });
        }
        if !self.is_moving_on_command() && !self.is_coasting() {
            return Ok(());
        }
        let distance = self.way_to_rest();
        let rest = self.position() + distance;
        let limit = if distance > 0.0 { limits.position_max } else { limits.position_min };
        let is_beyond = (distance > 0.0 && rest > limit) || (distance < 0.0 && rest < limit);
        if is_beyond { Err(Fault::PositionLimit { position: rest, limit }) } else { Ok(()) }
    }

    /// What is shown as the set-point of an axis in a profile mode.
    pub(super) fn shown_set_point(&self) -> State {
        let rest = State::rest(self.position());
        match self.profile.target() {
            Some(ProfileTarget::Position(position)) => State { position, ..rest },
            Some(ProfileTarget::Velocity(velocity)) => State { velocity, ..rest },
            Some(ProfileTarget::Torque(_)) | None => rest,
        }
    }
}
