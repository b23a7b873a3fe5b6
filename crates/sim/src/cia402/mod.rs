//! A simulated CiA 402 drive made from its electronic data sheet: the objects of the file with their types, access, defaults
//! and limits, and behind them the behaviour of CiA 301 and CiA 402. What the file lacks, the drive lacks. In what a product
//! deviates from its file stands in its [`Quirks`].
//!
//! ```text
//! data sheet ── object_dictionary ── node, services ┬── sdo_server   SDO: expedited, segmented, blocks
//!                                        │          ├── pdo_engine   RPDO, TPDO, transmission types
//!                                        │          ├── network      NMT, heartbeat, guarding, SYNC producer
//!                                        │          └── errors       emergency messages, error history
//!                                       axis, each: device   CiA 402: controlword → state → statusword
//!                                             motion, homing     set-points in every mode; profile, units: what objects say
//!                                             servo ── plant     loops → torque → joint
//! ```
//!
//! Choices where neither the file nor the standards give an answer:
//! - A cyclic target latched at SYNC k is reached one interpolation period later (60C2, otherwise 1006, otherwise 1 ms; with a
//!   quirk, 1006 before 60C2). The
//!   difference of the last two targets is fed forward for at most two periods. Without SYNC the last target is held.
//! - Interpolated position takes its targets from 60C1:1, or from 607A where the file lacks that or the quirks name it.
//! - Without 6007, the loss of the master is a fault; the NMT state changes by 1029.
//! - Without 6083, 6084 or 609A, or where they are 0, the axis reaches its highest velocity in 0.1 s.
//! - An axis that the file gives no unit for velocities has position units per second.
//! - 6076 shows the rated torque of the joint, and so do 6072, 60E0 and 60E1 its peak torque where the file leaves them 0.
//! - There is no following error window (6065) where the file leaves it 0, until it is written.
//! - A homing method whose switches are not wired is a homing error at once.
//! - The velocity mode (2), 607B, 60C4, 1007 and 1012 have no effect.

mod access;
mod axis;
mod device;
mod drive;
pub(crate) mod homing;
mod motion;
pub(crate) mod node;
pub(crate) mod places;
mod profile;
pub(crate) mod services;
mod units;

use takt_rt::Nanoseconds;
use takt_wire::canopen::eds;
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::quirks::Quirks;

use super::homing_switches::ReferenceSwitches;
use super::object_dictionary::SimulatedDictionary;
use super::plant::{Encoder, EndStops, JointParameters};

pub use drive::Cia402Drive;
pub(crate) use places::AXIS_OFFSET;

/// From a new value of 6060 until 6061 shows it, unless the quirks say otherwise.
const MODE_CHANGE_NS: Nanoseconds = 250_000;
/// The most axes in one node.
const MOST_AXES: usize = 8;

/// The parameters of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cia402AxisParameters {
    /// The mechanics.
    pub joint: JointParameters,
    /// Position units (object 6064) per rad (m), and their number at position 0.
    pub encoder: Encoder,
    /// Position units for one turn of the motor, for velocities in revolutions.
    pub counts_per_turn: f64,
    /// Position at the first power-up: rad (m).
    pub initial_position: f64,
    /// Rated torque: N·m (N). Object 6076 reports it in thousandths.
    pub rated_torque: f64,
    /// Peak torque: N·m (N).
    pub peak_torque: f64,
    /// The velocity limit of the motor in every mode: rad/s (m/s).
    pub highest_velocity: f64,
    /// The switches that its homing uses.
    pub switches: ReferenceSwitches,
    /// The mechanical end stops.
    pub end_stops: Option<EndStops>,
}

/// The parameters of one drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Cia402Parameters {
    /// Its data sheet.
    pub sheet: eds::ObjectDictionary,
    /// Node ID, 1 to 127.
    pub node: u8,
    /// In what it deviates from its data sheet.
    pub quirks: Quirks,
    /// Its axes; the objects of axis n stand 0x800 × n higher than those of the first one.
    pub axes: Vec<Cia402AxisParameters>,
    /// From power-up or "reset node" to the boot-up message, unless the quirks say otherwise.
    pub power_up_ns: Nanoseconds,
    /// From the arrival of SYNC until the feedback is ready to send.
    pub feedback_delay_ns: Nanoseconds,
    /// Seed of the SDO latencies.
    pub seed: u64,
}

/// Why no drive can be simulated from a data sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotADrive {
    /// It lacks an object without which nothing can be enabled.
    #[error("the data sheet has no object {0}, which axis {1} of a CiA 402 drive needs")]
    Lacks(ObjectAddress, usize),
    /// The number of axes is not possible.
    #[error("a CiA 402 drive has 1 to 8 axes, but {0} were given")]
    Axes(usize),
}

/// Position units for one turn of the motor as the data sheet gives them in objects 608F, 6091 and 6092.
pub fn counts_per_turn(sheet: &eds::ObjectDictionary, node: u8, axis: u16) -> Option<f64> {
    let dictionary = SimulatedDictionary::of(sheet, node, |_| false, |_| false);
    units::units_per_turn(&dictionary, &places::Places::of(&dictionary, axis))
}

/// The dictionary of a drive, if it has what every axis needs.
fn dictionary_of(parameters: &Cia402Parameters) -> Result<SimulatedDictionary, NotADrive> {
    let Cia402Parameters { sheet, node, quirks, axes, .. } = parameters;
    if !(1..=MOST_AXES).contains(&axes.len()) {
        return Err(NotADrive::Axes(axes.len()));
    }
    let dictionary = dictionary_by(sheet, *node, quirks);
    for axis in 0..axes.len() {
        for index in [0x6040, 0x6041] {
            let address = ObjectAddress::new(index + axis as u16 * AXIS_OFFSET, 0);
            dictionary.find(address).map_err(|_| NotADrive::Lacks(address, axis + 1))?;
        }
    }
    Ok(dictionary)
}

/// The dictionary of a drive by its data sheet and its quirks.
pub(crate) fn dictionary_by(sheet: &eds::ObjectDictionary, node: u8, quirks: &Quirks) -> SimulatedDictionary {
    let is_missing = |address| quirks.is_missing(address);
    let is_constant = |address| quirks.is_constant(address);
    let mut dictionary = SimulatedDictionary::of(sheet, node, is_missing, is_constant);
    for (address, value) in &quirks.values {
        if let Ok(place) = dictionary.find(*address) {
            dictionary.set_factory(place, *value);
        }
    }
    for (address, range) in &quirks.simulated.ranges {
        if let Ok(place) = dictionary.find(*address) {
            dictionary.set_range(place, *range);
        }
    }
    for (address, choices) in &quirks.simulated.choices {
        if let Ok(place) = dictionary.find(*address) {
            dictionary.set_choices(place, choices);
        }
    }
    let unsaved = &quirks.simulated.unsaved;
    dictionary.set_unsaved(|address| unsaved.iter().any(|pattern| pattern.matches(address)));
    dictionary
}
