//! The tasks that commissioning can carry out with a drive.

use takt_rt::{FieldMode, Nanoseconds};
use takt_wire::canopen::object::DataType;

use super::motion_profile::MotionProfile;
#[doc(hidden)]
pub use super::target::CommandValue;

/// A task with one drive.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Task {
    /// Read identity, ratings and condition.
    Info,
    /// Find the drives on the bus that speak the same protocol.
    Scan,
    /// Read objects, or the entries that a drive has in their place.
    Read {
        /// Their names or addresses, as the user wrote them.
        names: Vec<String>,
        /// The data type given by the user.
        data_type: Option<DataType>,
    },
    /// Write an object or entry, and read it back if it is readable.
    Write {
        /// Its name or address, as the user wrote it.
        name: String,
        /// The value.
        value: ValueText,
        /// The data type given by the user.
        data_type: Option<DataType>,
    },
    /// Enable the drive for a time.
    Enable {
        /// How long; `None`: until it is interrupted.
        hold_ns: Option<Nanoseconds>,
        /// Leave the drive enabled at the end, without holding first.
        keeps_enabled: bool,
    },
    /// Stop and disable.
    Disable,
    /// Move to a position.
    Move {
        /// The kind of move.
        kind: MoveKind,
        /// Velocity and accelerations.
        profile: MotionProfile,
        /// Leave the drive enabled at the end.
        keeps_enabled: bool,
    },
    /// Run at a velocity.
    Velocity {
        /// The velocity.
        velocity: CommandValue,
        /// Accelerations.
        profile: MotionProfile,
        /// How long; `None`: until it is interrupted.
        duration_ns: Option<Nanoseconds>,
        /// Leave the drive enabled at the end, at standstill.
        keeps_enabled: bool,
    },
    /// Apply a torque.
    Torque {
        /// The torque.
        torque: CommandValue,
        /// The axis is stopped above this velocity.
        velocity_limit: Option<CommandValue>,
        /// How long; `None`: until it is interrupted.
        duration_ns: Option<Nanoseconds>,
    },
    /// Run homing.
    Home {
        /// Homing method, object 6098; `None`: the family's default.
        method: Option<i8>,
        /// The timeout.
        within_ns: Nanoseconds,
        /// Allow a method that the manual does not describe.
        is_forced: bool,
    },
    /// Make the current position zero.
    Zero {
        /// True if the user confirmed it.
        is_confirmed: bool,
    },
    /// Store the parameters.
    Save,
    /// Restore the parameters of the factory.
    Restore {
        /// True if the user confirmed it.
        is_confirmed: bool,
    },
    /// Change the node ID.
    SetId {
        /// The new node ID, 1 to 127.
        node: u8,
    },
    /// Change the bit rate.
    SetBitRate {
        /// bit/s
        bit_rate: u32,
    },
    /// Release the brake without torque.
    ReleaseBrake {
        /// True if the user confirmed that nothing holds the joint.
        is_confirmed: bool,
    },
    /// Stop the joint as fast as the drive can, whatever that does to its gear, by a command of its own.
    EmergencyStop,
    /// Set how long the drive waits for its master.
    CommunicationTimeout {
        /// 0 for ever.
        milliseconds: u16,
    },
    /// Clear the drive's fault.
    ClearFault {
        /// True if the user confirmed the loss of the turn count, where clearing causes it.
        is_confirmed: bool,
    },
    /// Show readings of the axis.
    Watch {
        /// The interval.
        every_ns: Nanoseconds,
        /// How long; `None`: until it is interrupted.
        duration_ns: Option<Nanoseconds>,
    },
    /// Read the gains, or change the given ones.
    Gains {
        /// Proportional gain of the position loop.
        position_proportional: Option<i64>,
        /// Proportional gain of the velocity loop.
        velocity_proportional: Option<i64>,
        /// Integration time of the velocity loop.
        velocity_integration: Option<i64>,
    },
    /// Multiply preset gains of the drive's inner loops.
    GainFactors(GainFactors),
    /// Tell the drive what it follows, without torque.
    Mode(FieldMode),
    /// Read or set the electronic gear of the pulse input.
    Gear {
        /// Numerator and denominator.
        ratio: Option<(u16, u16)>,
    },
    /// Set whether the drive moves to its multi-turn zero at power-up.
    AutoHome {
        /// True if it does so.
        is_on: bool,
        /// True if the user confirmed it.
        is_confirmed: bool,
    },
    /// Set the drive up for interpolation over the bus.
    Interpolation,
}

impl Task {
    /// The same task, to which the user has agreed.
    #[must_use]
    pub fn confirmed(mut self) -> Self {
        match &mut self {
            Self::Zero { is_confirmed }
            | Self::Restore { is_confirmed }
            | Self::ReleaseBrake { is_confirmed }
            | Self::ClearFault { is_confirmed }
            | Self::AutoHome { is_confirmed, .. } => *is_confirmed = true,
            _ => {}
        }
        self
    }
}

/// Factors by which preset gains are multiplied; 1 leaves a gain as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GainFactors {
    /// Stiffness and damping of the position loop, where they are no factors.
    pub position_loop: Option<(u8, u8)>,
    /// Proportional gain of the velocity loop.
    pub velocity_kp: Option<f64>,
    /// Integral gain of the velocity loop.
    pub velocity_ki: Option<f64>,
    /// Proportional gain of the current loop.
    pub current_kp: Option<f64>,
    /// Integral gain of the current loop.
    pub current_ki: Option<f64>,
}

impl GainFactors {
    /// Returns `true` if none is given.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// What is asked of a pulse at the PWM input of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PulseWidth {
    /// The pulse for a value.
    Of {
        /// What it is.
        quantity: PulseQuantity,
        /// rad, Hz or A.
        value: f64,
    },
    /// What a pulse means.
    Means {
        /// µs
        width_us: f64,
    },
}

/// What the width of a pulse may stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PulseQuantity {
    /// rad
    Position,
    /// Hz, as the table of the drive has it.
    Velocity,
    /// A
    Current,
}

/// A value to write, as the user wrote it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ValueText {
    /// The text: with a unit, a whole number, or a word where the entry has words for its values.
    pub text: String,
    /// True if it is a whole number in the drive's own unit.
    pub is_raw: bool,
}

/// The kind of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum MoveKind {
    /// To a position.
    Absolute {
        /// The position.
        to: CommandValue,
        /// Take over the new target at once, also during a motion. Some drives always do so.
        is_immediate: bool,
    },
    /// By a distance.
    Relative(CommandValue),
    /// To a position and back, repeatedly.
    Reciprocate {
        /// The position.
        to: CommandValue,
        /// Number of repetitions; `None`: until it is interrupted.
        times: Option<u32>,
        /// Dwell time at each end.
        dwell_ns: Nanoseconds,
    },
    /// Without a target.
    Continuous {
        /// Forward or backward.
        is_forward: bool,
        /// How long; `None`: until it is interrupted.
        duration_ns: Option<Nanoseconds>,
    },
}
