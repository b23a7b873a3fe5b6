//! The result of `takt check` as text. Axes and buses that are alike are shown once.

use std::fmt::Write as _;

use crate::config::{Bus, Config, LimitOrigin};
use crate::printable::printable_path;
use crate::schedule::text::{message_name, microseconds, narrow, remedy, reserve, shortfall, sums};
use crate::schedule::{BusSchedule, MessageSchedule};

use super::lines;
use super::{AxisCheck, Check, ComplianceCheck, GroupCheck};
use crate::cli::columns::paragraph;
use crate::cli::table::{Table, UNBROKEN};

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
    if !check.fits {
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

/// The elements that follow each other and are alike.
fn alike<T>(elements: &[T], are_alike: impl Fn(&T, &T) -> bool) -> Vec<&[T]> {
    elements.chunk_by(are_alike).collect()
}

/// `a`, or `a, b`, or `a … z`; each name once where it is repeated.
fn span<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let mut different: Vec<&str> = names.collect();
    different.dedup();
    match different[..] {
        [first, _, .., last] if different.len() > 2 => format!("{first} … {last}"),
        _ => different.join(", "),
    }
}

/// The same with how many there are, where not all of them are named.
fn counted_span<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> String {
    let count = names.len();
    let span = span(names);
    if count > 2 { format!("{span} ({count})") } else { span }
}

fn is_shown_alike(first: &AxisCheck, second: &AxisCheck) -> bool {
    let anonymous = |axis: &AxisCheck| AxisCheck {
        name: String::new(),
        bus: String::new(),
        node: 0,
        urdf: None,
        ..axis.clone()
    };
    anonymous(first) == anonymous(second)
}

fn axes_table(axes: &[&[AxisCheck]]) -> Table {
    let mut table = Table::new(["axis", "bus", ">node", "mode", "following error"]);
    for (group, axis) in axes.iter().filter_map(|group| Some((group, group.first()?))) {
        let (lowest, highest) =
            group.iter().fold((u8::MAX, 0), |(low, high), axis| (low.min(axis.node), high.max(axis.node)));
        table.row([
            counted_span(group.iter().map(|axis| axis.name.as_str())),
            span(group.iter().map(|axis| axis.bus.as_str())),
            match axis.node_axis {
                1 if lowest == highest => lowest.to_string(),
                1 => format!("{lowest} to {highest}"),
                number => format!("{lowest}, axis {number}"),
            },
            axis.mode.to_owned(),
            format!(
                "up to {} {} for {}",
                short(axis.shown(axis.following_error)),
                axis.unit(),
                time(axis.following_error_time_ns)
            ),
        ]);
    }
    table
}

/// In the unit that the file has for the position limits of the axis.
fn limits_table(axes: &[&[AxisCheck]]) -> Table {
    let mut table =
        Table::new(["axis", "unit", ">lowest", ">highest", ">velocity", ">acceleration", ">jerk", ">torque"]);
    for (group, axis) in axes.iter().filter_map(|group| Some((group, group.first()?))) {
        let position = |position: f64| format!("{:.*}", axis.decimals(), axis.shown(position));
        let derivative = |value: f64| format!("{:.*}", axis.decimals().saturating_sub(2), axis.shown(value));
        table.row([
            counted_span(group.iter().map(|axis| axis.name.as_str())),
            axis.unit().to_owned(),
            position(axis.position_min),
            position(axis.position_max),
            position(axis.velocity),
            if axis.deceleration == axis.acceleration {
                derivative(axis.acceleration)
            } else {
                format!("{}, braking {}", derivative(axis.acceleration), derivative(axis.deceleration))
            },
            axis.jerk.map_or("none".to_owned(), derivative),
            format!("{:.1}{UNBROKEN}{}", axis.torque, if axis.is_linear { "N" } else { "Nm" }),
        ]);
    }
    table
}

/// Where the limits of each axis come from that has a joint in a robot description; `None` without one.
fn urdf_table(axes: &[AxisCheck]) -> Option<Table> {
    let mut table = Table::new(["axis", "joint", "position", "velocity", "torque", "file"]);
    let described: Vec<_> = axes.iter().filter_map(|axis| Some((axis, axis.urdf.as_ref()?))).collect();
    for (axis, urdf) in &described {
        let from = |origin| {
            match origin {
                LimitOrigin::Configuration => "here",
                LimitOrigin::Limit => "limit",
                LimitOrigin::SafetyController => "soft limit",
            }
            .to_owned()
        };
        table.row([
            axis.name.clone(),
            urdf.joint.clone(),
            from(urdf.position),
            from(urdf.velocity),
            from(urdf.torque),
            printable_path(&urdf.file),
        ]);
    }
    (!described.is_empty()).then_some(table)
}

/// The axes of which a stream may want a torque, an impedance, or a torque that is fed forward; `None` without one.
fn torque_table(axes: &[&[AxisCheck]]) -> Option<Table> {
    let mut table =
        Table::new(["axis", "as", "sent beside the target", ">stiffness", ">damping", ">torque per second"]);
    let mut has_rows = false;
    for (group, axis) in axes.iter().filter_map(|group| Some((group, group.first()?))) {
        let number = |of: fn(&ComplianceCheck) -> f64| {
            axis.compliance
                .as_ref()
                .map_or(String::new(), |compliance| format!("up to {:.1}", of(compliance)))
        };
        if axis.compliance.is_none() && axis.feed_forward == "none" {
            continue;
        }
        has_rows = true;
        table.row([
            counted_span(group.iter().map(|axis| axis.name.as_str())),
            if axis.compliance.is_some() { "target" } else { "offset" }.to_owned(),
            axis.feed_forward.to_owned(),
            number(|compliance| compliance.stiffness_max),
            number(|compliance| compliance.damping_max),
            number(|compliance| compliance.torque_rate),
        ]);
    }
    has_rows.then_some(table)
}

/// The axes whose mode may be changed at run time; `None` without one.
fn modes_table(axes: &[&[AxisCheck]]) -> Option<Table> {
    let mut table = Table::new(["axis", "starts in", "may be changed to", "when"]);
    let changing = axes.iter().filter_map(|group| Some((group, group.first()?)));
    let changing: Vec<_> = changing.filter(|(_, axis)| !axis.other_modes.is_empty()).collect();
    for (group, axis) in &changing {
        table.row([
            counted_span(group.iter().map(|axis| axis.name.as_str())),
            axis.mode.to_owned(),
            axis.other_modes.join(", "),
            axis.mode_change.unwrap_or_default().to_owned(),
        ]);
    }
    (!changing.is_empty()).then_some(table)
}

fn units_table(axes: &[&[AxisCheck]]) -> Table {
    let mut table =
        Table::new(["axis", "counts per unit", "one count", "counts per cycle at full speed", "counts"]);
    for (group, axis) in axes.iter().filter_map(|group| Some((group, group.first()?))) {
        let [lowest, highest] = axis.counts_range;
        table.row([
            counted_span(group.iter().map(|axis| axis.name.as_str())),
            format!("{} per {}", short(1.0 / axis.shown(axis.resolution)), axis.unit()),
            format!("{}{UNBROKEN}µ{}", short(axis.shown(axis.resolution) * 1e6), axis.unit()),
            format!("{:.1}", axis.counts_per_cycle),
            format!("{lowest} to {highest}"),
        ]);
    }
    table
}

fn supervision_table(axes: &[&[AxisCheck]]) -> Table {
    let mut table = Table::new([
        "axis",
        "the controller sees the drive by",
        ">stops after",
        "the drive sees the controller by",
        ">stops after",
    ]);
    for (group, axis) in axes.iter().filter_map(|group| Some((group, group.first()?))) {
        let supervision = &axis.supervision;
        table.row([
            counted_span(group.iter().map(|axis| axis.name.as_str())),
            supervision.drive.words(time),
            time(supervision.drive_lost_after_ns),
            supervision.controller.map_or("NOTHING".to_owned(), |sign| sign.words(time)),
            supervision.controller_lost_after_ns.map_or("never".to_owned(), time),
        ]);
    }
    table
}

fn unattended_table(axes: &[&[AxisCheck]]) -> Table {
    let mut table = Table::new(["axis", "mode", "what the drive does"]);
    for (group, axis) in axes.iter().filter_map(|group| Some((group, group.first()?))) {
        table.row([
            counted_span(group.iter().map(|axis| axis.name.as_str())),
            axis.mode.to_owned(),
            axis.without_controller.words(axis.shown_in),
        ]);
    }
    table
}

/// Buses that differ in names and identifiers alone.
type Group<'a> = Vec<(&'a BusSchedule, &'a Bus)>;

fn groups<'a>(buses: &[(&'a BusSchedule, &'a Bus)]) -> Vec<Group<'a>> {
    let mut groups: Vec<(BusSchedule, Group<'a>)> = vec![];
    for &(schedule, bus) in buses {
        let anonymous = without_names(schedule);
        match groups.iter_mut().find(|(known, _)| *known == anonymous) {
            Some((_, group)) => group.push((schedule, bus)),
            None => groups.push((anonymous, vec![(schedule, bus)])),
        }
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

/// What decides whether two buses are alike. What is late follows from it.
fn without_names(schedule: &BusSchedule) -> BusSchedule {
    let mut schedule = BusSchedule { name: String::new(), shortfalls: vec![], ..schedule.clone() };
    for message in &mut schedule.messages {
        message.axis = None;
        message.id = 0;
    }
    schedule
}

fn names(group: &Group<'_>) -> String {
    counted_span(group.iter().map(|(schedule, _)| schedule.name.as_str()))
}

fn buses_table(groups: &[Group<'_>]) -> Table {
    let mut table = Table::new([
        "bus",
        "interface",
        ">load",
        ">feedback by",
        ">command phase",
        "possible",
        ">set-points by",
        "verdict",
    ]);
    for (group, (schedule, _)) in groups.iter().filter_map(|group| Some((group, group.first()?))) {
        let interfaces: Vec<String> = group.iter().map(|(_, bus)| bus.interface.to_string()).collect();
        let phases = schedule.slot.command_phases_ns.map_or("none".to_owned(), |(earliest, latest)| {
            format!("{}{UNBROKEN}to{UNBROKEN}{}", microseconds(earliest), microseconds(latest))
        });
        table.row([
            names(group),
            format!("{}, {} kbit/s", span(interfaces.iter().map(String::as_str)), schedule.bit_rate / 1000),
            format!("{:.1}{UNBROKEN}%", schedule.load_percent),
            microseconds(schedule.slot.feedback_done_ns),
            microseconds(schedule.command_phase_ns),
            phases,
            microseconds(schedule.slot.set_points_done_ns),
            match (schedule.fits(), schedule.is_narrow()) {
                (true, false) => "fits",
                (true, true) => "fits narrowly",
                (false, _) => "DOES NOT FIT",
            }
            .to_owned(),
        ]);
    }
    table
}

fn bus_text(group: &Group<'_>) -> String {
    let Some((schedule, _)) = group.first() else { return String::new() };
    let whose = match group.len() {
        1 => String::new(),
        alike => {
            format!(", and {} alike", if alike == 2 { "one".to_owned() } else { (alike - 1).to_string() })
        }
    };
    let mut text =
        format!("Bus {}{whose} (times in µs)\n{}", schedule.name, message_table(&schedule.messages));
    let line = |line: &str, indentation: usize| format!("{}\n", paragraph(&format!("  {line}"), indentation));
    for sum in sums(schedule).into_iter().chain(reserve(schedule)) {
        text.push_str(&line(&sum, SUM_INDENTATION));
    }
    match narrow(schedule) {
        Some(why) => text.push_str(&line(&format!("fits narrowly: {why}"), 4)),
        None if schedule.fits() => text.push_str("  fits\n"),
        None => {}
    }
    for shortfall in schedule.shortfalls.iter().map(shortfall) {
        text.push_str(&line(&format!("DOES NOT FIT: {shortfall}"), 4));
    }
    for remedy in schedule.remedies.iter().map(remedy) {
        text.push_str(&line(&format!("what would fit: {remedy}"), 4));
    }
    text
}

/// Where the numbers of a sum begin.
const SUM_INDENTATION: usize = 16;

fn message_table(messages: &[MessageSchedule]) -> Table {
    let mut table = Table::new([
        "id",
        "message",
        "axis",
        ">on the wire",
        ">period",
        ">response",
        ">in slot by",
        ">due",
        ">early",
    ]);
    for group in alike(messages, are_shown_alike) {
        let [message, ..] = group else { continue };
        let first_id = format!("{:03X}", message.id);
        let id = match group {
            [_, .., last] => format!("{first_id}-{:03X}", last.id),
            _ => first_id,
        };
        let bound = |ns: Option<u64>| match ns {
            Some(ns) => microseconds(ns),
            None if message.is_sent_while_enabled => "no bound".to_owned(),
            None => "-".to_owned(),
        };
        table.row([
            id,
            message_name(message.kind).to_owned(),
            span(group.iter().filter_map(|message| message.axis.as_deref())),
            microseconds(message.transmission_ns),
            if message.is_sent_while_enabled { time(message.period_ns) } else { "disabled".to_owned() },
            bound(message.response_ns),
            message.in_slot_ns.map_or("-".to_owned(), microseconds),
            message.deadline_ns.map_or("-".to_owned(), microseconds),
            earliness(message),
        ]);
    }
    table
}

/// How much earlier than due.
fn earliness(message: &MessageSchedule) -> String {
    let Some(deadline_ns) = message.deadline_ns else { return "-".to_owned() };
    match message.in_slot_ns.or(message.response_ns) {
        Some(ns) if ns <= deadline_ns => microseconds(deadline_ns - ns),
        Some(ns) => format!("{} LATE", microseconds(ns - deadline_ns)),
        None => "LATE".to_owned(),
    }
}

fn are_shown_alike(first: &MessageSchedule, second: &MessageSchedule) -> bool {
    let anonymous = |message: &MessageSchedule| MessageSchedule { axis: None, id: 0, ..message.clone() };
    anonymous(first) == anonymous(second)
}

/// A number with five significant digits, without zeros at its end.
fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let decimals = (4 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A length of time in the unit that suits it.
fn time(ns: u64) -> String {
    if ns >= 1_000_000_000 && ns.is_multiple_of(100_000_000) {
        format!("{} s", ns as f64 / 1e9)
    } else if ns >= 1_000_000 && ns.is_multiple_of(100_000) {
        format!("{} ms", ns as f64 / 1e6)
    } else {
        format!("{} µs", microseconds(ns))
    }
}
