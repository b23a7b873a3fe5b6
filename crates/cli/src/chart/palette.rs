//! The colours of charts.

/// The colours of curves in a file of its own, for as many as can be told apart.
pub const COLOURS: [&str; 8] =
    ["#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2"];

/// The colour of words for what is shaded.
pub const SHADED_WORDS: &str = "#777";

/// The colours of what is around the curves.
pub struct Palette {
    /// `None` is that of what is behind.
    pub background: Option<&'static str>,
    pub words: &'static str,
    pub frame: &'static str,
    pub grid: &'static str,
    pub shade: &'static str,
    pub mark: &'static str,
    curves: [&'static str; COLOURS.len()],
    shaded_words: &'static str,
}

/// Of a file of its own, which is light everywhere.
pub const FILE: Palette = Palette {
    background: Some("white"),
    words: "black",
    frame: "#888",
    grid: "#e8e8e8",
    shade: "#ddd",
    mark: "#d62728",
    curves: COLOURS,
    shaded_words: SHADED_WORDS,
};

/// Of a page, which defines these variables.
pub const PAGE: Palette = Palette {
    background: None,
    words: "var(--words)",
    frame: "var(--frame)",
    grid: "var(--grid)",
    shade: "var(--shade)",
    mark: "var(--error)",
    curves: [
        "var(--c0)",
        "var(--c1)",
        "var(--c2)",
        "var(--c3)",
        "var(--c4)",
        "var(--c5)",
        "var(--c6)",
        "var(--c7)",
    ],
    shaded_words: "var(--faint)",
};

impl Palette {
    /// What a colour of [`COLOURS`] is here.
    pub fn of(&self, colour: &'static str) -> &'static str {
        if colour == SHADED_WORDS {
            return self.shaded_words;
        }
        let known = COLOURS.iter().position(|known| *known == colour);
        known.and_then(|index| self.curves.get(index)).copied().unwrap_or(colour)
    }
}
