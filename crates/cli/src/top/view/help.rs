//! The keys.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::Line;
use ratatui::widgets::{Paragraph, Widget, Wrap};

use super::palette::Palette;

const KEYS: [(&str, &str); 14] = [
    ("SPACE", "stop all axes, held under power (category 2); needs no lease"),
    ("x", "stop all axes, then remove the power (category 1); needs no lease"),
    ("↑ ↓  k j", "select an axis"),
    ("t", "take the lease, to command"),
    ("T", "take the lease from whoever has it (asks)"),
    ("r", "give the lease back"),
    ("← →", "hold to jog the selected axis; it comes to rest when the key is let go"),
    ("+ -", "faster, slower"),
    ("e", "enable (asks)"),
    ("d", "bring to rest and disable (asks)"),
    ("c", "clear faults (asks)"),
    ("g", "e, d and c are for all axes, or for the group of the selected one"),
    ("q", "quit; the axes go on"),
    ("?", "this page; any key leaves it"),
];

/// Draws the page.
pub fn draw(area: Rect, buffer: &mut Buffer, palette: Palette) {
    let mut lines = vec![Line::styled("KEYS", palette.heading())];
    lines.extend(KEYS.iter().map(|(key, what)| Line::raw(format!("{key:<9} {what}"))));
    lines.push(Line::raw(""));
    lines.push(Line::raw(
        "No stop here is safety-rated: the emergency stop is in hardware. ○ is the set-point, ● the position.",
    ));
    Paragraph::new(lines).wrap(Wrap { trim: false }).render(area, buffer);
}
