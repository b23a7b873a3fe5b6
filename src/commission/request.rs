//! What can be asked of a drive.

use takt_rt::Nanoseconds;

use super::dictionary::Entry;
use super::pace::Pace;
use super::subject::Amount;
use crate::canopen::object::{DataType, Object, ObjectAddress};

/// Something to do with one drive.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Who it is and how it fares.
    Info,
    /// Read objects.
    Read {
        /// Which.
        objects: Vec<ReadObject>,
    },
    /// Write an object, and read it back where that can be done.
    Write {
        /// Which.
        object: Object,
        /// The drive's number.
        value: i64,
        /// What is known of it.
        entry: Option<Entry>,
    },
    /// Torque on, held for a time.
    Enable {
        /// For how long; `None`: until it is interrupted.
        hold_ns: Option<Nanoseconds>,
        /// Whether torque stays on in the end. Then nothing is held.
        keeps_enabled: bool,
    },
    /// Stop and torque off.
    Disable,
    /// Move to a position.
    Move {
        /// Where to.
        course: Course,
        /// How fast.
        pace: Pace,
        /// Whether torque stays on in the end.
        keeps_enabled: bool,
    },
    /// Turn at a velocity.
    Velocity {
        /// The velocity.
        velocity: Amount,
        /// Accelerations.
        pace: Pace,
        /// For how long; `None`: until it is interrupted.
        duration_ns: Option<Nanoseconds>,
        /// Whether torque stays on in the end, at standstill.
        keeps_enabled: bool,
    },
    /// Apply a torque.
    Torque {
        /// The torque.
        torque: Amount,
        /// Faster than this the axis is stopped.
        velocity_limit: Option<Amount>,
        /// For how long; `None`: until it is interrupted.
        duration_ns: Option<Nanoseconds>,
    },
    /// Find the home position.
    Home {
        /// Object 6098; `None`: the family's own choice.
        method: Option<i8>,
        /// The longest time that it may take.
        within_ns: Nanoseconds,
        /// Whether a method is tried that the manual does not describe.
        is_forced: bool,
    },
    /// Make the present position zero.
    Zero {
        /// Whether it was agreed to.
        is_agreed: bool,
    },
    /// Store the parameters.
    Save,
    /// Give the drive another node number.
    SetId {
        /// 1 to 127.
        node: u8,
    },
    /// Give the drive another bit rate.
    SetBitRate {
        /// bit/s
        bit_rate: u32,
    },
    /// Clear the fault that the drive is in.
    ClearFault {
        /// Whether the loss of the count of turns was agreed to, where that is the way.
        is_agreed: bool,
    },
    /// Show where the axis is.
    Watch {
        /// Between two looks.
        every_ns: Nanoseconds,
        /// For how long; `None`: until it is interrupted.
        duration_ns: Option<Nanoseconds>,
    },
    /// Read the gains, or change some of them.
    Gains {
        /// Position loop, proportional.
        position_proportional: Option<i64>,
        /// Velocity loop, proportional.
        velocity_proportional: Option<i64>,
        /// Velocity loop, integration time.
        velocity_integration: Option<i64>,
    },
    /// Read or set the electronic gear of the pulse input.
    Gear {
        /// Numerator and denominator.
        ratio: Option<(u16, u16)>,
    },
    /// Whether the drive goes to its multi-turn zero by itself at power-up.
    AutoHome {
        /// Whether it does.
        is_on: bool,
        /// Whether it was agreed to.
        is_agreed: bool,
    },
    /// Set the drive up for interpolation over the bus.
    Interpolation,
}

/// An object to read, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadObject {
    /// Where it is.
    pub address: ObjectAddress,
    /// What is known of it.
    pub entry: Option<Entry>,
    /// The type that was told.
    pub data_type: Option<DataType>,
}

/// A way to move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Course {
    /// To a position.
    Absolute {
        /// The position.
        to: Amount,
        /// Whether the drive takes the target over at once, also while it moves. A YZ-AIM always does.
        is_immediate: bool,
    },
    /// By a distance.
    Relative(Amount),
    /// To a position and back, so many times.
    Reciprocate {
        /// The position.
        to: Amount,
        /// How often.
        times: u32,
        /// Standstill at each end.
        dwell_ns: Nanoseconds,
    },
    /// On and on.
    Continuous {
        /// Forward or backward.
        is_forward: bool,
        /// For how long; `None`: until it is interrupted.
        duration_ns: Option<Nanoseconds>,
    },
}
