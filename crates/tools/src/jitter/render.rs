//! The measurements as text.

use super::report::{JitterReport, PassReport};
use takt::telemetry::Emphasis;
use takt::telemetry::render::{duration, histograms, latency_table, line, missed_slots, realtime};

impl JitterReport {
    /// The report as text of at most 80 columns (but for commands, which are not broken).
    pub fn render(&self, emphasis: Emphasis) -> String {
        let mut text = String::new();
        let cycle = duration(self.cycle_ns);
        let bus = self.bus.as_ref().map_or("no bus".to_owned(), |bus| format!("SYNC on {bus}"));
        line(
            &mut text,
            &format!(
                "{}  {} cycles of {cycle} for each kind of pacing, {bus}",
                emphasis.heading("jitter"),
                self.cycles
            ),
        );
        if !self.is_whole {
            line(&mut text, &emphasis.bad("interrupted: these are the cycles measured until then"));
        }
        for pass in &self.passes {
            show_pass(&mut text, emphasis, pass);
        }
        line(&mut text, "");
        realtime(&mut text, emphasis, &self.realtime);
        text
    }
}

fn show_pass(text: &mut String, emphasis: Emphasis, pass: &PassReport) {
    line(text, "");
    let title = match pass.pacing {
        "sleep" => "sleep only".to_owned(),
        _ => format!("sleep, then spin for the last {}", duration(pass.spin_guard_ns)),
    };
    line(text, &emphasis.heading(&format!("── {title} {:─<1$}", "", 76 - title.chars().count())));
    histograms(text, emphasis, &pass.wake_ns, &pass.sync_ns);
    line(text, "");
    latency_table(text, emphasis, &[("wake-up", &pass.wake_ns), ("SYNC release", &pass.sync_ns)]);
    missed_slots(text, emphasis, pass.missed_slots, pass.cycles);
    if let (Some(sent), Some(overruns), Some(errors)) = (pass.sync_sent, pass.tx_overruns, pass.bus_errors) {
        let words = format!("{:<20}{sent:>12}, {overruns} overruns, {errors} bus errors", "SYNC on the wire");
        line(text, &if overruns + errors == 0 { words } else { emphasis.bad(&words) });
    }
    if pass.records_dropped > 0 {
        line(text, &emphasis.bad(&format!("{:<20}{:>12}", "cycles not counted", pass.records_dropped)));
    }
}
