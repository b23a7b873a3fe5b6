//! The measurements as SVG: two histograms with logarithmic axes, one curve for each kind of pacing.

use std::fmt::Write;

use super::measurement::{Measurement, Pacing};
use takt::telemetry::Latency;
use takt::telemetry::render::duration;

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

/// Renders the measurements as SVG under `title`.
pub fn svg(title: &str, measurements: &[Measurement]) -> String {
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
         font-family=\"Helvetica, Arial, sans-serif\" font-size=\"12\">\n\
         <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"white\"/>\n"
    );
    text(&mut svg, (PANELS_LEFT[0], 32.0), "start", "font-size=\"17\" font-weight=\"bold\"", title);
    let wake: Vec<_> = measurements.iter().map(|pass| (pass.pacing, &pass.statistics.wake)).collect();
    let sync: Vec<_> = measurements.iter().map(|pass| (pass.pacing, &pass.statistics.sync)).collect();
    panel(&mut svg, PANELS_LEFT[0], "wake-up latency", &wake);
    panel(&mut svg, PANELS_LEFT[1], "SYNC release error", &sync);
    let mut left = PANELS_LEFT[0];
    for pass in measurements {
        legend(&mut svg, left, pass);
        left += PANELS_LEFT[1] - PANELS_LEFT[0];
    }
    svg.push_str("</svg>\n");
    svg
}

const fn colour(pacing: Pacing) -> &'static str {
    match pacing {
        Pacing::Sleep => "#d9822b",
        Pacing::SleepThenSpin => "#1f6fb2",
    }
}

fn text(svg: &mut String, (x, y): (f64, f64), anchor: &str, style: &str, words: &str) {
    let words = words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let _ = writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" {style}>{words}</text>");
}

fn rule(svg: &mut String, (x1, y1): (f64, f64), (x2, y2): (f64, f64), colour: &str) {
    let _ = writeln!(
        svg,
        "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{colour}\"/>"
    );
}

fn counts(latency: &Latency) -> Vec<u64> {
    let bound = |range: usize| {
        let decades = range as f64 / RANGES_PER_DECADE as f64;
        (SHORTEST_NS * 10_f64.powf(decades)).round() as u64
    };
    latency.counts(&(0..=RANGES).map(bound).collect::<Vec<_>>())
}

/// One histogram with its axes, and one curve for each kind of pacing.
fn panel(svg: &mut String, left: f64, title: &str, latencies: &[(Pacing, &Latency)]) {
    let bottom = PANEL_TOP + PANEL_HEIGHT;
    let curves: Vec<_> = latencies.iter().map(|(pacing, latency)| (*pacing, counts(latency))).collect();
    let most = curves.iter().flat_map(|(_, counts)| counts).copied().max().unwrap_or(0);
    // Whole decades of cycles; a decade below one cycle, so that a single one still has a height.
    let decades = (most.max(1) as f64).log10().ceil().max(1.0) + 1.0;
    let y = |count: f64| bottom - PANEL_HEIGHT * (count.log10() + 1.0).max(0.0) / decades;

    text(svg, (left, PANEL_TOP - 14.0), "start", "font-weight=\"bold\"", title);
    for (decade, label) in DECADE_LABELS.iter().enumerate() {
        let x = left + PANEL_WIDTH * decade as f64 / DECADES as f64;
        rule(svg, (x, PANEL_TOP), (x, bottom), "#e4e4e4");
        text(svg, (x, bottom + 17.0), "middle", "fill=\"#444\"", label);
    }
    for exponent in 0..decades as i32 {
        let count = 10_f64.powi(exponent);
        rule(svg, (left, y(count)), (left + PANEL_WIDTH, y(count)), "#e4e4e4");
        text(svg, (left - 7.0, y(count) + 4.0), "end", "fill=\"#444\"", &format!("{count}"));
    }
    for (pacing, counts) in &curves {
        let mut path = format!("M{left:.1} {bottom:.1}");
        for (range, count) in counts.iter().enumerate() {
            let x = |range: usize| left + PANEL_WIDTH * range as f64 / RANGES as f64;
            let top = if *count == 0 { bottom } else { y(*count as f64) };
            let _ = write!(path, "V{top:.1}H{:.1}", x(range + 1));
        }
        let _ = writeln!(
            svg,
            "<path d=\"{path}V{bottom:.1}Z\" fill=\"{0}\" fill-opacity=\"0.3\" stroke=\"{0}\" stroke-width=\"1.3\"/>",
            colour(*pacing)
        );
    }
    rule(svg, (left, bottom), (left + PANEL_WIDTH, bottom), "#444");
    rule(svg, (left, PANEL_TOP), (left, bottom), "#444");
    text(svg, (left - 7.0, PANEL_TOP - 14.0), "end", "fill=\"#444\"", "cycles");
}

/// The legend below the histograms: a kind of pacing with its figures.
fn legend(svg: &mut String, left: f64, pass: &Measurement) {
    let top = PANEL_TOP + PANEL_HEIGHT + 36.0;
    let colour = colour(pass.pacing);
    let _ = writeln!(
        svg,
        "<rect x=\"{left}\" y=\"{top:.1}\" width=\"14\" height=\"14\" fill=\"{colour}\" fill-opacity=\"0.3\" stroke=\"{colour}\"/>"
    );
    let name = match pass.pacing {
        Pacing::Sleep => "sleep only".to_owned(),
        Pacing::SleepThenSpin => {
            format!("sleep, then spin for the last {}", duration(pass.spin_guard_ns))
        }
    };
    text(svg, (left + 22.0, top + 12.0), "start", "font-weight=\"bold\"", &name);
    let sync = &pass.statistics.sync;
    let [median, p999, max] = [sync.quantile_ns(0.5), sync.quantile_ns(0.999), sync.max_ns()].map(duration);
    let figures = format!(
        "SYNC: median {median}, 99.9 % {p999}, max {max}; {} missed slots",
        pass.statistics.missed_slots
    );
    text(svg, (left + 22.0, top + 30.0), "start", "fill=\"#444\"", &figures);
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
        let svg = svg("<can0> & \"co\"", &[]);
        assert!(svg.contains(">&lt;can0&gt; &amp; \"co\"</text>"), "{svg}");
        assert!(svg.ends_with("</svg>\n"));
    }
}
