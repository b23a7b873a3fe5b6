//! `[[axis]]`, with `[defaults.axis]` behind each of them.

use std::ops::Range;

use takt_rt::MAX_AXES;
use takt_wire::canopen::dcf::DeviceConfiguration;

use super::bus::ReadBus;
use super::control::modes;
use super::entry::Entry;
use super::limits::{ReadLimits, following_error, limits};
use super::machine::heartbeat;
use super::section::Section;
use super::travel::{counting, travel};
use super::urdf::{DescribedJoint, Description};
use crate::config::configured_family::{ConfiguredFamily, FamilyKeys};
use crate::config::defaults;
use crate::config::drive_family::{DriveFacts, DriveFamily, Protocol};
use crate::config::keys::{self, axis as axis_keys, identity as identity_keys, joint as joint_keys};
use crate::config::model::{
    Axis, FeedForward, Feedback, Follow, FrictionShape, Identity, Interface, Joint, Limits, PdoMapping,
    PowerUpState, SimulatedJoint, Travel,
};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantities::Quantities;
use crate::config::quantity::Quantity;
use crate::config::rules;
use crate::config::rules::loops::Surroundings;
use crate::config::rules::program::AxisView;

/// An axis as far as it could be read.
pub struct ReadAxis {
    pub name: Option<String>,
    pub quantities: Quantities,
    pub limits: Option<Limits>,
    /// `None` when something about it is wrong.
    pub axis: Option<Axis>,
    place: Option<(usize, u8)>,
    drive: Option<DriveFamily>,
    header: Range<usize>,
    dcf: Range<usize>,
}

impl ReadAxis {
    /// The bytes of its `dcf`, or else of its header.
    pub fn dcf(&self) -> Range<usize> {
        self.dcf.clone()
    }

    /// The bytes of its header.
    pub fn header(&self) -> Range<usize> {
        self.header.clone()
    }

    /// What a move needs to know of it.
    pub fn view(&self) -> AxisView<'_> {
        AxisView {
            name: self.name.as_deref().unwrap_or_default(),
            quantities: self.quantities,
            limits: self.limits.as_ref(),
            control: self.axis.as_ref().map(|axis| axis.control),
        }
    }
}

/// What the axes need of the rest of the file.
pub struct Machine<'a> {
    pub buses: &'a [ReadBus<'a>],
    pub cycle_ns: u64,
    pub master_node: u8,
    /// The families that a drive may be of.
    pub families: &'a [&'static dyn ConfiguredFamily],
    /// The robot description.
    pub urdf: &'a Description,
}

impl Machine<'_> {
    fn bus(&self, bus: Option<usize>) -> Option<&ReadBus<'_>> {
        self.buses.get(bus?)
    }

    /// The period of a bus; `None` when it could not be read.
    fn period_ns(&self, bus: Option<usize>) -> Option<u64> {
        Some(self.cycle_ns * u64::from(self.bus(bus)?.divider?))
    }
}

/// The axes, but no more than one beyond those that a controller can have: the rest are only counted.
pub fn axes(sections: Vec<Section<'_>>, machine: &Machine<'_>) -> Vec<ReadAxis> {
    let count = sections.len();
    let mut axes: Vec<ReadAxis> = Vec::with_capacity(MAX_AXES + 1);
    for section in sections.into_iter().take(MAX_AXES + 1) {
        let spot = section.header_spot();
        let read = axis(section, machine, &axes);
        axes.push(read);
        if axes.len() > MAX_AXES {
            spot.report(rules::axis::too_many(count));
        }
    }
    axes
}

fn axis(mut section: Section<'_>, machine: &Machine<'_>, earlier: &[ReadAxis]) -> ReadAxis {
    let header = section.header();
    let name = section.require_own("name", "the name of the axis: name = \"joint1\"").and_then(|entry| {
        let name = entry.name()?.to_owned();
        if let Some(first) = earlier.iter().find(|axis| axis.name.as_ref() == Some(&name)) {
            entry.spot.report_against(rules::axis::duplicate_name(&name), &first.header);
        }
        Some(name)
    });
    let bus =
        section.require("bus", "the name of its bus").and_then(|entry| bus_index(&entry, machine.buses));
    let node_entry = section.require_own(axis_keys::NODE.name, "its node ID, 1 to 127");
    let families: Vec<_> = machine.families.iter().map(|family| (family.word(), *family)).collect();
    let example = families.first().map_or("", |(word, _)| word);
    let family = section
        .require("drive", format!("the family of the drive: drive = \"{example}\""))
        .and_then(|entry| entry.choice(&families));
    let mut simulated_section = section.section("simulated");
    let family_drive =
        family.and_then(|family| family.read(&mut FamilyKeys::of(&mut section, &mut simulated_section)));
    let drive = family_drive.as_deref();
    let node = node_entry.as_ref().and_then(|entry| match drive {
        Some(drive) if drive.protocol.is_of_serial_line() => {
            entry.integer(keys::LINE_ADDRESSES).and_then(|address| u8::try_from(address).ok())
        }
        _ => entry.integer(keys::master::NODE.integers()).and_then(|node| u8::try_from(node).ok()),
    });
    if let Some((drive, read)) = drive.zip(machine.bus(bus).filter(|read| read.bus.is_some())) {
        let name = read.name.as_deref().unwrap_or_default();
        rules::line::place(&section.spot("drive"), &section.spot("bus"), drive, name, read.is_line);
        let mut on_line = earlier.iter().filter(|other| other.place.map(|(bus, _)| bus) == bus);
        let first = on_line
            .find_map(|other| other.drive.as_deref().filter(|first| first.protocol.is_of_serial_line()));
        if let Some(first) = first {
            rules::line::one_protocol(&section.spot("drive"), drive, first);
        }
    }
    if let Some((entry, node)) = node_entry.as_ref().zip(node) {
        check_node(entry, node, drive, bus, machine, earlier);
    }
    if let Some((drive, bus)) = drive.zip(machine.bus(bus))
        && let Some(spot) = &bus.bit_rate_spot
    {
        rules::axis::bit_rate(spot, drive, bus.bit_rate);
    }

    let travel = travel(&mut section);
    let q = Quantities::of(travel.unwrap_or(Travel::Rotary));
    let counting = counting(&mut section, drive, travel);
    let described = DescribedJoint::of(&mut section, machine.urdf, name.as_deref(), travel);
    let limits_section = section.section("limits");
    let ReadLimits { limits, shown_in, urdf } =
        limits(limits_section, q, travel.unwrap_or(Travel::Rotary), counting.as_ref(), &described);
    let following_error = following_error(section.section("following_error"), q, travel);
    let power_up = section.nanoseconds(&axis_keys::POWER_UP);
    let mut joint_section = section.section("joint");
    let joint = joint(&mut joint_section, q);
    let rated_torque = joint.rated_torque.or(limits.map(|limits| limits.torque)).unwrap_or(1.0);
    let simulated = simulated(simulated_section, q, limits.as_ref(), rated_torque, drive, name.as_deref());
    let transmission_type = transmission_type(&mut section);
    let period_ns = machine.period_ns(bus);
    let surroundings = period_ns.map(|period_ns| {
        let interface = machine.bus(bus).and_then(|bus| bus.bus.as_ref()).map(|bus| &bus.interface);
        let is_simulated = interface == Some(&Interface::Simulated);
        Surroundings::new(period_ns, transmission_type, joint.inertia(), is_simulated)
    });
    let modes = modes(&mut section, drive, q, &joint, surroundings.as_ref());
    let control = modes.as_ref().map(|modes| modes.control);
    if let (Some(modes), Some(surroundings)) = (&modes, &surroundings) {
        let is_simulated = surroundings.is_simulated();
        rules::axis::joint(&modes.all(), &joint, is_simulated, |key| joint_section.spot(key));
    }
    joint_section.finish();
    if let Some(drive) = drive {
        if let (Some(control), Some(period_ns), Some(bus)) = (control, period_ns, machine.bus(bus)) {
            rules::axis::interpolation_period(&bus.spot, drive, control, period_ns);
        }
        if let (Some(limits), Some(counting)) = (&limits, &counting) {
            let spot = section.section("limits").spot("velocity");
            rules::axis::motor_speed(&spot, drive, limits, counting, q);
        }
    }
    let mapping = mapping(&mut section, drive);
    let feedback = feedback(&mut section, drive, mapping);
    let feed_forward = feed_forward(&mut section, drive);
    let answers_sync = section.boolean(&axis_keys::ANSWERS_SYNC);
    let start_tolerance = section.quantity(&axis_keys::START_TOLERANCE, q);
    let target_tolerance = section.quantity(&axis_keys::TARGET_TOLERANCE, q);
    let follow = section
        .get(axis_keys::FOLLOW.name)
        .and_then(|entry| entry.choice(&[("smooth", Follow::Smooth), ("exact", Follow::Exact)]));
    let missed = missed_feedback(&mut section, drive, period_ns);
    let feedback_delay = section.nanoseconds(&axis_keys::FEEDBACK_DELAY);
    let heartbeat_ns = section.keyed(&axis_keys::HEARTBEAT).and_then(|entry| heartbeat(&entry));
    let identity = identity(section.section("identity"), drive);
    let dcf = section.get(axis_keys::DCF.name).and_then(|entry| dcf(&entry, node));

    let place = bus.zip(node);
    let build = || {
        let (bus, node) = place?;
        let (travel, modes, counting) = (travel?, modes?, counting?);
        let controls = modes.all();
        Some(Axis {
            name: name.clone()?,
            bus,
            node,
            drive: family_drive.clone()?,
            control: modes.control,
            other_modes: modes.others,
            travel,
            counts_per_turn: counting.counts_per_turn,
            gear_ratio: counting.gear_ratio,
            reversed: counting.reversed,
            zero_counts: counting.zero_counts,
            limits: limits?,
            urdf,
            shown_in,
            compliance: modes.compliance,
            feed_forward,
            following_error,
            start_tolerance: start_tolerance.unwrap_or(defaults::start_tolerance(travel)),
            target_tolerance: target_tolerance
                .unwrap_or_else(|| defaults::target_tolerance(travel, &controls)),
            follow: follow.unwrap_or_default(),
            missed_feedback_cycles: missed
                .unwrap_or(const { axis_keys::MISSED_FEEDBACK_CYCLES.default_number() as u16 }),
            transmission_type,
            mapping,
            feedback,
            answers_sync,
            feedback_delay_ns: feedback_delay.unwrap_or(const { axis_keys::FEEDBACK_DELAY.default_ns() }),
            heartbeat_ns,
            identity,
            dcf,
            power_up_ns: power_up.unwrap_or(const { axis_keys::POWER_UP.default_ns() }),
            joint,
            simulated,
        })
    };
    let axis = build();
    if let Some(axis) = &axis {
        let at = |key: &str| section.spot(key);
        let read_bus = machine.bus(bus).and_then(|bus| bus.bus.as_ref());
        rules::bit_fields::axis(axis, read_bus, at);
        let before = earlier.iter().filter_map(|other| other.axis.as_ref());
        rules::converter::axis(axis, before, read_bus.map(|bus| &bus.interface), at);
        let others = earlier.iter().filter_map(|other| Some((other.axis.as_ref()?, Some(&other.header))));
        rules::identifiers::axis(axis, others, machine.master_node, at);
    }
    let dcf = section.spot("dcf").span().unwrap_or_else(|| header.clone());
    section.finish();
    ReadAxis { name, quantities: q, limits, axis, place, drive: family_drive, header, dcf }
}

/// For how many cycles of its bus feedback may be missing: the number, or the cycles of a time.
fn missed_feedback(
    section: &mut Section<'_>,
    drive: Option<&DriveFacts>,
    period_ns: Option<u64>,
) -> Option<u16> {
    let cycles = section.keyed(&axis_keys::MISSED_FEEDBACK_CYCLES);
    let Some(time) = section.get(axis_keys::MISSED_FEEDBACK_TIME.name) else {
        return cycles?.integer();
    };
    let key = time.spot.key.clone();
    if cycles.is_some() {
        let belongs = "both say for how long feedback may be missing: keep one of them";
        time.report(ProblemKind::Ignored { key, beside: "missed_feedback_cycles", belongs });
        return None;
    }
    let is_off_cycle = |drive: &DriveFacts| matches!(drive.protocol, Protocol::Own(_) | Protocol::SerialLine);
    if drive.is_some_and(is_off_cycle) {
        let belongs =
            "`missed_feedback_cycles` counts the reports of a drive that is spoken to beside the cycle";
        time.report(ProblemKind::Ignored { key, beside: "drive", belongs });
        return None;
    }
    let period_ns = period_ns?.max(1);
    let cycle_s = period_ns as f64 / 1e9;
    let most = (axis_keys::MISSED_FEEDBACK_CYCLES.integers().end - 1) as f64;
    let time_ns = time.nanoseconds(cycle_s..=most * period_ns as f64 / 1e9)?;
    u16::try_from(time_ns / period_ns).ok()
}

fn bus_index(entry: &Entry<'_>, buses: &[ReadBus<'_>]) -> Option<usize> {
    let given = entry.text()?;
    let found = buses.iter().position(|bus| bus.name.as_deref() == Some(given));
    if found.is_none() && buses.iter().all(|bus| bus.name.is_some()) {
        let known: Vec<&str> = buses.iter().filter_map(|bus| bus.name.as_deref()).collect();
        entry.report(rules::axis::unknown_bus(given, &known));
    }
    found
}

fn check_node(
    entry: &Entry<'_>,
    node: u8,
    drive: Option<&DriveFacts>,
    bus: Option<usize>,
    machine: &Machine<'_>,
    earlier: &[ReadAxis],
) {
    if let Some(drive) = drive {
        rules::axis::own_node(&entry.spot, drive, node);
    }
    let Some(bus) = bus else { return };
    for other in earlier {
        if let (Some(drive), Some(theirs), Some((other_bus, other_node))) =
            (drive, other.drive.as_deref(), other.place)
            && other_bus == bus
            && other_node != node
            && let Some(kind) =
                rules::axis::shared_identifier(&entry.spot, (drive, node), (theirs, other_node))
        {
            entry.spot.report_against(kind, &other.header);
        }
    }
    let bus_name = machine.bus(Some(bus)).and_then(|bus| bus.name.as_deref()).unwrap_or_default();
    let kind = rules::axis::duplicate_node(bus_name, node);
    let is_other = |axis: &&ReadAxis| {
        let both = axis.drive.as_deref().zip(drive);
        !both.is_some_and(|(first, second)| rules::axis::are_of_one_node(first, second))
    };
    if let Some(first) = earlier.iter().filter(|axis| axis.place == Some((bus, node))).find(is_other) {
        entry.spot.report_against(kind, &first.header);
    } else if node == machine.master_node && !drive.is_some_and(|drive| drive.protocol.is_of_serial_line()) {
        entry.report(kind);
    }
}

fn joint(section: &mut Section<'_>, q: Quantities) -> Joint {
    Joint {
        inertia: section.quantity(&joint_keys::INERTIA, q),
        viscous_friction: section.quantity(&joint_keys::VISCOUS_FRICTION, q),
        coulomb_friction: section.quantity(&joint_keys::COULOMB_FRICTION, q),
        rated_torque: section.quantity(&joint_keys::RATED_TORQUE, q),
    }
}

fn simulated(
    mut section: Section<'_>,
    q: Quantities,
    limits: Option<&Limits>,
    rated_torque: f64,
    drive: Option<&DriveFacts>,
    name: Option<&str>,
) -> SimulatedJoint {
    use keys::simulated::{FRICTION_SHAPE, GRAVITY, INITIAL_POSITION, PEAK_TORQUE, POWER_UP};

    let gravity = section.quantity(&GRAVITY, q);
    let peak_torque = section.quantity(&PEAK_TORQUE, q);
    let initial = section.get(INITIAL_POSITION.name).and_then(|entry| {
        let position = entry.unbounded(q.position)?;
        let name = name.unwrap_or_default();
        rules::simulation::initial_position(&entry.spot, position, q, limits, name);
        Some(position)
    });
    let friction = section.get(FRICTION_SHAPE.name).and_then(|entry| {
        entry.choice(&[
            ("constant", FrictionShape::Constant),
            ("harmonic-drive", FrictionShape::HarmonicDrive),
        ])
    });
    let power_up = section.get(POWER_UP.name).and_then(|entry| {
        let choices =
            [("pre-operational", PowerUpState::PreOperational), ("operational", PowerUpState::Operational)];
        let is_duration = entry.is_quantity(Quantity::DURATION);
        if is_duration {
            entry.report(ProblemKind::Replaced {
                key: entry.spot.key.clone(),
                by: "the time in [[axis]], before its tables: power_up = \"200 ms\"",
            });
            return None;
        }
        let power_up = entry.choice(&choices)?;
        if let Some(drive) = drive {
            rules::simulation::power_up(&entry.spot, drive, power_up);
        }
        Some(power_up)
    });
    section.finish();
    SimulatedJoint {
        gravity: gravity.unwrap_or(const { GRAVITY.default_number() }),
        friction: friction.unwrap_or_default(),
        peak_torque: peak_torque.unwrap_or(defaults::PEAK_TO_RATED_TORQUE * rated_torque),
        initial_position: initial.unwrap_or_else(|| limits.map_or(0.0, defaults::initial_position)),
        power_up: power_up.unwrap_or_default(),
    }
}

fn mapping(section: &mut Section<'_>, drive: Option<&DriveFacts>) -> PdoMapping {
    let choices = [("written", PdoMapping::Written), ("as-stored", PdoMapping::AsStored)];
    let read = section.get(axis_keys::MAPPING.name).and_then(|entry| {
        let mapping = entry.choice(&choices)?;
        if let Some(drive) = drive {
            rules::axis::mapping(&entry.spot, drive, mapping);
        }
        Some(mapping)
    });
    read.unwrap_or(drive.map_or(PdoMapping::Written, defaults::mapping))
}

fn feedback(section: &mut Section<'_>, drive: Option<&DriveFacts>, mapping: PdoMapping) -> Vec<Feedback> {
    let choices = Feedback::ALL.map(|feedback| (feedback.word(), feedback));
    let Some(entry) = section.get(axis_keys::FEEDBACK.name) else {
        return drive.map_or(vec![], |drive| defaults::feedback(drive, mapping));
    };
    let mut feedback = vec![];
    for entry in entry.list().into_iter().flatten() {
        let Some(object) = entry.choice(&choices) else { continue };
        rules::axis::feedback(&entry.spot, drive, object, &feedback);
        feedback.push(object);
    }
    feedback
}

fn feed_forward(section: &mut Section<'_>, drive: Option<&DriveFacts>) -> FeedForward {
    let choices = [
        ("none", FeedForward::None),
        ("velocity", FeedForward::Velocity),
        ("torque", FeedForward::Torque),
        ("velocity-and-torque", FeedForward::VelocityAndTorque),
    ];
    let read = section.get(axis_keys::FEED_FORWARD.name).and_then(|entry| {
        let feed_forward = entry.choice(&choices)?;
        rules::axis::feed_forward(&entry.spot, drive, feed_forward);
        Some(feed_forward)
    });
    read.unwrap_or_default()
}

fn transmission_type(section: &mut Section<'_>) -> u8 {
    let read = section.keyed(&axis_keys::TRANSMISSION_TYPE).and_then(|entry| {
        let value = entry.integer()?;
        rules::axis::transmission_type(&entry.spot, value);
        Some(value)
    });
    read.unwrap_or(const { axis_keys::TRANSMISSION_TYPE.default_number() as u8 })
}

fn dcf(entry: &Entry<'_>, node: Option<u8>) -> Option<DeviceConfiguration> {
    let path = entry.path_from_file()?;
    DeviceConfiguration::load(&path, node?).map_err(|reason| entry.report(ProblemKind::Dcf { reason })).ok()
}

fn identity(mut section: Section<'_>, drive: Option<&DriveFacts>) -> Identity {
    let default = drive.map_or(Identity::default(), |drive| drive.identity);
    let mut value = |key, default| match section.keyed(key) {
        None => default,
        Some(entry) if entry.is_the_word() => None,
        Some(entry) => entry.integer(),
    };
    let identity = Identity {
        device_type: value(&identity_keys::DEVICE_TYPE, default.device_type),
        vendor: value(&identity_keys::VENDOR, default.vendor),
        product: value(&identity_keys::PRODUCT, default.product),
        revision: value(&identity_keys::REVISION, default.revision),
    };
    section.finish();
    identity
}
