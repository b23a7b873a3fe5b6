//! Curves over time as SVG: one panel below the other, limits as dashed lines, one instant marked.

mod palette;
mod ticks;

pub use palette::{COLOURS, SHADED_WORDS};
use palette::{FILE, PAGE, Palette};
pub use ticks::ticks;

use crate::svg::{Svg, escaped};

/// The widths of a file, and of a chart on a page, where the letters are larger on a small screen.
const FILE_WIDTH: f64 = 900.0;
const PAGE_WIDTH: f64 = 640.0;
const PANEL: f64 = 180.0;
const LEFT: f64 = 80.0;
const RIGHT_MARGIN: f64 = 20.0;
const GAP: f64 = 40.0;
const MARGIN: f64 = 8.0;
/// The most values beside a panel.
const VALUES: usize = 6;
/// The room of a time below a panel.
const TIME_ROOM: f64 = 85.0;
/// The columns of a line of the title, which find room also in a wide font; and the most lines.
const TITLE_COLUMNS: usize = 100;
const TITLE_LINES: usize = 4;
const TITLE_LINE: f64 = 18.0;

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
    /// The chart as a file of its own.
    pub fn draw(&self) -> String {
        self.draw_as(FILE_WIDTH, &FILE)
    }

    /// The chart as a part of a page, whose style has the colours.
    pub fn draw_on_page(&self) -> String {
        self.draw_as(PAGE_WIDTH, &PAGE)
    }

    fn draw_as(&self, width: f64, palette: &Palette) -> String {
        let title = title_lines(&self.title);
        let top = if title.is_empty() { 0.0 } else { GAP + TITLE_LINE * (title.len() - 1) as f64 };
        let height = top + self.panels.len() as f64 * (PANEL + GAP) + 0.5 * GAP;
        let mut svg = Svg::new((width, height), palette.words, palette.background);
        for (number, line) in title.iter().enumerate() {
            let y = 24.0 + TITLE_LINE * number as f64;
            svg.text((20.0, y), "start", "font-size=\"14\"", line);
        }
        for (index, panel) in self.panels.iter().enumerate() {
            let top = top + GAP * 0.75 + index as f64 * (PANEL + GAP);
            Drawing { chart: self, panel, palette, top, right: width - RIGHT_MARGIN }.draw(&mut svg);
        }
        svg.into_text()
    }
}

/// A panel at its place.
struct Drawing<'a> {
    chart: &'a Chart,
    panel: &'a Panel,
    palette: &'a Palette,
    top: f64,
    right: f64,
}

/// The values of a panel, from the lowest to the highest.
#[derive(Clone, Copy)]
struct Scale {
    low: f64,
    high: f64,
    top: f64,
}

impl Scale {
    /// A line at a limit must not lie on the frame.
    fn y(&self, value: f64) -> f64 {
        self.top + MARGIN + (PANEL - 2.0 * MARGIN) * (1.0 - (value - self.low) / (self.high - self.low))
    }
}

impl Drawing<'_> {
    fn x(&self, time_s: f64) -> f64 {
        let (from, to) = self.chart.span_s;
        LEFT + (self.right - LEFT) * if to > from { (time_s - from) / (to - from) } else { 0.0 }
    }

    fn scale(&self) -> Scale {
        let limits = self.panel.limits.iter().map(|(limit, _)| *limit);
        let points = self.panel.curves.iter().flat_map(|curve| curve.points.iter().map(|(_, value)| *value));
        let values = points.chain(limits).filter(|value| value.is_finite());
        let (low, high) = values
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
        // A value that does not change is in the middle.
        let room = if low == 0.0 { 1.0 } else { low.abs() * 0.1 };
        let (low, high) = if high - low > low.abs() * 1e-9 { (low, high) } else { (low - room, high + room) };
        Scale { low, high, top: self.top }
    }

    fn draw(&self, svg: &mut Svg) {
        let Self { chart, panel, palette, top, right } = *self;
        let (scale, bottom) = (self.scale(), top + PANEL);
        for (from, to) in &panel.shaded {
            // A single cycle is visible, too.
            let (x, width) = (self.x(*from), (self.x(*to) - self.x(*from)).max(1.0));
            svg.rect((x, top), (width, PANEL), format_args!("fill=\"{}\"", palette.shade));
        }
        self.draw_values(svg, scale);
        self.draw_times(svg);
        for end in [(LEFT, top), (right, bottom)] {
            svg.line((LEFT, bottom), end, format_args!("stroke=\"{}\"", palette.frame));
        }
        svg.text((LEFT, top - 6.0), "start", "", &panel.name);
        self.draw_legend(svg);
        if let Some(mark_s) = chart.mark_s {
            let x = self.x(mark_s);
            svg.line((x, top), (x, bottom), format_args!("stroke=\"{}\"", palette.mark));
        }
        for (limit, colour) in panel.limits.iter().filter(|(limit, _)| limit.is_finite()) {
            let (y, colour) = (scale.y(*limit), palette.of(colour));
            let dashed = format_args!("stroke=\"{colour}\" stroke-dasharray=\"4 4\" opacity=\"0.5\"");
            svg.line((LEFT, y), (right, y), dashed);
        }
        panel.curves.iter().for_each(|curve| self.draw_curve(svg, curve, scale));
    }

    fn draw_values(&self, svg: &mut Svg, scale: Scale) {
        for tick in ticks(scale.low, scale.high, VALUES) {
            let y = scale.y(tick.value);
            svg.line((LEFT, y), (self.right, y), format_args!("stroke=\"{}\"", self.palette.grid));
            svg.text((LEFT - 6.0, y + 4.0), "end", "", &tick.label);
        }
    }

    fn draw_times(&self, svg: &mut Svg) {
        let (bottom, (from, to)) = (self.top + PANEL, self.chart.span_s);
        for tick in ticks(from, to, ((self.right - LEFT) / TIME_ROOM) as usize) {
            let x = self.x(tick.value);
            svg.line((x, self.top), (x, bottom), format_args!("stroke=\"{}\"", self.palette.grid));
            svg.text((x, bottom + 15.0), "middle", "", format_args!("{} s", tick.label));
        }
    }

    fn draw_curve(&self, svg: &mut Svg, Curve { colour, points }: &Curve, scale: Scale) {
        let colour = self.palette.of(colour);
        // Points without a value between them are one line.
        let lines = points.split(|(_, value)| !value.is_finite()).filter(|line| !line.is_empty());
        for line in lines {
            let points = line.iter().map(|(time_s, value)| (self.x(*time_s), scale.y(*value)));
            svg.polyline(points, format_args!("stroke=\"{colour}\" stroke-width=\"1.5\""));
        }
    }

    /// The names at the right, so that the heading keeps its place.
    fn draw_legend(&self, svg: &mut Svg) {
        let names = self.panel.legend.iter().filter(|(name, _)| !name.is_empty());
        let words: Vec<String> = names
            .map(|(name, colour)| {
                format!("<tspan fill=\"{}\">{}</tspan>", self.palette.of(colour), escaped(name))
            })
            .collect();
        if !words.is_empty() {
            svg.markup((self.right, self.top - 6.0), "end", "", &words.join("&#160;&#160; "));
        }
    }
}

/// The title, broken between words. The author of a file may have given it any length.
fn title_lines(title: &str) -> Vec<String> {
    let most = TITLE_COLUMNS * TITLE_LINES;
    let kept: String = title.chars().take(most + 1).collect();
    let mut lines: Vec<String> =
        textwrap::wrap(kept.trim(), TITLE_COLUMNS).iter().map(ToString::to_string).collect();
    let is_whole = kept.len() == title.len() && lines.len() <= TITLE_LINES;
    lines.truncate(TITLE_LINES);
    if let Some(last) = lines.last_mut().filter(|_| !is_whole) {
        last.push('…');
    }
    lines.retain(|line| !line.is_empty());
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_title_is_broken_between_words_and_its_end_is_left_out_only_beyond_four_lines() {
        let reason =
            "joint3 was 0.0213 rad from its set-point (allowed: 0.0020 rad) while moving, ".repeat(4);
        let lines = title_lines(&reason);
        assert_eq!((lines.join(" "), lines.len()), (reason.trim().to_owned(), 4));
        assert!(lines.iter().all(|line| line.chars().count() <= TITLE_COLUMNS), "{lines:?}");
        let chart = |title: &str| Chart { title: title.to_owned(), ..Chart::default() }.draw();
        assert_eq!(chart(&reason).matches("font-size=\"14\"").count(), 4);
        assert_eq!(chart("").matches("font-size=\"14\"").count(), 0);
        let endless = title_lines(&"x".repeat(1 << 20));
        assert!(endless.len() == TITLE_LINES && endless[3].ends_with('…'), "{endless:?}");
        assert_eq!(title_lines("arm"), ["arm"]);
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
