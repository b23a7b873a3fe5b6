//! The registers of a drive (eRob Modbus-RTU manual 1.5, tables 4-1 and 5-1 to 5-6). Where the manual says nothing of a sign, the
//! reading is argued in its companion table (`tests/vectors/erob-modbus-registers.csv`).

use std::fmt;

use arrayvec::ArrayVec;

/// A register, or two that make one number of 32 bits: the high word has the lower address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// Its address as it is on the wire; that of the high word where there are two.
    pub address: u16,
    /// Its name.
    pub name: &'static str,
    /// What may be done with it.
    pub access: Access,
    /// Its width and its sign.
    pub number: Number,
    /// The unit of its number on the wire.
    pub unit: Unit,
    /// Which numbers it takes, or shows.
    pub values: Values,
    /// What else must be known of it; empty if nothing.
    pub note: &'static str,
}

/// What may be done with a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// It is read.
    Read,
    /// It is read and written.
    ReadWrite,
    /// A write is a command; there is nothing to read.
    Command,
}

impl Access {
    /// Whether the register can be read.
    pub const fn can_read(self) -> bool {
        matches!(self, Self::Read | Self::ReadWrite)
    }

    /// Whether the register can be written.
    pub const fn can_write(self) -> bool {
        matches!(self, Self::ReadWrite | Self::Command)
    }
}

/// How a number is written into registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    /// 16 bits without a sign.
    Word,
    /// 16 bits with a sign.
    SignedWord,
    /// 32 bits without a sign.
    Double,
    /// 32 bits with a sign.
    SignedDouble,
}

impl Number {
    /// How many registers it takes.
    pub const fn words(self) -> u16 {
        match self {
            Self::Word | Self::SignedWord => 1,
            Self::Double | Self::SignedDouble => 2,
        }
    }

    /// The least and the greatest number.
    pub const fn range(self) -> (i64, i64) {
        match self {
            Self::Word => (0, u16::MAX as i64),
            Self::SignedWord => (i16::MIN as i64, i16::MAX as i64),
            Self::Double => (0, u32::MAX as i64),
            Self::SignedDouble => (i32::MIN as i64, i32::MAX as i64),
        }
    }
}

/// The unit of a number on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// None: a plain number.
    None,
    /// Counts at the output: 524288 are a turn (the vendor's other manuals; this one does not say).
    Counts,
    /// Counts per second.
    CountsPerSecond,
    /// Counts per second squared.
    CountsPerSecondSquared,
    /// Milliamperes.
    Milliamperes,
    /// Millivolts.
    Millivolts,
    /// Milliseconds.
    Milliseconds,
    /// Times of 0.05 ms.
    FiftyMicroseconds,
    /// Degrees Celsius.
    Celsius,
    /// Millinewton-metres.
    MillinewtonMetres,
}

impl Unit {
    /// The unit as it is written behind a number; empty for a plain number.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Counts => "count",
            Self::CountsPerSecond => "count/s",
            Self::CountsPerSecondSquared => "count/s²",
            Self::Milliamperes => "mA",
            Self::Millivolts => "mV",
            Self::Milliseconds => "ms",
            Self::FiftyMicroseconds => "× 0.05 ms",
            Self::Celsius => "°C",
            Self::MillinewtonMetres => "mN·m",
        }
    }
}

/// The numbers that a register takes or shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// Any that its words can hold.
    Any,
    /// Those from here to there.
    Range(i64, i64),
    /// These, with their meanings.
    Named(&'static [(i64, &'static str)]),
}

impl fmt::Display for Values {
    /// Nothing for any.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Any => Ok(()),
            Self::Range(lowest, highest) => write!(f, "{lowest} to {highest}"),
            Self::Named(names) => {
                for (place, (value, name)) in names.iter().enumerate() {
                    write!(f, "{}{value} ({name})", if place > 0 { ", " } else { "" })?;
                }
                Ok(())
            }
        }
    }
}

/// A value that a register does not take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ValueError {
    /// The register.
    pub register: Register,
    /// The value.
    pub value: i64,
}

impl std::error::Error for ValueError {}

impl fmt::Display for ValueError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} cannot be {}: it takes ", self.register, self.value)?;
        match self.register.values {
            Values::Any => {
                let (lowest, highest) = self.register.number.range();
                write!(f, "{lowest} to {highest}")
            }
            values => values.fmt(f),
        }
    }
}

impl Register {
    /// The words of a value, the high one first.
    ///
    /// # Errors
    /// The register does not take the value.
    pub fn encode(&self, value: i64) -> Result<ArrayVec<u16, 2>, ValueError> {
        let (lowest, highest) = self.number.range();
        let is_taken = match self.values {
            Values::Any => true,
            Values::Range(lowest, highest) => (lowest..=highest).contains(&value),
            Values::Named(names) => names.iter().any(|(known, _)| *known == value),
        };
        if !is_taken || value < lowest || value > highest {
            return Err(ValueError { register: *self, value });
        }
        let mut words = ArrayVec::new();
        if self.number.words() == 2 {
            words.push((value >> 16) as u16);
        }
        words.push(value as u16);
        Ok(words)
    }

    /// The value of words; `None` if their number is wrong.
    pub fn decode(&self, words: &[u16]) -> Option<i64> {
        match (self.number, words) {
            (Number::Word, [word]) => Some((*word).into()),
            (Number::SignedWord, [word]) => Some(word.cast_signed().into()),
            (Number::Double, [high, low]) => Some(double(*high, *low).into()),
            (Number::SignedDouble, [high, low]) => Some(double(*high, *low).cast_signed().into()),
            _ => None,
        }
    }

    /// A value in words: with its unit, or its meaning.
    pub fn show(&self, value: i64) -> String {
        let meaning = match self.values {
            Values::Named(names) => names.iter().find(|(known, _)| *known == value),
            Values::Any | Values::Range(..) => None,
        };
        match (meaning, self.unit.symbol()) {
            (Some((_, meaning)), _) => format!("{value} ({meaning})"),
            (None, "") => value.to_string(),
            (None, unit) => format!("{value} {unit}"),
        }
    }

    /// Whether it makes no difference how often a value is written: not for commands that act anew each time.
    pub fn may_be_repeated(&self) -> bool {
        ![START_MOTION, CLEAR_FAULT, SAVE, RESET_ENCODER].contains(self)
    }
}

impl fmt::Display for Register {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (0x{:04X})", self.name, self.address)
    }
}

const fn double(high: u16, low: u16) -> u32 {
    (high as u32) << 16 | low as u32
}

/// The register at an address, if the table has it.
pub fn find(address: u16) -> Option<&'static Register> {
    ALL.iter().find(|register| register.address == address)
}

/// The register with this name, with blanks or hyphens, or with this address as `0x…`.
pub fn named(text: &str) -> Option<&'static Register> {
    let text = text.trim().to_lowercase();
    match text.strip_prefix("0x") {
        Some(address) => find(u16::from_str_radix(address, 16).ok()?),
        None => ALL
            .iter()
            .find(|register| register.name.to_lowercase().replace(' ', "-") == text.replace(' ', "-")),
    }
}

const fn read(address: u16, name: &'static str, unit: Unit) -> Register {
    Register {
        address,
        name,
        access: Access::Read,
        number: Number::Word,
        unit,
        values: Values::Any,
        note: "",
    }
}

const fn read_double(address: u16, name: &'static str, unit: Unit) -> Register {
    Register { number: Number::Double, ..read(address, name, unit) }
}

const fn set(address: u16, name: &'static str, unit: Unit) -> Register {
    Register { access: Access::ReadWrite, ..read(address, name, unit) }
}

const fn set_double(address: u16, name: &'static str, unit: Unit) -> Register {
    Register { number: Number::Double, ..set(address, name, unit) }
}

const fn command(address: u16, name: &'static str) -> Register {
    Register { access: Access::Command, ..read(address, name, Unit::None) }
}

impl Register {
    const fn note(self, note: &'static str) -> Self {
        Self { note, ..self }
    }

    const fn values(self, values: Values) -> Self {
        Self { values, ..self }
    }

    const fn signed(self) -> Self {
        let number = match self.number {
            Number::Word | Number::SignedWord => Number::SignedWord,
            Number::Double | Number::SignedDouble => Number::SignedDouble,
        };
        Self { number, ..self }
    }
}

/// Slave address.
pub const SLAVE_ADDRESS: Register = set(0x0000, "slave address", Unit::None)
    .values(Values::Range(1, 247))
    .note("counts after saving and a power cycle; the manual prints 1 to 255, the standard has 247");
/// Bit rate.
pub const BIT_RATE: Register = set(0x0001, "bit rate", Unit::None)
    .values(Values::Named(&[(1, "9600 bit/s"), (2, "19200 bit/s"), (3, "38400 bit/s"), (4, "115200 bit/s")]))
    .note("save, then switch the power off and on (the manual says so of the address alone)");
/// Communication time-out.
pub const COMMUNICATION_TIMEOUT: Register = set(0x0002, "communication time-out", Unit::Milliseconds)
    .values(Values::Range(0, 4_000))
    .note("0 is off, as from the factory; it counts from the first request of a master; then fault 0x0FA2");
/// Position loop gain.
pub const POSITION_LOOP_GAIN: Register = set(0x0030, "position loop gain", Unit::None);
/// Velocity loop gain.
pub const VELOCITY_LOOP_GAIN: Register = set(0x0031, "velocity loop gain", Unit::None);
/// Velocity loop integral.
pub const VELOCITY_LOOP_INTEGRAL: Register = set(0x0032, "velocity loop integral", Unit::None);
/// Operation mode.
pub const OPERATION_MODE: Register = set(0x0040, "operation mode", Unit::None)
    .values(Values::Named(&[(1, "torque control"), (2, "velocity control"), (3, "position control")]))
    .note("disable before a change");
/// Motion mode.
pub const MOTION_MODE: Register = set(0x0041, "motion mode", Unit::None)
    .values(Values::Named(&[(0, "continuous"), (1, "target position"), (2, "reciprocating")]))
    .note("of position control; 1 is for absolute and for relative moves");
/// Control source.
pub const CONTROL_SOURCE: Register = set(0x0042, "control source", Unit::None)
    .values(Values::Named(&[(0, "not used"), (1, "EtherCAT")]))
    .note("0 for every motion by Modbus");
/// Target absolute position.
pub const TARGET_POSITION: Register = set_double(0x0043, "target absolute position", Unit::Counts).signed();
/// Target relative position.
pub const RELATIVE_POSITION: Register = set_double(0x0045, "target relative position", Unit::Counts)
    .signed()
    .note("what is not 0 makes a move a relative one");
/// Profile velocity.
pub const PROFILE_VELOCITY: Register = set_double(0x0047, "profile velocity", Unit::CountsPerSecond)
    .signed()
    .note("negative for backward in a continuous motion alone");
/// Profile acceleration.
pub const PROFILE_ACCELERATION: Register =
    set_double(0x0049, "profile acceleration", Unit::CountsPerSecondSquared);
/// Profile deceleration.
pub const PROFILE_DECELERATION: Register =
    set_double(0x004B, "profile deceleration", Unit::CountsPerSecondSquared).note("the stop command uses it");
/// Reciprocating dwell time.
pub const DWELL_TIME: Register =
    set_double(0x004D, "reciprocating dwell time", Unit::FiftyMicroseconds).note("at each reversal");
/// Target current.
pub const TARGET_CURRENT: Register = set_double(0x004F, "target current", Unit::Milliamperes)
    .signed()
    .note("of torque control; it acts as soon as it is written");
/// Target velocity.
pub const TARGET_VELOCITY: Register = set_double(0x0051, "target velocity", Unit::CountsPerSecond)
    .signed()
    .note("of velocity control; it acts as soon as it is written");
/// Fault code.
pub const FAULT_CODE: Register = read(0x0060, "fault code", Unit::None).note("0 is taken for no fault");
/// Motion status.
pub const MOTION_STATUS: Register = read(0x0061, "motion status", Unit::None)
    .values(Values::Named(&[(0, "stopped"), (1, "moving"), (3, "reciprocating motion stopped")]))
    .note("2 is not defined");
/// Position reached status.
pub const REACHED_STATUS: Register =
    read(0x0063, "position reached status", Unit::None).values(Values::Named(&[
        (0, "motor off"),
        (1, "motor on"),
        (2, "running"),
        (3, "settling"),
        (4, "target reached"),
    ]));
/// Demanded position.
pub const DEMANDED_POSITION: Register = read_double(0x0064, "demanded position", Unit::Counts).signed();
/// Actual position.
pub const ACTUAL_POSITION: Register = read_double(0x0066, "actual position", Unit::Counts).signed();
/// Position error.
pub const POSITION_ERROR: Register = read_double(0x0068, "position error", Unit::Counts).signed();
/// Demanded velocity.
pub const DEMANDED_VELOCITY: Register =
    read_double(0x006C, "demanded velocity", Unit::CountsPerSecond).signed();
/// Actual velocity.
pub const ACTUAL_VELOCITY: Register = read_double(0x006E, "actual velocity", Unit::CountsPerSecond).signed();
/// Velocity error.
pub const VELOCITY_ERROR: Register = read_double(0x0070, "velocity error", Unit::CountsPerSecond).signed();
/// Demanded current.
pub const DEMANDED_CURRENT: Register = read_double(0x0072, "demanded current", Unit::Milliamperes).signed();
/// Motor current.
pub const MOTOR_CURRENT: Register = read_double(0x0074, "motor current", Unit::Milliamperes).signed();
/// DC bus voltage.
pub const BUS_VOLTAGE: Register = read_double(0x0076, "DC bus voltage", Unit::Millivolts);
/// Power stage temperature.
pub const TEMPERATURE: Register = read(0x0078, "power stage temperature", Unit::Celsius)
    .signed()
    .note("the sensor reaches from -20 to 150 °C");
/// Position reached window.
pub const REACHED_WINDOW: Register = set(0x0079, "position reached window", Unit::Counts);
/// Position reached time.
pub const REACHED_TIME: Register = set(0x007A, "position reached time", Unit::FiftyMicroseconds)
    .note("so long the position must stay in its window");
/// Torque sensor value.
pub const TORQUE_SENSOR: Register = read_double(0x007B, "torque sensor value", Unit::MillinewtonMetres)
    .signed()
    .note("of models with a torque sensor");
/// Dual encoder difference.
pub const ENCODER_DIFFERENCE: Register = read_double(0x007D, "dual encoder difference", Unit::Counts)
    .signed()
    .note("of the encoders at load and motor: how far the gear is twisted; its sign is not stated");
/// Continuous current.
pub const CONTINUOUS_CURRENT: Register = set_double(0x00B0, "continuous current", Unit::Milliamperes);
/// Peak current.
pub const PEAK_CURRENT: Register = set_double(0x00B2, "peak current", Unit::Milliamperes);
/// Peak current duration.
pub const PEAK_CURRENT_DURATION: Register =
    set(0x00B4, "peak current duration", Unit::Milliseconds).note("for so long the peak current may flow");
/// Maximum velocity.
pub const MAXIMUM_VELOCITY: Register = set_double(0x00B5, "maximum velocity", Unit::CountsPerSecond);
/// Maximum acceleration.
pub const MAXIMUM_ACCELERATION: Register =
    set_double(0x00B7, "maximum acceleration", Unit::CountsPerSecondSquared);
/// Maximum position error.
pub const MAXIMUM_POSITION_ERROR: Register =
    set_double(0x00B9, "maximum position error", Unit::Counts).note("a fault beyond it");
/// Maximum velocity error.
pub const MAXIMUM_VELOCITY_ERROR: Register =
    set_double(0x00BB, "maximum velocity error", Unit::CountsPerSecond).note("a fault beyond it");
/// Position limit minimum.
pub const POSITION_LIMIT_MINIMUM: Register =
    set_double(0x00BD, "position limit minimum", Unit::Counts).signed();
/// Position limit maximum.
pub const POSITION_LIMIT_MAXIMUM: Register =
    set_double(0x00BF, "position limit maximum", Unit::Counts).signed();
/// Maximum phase current.
pub const MAXIMUM_PHASE_CURRENT: Register = set_double(0x00C1, "maximum phase current", Unit::Milliamperes);
/// Maximum motor current.
pub const MAXIMUM_MOTOR_CURRENT: Register = set_double(0x00C3, "maximum motor current", Unit::Milliamperes);
/// Stall current.
pub const STALL_CURRENT: Register = set_double(0x00C5, "stall current", Unit::Milliamperes);
/// Stall velocity.
pub const STALL_VELOCITY: Register = set_double(0x00C7, "stall velocity", Unit::CountsPerSecond);
/// Stall time.
pub const STALL_TIME: Register = set(0x00C9, "stall time", Unit::FiftyMicroseconds)
    .note("a fault after this time with more than the stall current and less than the stall velocity");
/// Minimum bus voltage.
pub const MINIMUM_BUS_VOLTAGE: Register = set_double(0x00CA, "minimum bus voltage", Unit::Millivolts);
/// Maximum bus voltage.
pub const MAXIMUM_BUS_VOLTAGE: Register = set_double(0x00CC, "maximum bus voltage", Unit::Millivolts);
/// Power stage temperature limit.
pub const TEMPERATURE_LIMIT: Register =
    set(0x00D1, "power stage temperature limit", Unit::Celsius).signed().note("85 °C at most is advised");
/// Torque-mode velocity limit.
pub const TORQUE_VELOCITY_LIMIT: Register = set_double(0x00D8, "torque-mode velocity limit", Unit::CountsPerSecond).signed()
    .note("in the torque sequence of the manual and in none of its tables; 0 may mean no limit, so write a positive one");
/// Motor enable.
pub const MOTOR_ENABLE: Register = command(0x00F0, "motor enable")
    .values(Values::Named(&[(0, "disable"), (1, "enable")]))
    .note("wait 500 ms after enabling; the brake follows by itself");
/// Start motion.
pub const START_MOTION: Register = command(0x00F1, "start motion").note("of position control; any value");
/// Stop motion.
pub const STOP_MOTION: Register = command(0x00F2, "stop motion")
    .note("with the profile deceleration; any value; in torque control it also disables");
/// Emergency stop.
pub const EMERGENCY_STOP: Register = command(0x00F3, "emergency stop")
    .note("in less than 50 ms: a shock for the gear, and the bus voltage rises; which value is not stated");
/// Stop reciprocation.
pub const STOP_RECIPROCATION: Register =
    command(0x00F4, "stop reciprocation").note("the motion ends at its next end; any value");
/// Clear fault.
pub const CLEAR_FAULT: Register = command(0x00F6, "clear fault").values(Values::Range(1, 0xFFFF));
/// Save parameters.
pub const SAVE: Register =
    command(0x00F7, "save parameters").note("takes 3 s, in which the power must stay on; any value");
/// Reset load-side encoder.
pub const RESET_ENCODER: Register = command(0x00F9, "reset load-side encoder")
    .note("wipes the count of turns; for the battery alarm of multi-turn models alone; any value");

/// Every register, in the order of the addresses.
pub static ALL: [Register; 60] = [
    SLAVE_ADDRESS,
    BIT_RATE,
    COMMUNICATION_TIMEOUT,
    POSITION_LOOP_GAIN,
    VELOCITY_LOOP_GAIN,
    VELOCITY_LOOP_INTEGRAL,
    OPERATION_MODE,
    MOTION_MODE,
    CONTROL_SOURCE,
    TARGET_POSITION,
    RELATIVE_POSITION,
    PROFILE_VELOCITY,
    PROFILE_ACCELERATION,
    PROFILE_DECELERATION,
    DWELL_TIME,
    TARGET_CURRENT,
    TARGET_VELOCITY,
    FAULT_CODE,
    MOTION_STATUS,
    REACHED_STATUS,
    DEMANDED_POSITION,
    ACTUAL_POSITION,
    POSITION_ERROR,
    DEMANDED_VELOCITY,
    ACTUAL_VELOCITY,
    VELOCITY_ERROR,
    DEMANDED_CURRENT,
    MOTOR_CURRENT,
    BUS_VOLTAGE,
    TEMPERATURE,
    REACHED_WINDOW,
    REACHED_TIME,
    TORQUE_SENSOR,
    ENCODER_DIFFERENCE,
    CONTINUOUS_CURRENT,
    PEAK_CURRENT,
    PEAK_CURRENT_DURATION,
    MAXIMUM_VELOCITY,
    MAXIMUM_ACCELERATION,
    MAXIMUM_POSITION_ERROR,
    MAXIMUM_VELOCITY_ERROR,
    POSITION_LIMIT_MINIMUM,
    POSITION_LIMIT_MAXIMUM,
    MAXIMUM_PHASE_CURRENT,
    MAXIMUM_MOTOR_CURRENT,
    STALL_CURRENT,
    STALL_VELOCITY,
    STALL_TIME,
    MINIMUM_BUS_VOLTAGE,
    MAXIMUM_BUS_VOLTAGE,
    TEMPERATURE_LIMIT,
    TORQUE_VELOCITY_LIMIT,
    MOTOR_ENABLE,
    START_MOTION,
    STOP_MOTION,
    EMERGENCY_STOP,
    STOP_RECIPROCATION,
    CLEAR_FAULT,
    SAVE,
    RESET_ENCODER,
];

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn every_value_that_a_register_takes_is_read_as_it_was_written(
            register in prop::sample::select(&ALL[..]), value in any::<i64>(), is_small: bool,
        ) {
            let value = if is_small { value % 0x2_0000 } else { value % 0x2_0000_0000 };
            match register.encode(value) {
                Ok(words) => prop_assert_eq!(register.decode(&words), Some(value)),
                Err(error) => prop_assert_eq!(error, ValueError { register, value }),
            }
        }
    }

    #[test]
    fn a_number_of_32_bits_has_its_high_word_first_and_two_s_complement() {
        assert_eq!(TARGET_POSITION.encode(500_000).unwrap()[..], [7, 0xA120]);
        assert_eq!(TARGET_VELOCITY.encode(-1).unwrap()[..], [0xFFFF, 0xFFFF]);
        assert_eq!(ACTUAL_VELOCITY.decode(&[0xFFFF, 0xD8F0]), Some(-10_000));
        assert_eq!(BUS_VOLTAGE.decode(&[0xFFFF, 0xD8F0]), Some(0xFFFF_D8F0));
        assert_eq!(TEMPERATURE.decode(&[0xFFEC]), Some(-20));
        assert_eq!((ACTUAL_VELOCITY.decode(&[1]), FAULT_CODE.decode(&[1, 2])), (None, None));
    }

    #[test]
    fn a_value_that_a_register_does_not_take_is_refused_with_those_that_it_takes() {
        let refusal = |register: Register, value| register.encode(value).unwrap_err().to_string();
        assert_eq!(
            refusal(OPERATION_MODE, 4),
            "operation mode (0x0040) cannot be 4: it takes 1 (torque control), 2 (velocity control), 3 (position control)"
        );
        assert_eq!(
            refusal(COMMUNICATION_TIMEOUT, 4_001),
            "communication time-out (0x0002) cannot be 4001: it takes 0 to 4000"
        );
        assert_eq!(
            refusal(PROFILE_ACCELERATION, -1),
            "profile acceleration (0x0049) cannot be -1: it takes 0 to 4294967295"
        );
        assert_eq!(MOTION_STATUS.show(1), "1 (moving)");
        assert_eq!(
            (MOTION_STATUS.show(2), BUS_VOLTAGE.show(48_000)),
            ("2".to_owned(), "48000 mV".to_owned())
        );
    }

    #[test]
    fn a_register_is_found_by_its_name_and_its_address() {
        for text in ["actual position", "Actual-Position", "0x0066", "0x66"] {
            assert_eq!(named(text), Some(&ACTUAL_POSITION), "{text}");
        }
        assert_eq!((named("position"), named("0x67"), named("0xZZ"), named("")), (None, None, None, None));
        assert!(ALL.iter().all(|register| named(register.name) == Some(register)));
    }

    #[test]
    fn the_registers_stand_in_the_order_of_their_addresses_and_none_overlaps_another() {
        for pair in ALL.windows(2) {
            assert!(pair[0].address + pair[0].number.words() <= pair[1].address, "{}", pair[1]);
        }
    }
}
