//! A step of the control loops and of the joint.

use takt_rt::Nanoseconds;

use super::settings::ControlMode;
use super::{CommandedModule, FOLLOWING_FAULT, Power};
use crate::profile_motions::Motion;

/// The period of the loops.
const STEP_NS: Nanoseconds = 250_000;
const STEP_S: f64 = STEP_NS as f64 * 1e-9;

impl CommandedModule {
    /// Advances to a time.
    pub fn run_until(&mut self, now_ns: Nanoseconds) {
        while self.stepped_ns + STEP_NS <= now_ns {
            self.step();
        }
    }

    /// When it is to be advanced again.
    pub const fn wake_ns(&self) -> Nanoseconds {
        self.stepped_ns + STEP_NS
    }

    fn step(&mut self) {
        self.stepped_ns += STEP_NS;
        let velocity = self.joint.velocity();
        let per_unit = self.parameters.encoder.counts_per_unit;
        self.torque = match (self.power, self.settings.mode) {
            (Power::Off | Power::Fault(_), _) => 0.0,
            (Power::On { .. }, ControlMode::Torque) => self.step_torque(velocity, per_unit),
            (Power::On { .. }, ControlMode::Velocity) => self.step_velocity(velocity, per_unit),
            (Power::On { motion, since_ns, settled_ns }, ControlMode::Position) => {
                self.step_position(motion, since_ns, settled_ns, velocity, per_unit)
            }
        };
        if self.defects.is_blocked {
            self.joint.halt();
        }
        let is_braked = self.is_braked() || self.defects.is_blocked;
        self.joint.step(STEP_S, self.torque, is_braked);
    }

    fn step_torque(&mut self, velocity: f64, per_unit: f64) -> f64 {
        let direction = 1f64.copysign(per_unit);
        let demand = direction * 1e-3 * self.settings.set_point * self.parameters.torque_per_ampere;
        self.servo.torque_within(demand, velocity, self.settings.velocity_limit / per_unit.abs())
    }

    fn step_velocity(&mut self, velocity: f64, per_unit: f64) -> f64 {
        let wanted = self.settings.set_point;
        if wanted != 0.0 {
            self.emergency_rate = None;
        }
        let profile = self.settings.profile;
        let slower = self.emergency_rate.unwrap_or(profile.deceleration);
        self.velocity_demand.ramp_between(wanted, profile.acceleration, slower, STEP_S);
        self.servo.velocity(self.velocity_demand.velocity / per_unit, velocity, 0.0, STEP_S)
    }

    fn step_position(
        &mut self,
        mut motion: Motion,
        since_ns: Nanoseconds,
        settled_ns: Nanoseconds,
        velocity: f64,
        per_unit: f64,
    ) -> f64 {
        motion.step(self.stepped_ns, &self.settings.profile, STEP_S);
        let error = motion.position() - f64::from(self.counts());
        if error.abs() > self.settings.position_error {
            self.fail(FOLLOWING_FAULT);
            return 0.0;
        }
        let is_within = error.abs() < self.settings.window && !motion.is_moving();
        let settled_ns = if is_within { settled_ns } else { self.stepped_ns };
        self.power = Power::On { motion, since_ns, settled_ns };
        self.servo.position(error / per_unit, motion.velocity() / per_unit, velocity, 0.0, STEP_S)
    }
}
