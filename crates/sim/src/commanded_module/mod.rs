//! A simulated eRob that commands move, whichever protocol carries them: power, control loops, motions, joint, brake and encoder. The
//! drive of each protocol holds its settings, and gives those that shape the motions.
//!
//! - `settings`: what shapes the motions.
//! - `loops`: a step of the control loops and of the joint.
//! - `defects`: what goes wrong with it on purpose.

mod defects;
mod loops;
mod settings;

pub use settings::{ControlMode, ModuleSettings, STEEPEST, ramp};

use takt_rt::{DriveState, Nanoseconds};

use super::drive::{NodeState, Observation};
use super::motion::Generator;
use super::plant::{Encoder, Gravity, Joint, JointParameters};
use super::profile_motions::Motion;
use super::servo::Servo;

/// The time that saving takes.
const SAVE_NS: Nanoseconds = 3_000_000_000;
/// An emergency stop takes less than 50 ms.
const EMERGENCY_STOP_S: f64 = 0.04;
/// A joint slower than this does not move: counts/s.
const STANDING: f64 = 200.0;
/// By how much the torque twists the joint between its encoders: counts for one N·m. Not published; of the size of a strain wave gear,
/// about 40,000 N·m/rad.
const TWIST: f64 = 2.0;
/// The fault of an empty battery of a multi-turn encoder.
const BATTERY_FAULT: u16 = 0x730F;
/// The fault of a position error that is too large.
const FOLLOWING_FAULT: u16 = 0x8611;

/// What a module is made with, whichever protocol it speaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModuleParameters {
    /// The mechanics.
    pub joint: JointParameters,
    /// The encoder at the output.
    pub encoder: Encoder,
    /// Counts of a turn of the output.
    pub counts_per_turn: f64,
    /// Where the joint is at first: rad.
    pub initial_position: f64,
    /// Peak torque: N·m.
    pub peak_torque: f64,
    /// Torque for one ampere: N·m/A.
    pub torque_per_ampere: f64,
    /// The highest velocity of the motor: rad/s.
    pub highest_velocity: f64,
    /// From power-on until it can be enabled: 8 s by the manual of the own CAN protocol.
    pub ready_ns: Nanoseconds,
    /// True if it has a battery that keeps the count of turns.
    pub has_battery: bool,
}

/// Whether the motor has power.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Power {
    Off,
    On {
        motion: Motion,
        since_ns: Nanoseconds,
        /// Since when the joint is within the window of its target.
        settled_ns: Nanoseconds,
    },
    /// Off, by a fault.
    Fault(u16),
}

/// Why a module cannot be enabled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotEnabled {
    /// It was switched on just now.
    Starting,
    /// It shows a fault.
    Faulted,
}

/// Why a motion cannot start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotStarted {
    /// The motor is off.
    Disabled,
    /// It is not position-controlled, or there is no such motion mode.
    Mode,
}

/// Defects that last.
#[derive(Clone, Copy, Debug, Default)]
struct Defects {
    is_blocked: bool,
    is_brake_stuck: bool,
    is_silent: bool,
}

/// A module without its protocol.
#[derive(Clone, Debug)]
pub struct CommandedModule {
    parameters: ModuleParameters,
    settings: ModuleSettings,
    power: Power,
    servo: Servo,
    joint: Joint,
    torque: f64,
    /// The demand of velocity control.
    velocity_demand: Generator,
    /// The demand of velocity control goes to 0 at this rate: counts/s².
    emergency_rate: Option<f64>,
    /// What is added to the encoder's counts since the count of turns was lost.
    counts_offset: i32,
    has_battery_alarm: bool,
    /// By a command, until the motor is enabled or disabled.
    is_brake_released: bool,
    defects: Defects,
    ready_ns: Nanoseconds,
    saving_until_ns: Option<Nanoseconds>,
    stepped_ns: Nanoseconds,
}

impl CommandedModule {
    /// A module whose supply is switched on at time 0.
    pub fn new(parameters: ModuleParameters, settings: ModuleSettings) -> Self {
        let ModuleParameters { joint, peak_torque, highest_velocity, .. } = parameters;
        let mut module = Self {
            settings,
            power: Power::Off,
            servo: Servo::new(joint.inertia, peak_torque, highest_velocity),
            joint: Joint::new(joint, parameters.initial_position),
            torque: 0.0,
            velocity_demand: Generator::default(),
            emergency_rate: None,
            counts_offset: 0,
            has_battery_alarm: false,
            is_brake_released: false,
            defects: Defects::default(),
            ready_ns: parameters.ready_ns,
            saving_until_ns: None,
            stepped_ns: 0,
            parameters,
        };
        if !parameters.has_battery {
            module.lose_turns();
        }
        module
    }

    /// Takes the settings that shape the motions, after one of them has changed.
    pub const fn take_settings(&mut self, settings: ModuleSettings) {
        self.settings = settings;
    }

    /// The position of the joint: counts.
    pub fn counts(&self) -> i32 {
        self.parameters.encoder.counts(self.joint.position()).wrapping_add(self.counts_offset)
    }

    /// The position of the joint within a turn: counts.
    pub fn counts_within_turn(&self) -> f64 {
        f64::from(self.counts()).rem_euclid(self.parameters.counts_per_turn)
    }

    /// The velocity of the joint: counts/s.
    pub fn velocity(&self) -> f64 {
        self.parameters.encoder.counts_per_second(self.joint.velocity())
    }

    /// The demanded velocity: counts/s.
    pub fn demanded_velocity(&self) -> f64 {
        match (self.settings.mode, self.motion()) {
            (ControlMode::Velocity, _) => self.velocity_demand.velocity,
            (_, motion) => motion.map_or(0.0, |motion| motion.velocity()),
        }
    }

    /// mA
    pub fn milliamperes(&self) -> f64 {
        1000.0 * self.torque / self.parameters.torque_per_ampere
    }

    /// N·m
    pub const fn torque(&self) -> f64 {
        self.torque
    }

    /// How far the torque twists the joint between its encoders: counts.
    pub fn twist(&self) -> i32 {
        (self.torque * TWIST).round() as i32
    }

    /// Returns `true` if the motor has power.
    pub const fn is_enabled(&self) -> bool {
        matches!(self.power, Power::On { .. })
    }

    /// Returns `true` if the brake is engaged.
    pub const fn is_braked(&self) -> bool {
        !(self.is_enabled() || self.is_brake_released) || self.defects.is_brake_stuck
    }

    /// Returns `true` if it is led through a motion, or its joint moves.
    pub fn is_moving(&self) -> bool {
        self.motion().is_some_and(|motion| motion.is_moving()) || self.velocity().abs() > STANDING
    }

    /// Returns `true` if it does not reply, on purpose.
    pub const fn is_silent(&self) -> bool {
        self.defects.is_silent
    }

    /// The fault that it shows; 0 for none.
    pub const fn fault(&self) -> u16 {
        if let Power::Fault(code) = self.power { code } else { 0 }
    }

    /// What position control is led through.
    pub const fn motion(&self) -> Option<Motion> {
        if let Power::On { motion, .. } = self.power { Some(motion) } else { None }
    }

    /// 0 motor off, 1 motor on, 2 running, 3 settling, 4 at the target.
    pub fn reached_status(&self) -> u16 {
        match self.power {
            Power::Off | Power::Fault(_) => 0,
            Power::On { motion, .. } if motion.is_moving() => 2,
            Power::On { motion, .. } if !motion.is_target_reached() => 1,
            Power::On { settled_ns, .. } => {
                let is_reached = self.stepped_ns.saturating_sub(settled_ns) >= self.settings.settling_ns;
                if is_reached { 4 } else { 3 }
            }
        }
    }

    /// Enables the motor.
    ///
    /// # Errors
    /// It has just been switched on, or shows a fault.
    pub fn enable(&mut self, now_ns: Nanoseconds) -> Result<(), NotEnabled> {
        self.is_brake_released = false;
        match self.power {
            Power::On { .. } => Ok(()),
            Power::Fault(_) => Err(NotEnabled::Faulted),
            Power::Off if now_ns < self.ready_ns => Err(NotEnabled::Starting),
            Power::Off => {
                self.servo.reset();
                self.velocity_demand.velocity = self.velocity();
                self.emergency_rate = None;
                let motion = Motion::resting_at(self.counts().into());
                self.power = Power::On { motion, since_ns: now_ns, settled_ns: now_ns };
                Ok(())
            }
        }
    }

    /// Disables the motor; a fault stays.
    pub fn disable(&mut self) {
        self.is_brake_released = false;
        self.torque = 0.0;
        if self.is_enabled() {
            self.power = Power::Off;
        }
    }

    /// Clears a fault whose cause is gone.
    pub fn clear_fault(&mut self) {
        if matches!(self.power, Power::Fault(_)) && !self.has_battery_alarm {
            self.power = Power::Off;
        }
    }

    /// Releases the brake without torque.
    pub const fn release_brake(&mut self) {
        self.is_brake_released = true;
    }

    /// How long the motor has been enabled.
    pub const fn enabled_ns(&self, now_ns: Nanoseconds) -> Option<Nanoseconds> {
        if let Power::On { since_ns, .. } = self.power { Some(now_ns.saturating_sub(since_ns)) } else { None }
    }

    /// Starts the motion of position control that the settings say.
    ///
    /// # Errors
    /// The motor is off, or there is no such motion.
    pub fn start(&mut self) -> Result<(), NotStarted> {
        let ModuleSettings { mode, motion_mode, target, distance, .. } = self.settings;
        let Power::On { motion, .. } = &mut self.power else { return Err(NotStarted::Disabled) };
        if mode != ControlMode::Position {
            return Err(NotStarted::Mode);
        }
        // A relative position that is not 0 makes the move a relative one.
        let target = if distance == 0.0 { target } else { motion.position() + distance };
        match motion_mode {
            0 => motion.run(),
            1 => motion.move_to(target),
            2 => motion.reciprocate_to(target),
            _ => return Err(NotStarted::Mode),
        }
        Ok(())
    }

    /// Stops the motion of position control with the profile deceleration.
    pub fn stop(&mut self) {
        self.stop_with(self.settings.profile.deceleration);
    }

    /// Stops the motion in less than 50 ms, also in velocity control once its set-point is 0.
    pub fn stop_in_an_emergency(&mut self) {
        let rate = (self.velocity().abs() / EMERGENCY_STOP_S).max(1e6);
        self.emergency_rate = Some(rate);
        self.stop_with(rate);
    }

    fn stop_with(&mut self, deceleration: f64) {
        if let Power::On { motion, .. } = &mut self.power {
            motion.stop_with(deceleration);
        }
    }

    /// Ends a reciprocating motion at its next end.
    pub fn end_reciprocation(&mut self) {
        if let Power::On { motion, .. } = &mut self.power {
            motion.end_reciprocation();
        }
    }

    /// Wipes the count of turns, and ends the alarm of the battery.
    pub fn reset_encoder(&mut self) {
        self.has_battery_alarm = false;
        if self.power == Power::Fault(BATTERY_FAULT) {
            self.power = Power::Off;
        }
        self.lose_turns();
        let here = self.counts();
        if let Power::On { motion, .. } = &mut self.power {
            *motion = Motion::resting_at(here.into());
        }
    }

    /// Leaves the position within one turn.
    fn lose_turns(&mut self) {
        let lost = self.counts_within_turn() - f64::from(self.counts());
        self.counts_offset = self.counts_offset.wrapping_add(lost as i32);
    }

    /// Detects a fault, and cuts the power of the motor.
    pub fn fail(&mut self, code: u16) {
        self.power = Power::Fault(code);
        self.torque = 0.0;
    }

    /// Begins to save the settings.
    pub const fn save(&mut self, now_ns: Nanoseconds) {
        self.saving_until_ns = Some(now_ns.saturating_add(SAVE_NS));
    }

    /// Returns `true` if saving is over by now. It says so once.
    pub fn has_saved(&mut self, now_ns: Nanoseconds) -> bool {
        self.saving_until_ns.take_if(|until_ns| *until_ns <= now_ns).is_some()
    }

    /// Cuts the supply and restores it at once, with these settings.
    pub fn power_cycle(&mut self, now_ns: Nanoseconds, settings: ModuleSettings) {
        self.settings = settings;
        self.power = Power::Off;
        self.is_brake_released = false;
        (self.torque, self.saving_until_ns) = (0.0, None);
        self.ready_ns = now_ns.saturating_add(self.parameters.ready_ns);
        if !self.parameters.has_battery {
            self.lose_turns();
        }
    }

    /// The truth about it.
    pub fn observe(&self) -> Observation {
        let state = match self.power {
            Power::Off => DriveState::SwitchOnDisabled,
            Power::On { .. } => DriveState::OperationEnabled,
            Power::Fault(_) => DriveState::Fault,
        };
        Observation {
            position: self.joint.position(),
            velocity: self.joint.velocity(),
            torque: self.torque,
            position_counts: self.counts(),
            state,
            statusword: 0,
            error_code: self.fault(),
            operation_mode: self.settings.mode as i8,
            nmt: NodeState::Operational,
            is_braked: self.is_braked(),
        }
    }

    /// Sets the pull of gravity.
    pub fn set_gravity(&mut self, gravity: Gravity) {
        self.joint.set_gravity(gravity);
    }

    /// Sets a torque of a load: N·m.
    pub fn set_load_torque(&mut self, torque: f64) {
        self.joint.set_load_torque(torque);
    }
}
