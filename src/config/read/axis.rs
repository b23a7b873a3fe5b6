//! `[[axis]]`, with `[defaults.axis]` behind each of them.

use std::ops::Range;

use takt_rt::MAX_AXES;

use super::bus::ReadBus;
use super::control::control;
use super::entry::{Bounds, Entry, Problems};
use super::limits::{contains, following_error, limits, show_range};
use super::machine::{boolean, heartbeat, node};
use super::section::Section;
use super::travel::{Counting, Quantities, counting, travel};
use crate::canopen::dcf::DeviceConfiguration;
use crate::config::defaults;
use crate::config::model::{
    Axis, Control, DriveFamily, Feedback, Identity, Limits, Master, OnViolation, PdoMapping, SimulatedJoint,
    Travel,
};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantity::Quantity;
use crate::config::spelling;
use crate::drive::yz_aim;

/// The families of drives by their words.
const DRIVES: [(&str, DriveFamily); 2] = [
    (DriveFamily::ErobCanopen.word(), DriveFamily::ErobCanopen),
    (DriveFamily::YzAim.word(), DriveFamily::YzAim),
];

/// An axis as far as it could be read.
pub struct ReadAxis {
    pub name: Option<String>,
    pub quantities: Quantities,
    pub limits: Option<Limits>,
    /// `None` when something about it is wrong.
    pub axis: Option<Axis>,
    place: Option<(usize, u8)>,
    header: Range<usize>,
}

pub fn axes<'a>(
    sections: Vec<Section<'a>>,
    buses: &[ReadBus],
    cycle_ns: u64,
    master: &Master,
    problems: &'a Problems<'a>,
) -> Vec<ReadAxis> {
    let count = sections.len();
    let mut axes: Vec<ReadAxis> = Vec::with_capacity(count);
    for section in sections {
        let header = section.header();
        axes.push(axis(section, buses, cycle_ns, master, &axes, problems));
        if axes.len() == MAX_AXES + 1 {
            problems.report(ProblemKind::TooMany { what: "axes", given: count, limit: MAX_AXES }, header);
        }
    }
    axes
}

fn axis<'a>(
    mut section: Section<'a>,
    buses: &[ReadBus],
    cycle_ns: u64,
    master: &Master,
    earlier: &[ReadAxis],
    problems: &'a Problems<'a>,
) -> ReadAxis {
    let header = section.header();
    let name = section.require_own("name", "the name of the axis: name = \"joint1\"").and_then(|entry| {
        let name = entry.name()?.to_owned();
        if let Some(first) = earlier.iter().find(|axis| axis.name.as_ref() == Some(&name)) {
            let kind = ProblemKind::DuplicateName { what: "axis", name: name.clone() };
            problems.report_against(kind, entry.span.clone(), first.header.clone());
        }
        Some(name)
    });
    let bus = section.require("bus", "the name of its bus").and_then(|entry| bus_index(&entry, buses));
    let node = section.require_own("node", "its node number, 1 to 127").and_then(|entry| {
        let node = node(&entry)?;
        check_node(&entry, node, bus, buses, master, earlier, problems);
        Some(node)
    });
    let drive = section
        .require("drive", "the family of the drive: drive = \"erob-canopen\"")
        .and_then(|entry| entry.choice(&DRIVES));
    check_bit_rate(drive, bus.and_then(|bus| buses.get(bus)), problems);

    let travel = travel(&mut section);
    let quantities = Quantities::of(travel.unwrap_or(Travel::Rotary));
    let counting = counting(&mut section, drive);
    let limits = limits(section.section("limits"), quantities, travel, &counting);
    let following_error = following_error(section.section("following_error"), quantities);
    let simulated = simulated(section.section("simulated"), quantities, limits.as_ref(), name.as_deref());
    let control = control(&mut section, drive, quantities, &simulated);
    if drive == Some(DriveFamily::YzAim) {
        check_period(control, bus.and_then(|bus| buses.get(bus)), cycle_ns, problems);
        check_speed(&section, limits.as_ref(), &counting, travel, quantities);
    }
    let mapping = mapping(&mut section, drive);
    let feedback = feedback(&mut section, drive, mapping);
    let answers_sync = boolean(&mut section, "answers_sync", defaults::ANSWERS_SYNC);
    let transmission_type = transmission_type(&mut section);
    let start_tolerance = section
        .get("start_tolerance")
        .and_then(|entry| entry.quantity(quantities.position, Bounds::Positive));
    let on_violation = section
        .get("on_violation")
        .and_then(|entry| entry.choice(&[("reject", OnViolation::Reject), ("clamp", OnViolation::Clamp)]));
    let missed = section.get("missed_feedback_cycles").and_then(|entry| entry.integer(1..1001));
    let feedback_delay = section.get("feedback_delay").and_then(|entry| entry.nanoseconds(0.0, 0.01));
    let heartbeat_ns = section.get("heartbeat").and_then(|entry| heartbeat(&entry));
    let identity = identity(section.section("identity"), drive);
    let dcf = section.get("dcf").and_then(|entry| dcf(&entry, node));
    section.finish();

    let place = bus.zip(node);
    let build = || {
        let (bus, node) = place?;
        Some(Axis {
            name: name.clone()?,
            bus,
            node,
            drive: drive?,
            control: control?,
            travel: travel?,
            counts_per_turn: counting.counts_per_turn,
            gear_ratio: counting.gear_ratio,
            reversed: counting.reversed,
            zero_counts: counting.zero_counts,
            limits: limits?,
            following_error,
            start_tolerance: start_tolerance.unwrap_or(match travel? {
                Travel::Rotary => defaults::START_TOLERANCE_RAD,
                Travel::Linear { .. } => defaults::START_TOLERANCE_M,
            }),
            on_violation: on_violation.unwrap_or_default(),
            missed_feedback_cycles: missed
                .and_then(|cycles| u16::try_from(cycles).ok())
                .unwrap_or(defaults::MISSED_FEEDBACK_CYCLES),
            transmission_type,
            mapping,
            feedback,
            answers_sync,
            feedback_delay_ns: feedback_delay.unwrap_or(defaults::FEEDBACK_DELAY_NS),
            heartbeat_ns,
            identity,
            dcf,
            simulated,
        })
    };
    let axis = build();
    ReadAxis { name, quantities, limits, axis, place, header }
}

fn bus_index(entry: &Entry<'_>, buses: &[ReadBus]) -> Option<usize> {
    let given = entry.text()?;
    let found = buses.iter().position(|bus| bus.name.as_deref() == Some(given));
    if found.is_none() && buses.iter().all(|bus| bus.name.is_some()) {
        let known: Vec<String> = buses.iter().filter_map(|bus| bus.name.clone()).collect();
        let nearest = spelling::nearest(given, known.iter().map(String::as_str)).map(str::to_owned);
        entry.report(ProblemKind::UnknownBus { name: given.to_owned(), nearest, known });
    }
    found
}

fn check_node(
    entry: &Entry<'_>,
    node: u8,
    bus: Option<usize>,
    buses: &[ReadBus],
    master: &Master,
    earlier: &[ReadAxis],
    problems: &Problems<'_>,
) {
    let Some(bus) = bus else { return };
    let bus_name = buses.get(bus).and_then(|bus| bus.name.clone()).unwrap_or_default();
    let kind = ProblemKind::DuplicateNode { bus: bus_name, node };
    if let Some(first) = earlier.iter().find(|axis| axis.place == Some((bus, node))) {
        problems.report_against(kind, entry.span.clone(), first.header.clone());
    } else if node == master.node {
        entry.report(kind);
    }
}

/// An eRob knows one bit rate (eRunner manual, section 1 of the specification), a YZ-AIM four (manual, 5.13).
fn check_bit_rate(drive: Option<DriveFamily>, bus: Option<&ReadBus>, problems: &Problems<'_>) {
    let (rates, allowed): (&[u32], _) = match drive {
        Some(DriveFamily::ErobCanopen) => {
            (&[1_000_000], "1 Mbit/s, the one bit rate of the eRobs on this bus")
        }
        Some(DriveFamily::YzAim) => (
            &[125_000, 250_000, 500_000, 1_000_000],
            "125, 250 or 500 kbit/s or 1 Mbit/s, the bit rates of the YZ-AIMs on this bus",
        ),
        None => return,
    };
    if let Some(bus) = bus.filter(|bus| !rates.contains(&bus.bit_rate))
        && let Some(span) = bus.bit_rate_span.clone()
    {
        let (key, value) = ("bus.bit_rate".to_owned(), Quantity::BIT_RATE.show(bus.bit_rate.into()));
        problems.report(ProblemKind::OutOfRange { key, value, allowed: allowed.to_owned() }, span);
    }
}

/// A YZ-AIM interpolates from target to target in 2 ms (manual, 5.10.3).
fn check_period(control: Option<Control>, bus: Option<&ReadBus>, cycle_ns: u64, problems: &Problems<'_>) {
    let (Some(Control::Interpolated), Some(bus)) = (control, bus) else { return };
    let Some(divider) = bus.divider else { return };
    let period_ns = cycle_ns * u64::from(divider);
    if period_ns != yz_aim::INTERPOLATION_PERIOD_NS {
        let (key, value) = ("bus.period".to_owned(), Quantity::DURATION.show(period_ns as f64 / 1e9));
        let allowed = "2 ms, the period of a YZ-AIM that interpolates: period = \"2 ms\"".to_owned();
        problems.report(ProblemKind::OutOfRange { key, value, allowed }, bus.header.clone());
    }
}

/// Objects 6081 and 60FF of a YZ-AIM end at 3000 r/min of the motor.
fn check_speed(
    section: &Section<'_>,
    limits: Option<&Limits>,
    counting: &Counting,
    travel: Option<Travel>,
    q: Quantities,
) {
    let Some(limits) = limits else { return };
    let turns_per_unit = counting.counts_per_unit(travel) / counting.counts_per_turn;
    let highest = yz_aim::HIGHEST_SPEED_RPM / 60.0 / turns_per_unit;
    if limits.velocity > highest * (1.0 + 1e-9) {
        let allowed = format!("at most {}, 3000 r/min of the motor", q.velocity.show(highest));
        section.report_default_out_of_range("limits.velocity", q.velocity.show(limits.velocity), allowed);
    }
}

fn simulated(
    mut section: Section<'_>,
    q: Quantities,
    limits: Option<&Limits>,
    name: Option<&str>,
) -> SimulatedJoint {
    let mut value = |key, quantity, bounds| {
        section.get(key).and_then(|entry: Entry<'_>| entry.quantity(quantity, bounds))
    };
    let inertia = value("inertia", q.inertia, Bounds::Positive);
    let viscous_friction = value("viscous_friction", q.damping, Bounds::NotNegative);
    let coulomb_friction = value("coulomb_friction", q.effort, Bounds::NotNegative);
    let rated_torque = value("rated_torque", q.effort, Bounds::Positive);
    let peak_torque = value("peak_torque", q.effort, Bounds::Positive);
    let power_up_ns = section.get("power_up").and_then(|entry| entry.nanoseconds(0.0, 60.0));
    let initial = section.get("initial_position").and_then(|entry| {
        let position = entry.quantity(q.position, Bounds::Finite)?;
        if let Some(limits) = limits.filter(|limits| !contains(limits, position)) {
            entry.report(ProblemKind::InitialPositionOutsideLimits {
                axis: name.unwrap_or_default().to_owned(),
                value: q.position.show(position),
                allowed: show_range(limits, q),
            });
        }
        Some(position)
    });
    section.finish();
    let torque_limit = limits.map_or(1.0, |limits| limits.torque);
    let rated_torque = rated_torque.unwrap_or(torque_limit);
    SimulatedJoint {
        inertia: inertia.unwrap_or(defaults::INERTIA),
        viscous_friction: viscous_friction.unwrap_or(defaults::VISCOUS_FRICTION),
        coulomb_friction: coulomb_friction.unwrap_or(defaults::COULOMB_FRICTION),
        rated_torque,
        peak_torque: peak_torque.unwrap_or(defaults::PEAK_TO_RATED_TORQUE * rated_torque),
        initial_position: initial.unwrap_or_else(|| {
            limits.map_or(0.0, |limits| 0.0_f64.max(limits.position_min).min(limits.position_max))
        }),
        power_up_ns: power_up_ns.unwrap_or(defaults::POWER_UP_NS),
    }
}

fn mapping(section: &mut Section<'_>, drive: Option<DriveFamily>) -> PdoMapping {
    let is_fixed = drive == Some(DriveFamily::YzAim);
    let choices = [("written", PdoMapping::Written), ("as-stored", PdoMapping::AsStored)];
    let read = section.get("mapping").and_then(|entry| {
        let mapping = entry.choice(&choices)?;
        if is_fixed && mapping == PdoMapping::Written {
            let allowed = "as-stored, since the PDOs of a YZ-AIM are fixed".to_owned();
            entry.report_range("written".to_owned(), allowed);
        }
        Some(mapping)
    });
    read.unwrap_or(if is_fixed { PdoMapping::AsStored } else { PdoMapping::Written })
}

/// A drive whose PDOs are written reports its mode of operation unless another list is given: nothing else tells that
/// somebody has changed it.
fn feedback(section: &mut Section<'_>, drive: Option<DriveFamily>, mapping: PdoMapping) -> Vec<Feedback> {
    let choices = Feedback::ALL.map(|feedback| (feedback.word(), feedback));
    let Some(entry) = section.get("feedback") else {
        return if mapping == PdoMapping::Written { vec![Feedback::OperationMode] } else { vec![] };
    };
    let mut feedback = vec![];
    for entry in entry.list().into_iter().flatten() {
        let Some(object) = entry.choice(&choices) else { continue };
        if drive == Some(DriveFamily::YzAim) {
            let given = entry.text().unwrap_or_default().to_owned();
            entry.report_range(given, "nothing, since the PDOs of a YZ-AIM are fixed".to_owned());
        }
        if feedback.contains(&object) {
            let given = entry.text().unwrap_or_default().to_owned();
            entry.report(ProblemKind::Repeated { key: entry.path.clone(), given });
        } else {
            feedback.push(object);
        }
    }
    feedback
}

/// 1 to 240: every so many SYNCs; 254 and 255: on the drive's own events (CiA 301, 7.5.2.36 and 7.5.2.38).
fn transmission_type(section: &mut Section<'_>) -> u8 {
    let read = section.get("transmission_type").and_then(|entry| {
        let value = u8::try_from(entry.integer(1..256)?).ok()?;
        if matches!(value, 241..=253) {
            entry.report_range(value.to_string(), "1 to 240 (SYNC), 254 or 255 (event)".to_owned());
        }
        Some(value)
    });
    read.unwrap_or(defaults::TRANSMISSION_TYPE)
}

fn dcf(entry: &Entry<'_>, node: Option<u8>) -> Option<DeviceConfiguration> {
    let path = entry.path_from_file()?;
    DeviceConfiguration::load(&path, node?).map_err(|reason| entry.report(ProblemKind::Dcf { reason })).ok()
}

fn identity(mut section: Section<'_>, drive: Option<DriveFamily>) -> Identity {
    let default = match drive {
        Some(DriveFamily::ErobCanopen) => defaults::EROB_IDENTITY,
        Some(DriveFamily::YzAim) => defaults::YZ_AIM_IDENTITY,
        None => Identity::default(),
    };
    let mut value = |key, default| match section.get(key) {
        None => default,
        Some(entry) if entry.is_word("any") => None,
        Some(entry) => entry.integer(0..1 << 32).and_then(|value| u32::try_from(value).ok()),
    };
    let identity = Identity {
        device_type: value("device_type", default.device_type),
        vendor: value("vendor", default.vendor),
        product: value("product", default.product),
        revision: value("revision", default.revision),
    };
    section.finish();
    identity
}
