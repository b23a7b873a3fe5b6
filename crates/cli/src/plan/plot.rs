//! A trajectory as SVG: four panels, one colour for each axis, limits as dashed lines.

use takt_rt::plan::{Limits, Problem, Profile};

use crate::chart::{COLOURS, Chart, Curve, Panel};

const STEPS: u32 = 800;

/// One derivative of the position.
struct Derivative {
    name: &'static str,
    value: fn(&Profile, f64) -> f64,
    limits: fn(&Limits) -> [f64; 2],
}

const DERIVATIVES: [Derivative; 4] = [
    Derivative {
        name: "position",
        value: |profile, time_s| profile.sample(time_s).position,
        limits: |limits| [limits.position_min, limits.position_max],
    },
    Derivative {
        name: "velocity",
        value: |profile, time_s| profile.sample(time_s).velocity,
        limits: |limits| [limits.velocity_min, limits.velocity_max],
    },
    Derivative {
        name: "acceleration",
        value: |profile, time_s| profile.sample(time_s).acceleration,
        limits: |limits| [limits.acceleration_min, limits.acceleration_max],
    },
    Derivative { name: "jerk", value: jerk, limits: |limits| [-limits.jerk_max, limits.jerk_max] },
];

fn jerk(profile: &Profile, time_s: f64) -> f64 {
    let inside = |start_s: f64, duration_s: f64| time_s >= start_s && time_s < start_s + duration_s;
    profile.phases().find(|phase| inside(phase.start_s, phase.duration_s)).map_or(0.0, |phase| phase.jerk)
}

/// The trajectory as SVG.
pub fn draw(problems: &[Problem], profiles: &[Profile]) -> String {
    let duration_s = profiles.iter().map(Profile::duration_s).fold(0.0, f64::max);
    let mut panels: Vec<Panel> =
        DERIVATIVES.iter().map(|derivative| panel(derivative, duration_s, problems, profiles)).collect();
    if let Some(first) = panels.first_mut() {
        first.legend = (0..problems.len()).map(|axis| (format!("axis {axis}"), colour(axis))).collect();
    }
    Chart { span_s: (0.0, duration_s), panels, ..Chart::default() }.draw()
}

fn colour(axis: usize) -> &'static str {
    COLOURS[axis % COLOURS.len()]
}

fn panel(derivative: &Derivative, duration_s: f64, problems: &[Problem], profiles: &[Profile]) -> Panel {
    let times = || (0..=STEPS).map(|step| duration_s * f64::from(step) / f64::from(STEPS));
    let curve = |(axis, profile): (usize, &Profile)| Curve {
        colour: colour(axis),
        points: times().map(|time_s| (time_s, (derivative.value)(profile, time_s))).collect(),
    };
    let limits = problems
        .iter()
        .enumerate()
        .flat_map(|(axis, problem)| (derivative.limits)(&problem.limits).map(|limit| (limit, colour(axis))));
    Panel {
        name: derivative.name.to_owned(),
        curves: profiles.iter().enumerate().map(curve).collect(),
        limits: limits.collect(),
        ..Panel::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::plan::{State, position};

    #[test]
    fn every_panel_has_a_line_for_every_axis_and_its_finite_limits() {
        let problem = Problem {
            start: State::rest(0.0),
            target: State::rest(1.0),
            limits: Limits::symmetric(1.0, 4.0, 50.0),
        };
        let profile = position(&problem).unwrap();
        let svg = draw(&[problem; 2], &[profile; 2]);
        assert_eq!(svg.matches("<polyline").count(), 8);
        // Velocity, acceleration and jerk have two limits each, the position has none.
        assert_eq!(svg.matches("stroke-dasharray").count(), 12);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert!(svg.contains(">axis 0<") && svg.contains(">axis 1<") && !svg.contains(">axis 2<"));
    }
}
