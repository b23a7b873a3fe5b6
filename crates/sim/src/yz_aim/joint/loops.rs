//! Steps the control loops and the joint.

use takt_rt::{NANOSECONDS_PER_SECOND, Nanoseconds};

use super::{COUNTS_PER_SECOND_PER_RPM, LoadMonitor, NEVER, YzAimJoint, mode};
use crate::cia402::homing::{HomingSpeed, HomingStep};
use crate::homing_switches::{HomingSwitches, ReferenceSwitches, Switch};
use crate::loops::ControlLoops;
use crate::motion::Measured;
use crate::yz_aim::device::Level;
use crate::yz_aim::motion::MotionCommand;

/// 6083h: at this value and above there is no ramp (manual IV.1).
const NO_RAMP: i64 = 60_000;

impl ControlLoops for YzAimJoint {
    fn stepped_ns(&self) -> Nanoseconds {
        self.stepped_ns
    }

    fn step(&mut self, duration_ns: Nanoseconds) {
        let duration_s = duration_ns as f64 / NANOSECONDS_PER_SECOND as f64;
        self.stepped_ns += duration_ns;
        let is_energised = self.is_energised();
        if is_energised && !self.was_energised {
            self.engage();
        }
        self.was_energised = is_energised;
        if is_energised {
            self.drive(duration_s);
        } else {
            self.homing.fail();
            self.torque = 0.0;
        }
        let from = self.joint.position();
        if self.joint_defects.is_blocked {
            self.joint.halt();
        } else {
            self.joint.step(duration_s, self.torque * self.direction(), false);
        }
        if is_energised {
            self.step_homing(from, duration_s);
            self.monitor_load(duration_s);
        } else {
            self.motion.engage(self.actual());
        }
    }
}

impl YzAimJoint {
    /// Restarts the motion at the actual position, when torque comes on or the command changes.
    pub(super) fn engage(&mut self) {
        if !self.was_energised {
            self.servo.reset();
            self.load_monitor = LoadMonitor::default();
        }
        self.motion.engage(self.actual());
    }

    fn motion_command(&self) -> MotionCommand {
        if self.is_master_lost || self.device.is_halted() {
            return MotionCommand::Stop;
        }
        if self.homing.is_running() {
            let speed = match self.homing.speed() {
                HomingSpeed::Switch(direction) => direction,
                HomingSpeed::Zero(direction) => 0.1 * direction,
                HomingSpeed::Rest => 0.0,
            };
            return MotionCommand::Velocity(
                speed * self.parameters.homing.speed_rpm * COUNTS_PER_SECOND_PER_RPM,
            );
        }
        let profile_speed = self.real(self.places.profile_velocity) * COUNTS_PER_SECOND_PER_RPM;
        match (self.device.level(), self.mode()) {
            (Level::Cold, _) => MotionCommand::Profile(self.power_up_speed.unwrap_or(profile_speed)),
            (Level::Enabled, mode::PROFILE_POSITION) => MotionCommand::Profile(profile_speed),
            (Level::Enabled, mode::VELOCITY) => {
                MotionCommand::Velocity(self.real(self.places.target_velocity) * COUNTS_PER_SECOND_PER_RPM)
            }
            (Level::Enabled, _) if self.interpolates() => MotionCommand::Interpolate,
            _ => MotionCommand::Stop,
        }
    }

    /// The acceleration ramp: counts/s².
    fn acceleration(&self) -> f64 {
        match self.number(self.places.acceleration) {
            NO_RAMP.. => f64::INFINITY,
            // At least 1: a ramp of 0 would never stop the motor.
            slope => slope.max(1) as f64 * COUNTS_PER_SECOND_PER_RPM,
        }
    }

    /// One step of command, loops and torque.
    fn drive(&mut self, duration_s: f64) {
        let actual = self.actual();
        let demand = self.motion.step(self.motion_command(), self.acceleration(), actual, duration_s);
        self.servo.set_torque_limit(self.torque_limit());
        let measured = Measured {
            count: 1.0 / self.parameters.encoder.counts_per_unit.abs(),
            // No torque is fed forward.
            per_mille: 0.0,
            position: actual.position,
            velocity: self.joint.velocity() * self.direction(),
        };
        self.torque = demand.torque(&mut self.servo, measured, duration_s);
    }

    /// The switches as CiA 402 names them: DIR is the negative limit switch (method 17) or the home switch (19 to 22), PU the positive
    /// limit switch (18). The drive looks for one that is not wired, too.
    pub(super) fn switches(&self) -> ReferenceSwitches {
        const NOT_WIRED: Switch = Switch { from: f64::INFINITY, to: f64::INFINITY };
        let HomingSwitches { dir, pu } = self.parameters.switches;
        let dir = Some(dir.unwrap_or(NOT_WIRED));
        let positive_limit = Some(pu.unwrap_or(NOT_WIRED));
        ReferenceSwitches { negative_limit: dir, positive_limit, home: dir, index_distance: None }
    }

    /// Evaluates the switches after a step of the joint from this position.
    fn step_homing(&mut self, from: f64, duration_s: f64) {
        if !self.homing.is_running() {
            return;
        }
        self.homing_s += duration_s;
        let home = self.homing.step(HomingStep {
            switches: &self.switches(),
            from,
            to: self.joint.position(),
            direction: self.direction(),
            is_at_rest: self.is_at_rest(),
        });
        if home.is_some() {
            self.set_counts(0);
        }
        let gives_up_ns = self.parameters.homing.gives_up_ns.unwrap_or(NEVER);
        if self.homing_s * NANOSECONDS_PER_SECOND as f64 > gives_up_ns as f64 {
            self.homing.fail();
        }
    }
}
