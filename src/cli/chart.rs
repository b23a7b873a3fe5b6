//! Curves over time as SVG: one panel below the other, limits as dashed lines, one instant marked.

use std::fmt::Write as _;

const WIDTH: f64 = 900.0;
const PANEL: f64 = 180.0;
const LEFT: f64 = 80.0;
const RIGHT: f64 = WIDTH - 20.0;
const GAP: f64 = 34.0;
const MARGIN: f64 = 8.0;
const LETTER: f64 = 7.0;
const LINE: f64 = 14.0;
/// The longest title, in characters.
const TITLE_LETTERS: usize = 118;

/// The colours of curves, for as many as can be told apart.
pub const COLOURS: [&str; 8] =
    ["#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2"];

/// Panels over one time axis.
#[derive(Debug, Default)]
pub struct Chart {
    /// The title above the panels; may be empty.
    pub title: String,
    /// The start and the end of the time axis, in seconds.
    pub span_s: (f64, f64),
    /// An instant that is marked in every panel.
    pub mark_s: Option<f64>,
    /// From top to bottom.
    pub panels: Vec<Panel>,
}

/// Curves over one scale.
#[derive(Debug, Default)]
pub struct Panel {
    /// The quantity with its unit.
    pub name: String,
    /// Names beside the heading, each with its colour.
    pub legend: Vec<(String, &'static str)>,
    /// The curves.
    pub curves: Vec<Curve>,
    /// Values that are drawn as dashed lines.
    pub limits: Vec<(f64, &'static str)>,
    /// Spans of time that are shaded, in seconds.
    pub shaded: Vec<(f64, f64)>,
}

/// A curve.
#[derive(Debug)]
pub struct Curve {
    /// Its colour.
    pub colour: &'static str,
    /// Times in seconds and values. Where a value is not finite, the curve has a gap.
    pub points: Vec<(f64, f64)>,
}

impl Chart {
    /// The chart as SVG.
    pub fn draw(&self) -> String {
        let top = if self.title.is_empty() { 0.0 } else { GAP };
        let height = top + self.panels.len() as f64 * (PANEL + GAP) + GAP;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" \
             font-size=\"12\">\n<rect width=\"{WIDTH}\" height=\"{height}\" fill=\"white\"/>\n"
        );
        if !self.title.is_empty() {
            // Writing to a string cannot fail.
            let mut title: String = self.title.chars().take(TITLE_LETTERS).collect();
            if title.len() < self.title.len() {
                title.push('…');
            }
            let _ = writeln!(svg, "<text x=\"20\" y=\"24\" font-size=\"14\">{}</text>", escaped(&title));
        }
        for (index, panel) in self.panels.iter().enumerate() {
            self.draw_panel(&mut svg, panel, top + GAP + index as f64 * (PANEL + GAP));
        }
        svg.push_str("</svg>\n");
        svg
    }

    fn x(&self, time_s: f64) -> f64 {
        let (from, to) = self.span_s;
        LEFT + (RIGHT - LEFT) * if to > from { (time_s - from) / (to - from) } else { 0.0 }
    }

    fn draw_panel(&self, svg: &mut String, panel: &Panel, top: f64) {
        let limits = panel.limits.iter().filter(|(limit, _)| limit.is_finite());
        let points = panel.curves.iter().flat_map(|curve| curve.points.iter().map(|(_, value)| *value));
        let values = points.chain(limits.clone().map(|(limit, _)| *limit)).filter(|value| value.is_finite());
        let (low, high) = values
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
        let span = if high > low { high - low } else { 1.0 };
        // A line at a limit must not lie on the frame.
        let y = |value: f64| top + MARGIN + (PANEL - 2.0 * MARGIN) * (1.0 - (value - low) / span);
        let bottom = top + PANEL;
        for (from, to) in &panel.shaded {
            // A single cycle is visible, too.
            let (x, width) = (self.x(*from), (self.x(*to) - self.x(*from)).max(1.0));
            let _ = writeln!(
                svg,
                "<rect x=\"{x:.2}\" y=\"{top}\" width=\"{width:.2}\" height=\"{PANEL}\" fill=\"#ddd\"/>"
            );
        }
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            "<path d=\"M{LEFT} {top}V{bottom}H{RIGHT}\" fill=\"none\" stroke=\"#888\"/>\
             <text x=\"{LEFT}\" y=\"{}\">{}</text>",
            top - 6.0,
            escaped(&panel.name),
        );
        let _ = writeln!(
            svg,
            "<text x=\"{0}\" y=\"{1:.2}\" text-anchor=\"end\">{2}</text>\
             <text x=\"{0}\" y=\"{3:.2}\" text-anchor=\"end\">{4}</text>\
             <text x=\"{LEFT}\" y=\"{5}\">{6} s</text>\
             <text x=\"{RIGHT}\" y=\"{5}\" text-anchor=\"end\">{7} s</text>",
            LEFT - 6.0,
            y(high) + 4.0,
            number(high),
            y(low) + 4.0,
            number(low),
            bottom + 14.0,
            number(self.span_s.0),
            number(self.span_s.1),
        );
        draw_legend(svg, &panel.legend, top - 6.0);
        if low < 0.0 && high > 0.0 {
            let _ = writeln!(svg, "<path d=\"M{LEFT} {:.2}H{RIGHT}\" stroke=\"#ddd\"/>", y(0.0));
            let is_apart = [low, high].iter().all(|end| (y(*end) - y(0.0)).abs() > LINE);
            if is_apart {
                let _ = writeln!(
                    svg,
                    "<text x=\"{}\" y=\"{:.2}\" text-anchor=\"end\">0</text>",
                    LEFT - 6.0,
                    y(0.0) + 4.0
                );
            }
        }
        if let Some(mark_s) = self.mark_s {
            let _ = writeln!(svg, "<path d=\"M{:.2} {top}V{bottom}\" stroke=\"#d62728\"/>", self.x(mark_s));
        }
        for (limit, colour) in limits {
            let _ = writeln!(
                svg,
                "<path d=\"M{LEFT} {0:.2}H{RIGHT}\" stroke=\"{colour}\" stroke-dasharray=\"4 4\" opacity=\"0.5\"/>",
                y(*limit)
            );
        }
        for Curve { colour, points } in &panel.curves {
            // Points without a value between them are one line.
            let lines = points.split(|(_, value)| !value.is_finite()).filter(|line| !line.is_empty());
            for line in lines {
                let points: String = line.iter().fold(String::new(), |mut points, (time_s, value)| {
                    let _ = write!(points, "{:.2},{:.2} ", self.x(*time_s), y(*value));
                    points
                });
                let _ = writeln!(
                    svg,
                    "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"/>"
                );
            }
        }
    }
}

/// The names from the right to the left, so that the heading keeps its place.
fn draw_legend(svg: &mut String, legend: &[(String, &str)], y: f64) {
    let mut x = RIGHT;
    for (name, colour) in legend.iter().rev() {
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            "<text x=\"{x:.2}\" y=\"{y}\" text-anchor=\"end\" fill=\"{colour}\">{}</text>",
            escaped(name)
        );
        x -= LETTER * (name.chars().count() + 2) as f64;
    }
}

fn escaped(words: &str) -> String {
    words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Four significant digits, without trailing zeros.
fn number(value: f64) -> String {
    let digits = if value == 0.0 { 0.0 } else { 3.0 - value.abs().log10().floor() };
    let factor = 10_f64.powf(digits.clamp(-300.0, 300.0));
    format!("{}", (value * factor).round() / factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_beside_the_panels_have_four_digits_at_most() {
        let numbers = [1.5, -10.0, 1.563_764, 12_345.6, 0.001_234_56, 0.0].map(number);
        assert_eq!(numbers, ["1.5", "-10", "1.564", "12350", "0.001235", "0"]);
    }

    #[test]
    fn values_that_are_not_finite_and_panels_without_any_are_drawn_without_harm() {
        let curve =
            Curve { colour: COLOURS[0], points: vec![(0.0, 1.0), (0.5, f64::NAN), (1.0, f64::INFINITY)] };
        let panel = Panel { name: "a < b".to_owned(), curves: vec![curve], ..Panel::default() };
        let chart = Chart { span_s: (0.0, 1.0), panels: vec![panel, Panel::default()], ..Chart::default() };
        let svg = chart.draw();
        assert!(!svg.contains("NaN") && !svg.contains("inf") && svg.contains("a &lt; b"), "{svg}");
    }

    #[test]
    fn a_curve_has_a_gap_where_a_value_is_missing_and_a_span_of_time_can_be_shaded() {
        let values = [1.0, 2.0, f64::NAN, f64::NAN, 5.0, 6.0];
        let points = (0..6).map(|at| (f64::from(at), values[at as usize])).collect();
        let curves = vec![Curve { colour: COLOURS[0], points }];
        let panel = Panel { curves, shaded: vec![(2.0, 3.0)], ..Panel::default() };
        let svg = Chart { span_s: (0.0, 5.0), panels: vec![panel], ..Chart::default() }.draw();
        let lines: Vec<&str> = svg.lines().filter(|line| line.starts_with("<polyline")).collect();
        assert_eq!(lines.len(), 2, "{svg}");
        assert!(lines.iter().all(|line| line.matches(',').count() == 2), "{svg}");
        assert_eq!(svg.matches("fill=\"#ddd\"").count(), 1, "{svg}");
    }
}
