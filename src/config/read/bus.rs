//! `[[bus]]`

use std::ops::Range;

use takt_rt::MAX_BUSES;

use super::entry::Entry;
use super::line;
use super::section::Section;
use crate::config::defaults;
use crate::config::keys::{self, bus as bus_keys};
use crate::config::model::{Bus, CommandFrames, Interface, SerialDevice};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantity::Quantity;
use crate::config::rules;
use crate::config::spot::Spot;

/// A bus as far as it could be read.
pub struct ReadBus<'a> {
    pub name: Option<String>,
    pub bit_rate: u32,
    /// Cycles of the controller in one of this bus; `None` when its period is wrong.
    pub divider: Option<u32>,
    /// True if it is a serial line, and no CAN bus.
    pub is_line: bool,
    /// Where the bit rate is, if it is given.
    pub bit_rate_spot: Option<Spot<'a>>,
    /// True if the schedule decides if axes share command frames.
    pub has_automatic_frames: bool,
    /// `None` when something about it is wrong.
    pub bus: Option<Bus>,
    /// Where the section begins.
    pub spot: Spot<'a>,
    header: Range<usize>,
}

/// The buses, but no more than one beyond those that a controller can have: the rest are only counted. `lines`: the names of those
/// that have drives of serial lines.
pub fn buses<'a>(sections: Vec<Section<'a>>, cycle_ns: u64, lines: &[&str]) -> Vec<ReadBus<'a>> {
    let count = sections.len();
    let mut buses = Vec::with_capacity(MAX_BUSES + 1);
    for section in sections.into_iter().take(MAX_BUSES + 1) {
        let spot = section.header_spot();
        let read = bus(section, cycle_ns, &buses, lines);
        buses.push(read);
        if buses.len() > MAX_BUSES {
            spot.report(rules::bus::too_many(count));
        }
    }
    buses
}

fn bus<'a>(mut section: Section<'a>, cycle_ns: u64, earlier: &[ReadBus<'a>], lines: &[&str]) -> ReadBus<'a> {
    let header = section.header();
    let spot = section.header_spot();
    let name = section.require_own("name", "the name of the bus: name = \"left\"").and_then(|entry| {
        let name = entry.name()?;
        if let Some(first) = earlier.iter().find(|bus| bus.name.as_deref() == Some(name)) {
            entry.spot.report_against(rules::bus::duplicate_name(name), &first.header);
        }
        Some(name)
    });
    let interface_entry = section.get(bus_keys::INTERFACE.name);
    let interface = match &interface_entry {
        None => Some(Interface::Simulated),
        Some(entry) => interface(entry, earlier),
    };
    let is_line = match &interface {
        Some(Interface::Serial(_)) => true,
        Some(Interface::Simulated) => name.is_some_and(|name| lines.contains(&name)),
        Some(Interface::SocketCan(_) | Interface::Slcan(_) | Interface::Converter(_)) | None => false,
    };
    let bit_rate_entry = section.get(bus_keys::BIT_RATE.name);
    let bit_rate = bit_rate_entry.as_ref().and_then(|entry| {
        let rate = entry.unbounded(Quantity::BIT_RATE)?;
        // Those of a line are those of its drives, which `rules::axis` knows.
        if is_line { Some(rate.round() as u32) } else { rules::bus::bit_rate(&entry.spot, rate) }
    });
    let bit_rate = match &interface {
        Some(Interface::Serial(device)) => line_bit_rate(device, bit_rate_entry.as_ref(), bit_rate),
        _ if is_line => bit_rate.unwrap_or(defaults::LINE_BIT_RATE),
        _ => bit_rate.unwrap_or(const { bus_keys::BIT_RATE.default_number() as u32 }),
    };
    for key in rules::line::CAN_KEYS.into_iter().filter(|_| is_line) {
        if let Some(entry) = section.get(key) {
            entry.report(rules::line::can_key(&entry.spot.key));
        }
    }
    let data_bit_rate = section.get(bus_keys::DATA_BIT_RATE.name).filter(|_| !is_line).and_then(|entry| {
        let rate = entry.unbounded(Quantity::BIT_RATE)?;
        rules::bus::data_bit_rate(
            &entry.spot,
            rate,
            bit_rate,
            interface.as_ref().unwrap_or(&Interface::Simulated),
        )
    });
    let divider = match section.get(bus_keys::PERIOD.name) {
        Some(entry) => divider(&entry, cycle_ns),
        None => Some(if is_line { line::divider(cycle_ns) } else { 1 }),
    };
    let restart_ms = section.integer(&bus_keys::RESTART_MS);
    let service_frames = section.integer(&bus_keys::SERVICE_FRAMES);
    let sdo_while_enabled = section.boolean(&bus_keys::SDO_WHILE_ENABLED);
    let choices = [
        ("auto", None),
        ("one-per-axis", Some(CommandFrames::OnePerAxis)),
        ("shared", Some(CommandFrames::Shared)),
    ];
    let command_frames =
        section.get(bus_keys::COMMAND_FRAMES.name).and_then(|entry| entry.choice(&choices)).flatten();
    section.finish();
    let bus = name.zip(interface).map(|(name, interface)| Bus {
        name: name.to_owned(),
        interface,
        divider: divider.unwrap_or(1),
        bit_rate,
        data_bit_rate,
        restart_ms: restart_ms.unwrap_or(const { bus_keys::RESTART_MS.default_number() as u32 }),
        service_frames_per_cycle: service_frames
            .unwrap_or(const { bus_keys::SERVICE_FRAMES.default_number() as usize }),
        sdo_while_enabled,
        command_frames: command_frames.unwrap_or_default(),
    });
    ReadBus {
        name: name.map(str::to_owned),
        bit_rate,
        divider,
        is_line,
        bit_rate_spot: bit_rate_entry.or(interface_entry.filter(|_| is_line)).map(|entry| entry.spot),
        has_automatic_frames: command_frames.is_none() && !is_line,
        bus,
        spot,
        header,
    }
}

/// The bit rate of a line is said once: with the device, or by `bit_rate`.
fn line_bit_rate(device: &SerialDevice, entry: Option<&Entry<'_>>, of_bus: Option<u32>) -> u32 {
    if let (Some(entry), Some(of_bus), Some(of_device)) = (entry, of_bus, device.bit_rate)
        && of_bus != of_device
    {
        rules::line::two_bit_rates(&entry.spot, of_bus, of_device);
    }
    device.bit_rate.or(of_bus).unwrap_or(defaults::LINE_BIT_RATE)
}

fn interface(entry: &Entry<'_>, earlier: &[ReadBus<'_>]) -> Option<Interface> {
    let parsed = entry.text()?.parse();
    let interface: Interface =
        parsed.map_err(|reason| entry.report(ProblemKind::Interface { reason })).ok()?;
    let owner = earlier.iter().find(|other| {
        other.bus.as_ref().is_some_and(|bus| rules::bus::is_same_device(&bus.interface, &interface))
    });
    if let Some(owner) = owner {
        entry.spot.report_against(rules::bus::duplicate_interface(&interface), &owner.header);
    }
    Some(interface)
}

/// A bus may have one cycle in several of the controller's.
fn divider(entry: &Entry<'_>, cycle_ns: u64) -> Option<u32> {
    let cycle_s = cycle_ns as f64 / 1e9;
    let period_ns = entry.nanoseconds(cycle_s..=keys::BUS_PERIOD_AT_MOST_S.max(cycle_s))?;
    if !period_ns.is_multiple_of(cycle_ns) {
        let period = Quantity::DURATION.show(cycle_s);
        entry.report_range(
            Quantity::DURATION.show(period_ns as f64 / 1e9),
            format!("a multiple of the cycle's period, {period}"),
        );
        return None;
    }
    rules::bus::divider(&entry.spot, u32::try_from(period_ns / cycle_ns).ok()?, cycle_ns)
}
