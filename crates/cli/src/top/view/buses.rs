//! The buses.

use ratatui::style::Style;
use ratatui::text::Line;
use takt_rt::BusState;

use super::palette::Palette;
use crate::top::model::Model;
use takt::telemetry::BusReport;

/// The columns from which on rates of frames are shown.
const WITH_RATES: u16 = 76;

/// The lines: a heading, and a line for each bus.
pub fn lines(model: &Model, width: u16, palette: Palette) -> Vec<Line<'static>> {
    let has_rates = width >= WITH_RATES;
    let rates = |tx: &str, rx: &str| if has_rates { format!(" {tx:>7} {rx:>7}") } else { String::new() };
    let heading = format!(
        "{:<12}{:>6}{} {:>7} {:>5}  {}",
        "BUS",
        "load",
        rates("tx/s", "rx/s"),
        "errors",
        "lost",
        "state"
    );
    let mut lines = vec![Line::styled(heading, palette.heading())];
    let buses = model.machine.buses.iter().zip(model.seen.snapshot.buses());
    for (number, (bus, health)) in buses.enumerate() {
        let (load, tx, rx) = match model.rates(number) {
            Some((load, tx, rx)) => (format!("{load:.1} %"), format!("{tx:.0}"), format!("{rx:.0}")),
            None => ("-".to_owned(), "-".to_owned(), "-".to_owned()),
        };
        let lost = health.tx_overruns + health.rx_overruns;
        let name: String = format!("{} {}", bus.name, bus.interface).chars().take(11).collect();
        let text = format!(
            "{name:<12}{load:>6}{} {:>7} {lost:>5}  {}",
            rates(&tx, &rx),
            health.errors,
            BusReport::state_words(health.state)
        );
        let style = match health.state {
            BusState::ErrorActive if health.errors == 0 && lost == 0 => Style::new(),
            BusState::ErrorActive => palette.notable(),
            _ => palette.bad(),
        };
        lines.push(Line::styled(text, style));
    }
    lines
}
