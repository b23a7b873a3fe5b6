//! Straight lines (the paper's "phase synchronisation"): all axes follow one profile, each multiplied by its own ratio.

use super::error::PlanError;
use super::problem::{Limits, Problem, State};
use super::profile::Profile;

/// A quantity may differ from its proportion by this much, relative to its size.
const PROPORTION: f64 = 1e-9;

/// A difference up to this, relative to positions and limits, is rounding.
const ROUNDING: f64 = 1024.0 * f64::EPSILON;

/// The straight line of a motion: every axis moves in proportion to one of them, the reference axis.
#[derive(Clone, Copy)]
pub(super) struct Line {
    reference: usize,
    problem: Problem,
}

/// The quantities that must be in proportion: the distance, and the velocities and accelerations at both ends.
fn quantities(problem: &Problem) -> [f64; 5] {
    let Problem { start, target, limits } = problem;
    let accelerations =
        if limits.is_second_order() { [0.0; 2] } else { [start.acceleration, target.acceleration] };
    let distance = target.position - start.position;
    [distance, start.velocity, target.velocity, accelerations[0], accelerations[1]]
}

impl Line {
    /// The line on which all axes move.
    ///
    /// # Errors
    /// [`PlanError::NotStraight`] if an axis is not in proportion to the others.
    pub(super) fn of(problems: &[Problem]) -> Result<Self, PlanError> {
        // The axis with the longest distance. If all distances are zero: the fastest axis, or the one that accelerates most.
        let mut reference = (
            0,
            Problem {
                start: State::rest(0.0),
                target: State::rest(0.0),
                limits: Limits::symmetric(1.0, 1.0, 1.0),
            },
        );
        let mut largest = 0.0;
        for quantity in 0..5 {
            for (axis, problem) in problems.iter().enumerate() {
                let size = quantities(problem).get(quantity).map_or(0.0, |value| value.abs());
                if size > largest || (axis == 0 && quantity == 0) {
                    largest = size;
                    reference = (axis, *problem);
                }
            }
            if largest > 0.0 {
                break;
            }
        }
        let line = Self { reference: reference.0, problem: reference.1 };
        for (axis, problem) in problems.iter().enumerate() {
            if !line.contains(problem) {
                return Err(PlanError::NotStraight { axis });
            }
        }
        Ok(line)
    }

    /// How far the axis moves when the reference axis moves by one.
    fn ratio(&self, problem: &Problem) -> f64 {
        let all = quantities(&self.problem).into_iter().zip(quantities(problem));
        all.into_iter()
            .find(|(reference, _)| *reference != 0.0)
            .map_or(0.0, |(reference, own)| own / reference)
    }

    fn contains(&self, problem: &Problem) -> bool {
        let ratio = self.ratio(problem);
        let Problem { start, target, limits } = problem;
        let velocity = limits.velocity_max.max(-limits.velocity_min);
        let acceleration = limits.acceleration_max.max(-limits.acceleration_min);
        let rounding =
            [start.position.abs() + target.position.abs(), velocity, velocity, acceleration, acceleration];
        let both = quantities(&self.problem).into_iter().zip(quantities(problem)).zip(rounding);
        both.into_iter().all(|((reference, own), rounding)| {
            (own - ratio * reference).abs() <= PROPORTION * own.abs() + ROUNDING * rounding
        })
    }

    /// The problem of the reference axis, with limits so that every axis keeps its own.
    pub(super) fn projected(&self, problems: &[Problem]) -> Problem {
        let mut limits =
            Limits { position_max: f64::INFINITY, position_min: f64::NEG_INFINITY, ..self.problem.limits };
        for problem in problems {
            let ratio = self.ratio(problem);
            if ratio == 0.0 {
                continue;
            }
            let own = &problem.limits;
            let project = |max: f64, min: f64| {
                if ratio > 0.0 { (max / ratio, min / ratio) } else { (min / ratio, max / ratio) }
            };
            let (velocity_max, velocity_min) = project(own.velocity_max, own.velocity_min);
            let (acceleration_max, acceleration_min) = project(own.acceleration_max, own.acceleration_min);
            limits.velocity_max = limits.velocity_max.min(velocity_max);
            limits.velocity_min = limits.velocity_min.max(velocity_min);
            limits.acceleration_max = limits.acceleration_max.min(acceleration_max);
            limits.acceleration_min = limits.acceleration_min.max(acceleration_min);
            limits.jerk_max = limits.jerk_max.min(own.jerk_max / ratio.abs());
        }
        Problem { limits, ..self.problem }
    }

    /// Lets all axes follow the profile of the reference axis.
    pub(super) fn follow(&self, reference: &Profile, problems: &[Problem], profiles: &mut [Profile]) {
        for (axis, (problem, profile)) in problems.iter().zip(profiles.iter_mut()).enumerate() {
            profile.take_motion(reference);
            if axis != self.reference {
                profile.scale(self.ratio(problem), problem.start.position, problem.target);
            }
        }
    }

    /// Returns `true` if every axis keeps its limits when it follows this profile of the reference axis.
    pub(super) fn keeps_limits(&self, reference: &Profile, problems: &[Problem]) -> bool {
        let within = |value: f64, min: f64, max: f64| {
            value >= min * (1.0 + ROUNDING) && value <= max * (1.0 + ROUNDING)
        };
        let extrema = reference.extrema();
        // Without a jerk limit the acceleration jumps between the phases.
        let jerk = match self.problem.limits.is_second_order() {
            true => f64::INFINITY,
            false => reference.phases().fold(0.0_f64, |largest, phase| largest.max(phase.jerk.abs())),
        };
        problems.iter().all(|problem| {
            let ratio = self.ratio(problem);
            let Limits { velocity_max, velocity_min, acceleration_max, acceleration_min, jerk_max, .. } =
                problem.limits;
            let velocities = [extrema.velocity.min, extrema.velocity.max];
            let accelerations = [extrema.acceleration.min, extrema.acceleration.max];
            velocities.iter().all(|velocity| within(ratio * velocity, velocity_min, velocity_max))
                && accelerations.iter().all(|value| within(ratio * value, acceleration_min, acceleration_max))
                && (ratio == 0.0 || ratio.abs() * jerk <= jerk_max * (1.0 + ROUNDING))
        })
    }

    /// The index of the reference axis.
    pub(super) fn reference(&self) -> usize {
        self.reference
    }
}
