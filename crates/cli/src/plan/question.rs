//! A problem, as it is read from a line of JSON.

use serde::Deserialize;
use serde::de::IgnoredAny;
use takt_rt::plan::{
    Limit, Limits, PlanError, PlanOptions, Problem, Profile, State, Synchronisation, synchronised,
    synchronised_velocity,
};

use super::answer::{Answer, sample_times};

/// The problem, one number an axis in every list. What is left out is zero, or unlimited for a position or a jerk.
///
/// Files of problems with known answers have `family` and the answer in the same line: these keys are allowed and
/// ignored.
#[derive(Deserialize, Debug)]
#[serde(
    deny_unknown_fields,
    expecting = "a problem: {\"p0\": [0], \"pf\": [1], \"vmax\": [2], \"amax\": [8]}"
)]
pub struct Question {
    #[serde(default)]
    id: serde_json::Value,
    #[serde(default)]
    interface: Interface,
    #[serde(default)]
    sync: Sync,
    /// The duration is a multiple of this, and the answer has a sample at each.
    dt: Option<f64>,
    min_duration: Option<f64>,
    p0: Vec<f64>,
    #[serde(default)]
    v0: Vec<f64>,
    #[serde(default)]
    a0: Vec<f64>,
    #[serde(default)]
    pf: Vec<f64>,
    #[serde(default)]
    vf: Vec<f64>,
    #[serde(default)]
    af: Vec<f64>,
    vmax: Vec<f64>,
    /// Minus `vmax` when left out.
    vmin: Option<Vec<f64>>,
    amax: Vec<f64>,
    /// Minus `amax` when left out.
    amin: Option<Vec<f64>>,
    #[serde(default)]
    jmax: Vec<Option<f64>>,
    #[serde(default)]
    pmin: Vec<Option<f64>>,
    #[serde(default)]
    pmax: Vec<Option<f64>>,
    /// The times at which the trajectory is sampled (s).
    t: Option<Vec<f64>>,
    /// The expected number of axes, if it is to be checked.
    dofs: Option<usize>,
    #[serde(default, rename = "family")]
    _family: IgnoredAny,
    #[serde(default, rename = "result")]
    _result: IgnoredAny,
    #[serde(default, rename = "duration")]
    _duration: IgnoredAny,
    #[serde(default, rename = "t_min")]
    _minimum_durations: IgnoredAny,
    #[serde(default, rename = "p")]
    _positions: IgnoredAny,
    #[serde(default, rename = "v")]
    _velocities: IgnoredAny,
    #[serde(default, rename = "a")]
    _accelerations: IgnoredAny,
}

#[derive(Deserialize, Clone, Copy, Debug, Default)]
#[serde(rename_all = "lowercase")]
enum Interface {
    #[default]
    Position,
    Velocity,
}

#[derive(Deserialize, Clone, Copy, Debug, Default)]
#[serde(rename_all = "lowercase")]
enum Sync {
    #[default]
    Time,
    Phase,
    Straight,
    None,
}

/// Checks that no axis leaves its velocity limits before its target velocity, unless its start does so by itself.
fn keeps_velocity(problems: &[Problem], profiles: &[Profile]) -> Result<(), PlanError> {
    for (axis, (Problem { start, limits, .. }, profile)) in problems.iter().zip(profiles).enumerate() {
        let reached = profile.extrema().velocity;
        // The velocity when the jerk has ended the acceleration of the start, at the earliest.
        let unavoidable =
            start.velocity + 0.5 * start.acceleration * start.acceleration.abs() / limits.jerk_max;
        let (highest, lowest) = (start.velocity.max(unavoidable), start.velocity.min(unavoidable));
        let beyond = if reached.max > limits.velocity_max.max(highest) * (1.0 + ROUNDING) {
            Limit::VelocityMax
        } else if reached.min < limits.velocity_min.min(lowest) * (1.0 + ROUNDING) {
            Limit::VelocityMin
        } else {
            continue;
        };
        return Err(PlanError::TargetBeyondLimit { axis, limit: beyond });
    }
    Ok(())
}

/// Exceeding a limit by this much, relative to it, is rounding.
const ROUNDING: f64 = 1e-9;

impl Question {
    /// Reads a line and checks that the lists belong together.
    pub fn parse(line: &str) -> Result<Self, String> {
        if line.trim_start().starts_with('[') {
            return Err("a problem is no list, but an object: {\"p0\": [0], …}".to_owned());
        }
        let question: Self = serde_json::from_str(line).map_err(|error| {
            // Of the place that the reader names, only the column means something: every line is read on its own.
            let (words, column) = (error.to_string(), error.column());
            let words =
                words.strip_suffix(&format!(" at line {} column {column}", error.line())).unwrap_or(&words);
            format!("{words} (column {column})")
        })?;
        question.check_lengths()?;
        Ok(question)
    }

    fn check_lengths(&self) -> Result<(), String> {
        let axes = self.p0.len();
        if axes == 0 {
            return Err("`p0` is empty: a problem has at least one axis".to_owned());
        }
        let required = [("vmax", self.vmax.len()), ("amax", self.amax.len())];
        let optional = [
            ("v0", self.v0.len()),
            ("a0", self.a0.len()),
            ("pf", self.pf.len()),
            ("vf", self.vf.len()),
            ("af", self.af.len()),
            ("vmin", self.vmin.as_ref().map_or(0, Vec::len)),
            ("amin", self.amin.as_ref().map_or(0, Vec::len)),
            ("jmax", self.jmax.len()),
            ("pmin", self.pmin.len()),
            ("pmax", self.pmax.len()),
        ];
        if let Some(dofs) = self.dofs.filter(|dofs| *dofs != axes) {
            return Err(format!("`dofs` is {dofs}, `p0` has {axes} numbers"));
        }
        let wrong = required
            .iter()
            .find(|(_, length)| *length != axes)
            .or_else(|| optional.iter().find(|(_, length)| *length != 0 && *length != axes));
        match wrong {
            Some((name, length)) => Err(format!("`{name}` has {length} numbers, `p0` has {axes}")),
            None => Ok(()),
        }
    }

    /// The problems of the axes.
    pub fn problems(&self) -> Vec<Problem> {
        let or_zero = |list: &[f64], axis: usize| list.get(axis).copied().unwrap_or(0.0);
        let negative = |list: &Option<Vec<f64>>, max: f64, axis: usize| {
            list.as_ref().and_then(|list| list.get(axis).copied()).unwrap_or(-max)
        };
        let or = |list: &[Option<f64>], axis: usize, otherwise: f64| {
            list.get(axis).copied().flatten().unwrap_or(otherwise)
        };
        let state = |axis: usize, [position, velocity, acceleration]: [&[f64]; 3]| State {
            position: or_zero(position, axis),
            velocity: or_zero(velocity, axis),
            acceleration: or_zero(acceleration, axis),
        };
        let limits = self.vmax.iter().zip(&self.amax).enumerate().map(|(axis, (vmax, amax))| {
            Limits::asymmetric(
                *vmax,
                negative(&self.vmin, *vmax, axis),
                *amax,
                negative(&self.amin, *amax, axis),
                or(&self.jmax, axis, f64::INFINITY),
            )
            .with_position(or(&self.pmin, axis, f64::NEG_INFINITY), or(&self.pmax, axis, f64::INFINITY))
        });
        limits
            .enumerate()
            .map(|(axis, limits)| Problem {
                start: state(axis, [&self.p0, &self.v0, &self.a0]),
                target: state(axis, [&self.pf, &self.vf, &self.af]),
                limits,
            })
            .collect()
    }

    /// The answer, and the trajectory if there is one.
    pub fn solve(&self) -> (Answer, Option<Vec<Profile>>) {
        let problems = self.problems();
        let mut profiles = vec![Profile::hold(0.0); problems.len()];
        let timing = PlanOptions {
            synchronisation: match self.sync {
                Sync::Time => Synchronisation::Time,
                Sync::Phase => Synchronisation::Phase,
                Sync::Straight => Synchronisation::Straight,
                Sync::None => Synchronisation::Independent,
            },
            minimum_duration_s: self.min_duration.unwrap_or(0.0),
            cycle_s: self.dt,
            ..PlanOptions::default()
        };
        let planned = match self.interface {
            Interface::Position => synchronised(&problems, &mut profiles, timing),
            Interface::Velocity => synchronised_velocity(&problems, &mut profiles, timing),
        };
        let checked = planned.and_then(|duration_s| match self.interface {
            Interface::Velocity => keeps_velocity(&problems, &profiles).map(|()| duration_s),
            Interface::Position => Ok(duration_s),
        });
        match checked {
            Ok(duration_s) => {
                let times = self.t.clone().unwrap_or_else(|| sample_times(duration_s, self.dt));
                (Answer::planned(self.id.clone(), duration_s, times, &profiles), Some(profiles))
            }
            Err(error) => (Answer::refused(self.id.clone(), error), None),
        }
    }
}
