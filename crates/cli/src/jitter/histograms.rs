//! The measurements as SVG: two histograms with logarithmic axes, one curve for each kind of pacing.

use takt::telemetry::Latency;
use takt::telemetry::render::duration;
use takt_tools::jitter::{Measurement, Pacing};

use crate::svg::Svg;

const WIDTH: f64 = 1_000.0;
const HEIGHT: f64 = 470.0;
const PANEL_WIDTH: f64 = 400.0;
const PANEL_HEIGHT: f64 = 290.0;
const PANEL_TOP: f64 = 95.0;
const PANELS_LEFT: [f64; 2] = [65.0, 555.0];

/// The time axis: from 10 ns on, so many decades, each in so many ranges.
const SHORTEST_NS: f64 = 10.0;
const DECADES: usize = 7;
const RANGES_PER_DECADE: usize = 12;
const RANGES: usize = DECADES * RANGES_PER_DECADE;
const DECADE_LABELS: [&str; DECADES + 1] =
    ["10 ns", "100 ns", "1 µs", "10 µs", "100 µs", "1 ms", "10 ms", "100 ms"];

const GRID: &str = "#e4e4e4";
const FRAME: &str = "#444";
/// Attributes of words.
const GREY: &str = "fill=\"#444\"";
const BOLD: &str = "font-weight=\"bold\"";

/// Renders the measurements as SVG under `title`.
pub fn draw(title: &str, measurements: &[Measurement]) -> String {
    let mut svg = Svg::new((WIDTH, HEIGHT), "black", Some("white"));
    svg.text((PANELS_LEFT[0], 32.0), "start", "font-size=\"17\" font-weight=\"bold\"", title);
    let wake: Vec<_> = measurements.iter().map(|pass| (pass.pacing, &pass.statistics.wake)).collect();
    let sync: Vec<_> = measurements.iter().map(|pass| (pass.pacing, &pass.statistics.sync)).collect();
    panel(&mut svg, PANELS_LEFT[0], "wake-up latency", &wake);
    panel(&mut svg, PANELS_LEFT[1], "SYNC release error", &sync);
    let mut left = PANELS_LEFT[0];
    for pass in measurements {
        legend(&mut svg, left, pass);
        left += PANELS_LEFT[1] - PANELS_LEFT[0];
    }
    svg.into_text()
}

const fn colour(pacing: Pacing) -> &'static str {
    match pacing {
        Pacing::Sleep => "#d9822b",
        Pacing::SleepThenSpin => "#1f6fb2",
    }
}

fn counts(latency: &Latency) -> Vec<u64> {
    let bound = |range: usize| {
        let decades = range as f64 / RANGES_PER_DECADE as f64;
        (SHORTEST_NS * 10_f64.powf(decades)).round() as u64
    };
    latency.counts(&(0..=RANGES).map(bound).collect::<Vec<_>>())
}

/// One histogram with its axes, and one curve for each kind of pacing.
fn panel(svg: &mut Svg, left: f64, title: &str, latencies: &[(Pacing, &Latency)]) {
    let bottom = PANEL_TOP + PANEL_HEIGHT;
    let curves: Vec<_> = latencies.iter().map(|(pacing, latency)| (*pacing, counts(latency))).collect();
    let most = curves.iter().flat_map(|(_, counts)| counts).copied().max().unwrap_or(0);
    // Whole decades of cycles; a decade below one cycle, so that a single one still has a height.
    let decades = (most.max(1) as f64).log10().ceil().max(1.0) + 1.0;
    let y = |count: f64| bottom - PANEL_HEIGHT * (count.log10() + 1.0).max(0.0) / decades;

    let rule = |svg: &mut Svg, from, to, colour: &str| {
        svg.line(from, to, format_args!("stroke=\"{colour}\""));
    };
    svg.text((left, PANEL_TOP - 14.0), "start", BOLD, title);
    for (decade, label) in DECADE_LABELS.iter().enumerate() {
        let x = left + PANEL_WIDTH * decade as f64 / DECADES as f64;
        rule(svg, (x, PANEL_TOP), (x, bottom), GRID);
        svg.text((x, bottom + 17.0), "middle", GREY, label);
    }
    for exponent in 0..decades as i32 {
        let count = 10_f64.powi(exponent);
        rule(svg, (left, y(count)), (left + PANEL_WIDTH, y(count)), GRID);
        svg.text((left - 7.0, y(count) + 4.0), "end", GREY, count);
    }
    for (pacing, counts) in &curves {
        let x = |range: usize| left + PANEL_WIDTH * range as f64 / RANGES as f64;
        let steps = counts.iter().enumerate().flat_map(|(range, count)| {
            let top = if *count == 0 { bottom } else { y(*count as f64) };
            [(x(range), top), (x(range + 1), top)]
        });
        let points = [(left, bottom)].into_iter().chain(steps).chain([(left + PANEL_WIDTH, bottom)]);
        let colour = colour(*pacing);
        svg.area(
            points,
            format_args!("fill=\"{colour}\" fill-opacity=\"0.3\" stroke=\"{colour}\" stroke-width=\"1.3\""),
        );
    }
    rule(svg, (left, bottom), (left + PANEL_WIDTH, bottom), FRAME);
    rule(svg, (left, PANEL_TOP), (left, bottom), FRAME);
    svg.text((left - 7.0, PANEL_TOP - 14.0), "end", GREY, "cycles");
}

/// The legend below the histograms: a kind of pacing with its figures.
fn legend(svg: &mut Svg, left: f64, pass: &Measurement) {
    let top = PANEL_TOP + PANEL_HEIGHT + 36.0;
    let colour = colour(pass.pacing);
    let filled = format_args!("fill=\"{colour}\" fill-opacity=\"0.3\" stroke=\"{colour}\"");
    svg.rect((left, top), (14.0, 14.0), filled);
    let name = match pass.pacing {
        Pacing::Sleep => "sleep only".to_owned(),
        Pacing::SleepThenSpin => {
            format!("sleep, then spin for the last {}", duration(pass.spin_guard_ns))
        }
    };
    svg.text((left + 22.0, top + 12.0), "start", BOLD, name);
    let sync = &pass.statistics.sync;
    let [median, p999, max] = [sync.quantile_ns(0.5), sync.quantile_ns(0.999), sync.max_ns()].map(duration);
    let missed = pass.statistics.missed_slots;
    let figures = format_args!("SYNC: median {median}, 99.9 % {p999}, max {max}; {missed} missed slots");
    svg.text((left + 22.0, top + 30.0), "start", GREY, figures);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cycle_lies_under_the_curve_wherever_it_is_on_the_axis() {
        let mut latency = Latency::default();
        [1, 15, 150, 1_500_000, 900_000_000].into_iter().for_each(|ns| latency.add(ns));
        let counts = counts(&latency);
        assert_eq!((counts.len(), counts.iter().sum()), (RANGES, 5));
        assert_eq!((counts[0], counts[RANGES - 1]), (1, 1));
    }

    #[test]
    fn a_title_with_signs_of_the_markup_stays_a_title() {
        let svg = draw("<can0> & \"co\"", &[]);
        assert!(svg.contains(">&lt;can0&gt; &amp; &quot;co&quot;</text>"), "{svg}");
        assert!(svg.ends_with("</svg>\n"));
    }
}
