//! What is wrong with the servo or its joint, beyond its alarms.

use takt_rt::Frame;

use crate::sim::defect::{Defect, Unsupported, shorter};

/// The lasting defects of one servo.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Defects {
    /// The joint does not move.
    pub is_joint_blocked: bool,
    /// The SDO server is mute.
    pub is_sdo_silent: bool,
    is_feedback_short: bool,
    /// The bits that TPDOs show as 1, and those that they show as 0.
    statusword: Option<(u16, u16)>,
}

impl Defects {
    /// A lasting defect comes or goes; events leave nothing here.
    ///
    /// # Errors
    /// [`Unsupported`] for what this servo cannot have.
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

    /// The statusword that TPDOs show in place of the true one.
    pub fn shown(&self, statusword: u16) -> u16 {
        let (set, clear) = self.statusword.unwrap_or_default();
        statusword & !clear | set
    }

    /// A TPDO as it leaves the drive.
    pub fn sent(&self, frame: Frame) -> Frame {
        if self.is_feedback_short { shorter(frame) } else { frame }
    }
}
