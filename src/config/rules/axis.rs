//! The axes.

use takt_rt::{MAX_AXES, OperationMode};
use takt_wire::printable::excerpt;

use super::loops::Surroundings;
use super::{Fields, bit_fields, converter, identifiers, limits, line, loops, master, name, simulation};
use crate::config::drive_family::{DriveFacts, ModeChangeRule, Protocol};
use crate::config::keys;
use crate::config::mode_words::{MODES, mode_word};
use crate::config::model::{
    Axis, Config, Control, FeedForward, Feedback, Interface, Joint, Limits, PdoMapping, Travel,
};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantities::{Counting, Quantities};
use crate::config::quantity::Quantity;
use crate::config::spelling;
use crate::config::spot::Spot;

pub fn validate(config: &Config, whole: &Fields<'_>) {
    let axes = &config.axes;
    if axes.is_empty() {
        let says = "at least one [[axis]]";
        whole.at("axis").report(ProblemKind::MissingKey { key: "axis".to_owned(), says: says.into() });
    }
    if axes.len() > MAX_AXES {
        whole.at("axis").report(too_many(axes.len()));
        return;
    }
    for (index, axis) in axes.iter().enumerate() {
        let fields = whole.element("axis", "axes", index, &axis.name);
        let earlier = axes.get(..index).unwrap_or_default();
        name(&fields.at("name"), &axis.name);
        if earlier.iter().any(|other| other.name == axis.name) {
            fields.at("name").report(duplicate_name(&axis.name));
        }
        validate_place(axis, earlier, config, &fields);
        line::validate_place(config, index, &fields);
        validate_motion(axis, config, &fields);
        validate_process_data(axis, &fields);
        let at = |key: &str| fields.at(key);
        bit_fields::axis(axis, config.buses.get(axis.bus), at);
        converter::axis(axis, earlier.iter(), config.buses.get(axis.bus).map(|bus| &bus.interface), at);
        identifiers::axis(axis, earlier.iter().map(|other| (other, None)), config.master.node, at);
    }
}

pub fn too_many(given: usize) -> ProblemKind {
    ProblemKind::TooMany { what: "axes", given, limit: MAX_AXES }
}

pub fn duplicate_name(name: &str) -> ProblemKind {
    ProblemKind::DuplicateName { what: "axis", name: name.to_owned() }
}

/// The bus, and the node ID on it.
fn validate_place(axis: &Axis, earlier: &[Axis], config: &Config, fields: &Fields<'_>) {
    let Some(bus) = config.buses.get(axis.bus) else {
        let known: Vec<&str> = config.buses.iter().map(|bus| bus.name.as_str()).collect();
        fields.at("bus").report(unknown_bus(&axis.bus.to_string(), &known));
        return;
    };
    let spot = fields.at("node");
    let is_on_line = axis.drive.protocol.is_of_serial_line();
    let nodes = if is_on_line { keys::LINE_ADDRESSES } else { keys::master::NODE.integers() };
    if spot.integer(axis.node, &nodes).is_some() {
        if axis.node == config.master.node && !is_on_line {
            spot.report(duplicate_node(&bus.name, axis.node));
        }
        for other in earlier.iter().filter(|other| (other.bus, other.node) == (axis.bus, axis.node)) {
            if !are_of_one_node(&other.drive, &axis.drive) {
                spot.report(duplicate_node(&bus.name, axis.node));
            }
        }
    }
    own_node(&spot, &axis.drive, axis.node);
    let others = earlier.iter().filter(|other| other.bus == axis.bus && other.node != axis.node);
    for other in others {
        if let Some(kind) = shared_identifier(&spot, (&axis.drive, axis.node), (&other.drive, other.node)) {
            spot.report(kind);
        }
    }
    bit_rate(&fields.at("bus.bit_rate"), &axis.drive, bus.bit_rate);
}

/// A protocol that is not CANopen may have room for fewer node IDs.
pub fn own_node(spot: &Spot<'_>, drive: &DriveFacts, node: u8) {
    if let Some(own) = drive.protocol.own_identifiers().filter(|own| node > own.last_node) {
        spot.report_range(
            node.to_string(),
            format!("1 to {}, the node IDs of an {}", own.last_node, drive.name),
        );
    }
}

/// What is wrong with two drives of one bus of which one does not speak CANopen, and that have an identifier in common.
pub fn shared_identifier(
    spot: &Spot<'_>,
    (drive, node): (&DriveFacts, u8),
    (other, other_node): (&DriveFacts, u8),
) -> Option<ProblemKind> {
    match (drive.protocol, other.protocol) {
        // The identifiers of bit fields are those of a description: `rules::identifiers` looks at them.
        (Protocol::Canopen, Protocol::Canopen) | (Protocol::BitFields, _) | (_, Protocol::BitFields) => {
            return None;
        }
        (Protocol::SerialLine, _) | (_, Protocol::SerialLine) => return None,
        (Protocol::Own(_), _) | (_, Protocol::Own(_)) => {}
    }
    let theirs = other.identifiers(other_node);
    let id = drive.identifiers(node).into_iter().find(|id| theirs.contains(id))?;
    Some(ProblemKind::OutOfRange {
        key: spot.key.clone(),
        value: format!(
            "{node}, by which the {} and node {other_node} both use {:03X}",
            drive.name,
            id.value()
        ),
        allowed: "a node ID whose identifiers no other drive on the bus has".to_owned(),
    })
}

pub fn unknown_bus(given: &str, known: &[&str]) -> ProblemKind {
    let nearest = spelling::nearest(given, known.iter().copied()).map(str::to_owned);
    let known = known.iter().map(|name| (*name).to_owned()).collect();
    ProblemKind::UnknownBus { name: excerpt(given), nearest, known }
}

/// Returns `true` if two axes can be those of one drive with several axes.
pub fn are_of_one_node(first: &DriveFacts, second: &DriveFacts) -> bool {
    (first.word, first.identity) == (second.word, second.identity) && first.node_axis != second.node_axis
}

pub fn duplicate_node(bus: &str, node: u8) -> ProblemKind {
    ProblemKind::DuplicateNode { bus: bus.to_owned(), node }
}

/// A bit rate that the drives on the bus know.
pub fn bit_rate(spot: &Spot<'_>, drive: &DriveFacts, rate: u32) {
    if drive.bit_rates.is_empty() || drive.bit_rates.contains(&rate) {
        return;
    }
    let show = |rate: &u32| Quantity::BIT_RATE.show((*rate).into());
    let allowed = match drive.bit_rates {
        [only] => format!("{}, the one bit rate of the {}s on this bus", show(only), drive.name),
        rates => {
            format!("{}, the bit rates of the {}s on this bus", or_list(rates.iter().map(show)), drive.name)
        }
    };
    spot.report(ProblemKind::OutOfRange { key: "bus.bit_rate".to_owned(), value: show(&rate), allowed });
}

/// `a, b or c`
fn or_list(words: impl IntoIterator<Item = String>) -> String {
    let words: Vec<String> = words.into_iter().collect();
    match words.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        _ => words.concat(),
    }
}

/// Units, limits, mode, loops, and the simulated joint.
fn validate_motion(axis: &Axis, config: &Config, fields: &Fields<'_>) {
    let q = Quantities::of(axis.travel);
    let counting = Counting::of(axis);
    let is_countable = validate_counting(axis, fields);
    let are_sound =
        is_countable && limits::validate(&axis.limits, q, Some(&counting), &fields.within("limits"));
    let limits = are_sound.then_some(&axis.limits);
    limits::validate_following_error(&axis.following_error, q, &fields.within("following_error"));
    fields.quantity(&keys::axis::START_TOLERANCE, q, axis.start_tolerance);
    fields.quantity(&keys::axis::TARGET_TOLERANCE, q, axis.target_tolerance);
    fields.duration(&keys::axis::POWER_UP, axis.power_up_ns);
    validate_joint(&axis.joint, q, &fields.within("joint"));
    simulation::validate_joint(
        &axis.simulated,
        q,
        limits,
        &axis.name,
        &axis.drive,
        &fields.within("simulated"),
    );

    let period_ns = config.bus_cycle(axis.bus).period_ns;
    mode(&fields.at("mode"), &axis.drive, axis.control);
    interpolation_period(&fields.at("bus.period"), &axis.drive, axis.control, period_ns);
    if let Some(limits) = limits {
        motor_speed(&fields.at("limits.velocity"), &axis.drive, limits, &counting, q);
    }
    let is_simulated = config.buses.get(axis.bus).is_some_and(|bus| bus.interface == Interface::Simulated);
    let surroundings =
        Surroundings::new(period_ns, axis.transmission_type, axis.joint.inertia(), is_simulated);
    for control in axis.controls() {
        loops::validate(*control, q, axis.joint.inertia(), &surroundings, fields);
    }
    let controls: Vec<Control> = axis.controls().copied().collect();
    joint(&controls, &axis.joint, is_simulated, |key| fields.within("joint").at(key));
    validate_other_modes(axis, &fields.at("modes"));
}

fn validate_joint(joint: &Joint, q: Quantities, fields: &Fields<'_>) {
    use keys::joint::{COULOMB_FRICTION, INERTIA, RATED_TORQUE, VISCOUS_FRICTION};

    let values = [
        (&INERTIA, joint.inertia),
        (&VISCOUS_FRICTION, joint.viscous_friction),
        (&COULOMB_FRICTION, joint.coulomb_friction),
        (&RATED_TORQUE, joint.rated_torque),
    ];
    for (key, value) in values {
        if let Some(value) = value {
            fields.quantity(key, q, value);
        }
    }
}

/// The torque loop of CST feeds the joint's mechanics forward. On a real bus they are those of a real joint, and no default
/// suits it.
pub fn joint<'a>(
    controls: &[Control],
    joint: &Joint,
    is_simulated: bool,
    at: impl Fn(&'static str) -> Spot<'a>,
) {
    if is_simulated || !controls.iter().any(|control| matches!(control, Control::Torque { .. })) {
        return;
    }
    let needed = [
        (
            "inertia",
            joint.inertia,
            "rotor and load at the joint, which mode \"cst\" feeds forward on a real bus",
        ),
        (
            "viscous_friction",
            joint.viscous_friction,
            "which mode \"cst\" feeds forward on a real bus; 0 for none",
        ),
        (
            "coulomb_friction",
            joint.coulomb_friction,
            "which mode \"cst\" feeds forward on a real bus; 0 for none",
        ),
    ];
    for (key, value, says) in needed {
        if value.is_none() {
            let spot = at(key);
            spot.report(ProblemKind::MissingKey { key: spot.key.clone(), says: says.into() });
        }
    }
}

fn validate_counting(axis: &Axis, fields: &Fields<'_>) -> bool {
    let lead = match axis.travel {
        Travel::Rotary => Some(0.0),
        Travel::Linear { lead_m } => fields.quantity(&keys::axis::LEAD, Quantities::LINEAR, lead_m),
    };
    let counts = fields.number(&keys::axis::COUNTS_PER_TURN, axis.counts_per_turn);
    let gear = fields.number(&keys::axis::GEAR_RATIO, axis.gear_ratio);
    lead.is_some() && counts.is_some() && gear.is_some()
}

/// What is exchanged with the drive in every cycle, and its heartbeat.
fn validate_process_data(axis: &Axis, fields: &Fields<'_>) {
    mapping(&fields.at("mapping"), &axis.drive, axis.mapping);
    for (index, object) in axis.feedback.iter().enumerate() {
        let earlier = axis.feedback.get(..index).unwrap_or_default();
        feedback(&fields.at("feedback"), Some(&axis.drive), *object, earlier);
    }
    transmission_type(&fields.at("transmission_type"), axis.transmission_type);
    fields.integer(&keys::axis::MISSED_FEEDBACK_CYCLES, axis.missed_feedback_cycles);
    fields.duration(&keys::axis::FEEDBACK_DELAY, axis.feedback_delay_ns);
    if let Some(heartbeat_ns) = axis.heartbeat_ns {
        master::heartbeat(&fields.at("heartbeat"), heartbeat_ns);
    }
}

/// A mode that the drive has.
fn mode(spot: &Spot<'_>, drive: &DriveFacts, control: Control) {
    if !drive.has_mode(&control) {
        let words = MODES.iter().filter(|(_, mode)| drive.modes.contains(*mode));
        let words = or_list(words.map(|(word, _)| format!("\"{word}\"")));
        let allowed = format!("a mode of {} drives: {words}", drive.name);
        spot.report_range(format!("{:?}", control.operation_mode()), allowed);
    }
}

/// The modes that an axis may be changed to at run time, by their words: the cyclic synchronous ones.
pub const CHANGEABLE_MODES: [(&str, OperationMode); 3] = [MODES[0], MODES[1], MODES[2]];

fn validate_other_modes(axis: &Axis, spot: &Spot<'_>) {
    if axis.other_modes.is_empty() || !has_other_modes(spot, &axis.drive, axis.control) {
        return;
    }
    let mut seen = vec![axis.control.operation_mode()];
    for control in &axis.other_modes {
        let mode = control.operation_mode();
        if !control.is_cyclic_synchronous() {
            spot.report_range(format!("{mode:?}"), "\"csp\", \"csv\" or \"cst\"".to_owned());
        } else if seen.contains(&mode) {
            repeated_mode(spot, mode);
        }
        seen.push(mode);
    }
}

/// Returns `true` if a drive that starts like this can be changed to other modes; reports it if not.
pub fn has_other_modes(spot: &Spot<'_>, drive: &DriveFacts, control: Control) -> bool {
    let (given, allowed) = match drive.mode_changes {
        ModeChangeRule::Never { because } => {
            (format!("given for a {}", drive.name), format!("left out: {because}"))
        }
        ModeChangeRule::When(_) if control.is_cyclic_synchronous() => return true,
        ModeChangeRule::When(_) => (
            "given for an axis in another mode than \"csp\", \"csv\" or \"cst\"".to_owned(),
            "left out, or `mode` one of them: only they change without a bump".to_owned(),
        ),
    };
    spot.report_range(given, allowed);
    false
}

pub fn repeated_mode(spot: &Spot<'_>, mode: OperationMode) {
    spot.report(ProblemKind::Repeated { key: spot.key.clone(), given: mode_word(mode).to_owned() });
}

/// The period in which the drive interpolates from target to target, where it has only one.
pub fn interpolation_period(spot: &Spot<'_>, drive: &DriveFacts, control: Control, period_ns: u64) {
    if let Some(only_ns) = drive.interpolation_period_ns
        && control == Control::Interpolated
        && period_ns != only_ns
    {
        let show = |ns: u64| Quantity::DURATION.show(ns as f64 / 1e9);
        let (key, value, only) = ("bus.period".to_owned(), show(period_ns), show(only_ns));
        let allowed =
            format!("{only}, the period of a {} that interpolates: period = \"{only}\"", drive.name);
        spot.report(ProblemKind::OutOfRange { key, value, allowed });
    }
}

/// The highest speed that objects 6081 and 60FF of the drive can hold.
pub fn motor_speed(spot: &Spot<'_>, drive: &DriveFacts, limits: &Limits, counting: &Counting, q: Quantities) {
    let Some(highest_rpm) = drive.highest_speed_rpm else { return };
    let highest = highest_rpm / 60.0 / counting.turns_per_unit();
    if limits.velocity > highest * (1.0 + 1e-9) {
        let allowed = format!("at most {}, {highest_rpm} r/min of the motor", q.velocity.show(highest));
        spot.report_range(q.velocity.show(limits.velocity), allowed);
    }
}

pub fn mapping(spot: &Spot<'_>, drive: &DriveFacts, mapping: PdoMapping) {
    if drive.has_fixed_process_data && mapping == PdoMapping::Written {
        spot.report_range("written".to_owned(), format!("as-stored, {}", since_fixed(drive)));
    }
}

fn since_fixed(drive: &DriveFacts) -> String {
    format!("since the PDOs of a {} are fixed", drive.name)
}

pub fn feedback(spot: &Spot<'_>, drive: Option<&DriveFacts>, object: Feedback, earlier: &[Feedback]) {
    let given = object.word().to_owned();
    if let Some(drive) = drive.filter(|drive| drive.has_fixed_process_data) {
        spot.report_range(given.clone(), format!("nothing, {}", since_fixed(drive)));
    }
    if earlier.contains(&object) {
        spot.report(ProblemKind::Repeated { key: spot.key.clone(), given });
    }
}

/// Fixed PDOs have no room for anything beside the target.
pub fn feed_forward(spot: &Spot<'_>, drive: Option<&DriveFacts>, feed_forward: FeedForward) {
    if let Some(drive) =
        drive.filter(|drive| drive.has_fixed_process_data && feed_forward != FeedForward::None)
    {
        spot.report_range("an offset".to_owned(), format!("\"none\", {}", since_fixed(drive)));
    }
}

/// 1 to 240: every so many SYNCs; 254 and 255: on the drive's own events (CiA 301, 7.5.2.36 and 7.5.2.38).
pub fn transmission_type(spot: &Spot<'_>, value: u8) {
    if spot.integer_of(&keys::axis::TRANSMISSION_TYPE, value).is_some() && matches!(value, 241..=253) {
        spot.report_range(value.to_string(), "1 to 240 (SYNC), 254 or 255 (event)".to_owned());
    }
}
