//! The distribution of a time as a drawing on a page: six bars in each decade, with logarithmic heights.

use takt::telemetry::LatencyReport;

use crate::svg::Svg;

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 220.0;
const LEFT: f64 = 64.0;
const RIGHT: f64 = WIDTH - 20.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = HEIGHT - 30.0;
/// As in [`LatencyReport::histogram`].
const RANGES_PER_DECADE: usize = 6;
/// The lower bounds of the decades.
const DECADES: [&str; 7] = ["100 ns", "1 µs", "10 µs", "100 µs", "1 ms", "10 ms", "100 ms"];

/// The bars of a time, or nothing if it was always 0.
pub fn draw(latency: &LatencyReport) -> Option<String> {
    let counts = &latency.histogram;
    let most = counts.iter().max().copied().filter(|_| latency.max > 0)?;
    let used = |index: &usize| counts.get(*index).is_some_and(|count| *count > 0);
    let first = (0..counts.len()).find(used)? / RANGES_PER_DECADE;
    let last = (0..counts.len()).rfind(used)? / RANGES_PER_DECADE;
    let ranges = (last - first + 1) * RANGES_PER_DECADE;
    let powers = (most as f64).log10().ceil().max(1.0);
    let x = |range: f64| LEFT + (RIGHT - LEFT) * range / ranges as f64;
    // A single cycle is visible, too: it is half a decade above nothing.
    let y = |count: f64| BOTTOM - (BOTTOM - TOP) * (count.log10() + 0.5) / (powers + 0.5);
    let mut svg = Svg::new((WIDTH, HEIGHT), "var(--words)", None);
    for power in 0..=powers as i32 {
        let y = y(10_f64.powi(power));
        let label = if power < 4 { 10_u64.pow(power as u32).to_string() } else { format!("1e{power}") };
        svg.line((LEFT, y), (RIGHT, y), format_args!("stroke=\"var(--grid)\""));
        svg.text((LEFT - 6.0, y + 4.0), "end", "", label);
    }
    let shown = counts.iter().skip(first * RANGES_PER_DECADE).take(ranges);
    for (range, count) in shown.enumerate().filter(|(_, count)| **count > 0) {
        let (left, right, top) = (x(range as f64) + 1.0, x(range as f64 + 1.0) - 1.0, y(*count as f64));
        svg.element(format_args!("<g><title>{count}</title>"));
        svg.rect((left, top), (right - left, BOTTOM - top), format_args!("fill=\"var(--c0)\""));
        svg.element(format_args!("</g>"));
    }
    for end in [(LEFT, TOP), (RIGHT, BOTTOM)] {
        svg.line((LEFT, BOTTOM), end, format_args!("stroke=\"var(--frame)\""));
    }
    for (number, decade) in DECADES.iter().enumerate().skip(first).take(last - first + 2) {
        let (x, anchor) = match number - first {
            count if count > last - first => (RIGHT, "end"),
            count => (x((count * RANGES_PER_DECADE) as f64), "middle"),
        };
        svg.text((x, BOTTOM + 18.0), anchor, "", decade);
    }
    Some(svg.into_text())
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt::telemetry::Latency;

    #[test]
    fn there_is_a_bar_for_every_range_with_a_cycle_and_none_for_times_that_were_always_zero() {
        let mut latency = Latency::default();
        (0..1000).for_each(|_| latency.add(2_000));
        latency.add(70_000);
        let svg = draw(&LatencyReport::new(&latency)).unwrap();
        assert_eq!(svg.matches("<rect").count(), 2, "{svg}");
        assert!(svg.contains("<title>1000</title>") && svg.contains("<title>1</title>"), "{svg}");
        assert!(svg.contains("1 µs") && svg.contains("100 µs") && !svg.contains("1 ms"), "{svg}");
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        let mut zero = Latency::default();
        zero.add(0);
        assert_eq!(draw(&LatencyReport::new(&zero)), None);
        assert_eq!(draw(&LatencyReport::new(&Latency::default())), None);
    }
}
