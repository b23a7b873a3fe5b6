//! The buses.

use takt_rt::slcan::DataBitRate;
use takt_rt::{EngineParameters, MAX_BUSES};

use super::{Fields, name};
use crate::config::bounds::Bounds;
use crate::config::keys;
use crate::config::model::{Config, Interface};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantity::Quantity;
use crate::config::spot::Spot;

pub fn validate(config: &Config, whole: &Fields<'_>) {
    let buses = &config.buses;
    if buses.is_empty() {
        let says = "at least one [[bus]]";
        whole.at("bus").report(ProblemKind::MissingKey { key: "bus".to_owned(), says: says.into() });
    }
    if buses.len() > MAX_BUSES {
        whole.at("bus").report(too_many(buses.len()));
        return;
    }
    for (index, bus) in buses.iter().enumerate() {
        let fields = whole.element("bus", "buses", index, &bus.name);
        let earlier = buses.get(..index).unwrap_or_default();
        name(&fields.at("name"), &bus.name);
        if earlier.iter().any(|other| other.name == bus.name) {
            fields.at("name").report(duplicate_name(&bus.name));
        }
        interface(&fields.at("interface"), &bus.interface);
        if earlier.iter().any(|other| is_same_device(&other.interface, &bus.interface)) {
            fields.at("interface").report(duplicate_interface(&bus.interface));
        }
        divider(&fields.at("period"), bus.divider, config.cycle.period_ns);
        if config.is_serial_line(index) {
            super::line::validate(bus, &fields);
            continue;
        }
        bit_rate(&fields.at("bit_rate"), f64::from(bus.bit_rate));
        if let Some(rate) = bus.data_bit_rate {
            data_bit_rate(&fields.at("data_bit_rate"), f64::from(rate), bus.bit_rate, &bus.interface);
        }
        fields.integer(&keys::bus::RESTART_MS, bus.restart_ms);
        fields.integer(&keys::bus::SERVICE_FRAMES, bus.service_frames_per_cycle);
    }
}

pub fn too_many(given: usize) -> ProblemKind {
    ProblemKind::TooMany { what: "buses", given, limit: MAX_BUSES }
}

pub fn duplicate_name(name: &str) -> ProblemKind {
    ProblemKind::DuplicateName { what: "bus", name: name.to_owned() }
}

pub fn duplicate_interface(interface: &Interface) -> ProblemKind {
    ProblemKind::DuplicateInterface { interface: interface.to_string() }
}

/// Simulated buses are each a bus of their own.
pub fn is_same_device(one: &Interface, other: &Interface) -> bool {
    match (one, other) {
        (
            Interface::Slcan(one) | Interface::Converter(one),
            Interface::Slcan(other) | Interface::Converter(other),
        ) => one.device == other.device,
        (Interface::Serial(one), Interface::Serial(other)) => one.device == other.device,
        (Interface::Slcan(one) | Interface::Converter(one), Interface::Serial(other))
        | (Interface::Serial(other), Interface::Slcan(one) | Interface::Converter(one)) => {
            one.device == other.device
        }
        _ => one == other && *one != Interface::Simulated,
    }
}

/// A name that was set in code is one that could have been read.
fn interface(spot: &Spot<'_>, interface: &Interface) {
    let given = match interface {
        Interface::Simulated => return,
        Interface::SocketCan(name) => name.clone(),
        Interface::Slcan(_) | Interface::Converter(_) | Interface::Serial(_) => interface.to_string(),
    };
    match given.parse::<Interface>() {
        Ok(parsed) if parsed == *interface => {}
        Ok(_) => {
            spot.report_range(format!("{given:?}"), "what Interface::from_str makes of this text".to_owned())
        }
        Err(reason) => spot.report(ProblemKind::Interface { reason }),
    }
}

/// A bus has one cycle in one or several of the controller's, in as many as the engine can wait.
pub fn divider(spot: &Spot<'_>, divider: u32, cycle_ns: u64) -> Option<u32> {
    let period_ns = cycle_ns.saturating_mul(divider.into());
    let cycle_s = cycle_ns as f64 / 1e9;
    let most = <EngineParameters>::LARGEST_DIVIDER;
    if divider > most {
        let show = |ns: u64| Quantity::DURATION.show(ns as f64 / 1e9);
        let longest_ns = cycle_ns.saturating_mul(most.into());
        let allowed = format!("{} to {}: {most} cycles at most", show(cycle_ns), show(longest_ns));
        spot.report_range(show(period_ns), allowed);
        return None;
    }
    spot.duration(period_ns, cycle_s..=keys::BUS_PERIOD_AT_MOST_S.max(cycle_s)).map(|_| divider)
}

pub fn bit_rate(spot: &Spot<'_>, rate: f64) -> Option<u32> {
    let found = keys::BIT_RATES.into_iter().find(|allowed| (f64::from(*allowed) - rate).abs() < 1.0);
    if found.is_none() {
        let allowed = keys::BIT_RATES.map(|rate| Quantity::BIT_RATE.show(rate.into())).join(", ");
        spot.report_range(Quantity::BIT_RATE.show(rate), allowed);
    }
    found
}

/// The data phase is at least as fast as the arbitration phase. An SLCAN adapter has some bit rates alone.
pub fn data_bit_rate(spot: &Spot<'_>, rate: f64, bit_rate: u32, interface: &Interface) -> Option<u32> {
    let bounds = Bounds::Between(bit_rate.into(), keys::DATA_BIT_RATE_AT_MOST);
    let rate = spot.quantity(rate, Quantity::BIT_RATE, bounds).map(|rate| rate.round() as u32)?;
    if matches!(interface, Interface::Slcan(_)) && DataBitRate::of(rate).is_none() {
        let show = |rate: u32| Quantity::BIT_RATE.show(rate.into());
        let allowed = DataBitRate::all().map(show).join(", ");
        spot.report_range(show(rate), format!("a bit rate that SLCAN adapters have: {allowed}"));
        return None;
    }
    Some(rate)
}
