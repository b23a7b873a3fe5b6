//! Defects of a simulated drive or its joint. Unlike a [`DriveFault`](super::DriveFault), the drive itself may not
//! detect them.

use takt_rt::{Frame, FrameKind};

/// A defect of a drive or its joint. Most are states that last until they are removed; the others are momentary events
/// ([`Defect::is_event`]).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Defect {
    /// The joint is blocked.
    BlockedJoint,
    /// The brake stays engaged, whatever the drive commands.
    StuckBrake,
    /// The SDO server does not reply; everything else works.
    SilentSdoServer,
    /// The feedback PDOs carry another object than the mapping says: the motor encoder (2240) instead of the position
    /// (6064).
    OtherObjectMapped,
    /// The feedback PDOs are one byte shorter than their mapping.
    ShortFeedback,
    /// The statusword in the feedback has wrong bits.
    Statusword {
        /// Bits of object 6041 that are sent as 1.
        set: u16,
        /// Bits of object 6041 that are sent as 0, unless they are in `set`.
        clear: u16,
    },
    /// The feedback has this mode of operation (object 6061).
    OperationModeDisplay {
        /// The number of the mode.
        mode: i8,
    },
    /// The actual position of the drive jumps.
    EncoderJump {
        /// The distance at the joint: rad (m).
        distance: f64,
    },
    /// The drive detects an error with this code (object 603F), sends an emergency message and enters the fault state.
    Alarm {
        /// The error code.
        code: u16,
    },
    /// The drive sends an emergency message with this code and continues, as for a warning.
    Emergency {
        /// The error code.
        code: u16,
    },
    /// Safe torque off: the drive leaves operation enabled without a fault.
    TorqueOff,
    /// The drive does not obey its controlword.
    Disobedience(Disobedience),
}

/// How a drive does not obey its controlword (object 6040). It still reacts to faults, and to missing heartbeats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disobedience {
    /// It stays in its state.
    KeepsState,
    /// It is in operation enabled, whatever it is told.
    EnablesItself,
    /// Somebody else has it by its local interface: it stays in its state, and clears statusword bit 9 (remote).
    IsLocal,
}

impl Defect {
    /// Returns `true` if this is a momentary event, so that nothing has to be removed later.
    pub const fn is_event(self) -> bool {
        matches!(
            self,
            Self::EncoderJump { .. } | Self::Alarm { .. } | Self::Emergency { .. } | Self::TorqueOff
        )
    }
}

/// The frame with the next shorter length that one of its kind can have.
pub(super) fn shorter(frame: Frame) -> Frame {
    let (id, payload) = (frame.id(), frame.payload());
    let with_length = |length: usize| {
        let rest = payload.get(..length)?;
        match frame.kind() {
            FrameKind::Data => Frame::data(id, rest).ok(),
            FrameKind::Fd => Frame::fd(id, rest, false).ok(),
            FrameKind::FdBitRateSwitch => Frame::fd(id, rest, true).ok(),
            FrameKind::Remote => None,
        }
    };
    (0..payload.len()).rev().find_map(with_length).unwrap_or(frame)
}

/// This simulated drive cannot have the defect.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{reason}")]
pub struct Unsupported {
    /// The defect.
    pub defect: Defect,
    /// The reason, for people; it names the family.
    pub reason: &'static str,
}
