//! The tables of the CAN buses: their load, and the response time of every message.

use takt::config::Bus;
use takt::schedule::text::{message_name, microseconds, narrow, remedy, reserve, shortfall, sums};
use takt::schedule::{BusSchedule, MessageSchedule};

use super::spans::{alike, counted_span, span, time};
use crate::columns::paragraph;
use crate::table::{Table, UNBROKEN};

/// Buses that differ in names and identifiers alone.
pub(super) type Group<'a> = Vec<(&'a BusSchedule, &'a Bus)>;

pub(super) fn groups<'a>(buses: &[(&'a BusSchedule, &'a Bus)]) -> Vec<Group<'a>> {
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
    let mut schedule = schedule.clone();
    schedule.name.clear();
    schedule.shortfalls.clear();
    for message in &mut schedule.messages {
        message.axis = None;
        message.id = 0;
    }
    schedule
}

fn names(group: &Group<'_>) -> String {
    counted_span(group.iter().map(|(schedule, _)| schedule.name.as_str()))
}

pub(super) fn buses_table(groups: &[Group<'_>]) -> Table {
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

pub(super) fn bus_text(group: &Group<'_>) -> String {
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
    let anonymous = |message: &MessageSchedule| {
        let mut message = message.clone();
        (message.axis, message.id) = (None, 0);
        message
    };
    anonymous(first) == anonymous(second)
}
