//! The kinds of problems that a configuration can have, and what to do about each.

use std::borrow::Cow;

use takt_wire::canopen::dcf::DcfError;
use thiserror::Error;

use super::interface_error::InterfaceError;
use super::quantity::{self, Quantity};
use super::urdf_error::UrdfError;

/// The kinds of problems. `key` is the whole path of a key, as in `axis.limits.velocity`.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ProblemKind {
    /// The file cannot be read.
    #[error("the file cannot be read: {reason}")]
    Unreadable {
        /// The operating system's message.
        reason: String,
    },
    /// It is not text in UTF-8.
    #[error("this is not text: a byte that UTF-8 does not have")]
    NotText,
    /// It is not TOML.
    #[error("this is not TOML: {message}")]
    Syntax {
        /// The parser's message.
        message: String,
    },
    /// A key that has no meaning.
    #[error("`{key}` means nothing here")]
    UnknownKey {
        /// The key.
        key: String,
        /// The most similar known name.
        nearest: Option<&'static str>,
        /// The keys that mean something in this place.
        known: Vec<&'static str>,
    },
    /// A key that means nothing beside another one.
    #[error("`{key}` means nothing beside `{beside}`")]
    Ignored {
        /// The key.
        key: String,
        /// The other one.
        beside: &'static str,
        /// When it means something.
        belongs: &'static str,
    },
    /// A key of CAN buses on a serial line.
    #[error("`{key}` means nothing on a serial line")]
    NotOnALine {
        /// The key.
        key: String,
    },
    /// A key of an earlier version.
    #[error("`{key}` has been replaced")]
    Replaced {
        /// The key.
        key: String,
        /// The key or value to write now.
        by: &'static str,
    },
    /// A key that is needed and not there.
    #[error("`{key}` is missing")]
    MissingKey {
        /// The key.
        key: String,
        /// What it says and how it may be written.
        says: Cow<'static, str>,
    },
    /// A value of another type.
    #[error("`{key}` must be {expected}, not {found}")]
    WrongType {
        /// The key.
        key: String,
        /// The expected kind of value.
        expected: &'static str,
        /// The received value.
        found: &'static str,
    },
    /// A text that is not a number with a unit.
    #[error("`{key}` must be a number with a unit; {given:?} does not begin with a number")]
    NotAQuantity {
        /// The key.
        key: String,
        /// The text.
        given: String,
        /// What is asked for.
        quantity: Quantity,
    },
    /// A quantity in quotes without its unit.
    #[error("{given:?} has no unit")]
    MissingUnit {
        /// The key.
        key: String,
        /// The text.
        given: String,
        /// What is asked for.
        quantity: Quantity,
    },
    /// A unit that is not known.
    #[error("the unit {symbol:?} of `{key}` is not known")]
    UnknownUnit {
        /// The key.
        key: String,
        /// The part of the unit that is not known.
        symbol: String,
        /// What is asked for.
        quantity: Quantity,
    },
    /// A unit of another quantity.
    #[error("`{key}` is {}, and {unit:?} is not a unit of that", article_of(quantity.name))]
    WrongUnit {
        /// The key.
        key: String,
        /// The unit as written.
        unit: String,
        /// What is asked for.
        quantity: Quantity,
    },
    /// A value that cannot be.
    #[error("`{key}` cannot be {value}")]
    OutOfRange {
        /// The key.
        key: String,
        /// The value.
        value: String,
        /// What it may be.
        allowed: String,
    },
    /// A word that is not one of those that are allowed here.
    #[error("`{key}` cannot be {given:?}")]
    UnknownChoice {
        /// The key.
        key: String,
        /// The word.
        given: String,
        /// The most similar known name.
        nearest: Option<&'static str>,
        /// The words that are allowed here.
        choices: Vec<&'static str>,
    },
    /// A name that is empty or has characters that names cannot have.
    #[error("`{key}` cannot be {given:?}")]
    BadName {
        /// The key.
        key: String,
        /// The name.
        given: String,
    },
    /// The same thing twice in a list.
    #[error("{given:?} is in `{key}` twice")]
    Repeated {
        /// The key of the list.
        key: String,
        /// What is there twice.
        given: String,
    },
    /// Two buses, axes or groups of the same name.
    #[error("there is already {} called {name:?}", article_of(what))]
    DuplicateName {
        /// `bus`, `axis` or `group`.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// Two nodes with the same node ID on a bus.
    #[error("the node ID {node} is already taken on the bus {bus:?}")]
    DuplicateNode {
        /// The bus.
        bus: String,
        /// The node.
        node: u8,
    },
    /// Two buses on the same interface.
    #[error("the interface {interface:?} already belongs to another bus")]
    DuplicateInterface {
        /// The interface.
        interface: String,
    },
    /// An axis on a bus that is not there.
    #[error("there is no bus called {name:?}")]
    UnknownBus {
        /// The name.
        name: String,
        /// The most similar known name.
        nearest: Option<String>,
        /// The buses that are there.
        known: Vec<String>,
    },
    /// An axis or a group that is not there.
    #[error("there is no {what} called {name:?}")]
    UnknownName {
        /// `axis` or `group`.
        what: &'static str,
        /// The name.
        name: String,
        /// The most similar known name.
        nearest: Option<String>,
        /// Those that are there.
        known: Vec<String>,
    },
    /// An axis that two groups name.
    #[error("{axis:?} is in the group {group:?} already")]
    InTwoGroups {
        /// The axis.
        axis: String,
        /// The group that named it first.
        group: String,
    },
    /// An axis that no group names, though there are groups.
    #[error("{axis:?} is in no group")]
    InNoGroup {
        /// The axis.
        axis: String,
    },
    /// A group that is to stop with itself.
    #[error("{name:?} cannot stop with itself")]
    StopsWithItself {
        /// The group.
        name: String,
    },
    /// An interface that takt cannot use.
    #[error("{reason}")]
    Interface {
        /// Why.
        #[source]
        reason: InterfaceError,
    },
    /// A target that is not one number for every axis.
    #[error("the move has {given} targets, but there are {axes} axes{}", of_group(group.as_deref()))]
    TargetCount {
        /// Number of targets.
        given: usize,
        /// Number of axes.
        axes: usize,
        /// The group that moves, where there are several.
        group: Option<String>,
    },
    /// A target that an axis may not go to.
    #[error("{axis:?} may not go to {value}")]
    TargetOutsideLimits {
        /// The name of the axis.
        axis: String,
        /// The target.
        value: String,
        /// Where it may go.
        allowed: String,
    },
    /// A simulated joint that begins where it may not be.
    #[error("{axis:?} cannot begin at {value}")]
    InitialPositionOutsideLimits {
        /// The name of the axis.
        axis: String,
        /// The position.
        value: String,
        /// Where it may be.
        allowed: String,
    },
    /// Limits that leave no room.
    #[error("the lowest position {low} is not below the highest {high}")]
    EmptyRange {
        /// The lower limit.
        low: String,
        /// The upper limit.
        high: String,
    },
    /// Something beyond the counts that a drive has.
    #[error("`{key}` is {counts:.0} counts, and the drive counts from {lowest} to {highest}")]
    BeyondCounts {
        /// The key.
        key: String,
        /// The value in counts or counts per second.
        counts: f64,
        /// The lowest count of the drive.
        lowest: i32,
        /// The highest count.
        highest: i32,
    },
    /// A device configuration file that cannot be used.
    #[error("{reason}")]
    Dcf {
        /// Why.
        reason: DcfError,
    },
    /// A value of a device configuration file with which bring-up refuses the drive.
    #[error("{file} writes {value} to {object}, and {axis:?} needs {needed}")]
    RefusedValue {
        /// The file.
        file: String,
        /// The object, with its name.
        object: String,
        /// The value, in the unit of the drive and in SI units.
        value: String,
        /// The condition for it.
        needed: String,
        /// The name of the axis.
        axis: String,
        /// The remedy.
        advice: &'static str,
    },
    /// A robot description that cannot be used, or a joint of it.
    #[error("{reason}")]
    Urdf {
        /// Why.
        reason: UrdfError,
    },
    /// A limit that is wider than that of the joint in the robot description.
    #[error("`{key}` is {value}, and the joint {joint:?} of {file} allows {allowed}")]
    WiderThanUrdf {
        /// The key.
        key: String,
        /// The value.
        value: String,
        /// What the robot description allows.
        allowed: String,
        /// The joint.
        joint: String,
        /// The file.
        file: String,
    },
    /// `command_phase = "auto"` where none is possible.
    #[error("no command phase suits every bus")]
    NoCommandPhase {
        /// The sums of the buses that are the cause, and what would help, in words.
        cause: String,
    },
    /// More than one controller can do.
    #[error("{given} {what} are more than the {limit} that one controller can do")]
    TooMany {
        /// `axes`, `buses` or `groups`.
        what: &'static str,
        /// The configured number.
        given: usize,
        /// The largest possible number.
        limit: usize,
    },
}

impl ProblemKind {
    /// What to do about it.
    pub fn help(&self) -> String {
        match self {
            Self::Unreadable { .. } => {
                "give the path of a configuration; configs/reference.toml explains them".into()
            }
            Self::NotText => "a configuration is TOML in UTF-8; is this another file?".into(),
            Self::Syntax { .. } => {
                "the rules of TOML are at https://toml.io; texts, and numbers with units, are in quotes"
                    .into()
            }
            Self::UnknownKey { nearest: Some(nearest), .. } => format!("did you mean `{nearest}`?"),
            Self::UnknownKey { nearest: None, known, .. } => {
                format!("allowed here: {}", known.join(", "))
            }
            Self::Ignored { belongs, .. } => (*belongs).into(),
            Self::NotOnALine { .. } => "it belongs to CAN buses: leave it out".into(),
            Self::Replaced { by, .. } => format!("write {by}"),
            Self::MissingKey { says, .. } => says.clone().into_owned(),
            Self::WrongType { expected, .. } => format!("write {expected}"),
            Self::NotAQuantity { quantity, .. } | Self::WrongUnit { quantity, .. } => {
                show_quantity(*quantity)
            }
            Self::MissingUnit { given, quantity, .. } => format!(
                "add the unit, as in \"{}\"; without quotes, {given} is taken in {}",
                quantity.example, quantity.unit
            ),
            Self::UnknownUnit { symbol, quantity, .. } => match quantity::nearest_unit(symbol, *quantity) {
                Some(unit) => format!("did you mean {unit:?}? {}", show_quantity(*quantity)),
                None => show_quantity(*quantity),
            },
            Self::OutOfRange { allowed, .. } => format!("allowed: {allowed}"),
            Self::UnknownChoice { nearest: Some(nearest), choices, .. } => {
                format!("did you mean {nearest:?}? {}", show_choices(choices))
            }
            Self::UnknownChoice { nearest: None, choices, .. } => show_choices(choices),
            Self::BadName { .. } => "a name has 1 to 32 letters, digits or -_.".into(),
            Self::Repeated { .. } => "remove one of them".into(),
            Self::DuplicateName { what, .. } => format!("give each {what} a name of its own"),
            Self::DuplicateNode { .. } => {
                "give each node of a bus a node ID of its own, 1 to 127; on every bus, \
                 [master] node is the ID of the controller. Axes of one drive have one node ID, one `eds`, and each another \
                 `node_axis`"
                    .into()
            }
            Self::DuplicateInterface { .. } => "give each bus an interface of its own".into(),
            Self::UnknownBus { nearest: Some(nearest), .. } => format!("did you mean {nearest:?}?"),
            Self::UnknownBus { nearest: None, known, .. } => format!("the buses are: {}", known.join(", ")),
            Self::UnknownName { nearest: Some(nearest), .. } => format!("did you mean {nearest:?}?"),
            Self::UnknownName { known, .. } if known.is_empty() => {
                "there is no [[group]]: all axes move together, and no group is named".into()
            }
            Self::UnknownName { what, known, .. } => {
                let plural = if *what == "axis" { "axes" } else { "groups" };
                format!("the {plural} are: {}", known.join(", "))
            }
            Self::InTwoGroups { .. } => "leave it in one of them".into(),
            Self::InNoGroup { .. } => {
                "add it to the axes of a [[group]], or give it a [[group]] of its own: every axis is in one \
                 group, or there is no [[group]]"
                    .into()
            }
            Self::StopsWithItself { .. } => "name other groups, or leave `stops_with` out".into(),
            Self::Interface { reason } => reason.help(),
            Self::TargetCount { group: Some(_), .. } => {
                "one target for every axis of the group in the order in which it names them, or one number \
                 for all of them"
                    .into()
            }
            Self::TargetCount { group: None, .. } => {
                "one target for every axis in the order of the file, or one number for all \
                                         of them"
                    .into()
            }
            Self::TargetOutsideLimits { allowed, .. }
            | Self::InitialPositionOutsideLimits { allowed, .. } => {
                format!("allowed by its limits: {allowed}")
            }
            Self::EmptyRange { .. } => "the lowest position comes first".into(),
            Self::BeyondCounts { .. } => "check counts_per_turn, gear_ratio, lead and zero_counts".into(),
            Self::Dcf { reason } => reason.help().into(),
            Self::RefusedValue { advice, .. } => (*advice).into(),
            Self::Urdf { reason } => reason.help(),
            Self::WiderThanUrdf { .. } => {
                "a limit may be narrower than that of the robot description, not wider: leave it out to take that one".into()
            }
            Self::NoCommandPhase { cause } => cause.clone(),
            Self::TooMany { .. } => "divide the machine between several controllers".into(),
        }
    }

    /// What is written beside the place in the file.
    pub(super) fn label(&self) -> &'static str {
        match self {
            Self::NotText | Self::Syntax { .. } => "here",
            Self::UnknownKey { .. } => "not known here",
            Self::Ignored { .. } | Self::NotOnALine { .. } => "means nothing here",
            Self::Replaced { .. } => "is not a key any more",
            Self::MissingKey { .. } => "missing in here",
            Self::WrongType { .. } => "wrong type",
            Self::UnknownUnit { .. } | Self::WrongUnit { .. } => "wrong unit",
            Self::NotAQuantity { .. } => "no number",
            Self::WiderThanUrdf { .. } => "wider",
            Self::MissingUnit { .. } => "no unit",
            Self::DuplicateName { .. }
            | Self::DuplicateNode { .. }
            | Self::DuplicateInterface { .. }
            | Self::InTwoGroups { .. } => "again",
            Self::InNoGroup { .. } => "in no group",
            Self::RefusedValue { .. } => "a value that bring-up refuses",
            Self::TargetCount { .. } => "wrong length",
            Self::TargetOutsideLimits { .. } | Self::InitialPositionOutsideLimits { .. } => {
                "outside the limits"
            }
            _ => "this",
        }
    }
}

fn show_quantity(quantity: Quantity) -> String {
    match quantity.unit {
        "" => format!(
            "write {} {}, as in {:?} or as a bare number",
            article(quantity.name),
            quantity.name,
            quantity.example
        ),
        unit => format!(
            "write {} {}, as in {:?}, or a bare number in {unit}",
            article(quantity.name),
            quantity.name,
            quantity.example
        ),
    }
}

fn of_group(group: Option<&str>) -> String {
    group.map_or(String::new(), |group| format!(" in the group {group:?}"))
}

fn show_choices(choices: &[&str]) -> String {
    let quoted: Vec<_> = choices.iter().map(|choice| format!("{choice:?}")).collect();
    format!("allowed here: {}", quoted.join(", "))
}

fn article(noun: &str) -> &'static str {
    if noun.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" }
}

fn article_of(noun: &str) -> String {
    format!("{} {noun}", article(noun))
}
