//! The defects of a YZ-AIM that raise no alarm by themselves.

use takt_rt::Frame;

use crate::sim::defect::{Defect, Unsupported, shorter};

/// The lasting defects of one YZ-AIM.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct YzAimDefects {
    /// The joint cannot move.
    pub is_joint_blocked: bool,
    /// The SDO server does not reply.
    pub is_sdo_silent: bool,
    is_feedback_short: bool,
    /// The bits that TPDOs send as 1, and those that they send as 0.
    statusword: Option<(u16, u16)>,
}

impl YzAimDefects {
    /// Sets or removes a lasting defect; events change nothing here.
    ///
    /// # Errors
    /// [`Unsupported`] when this drive cannot have the defect.
    pub fn set(&mut self, defect: Defect, is_present: bool) -> Result<(), Unsupported> {
        let refused = |reason| Err(Unsupported { defect, reason });
        match defect {
            Defect::BlockedJoint => self.is_joint_blocked = is_present,
            Defect::SilentSdoServer => self.is_sdo_silent = is_present,
            Defect::ShortFeedback => self.is_feedback_short = is_present,
            Defect::Statusword { set, clear } => self.statusword = is_present.then_some((set, clear)),
            Defect::EncoderJump { .. } | Defect::Alarm { .. } => {}
            Defect::StuckBrake => return refused("a YZ-AIM has no brake"),
            Defect::OtherObjectMapped => {
                return refused("the PDOs of a YZ-AIM are fixed, and can only be too short: \"short\"");
            }
            Defect::OperationModeDisplay { .. } => return refused("the PDOs of a YZ-AIM show no mode"),
            Defect::Emergency { .. } => return refused("a YZ-AIM sends no emergency messages"),
            Defect::TorqueOff => return refused("a YZ-AIM has no safe torque off"),
        }
        Ok(())
    }

    /// The statusword that TPDOs send instead of the true one.
    pub fn shown(&self, statusword: u16) -> u16 {
        let (set, clear) = self.statusword.unwrap_or_default();
        statusword & !clear | set
    }

    /// A TPDO as it is sent.
    pub fn sent(&self, frame: Frame) -> Frame {
        if self.is_feedback_short { shorter(frame) } else { frame }
    }
}
