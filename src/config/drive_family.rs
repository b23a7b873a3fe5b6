//! A family of drives, as far as a configuration, the schedule and the engine need to know it: facts, as data.
//!
//! The facts of each family stand in its own folder (`src/family/<name>`). A family whose drives differ, each described by a file,
//! makes the facts of a drive when it reads the configuration.

use std::any::Any;
use std::fmt;
use std::ops::Deref;
use std::sync::Arc;

use takt_rt::{Cia402Codec, Id, MappedObject, ModeCondition, OperationMode, PositionCounter};

use super::error_control::ErrorControl;
use super::model::{Control, Identity};

/// A family of drives: the word for it in a configuration, and what is known of its drives.
#[derive(Clone)]
pub struct DriveFamily {
    facts: Facts,
}

#[derive(Clone)]
enum Facts {
    /// Every drive of the family is alike.
    OfFamily(&'static DriveFacts),
    /// They were read from the description of one drive, which the family keeps beside them.
    OfDrive(Arc<Described>),
    /// They are read, when they are first needed, from a description that comes with takt.
    BuiltIn(fn() -> &'static DriveFamily),
}

struct Described {
    facts: DriveFacts,
    description: Box<dyn Any + Send + Sync>,
}

/// Facts about the drives of a family.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveFacts {
    /// The word for the family in a configuration.
    pub word: &'static str,
    /// Display name.
    pub name: &'static str,
    /// Expected identity. `None` accepts any value.
    pub identity: Identity,
    /// Counts of one turn of the position that the drives report. `None`: a configuration must say it.
    pub counts_per_turn: Option<f64>,
    /// The counts that the drives report as their position (object 6064).
    pub counter: PositionCounter,
    /// The unit of velocities (objects 606C, 60FF).
    pub velocity_unit: VelocityUnit,
    /// The unit of profile velocities (6081, 6099), where it is another one.
    pub profile_velocity_unit: Option<VelocityUnit>,
    /// The unit of accelerations (6083, 6084, 6085): so much velocity in a second; `None`: that of profile velocities.
    pub acceleration_unit: Option<VelocityUnit>,
    /// The unit of the highest speed of the motor (6080). CiA 402: r/min.
    pub motor_speed_unit: VelocityUnit,
    /// True if software position limits (607D) of which the lowest is not below the highest, as 0 and 0, are off.
    pub empty_software_limits_are_off: bool,
    /// The modes that the drives have.
    pub modes: ModeSet,
    /// The mode where a configuration names none.
    pub usual_mode: Control,
    /// Whether they take another mode at run time.
    pub mode_changes: ModeChangeRule,
    /// The object that has the target of interpolated position mode.
    pub interpolation_target: MappedObject,
    /// The only period of interpolated position mode, where there is only one.
    pub interpolation_period_ns: Option<u64>,
    /// The highest speed that objects 60FF and 6081 can hold, in r/min of the reported position.
    pub highest_speed_rpm: Option<f64>,
    /// The bit rates that the drives know. Empty: any.
    pub bit_rates: &'static [u32],
    /// True if the controller can map their PDOs.
    pub has_fixed_process_data: bool,
    /// True if a PDO can carry the mode of operation that a drive shows (6061).
    pub reports_mode: bool,
    /// True if the drives can be told to answer set-points alone, and not SYNC (`answers_sync`).
    pub may_ignore_sync: bool,
    /// The number of this axis among those of its drive, 1 where a drive has one axis. See [`Axis::node`](super::model::Axis::node).
    pub node_axis: u8,
    /// Protocol.
    pub protocol: Protocol,
    /// Error control, besides feedback.
    pub error_control: ErrorControl,
    /// True if the drives can watch the heartbeat of the controller (object 1016).
    pub consumes_heartbeat: bool,
    /// True if the drives have emergency objects.
    pub sends_emergencies: bool,
    /// True if the drives may be operational after power-up, without an NMT command.
    pub may_power_up_operational: bool,
    /// Use of controlword and statusword.
    pub codec: Cia402Codec,
    /// The pause that they need between two controlwords.
    pub controlword_spacing_ns: u64,
    /// Time from power-on until they can be enabled, where they answer long before.
    pub enabled_from_ns: u64,
    /// Plausible values.
    pub plausible: Plausible,
}

/// Protocol of drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// By CANopen: they are nodes, with objects, NMT states and PDOs.
    Canopen,
    /// By frames of bit fields, see [`Family::field_drive`](crate::family::Family::field_drive).
    BitFields,
    /// By a protocol of their own with these identifiers, one request at a time.
    Own(OwnIdentifiers),
    /// By requests and replies on a serial line, which is no CAN bus.
    SerialLine,
}

impl Protocol {
    /// The identifiers of a protocol of their own.
    pub const fn own_identifiers(self) -> Option<OwnIdentifiers> {
        match self {
            Self::Own(own) => Some(own),
            Self::Canopen | Self::BitFields | Self::SerialLine => None,
        }
    }

    /// Returns `true` if the drives are on a serial line, and not on a CAN bus.
    pub const fn is_of_serial_line(self) -> bool {
        matches!(self, Self::SerialLine)
    }
}

/// The 11-bit identifiers of a protocol that is not CANopen: the node ID is added to each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OwnIdentifiers {
    /// Of the requests of the controller.
    pub request: u16,
    /// Of the replies of a drive.
    pub reply: u16,
    /// The highest node ID. The lowest is 1.
    pub last_node: u8,
}

impl OwnIdentifiers {
    /// The identifier of the requests to a node.
    pub fn request_id(self, node: u8) -> Id {
        Self::id(self.request, node)
    }

    /// The identifier of the replies of a node.
    pub fn reply_id(self, node: u8) -> Id {
        Self::id(self.reply, node)
    }

    fn id(base: u16, node: u8) -> Id {
        // What is beyond 11 bits belongs to no node.
        let highest = u32::from(base) + u32::from(node);
        Id::base(highest.min(0x7FF)).unwrap_or(Id::canopen(base, node))
    }
}

/// Modes of operation, a bit for each as in object 6502.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ModeSet(pub u32);

impl ModeSet {
    /// These modes.
    pub const fn of(modes: &[OperationMode]) -> Self {
        let (mut bits, mut at) = (0, 0);
        while at < modes.len() {
            bits |= 1 << (modes[at] as u32 - 1);
            at += 1;
        }
        Self(bits)
    }

    /// Returns `true` if the mode is one of them.
    pub const fn contains(self, mode: OperationMode) -> bool {
        self.0 >> (mode as u32 - 1) & 1 == 1
    }
}

/// The unit of a drive's velocities.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum VelocityUnit {
    /// Counts of the reported position per second.
    Counts(f64),
    /// r/min of the reported position.
    RevolutionsPerMinute(f64),
}

impl VelocityUnit {
    /// The drive's number for a speed of one turn of its position per second.
    pub(crate) const fn units_per_turn(self, counts_per_turn: f64) -> f64 {
        match self {
            Self::Counts(counts) => counts_per_turn / counts,
            Self::RevolutionsPerMinute(rpm) => 60.0 / rpm,
        }
    }
}

/// Whether drives take another mode at run time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ModeChangeRule {
    /// They do, under this condition.
    When(ModeCondition),
    /// They do not.
    Never {
        /// Why.
        because: &'static str,
    },
}

impl ModeChangeRule {
    /// When drives take another mode; `None` if they never do.
    pub const fn condition(self) -> Option<ModeCondition> {
        match self {
            Self::When(condition) => Some(condition),
            Self::Never { .. } => None,
        }
    }
}

/// Plausible values of a drive of a family. Others are possible, and cause a warning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plausible {
    /// The fastest that drives of the family turn, in turns per second of the position that they report.
    pub fastest_turns_per_s: f64,
    /// The fastest that the joint of a drive without a further transmission usually turns: rad/s.
    pub usual_velocity: f64,
    /// The ratios of the gears inside the drives, from this one on, where the drives report turns of the output behind that
    /// gear.
    pub inner_gear_from: Option<f64>,
}

impl Plausible {
    /// Nothing is known.
    pub(crate) const ANYTHING: Self =
        Self { fastest_turns_per_s: f64::INFINITY, usual_velocity: f64::INFINITY, inner_gear_from: None };
}

impl DriveFacts {
    /// A family that keeps to CiA 402, without a mark of its own: every mode, free process data, counts per second.
    pub const fn standard(word: &'static str, name: &'static str) -> Self {
        Self {
            word,
            name,
            identity: Identity { device_type: None, vendor: None, product: None, revision: None },
            counts_per_turn: None,
            counter: PositionCounter::BITS_32,
            velocity_unit: VelocityUnit::Counts(1.0),
            profile_velocity_unit: None,
            acceleration_unit: None,
            motor_speed_unit: VelocityUnit::RevolutionsPerMinute(1.0),
            empty_software_limits_are_off: true,
            modes: ModeSet::of(&OperationMode::ALL),
            usual_mode: Control::Position,
            mode_changes: ModeChangeRule::When(ModeCondition::Disabled),
            interpolation_target: MappedObject::new(0x607A, 0, 32),
            interpolation_period_ns: None,
            highest_speed_rpm: None,
            bit_rates: &[],
            has_fixed_process_data: false,
            reports_mode: true,
            may_ignore_sync: false,
            node_axis: 1,
            protocol: Protocol::Canopen,
            error_control: ErrorControl::Heartbeat { fixed_ms: None },
            consumes_heartbeat: true,
            sends_emergencies: true,
            may_power_up_operational: false,
            codec: Cia402Codec::STANDARD,
            controlword_spacing_ns: 0,
            enabled_from_ns: 0,
            plausible: Plausible::ANYTHING,
        }
    }

    /// Every identifier between a drive with this node ID and its master: those of its own protocol, or those that CANopen gives to
    /// its node (CiA 301, 7.3.3). On a serial line there are none.
    pub(crate) fn identifiers(&self, node: u8) -> Vec<Id> {
        match self.protocol {
            Protocol::Own(own) => vec![own.request_id(node), own.reply_id(node)],
            Protocol::Canopen | Protocol::BitFields => {
                (1..=0xE).map(|function| Id::canopen(function << 7, node)).collect()
            }
            Protocol::SerialLine => vec![],
        }
    }

    /// Returns `true` if the drives have the mode.
    pub(crate) fn has_mode(&self, control: &Control) -> bool {
        self.modes.contains(control.operation_mode())
    }

    /// Returns the drives' number for a speed of one turn of their position per second.
    pub const fn velocity_units_per_turn(&self, counts_per_turn: f64) -> f64 {
        self.velocity_unit.units_per_turn(counts_per_turn)
    }

    /// Units of profile velocities (6081) for one unit of velocities (60FF).
    pub fn profile_velocity_units_per_velocity_unit(&self, counts_per_turn: f64) -> f64 {
        let unit = self.profile_velocity_unit.unwrap_or(self.velocity_unit);
        unit.units_per_turn(counts_per_turn) / self.velocity_units_per_turn(counts_per_turn)
    }

    /// Units of accelerations (6083) for one unit of velocities (60FF) in a second.
    pub fn acceleration_units_per_velocity_unit(&self, counts_per_turn: f64) -> f64 {
        let unit = self.acceleration_unit.or(self.profile_velocity_unit).unwrap_or(self.velocity_unit);
        unit.units_per_turn(counts_per_turn) / self.velocity_units_per_turn(counts_per_turn)
    }

    /// Units of the highest speed of the motor (6080) for one unit of velocities (60FF).
    pub fn motor_speed_units_per_velocity_unit(&self, counts_per_turn: f64) -> f64 {
        self.motor_speed_unit.units_per_turn(counts_per_turn) / self.velocity_units_per_turn(counts_per_turn)
    }
}

impl DriveFamily {
    /// A family whose drives are all alike.
    pub const fn of_family(facts: &'static DriveFacts) -> Self {
        Self { facts: Facts::OfFamily(facts) }
    }

    /// A family whose drives are all alike, by a description that comes with takt.
    pub(crate) const fn built_in(read: fn() -> &'static Self) -> Self {
        Self { facts: Facts::BuiltIn(read) }
    }

    /// One drive of a family, with the facts that its description gives. The family finds the description again by
    /// [`description`](Self::description).
    pub fn of_drive(facts: DriveFacts, description: impl Any + Send + Sync) -> Self {
        Self { facts: Facts::OfDrive(Arc::new(Described { facts, description: Box::new(description) })) }
    }

    /// Returns the data that the family has read for this drive, if there are any and they have this type.
    pub fn description<T: Any>(&self) -> Option<&T> {
        match &self.facts {
            Facts::OfFamily(_) => None,
            Facts::OfDrive(drive) => drive.description.downcast_ref(),
            Facts::BuiltIn(read) => read().description(),
        }
    }
}

impl Deref for DriveFamily {
    type Target = DriveFacts;

    fn deref(&self) -> &DriveFacts {
        match &self.facts {
            Facts::OfFamily(facts) => facts,
            Facts::OfDrive(drive) => &drive.facts,
            Facts::BuiltIn(read) => read(),
        }
    }
}

impl PartialEq for DriveFamily {
    /// Returns `true` if they are drives of one family that look alike to a configuration.
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl fmt::Debug for DriveFamily {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.word)
    }
}
