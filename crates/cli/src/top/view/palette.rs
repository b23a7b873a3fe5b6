//! The styles of what is drawn.

use ratatui::style::{Color, Modifier, Style};

/// Styles, with or without colours.
#[derive(Clone, Copy, Debug)]
pub struct Palette {
    /// True if there are colours: not with `NO_COLOR`.
    pub has_colours: bool,
}

impl Palette {
    fn coloured(self, colour: Color, modifier: Modifier) -> Style {
        let style = Style::new().add_modifier(modifier);
        if self.has_colours { style.fg(colour) } else { style }
    }

    /// Of what is not as it should be.
    pub fn bad(self) -> Style {
        self.coloured(Color::Red, Modifier::BOLD)
    }

    /// Of what asks for attention.
    pub fn notable(self) -> Style {
        self.coloured(Color::Yellow, Modifier::BOLD)
    }

    /// Of what is well.
    pub fn good(self) -> Style {
        self.coloured(Color::Green, Modifier::empty())
    }

    /// Of headings.
    pub fn heading(self) -> Style {
        self.coloured(Color::Cyan, Modifier::BOLD)
    }

    /// Of what is less important.
    pub fn faint(self) -> Style {
        Style::new().add_modifier(Modifier::DIM)
    }
}
