//! The set-points of the control loops in every mode of operation. Units: position units (counts), counts/s, per mille of the
//! rated torque.

mod status;

use takt_rt::{OperationMode, controlword};

use crate::homing_switches::ReferenceSwitches;
use crate::motion::{Actual, Demand, Generator, SetPoints};

use super::homing::{Homing, HomingSpeed, HomingStep};
use super::profile::Profile;

/// In interpolated position mode with moves, a target up to this multiple of the longest step (profile velocity times period)
/// belongs to a stream. A more distant one is a move.
const STREAMED_STEPS: f64 = 1.5;

/// Generates the set-points of the loops.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    mode: Option<OperationMode>,
    /// True if a distant target of interpolated position mode is a move by the profile.
    moves_in_interpolation: bool,
    /// True if the targets of interpolated position mode come as a stream.
    is_streamed: bool,
    generator: Generator,
    torque: f64,
    set_points: SetPoints,
    homing: Homing,
    /// How long the actual value has been within its window.
    in_window_s: f64,
    /// How long the following error has been beyond its window.
    beyond_window_s: f64,
    is_limited: bool,
    has_following_error: bool,
}

impl Motion {
    /// A generator at standstill.
    pub fn new(moves_in_interpolation: bool) -> Self {
        Self {
            mode: None,
            moves_in_interpolation,
            is_streamed: false,
            generator: Generator::default(),
            torque: 0.0,
            set_points: SetPoints::default(),
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
        *self = Self {
            mode,
            generator: Generator::starting(actual),
            set_points: SetPoints::starting(actual.position),
            ..Self::new(self.moves_in_interpolation)
        };
        self.latch(profile);
    }

    /// Without torque, the demand follows the actual position.
    pub fn follow(&mut self, actual: Actual) {
        self.generator.follow(Actual { velocity: 0.0, ..actual });
        self.torque = 0.0;
        self.homing.interrupt();
    }

    /// Shifts the positions, when homing has given the joint another position.
    pub fn shift(&mut self, by: f64) {
        self.generator.shift(by);
        self.set_points.shift(by);
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
        if !self.generator.interpolates_to(target) && self.streams_to(target, profile) {
            let period_s = profile.interpolation_period_s();
            self.generator.interpolate_to(target, period_s, profile.velocity_limit());
        }
    }

    /// Returns `true` if a cyclic target is one of a stream, and not one of a move.
    fn streams_to(&mut self, target: f64, profile: &Profile<'_>) -> bool {
        if !self.moves_in_interpolation || self.mode != Some(OperationMode::InterpolatedPosition) {
            return true;
        }
        let longest_step = profile.profile_velocity() * profile.interpolation_period_s();
        let is_within_stream = (target - self.generator.position).abs() <= STREAMED_STEPS * longest_step;
        if !self.is_streamed && is_within_stream {
            self.generator.target = self.generator.position;
        }
        self.is_streamed = is_within_stream;
        is_within_stream
    }

    /// Returns `true` if bit 4 of the controlword starts a move by the profile.
    fn has_set_points(&self) -> bool {
        self.mode == Some(OperationMode::ProfilePosition)
            || self.mode == Some(OperationMode::InterpolatedPosition) && self.moves_in_interpolation
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
            _ if self.has_set_points() => {
                self.evaluate_set_point(word, previous, profile);
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
                self.generator.end_interpolation();
                self.latch(profile);
                false
            }
            _ => false,
        }
    }

    fn evaluate_set_point(&mut self, word: u16, previous: u16, profile: &Profile<'_>) {
        let mut set_points = self.set_points;
        let wanted = profile.real(profile.places.target_position);
        let target = |base| self.within_software_limits(base + wanted, profile);
        if set_points.evaluate(word, previous, target) {
            self.in_window_s = 0.0;
        }
        self.set_points = set_points;
    }

    /// Advances by `duration_s` and returns the set-point. A position is that of the beginning of the step, when the
    /// actual position was measured.
    pub fn step(&mut self, word: u16, actual: Actual, profile: &Profile<'_>, duration_s: f64) -> Demand {
        let places = profile.places;
        let is_halted = word & controlword::HALT != 0;
        let offset = profile.real(places.torque_offset);
        let velocity_offset = profile.real(places.velocity_offset) * profile.units.velocity;
        let position = self.generator.position;
        match self.mode {
            Some(
                OperationMode::ProfilePosition | OperationMode::Homing | OperationMode::InterpolatedPosition,
            ) if is_halted => {
                self.generator.ramp(0.0, profile.deceleration_of(profile.halt_ramp()), duration_s);
                Demand::Position { position, velocity: self.generator.velocity, torque: 0.0 }
            }
            _ if self.has_set_points() && !self.is_streamed => {
                self.step_profile(profile, duration_s);
                Demand::Position { position, velocity: self.generator.velocity, torque: 0.0 }
            }
            Some(OperationMode::Homing) => {
                let wanted = match self.homing.speed() {
                    HomingSpeed::Switch(direction) => direction * profile.real(places.homing_speed_switch),
                    HomingSpeed::Zero(direction) => direction * profile.real(places.homing_speed_zero),
                    HomingSpeed::Rest => 0.0,
                };
                let limit = profile.velocity_limit();
                let wanted = (wanted * profile.units.profile_velocity).clamp(-limit, limit);
                self.generator.ramp(wanted, profile.homing_acceleration(), duration_s);
                Demand::Position { position, velocity: self.generator.velocity, torque: 0.0 }
            }
            Some(OperationMode::ProfileVelocity) => {
                let target = profile.real(places.target_velocity) * profile.units.velocity;
                let wanted = if is_halted { 0.0 } else { target };
                self.generator.position = actual.position;
                let wanted = self.velocity_within_limits(wanted, profile);
                if is_halted {
                    let rate = profile.deceleration_of(profile.halt_ramp());
                    self.generator.ramp(wanted, rate, duration_s);
                } else {
                    let (acceleration, deceleration) = (profile.acceleration(), profile.deceleration());
                    self.generator.ramp_between(wanted, acceleration, deceleration, duration_s);
                }
                Demand::Velocity { velocity: self.generator.velocity, torque: 0.0 }
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
                self.generator.step_interpolation(profile.velocity_limit(), duration_s);
                Demand::Position {
                    position,
                    velocity: self.generator.forward + velocity_offset,
                    torque: offset,
                }
            }
            Some(OperationMode::InterpolatedPosition) => {
                self.generator.step_interpolation(profile.velocity_limit(), duration_s);
                Demand::Position { position, velocity: self.generator.forward, torque: 0.0 }
            }
            Some(OperationMode::CyclicSynchronousVelocity) => {
                let wanted = profile.real(places.target_velocity) * profile.units.velocity + velocity_offset;
                self.generator.position = actual.position;
                self.generator.velocity = self.velocity_within_limits(wanted, profile);
                Demand::Velocity { velocity: self.generator.velocity, torque: offset }
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
        self.generator.ramp(0.0, deceleration, duration_s);
        (Demand::Velocity { velocity: self.generator.velocity, torque: 0.0 }, self.generator.velocity == 0.0)
    }

    /// Begins a deceleration from the actual velocity.
    pub fn begin_stop(&mut self, actual: Actual) {
        self.generator.follow(actual);
        self.homing.interrupt();
    }

    /// A step of the homing; returns the home position when it has just been found: rad (m).
    pub fn step_homing(&mut self, step: HomingStep<'_>) -> Option<f64> {
        if self.mode == Some(OperationMode::Homing) { self.homing.step(step) } else { None }
    }

    /// Returns `true` if the demand is at rest.
    pub fn is_at_rest(&self) -> bool {
        self.generator.velocity == 0.0
    }

    /// Returns `true` if the following error has just been beyond its window (6065) for longer than its time (6066).
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
            window.is_some_and(|window| (self.generator.position - actual.position).abs() > window);
        self.beyond_window_s = if self.has_following_error { self.beyond_window_s + duration_s } else { 0.0 };
        self.has_following_error
            && self.beyond_window_s > profile.milliseconds(profile.places.following_error_time)
    }

    /// Demanded position in counts (object 6062).
    pub fn position(&self) -> f64 {
        self.generator.position
    }

    /// Demanded velocity in counts/s (object 606B).
    pub fn velocity(&self) -> f64 {
        self.generator.velocity
    }

    fn within_software_limits(&mut self, position: f64, profile: &Profile<'_>) -> f64 {
        let limited = profile.limits().position(position);
        self.is_limited = limited != position;
        limited
    }

    /// Limits a velocity so that it does not go beyond the software limits.
    fn velocity_within_limits(&mut self, velocity: f64, profile: &Profile<'_>) -> f64 {
        let limited = profile.limits().velocity_at(self.generator.position, velocity);
        self.is_limited = limited != velocity;
        limited
    }

    /// One step of a trapezoidal profile to the active set-point.
    fn step_profile(&mut self, profile: &Profile<'_>, duration_s: f64) {
        let (acceleration, deceleration) = (profile.acceleration(), profile.deceleration());
        let velocity = profile.profile_velocity();
        match self.set_points.active {
            Some(target) => {
                if self.generator.step_profile(target, velocity, acceleration, deceleration, duration_s) {
                    self.set_points.arrived();
                }
            }
            None => self.generator.ramp(0.0, deceleration, duration_s),
        }
    }
}
