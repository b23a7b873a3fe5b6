//! What can go wrong: one table of the rules, and of the faults that break them.

use crate::cia402::{DriveState, OperationMode};
use crate::frame::Id;
use crate::recorded_numbers::{Fixed, RecordedNumber, RecordedNumbers, stated_or};
use crate::stop_category::StopCategory;
use crate::time::Nanoseconds;

/// A rule is `NUMBER: NAME, KEY, CATEGORY, SENTENCE;`. A fault is `NAME { FIELDS } => RULE, CURE;`: a recording keeps its fields,
/// in their order, or what stands behind `as`. Of several faults that break one rule, the first one whose condition
/// behind `if` the two numbers meet is read. The order of the faults and the numbers of the rules are those of
/// recordings: new ones come last.
macro_rules! faults {
    (
        rules { $($number:literal: $rule:ident, $key:literal, $category:ident, $says:literal;)* }
        faults {
            $($(#[$doc:meta])*
            $fault:ident $({ $($(#[$field_doc:meta])* $field:ident: $type:ty,)* })?
            => $broken:ident $(as $numbers:tt)? $(if $condition:expr)?, $cure:literal;)*
        }
    ) => {
        /// What is broken by a fault, without the numbers: the key of a configuration and the number of a recording.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
        #[repr(u8)]
        pub enum Rule {
            $(
                #[doc = concat!("`", $key, "`: ", $says, ".")]
                $rule = $number,
            )*
        }

        impl Rule {
            /// Every rule, in the order of their numbers.
            pub const ALL: [Self; [$($number),*].len()] = [$(Self::$rule),*];

            /// Its word in configurations and reports.
            pub const fn key(self) -> &'static str {
                match self {
                    $(Self::$rule => $key,)*
                }
            }

            /// Returns the condition that breaks it, in words.
            pub const fn sentence(self) -> &'static str {
                match self {
                    $(Self::$rule => $says,)*
                }
            }

            /// The stop that this rule asks for unless a configuration says otherwise. A drive that no longer obeys, or
            /// whose obedience cannot be seen, gets its power removed with the others' in a controlled stop; a bad
            /// command is a reason to stand still, not to drop the load onto the brakes.
            pub const fn default_category(self) -> StopCategory {
                match self {
                    $(Self::$rule => StopCategory::$category,)*
                }
            }
        }

        /// What made the group stop without anybody asking for it. Lengths are in rad (m for a linear axis) and their derivatives.
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
        pub enum Fault {
            $($(#[$doc])* $fault $({ $($(#[$field_doc])* $field: $type,)* })?,)*
        }

        impl Fault {
            /// The rule that is broken.
            pub const fn rule(&self) -> Rule {
                match self {
                    $(Self::$fault { .. } => Rule::$broken,)*
                }
            }

            /// What to do about it. A drive that reports an error has a better cure: that of its error.
            pub const fn cure(&self) -> &'static str {
                match self {
                    $(Self::$fault { .. } => $cure,)*
                }
            }

            /// What was seen and what was allowed, as two numbers for recordings; 0 where there is none.
            /// [`Fault::from_numbers`] is the way back.
            pub fn numbers(&self) -> (f64, f64) {
                match *self {
                    $(Self::$fault { $($($field),*)? } => {
                        stated_or!($($numbers)? ($($($field,)*)?)).to_numbers()
                    })*
                }
            }

            /// The fault that these numbers stand for; `None` for [`Rule::Requested`], and for numbers that no fault has.
            pub fn from_numbers(rule: Rule, seen: f64, allowed: f64) -> Option<Self> {
                match rule {
                    Rule::Requested => None,
                    $(Rule::$broken $(if meets(seen, allowed, $condition))? => {
                        let stated_or!($($numbers)? ($($($field,)*)?)) =
                            RecordedNumbers::from_numbers(seen, allowed)?;
                        Some(Self::$fault { $($($field),*)? })
                    })*
                }
            }
        }
    };
}

faults! {
    rules {
        0: Requested, "requested", Two, "the stop was asked for";
        1: NotFinite, "not_finite", Two, "a set-point is no number";
        2: PositionLimit, "position_limit", Two, "a set-point is outside the limits, or could not stop before one";
        3: VelocityLimit, "velocity_limit", Two, "a set-point is faster than the limit";
        4: AccelerationLimit, "acceleration_limit", Two, "a set-point accelerates more than the limit";
        5: FollowingError, "following_error", One, "a joint is farther off its set-point than its following error limit, for longer than its time";
        6: StaleCommand, "stale_command", Two, "a stream or a velocity has expired";
        7: MissedFeedback, "missed_feedback", One, "a drive did not report for too many cycles";
        8: DriveFault, "drive_fault", One, "a drive reports a fault";
        9: DriveDisabled, "drive_disabled", One, "a drive left operation enabled by itself";
        10: ModeChanged, "mode_changed", One, "a drive has another mode than the one that it was given";
        11: EnableTimeout, "enable_timeout", One, "a drive was not enabled in time";
        12: NoTrajectory, "no_trajectory", Two, "a move could not be planned";
        13: BusLost, "bus_lost", One, "bus-off, or the interface is down";
        14: NotTransmitted, "not_transmitted", One, "set-points do not get onto the wire, or the queue is full";
        15: NotAcknowledged, "not_acknowledged", One, "a drive in profile position does not acknowledge its target";
        16: NodeLost, "node_lost", One, "a drive's heartbeat ceased";
        17: NodeNotOperational, "node_not_operational", One, "a drive has left the NMT state operational";
        18: UnexpectedBootUp, "unexpected_boot_up", One, "a drive has started anew";
        19: EmergencyMessage, "emergency_message", One, "a drive sent an emergency message without a fault that explains it";
        20: DuplicateNode, "duplicate_node", One, "two nodes have one node ID";
        21: ForeignMaster, "foreign_master", One, "another node sends SYNC, set-points or NMT";
        22: TimingUnfit, "timing_unfit", One, "too many slots were missed: see missed_slots";
        23: StartPose, "start_pose", Two, "a stream begins too far from the joint";
        24: JerkLimit, "jerk_limit", Two, "a set-point of a stream changes its acceleration faster than the limit";
        25: BusErrorPassive, "bus_error_passive", Two, "the CAN controller has gone error passive";
        26: ImplausibleFeedback, "implausible_feedback", One, "a joint is reported where it cannot have got to";
        27: CallbackOverrun, "callback_overrun", Two, "a call of a callback took longer than its budget";
        28: CallbackPanicked, "callback_panicked", Two, "a callback panicked";
        29: NoTorqueInMode, "no_torque_in_mode", Two, "a torque or an impedance was wanted in another mode than \"cst\"";
        30: StiffnessLimit, "stiffness_limit", Two, "an impedance was wanted that is stiffer than stiffness_max";
        31: DampingLimit, "damping_limit", Two, "an impedance was wanted with more damping than damping_max";
        32: ModeNotShown, "mode_not_shown", One, "a drive does not show the mode that it was changed to";
        33: NotDisabled, "not_disabled", One, "a drive has not confirmed in time that it is disabled";
        34: DriveEnabled, "drive_enabled", One, "a drive has torque while its group is disabled";
        35: DriveLocal, "drive_local", One, "an enabled drive has cleared its remote bit (statusword bit 9)";
        36: MeasuredPosition, "measured_position", One, "an enabled joint is beyond a position limit by more than its following error limit";
        37: MeasuredVelocity, "measured_velocity", One, "an enabled joint is faster than 1.2 times its limit";
        38: MeasuredTorque, "measured_torque", One, "an enabled drive exerts more than 1.2 times the limit for long, and not what it limits itself to (6072)";
        39: NotAtRest, "not_at_rest", One, "a joint moves while it is to be enabled";
    }
    faults {
        /// A set-point, or the torque that is made of it here, was not a finite number.
        NotFinite {
            /// The position of the set-point; NaN for a torque.
            position: f64,
        } => NotFinite,
            "find the division or the missing value in the program that sends set-points";
        /// A set-point lay outside the position limits; in a profile mode, the place where the joint would come to rest.
        PositionLimit {
            /// The position.
            position: f64,
            /// The limit that it breaks.
            limit: f64,
        } => PositionLimit,
            "command a position within the limits; look at `limits.position`";
        /// A set-point asked for more than the velocity limit.
        VelocityLimit {
            /// The velocity.
            velocity: f64,
            /// The highest speed.
            limit: f64,
        } => VelocityLimit,
            "command less, or look at `limits.velocity`";
        /// A set-point asked for more than the acceleration limit.
        AccelerationLimit {
            /// The acceleration.
            acceleration: f64,
            /// The highest acceleration.
            limit: f64,
        } => AccelerationLimit,
            "command a smoother motion, or look at `limits.acceleration`";
        /// A set-point of a stream asked for more than the jerk limit.
        JerkLimit {
            /// The jerk.
            jerk: f64,
            /// The highest jerk.
            limit: f64,
        } => JerkLimit,
            "command a smoother motion, or look at `limits.jerk`";
        /// A stream began too far from where the joint is.
        StartPose {
            /// The distance.
            distance: f64,
            /// The largest distance allowed.
            limit: f64,
        } => StartPose,
            "begin the stream where the axis is";
        /// The joint was farther from its set-point than allowed for longer than allowed.
        FollowingError {
            /// The following error.
            error: f64,
            /// The largest one allowed.
            limit: f64,
        } => FollowingError,
            "look for an obstacle or a brake that is not released; then clear the fault and move more slowly";
        /// A joint was reported where it cannot be.
        ImplausibleFeedback {
            /// The distance from the last plausible position.
            distance: f64,
            /// The largest distance that the joint can have moved since.
            reachable: f64,
        } => ImplausibleFeedback,
            "check the encoder and `counts_per_turn`";
        /// A stream was begun, and no command came.
        StreamNotBegun {
            /// Cycles since the stream was begun.
            cycles: u32,
            /// Cycles within which the first command must come.
            limit: u32,
        } => StaleCommand if |_, allowed| allowed > 0.0,
            "push points at once after the stream has begun, and clear the fault";
        /// A streamed command, a velocity or a torque expired and was not renewed.
        StaleCommand {
            /// Cycles since it expired.
            age_cycles: u64,
        } => StaleCommand,
            "the program that commanded this axis has stopped to renew it; clear the fault and begin again";
        /// A drive has not reported in time for too many cycles.
        MissedFeedback {
            /// Cycles of its bus without feedback in time.
            cycles: u16,
            /// Cycles that are allowed.
            limit: u16,
        } => MissedFeedback if |_, allowed| allowed != 0.0,
            "check the power of the drive, its cable and the termination of the bus; after a loss of power, bring it up again";
        /// A drive reports whole cycles late, in every cycle.
        LateFeedback {
            /// Cycles of its bus.
            cycles: u16,
        } => MissedFeedback,
            "another master or an adapter delays its frames: end it, or give the bus a longer cycle";
        /// A drive reports a fault.
        DriveFault {
            /// Object 603F, or the code of the last emergency message; 0 if the drive gave none.
            error_code: u16,
        } => DriveFault,
            "see the cure of the drive's error; clear the fault when its cause is gone";
        /// A drive has left operation enabled by itself.
        DriveDisabled {
            /// Object 6041.
            statusword: u16,
        } => DriveDisabled,
            "look at the drive's inputs, its supply and its safe torque off";
        /// A drive was to be disabled and has not confirmed in time that it has no torque.
        NotDisabled {
            /// The state that it showed last.
            state: DriveState,
            /// Cycles of its bus without feedback; 0 if it reports.
            silent_cycles: u16,
        } => NotDisabled,
            "keep away from the joint and cut the supply of its drive; clear the fault when the drive reports again that it is disabled";
        /// A drive has torque although its group is disabled: it was enabled by something else than this controller.
        DriveEnabled {
            /// The state that it shows.
            state: DriveState,
        } => DriveEnabled,
            "keep away from the joint; end the other master or the vendor's tool that enables its drive, then clear the fault";
        /// An enabled drive does not obey the bus any more: it has cleared statusword bit 9 (remote), which it had set.
        DriveLocal {
            /// Object 6041.
            statusword: u16,
        } => DriveLocal,
            "keep away from the joint; end the vendor's tool or the local input that controls its drive, then clear the fault";
        /// The joint of an enabled drive is beyond a position limit by more than the following error limit.
        MeasuredPosition {
            /// Where it is.
            position: f64,
            /// The limit.
            limit: f64,
        } => MeasuredPosition,
            "keep away from the joint; look for what moves it against its drive, and at the drive's own deceleration and limits";
        /// The joint of an enabled drive is more than a fifth faster than its velocity limit.
        MeasuredVelocity {
            /// Its velocity.
            velocity: f64,
            /// The highest speed.
            limit: f64,
        } => MeasuredVelocity,
            "keep away from the joint; look at the load, at the drive's own limits, and at `limits.velocity`";
        /// An enabled drive exerts more than a fifth more torque than the torque limit, and not the torque to which it limits itself
        /// (object 6072).
        MeasuredTorque {
            /// Object 6077 in N·m (N).
            torque: f64,
            /// The highest torque.
            limit: f64,
        } => MeasuredTorque,
            "look for an obstacle or a brake that is not released, or look at `limits.torque`; then clear the fault";
        /// A drive shows another mode of operation than the one that it was set to.
        ModeChanged {
            /// Object 6061.
            shown: i8,
            /// Object 6060.
            expected: OperationMode,
        } => ModeChanged,
            "no other program may command this drive; clear the fault";
        /// A drive was told another mode of operation and has not shown it in time.
        ModeNotShown {
            /// Object 6061; 0 if it is not reported.
            shown: i8,
            /// Object 6060.
            expected: OperationMode,
        } => ModeNotShown,
            "check that the drive has this mode; most change it only while disabled";
        /// A torque or an impedance was wanted of an axis in a mode that has none: only in cyclic synchronous torque the loop is
        /// closed here.
        NoTorqueInMode {
            /// The mode of the axis, object 6060.
            mode: OperationMode,
        } => NoTorqueInMode as (Fixed::<0>, mode),
            "change the axis to CST";
        /// A stiffness was wanted that is negative, or more than the axis allows.
        StiffnessLimit {
            /// N·m/rad.
            stiffness: f64,
            /// The highest stiffness.
            limit: f64,
        } => StiffnessLimit,
            "command less, or look at `stiffness_max`";
        /// A damping was wanted that is negative, or more than the axis allows.
        DampingLimit {
            /// N·m·s/rad.
            damping: f64,
            /// The highest damping.
            limit: f64,
        } => DampingLimit,
            "command less, or look at `damping_max`";
        /// A drive in profile position does not acknowledge its target.
        NotAcknowledged {
            /// Cycles of its bus.
            cycles: u32,
            /// Cycles within which it must.
            limit: u32,
        } => NotAcknowledged,
            "check that the drive is in the mode that is configured; clear the fault";
        /// A drive did not reach operation enabled in time.
        EnableTimeout {
            /// Cycles since enabling began.
            cycles: u32,
            /// Cycles that are allowed.
            limit: u32,
        } => EnableTimeout,
            "check the drive's supply and its enable input; wait after power-on, then enable again";
        /// A joint that was to be enabled did not come to rest in time: a drive is not enabled on a joint that moves.
        NotAtRest {
            /// How fast it was at the end: rad/s (m/s).
            velocity: f64,
            /// The mean velocity below which a joint is at rest.
            limit: f64,
        } => NotAtRest,
            "hold the joint still, or set its brake; then enable again";
        /// No trajectory exists for what was asked.
        NoTrajectory => NoTrajectory,
            "choose a target that the limits allow";
        /// A controller of a bus has left it, because of its own errors (ISO 11898-1).
        BusOff => BusLost if |seen, _| seen <= 0.0,
            "look for a short circuit, the termination and the bit rate; clear the fault when the bus works again";
        /// An interface is down, or has gone.
        BusDown => BusLost as (Fixed::<1>,),
            "set the interface up, or plug the adapter in again, and bring the drives up again; an adapter on a serial line needs another run";
        /// The error counters of an interface are near bus-off.
        BusErrorPassive => BusErrorPassive,
            "check the cable, the termination and the bit rate";
        /// Frames of this controller do not get onto the wire.
        NotTransmitted {
            /// Cycles in a row.
            cycles: u32,
            /// Cycles that are allowed.
            limit: u32,
        } => NotTransmitted,
            "the bus is blocked by other frames or errors; look at its load and its cable";
        /// The heartbeat of a node has not come for too long.
        NodeLost {
            /// Cycles since the last one.
            cycles: u32,
            /// Cycles that are allowed.
            limit: u32,
        } => NodeLost,
            "check the power of the drive and its cable, and bring it up again";
        /// A node is in another NMT state than operational.
        NodeNotOperational {
            /// The state that its heartbeat shows (CiA 301, 7.2.8.3.2.2).
            state: u8,
        } => NodeNotOperational,
            "no other master may send NMT commands; bring the drive up again";
        /// A node has started anew while it was to work.
        UnexpectedBootUp => UnexpectedBootUp,
            "check the supply of the drive, and bring it up again";
        /// A drive has sent an emergency message, and its statusword shows no fault that would explain it.
        EmergencyMessage {
            /// The error code.
            code: u16,
        } => EmergencyMessage,
            "see the cure of the drive's error; clear the fault when its cause is gone";
        /// Two nodes answer with one node ID.
        DuplicateNode {
            /// The node ID.
            node: u8,
        } => DuplicateNode,
            "give one of the two drives another node ID";
        /// Another master sends SYNC, set-points or NMT commands on the bus.
        ForeignMaster {
            /// The identifier of its frame.
            id: Id,
        } => ForeignMaster,
            "end the other master, or disconnect it";
        /// Too many slots were missed.
        TimingUnfit {
            /// Missed slots that are not yet forgiven.
            missed: u32,
            /// As many are too many.
            limit: u32,
        } => TimingUnfit if |_, allowed| allowed != 0.0,
            "`takt doctor` says what this computer lacks for real time";
        /// The computer was suspended while drives were under power.
        Suspended {
            /// For how long.
            suspended_ns: Nanoseconds,
        } => TimingUnfit,
            "keep the computer awake while drives are under power (`systemd-inhibit`); then bring the drives up again";
        /// A call of the owner's callback has taken longer than it may.
        CallbackOverrun {
            /// How long it took.
            spent_ns: Nanoseconds,
            /// How long it may take.
            budget_ns: Nanoseconds,
        } => CallbackOverrun,
            "make the callback faster, or give it a larger budget";
        /// The owner's callback has panicked.
        CallbackPanicked => CallbackPanicked,
            "mend the callback; its message is in the log";
    }
}

fn meets(seen: f64, allowed: f64, condition: fn(f64, f64) -> bool) -> bool {
    condition(seen, allowed)
}

impl RecordedNumber for Rule {
    fn to_number(self) -> f64 {
        f64::from(self as u8)
    }

    fn from_number(number: f64) -> Option<Self> {
        Self::ALL.get(number as usize).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_of_another_master_keeps_the_length_of_its_identifier() {
        for id in [Id::base(0x080).unwrap(), Id::extended(0x080).unwrap(), Id::extended(0x1234_5678).unwrap()]
        {
            let fault = Fault::ForeignMaster { id };
            let (seen, allowed) = fault.numbers();
            assert_eq!(Fault::from_numbers(Rule::ForeignMaster, seen, allowed), Some(fault));
        }
    }

    #[test]
    fn every_fault_comes_back_from_its_numbers_and_breaks_the_rule_with_its_number() {
        for (number, rule) in Rule::ALL.into_iter().enumerate() {
            assert_eq!(rule as usize, number);
            // Operation modes are 1 to 10, states of drives 0 to 7; 0 chooses the other one of two faults of a rule.
            for (seen, allowed) in [(3.0, 8.0), (3.0, 0.0), (0.0, 8.0), (0.0, 0.0)] {
                let Some(fault) = Fault::from_numbers(rule, seen, allowed) else { continue };
                assert_eq!(fault.rule(), rule);
                let (seen, allowed) = fault.numbers();
                assert_eq!(Fault::from_numbers(rule, seen, allowed), Some(fault));
            }
        }
    }
}
