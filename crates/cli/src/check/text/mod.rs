//! The result of `takt check` as text. Axes and buses that are alike are shown once.

mod axes;
mod buses;
mod spans;

use std::fmt::Write as _;

use takt_wire::printable::printable_path;

use takt::config::Config;
use takt::schedule::BusSchedule;
use takt::schedule::text::microseconds;

use super::lines;
use super::result::{Check, GroupCheck};
use crate::columns::paragraph;
use crate::table::Table;
use axes::{
    axes_table, is_shown_alike, limits_table, modes_table, supervision_table, torque_table, unattended_table,
    units_table, urdf_table,
};
use buses::{bus_text, buses_table, groups};
use spans::{alike, time};

/// The whole text: the verdict first, then what is doubtful, then the tables.
pub fn whole(check: &Check, config: &Config) -> String {
    let summary = format!(
        "{} on {}, a cycle of {} with the command phase at {} µs{}{}",
        counted(check.axes.len(), "axis", "axes"),
        counted(check.buses.len(), "bus", "buses"),
        time(check.cycle_ns),
        microseconds(check.command_phase_ns),
        automatic(check),
        send_phase(check),
    );
    let mut text = paragraph(&format!("{}: {}", check.name, verdict(check)), 0);
    let _ = writeln!(text, "\n{}", paragraph(&summary, 0));
    text.push_str(&sentences("Refused by the data sheets of the drives", &check.refused));
    text.push_str(&sentences("Warnings", &check.warnings));
    text.push_str(&sentences("What drives lack, by their data sheets", &check.losses));
    if !check.groups.is_empty() {
        let _ = write!(text, "\nGroups\n{}", groups_table(&check.groups));
    }
    let axes = alike(&check.axes, is_shown_alike);
    let _ = write!(text, "\nAxes\n{}", axes_table(&axes));
    let _ = write!(text, "\nLimits\n{}", limits_table(&axes));
    if let Some(table) = urdf_table(&check.axes) {
        let _ = write!(text, "\nLimits of the robot description\n{table}");
    }
    if let Some(table) = modes_table(&axes) {
        let _ = write!(text, "\nModes of operation\n{table}");
    }
    if let Some(table) = torque_table(&axes) {
        let _ = write!(text, "\nTorque that streams may ask for\n{table}");
    }
    let _ = write!(text, "\nUnits\n{}", units_table(&axes));
    let _ = write!(
        text,
        "\nSupervision, beside feedback in every cycle\n{}",
        supervision_table(&alike(&check.axes, |first, second| first.supervision == second.supervision))
    );
    let _ = write!(
        text,
        "\nIf the controller is gone at full speed (kill -9, a broken cable)\n{}",
        unattended_table(&alike(&check.axes, |first, second| {
            first.mode == second.mode
                && first.shown_in == second.shown_in
                && first.without_controller == second.without_controller
        }))
    );

    text.push_str(&configuration_files(config));
    let both = check.buses.iter().zip(&config.buses).enumerate();
    let can: Vec<_> = both.filter(|(bus, _)| !config.is_serial_line(*bus)).map(|(_, both)| both).collect();
    let groups = groups(&can);
    if !groups.is_empty() {
        let _ = write!(
            text,
            "\nBuses in the worst slot (times in µs after its SYNC is due)\n{}",
            buses_table(&groups)
        );
    }
    for group in &groups {
        text.push('\n');
        text.push_str(&bus_text(group));
    }
    if let Some(table) = lines::table(&check.lines) {
        let _ = write!(text, "\nSerial lines, beside the cycle\n{table}");
    }
    for explained in [
        "response: from being queued until received, whatever else is queued when (Davis, Burns, Bril, Lukkien 2007)",
        "in slot by: after SYNC is due, with everything in its place in the slot",
    ] {
        let _ = write!(text, "\n{}", paragraph(explained, 2));
    }
    text.push('\n');
    text
}

fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// Sentences under a heading; nothing without one.
fn sentences(heading: &str, sentences: &[String]) -> String {
    if sentences.is_empty() {
        return String::new();
    }
    let lines = sentences.iter().map(|sentence| paragraph(&format!("  {sentence}"), 4));
    format!("\n{heading}\n{}\n", lines.collect::<Vec<_>>().join("\n"))
}

fn groups_table(groups: &[GroupCheck]) -> Table {
    let mut table = Table::new(["group", "axes", "stops with"]);
    for group in groups {
        table.row([group.name.clone(), group.axes.join(", "), group.stops_with.join(", ")]);
    }
    table
}

/// What the configuration files of the axes have written, and what of them is left out.
fn configuration_files(config: &Config) -> String {
    let mut text = String::new();
    for axis in &config.axes {
        let Some(file) = &axis.dcf else { continue };
        if text.is_empty() {
            text.push_str("\nConfiguration files\n");
        }
        let (path, count) = (printable_path(&file.path), file.downloads.len());
        let _ = writeln!(text, "  {}: {count} writes from {path}", axis.name);
        for (object, omission) in &file.omitted {
            let _ = writeln!(text, "    not written: {object} ({omission})");
        }
    }
    text
}

fn verdict(check: &Check) -> &'static str {
    if !check.refused.is_empty() {
        "REFUSED: by their data sheets, not every drive can be brought up."
    } else if !check.fits {
        "REFUSED: not every bus carries its traffic in the worst case."
    } else if check.buses.iter().any(BusSchedule::is_narrow) {
        "every bus carries its traffic in the worst case, but with little reserve."
    } else {
        "every bus carries its traffic in the worst case."
    }
}

fn automatic(check: &Check) -> String {
    match check.automatic_command_phase_ns {
        Some(phase_ns) if phase_ns == check.command_phase_ns => " (as \"auto\" has it)".to_owned(),
        Some(phase_ns) => format!(" (\"auto\": {} µs)", microseconds(phase_ns)),
        None => String::new(),
    }
}

fn send_phase(check: &Check) -> String {
    let sent = |phase_ns| format!(", set-points held until {} µs", microseconds(phase_ns));
    check.send_phase_ns.map(sent).unwrap_or_default()
}
