//! `[[bus]]`

use std::ops::Range;

use takt_rt::MAX_BUSES;

use super::entry::{Bounds, Entry, Problems};
use super::machine::boolean;
use super::section::Section;
use crate::config::defaults;
use crate::config::model::{Bus, Interface};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantity::Quantity;

/// The bit rates of CiA 301, 5.3, which every adapter and every drive here divides its clock to.
const CLASSIC_RATES: [f64; 8] = [10e3, 20e3, 50e3, 125e3, 250e3, 500e3, 800e3, 1e6];

/// Longer than anybody waits for a bus.
const RESTART_LIMIT_MS: i64 = 60_000;

/// A bus as far as it could be read.
pub struct ReadBus {
    pub name: Option<String>,
    pub bit_rate: u32,
    /// Cycles of the controller in one of this bus; `None` when its period is wrong.
    pub divider: Option<u32>,
    /// Where the bit rate stands, if it does.
    pub bit_rate_span: Option<Range<usize>>,
    /// `None` when something about it is wrong.
    pub bus: Option<Bus>,
    pub header: Range<usize>,
}

pub fn buses<'a>(sections: Vec<Section<'a>>, cycle_ns: u64, problems: &'a Problems<'a>) -> Vec<ReadBus> {
    let count = sections.len();
    let mut buses: Vec<ReadBus> = Vec::with_capacity(count);
    for section in sections {
        let header = section.header();
        buses.push(bus(section, cycle_ns, &buses, problems));
        if buses.len() == MAX_BUSES + 1 {
            let kind = ProblemKind::TooMany { what: "buses", given: count, limit: MAX_BUSES };
            problems.report(kind, header);
        }
    }
    buses
}

fn bus<'a>(
    mut section: Section<'a>,
    cycle_ns: u64,
    earlier: &[ReadBus],
    problems: &'a Problems<'a>,
) -> ReadBus {
    let header = section.header();
    let name_entry = section.require_own("name", "the name of the bus: name = \"left\"");
    let name = name_entry.as_ref().and_then(|entry| entry.name());
    if let (Some(entry), Some(name)) = (&name_entry, name)
        && let Some(first) = earlier.iter().find(|bus| bus.name.as_deref() == Some(name))
    {
        let kind = ProblemKind::DuplicateName { what: "bus", name: name.to_owned() };
        problems.report_against(kind, entry.span.clone(), first.header.clone());
    }

    let interface_entry = section.get("interface");
    let interface = match &interface_entry {
        None => Some(Interface::Simulated),
        Some(entry) => entry.text().and_then(|text| {
            text.parse().map_err(|reason| entry.report(ProblemKind::Interface { reason })).ok()
        }),
    };
    let owner = earlier.iter().find(|other| {
        let taken = other.bus.as_ref().map(|bus| &bus.interface);
        taken.is_some() && taken == interface.as_ref() && taken != Some(&Interface::Simulated)
    });
    if let (Some(entry), Some(interface), Some(owner)) = (&interface_entry, &interface, owner) {
        let kind = ProblemKind::DuplicateInterface { interface: interface.to_string() };
        problems.report_against(kind, entry.span.clone(), owner.header.clone());
    }

    let bit_rate_entry = section.get("bit_rate");
    let bit_rate = bit_rate_entry.as_ref().and_then(bit_rate).unwrap_or(defaults::BIT_RATE);
    let data_bit_rate = section.get("data_bit_rate").and_then(|entry| {
        entry
            .quantity(Quantity::BIT_RATE, Bounds::Between(bit_rate.into(), 8e6))
            .map(|rate| rate.round() as u32)
    });
    let divider = section.get("period").map_or(Some(1), |entry| divider(&entry, cycle_ns));
    let restart_ms = section.get("restart_ms").and_then(|entry| entry.integer(0..RESTART_LIMIT_MS + 1));
    let service_frames = section.get("service_frames_per_cycle").and_then(|entry| entry.integer(1..33));
    let sdo_while_enabled = boolean(&mut section, "sdo_while_enabled", defaults::SDO_WHILE_ENABLED);
    section.finish();
    let bus = name.zip(interface).map(|(name, interface)| Bus {
        name: name.to_owned(),
        interface,
        divider: divider.unwrap_or(1),
        bit_rate,
        data_bit_rate,
        restart_ms: restart_ms.and_then(|time| u32::try_from(time).ok()).unwrap_or(defaults::RESTART_MS),
        service_frames_per_cycle: service_frames
            .and_then(|frames| usize::try_from(frames).ok())
            .unwrap_or(defaults::SERVICE_FRAMES_PER_CYCLE),
        sdo_while_enabled,
    });
    ReadBus {
        name: name.map(str::to_owned),
        bit_rate,
        divider,
        bit_rate_span: bit_rate_entry.map(|entry| entry.span),
        bus,
        header,
    }
}

/// A bus may have one cycle in several of the controller's.
fn divider(entry: &Entry<'_>, cycle_ns: u64) -> Option<u32> {
    let period_ns = entry.nanoseconds(cycle_ns as f64 / 1e9, 0.1)?;
    if !period_ns.is_multiple_of(cycle_ns) {
        let period = Quantity::DURATION.show(cycle_ns as f64 / 1e9);
        entry.report_range(
            Quantity::DURATION.show(period_ns as f64 / 1e9),
            format!("a multiple of the cycle's period, {period}"),
        );
        return None;
    }
    u32::try_from(period_ns / cycle_ns).ok()
}

fn bit_rate(entry: &Entry<'_>) -> Option<u32> {
    let rate = entry.quantity(Quantity::BIT_RATE, Bounds::Positive)?;
    if !CLASSIC_RATES.iter().any(|allowed| (allowed - rate).abs() < 1.0) {
        let allowed = CLASSIC_RATES.map(|rate| Quantity::BIT_RATE.show(rate)).join(", ");
        entry.report_range(Quantity::BIT_RATE.show(rate), allowed);
        return None;
    }
    Some(rate.round() as u32)
}
