//! The table of registers (eRob Modbus-RTU manual 1.5, tables 4-1 and 5-1 to 5-6). Where the manual says nothing of a sign, the reading
//! is argued in its companion table (`tests/vectors/erob-modbus-registers.csv`).

use takt_wire::erob_can::parameter::{Access, Parameter, Unit, Values};

use super::register::{Number, Register};

/// The register at an address, if the table has it.
pub fn find(address: u16) -> Option<&'static Register> {
    ALL.iter().find(|register| register.address == address)
}

impl Register {
    /// Returns `true` if it makes no difference how often a value is written: not for commands that act anew each time.
    pub fn may_be_repeated(&self) -> bool {
        ![START_MOTION, CLEAR_FAULT, SAVE, RESET_ENCODER].contains(self)
    }
}

impl Parameter for Register {
    const KIND: &'static str = "register";
    const EXAMPLE: &'static str = "0x0066";

    fn all() -> &'static [Self] {
        &ALL
    }

    /// `0x0066`
    fn at(address: &str) -> Option<Self> {
        let digits = address.strip_prefix("0x").or(address.strip_prefix("0X"))?;
        find(u16::from_str_radix(digits, 16).ok()?).copied()
    }

    fn address(&self) -> String {
        format!("0x{:04X}", self.address)
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
        self.number.range()
    }

    fn note(&self) -> &'static str {
        self.note
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
    Register { access: Access::CommandWithArgument, ..read(address, name, Unit::None) }
}

impl Register {
    const fn with_note(self, note: &'static str) -> Self {
        Self { note, ..self }
    }

    const fn taking(self, values: Values) -> Self {
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
    .taking(Values::Range(1, 247))
    .with_note("counts after saving and a power cycle; the manual prints 1 to 255, the standard has 247");
/// Bit rate.
pub const BIT_RATE: Register = set(0x0001, "bit rate", Unit::None)
    .taking(Values::Named(&[(1, "9600 bit/s"), (2, "19200 bit/s"), (3, "38400 bit/s"), (4, "115200 bit/s")]))
    .with_note("save, then switch the power off and on (the manual says so of the address alone)");
/// Communication time-out.
pub const COMMUNICATION_TIMEOUT: Register =
    set(0x0002, "communication time-out", Unit::Milliseconds).taking(Values::Range(0, 4_000)).with_note(
        "0 is off, as from the factory; it counts from the first request of a master; then fault 0x0FA2",
    );
/// Position loop gain.
pub const POSITION_LOOP_GAIN: Register = set(0x0030, "position loop gain", Unit::None);
/// Velocity loop gain.
pub const VELOCITY_LOOP_GAIN: Register = set(0x0031, "velocity loop gain", Unit::None);
/// Velocity loop integral.
pub const VELOCITY_LOOP_INTEGRAL: Register = set(0x0032, "velocity loop integral", Unit::None);
/// Operation mode.
pub const OPERATION_MODE: Register = set(0x0040, "operation mode", Unit::None)
    .taking(Values::Named(&[(1, "torque control"), (2, "velocity control"), (3, "position control")]))
    .with_note("disable before a change");
/// Motion mode.
pub const MOTION_MODE: Register = set(0x0041, "motion mode", Unit::None)
    .taking(Values::Named(&[(0, "continuous"), (1, "target position"), (2, "reciprocating")]))
    .with_note("of position control; 1 is for absolute and for relative moves");
/// Control source.
pub const CONTROL_SOURCE: Register = set(0x0042, "control source", Unit::None)
    .taking(Values::Named(&[(0, "not used"), (1, "EtherCAT")]))
    .with_note("0 for every motion by Modbus");
/// Target absolute position.
pub const TARGET_POSITION: Register = set_double(0x0043, "target absolute position", Unit::Counts).signed();
/// Target relative position.
pub const RELATIVE_POSITION: Register = set_double(0x0045, "target relative position", Unit::DistanceCounts)
    .signed()
    .with_note("what is not 0 makes a move a relative one");
/// Profile velocity.
pub const PROFILE_VELOCITY: Register = set_double(0x0047, "profile velocity", Unit::CountsPerSecond)
    .signed()
    .with_note("negative for backward in a continuous motion alone");
/// Profile acceleration.
pub const PROFILE_ACCELERATION: Register =
    set_double(0x0049, "profile acceleration", Unit::CountsPerSecondSquared);
/// Profile deceleration.
pub const PROFILE_DECELERATION: Register =
    set_double(0x004B, "profile deceleration", Unit::CountsPerSecondSquared)
        .with_note("the stop command uses it");
/// Reciprocating dwell time.
pub const DWELL_TIME: Register =
    set_double(0x004D, "reciprocating dwell time", Unit::FiftyMicroseconds).with_note("at each reversal");
/// Target current.
pub const TARGET_CURRENT: Register = set_double(0x004F, "target current", Unit::Milliamperes)
    .signed()
    .with_note("of torque control; it acts as soon as it is written");
/// Target velocity.
pub const TARGET_VELOCITY: Register = set_double(0x0051, "target velocity", Unit::CountsPerSecond)
    .signed()
    .with_note("of velocity control; it acts as soon as it is written");
/// Fault code.
pub const FAULT_CODE: Register = read(0x0060, "fault code", Unit::None).with_note("0 is taken for no fault");
/// Motion status.
pub const MOTION_STATUS: Register = read(0x0061, "motion status", Unit::None)
    .taking(Values::Named(&[(0, "stopped"), (1, "moving"), (3, "reciprocating motion stopped")]))
    .with_note("2 is not defined");
/// Position reached status.
pub const REACHED_STATUS: Register =
    read(0x0063, "position reached status", Unit::None).taking(Values::Named(&[
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
pub const POSITION_ERROR: Register = read_double(0x0068, "position error", Unit::DistanceCounts).signed();
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
    .with_note("the sensor reaches from -20 to 150 °C");
/// Position reached window.
pub const REACHED_WINDOW: Register = set(0x0079, "position reached window", Unit::DistanceCounts);
/// Position reached time.
pub const REACHED_TIME: Register = set(0x007A, "position reached time", Unit::FiftyMicroseconds)
    .with_note("so long the position must stay in its window");
/// Torque sensor value.
pub const TORQUE_SENSOR: Register = read_double(0x007B, "torque sensor value", Unit::MillinewtonMetres)
    .signed()
    .with_note("of models with a torque sensor");
/// Dual encoder difference.
pub const ENCODER_DIFFERENCE: Register = read_double(0x007D, "dual encoder difference", Unit::EncoderCounts)
    .signed()
    .with_note("of the encoders at load and motor: how far the gear is twisted; its sign is not stated");
/// Continuous current.
pub const CONTINUOUS_CURRENT: Register = set_double(0x00B0, "continuous current", Unit::Milliamperes);
/// Peak current.
pub const PEAK_CURRENT: Register = set_double(0x00B2, "peak current", Unit::Milliamperes);
/// Peak current duration.
pub const PEAK_CURRENT_DURATION: Register = set(0x00B4, "peak current duration", Unit::Milliseconds)
    .with_note("for so long the peak current may flow");
/// Maximum velocity.
pub const MAXIMUM_VELOCITY: Register = set_double(0x00B5, "maximum velocity", Unit::CountsPerSecond);
/// Maximum acceleration.
pub const MAXIMUM_ACCELERATION: Register =
    set_double(0x00B7, "maximum acceleration", Unit::CountsPerSecondSquared);
/// Maximum position error.
pub const MAXIMUM_POSITION_ERROR: Register =
    set_double(0x00B9, "maximum position error", Unit::DistanceCounts).with_note("a fault beyond it");
/// Maximum velocity error.
pub const MAXIMUM_VELOCITY_ERROR: Register =
    set_double(0x00BB, "maximum velocity error", Unit::CountsPerSecond).with_note("a fault beyond it");
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
    .with_note("a fault after this time with more than the stall current and less than the stall velocity");
/// Minimum bus voltage.
pub const MINIMUM_BUS_VOLTAGE: Register = set_double(0x00CA, "minimum bus voltage", Unit::Millivolts);
/// Maximum bus voltage.
pub const MAXIMUM_BUS_VOLTAGE: Register = set_double(0x00CC, "maximum bus voltage", Unit::Millivolts);
/// Power stage temperature limit.
pub const TEMPERATURE_LIMIT: Register = set(0x00D1, "power stage temperature limit", Unit::Celsius)
    .signed()
    .with_note("85 °C at most is advised");
/// Torque-mode velocity limit.
pub const TORQUE_VELOCITY_LIMIT: Register = set_double(0x00D8, "torque-mode velocity limit", Unit::CountsPerSecond).signed()
    .with_note("in the torque sequence of the manual and in none of its tables; 0 may mean no limit, so write a positive one");
/// Motor enable.
pub const MOTOR_ENABLE: Register = command(0x00F0, "motor enable")
    .taking(Values::Named(&[(0, "disable"), (1, "enable")]))
    .with_note("wait 500 ms after enabling; the brake follows by itself");
/// Start motion.
pub const START_MOTION: Register =
    command(0x00F1, "start motion").with_note("of position control; any value");
/// Stop motion.
pub const STOP_MOTION: Register = command(0x00F2, "stop motion")
    .with_note("with the profile deceleration; any value; in torque control it also disables");
/// Emergency stop.
pub const EMERGENCY_STOP: Register = command(0x00F3, "emergency stop").with_note(
    "in less than 50 ms: a shock for the gear, and the bus voltage rises; which value is not stated",
);
/// Stop reciprocation.
pub const STOP_RECIPROCATION: Register =
    command(0x00F4, "stop reciprocation").with_note("the motion ends at its next end; any value");
/// Clear fault.
pub const CLEAR_FAULT: Register = command(0x00F6, "clear fault").taking(Values::Range(1, 0xFFFF));
/// Save parameters.
pub const SAVE: Register =
    command(0x00F7, "save parameters").with_note("takes 3 s, in which the power must stay on; any value");
/// Reset load-side encoder.
pub const RESET_ENCODER: Register = command(0x00F9, "reset load-side encoder")
    .with_note("wipes the count of turns; for the battery alarm of multi-turn models alone; any value");

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
    use super::*;

    #[test]
    fn the_registers_stand_in_the_order_of_their_addresses_and_none_overlaps_another() {
        for pair in ALL.windows(2) {
            assert!(pair[0].address + pair[0].number.words() <= pair[1].address, "{}", pair[1]);
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
    fn a_register_is_found_by_its_address() {
        assert_eq!(
            (Register::at("0x0066"), Register::at("0x66")),
            (Some(ACTUAL_POSITION), Some(ACTUAL_POSITION))
        );
        for text in ["0x67", "0xZZ", "66", "", "actual position"] {
            assert_eq!(Register::at(text), None, "{text}");
        }
    }
}
