//! Quirks of a drive: in what it deviates from its electronic data sheet and from CiA 402. They are data, in a small file
//! beside the data sheet (`drives/*.toml`).

use takt_rt::{Nanoseconds, OperationMode};

use crate::canopen::object::ObjectAddress;
use crate::described_drive::Confirmation;

/// The drive that a quirk file is about.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct QuirkyDrive {
    /// The vendor, for people.
    pub vendor: String,
    /// The product, for people.
    pub product: String,
    /// Object 1018:1, if known.
    pub vendor_number: Option<u32>,
    /// Object 1018:2 of the products that it is true for; empty when they are not known.
    pub product_numbers: Vec<u32>,
    /// Whether it was tried.
    pub confirmation: Confirmation,
    /// The documents that it was taken from.
    pub sources: Vec<String>,
}

/// An object, or all sub-indices of an index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ObjectPattern {
    /// Every sub-index of this index.
    Index(u16),
    /// One sub-index.
    Address(ObjectAddress),
}

impl ObjectPattern {
    /// The first object that is meant.
    pub fn first(self) -> ObjectAddress {
        match self {
            Self::Index(index) => ObjectAddress::new(index, 0),
            Self::Address(exact) => exact,
        }
    }

    /// Returns `true` if an object is meant.
    pub fn matches(self, address: ObjectAddress) -> bool {
        match self {
            Self::Index(index) => address.index == index,
            Self::Address(exact) => address == exact,
        }
    }
}

/// What one unit of a velocity or acceleration object is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MotionUnit {
    /// Position units per second (per second²), times this factor.
    PositionUnits(f64),
    /// Revolutions of the motor per minute (per minute and second), times this factor.
    RevolutionsPerMinute(f64),
}

/// The NMT state of a simulated drive after power-up. Not every manual says which one real units have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PowerUpState {
    /// Pre-operational, as CiA 301 has it.
    #[default]
    PreOperational,
    /// Operational, as published programs for some drives seem to expect.
    Operational,
}

/// How long the drive takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Delays {
    /// From power-up or "reset node" to the boot-up message.
    pub boot_up_ns: Option<Nanoseconds>,
    /// From NMT start to the first PDO, sent or accepted.
    pub first_pdo_ns: Option<Nanoseconds>,
    /// From an SDO request to its reply, at most.
    pub sdo_reply_ns: Option<Nanoseconds>,
    /// From a new value of 6060 until 6061 shows it.
    pub mode_change_ns: Option<Nanoseconds>,
    /// From "save" in 1010 until it has taken effect.
    pub save_ns: Option<Nanoseconds>,
    /// How long bit 7 of the controlword must stay set to reset a fault.
    pub fault_reset_ns: Option<Nanoseconds>,
}

/// How the turn count of a multi-turn encoder is cleared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TurnCount {
    /// Writing 1 to this object clears it.
    pub clear: ObjectAddress,
    /// The error code (603F) of a fault that needs this before it can be reset: the encoder has lost its count.
    pub lost: Option<u16>,
}

/// An object of the vendor by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NamedObject {
    /// Where it is.
    pub address: ObjectAddress,
    /// Its name.
    pub name: &'static str,
    /// Its unit in words: "position", "distance", "velocity", "acceleration", "torque", or a factor and the name of a unit; empty for a
    /// plain number.
    pub unit: &'static str,
}

/// A protocol of the vendor that the drive may speak instead of CANopen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VendorProtocol {
    /// Its name.
    pub name: &'static str,
    /// The identifier of a request that changes nothing in the drive, without the node ID.
    pub request: u16,
    /// The first bytes of that request, the highest first.
    pub bytes: [u8; 2],
    /// The identifier of the reply, without the node ID.
    pub reply: u16,
    /// The highest node ID. Above it the identifiers are those of other nodes.
    pub last_node: u8,
    /// What to do with a drive that answers it.
    pub cure: &'static str,
}

/// A task that the drive cannot do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The command of `takt drive`.
    pub task: &'static str,
    /// Why it cannot be done.
    pub reason: &'static str,
    /// What to do instead.
    pub instead: &'static str,
}

/// Plausible values of a drive. Others are possible, and cause a warning.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlausibleTurns {
    /// The fastest that its position turns, in turns per second.
    pub fastest_per_s: Option<f64>,
    /// The fastest that its joint usually turns without a further transmission, in turns per second.
    pub usual_per_s: Option<f64>,
    /// The ratios of the gear inside, from this one on, where it reports turns of the output behind that gear.
    pub inner_gear_from: Option<f64>,
}

/// A measured value that a simulated drive shows in an object of its vendor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredObject {
    /// The object.
    pub address: ObjectAddress,
    /// The number in it for one of the quantity.
    pub factor: f64,
    /// The quantity.
    pub quantity: MeasuredQuantity,
}

/// A quantity that a simulated drive measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeasuredQuantity {
    /// The position of the joint since position 0: counts.
    Position,
    /// The torque of the motor: N·m (N).
    Torque,
}

/// In what a simulated drive deviates from CiA 301 and CiA 402. A program that commands the drive need not know it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SimulatedQuirks {
    /// True if it takes SYNC of any length.
    pub takes_any_sync: bool,
    /// True if it ignores the event timers of its RPDOs.
    pub ignores_rpdo_timers: bool,
    /// True if it has no TPDOs on remote request: transmission types 252 and 253 are refused.
    pub refuses_remote_pdos: bool,
    /// True if it has one abort code, 0609 0030, for every value that it refuses.
    pub has_one_abort_code: bool,
    /// True if its SDO uploads are segmented, which CiA 301 permits for any object.
    pub segments_uploads: bool,
    /// True if it interpolates over the SYNC period (1006), and over 60C2 only where that is 0.
    pub interpolates_over_sync: bool,
    /// True if a distant target of interpolated position mode is a move by its own profile, as in profile position mode.
    pub moves_in_interpolation: bool,
    /// True if no battery keeps its turn count: after power-up its position is within a turn.
    pub lacks_battery: bool,
    /// True if it has expedited SDO transfers only.
    pub has_expedited_only: bool,
    /// True if it takes SDO requests of four bytes and more, where CiA 301 has eight.
    pub takes_short_requests: bool,
    /// True if each RPDO is answered by the TPDO with its number, which no changed value sends.
    pub answers_rpdos: bool,
    /// True if it sends no boot-up message after power-up, only after NMT commands.
    pub is_power_up_silent: bool,
    /// True if it sends no emergency messages.
    pub lacks_emergencies: bool,
    /// Its torque for one ampere, for the rated current (6075): N·m (N).
    pub torque_per_ampere: Option<f64>,
    /// The ranges of objects that the data sheet leaves open.
    pub ranges: Vec<(ObjectAddress, [i64; 2])>,
    /// The only values that some objects take.
    pub choices: Vec<(ObjectAddress, Vec<i64>)>,
    /// Writable objects that it does not store.
    pub unsaved: Vec<ObjectPattern>,
    /// Measured values in objects of the vendor.
    pub measured: Vec<MeasuredObject>,
}

/// In what a drive deviates from its data sheet and from CiA 402. The default deviates in nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Quirks {
    /// The drive; empty for one without a quirk file.
    pub drive: QuirkyDrive,
    /// The modes that it has, where object 6502 does not tell.
    pub modes: Option<Vec<OperationMode>>,
    /// The modes that some units have beyond those that object 6502 tells; 6061 shows whether a unit has one.
    pub undeclared_modes: Vec<OperationMode>,
    /// True if it takes another mode only while it has no torque.
    pub keeps_mode_with_torque: bool,
    /// The object that has the target of interpolated position mode, where it is not 60C1:1.
    pub interpolation_target: Option<ObjectAddress>,
    /// Counts of one turn of the position that it reports (6064) as it leaves the factory, where objects 608F and 6092 do not
    /// tell.
    pub counts_per_turn: Option<f64>,
    /// Objects that it lacks although its data sheet lists them.
    pub missing: Vec<ObjectPattern>,
    /// Objects that it refuses to write although its data sheet says otherwise.
    pub constant: Vec<ObjectPattern>,
    /// Values of objects as it leaves the factory, where its data sheet leaves them open.
    pub values: Vec<(ObjectAddress, i64)>,
    /// How its turn count is cleared, if it has one that can be.
    pub turn_count: Option<TurnCount>,
    /// Bits of the statusword (6041) that are always 1.
    pub statusword_set: u16,
    /// Bits of the statusword (6041) that are always 0.
    pub statusword_clear: u16,
    /// Bits of the statusword (6041) that are 1 unless it is enabled.
    pub statusword_set_disabled: u16,
    /// Bits of the statusword (6041) that are always 1 in some units.
    pub statusword_set_in_some: u16,
    /// The unit of a velocity or acceleration object, where objects 60A9 and 6096 do not tell.
    pub units: Vec<(u16, MotionUnit)>,
    /// The NMT state after the boot-up message.
    pub power_up: PowerUpState,
    /// True if it refuses SDO block transfers.
    pub refuses_blocks: bool,
    /// True if it does not answer SDO requests for objects that it lacks.
    pub is_silent_if_absent: bool,
    /// True if its heartbeat has the code of "stopped" during an alarm, and a stopped one sends none.
    pub shows_alarm_in_heartbeat: bool,
    /// Its delays.
    pub delays: Delays,
    /// Its own error codes (603F, EMCY) in words.
    pub errors: Vec<(u16, String)>,
    /// What clears a fault with one of its error codes.
    pub cures: Vec<(u16, &'static str)>,
    /// The only bit rate that it has, in bit/s; empty if it has others.
    pub bit_rates: &'static [u32],
    /// True if software position limits (607D) of which the lowest is not below the highest, as 0 and 0, are not off.
    pub keeps_empty_limits: bool,
    /// Its plausible values.
    pub plausible: PlausibleTurns,
    /// Objects by name, in addition to those of CiA 301 and CiA 402, or instead.
    pub named: Vec<NamedObject>,
    /// The object with its temperature in °C.
    pub temperature: Option<ObjectAddress>,
    /// The protocol that it may speak instead of CANopen.
    pub vendor_protocol: Option<VendorProtocol>,
    /// What to check when it does not answer.
    pub if_silent: Option<&'static str>,
    /// How its node ID and bit rate are set, where it has no LSS (CiA 305).
    pub instead_of_lss: Option<&'static str>,
    /// The tasks that it cannot do.
    pub refusals: Vec<Refusal>,
    /// True if it has no inputs for reference switches, so that it can be homed on the present position only.
    pub lacks_switches: bool,
    /// In what the simulated drive deviates beyond that.
    pub simulated: SimulatedQuirks,
}

impl Quirks {
    /// Returns `true` if the drive lacks an object that its data sheet may list.
    pub fn is_missing(&self, address: ObjectAddress) -> bool {
        self.missing.iter().any(|pattern| pattern.matches(address))
    }

    /// Returns `true` if the drive refuses to write an object that its data sheet may call writable.
    pub fn is_constant(&self, address: ObjectAddress) -> bool {
        self.constant.iter().any(|pattern| pattern.matches(address))
    }

    /// The unit of a velocity or acceleration object of the first axis, if the file tells.
    pub fn unit(&self, index: u16) -> Option<MotionUnit> {
        self.units.iter().find(|(known, _)| *known == index).map(|(_, unit)| *unit)
    }

    /// An error code of the drive in words, if the file tells.
    pub fn error_words(&self, code: u16) -> Option<&str> {
        self.errors.iter().find(|(known, _)| *known == code).map(|(_, words)| words.as_str())
    }
}
