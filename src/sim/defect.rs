//! What can be wrong with a simulated drive or its joint beyond the causes of alarms
//! ([`DriveFault`](super::DriveFault)): things that the drive itself may not even notice.

use takt_rt::Frame;

/// Something wrong with a drive or its joint. Some are states that last until they are mended, the others
/// ([`Defect::is_event`]) just happen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Defect {
    /// The joint is held fast and cannot move at all.
    BlockedJoint,
    /// The brake stays engaged, whatever the drive does.
    StuckBrake,
    /// The SDO server gives no replies; everything else works.
    SilentSdoServer,
    /// The feedback PDOs carry other objects than they were mapped to: the position of the motor's encoder where the
    /// joint's belongs.
    OtherObjectMapped,
    /// The feedback PDOs are a byte shorter than they were mapped.
    ShortFeedback,
    /// The statusword in the feedback has other bits than the drive's state: some are set, some cleared.
    Statusword {
        /// Bits of object 6041 that are shown as 1.
        set: u16,
        /// Bits of object 6041 that are shown as 0, unless they are among `set`.
        clear: u16,
    },
    /// The feedback shows this mode of operation (object 6061).
    OperationModeDisplay {
        /// The number of the mode.
        mode: i8,
    },
    /// The encoder slips: the position that the drive works with jumps.
    EncoderJump {
        /// By so much at the joint: rad (m).
        distance: f64,
    },
    /// The drive detects an error with this code (object 603F) and goes to fault with an emergency message.
    Alarm {
        /// The code.
        code: u16,
    },
    /// The drive sends an emergency message with this code and goes on: a warning.
    Emergency {
        /// The code.
        code: u16,
    },
    /// The torque is taken from outside (safe torque off): the drive leaves operation enabled without a fault.
    TorqueOff,
}

impl Defect {
    /// Whether this happens once and is over, and there is nothing to mend.
    pub const fn is_event(self) -> bool {
        matches!(
            self,
            Self::EncoderJump { .. } | Self::Alarm { .. } | Self::Emergency { .. } | Self::TorqueOff
        )
    }
}

/// A frame without its last byte.
pub(super) fn shorter(frame: Frame) -> Frame {
    let shorter = frame.payload().split_last().and_then(|(_, rest)| Frame::data(frame.id(), rest).ok());
    shorter.unwrap_or(frame)
}

/// This simulated drive cannot be broken in this way.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{reason}")]
pub struct Unsupported {
    /// What it should have had.
    pub defect: Defect,
    /// Why it cannot, for people: names the family.
    pub reason: &'static str,
}
