//! The set-points of the control loops in every mode of operation. Units: counts, counts/s, per mille.

mod status;

use takt_rt::{OperationMode, controlword};

use super::objects::at;
use crate::sim::object_dictionary::SimulatedDictionary;

/// The set-point of the loops for one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ErobDemand {
    /// A position (counts) with its velocity (counts/s) and a torque fed forward (per mille).
    Position {
        /// counts
        position: f64,
        /// counts/s
        velocity: f64,
        /// per mille
        torque: f64,
    },
    /// A velocity (counts/s) with a torque fed forward (per mille).
    Velocity {
        /// counts/s
        velocity: f64,
        /// per mille
        torque: f64,
    },
    /// A torque (per mille).
    Torque(f64),
}

/// The interpolation from one CSP target to the next.
#[derive(Clone, Copy, Debug, Default)]
struct Interpolation {
    target: f64,
    left_s: f64,
    /// Velocity from the difference of the last two targets.
    velocity: f64,
    /// How long this velocity is still fed forward.
    forward_s: f64,
}

/// The set-points of profile position mode: an active one and a buffered one.
#[derive(Clone, Copy, Debug, Default)]
struct SetPoints {
    active: Option<f64>,
    buffered: Option<f64>,
    /// The last accepted target, to which relative targets are added.
    last: f64,
    is_acknowledged: bool,
}

/// Time constant of the low-pass for the velocity feed-forward in CSP, because targets are whole counts.
const FORWARD_FILTER_S: f64 = 1e-3;
/// Number of periods for which the velocity is fed forward, so that a SYNC up to one period late does not disturb the
/// joint.
const FORWARD_PERIODS: f64 = 2.0;
/// In interpolated position mode, a target up to this multiple of the longest step (profile velocity times period)
/// belongs to a stream. A more distant one is a move.
const STREAMED_STEPS: f64 = 1.5;
/// Tolerance in counts within which a profile has reached its target.
const ARRIVED: f64 = 0.01;

/// Generates the set-points of the loops.
#[derive(Clone, Copy, Debug)]
pub struct ErobMotion {
    mode: Option<OperationMode>,
    velocity_limit: f64,
    position: f64,
    velocity: f64,
    torque: f64,
    forward: f64,
    interpolation: Interpolation,
    /// Whether the targets of interpolated position mode come as a stream.
    is_streamed: bool,
    set_points: SetPoints,
    /// How long the actual value has been within its window.
    in_window_s: f64,
    is_limited: bool,
}

/// The measured motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErobActual {
    /// counts
    pub position: f64,
    /// counts/s
    pub velocity: f64,
}

impl ErobMotion {
    /// A generator at standstill. The limit (counts/s) is the drive's own.
    pub fn new(velocity_limit: f64) -> Self {
        Self {
            mode: None,
            velocity_limit,
            position: 0.0,
            velocity: 0.0,
            torque: 0.0,
            forward: 0.0,
            interpolation: Interpolation::default(),
            is_streamed: false,
            set_points: SetPoints::default(),
            in_window_s: 0.0,
            is_limited: false,
        }
    }

    /// Starts at the actual position, when torque comes on. The CSP target is the value of object 607A, so an old one
    /// makes the axis jump.
    pub fn engage(
        &mut self,
        mode: Option<OperationMode>,
        actual: ErobActual,
        dictionary: &SimulatedDictionary,
    ) {
        *self = Self {
            mode,
            position: actual.position,
            velocity: actual.velocity,
            set_points: SetPoints { last: actual.position, ..SetPoints::default() },
            ..Self::new(self.velocity_limit)
        };
        self.interpolation.target = actual.position;
        self.latch(dictionary);
    }

    /// Without torque, the demand follows the actual position.
    pub fn follow(&mut self, actual: ErobActual) {
        self.position = actual.position;
        self.velocity = 0.0;
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
        if target == self.interpolation.target && self.interpolation.left_s > 0.0 {
            return;
        }
        if is_interpolating {
            let longest_step =
                dictionary.real(at::PROFILE_VELOCITY).min(self.velocity_limit(dictionary)) * period_s;
            let is_within_stream = (target - self.position).abs() <= STREAMED_STEPS * longest_step;
            if !self.is_streamed && is_within_stream {
                self.interpolation.target = self.position;
            }
            self.is_streamed = is_within_stream;
            if !is_within_stream {
                return;
            }
        }
        let limit = self.velocity_limit(dictionary);
        let velocity = ((target - self.interpolation.target) / period_s).clamp(-limit, limit);
        self.interpolation =
            Interpolation { target, left_s: period_s, velocity, forward_s: FORWARD_PERIODS * period_s };
    }

    /// Evaluates the controlword bits of profile position mode in an enabled drive.
    pub fn evaluate(&mut self, word: u16, previous: u16, dictionary: &SimulatedDictionary) {
        if !self.is_profile_position() {
            return;
        }
        if word & !previous & controlword::BIT_4 != 0 && !self.set_points.is_acknowledged {
            let base = if word & controlword::RELATIVE != 0 { self.set_points.last } else { 0.0 };
            let wanted = base + dictionary.real(at::TARGET_POSITION);
            let target = self.within_software_limits(wanted, dictionary);
            if word & controlword::BIT_5 != 0 || self.set_points.active.is_none() {
                self.set_points.active = Some(target);
                self.set_points.buffered = None;
            } else {
                self.set_points.buffered = Some(target);
            }
            self.set_points.last = target;
            self.set_points.is_acknowledged = true;
            self.in_window_s = 0.0;
        }
        if word & controlword::BIT_4 == 0 && self.set_points.buffered.is_none() {
            self.set_points.is_acknowledged = false;
        }
    }

    /// Advances by `duration_s` and returns the set-point. A position is that of the beginning of the step, when the
    /// actual position was measured.
    pub fn step(
        &mut self,
        word: u16,
        actual: ErobActual,
        dictionary: &SimulatedDictionary,
        duration_s: f64,
    ) -> ErobDemand {
        let is_halted = word & controlword::HALT != 0;
        let torque = dictionary.real(at::TORQUE_OFFSET);
        let position = self.position;
        match self.mode {
            Some(OperationMode::InterpolatedPosition) if self.is_streamed && !is_halted => {
                self.step_interpolation(dictionary, duration_s);
                ErobDemand::Position { position, velocity: self.forward, torque: 0.0 }
            }
            Some(OperationMode::ProfilePosition | OperationMode::InterpolatedPosition) => {
                if is_halted {
                    self.ramp_velocity(0.0, dictionary, duration_s);
                } else {
                    self.step_profile(dictionary, duration_s);
                }
                ErobDemand::Position { position, velocity: self.velocity, torque: 0.0 }
            }
            Some(OperationMode::ProfileVelocity) => {
                let wanted = if is_halted { 0.0 } else { dictionary.real(at::TARGET_VELOCITY) };
                self.position = actual.position;
                let wanted = self.velocity_within_limits(wanted, dictionary);
                self.ramp_velocity(wanted, dictionary, duration_s);
                ErobDemand::Velocity { velocity: self.velocity, torque: 0.0 }
            }
            Some(OperationMode::ProfileTorque) => {
                let wanted = if is_halted { 0.0 } else { dictionary.real(at::TARGET_TORQUE) };
                let slope = dictionary.real(at::TORQUE_SLOPE);
                // A slope of 0 means no slope: the torque steps.
                let most = if slope > 0.0 { slope * duration_s } else { f64::INFINITY };
                self.torque += (wanted - self.torque).clamp(-most, most);
                ErobDemand::Torque(self.torque)
            }
            Some(OperationMode::CyclicSynchronousPosition) => {
                self.step_interpolation(dictionary, duration_s);
                let velocity = self.forward + dictionary.real(at::VELOCITY_OFFSET);
                ErobDemand::Position { position, velocity, torque }
            }
            Some(OperationMode::CyclicSynchronousVelocity) => {
                let wanted = dictionary.real(at::TARGET_VELOCITY) + dictionary.real(at::VELOCITY_OFFSET);
                self.position = actual.position;
                self.velocity = self.velocity_within_limits(wanted, dictionary);
                ErobDemand::Velocity { velocity: self.velocity, torque }
            }
            Some(OperationMode::CyclicSynchronousTorque) => {
                self.torque = dictionary.real(at::TARGET_TORQUE) + torque;
                ErobDemand::Torque(self.torque)
            }
            _ => ErobDemand::Position { position, velocity: 0.0, torque: 0.0 },
        }
    }

    /// Decelerates in any mode, and returns whether the demand is at standstill.
    pub fn step_stop(&mut self, deceleration: f64, duration_s: f64) -> (ErobDemand, bool) {
        let most = deceleration * duration_s;
        self.velocity -= self.velocity.clamp(-most, most);
        self.position += self.velocity * duration_s;
        (ErobDemand::Velocity { velocity: self.velocity, torque: 0.0 }, self.velocity == 0.0)
    }

    /// Begins a deceleration from the actual velocity.
    pub fn begin_stop(&mut self, actual: ErobActual) {
        self.position = actual.position;
        self.velocity = actual.velocity;
    }

    /// Whether the mode follows a position, and so has a following error.
    pub fn follows_position(&self) -> bool {
        matches!(self.mode, Some(OperationMode::CyclicSynchronousPosition)) || self.is_profile_position()
    }

    /// Demanded position in counts (object 6062).
    pub fn position(&self) -> f64 {
        self.position
    }

    /// Demanded velocity in counts/s (object 606B).
    pub fn velocity(&self) -> f64 {
        self.velocity
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

    fn within_software_limits(&mut self, position: f64, dictionary: &SimulatedDictionary) -> f64 {
        let lowest = dictionary.real(at::POSITION_MIN);
        let highest = dictionary.real(at::POSITION_MAX);
        let limited = position.min(highest).max(lowest);
        self.is_limited = limited != position;
        limited
    }

    /// Limits a velocity so that it does not go beyond the software limits.
    fn velocity_within_limits(&mut self, velocity: f64, dictionary: &SimulatedDictionary) -> f64 {
        let limit = self.velocity_limit(dictionary);
        let is_beyond = velocity > 0.0 && self.position >= dictionary.real(at::POSITION_MAX)
            || velocity < 0.0 && self.position <= dictionary.real(at::POSITION_MIN);
        self.is_limited = is_beyond || velocity.abs() > limit;
        if is_beyond { 0.0 } else { velocity.clamp(-limit, limit) }
    }

    fn step_interpolation(&mut self, dictionary: &SimulatedDictionary, duration_s: f64) {
        let Interpolation { target, left_s, velocity, forward_s } = self.interpolation;
        let most = self.velocity_limit(dictionary) * duration_s;
        let distance = target - self.position;
        // Without a new target, the last one is reached and held.
        let share = if left_s > duration_s { duration_s / left_s } else { 1.0 };
        let step = (distance * share).clamp(-most, most);
        self.position += step;
        self.velocity = step / duration_s;
        self.interpolation.left_s = (left_s - duration_s).max(0.0);
        self.interpolation.forward_s = (forward_s - duration_s).max(0.0);
        let wanted = if forward_s > 0.0 { velocity } else { 0.0 };
        self.forward += (wanted - self.forward) * duration_s / (FORWARD_FILTER_S + duration_s);
    }

    /// One step of a trapezoidal profile to the active set-point.
    fn step_profile(&mut self, dictionary: &SimulatedDictionary, duration_s: f64) {
        let Some(target) = self.set_points.active else {
            self.ramp_velocity(0.0, dictionary, duration_s);
            return;
        };
        let distance = target - self.position;
        let deceleration = deceleration(dictionary);
        // The highest velocity from which whole steps of the deceleration end exactly at the target.
        let step = deceleration * duration_s;
        let highest = step * ((0.25 + 2.0 * distance.abs() / (step * duration_s)).sqrt() - 0.5);
        let limit = dictionary.real(at::PROFILE_VELOCITY).min(self.velocity_limit(dictionary));
        self.ramp_velocity(highest.min(limit).copysign(distance), dictionary, duration_s);
        if (target - self.position).abs() < ARRIVED && self.velocity.abs() <= 2.0 * step {
            self.position = target;
            self.velocity = 0.0;
            self.set_points.active = self.set_points.buffered.take();
        }
    }

    /// Ramps the demanded velocity towards `wanted` by the profile, and moves.
    fn ramp_velocity(&mut self, wanted: f64, dictionary: &SimulatedDictionary, duration_s: f64) {
        let is_faster = wanted * self.velocity >= 0.0 && wanted.abs() > self.velocity.abs();
        let rate = if is_faster { acceleration(dictionary) } else { deceleration(dictionary) };
        let most = rate * duration_s;
        self.velocity += (wanted - self.velocity).clamp(-most, most);
        self.position += self.velocity * duration_s;
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
