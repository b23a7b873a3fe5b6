//! The defects of an eRob, and their effect on its feedback.

use takt_rt::Frame;

use super::dictionary::{ErobDictionary, at};
use crate::sim::defect::{Defect, shorter};

/// The lasting defects of one eRob.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ErobDefects {
    /// The joint cannot move.
    pub is_joint_blocked: bool,
    /// The brake does not release.
    pub is_brake_stuck: bool,
    /// The SDO server does not reply.
    pub is_sdo_silent: bool,
    is_other_object_mapped: bool,
    is_feedback_short: bool,
    statusword: Option<(u16, u16)>,
    operation_mode: Option<i8>,
}

/// The entries that a defect can change in the feedback.
const SHOWN: [usize; 3] = [at::STATUSWORD, at::OPERATION_MODE_DISPLAY, at::POSITION];

/// The true values of these entries.
#[derive(Clone, Copy, Debug)]
pub struct Truth([u32; SHOWN.len()]);

impl ErobDefects {
    /// Sets or removes a lasting defect; events change nothing here.
    pub fn set(&mut self, defect: Defect, is_present: bool) {
        match defect {
            Defect::BlockedJoint => self.is_joint_blocked = is_present,
            Defect::StuckBrake => self.is_brake_stuck = is_present,
            Defect::SilentSdoServer => self.is_sdo_silent = is_present,
            Defect::OtherObjectMapped => self.is_other_object_mapped = is_present,
            Defect::ShortFeedback => self.is_feedback_short = is_present,
            Defect::Statusword { set, clear } => self.statusword = is_present.then_some((set, clear)),
            Defect::OperationModeDisplay { mode } => self.operation_mode = is_present.then_some(mode),
            Defect::EncoderJump { .. }
            | Defect::Alarm { .. }
            | Defect::Emergency { .. }
            | Defect::TorqueOff => {}
        }
    }

    /// Writes the defective values to the dictionary; [`Truth::restore`] restores the true ones.
    pub fn falsify(&self, dictionary: &mut ErobDictionary) -> Truth {
        let truth = Truth(SHOWN.map(|at| dictionary.get(at)));
        if let Some((set, clear)) = self.statusword {
            let word = dictionary.get(at::STATUSWORD) & !u32::from(clear) | u32::from(set);
            dictionary.set(at::STATUSWORD, word);
        }
        if let Some(mode) = self.operation_mode {
            dictionary.set(at::OPERATION_MODE_DISPLAY, mode as u8 as u32);
        }
        if self.is_other_object_mapped {
            dictionary.set(at::POSITION, dictionary.get(at::MOTOR_ENCODER));
        }
        truth
    }

    /// A feedback PDO as it is sent.
    pub fn sent(&self, frame: Frame) -> Frame {
        if self.is_feedback_short { shorter(frame) } else { frame }
    }
}

impl Truth {
    /// Restores the entries.
    pub fn restore(self, dictionary: &mut ErobDictionary) {
        for (at, value) in SHOWN.into_iter().zip(self.0) {
            dictionary.set(at, value);
        }
    }
}
