//! From set-points to what the loops are to follow, in every mode of operation. Counts, counts/s, per mille.

mod status;

use takt_rt::{OperationMode, controlword};

use super::dictionary::{Dictionary, at};

/// What the loops are to follow in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Demand {
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

/// The way from one latched CSP target to the next.
#[derive(Clone, Copy, Debug, Default)]
struct Interpolation {
    target: f64,
    left_s: f64,
    /// Velocity from the difference of the last two targets.
    velocity: f64,
    /// For how long it goes on being fed forward.
    forward_s: f64,
}

/// The set-points of profile position: one under way, one behind it.
#[derive(Clone, Copy, Debug, Default)]
struct SetPoints {
    active: Option<f64>,
    buffered: Option<f64>,
    /// The last target taken, to which relative ones are added.
    last: f64,
    is_acknowledged: bool,
}

/// The feed-forward of the velocity in CSP passes a low-pass of this time, since targets are whole counts.
const FORWARD_FILTER_S: f64 = 1e-3;
/// The velocity is fed forward for this many periods, so that a SYNC that is less than a period late does not shake
/// the joint.
const FORWARD_PERIODS: f64 = 2.0;
/// A target of interpolated position that is further away than this many of the steps that the profile velocity allows
/// is not one of a stream, but a move.
const STREAMED_REACH: f64 = 1.5;
/// Closer than this (counts) a profile has arrived.
const ARRIVED: f64 = 0.01;

/// The reference generator.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    mode: Option<OperationMode>,
    velocity_limit: f64,
    position: f64,
    velocity: f64,
    torque: f64,
    forward: f64,
    interpolation: Interpolation,
    /// Whether targets of interpolated position come as a stream, each within reach of the last.
    is_streamed: bool,
    set_points: SetPoints,
    /// For how long the actual value has been within its window.
    in_window_s: f64,
    is_limited: bool,
}

/// What the joint really does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actual {
    /// counts
    pub position: f64,
    /// counts/s
    pub velocity: f64,
}

impl Motion {
    /// A generator at rest. The limit (counts/s) is the drive's own highest speed.
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

    /// Torque comes on: everything begins at the actual position. The target of CSP is whatever object 607A holds,
    /// so a stale one makes the axis jump.
    pub fn engage(&mut self, mode: Option<OperationMode>, actual: Actual, dictionary: &Dictionary) {
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

    /// While there is no torque, the demand is where the joint is.
    pub fn follow(&mut self, actual: Actual) {
        self.position = actual.position;
        self.velocity = 0.0;
        self.torque = 0.0;
    }

    /// Takes the target of CSP, or of interpolated position while bit 4 is set, from the dictionary: at SYNC, or when it
    /// has been written in between. It is reached at the end of the interpolation period, so at the next SYNC. The same
    /// target again changes nothing while it is still under way.
    pub fn latch(&mut self, dictionary: &Dictionary) {
        let is_interpolating = self.mode == Some(OperationMode::InterpolatedPosition)
            && dictionary.get(at::CONTROLWORD) as u16 & controlword::BIT_4 != 0;
        if self.mode != Some(OperationMode::CyclicSynchronousPosition) && !is_interpolating {
            return;
        }
        let period_s = interpolation_period_s(dictionary);
        let wanted =
            dictionary.signed_real(at::TARGET_POSITION) + dictionary.signed_real(at::POSITION_OFFSET);
        let target = self.within_software_limits(wanted, dictionary);
        if target == self.interpolation.target && self.interpolation.left_s > 0.0 {
            return;
        }
        if is_interpolating {
            let reach = dictionary.real(at::PROFILE_VELOCITY).min(self.velocity_limit(dictionary)) * period_s;
            let is_in_reach = (target - self.position).abs() <= STREAMED_REACH * reach;
            if !self.is_streamed && is_in_reach {
                self.interpolation.target = self.position;
            }
            self.is_streamed = is_in_reach;
            if !is_in_reach {
                return;
            }
        }
        let limit = self.velocity_limit(dictionary);
        let velocity = ((target - self.interpolation.target) / period_s).clamp(-limit, limit);
        self.interpolation =
            Interpolation { target, left_s: period_s, velocity, forward_s: FORWARD_PERIODS * period_s };
    }

    /// Evaluates the bits of the controlword that belong to profile position, in an enabled drive.
    pub fn evaluate(&mut self, word: u16, previous: u16, dictionary: &Dictionary) {
        if !self.is_profile_position() {
            return;
        }
        if word & !previous & controlword::BIT_4 != 0 && !self.set_points.is_acknowledged {
            let base = if word & controlword::RELATIVE != 0 { self.set_points.last } else { 0.0 };
            let wanted = base + dictionary.signed_real(at::TARGET_POSITION);
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

    /// Moves on by `duration_s` and says what the loops are to follow: a position is that of the beginning of the
    /// step, which is when the actual one was measured.
    pub fn step(&mut self, word: u16, actual: Actual, dictionary: &Dictionary, duration_s: f64) -> Demand {
        let is_halted = word & controlword::HALT != 0;
        let torque = dictionary.signed_real(at::TORQUE_OFFSET);
        let position = self.position;
        match self.mode {
            Some(OperationMode::InterpolatedPosition) if self.is_streamed && !is_halted => {
                self.step_interpolation(dictionary, duration_s);
                Demand::Position { position, velocity: self.forward, torque: 0.0 }
            }
            Some(OperationMode::ProfilePosition | OperationMode::InterpolatedPosition) => {
                if is_halted {
                    self.ramp_velocity(0.0, dictionary, duration_s);
                } else {
                    self.step_profile(dictionary, duration_s);
                }
                Demand::Position { position, velocity: self.velocity, torque: 0.0 }
            }
            Some(OperationMode::ProfileVelocity) => {
                let wanted = if is_halted { 0.0 } else { dictionary.signed_real(at::TARGET_VELOCITY) };
                self.position = actual.position;
                let wanted = self.velocity_within_limits(wanted, dictionary);
                self.ramp_velocity(wanted, dictionary, duration_s);
                Demand::Velocity { velocity: self.velocity, torque: 0.0 }
            }
            Some(OperationMode::ProfileTorque) => {
                let wanted = if is_halted { 0.0 } else { dictionary.signed_real(at::TARGET_TORQUE) };
                let slope = dictionary.real(at::TORQUE_SLOPE);
                // A slope of 0 is none: the torque steps.
                let most = if slope > 0.0 { slope * duration_s } else { f64::INFINITY };
                self.torque += (wanted - self.torque).clamp(-most, most);
                Demand::Torque(self.torque)
            }
            Some(OperationMode::CyclicSynchronousPosition) => {
                self.step_interpolation(dictionary, duration_s);
                let velocity = self.forward + dictionary.signed_real(at::VELOCITY_OFFSET);
                Demand::Position { position, velocity, torque }
            }
            Some(OperationMode::CyclicSynchronousVelocity) => {
                let wanted =
                    dictionary.signed_real(at::TARGET_VELOCITY) + dictionary.signed_real(at::VELOCITY_OFFSET);
                self.position = actual.position;
                self.velocity = self.velocity_within_limits(wanted, dictionary);
                Demand::Velocity { velocity: self.velocity, torque }
            }
            Some(OperationMode::CyclicSynchronousTorque) => {
                self.torque = dictionary.signed_real(at::TARGET_TORQUE) + torque;
                Demand::Torque(self.torque)
            }
            _ => Demand::Position { position, velocity: 0.0, torque: 0.0 },
        }
    }

    /// Decelerates, whatever the mode, and says whether the demand has come to rest.
    pub fn step_stop(&mut self, deceleration: f64, duration_s: f64) -> (Demand, bool) {
        let most = deceleration * duration_s;
        self.velocity -= self.velocity.clamp(-most, most);
        self.position += self.velocity * duration_s;
        (Demand::Velocity { velocity: self.velocity, torque: 0.0 }, self.velocity == 0.0)
    }

    /// A deceleration begins: the demand takes over the actual velocity.
    pub fn begin_stop(&mut self, actual: Actual) {
        self.position = actual.position;
        self.velocity = actual.velocity;
    }

    /// Whether the mode has a position to follow, and with it a following error.
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
        // Mode 7, where a unit has it, moves like mode 1 (eRunner manual 1.7, 5.7: a move to an absolute
        // target that bit 4 starts and profile velocity 0 stops), unless the targets come as a stream.
        matches!(self.mode, Some(OperationMode::ProfilePosition | OperationMode::InterpolatedPosition))
    }

    fn is_cyclic(&self) -> bool {
        self.mode.is_some_and(|mode| mode as i8 >= OperationMode::CyclicSynchronousPosition as i8)
    }

    fn velocity_limit(&self, dictionary: &Dictionary) -> f64 {
        dictionary.real(at::MAX_PROFILE_VELOCITY).min(self.velocity_limit)
    }

    fn within_software_limits(&mut self, position: f64, dictionary: &Dictionary) -> f64 {
        let lowest = dictionary.signed_real(at::POSITION_MIN);
        let highest = dictionary.signed_real(at::POSITION_MAX);
        let limited = position.min(highest).max(lowest);
        self.is_limited = limited != position;
        limited
    }

    /// A velocity that does not lead beyond the software limits.
    fn velocity_within_limits(&mut self, velocity: f64, dictionary: &Dictionary) -> f64 {
        let limit = self.velocity_limit(dictionary);
        let is_beyond = velocity > 0.0 && self.position >= dictionary.signed_real(at::POSITION_MAX)
            || velocity < 0.0 && self.position <= dictionary.signed_real(at::POSITION_MIN);
        self.is_limited = is_beyond || velocity.abs() > limit;
        if is_beyond { 0.0 } else { velocity.clamp(-limit, limit) }
    }

    fn step_interpolation(&mut self, dictionary: &Dictionary, duration_s: f64) {
        let Interpolation { target, left_s, velocity, forward_s } = self.interpolation;
        let most = self.velocity_limit(dictionary) * duration_s;
        let distance = target - self.position;
        // Without a new target the last one is reached and held.
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
    fn step_profile(&mut self, dictionary: &Dictionary, duration_s: f64) {
        let Some(target) = self.set_points.active else {
            self.ramp_velocity(0.0, dictionary, duration_s);
            return;
        };
        let distance = target - self.position;
        let deceleration = deceleration(dictionary);
        // The highest velocity from which whole steps of the deceleration lead exactly to the target.
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

    /// Brings the demanded velocity nearer to `wanted` by the profile's acceleration or deceleration, and moves.
    fn ramp_velocity(&mut self, wanted: f64, dictionary: &Dictionary, duration_s: f64) {
        let is_faster = wanted * self.velocity >= 0.0 && wanted.abs() > self.velocity.abs();
        let rate = if is_faster { acceleration(dictionary) } else { deceleration(dictionary) };
        let most = rate * duration_s;
        self.velocity += (wanted - self.velocity).clamp(-most, most);
        self.position += self.velocity * duration_s;
    }
}

fn acceleration(dictionary: &Dictionary) -> f64 {
    dictionary.real(at::PROFILE_ACCELERATION).min(dictionary.real(at::MAX_ACCELERATION))
}

/// At least 1 count/s², since a profile without any would never end.
fn deceleration(dictionary: &Dictionary) -> f64 {
    dictionary.real(at::PROFILE_DECELERATION).min(dictionary.real(at::MAX_DECELERATION)).max(1.0)
}

/// The period over which CSP interpolates: the SYNC period 1006, or else 60C2, or else 1 ms.
fn interpolation_period_s(dictionary: &Dictionary) -> f64 {
    let cycle_us = dictionary.real(at::CYCLE_PERIOD);
    if cycle_us > 0.0 {
        return cycle_us * 1e-6;
    }
    let exponent = dictionary.signed(at::INTERPOLATION_EXPONENT).clamp(-6, 0);
    let period_s = dictionary.real(at::INTERPOLATION_PERIOD) * 10f64.powi(exponent);
    if period_s > 0.0 { period_s } else { 1e-3 }
}
