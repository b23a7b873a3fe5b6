//! The defects that a YZ-AIM can have.

use crate::defect::{Defect, Unsupported};

/// Checks that a YZ-AIM can have a defect.
///
/// # Errors
/// [`Unsupported`] with the reason.
pub fn check_possible(defect: Defect) -> Result<(), Unsupported> {
    let reason = match defect {
        Defect::BlockedJoint
        | Defect::SilentSdoServer
        | Defect::ShortFeedback
        | Defect::Statusword { .. }
        | Defect::EncoderJump { .. }
        | Defect::Alarm { .. } => return Ok(()),
        Defect::StuckBrake => "a YZ-AIM has no brake",
        Defect::OtherObjectMapped => "the PDOs of a YZ-AIM are fixed, and can only be too short: \"short\"",
        Defect::OperationModeDisplay { .. } => "the PDOs of a YZ-AIM show no mode",
        Defect::Emergency { .. } => "a YZ-AIM sends no emergency messages",
        Defect::TorqueOff => "a YZ-AIM has no safe torque off",
        Defect::Disobedience(_) => "a simulated YZ-AIM obeys its controlword",
    };
    Err(Unsupported { defect, reason })
}
