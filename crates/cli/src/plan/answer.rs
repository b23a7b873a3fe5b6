//! An answer, as it is written to a line of JSON.

use serde::Serialize;
use takt_rt::plan::{Extrema, Limit, PlanError, Profile, Quantity};

/// The number of sample times, from the start to the end, where the problem has no grid of its own.
const SAMPLES: u32 = 16;
/// The most samples on the grid of a problem. A longer trajectory has [`SAMPLES`].
const SAMPLES_AT_MOST: f64 = 1e6;

/// The sample times of a trajectory: on the grid of the problem if it has one.
pub fn sample_times(duration_s: f64, grid_s: Option<f64>) -> Vec<f64> {
    match grid_s.map(|grid_s| (grid_s, (duration_s / grid_s).round())) {
        Some((grid_s, steps)) if steps < SAMPLES_AT_MOST => {
            (0..=steps as u32).map(|k| f64::from(k) * grid_s).collect()
        }
        _ => (0..SAMPLES).map(|k| duration_s * f64::from(k) / f64::from(SAMPLES - 1)).collect(),
    }
}

/// The answer to one problem.
#[derive(Serialize, Debug)]
pub struct Answer {
    id: serde_json::Value,
    /// `ok`, or the name of the error.
    result: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    message: Option<String>,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    trajectory: Option<Trajectory>,
}

/// Times in s; one number an axis, or a list of these for each sample time.
#[derive(Serialize, Debug)]
struct Trajectory {
    duration: f64,
    t_min: Vec<f64>,
    t: Vec<f64>,
    p: Vec<Vec<f64>>,
    v: Vec<Vec<f64>>,
    a: Vec<Vec<f64>>,
    pmin: Vec<f64>,
    pmax: Vec<f64>,
}

impl Answer {
    /// A trajectory was found.
    pub fn planned(id: serde_json::Value, duration_s: f64, times: Vec<f64>, profiles: &[Profile]) -> Self {
        let states: Vec<Vec<_>> = times
            .iter()
            .map(|time_s| profiles.iter().map(|profile| profile.sample(*time_s)).collect())
            .collect();
        let extrema: Vec<Extrema> = profiles.iter().map(Profile::extrema).collect();
        let trajectory = Trajectory {
            duration: duration_s,
            t_min: profiles.iter().map(Profile::minimum_duration_s).collect(),
            p: states.iter().map(|states| states.iter().map(|state| state.position).collect()).collect(),
            v: states.iter().map(|states| states.iter().map(|state| state.velocity).collect()).collect(),
            a: states.iter().map(|states| states.iter().map(|state| state.acceleration).collect()).collect(),
            t: times,
            pmin: extrema.iter().map(|extrema| extrema.position.min).collect(),
            pmax: extrema.iter().map(|extrema| extrema.position.max).collect(),
        };
        Self { id, result: "ok".into(), message: None, trajectory: Some(trajectory) }
    }

    /// The problem has no solution.
    pub fn refused(id: serde_json::Value, error: PlanError) -> Self {
        let (name, message) = words(error);
        Self { id, result: name.into(), message: Some(message), trajectory: None }
    }

    /// The line is not a problem.
    pub fn malformed(line: usize, message: String) -> Self {
        let message = Some(format!("line {line}: {message}"));
        Self { id: serde_json::Value::Null, result: "malformed".into(), message, trajectory: None }
    }
}

/// The name of the error, and what it says.
fn words(error: PlanError) -> (&'static str, String) {
    match error {
        PlanError::NotFinite { axis, quantity } => {
            ("not_finite", format!("axis {axis}: `{}` is not a finite number", state_key(quantity)))
        }
        PlanError::InvalidLimit { axis, limit } => {
            ("invalid_limit", format!("axis {axis}: {}", requirement(limit)))
        }
        PlanError::TargetBeyondLimit { axis, limit } => {
            let key = limit_key(limit);
            ("target_beyond_limit", format!("axis {axis}: the target cannot be reached within `{key}`"))
        }
        PlanError::PositionBeyondLimit { axis, limit } => {
            let key = limit_key(limit);
            ("position_beyond_limit", format!("axis {axis}: no trajectory to the target keeps `{key}`"))
        }
        PlanError::NotStraight { axis } => {
            ("not_straight", format!("axis {axis} is not in proportion to the others"))
        }
        PlanError::NotRepresentable { axis } => {
            ("not_representable", format!("axis {axis}: the numbers are too large or too small"))
        }
        PlanError::LengthMismatch { expected, received } => {
            ("length_mismatch", format!("{received} axes in place of {expected}"))
        }
        PlanError::InvalidTiming => {
            let message = "`min_duration` is negative, or `dt` is not above 0, or one of them is too large or too small";
            ("invalid_timing", message.into())
        }
    }
}

/// The key of a problem in which a limit stands.
const fn limit_key(limit: Limit) -> &'static str {
    match limit {
        Limit::PositionMax => "pmax",
        Limit::PositionMin => "pmin",
        Limit::VelocityMax => "vmax",
        Limit::VelocityMin => "vmin",
        Limit::AccelerationMax => "amax",
        Limit::AccelerationMin => "amin",
        Limit::JerkMax => "jmax",
    }
}

/// The condition that a limit has to meet.
const fn requirement(limit: Limit) -> &'static str {
    match limit {
        Limit::PositionMax | Limit::PositionMin => "`pmin` must be below `pmax`",
        Limit::VelocityMax => "`vmax` must be above 0",
        Limit::VelocityMin => "`vmin` must be below 0",
        Limit::AccelerationMax => "`amax` must be above 0",
        Limit::AccelerationMin => "`amin` must be below 0",
        Limit::JerkMax => "`jmax` must be above 0, or null for no limit",
    }
}

/// The key of a problem in which a part of the start or the target stands.
const fn state_key(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::StartPosition => "p0",
        Quantity::StartVelocity => "v0",
        Quantity::StartAcceleration => "a0",
        Quantity::TargetPosition => "pf",
        Quantity::TargetVelocity => "vf",
        Quantity::TargetAcceleration => "af",
    }
}
