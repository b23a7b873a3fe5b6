//! SVG as text: the elements that drawings are made of. Coordinates have two decimals at most.

use std::fmt::{Arguments, Display, Write as _};

/// A point, or a width and a height.
pub type Pair = (f64, f64);

/// A drawing.
#[derive(Debug)]
pub struct Svg(String);

impl Svg {
    /// An empty drawing of this size, with the colour of its words and, if it has one, of its background.
    pub fn new((width, height): Pair, words: &str, background: Option<&str>) -> Self {
        let mut svg = Self(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
             font-size=\"12\" fill=\"{words}\">\n"
        ));
        if let Some(background) = background {
            svg.rect((0.0, 0.0), (width, height), format_args!("fill=\"{background}\""));
        }
        svg
    }

    /// Adds an element.
    pub fn element(&mut self, element: Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.0, "{element}");
    }

    /// Adds a rectangle at its upper left corner.
    pub fn rect(&mut self, (x, y): Pair, (width, height): Pair, attributes: Arguments<'_>) {
        let [x, y, width, height] = [x, y, width, height].map(rounded);
        self.element(format_args!(
            "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" {attributes}/>"
        ));
    }

    /// Adds a straight line.
    pub fn line(&mut self, (x1, y1): Pair, (x2, y2): Pair, attributes: Arguments<'_>) {
        let [x1, y1, x2, y2] = [x1, y1, x2, y2].map(rounded);
        self.element(format_args!("<line x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\" {attributes}/>"));
    }

    /// Adds a line through these points.
    pub fn polyline(&mut self, points: impl IntoIterator<Item = Pair>, attributes: Arguments<'_>) {
        let points = listed(points);
        self.element(format_args!("<polyline points=\"{points}\" fill=\"none\" {attributes}/>"));
    }

    /// Adds the area within these points.
    pub fn area(&mut self, points: impl IntoIterator<Item = Pair>, attributes: Arguments<'_>) {
        let points = listed(points);
        self.element(format_args!("<polygon points=\"{points}\" {attributes}/>"));
    }

    /// Adds words whose start, middle or end (`anchor`) is at this point.
    pub fn text(&mut self, at: Pair, anchor: &str, attributes: &str, words: impl Display) {
        self.markup(at, anchor, attributes, &escaped(&words.to_string()));
    }

    /// Adds words with markup in them.
    pub fn markup(&mut self, (x, y): Pair, anchor: &str, attributes: &str, words: &str) {
        let [x, y] = [x, y].map(rounded);
        self.element(format_args!(
            "<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\" {attributes}>{words}</text>"
        ));
    }

    /// The drawing as text.
    pub fn into_text(mut self) -> String {
        self.0.push_str("</svg>\n");
        self.0
    }
}

fn rounded(coordinate: f64) -> f64 {
    (coordinate * 100.0).round() / 100.0
}

fn listed(points: impl IntoIterator<Item = Pair>) -> String {
    let points = points.into_iter().map(|(x, y)| format!("{},{}", rounded(x), rounded(y)));
    points.collect::<Vec<_>>().join(" ")
}

/// Words as a part of a page or a drawing.
pub fn escaped(words: &str) -> String {
    words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
