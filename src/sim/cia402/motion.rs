//! The set-points of the control loops in every mode of operation. Units: position units (counts), counts/s, per mille of the
//! rated torque.

mod status;

use takt_rt::{OperationMode, controlword};

use crate::sim::homing_switches::ReferenceSwitches;

use super::homing::{Homing, HomingSpeed, HomingStep};
use super::profile::Profile;

/// The set-point of the loops for one step.
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

/// The interpolation from one cyclic target to the next.
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

/// Time constant of the low-pass for the velocity feed-forward of cyclic targets, because they are whole counts.
const FORWARD_FILTER_S: f64 = 1e-3;
/// Number of periods for which the velocity is fed forward, so that a SYNC up to one period late does not disturb the
/// joint.
const FORWARD_PERIODS: f64 = 2.0;
/// Tolerance in counts within which a profile has reached its target.
const ARRIVED: f64 = 0.01;

/// Generates the set-points of the loops.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    mode: Option<OperationMode>,
    position: f64,
    velocity: f64,
    torque: f64,
    forward: f64,
    interpolation: Interpolation,
    set_points: SetPoints,
    homing: Homing,
    /// How long the actual value has been within its window.
    in_window_s: f64,
    /// How long the following error has been beyond its window.
    beyond_window_s: f64,
    is_limited: bool,
    has_following_error: bool,
}

/// The measured motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actual {
    /// counts
    pub position: f64,
    /// counts/s
    pub velocity: f64,
}

impl Motion {
    /// A generator at standstill.
    pub const fn new() -> Self {
        Self {
            mode: None,
            position: 0.0,
            velocity: 0.0,
            torque: 0.0,
            forward: 0.0,
            interpolation: Interpolation { target: 0.0, left_s: 0.0, velocity: 0.0, forward_s: 0.0 },
            set_points: SetPoints { active: None, buffered: None, last: 0.0, is_acknowledged: false },
            homing: Homing::idle(),
            in_window_s: 0.0,
            beyond_window_s: 0.0,
            is_limited: false,
            has_following_error: false,
        }
    }

    /// Starts at the actual position, when the axis follows set-points from now on, or its mode has changed. The cyclic
    /// target is the value of object 607A, so an old one makes the axis jump.
    pub fn engage(&mut self, mode: Option<OperationMode>, actual: Actual, profile: &Profile<'_>) {
        *self = Self { mode, position: actual.position, velocity: actual.velocity, ..Self::new() };
        self.set_points.last = actual.position;
        self.interpolation.target = actual.position;
        self.latch(profile);
    }

    /// Without torque, the demand follows the actual position.
    pub fn follow(&mut self, actual: Actual) {
        self.position = actual.position;
        self.velocity = 0.0;
        self.torque = 0.0;
        self.homing.interrupt();
    }

    /// Shifts the positions, when homing has given the joint another position.
    pub fn shift(&mut self, by: f64) {
        self.position += by;
        self.interpolation.target += by;
        self.set_points.last += by;
    }

    /// Latches the target of CSP, or of interpolated position mode while controlword bit 4 is set: at SYNC, or after a
    /// write in between. It is reached at the end of the interpolation period. The same target again changes nothing while
    /// the interpolation runs.
    pub fn latch(&mut self, profile: &Profile<'_>) {
        let places = profile.places;
        let wanted = match self.mode {
            Some(OperationMode::CyclicSynchronousPosition) => {
                profile.real(places.target_position) + profile.real(places.position_offset)
            }
            Some(OperationMode::InterpolatedPosition) if self.interpolates(profile) => {
                profile.real(places.interpolation_data.or(places.target_position))
            }
            _ => return,
        };
        let target = self.within_software_limits(wanted, profile);
        if target == self.interpolation.target && self.interpolation.left_s > 0.0 {
            return;
        }
        let period_s = profile.interpolation_period_s();
        let limit = profile.velocity_limit();
        let velocity = ((target - self.interpolation.target) / period_s).clamp(-limit, limit);
        self.interpolation =
            Interpolation { target, left_s: period_s, velocity, forward_s: FORWARD_PERIODS * period_s };
    }

    fn interpolates(&self, profile: &Profile<'_>) -> bool {
        profile.real(profile.places.controlword) as u16 & controlword::BIT_4 != 0
    }

    /// Evaluates the mode's bits of the controlword in an enabled drive. Returns whether the homing has found its home
    /// position without motion.
    pub fn evaluate(
        &mut self,
        word: u16,
        previous: u16,
        switches: &ReferenceSwitches,
        profile: &Profile<'_>,
    ) -> bool {
        let is_rising = word & !previous & controlword::BIT_4 != 0;
        match self.mode {
            Some(OperationMode::ProfilePosition) => {
                self.evaluate_set_point(word, is_rising, profile);
                false
            }
            Some(OperationMode::Homing) if is_rising => {
                let method = profile.real(profile.places.homing_method) as i64;
                self.homing.start(method, switches)
            }
            Some(OperationMode::Homing) => {
                if word & controlword::BIT_4 == 0 {
                    self.homing.interrupt();
                }
                false
            }
            Some(OperationMode::InterpolatedPosition) if is_rising => {
                self.interpolation = Interpolation { target: self.position, ..Interpolation::default() };
                self.latch(profile);
                false
            }
            _ => false,
        }
    }

    fn evaluate_set_point(&mut self, word: u16, is_rising: bool, profile: &Profile<'_>) {
        if is_rising && !self.set_points.is_acknowledged {
            let base = if word & controlword::RELATIVE != 0 { self.set_points.last } else { 0.0 };
            let wanted = base + profile.real(profile.places.target_position);
            let target = self.within_software_limits(wanted, profile);
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
    pub fn step(&mut self, word: u16, actual: Actual, profile: &Profile<'_>, duration_s: f64) -> Demand {
        let places = profile.places;
        let is_halted = word & controlword::HALT != 0;
        let offset = profile.real(places.torque_offset);
        let velocity_offset = profile.real(places.velocity_offset) * profile.units.velocity;
        let position = self.position;
        match self.mode {
            Some(
                OperationMode::ProfilePosition | OperationMode::Homing | OperationMode::InterpolatedPosition,
            ) if is_halted => {
                self.ramp_velocity(0.0, profile.deceleration_of(profile.halt_ramp()), duration_s);
                Demand::Position { position, velocity: self.velocity, torque: 0.0 }
            }
            Some(OperationMode::ProfilePosition) => {
                self.step_profile(profile, duration_s);
                Demand::Position { position, velocity: self.velocity, torque: 0.0 }
            }
            Some(OperationMode::Homing) => {
                let wanted = match self.homing.speed() {
                    HomingSpeed::Switch(direction) => direction * profile.real(places.homing_speed_switch),
                    HomingSpeed::Zero(direction) => direction * profile.real(places.homing_speed_zero),
                    HomingSpeed::Rest => 0.0,
                };
                let limit = profile.velocity_limit();
                let wanted = (wanted * profile.units.profile_velocity).clamp(-limit, limit);
                self.ramp_velocity(wanted, profile.homing_acceleration(), duration_s);
                Demand::Position { position, velocity: self.velocity, torque: 0.0 }
            }
            Some(OperationMode::ProfileVelocity) => {
                let target = profile.real(places.target_velocity) * profile.units.velocity;
                let wanted = if is_halted { 0.0 } else { target };
                self.position = actual.position;
                let wanted = self.velocity_within_limits(wanted, profile);
                let is_faster = wanted * self.velocity >= 0.0 && wanted.abs() > self.velocity.abs();
                let rate = match (is_halted, is_faster) {
                    (true, _) => profile.deceleration_of(profile.halt_ramp()),
                    (false, true) => profile.acceleration(),
                    (false, false) => profile.deceleration(),
                };
                self.ramp_velocity(wanted, rate, duration_s);
                Demand::Velocity { velocity: self.velocity, torque: 0.0 }
            }
            Some(OperationMode::ProfileTorque) => {
                let wanted = if is_halted { 0.0 } else { profile.real(places.target_torque) };
                let slope = profile.real(places.torque_slope);
                // Without a slope, or with 0, the torque steps.
                let most = if slope > 0.0 { slope * duration_s } else { f64::INFINITY };
                self.torque += (wanted - self.torque).clamp(-most, most);
                Demand::Torque(self.torque)
            }
            Some(OperationMode::CyclicSynchronousPosition) => {
                self.step_interpolation(profile, duration_s);
                Demand::Position { position, velocity: self.forward + velocity_offset, torque: offset }
            }
            Some(OperationMode::InterpolatedPosition) => {
                self.step_interpolation(profile, duration_s);
                Demand::Position { position, velocity: self.forward, torque: 0.0 }
            }
            Some(OperationMode::CyclicSynchronousVelocity) => {
                let wanted = profile.real(places.target_velocity) * profile.units.velocity + velocity_offset;
                self.position = actual.position;
                self.velocity = self.velocity_within_limits(wanted, profile);
                Demand::Velocity { velocity: self.velocity, torque: offset }
            }
            Some(OperationMode::CyclicSynchronousTorque) => {
                self.torque = profile.real(places.target_torque) + offset;
                Demand::Torque(self.torque)
            }
            _ => Demand::Position { position, velocity: 0.0, torque: 0.0 },
        }
    }

    /// Decelerates in any mode, and returns whether the demand is at standstill.
    pub fn step_stop(&mut self, deceleration: f64, duration_s: f64) -> (Demand, bool) {
        self.ramp_velocity(0.0, deceleration, duration_s);
        (Demand::Velocity { velocity: self.velocity, torque: 0.0 }, self.velocity == 0.0)
    }

    /// Begins a deceleration from the actual velocity.
    pub fn begin_stop(&mut self, actual: Actual) {
        self.position = actual.position;
        self.velocity = actual.velocity;
        self.homing.interrupt();
    }

    /// A step of the homing; returns the home position when it has just been found: rad (m).
    pub fn step_homing(&mut self, step: HomingStep<'_>) -> Option<f64> {
        if self.mode == Some(OperationMode::Homing) { self.homing.step(step) } else { None }
    }

    /// Whether the demand is at rest.
    pub fn is_at_rest(&self) -> bool {
        self.velocity == 0.0
    }

    /// Whether the following error has just been beyond its window (6065) for longer than its time (6066).
    pub fn exceeds_window(&mut self, actual: Actual, profile: &Profile<'_>, duration_s: f64) -> bool {
        let is_watched = matches!(
            self.mode,
            Some(
                OperationMode::ProfilePosition
                    | OperationMode::Homing
                    | OperationMode::InterpolatedPosition
                    | OperationMode::CyclicSynchronousPosition
            )
        );
        let window = profile.following_error_window().filter(|_| is_watched);
        self.has_following_error =
            window.is_some_and(|window| (self.position - actual.position).abs() > window);
        self.beyond_window_s = if self.has_following_error { self.beyond_window_s + duration_s } else { 0.0 };
        self.has_following_error
            && self.beyond_window_s > profile.milliseconds(profile.places.following_error_time)
    }

    /// Demanded position in counts (object 6062).
    pub fn position(&self) -> f64 {
        self.position
    }

    /// Demanded velocity in counts/s (object 606B).
    pub fn velocity(&self) -> f64 {
        self.velocity
    }

    fn within_software_limits(&mut self, position: f64, profile: &Profile<'_>) -> f64 {
        let (lowest, highest) = profile.software_limits();
        let limited = position.min(highest).max(lowest);
        self.is_limited = limited != position;
        limited
    }

    /// Limits a velocity so that it does not go beyond the software limits.
    fn velocity_within_limits(&mut self, velocity: f64, profile: &Profile<'_>) -> f64 {
        let limit = profile.velocity_limit();
        let (lowest, highest) = profile.software_limits();
        let is_beyond =
            velocity > 0.0 && self.position >= highest || velocity < 0.0 && self.position <= lowest;
        self.is_limited = is_beyond || velocity.abs() > limit;
        if is_beyond { 0.0 } else { velocity.clamp(-limit, limit) }
    }

    fn step_interpolation(&mut self, profile: &Profile<'_>, duration_s: f64) {
        let Interpolation { target, left_s, velocity, forward_s } = self.interpolation;
        let most = profile.velocity_limit() * duration_s;
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
    fn step_profile(&mut self, profile: &Profile<'_>, duration_s: f64) {
        let deceleration = profile.deceleration();
        let Some(target) = self.set_points.active else {
            self.ramp_velocity(0.0, deceleration, duration_s);
            return;
        };
        let distance = target - self.position;
        // The highest velocity from which whole steps of the deceleration end exactly at the target.
        let step = deceleration * duration_s;
        let highest = step * ((0.25 + 2.0 * distance.abs() / (step * duration_s)).sqrt() - 0.5);
        let wanted = highest.min(profile.profile_velocity()).copysign(distance);
        let is_faster = wanted * self.velocity >= 0.0 && wanted.abs() > self.velocity.abs();
        let rate = if is_faster { profile.acceleration() } else { deceleration };
        self.ramp_velocity(wanted, rate, duration_s);
        if (target - self.position).abs() < ARRIVED && self.velocity.abs() <= 2.0 * step {
            self.position = target;
            self.velocity = 0.0;
            self.set_points.active = self.set_points.buffered.take();
        }
    }

    /// Ramps the demanded velocity towards `wanted`, and moves.
    fn ramp_velocity(&mut self, wanted: f64, rate: f64, duration_s: f64) {
        let most = rate * duration_s;
        self.velocity += (wanted - self.velocity).clamp(-most, most);
        self.position += self.velocity * duration_s;
    }
}
