//! The parameters, variables and commands of a drive (eRunner manual 7.5, tables 7-13 and 7-14; where the print is damaged, the
//! reading that is argued in the text of each entry).

use std::fmt;

use super::frame::EntryAddress;
use crate::erob_can::parameter::{Access, Parameter, Unit, Values};

/// An entry of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Where it is.
    pub address: EntryAddress,
    /// Its name.
    pub name: &'static str,
    /// What may be done with it.
    pub access: Access,
    /// The unit of its number on the wire.
    pub unit: Unit,
    /// Which numbers it takes, or shows.
    pub values: Values,
    /// What else must be known of it; empty if nothing.
    pub note: &'static str,
}

impl Parameter for Entry {
    const KIND: &'static str = "entry";
    const EXAMPLE: &'static str = "0x0086, 0x0232:5";

    fn all() -> &'static [Self] {
        &ALL
    }

    /// `index:sub-index` in hexadecimal: `86`, `0x0232`, `0232:5`. One that the table does not have can be read and written as well.
    fn at(address: &str) -> Option<Self> {
        let address = EntryAddress::parse(address)?;
        Some(find(address).copied().unwrap_or(Self::unlisted(address)))
    }

    fn address(&self) -> String {
        self.address.to_string()
    }

    fn name(&self) -> &'static str {
        self.name
    }

    fn access(&self) -> Access {
        self.access
    }

    fn unit(&self) -> Unit {
        self.unit
    }

    fn values(&self) -> Values {
        self.values
    }

    fn range(&self) -> (i64, i64) {
        (i32::MIN.into(), i32::MAX.into())
    }

    fn note(&self) -> &'static str {
        self.note
    }
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_listed() { write!(f, "{} ({})", self.name, self.address) } else { self.address.fmt(f) }
    }
}

/// The entry at an address, if the table has it.
pub fn find(address: EntryAddress) -> Option<&'static Entry> {
    ALL.iter().find(|entry| entry.address == address)
}

/// The entry at an address with its name, or the address alone.
pub fn describe(address: EntryAddress) -> String {
    find(address).map_or_else(|| address.to_string(), Entry::to_string)
}

const YES_NO: Values = Values::Named(&[(0, "no"), (1, "yes")]);

const fn read(index: u16, name: &'static str, unit: Unit) -> Entry {
    Entry {
        address: EntryAddress::new(index),
        name,
        access: Access::Read,
        unit,
        values: Values::Any,
        note: "",
    }
}

const fn read_sub(index: u16, sub_index: u16, name: &'static str) -> Entry {
    Entry { address: EntryAddress::sub(index, sub_index), ..read(index, name, Unit::None) }
}

const fn set(index: u16, name: &'static str, unit: Unit) -> Entry {
    Entry { access: Access::ReadWrite, ..read(index, name, unit) }
}

const fn command(index: u16, name: &'static str) -> Entry {
    Entry { access: Access::Command, ..read(index, name, Unit::None) }
}

impl Entry {
    /// An address that the table does not have: what is known of it is that it has 32 bits.
    const fn unlisted(address: EntryAddress) -> Self {
        Self {
            address,
            name: "entry",
            access: Access::ReadWrite,
            unit: Unit::None,
            values: Values::Any,
            note: "",
        }
    }

    /// Returns `true` if the table has it.
    pub fn is_listed(&self) -> bool {
        find(self.address).is_some()
    }

    const fn with_note(self, note: &'static str) -> Self {
        Self { note, ..self }
    }

    const fn taking(self, values: Values) -> Self {
        Self { values, ..self }
    }

    const fn with_access(self, access: Access) -> Self {
        Self { access, ..self }
    }
}

/// Hardware version.
pub const HARDWARE_VERSION: Entry = read_sub(0x0001, 3, "hardware version");
/// Firmware version.
pub const FIRMWARE_VERSION: Entry = read_sub(0x0001, 4, "firmware version");
/// Actual position.
pub const ACTUAL_POSITION: Entry =
    read(0x0002, "actual position", Unit::Counts).with_note("at the output; it may lie beyond one turn");
/// Actual velocity.
pub const ACTUAL_VELOCITY: Entry =
    Entry { unit: Unit::CountsPerSecond, ..read_sub(0x0005, 1, "actual velocity") };
/// Actual motor current.
pub const MOTOR_CURRENT: Entry = read(0x0008, "actual motor current", Unit::Milliamperes);
/// Phase U current.
pub const PHASE_U_CURRENT: Entry = read(0x0009, "phase U current", Unit::Milliamperes);
/// Phase V current.
pub const PHASE_V_CURRENT: Entry = read(0x000A, "phase V current", Unit::Milliamperes);
/// Phase U voltage.
pub const PHASE_U_VOLTAGE: Entry =
    read(0x000D, "phase U voltage", Unit::Millivolts).with_note("printed in mA, as no other voltage is");
/// Phase V voltage.
pub const PHASE_V_VOLTAGE: Entry = read(0x000E, "phase V voltage", Unit::Millivolts);
/// Phase W voltage.
pub const PHASE_W_VOLTAGE: Entry = read(0x000F, "phase W voltage", Unit::Millivolts);
/// Error code.
pub const ERROR_CODE: Entry = read(0x001F, "error code", Unit::None)
    .with_note("0 is ready; the others stand in appendix 2 of the eRob user manual");
/// Running state.
pub const RUNNING_STATE: Entry = read(0x0020, "running state", Unit::None)
    .taking(Values::Named(&[(0, "stopped"), (1, "moving"), (3, "stopping reciprocation")]))
    .with_note("the numbers are those of the Modbus manual; try them on hardware");
/// Digital inputs.
pub const DIGITAL_INPUTS: Entry = read(0x0022, "digital inputs", Unit::None)
    .with_note("bits 0 to 5 are IN1 to IN6; joint modules have IN1 and IN2");
/// Analogue input.
pub const ANALOGUE_INPUT: Entry = read(0x0023, "analogue input", Unit::Millivolts);
/// DC bus voltage.
pub const BUS_VOLTAGE: Entry = read(0x0024, "DC bus voltage", Unit::Millivolts);
/// Power stage temperature.
pub const TEMPERATURE: Entry = read(0x0026, "power stage temperature", Unit::Celsius);
/// Continuous current.
pub const CONTINUOUS_CURRENT: Entry =
    read(0x0033, "continuous current", Unit::Milliamperes).with_note("eTunner, page safety power supply");
/// Peak current.
pub const PEAK_CURRENT: Entry =
    read(0x0034, "peak current", Unit::Milliamperes).with_note("eTunner, page safety power supply");
/// Peak current duration.
pub const PEAK_CURRENT_DURATION: Entry = read(0x0035, "peak current duration", Unit::Milliseconds)
    .with_note("for so long the peak current may flow");
/// CAN address.
pub const CAN_ADDRESS: Entry =
    set(0x0043, "CAN address", Unit::None).taking(Values::Range(1, 64)).with_note("the node ID of the joint");
/// CAN bit rate.
pub const BIT_RATE: Entry =
    read(0x0044, "CAN bit rate", Unit::BitsPerSecond).with_note("1 Mbit/s, which cannot be changed");
/// Operating mode.
pub const OPERATING_MODE: Entry = set(0x004E, "operating mode", Unit::None)
    .taking(Values::Named(&[(1, "torque control"), (2, "velocity control"), (3, "position control")]))
    .with_note("disable before a change; 4 is printed too, with a meaning that nobody can read");
/// Maximum velocity.
pub const MAXIMUM_VELOCITY: Entry =
    set(0x0050, "maximum velocity", Unit::CountsPerSecond).taking(Values::NotNegative);
/// Position limit minimum.
pub const POSITION_LIMIT_MINIMUM: Entry = set(0x0052, "position limit minimum", Unit::Counts);
/// Position limit maximum.
pub const POSITION_LIMIT_MAXIMUM: Entry = set(0x0053, "position limit maximum", Unit::Counts);
/// Maximum position error.
pub const MAXIMUM_POSITION_ERROR: Entry = set(0x0054, "maximum position error", Unit::DistanceCounts)
    .taking(Values::NotNegative)
    .with_note("a fault beyond it; from the factory 5242 to 10484, of the eRob142 1800 to 4320");
/// Maximum velocity error.
pub const MAXIMUM_VELOCITY_ERROR: Entry = set(0x0055, "maximum velocity error", Unit::CountsPerSecond)
    .taking(Values::NotNegative)
    .with_note("a fault beyond it; from the factory 42000 to 84000");
/// Stall current.
pub const STALL_CURRENT: Entry = set(0x0056, "stall current", Unit::Milliamperes)
    .taking(Values::NotNegative)
    .with_note("from the factory 120 % of the continuous current, of the eRob110 and eRob142 110 %");
/// Stall velocity.
pub const STALL_VELOCITY: Entry = set(0x0057, "stall velocity", Unit::CountsPerSecond)
    .taking(Values::NotNegative)
    .with_note("a fault below it, with more than the stall current for the stall time");
/// Stall time.
pub const STALL_TIME: Entry = set(0x0058, "stall time", Unit::Milliseconds).taking(Values::NotNegative);
/// Maximum phase current.
pub const MAXIMUM_PHASE_CURRENT: Entry = set(0x0062, "maximum phase current", Unit::Milliamperes)
    .taking(Values::NotNegative)
    .with_note("the drive shuts off beyond it");
/// Maximum motor current.
pub const MAXIMUM_MOTOR_CURRENT: Entry = set(0x0063, "maximum motor current", Unit::Milliamperes)
    .taking(Values::NotNegative)
    .with_note("the drive shuts off beyond it");
/// Position loop gain.
pub const POSITION_LOOP_GAIN: Entry = set(0x0064, "position loop gain", Unit::None)
    .taking(Values::NotNegative)
    .with_note("the factory value suits most uses");
/// Velocity loop gain.
pub const VELOCITY_LOOP_GAIN: Entry = set(0x0066, "velocity loop gain", Unit::None)
    .taking(Values::NotNegative)
    .with_note("the factory value suits most uses");
/// Velocity loop integral.
pub const VELOCITY_LOOP_INTEGRAL: Entry = set(0x0067, "velocity loop integral", Unit::None)
    .taking(Values::NotNegative)
    .with_note("the factory value suits most uses");
/// Start motion.
pub const START_MOTION: Entry = command(0x0083, "start motion");
/// Stop motion.
pub const STOP_MOTION: Entry = command(0x0084, "stop motion").with_note("with the profile deceleration");
/// Absolute target position.
pub const TARGET_POSITION: Entry =
    set(0x0086, "absolute target position", Unit::Counts).with_note("the relative position must be 0");
/// Relative position.
pub const RELATIVE_POSITION: Entry = set(0x0087, "relative position", Unit::DistanceCounts)
    .with_note("0 for an absolute move; the sign is the direction");
/// Profile acceleration.
pub const PROFILE_ACCELERATION: Entry = set(0x0088, "profile acceleration", Unit::CountsPerSecondSquared)
    .taking(Values::NotNegative)
    .with_note("at most three times the profile velocity is advised");
/// Profile deceleration.
pub const PROFILE_DECELERATION: Entry = set(0x0089, "profile deceleration", Unit::CountsPerSecondSquared)
    .taking(Values::NotNegative)
    .with_note("at most three times the profile velocity is advised");
/// Profile velocity.
pub const PROFILE_VELOCITY: Entry = set(0x008A, "profile velocity", Unit::CountsPerSecond)
    .with_note("its sign is the direction of continuous motion, in which it may be changed");
/// Jerk setting.
pub const JERK_SETTING: Entry = set(0x008B, "jerk setting", Unit::None).taking(Values::Named(&[
    (0, "50 µs"),
    (1, "100 µs"),
    (2, "200 µs"),
    (3, "400 µs"),
    (4, "800 µs"),
    (5, "1600 µs"),
    (6, "3200 µs"),
    (7, "6400 µs"),
    (8, "12800 µs"),
    (9, "25600 µs"),
]));
/// Quick-stop deceleration.
pub const QUICK_STOP_DECELERATION: Entry =
    set(0x008C, "quick-stop deceleration", Unit::CountsPerSecondSquared)
        .taking(Values::NotNegative)
        .with_note("at a temperature alarm, and at a position limit");
/// Motion mode.
pub const MOTION_MODE: Entry = set(0x008D, "motion mode", Unit::None)
    .taking(Values::Named(&[(0, "continuous"), (1, "target position"), (2, "reciprocating")]))
    .with_note("stop before a change");
/// Dwell time.
pub const DWELL_TIME: Entry = set(0x0093, "dwell time", Unit::Milliseconds)
    .taking(Values::NotNegative)
    .with_note("at each reversal of reciprocating motion");
/// Motor angle.
pub const MOTOR_ANGLE: Entry =
    read(0x009C, "motor angle", Unit::EncoderCounts).with_note("of the encoder on the motor's side");
/// Apply acceleration limits to all motion.
pub const LIMITS_APPLY: Entry =
    set(0x009E, "apply acceleration limits to all motion", Unit::None).taking(YES_NO);
/// Load angle.
pub const LOAD_ANGLE: Entry = read(0x009F, "load angle", Unit::EncoderCounts)
    .with_note("of the single-turn encoder on the load's side");
/// Save parameters.
pub const SAVE: Entry = command(0x00E8, "save parameters").with_note("leave the power on for 3 s");
/// Three-phase current sum error.
pub const PHASE_CURRENT_SUM_ERROR: Entry =
    set(0x00FD, "three-phase current sum error", Unit::Milliamperes).taking(Values::NotNegative);
/// Phase W current.
pub const PHASE_W_CURRENT: Entry = read(0x00FE, "phase W current", Unit::Milliamperes);
/// COM number.
pub const COM_NUMBER: Entry =
    set(0x00FF, "COM number", Unit::None).taking(Values::NotNegative).with_note("the ID on the RS-485 line");
/// Motor enable.
pub const MOTOR_ENABLE: Entry = command(0x0100, "motor enable")
    .with_access(Access::CommandWithArgument)
    .taking(Values::Named(&[(0, "disable"), (1, "enable")]));
/// Positioning-complete threshold.
pub const POSITIONED_THRESHOLD: Entry =
    set(0x0109, "positioning-complete threshold", Unit::DistanceCounts).taking(Values::NotNegative);
/// Positioning-complete time.
pub const POSITIONED_TIME: Entry =
    set(0x010A, "positioning-complete time", Unit::Milliseconds).taking(Values::NotNegative);
/// Target-reached state.
pub const TARGET_REACHED_STATE: Entry = read(0x010C, "target-reached state", Unit::None)
    .taking(Values::Named(&[
        (0, "motor off"),
        (1, "motor on"),
        (2, "running"),
        (3, "settling"),
        (4, "target reached"),
    ]))
    .with_note("2 is that of the Modbus manual");
/// Control source.
pub const CONTROL_SOURCE: Entry = set(0x0112, "control source", Unit::None)
    .taking(Values::Named(&[(0, "not used"), (1, "EtherCAT")]))
    .with_note("16 is printed too, with a meaning that nobody can read");
/// Reset load-side encoder.
pub const RESET_LOAD_ENCODER: Entry = command(0x0114, "reset load-side encoder")
    .with_access(Access::CommandWithArgument)
    .taking(Values::Range(1, 1))
    .with_note(
        "WIPES THE MULTI-TURN COUNT: home the joint again; only after a battery alarm of a multi-turn model",
    );
/// Encoder difference.
pub const ENCODER_DIFFERENCE: Entry = read(0x0119, "encoder difference", Unit::EncoderCounts)
    .with_note("between the two encoders, a measure of the torque; in no table of the manual, read by a program of the vendor");
/// Allow loop changes over the bus.
pub const LOOP_CHANGES: Entry = set(0x0124, "allow loop changes over the bus", Unit::None).taking(YES_NO);
/// Maximum output torque.
pub const MAXIMUM_TORQUE: Entry = set(0x0129, "maximum output torque", Unit::PerMille)
    .taking(Values::NotNegative)
    .with_note("of the continuous current: sets the peak current");
/// Release brake.
pub const RELEASE_BRAKE: Entry = command(0x014F, "release brake").with_note("nothing holds the joint then");
/// Analogue quantity type.
pub const ANALOGUE_TYPE: Entry = set(0x01FD, "analogue quantity type", Unit::None)
    .with_access(Access::Write)
    .taking(Values::Named(&[(0, "internal")]))
    .with_note("not in the table of the manual, and used in its procedures");
/// Analogue quantity: the set-point of velocity and torque control.
pub const SET_POINT: Entry =
    set(0x01FE, "analogue quantity", Unit::None).with_access(Access::Write).with_note(
        "the set-point: count/s in velocity control, mA in torque control; not in the table of the manual",
    );
/// Torque-mode velocity limit.
pub const TORQUE_VELOCITY_LIMIT: Entry = set(0x0204, "torque-mode velocity limit", Unit::CountsPerSecond)
    .taking(Values::NotNegative)
    .with_note("may be changed only while disabled");
/// Torque sensor value.
pub const TORQUE_SENSOR: Entry =
    read(0x020D, "torque sensor value", Unit::MillinewtonMetres).with_note("of models with a torque sensor");
/// Module serial counter.
pub const SERIAL_COUNTER: Entry =
    read_sub(0x0232, 1, "module serial counter").with_note("as all of index 0232 from firmware X5061715X on");
/// Module model information A.
pub const MODEL_A: Entry = read_sub(0x0232, 2, "module model information A");
/// Module model information B.
pub const MODEL_B: Entry = read_sub(0x0232, 5, "module model information B");
/// Hardware change identifier.
pub const HARDWARE_CHANGE: Entry = read_sub(0x0232, 6, "hardware change identifier");
/// IO function identifier.
pub const IO_IDENTIFIER: Entry = read_sub(0x0232, 7, "IO function identifier")
    .with_note("modules with EtherCAT always have inputs and outputs, and show 0");
/// Module version.
pub const MODULE_VERSION: Entry = read_sub(0x0232, 8, "module version");

/// Every entry, in the order of their addresses.
pub static ALL: [Entry; 73] = [
    HARDWARE_VERSION,
    FIRMWARE_VERSION,
    ACTUAL_POSITION,
    ACTUAL_VELOCITY,
    MOTOR_CURRENT,
    PHASE_U_CURRENT,
    PHASE_V_CURRENT,
    PHASE_U_VOLTAGE,
    PHASE_V_VOLTAGE,
    PHASE_W_VOLTAGE,
    ERROR_CODE,
    RUNNING_STATE,
    DIGITAL_INPUTS,
    ANALOGUE_INPUT,
    BUS_VOLTAGE,
    TEMPERATURE,
    CONTINUOUS_CURRENT,
    PEAK_CURRENT,
    PEAK_CURRENT_DURATION,
    CAN_ADDRESS,
    BIT_RATE,
    OPERATING_MODE,
    MAXIMUM_VELOCITY,
    POSITION_LIMIT_MINIMUM,
    POSITION_LIMIT_MAXIMUM,
    MAXIMUM_POSITION_ERROR,
    MAXIMUM_VELOCITY_ERROR,
    STALL_CURRENT,
    STALL_VELOCITY,
    STALL_TIME,
    MAXIMUM_PHASE_CURRENT,
    MAXIMUM_MOTOR_CURRENT,
    POSITION_LOOP_GAIN,
    VELOCITY_LOOP_GAIN,
    VELOCITY_LOOP_INTEGRAL,
    START_MOTION,
    STOP_MOTION,
    TARGET_POSITION,
    RELATIVE_POSITION,
    PROFILE_ACCELERATION,
    PROFILE_DECELERATION,
    PROFILE_VELOCITY,
    JERK_SETTING,
    QUICK_STOP_DECELERATION,
    MOTION_MODE,
    DWELL_TIME,
    MOTOR_ANGLE,
    LIMITS_APPLY,
    LOAD_ANGLE,
    SAVE,
    PHASE_CURRENT_SUM_ERROR,
    PHASE_W_CURRENT,
    COM_NUMBER,
    MOTOR_ENABLE,
    POSITIONED_THRESHOLD,
    POSITIONED_TIME,
    TARGET_REACHED_STATE,
    CONTROL_SOURCE,
    RESET_LOAD_ENCODER,
    ENCODER_DIFFERENCE,
    LOOP_CHANGES,
    MAXIMUM_TORQUE,
    RELEASE_BRAKE,
    ANALOGUE_TYPE,
    SET_POINT,
    TORQUE_VELOCITY_LIMIT,
    TORQUE_SENSOR,
    SERIAL_COUNTER,
    MODEL_A,
    MODEL_B,
    HARDWARE_CHANGE,
    IO_IDENTIFIER,
    MODULE_VERSION,
];
