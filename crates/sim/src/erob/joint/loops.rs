//! Steps the control loops and the joint.

use takt_rt::{DriveState, NANOSECONDS_PER_SECOND, Nanoseconds, statusword};

use super::ErobJoint;
use crate::erob::objects::at;
use crate::errors::DeviceError;
use crate::loops::ControlLoops;
use crate::motion::{Actual, Measured};

impl ControlLoops for ErobJoint {
    fn stepped_ns(&self) -> Nanoseconds {
        self.stepped_ns
    }

    fn step(&mut self, duration_ns: Nanoseconds) {
        let duration_s = duration_ns as f64 / NANOSECONDS_PER_SECOND as f64;
        self.stepped_ns += duration_ns;
        self.take_coming_mode();
        self.evaluate(self.stepped_ns);
        let is_driven = self.device.state().has_torque();
        if is_driven {
            self.drive(duration_s);
        } else {
            self.torque = 0.0;
        }
        if self.defects.is_blocked {
            self.joint.halt();
        } else {
            let is_braked = self.is_braked();
            self.joint.step(duration_s, self.torque * self.direction(), is_braked);
        }
        self.read_encoder();
        let actual = self.actual;
        if is_driven {
            self.check_following_error(actual);
        } else {
            self.motion.follow(actual);
        }
        let word = self.device.controlword();
        let bits = self.motion.status_bits(actual, word, &self.canopen.dictionary, duration_s);
        self.mode_bits =
            if self.device.state() == DriveState::OperationEnabled { bits } else { statusword::BIT_12 };
    }
}

impl ErobJoint {
    /// One step of set-point, loops and torque.
    fn drive(&mut self, duration_s: f64) {
        let actual = self.actual;
        let demand = match self.device.stop() {
            Some(stop) => {
                let (demand, is_at_rest) = self.motion.step_stop(stop.deceleration, duration_s);
                if is_at_rest {
                    self.device.stopped();
                }
                demand
            }
            None => self.motion.step(self.device.controlword(), actual, &self.canopen.dictionary, duration_s),
        };
        let (count, per_mille) = self.units;
        let measured = Measured {
            count,
            per_mille,
            position: actual.position,
            velocity: self.joint.velocity() * self.direction(),
        };
        self.torque = demand.torque(&mut self.servo, measured, duration_s);
        if !self.device.state().has_torque() {
            self.torque = 0.0;
        }
    }

    fn check_following_error(&mut self, actual: Actual) {
        let window = self.canopen.dictionary.real(at::FOLLOWING_ERROR_WINDOW);
        let error = self.motion.position() - actual.position;
        let is_watched = window >= 0.0 && self.motion.follows_position() && self.device.stop().is_none();
        if is_watched && error.abs() > window {
            self.fail(DeviceError::FollowingError);
        }
    }
}
