//! Why a request is rejected: one table of the reasons.

use crate::cia402::OperationMode;
use crate::fault::Rule;
use crate::frame::Id;
use crate::pdo::MappedObject;
use crate::phase::Phase;
use crate::recorded_numbers::{Fixed, RecordedNumbers, stated_or};
use crate::request::RequestKind;

/// A reason is `NAME { FIELDS } = NUMBER, WORDS;`: a recording keeps its number and its fields, in their order, or what
/// stands behind `as`. New ones come last.
macro_rules! reasons {
    ($(
        $(#[$doc:meta])*
        $reason:ident $({ $($(#[$field_doc:meta])* $field:ident: $type:ty,)* })?
        = $number:literal $(as $numbers:tt)?, $words:literal $(, $argument:expr)*;
    )*) => {
        /// Why a request is rejected. Lengths in rad (m), velocities in rad/s (m/s), torques in N·m (N).
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
        pub enum RejectReason {
            $($(#[$doc])* $reason $({ $($(#[$field_doc])* $field: $type,)* })?,)*
        }

        impl RejectReason {
            /// One of each, in the order of their numbers, with numbers of no meaning.
            pub fn all() -> impl Iterator<Item = Self> {
                // 1 is also a mode of operation, a rule, an identifier, and a group of most machines.
                (0..).map_while(|number| Self::from_numbers(number, 1.0, 2.0))
            }

            /// The number that stands for it in recordings.
            pub const fn number(&self) -> u8 {
                match self {
                    $(Self::$reason { .. } => $number,)*
                }
            }

            /// What was asked for and what is allowed, as two numbers for recordings; 0 where there is none.
            /// [`RejectReason::from_numbers`] is the way back.
            pub fn numbers(&self) -> (f64, f64) {
                match *self {
                    $(Self::$reason { $($($field),*)? } => {
                        stated_or!($($numbers)? ($($($field,)*)?)).to_numbers()
                    })*
                }
            }

            /// The reason that these numbers stand for; `None` for numbers that no reason has.
            pub fn from_numbers(number: u8, asked: f64, allowed: f64) -> Option<Self> {
                match number {
                    $($number => {
                        let stated_or!($($numbers)? ($($($field,)*)?)) =
                            RecordedNumbers::from_numbers(asked, allowed)?;
                        Some(Self::$reason { $($($field),*)? })
                    })*
                    _ => None,
                }
            }
        }

        impl core::fmt::Display for RejectReason {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                match *self {
                    $(Self::$reason { $($($field),*)? } => write!(f, $words $(, $argument)*),)*
                }
            }
        }
    };
}

reasons! {
    /// It is not possible in the phase that the group is in.
    Phase = 0,
        "not possible in this phase";
    /// A fault has stopped the group and has not been reset.
    StopLatched {
        /// The rule that was broken.
        rule: Rule,
    } = 1,
        "a fault ({}) has stopped the group and must be reset first", rule.key();
    /// The run is ending: enabling is refused since [`Request::InhibitEnable`](crate::Request::InhibitEnable).
    EnableInhibited = 2,
        "enabling is inhibited";
    /// Slots are missed too often for a stream.
    MissedSlots {
        /// Missed slots that are not yet forgiven.
        missed: u32,
        /// From so many on no stream begins.
        limit: u32,
    } = 3,
        "{missed} slots were missed of late; from {limit} on no stream begins";
    /// There is no such axis.
    UnknownAxis {
        /// The number that was asked for.
        axis: u8,
        /// How many axes there are.
        axes: u8,
    } = 4,
        "there is no axis {axis}: there are {axes}";
    /// The axis is in a mode that takes no such target.
    WrongMode {
        /// The mode that it is in.
        mode: OperationMode,
    } = 5,
        "the axis is in {mode:?}, which takes no such target";
    /// A number is infinite or not a number.
    NotFinite {
        /// The number.
        value: f64,
    } = 6,
        "{value} is not a finite number";
    /// A target lies outside the position limits.
    PositionLimit {
        /// The target.
        position: f64,
        /// The limit.
        limit: f64,
    } = 7,
        "position {position} is beyond the limit of {limit}";
    /// A velocity is beyond the limit.
    VelocityLimit {
        /// The velocity.
        velocity: f64,
        /// The limit.
        limit: f64,
    } = 8,
        "velocity {velocity} is beyond the limit of {limit}";
    /// A torque is beyond the limit.
    TorqueLimit {
        /// The torque.
        torque: f64,
        /// The limit.
        limit: f64,
    } = 9,
        "torque {torque} is beyond the limit of {limit}";
    /// A target is passed at a speed from which the axis comes to rest only outside the position limits.
    NoRoomToStop {
        /// Where it would come to rest.
        rest: f64,
        /// The limit.
        limit: f64,
    } = 10,
        "the axis would come to rest at {rest}, beyond its limit of {limit}";
    /// The fraction of the velocity limits is not above 0 and up to 1.
    VelocityScale {
        /// The fraction.
        scale: f64,
    } = 11 as (scale, Fixed::<1>),
        "{scale} is not a fraction above 0 and up to 1";
    /// The fraction of the acceleration limits is not above 0 and up to 1.
    AccelerationScale {
        /// The fraction.
        scale: f64,
    } = 12 as (scale, Fixed::<1>),
        "{scale} is not a fraction above 0 and up to 1";
    /// The shortest duration is negative, or so long that no trajectory can be planned for it.
    MinimumDuration {
        /// The duration in seconds.
        duration_s: f64,
    } = 13,
        "{duration_s} s is not a possible duration";
    /// No trajectory within the limits leads there.
    NoTrajectory = 14,
        "no trajectory within the limits leads there";
    /// A rated torque is not a positive number.
    RatedTorque {
        /// The torque.
        torque: f64,
    } = 15,
        "{torque} is not a possible rated torque";
    /// No process data would be left in one direction.
    NoProcessData = 16,
        "there would be no PDO in one direction";
    /// A PDO maps too many objects.
    TooManyObjects = 20,
        "a PDO would have too many objects";
    /// An object cannot be mapped.
    Mapping {
        /// The object.
        object: MappedObject,
    } = 17,
        "object {:04X}:{:02X} cannot be mapped", object.index, object.subindex;
    /// An identifier is in use.
    IdTaken {
        /// The identifier.
        id: Id,
    } = 18,
        "identifier {id:?} is in use";
    /// The frames of a cycle would not fit into one batch.
    TooManyFrames {
        /// How many frames the bus would need.
        frames: u16,
        /// How many fit.
        limit: u16,
    } = 21,
        "{frames} frames in a cycle; {limit} fit";
    /// The drives are not told the time of day.
    NoTime = 19,
        "TIME is not sent";
    /// The host has no trajectory under this number.
    UnknownTrajectory = 22,
        "the host has no such trajectory";
    /// A trajectory does not begin where the axis is, or not at its velocity and acceleration.
    StartMismatch {
        /// Where it begins.
        position: f64,
        /// Where the axis is then.
        present: f64,
    } = 23,
        "the trajectory begins at {position} while the axis is at {present}, or not at its velocity";
    /// The cycle at which a trajectory was to take the place of another one has passed, or that one is not under way.
    TooLate = 24,
        "the cycle at which the trajectory was to begin has passed";
    /// Another trajectory is already to take the place of the present one.
    SuccessorPending = 25,
        "another trajectory is already to take the place of the present one";
    /// There is no such group.
    UnknownGroup {
        /// The number that was asked for.
        group: u8,
        /// How many groups there are.
        groups: u8,
    } = 26,
        "there is no group {group}: there are {groups}";
    /// It is for one group, there are several, and none is named.
    GroupNotNamed {
        /// How many groups there are.
        groups: u8,
    } = 27,
        "it must name one of the {groups} groups";
    /// The axis is in another group.
    OtherGroup {
        /// The group that was asked.
        asked: u8,
        /// The group that the axis is in.
        of_axis: u8,
    } = 28,
        "the axis is in group {of_axis}, not in group {asked}";
    /// The host has no callback under this number.
    UnknownCallback = 29,
        "the host has no such callback";
    /// The mode of the group is being changed.
    ModeChanging = 30,
        "the mode of operation is being changed";
    /// The axis is not set up for this mode.
    UnknownMode {
        /// The mode that was asked for.
        mode: OperationMode,
    } = 31,
        "the axis is not set up for {mode:?}";
    /// The process data of the axis do not carry an object that the change of its mode needs.
    ObjectNotMapped {
        /// The object.
        object: MappedObject,
    } = 32,
        "object {object} is not in the process data, and a change of the mode needs it";
    /// The drive takes another mode only while it is disabled.
    NotDisabled = 33,
        "the drive takes another mode only while it is disabled";
    /// The joint is not at rest.
    NotAtRest {
        /// How fast it is, or was a few cycles ago.
        velocity: f64,
    } = 34,
        "the joint is not at rest, or has not been for some cycles: {velocity}";
    /// The joint is at rest too far from its set-point: in another mode it would be pulled there in one step.
    OffSetPoint {
        /// How far.
        distance: f64,
        /// How far it may be.
        limit: f64,
    } = 35,
        "the joint is {distance} from its set-point; at most {limit} is allowed";
    /// The joint is beyond a wrap of its drive's position counter, or so far beyond its limits that it may as well be a lap of the counter
    /// away: the drive cannot be commanded where it is.
    BeyondCounter {
        /// Where it is, by what its drive has counted.
        position: f64,
        /// The nearest position limit.
        limit: f64,
    } = 36,
        "the joint is at {position}, where the count of its drive may have wrapped; its limit is {limit}";
    /// The last bring-up of the group has failed, or has not been confirmed yet: see
    /// [`Request::ConfirmBringUp`](crate::Request::ConfirmBringUp).
    NotBroughtUp = 37,
        "the last bring-up has failed or is not confirmed";
}

/// A request that was rejected. Nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct RequestError {
    /// What was asked for.
    pub request: RequestKind,
    /// Why it was rejected.
    pub reason: RejectReason,
    /// The axis concerned; `None` when it is not one axis.
    pub axis: Option<u8>,
    /// What the group was doing.
    pub phase: Phase,
}

impl core::fmt::Display for RequestError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:?} was rejected in phase {:?}", self.request, self.phase)?;
        match self.axis {
            Some(axis) => write!(f, ", axis {axis}: {}", self.reason),
            None => write!(f, ": {}", self.reason),
        }
    }
}

impl core::error::Error for RequestError {}
