//! The lasting defects of a simulated drive: their effect on its feedback and on its joint.

use takt_rt::Frame;

use super::defect::{Defect, shorter};
use super::object_dictionary::SimulatedDictionary;

/// The lasting defects of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointDefects {
    /// The joint cannot move.
    pub is_blocked: bool,
    /// The brake does not release.
    pub is_brake_stuck: bool,
}

impl JointDefects {
    /// Sets or removes a lasting defect; others change nothing here.
    pub fn set(&mut self, defect: Defect, is_present: bool) {
        match defect {
            Defect::BlockedJoint => self.is_blocked = is_present,
            Defect::StuckBrake => self.is_brake_stuck = is_present,
            _ => {}
        }
    }
}

/// Where the objects stand that a defect can change in the feedback.
#[derive(Clone, Copy, Debug)]
pub struct ShownObjects {
    /// 6041
    pub statusword: Option<usize>,
    /// 6061
    pub mode_display: Option<usize>,
    /// 6064
    pub position: Option<usize>,
    /// The object that takes the place of the position.
    pub instead_of_position: Option<usize>,
}

/// The lasting defects of the feedback.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FeedbackDefects {
    /// The SDO server does not reply.
    pub is_sdo_silent: bool,
    is_other_object_mapped: bool,
    is_short: bool,
    statusword: Option<(u16, u16)>,
    operation_mode: Option<i8>,
}

/// The true values of the objects that a defect can change in the feedback.
#[derive(Clone, Copy, Debug)]
pub struct Truth([(Option<usize>, i64); 3]);

impl FeedbackDefects {
    /// Sets or removes a lasting defect; others change nothing here.
    pub fn set(&mut self, defect: Defect, is_present: bool) {
        match defect {
            Defect::SilentSdoServer => self.is_sdo_silent = is_present,
            Defect::OtherObjectMapped => self.is_other_object_mapped = is_present,
            Defect::ShortFeedback => self.is_short = is_present,
            Defect::Statusword { set, clear } => self.statusword = is_present.then_some((set, clear)),
            Defect::OperationModeDisplay { mode } => self.operation_mode = is_present.then_some(mode),
            _ => {}
        }
    }

    /// Writes the defective values to the dictionary; [`Truth::restore`] restores the true ones.
    pub fn falsify(&self, shown: ShownObjects, dictionary: &mut SimulatedDictionary) -> Truth {
        let places = [shown.statusword, shown.mode_display, shown.position];
        let truth = Truth(places.map(|place| (place, dictionary.number_at(place).unwrap_or(0))));
        if let Some((set, clear)) = self.statusword {
            let word =
                dictionary.number_at(shown.statusword).unwrap_or(0) & !i64::from(clear) | i64::from(set);
            dictionary.set_at(shown.statusword, word);
        }
        if let Some(mode) = self.operation_mode {
            dictionary.set_at(shown.mode_display, mode.into());
        }
        if self.is_other_object_mapped {
            let other = dictionary.number_at(shown.instead_of_position).unwrap_or(0);
            dictionary.set_at(shown.position, other);
        }
        truth
    }

    /// A feedback PDO as it is sent.
    pub fn sent(&self, frame: Frame) -> Frame {
        if self.is_short { shorter(frame) } else { frame }
    }
}

impl Truth {
    /// Restores the objects.
    pub fn restore(self, dictionary: &mut SimulatedDictionary) {
        for (place, value) in self.0 {
            dictionary.set_at(place, value);
        }
    }
}
