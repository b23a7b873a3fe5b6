//! The set-points of the control loops in every mode of operation. Units: counts, counts/s, per mille.

mod status;

use takt_rt::{OperationMode, controlword};

use super::objects::at;
use crate::motion::{Actual, Demand, Generator, MotionLimits, SetPoints};
use crate::object_dictionary::SimulatedDictionary;

/// In interpolated position mode, a target up to this multiple of the longest step (profile velocity times period)
/// belongs to a stream. A more distant one is a move.
const STREAMED_STEPS: f64 = 1.5;
/// Generates the set-points of the loops.
#[derive(Clone, Copy, Debug)]
pub struct ErobMotion {
    mode: Option<OperationMode>,
    velocity_limit: f64,
    generator: Generator,
    torque: f64,
    /// True if the targets of interpolated position mode come as a stream.
    is_streamed: bool,
    set_points: SetPoints,
    /// How long the actual value has been within its window.
    in_window_s: f64,
    is_limited: bool,
}

impl ErobMotion {
    /// A generator at standstill. The limit (counts/s) is the drive's own.
    pub fn new(velocity_limit: f64) -> Self {
        Self {
            mode: None,
            velocity_limit,
            generator: Generator::default(),
            torque: 0.0,
            is_streamed: false,
            set_points: SetPoints::default(),
            in_window_s: 0.0,
            is_limited: false,
        }
    }

    /// Starts at the actual position, when torque comes on. The CSP target is the value of object 607A, so an old one
    /// makes the axis jump.
    pub fn engage(&mut self, mode: Option<OperationMode>, actual: Actual, dictionary: &SimulatedDictionary) {
        *self = Self {
            mode,
            generator: Generator::starting(actual),
            set_points: SetPoints::starting(actual.position),
            ..Self::new(self.velocity_limit)
        };
        self.latch(dictionary);
    }

    /// Without torque, the demand follows the actual position.
    pub fn follow(&mut self, actual: Actual) {
        self.generator.follow(Actual { velocity: 0.0, ..actual });
        self.torque = 0.0;
    }

    /// Latches the target of CSP, or of interpolated position mode while controlword bit 4 is set: at SYNC, or after a
    /// write in between. It is reached at the end of the interpolation period, at the next SYNC. The same target again
    /// changes nothing while the interpolation runs.
    pub fn latch(&mut self, dictionary: &SimulatedDictionary) {
        let is_interpolating = self.mode == Some(OperationMode::InterpolatedPosition)
            && dictionary.number(at::CONTROLWORD) as u16 & controlword::BIT_4 != 0;
        if self.mode != Some(OperationMode::CyclicSynchronousPosition) && !is_interpolating {
            return;
        }
        let period_s = interpolation_period_s(dictionary);
        let wanted = dictionary.real(at::TARGET_POSITION) + dictionary.real(at::POSITION_OFFSET);
        let target = self.within_software_limits(wanted, dictionary);
        if self.generator.interpolates_to(target) {
            return;
        }
        if is_interpolating {
            let longest_step =
                dictionary.real(at::PROFILE_VELOCITY).min(self.velocity_limit(dictionary)) * period_s;
            let is_within_stream = (target - self.generator.position).abs() <= STREAMED_STEPS * longest_step;
            if !self.is_streamed && is_within_stream {
                self.generator.target = self.generator.position;
            }
            self.is_streamed = is_within_stream;
            if !is_within_stream {
                return;
            }
        }
        self.generator.interpolate_to(target, period_s, self.velocity_limit(dictionary));
    }

    /// Evaluates the controlword bits of profile position mode in an enabled drive.
    pub fn evaluate(&mut self, word: u16, previous: u16, dictionary: &SimulatedDictionary) {
        if !self.is_profile_position() {
            return;
        }
        let mut set_points = self.set_points;
        let wanted = dictionary.real(at::TARGET_POSITION);
        let target = |base| self.within_software_limits(base + wanted, dictionary);
        if set_points.evaluate(word, previous, target) {
            self.in_window_s = 0.0;
        }
        self.set_points = set_points;
    }

    /// Advances by `duration_s` and returns the set-point. A position is that of the beginning of the step, when the
    /// actual position was measured.
    #[inline]
    pub fn step(
        &mut self,
        word: u16,
        actual: Actual,
        dictionary: &SimulatedDictionary,
        duration_s: f64,
    ) -> Demand {
        let is_halted = word & controlword::HALT != 0;
        let torque = dictionary.real(at::TORQUE_OFFSET);
        let position = self.generator.position;
        match self.mode {
            Some(OperationMode::InterpolatedPosition) if self.is_streamed && !is_halted => {
                self.generator.step_interpolation(self.velocity_limit(dictionary), duration_s);
                Demand::Position { position, velocity: self.generator.forward, torque: 0.0 }
            }
            Some(OperationMode::ProfilePosition | OperationMode::InterpolatedPosition) => {
                if is_halted {
                    self.ramp_velocity(0.0, dictionary, duration_s);
                } else {
                    self.step_profile(dictionary, duration_s);
                }
                Demand::Position { position, velocity: self.generator.velocity, torque: 0.0 }
            }
            Some(OperationMode::ProfileVelocity) => {
                let wanted = if is_halted { 0.0 } else { dictionary.real(at::TARGET_VELOCITY) };
                self.generator.position = actual.position;
                let wanted = self.velocity_within_limits(wanted, dictionary);
                self.ramp_velocity(wanted, dictionary, duration_s);
                Demand::Velocity { velocity: self.generator.velocity, torque: 0.0 }
            }
            Some(OperationMode::ProfileTorque) => {
                let wanted = if is_halted { 0.0 } else { dictionary.real(at::TARGET_TORQUE) };
                let slope = dictionary.real(at::TORQUE_SLOPE);
                // A slope of 0 means no slope: the torque steps.
                let most = if slope > 0.0 { slope * duration_s } else { f64::INFINITY };
                self.torque += (wanted - self.torque).clamp(-most, most);
                Demand::Torque(self.torque)
            }
            Some(OperationMode::CyclicSynchronousPosition) => {
                self.generator.step_interpolation(self.velocity_limit(dictionary), duration_s);
                let velocity = self.generator.forward + dictionary.real(at::VELOCITY_OFFSET);
                Demand::Position { position, velocity, torque }
            }
            Some(OperationMode::CyclicSynchronousVelocity) => {
                let wanted = dictionary.real(at::TARGET_VELOCITY) + dictionary.real(at::VELOCITY_OFFSET);
                self.generator.position = actual.position;
                self.generator.velocity = self.velocity_within_limits(wanted, dictionary);
                Demand::Velocity { velocity: self.generator.velocity, torque }
            }
            Some(OperationMode::CyclicSynchronousTorque) => {
                self.torque = dictionary.real(at::TARGET_TORQUE) + torque;
                Demand::Torque(self.torque)
            }
            _ => Demand::Position { position, velocity: 0.0, torque: 0.0 },
        }
    }

    /// Decelerates in any mode, and returns whether the demand is at standstill.
    pub fn step_stop(&mut self, deceleration: f64, duration_s: f64) -> (Demand, bool) {
        self.generator.ramp(0.0, deceleration, duration_s);
        (Demand::Velocity { velocity: self.generator.velocity, torque: 0.0 }, self.generator.velocity == 0.0)
    }

    /// Begins a deceleration from the actual velocity.
    pub fn begin_stop(&mut self, actual: Actual) {
        self.generator.follow(actual);
    }

    /// Returns `true` if the mode follows a position, and so has a following error.
    pub fn follows_position(&self) -> bool {
        matches!(self.mode, Some(OperationMode::CyclicSynchronousPosition)) || self.is_profile_position()
    }

    /// Demanded position in counts (object 6062).
    pub fn position(&self) -> f64 {
        self.generator.position
    }

    /// Demanded velocity in counts/s (object 606B).
    pub fn velocity(&self) -> f64 {
        self.generator.velocity
    }

    fn is_profile_position(&self) -> bool {
        // Mode 7 behaves like mode 1 where a unit has it, unless the targets come as a stream. eRunner manual 1.7, 5.7:
        // bit 4 starts a move to an absolute target, and profile velocity 0 stops it.
        matches!(self.mode, Some(OperationMode::ProfilePosition | OperationMode::InterpolatedPosition))
    }

    fn is_cyclic(&self) -> bool {
        self.mode.is_some_and(|mode| mode as i8 >= OperationMode::CyclicSynchronousPosition as i8)
    }

    fn velocity_limit(&self, dictionary: &SimulatedDictionary) -> f64 {
        dictionary.real(at::MAX_PROFILE_VELOCITY).min(self.velocity_limit)
    }

    fn limits(&self, dictionary: &SimulatedDictionary) -> MotionLimits {
        let positions = (dictionary.real(at::POSITION_MIN), dictionary.real(at::POSITION_MAX));
        MotionLimits { velocity: self.velocity_limit(dictionary), positions }
    }

    fn within_software_limits(&mut self, position: f64, dictionary: &SimulatedDictionary) -> f64 {
        let limited = self.limits(dictionary).position(position);
        self.is_limited = limited != position;
        limited
    }

    /// Limits a velocity so that it does not go beyond the software limits.
    fn velocity_within_limits(&mut self, velocity: f64, dictionary: &SimulatedDictionary) -> f64 {
        let limited = self.limits(dictionary).velocity_at(self.generator.position, velocity);
        self.is_limited = limited != velocity;
        limited
    }

    /// One step of a trapezoidal profile to the active set-point.
    fn step_profile(&mut self, dictionary: &SimulatedDictionary, duration_s: f64) {
        let (acceleration, deceleration) = (acceleration(dictionary), deceleration(dictionary));
        let velocity = dictionary.real(at::PROFILE_VELOCITY).min(self.velocity_limit(dictionary));
        match self.set_points.active {
            Some(target) => {
                if self.generator.step_profile(target, velocity, acceleration, deceleration, duration_s) {
                    self.set_points.arrived();
                }
            }
            None => self.generator.ramp(0.0, deceleration, duration_s),
        }
    }

    /// Ramps the demanded velocity towards `wanted` by the profile, and moves.
    fn ramp_velocity(&mut self, wanted: f64, dictionary: &SimulatedDictionary, duration_s: f64) {
        let (acceleration, deceleration) = (acceleration(dictionary), deceleration(dictionary));
        self.generator.ramp_between(wanted, acceleration, deceleration, duration_s);
    }
}

fn acceleration(dictionary: &SimulatedDictionary) -> f64 {
    dictionary.real(at::PROFILE_ACCELERATION).min(dictionary.real(at::MAX_ACCELERATION))
}

/// At least 1 count/s², because a profile without deceleration would never end.
fn deceleration(dictionary: &SimulatedDictionary) -> f64 {
    dictionary.real(at::PROFILE_DECELERATION).min(dictionary.real(at::MAX_DECELERATION)).max(1.0)
}

/// The period over which CSP interpolates: the SYNC period 1006, otherwise 60C2, otherwise 1 ms.
fn interpolation_period_s(dictionary: &SimulatedDictionary) -> f64 {
    let cycle_us = dictionary.real(at::CYCLE_PERIOD);
    if cycle_us > 0.0 {
        return cycle_us * 1e-6;
    }
    let exponent = dictionary.number(at::INTERPOLATION_EXPONENT).clamp(-6, 0) as i32;
    let period_s = dictionary.real(at::INTERPOLATION_PERIOD) * 10f64.powi(exponent);
    if period_s > 0.0 { period_s } else { 1e-3 }
}
