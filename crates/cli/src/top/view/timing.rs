//! The histograms of the loop.

use ratatui::text::{Line, Span};

use super::palette::Palette;
use super::times::duration;
use crate::top::model::Model;
use takt::telemetry::{TIME_BOUNDS_NS, TimeCounts};

/// The columns of all lines: the name, the histogram, and three numbers.
pub const COLUMNS: u16 = (NAME + TIME_BOUNDS_NS.len() + 1 + 3 * NUMBER) as u16;
const EIGHTHS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
/// The columns before the histogram.
const NAME: usize = 9;
/// The columns of a number, with the space before it.
const NUMBER: usize = 9;

/// The lines: a heading with a scale, and a line for each time.
pub fn lines(model: &Model, palette: Palette) -> Vec<Line<'static>> {
    let (recent, all) = (model.recent_timing(), model.seen.timing);
    let heading = format!("{:<NAME$}{} {:>8} {:>8} {:>8}", "TIMING", scale(), "p50", "p99", "max");
    let line = |name: &str, recent: &TimeCounts, all: &TimeCounts| {
        let quantile =
            |part| recent.quantile_ns(part).map_or_else(|| "-".to_owned(), |ns| format!("≤{}", duration(ns)));
        let longest = if all.count() == 0 { "-".to_owned() } else { duration(all.max_ns) };
        let numbers = format!(" {:>8} {:>8} {:>8}", quantile(0.5), quantile(0.99), longest);
        Line::from(vec![
            Span::raw(format!("{name:<NAME$}")),
            Span::styled(histogram(recent), palette.good()),
            Span::raw(numbers),
        ])
    };
    vec![
        Line::styled(heading, palette.heading()),
        line("wake-up", &recent.wake, &all.wake),
        line("SYNC", &recent.sync, &all.sync),
        line("compute", &recent.compute, &all.compute),
    ]
}

/// One column a range. A range with a single time is seen: the height is that of its logarithm.
fn histogram(times: &TimeCounts) -> String {
    let height = |count: u64| ((count + 1) as f64).ln();
    let highest = height(times.counts.iter().copied().max().unwrap_or(0));
    let column = |count: &u64| match count {
        0 => '·',
        count => {
            let eighths = (height(*count) / highest * 8.0).ceil() as usize;
            EIGHTHS.get(eighths.clamp(1, 8)).copied().unwrap_or('█')
        }
    };
    times.counts.iter().map(column).collect()
}

/// Where 1 µs, 10 µs, 100 µs, 1 ms and 10 ms are among the ranges.
fn scale() -> String {
    let mut scale = vec![' '; TIME_BOUNDS_NS.len() + 1];
    for (ns, label) in
        [(1_000, "1µ"), (10_000, "10µ"), (100_000, "100µ"), (1_000_000, "1m"), (10_000_000, "10m")]
    {
        let end = TIME_BOUNDS_NS.iter().position(|bound| *bound == ns).unwrap_or(0);
        let begin = (end + 1).saturating_sub(label.chars().count());
        // Where there is no room for both, the first of two stands.
        if begin > 0 && scale.get(begin - 1).is_none_or(|before| *before != ' ') {
            continue;
        }
        scale.iter_mut().skip(begin).zip(label.chars()).for_each(|(place, letter)| *place = letter);
    }
    scale.into_iter().collect()
}
