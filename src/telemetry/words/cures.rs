//! What to do about each fault.

use takt_rt::Fault;

/// The cure of a fault. A drive that reports an error has a better one: that of its error.
pub(super) const fn cure(fault: &Fault) -> &'static str {
    match fault {
        Fault::NotFinite { .. } => {
            "find the division or the missing value in the program that sends set-points"
        }
        Fault::PositionLimit { .. } => "command a position within the limits; look at `limits.position`",
        Fault::VelocityLimit { .. } => "command less, or look at `limits.velocity`",
        Fault::AccelerationLimit { .. } => "command a smoother motion, or look at `limits.acceleration`",
        Fault::FollowingError { .. } => {
            "look for an obstacle or a brake that is not released; then clear the fault and move more slowly"
        }
        Fault::StaleCommand { .. } => {
            "the program that commanded this axis has stopped to renew it; clear the fault and begin again"
        }
        Fault::StreamNotBegun { .. } => "push points at once after the stream has begun, and clear the fault",
        Fault::MissedFeedback { .. } => {
            "check the power of the drive, its cable and the termination of the bus; after a loss of power, bring it up again"
        }
        Fault::LateFeedback { .. } => {
            "another master or an adapter delays its frames: end it, or give the bus a longer cycle"
        }
        Fault::DriveFault { .. } | Fault::EmergencyMessage { .. } => {
            "see the cure of the drive's error; clear the fault when its cause is gone"
        }
        Fault::DriveDisabled { .. } => "look at the drive's inputs, its supply and its safe torque off",
        Fault::ModeChanged { .. } => "no other program may command this drive; clear the fault",
        Fault::EnableTimeout { .. } => {
            "check the drive's supply and its enable input; wait after power-on, then enable again"
        }
        Fault::NoTrajectory => "choose a target that the limits allow",
        Fault::BusOff => {
            "look for a short circuit, the termination and the bit rate; clear the fault when the bus works again"
        }
        Fault::BusDown => {
            "set the interface up, or plug the adapter in again, and bring the drives up again; an adapter on a serial line needs another run"
        }
        Fault::NotTransmitted { .. } => {
            "the bus is blocked by other frames or errors; look at its load and its cable"
        }
        Fault::NotAcknowledged { .. } => {
            "check that the drive is in the mode that is configured; clear the fault"
        }
        Fault::NodeLost { .. } => "check the power of the drive and its cable, and bring it up again",
        Fault::NodeNotOperational { .. } => "no other master may send NMT commands; bring the drive up again",
        Fault::UnexpectedBootUp => "check the supply of the drive, and bring it up again",
        Fault::DuplicateNode { .. } => "give one of the two drives another node ID",
        Fault::ForeignMaster { .. } => "end the other master, or disconnect it",
        Fault::Suspended { .. } => {
            "keep the computer awake while drives are under power (`systemd-inhibit`); then bring the drives up again"
        }
        Fault::TimingUnfit { .. } => "`takt doctor` says what this computer lacks for real time",
        Fault::StartPose { .. } => "begin the stream where the axis is",
        Fault::JerkLimit { .. } => "command a smoother motion, or look at `limits.jerk`",
        Fault::BusErrorPassive => "check the cable, the termination and the bit rate",
        Fault::ImplausibleFeedback { .. } => "check the encoder and `counts_per_turn`",
        Fault::CallbackOverrun { .. } => "make the callback faster, or give it a larger budget",
        Fault::CallbackPanicked => "mend the callback; its message is in the log",
        Fault::NoTorqueInMode { .. } => "change the axis to CST",
        Fault::StiffnessLimit { .. } => "command less, or look at `stiffness_max`",
        Fault::DampingLimit { .. } => "command less, or look at `damping_max`",
        Fault::ModeNotShown { .. } => {
            "check that the drive has this mode; most change it only while disabled"
        }
        Fault::NotDisabled { .. } => {
            "keep away from the joint and cut the supply of its drive; clear the fault when the drive reports again that it is disabled"
        }
        Fault::DriveEnabled { .. } => {
            "keep away from the joint; end the other master or the vendor's tool that enables its drive, then clear the fault"
        }
        Fault::DriveLocal { .. } => {
            "keep away from the joint; end the vendor's tool or the local input that controls its drive, then clear the fault"
        }
        Fault::MeasuredPosition { .. } => {
            "keep away from the joint; look for what moves it against its drive, and at the drive's own deceleration and limits"
        }
        Fault::MeasuredVelocity { .. } => {
            "keep away from the joint; look at the load, at the drive's own limits, and at `limits.velocity`"
        }
        Fault::MeasuredTorque { .. } => {
            "look for an obstacle or a brake that is not released, or look at `limits.torque`; then clear the fault"
        }
        Fault::NotAtRest { .. } => "hold the joint still, or set its brake; then enable again",
    }
}
