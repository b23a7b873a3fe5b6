//! A trajectory as a picture: four panels, one colour an axis, limits dashed.

use std::fmt::Write as _;
use takt_rt::plan::{Limits, Problem, Profile};

const WIDTH: f64 = 900.0;
const PANEL: f64 = 180.0;
const LEFT: f64 = 80.0;
const GAP: f64 = 34.0;
const MARGIN: f64 = 8.0;
const STEPS: u32 = 800;
const COLOURS: [&str; 8] =
    ["#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2"];

/// One derivative of the position.
struct Panel {
    name: &'static str,
    value: fn(&Profile, f64) -> f64,
    limits: fn(&Limits) -> [f64; 2],
}

const PANELS: [Panel; 4] = [
    Panel {
        name: "position",
        value: |profile, time_s| profile.sample(time_s).position,
        limits: |limits| [limits.position_min, limits.position_max],
    },
    Panel {
        name: "velocity",
        value: |profile, time_s| profile.sample(time_s).velocity,
        limits: |limits| [limits.velocity_min, limits.velocity_max],
    },
    Panel {
        name: "acceleration",
        value: |profile, time_s| profile.sample(time_s).acceleration,
        limits: |limits| [limits.acceleration_min, limits.acceleration_max],
    },
    Panel { name: "jerk", value: jerk, limits: |limits| [-limits.jerk_max, limits.jerk_max] },
];

fn jerk(profile: &Profile, time_s: f64) -> f64 {
    let inside = |start_s: f64, duration_s: f64| time_s >= start_s && time_s < start_s + duration_s;
    profile.phases().find(|phase| inside(phase.start_s, phase.duration_s)).map_or(0.0, |phase| phase.jerk)
}

/// The picture as SVG.
pub fn draw(problems: &[Problem], profiles: &[Profile]) -> String {
    let duration_s = profiles.iter().map(Profile::duration_s).fold(0.0, f64::max);
    let height = PANELS.len() as f64 * (PANEL + GAP) + GAP;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"{WIDTH}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    for axis in 0..problems.len() {
        let x = WIDTH - 20.0 - 60.0 * (problems.len() - axis) as f64;
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            "<text x=\"{x}\" y=\"16\" fill=\"{}\">axis {axis}</text>",
            COLOURS[axis % COLOURS.len()]
        );
    }
    for (index, panel) in PANELS.iter().enumerate() {
        let top = GAP + index as f64 * (PANEL + GAP);
        draw_panel(&mut svg, panel, top, duration_s, problems, profiles);
    }
    svg.push_str("</svg>\n");
    svg
}

/// Four significant digits, without trailing zeros.
fn number(value: f64) -> String {
    let digits = if value == 0.0 { 0.0 } else { 3.0 - value.abs().log10().floor() };
    let factor = 10_f64.powf(digits.clamp(-300.0, 300.0));
    format!("{}", (value * factor).round() / factor)
}

fn draw_panel(
    svg: &mut String,
    panel: &Panel,
    top: f64,
    duration_s: f64,
    problems: &[Problem],
    profiles: &[Profile],
) {
    let right = WIDTH - 20.0;
    let times = || (0..=STEPS).map(|step| duration_s * f64::from(step) / f64::from(STEPS));
    let limits = || {
        problems.iter().flat_map(|problem| (panel.limits)(&problem.limits)).filter(|limit| limit.is_finite())
    };
    let values = profiles.iter().flat_map(|profile| times().map(|time_s| (panel.value)(profile, time_s)));
    let (low, high) = values
        .chain(limits())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    let span = if high > low { high - low } else { 1.0 };
    let x = |time_s: f64| LEFT + (right - LEFT) * if duration_s > 0.0 { time_s / duration_s } else { 0.0 };
    // A line at a limit must not lie on the frame.
    let y = |value: f64| top + MARGIN + (PANEL - 2.0 * MARGIN) * (1.0 - (value - low) / span);
    let bottom = top + PANEL;
    // Writing to a string cannot fail.
    let _ = writeln!(
        svg,
        "<path d=\"M{LEFT} {top}V{bottom}H{right}\" fill=\"none\" stroke=\"#888\"/>\
         <text x=\"{LEFT}\" y=\"{}\">{}</text>\
         <text x=\"{}\" y=\"{:.2}\" text-anchor=\"end\">{}</text>\
         <text x=\"{}\" y=\"{:.2}\" text-anchor=\"end\">{}</text>\
         <text x=\"{LEFT}\" y=\"{}\">0 s</text>\
         <text x=\"{right}\" y=\"{}\" text-anchor=\"end\">{} s</text>",
        top - 6.0,
        panel.name,
        LEFT - 6.0,
        y(high) + 4.0,
        number(high),
        LEFT - 6.0,
        y(low) + 4.0,
        number(low),
        bottom + 14.0,
        bottom + 14.0,
        number(duration_s),
    );
    if low < 0.0 && high > 0.0 {
        let _ = writeln!(
            svg,
            "<path d=\"M{LEFT} {0:.2}H{right}\" stroke=\"#ddd\"/>\
             <text x=\"{1}\" y=\"{2:.2}\" text-anchor=\"end\">0</text>",
            y(0.0),
            LEFT - 6.0,
            y(0.0) + 4.0,
        );
    }
    for (axis, (problem, profile)) in problems.iter().zip(profiles).enumerate() {
        let colour = COLOURS[axis % COLOURS.len()];
        for limit in (panel.limits)(&problem.limits).into_iter().filter(|limit| limit.is_finite()) {
            let _ = writeln!(
                svg,
                "<path d=\"M{LEFT} {0:.2}H{right}\" stroke=\"{colour}\" stroke-dasharray=\"4 4\" opacity=\"0.5\"/>",
                y(limit)
            );
        }
        let points: String = times().fold(String::new(), |mut points, time_s| {
            let _ = write!(points, "{:.2},{:.2} ", x(time_s), y((panel.value)(profile, time_s)));
            points
        });
        let _ = writeln!(
            svg,
            "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"/>"
        );
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

    #[test]
    fn numbers_beside_the_panels_have_four_digits_at_most() {
        let numbers = [1.5, -10.0, 1.563_764, 12_345.6, 0.001_234_56, 0.0].map(number);
        assert_eq!(numbers, ["1.5", "-10", "1.564", "12350", "0.001235", "0"]);
    }
}
