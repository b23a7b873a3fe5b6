//! The defects of a drive made from its data sheet, and their effect on its feedback.

use takt_rt::Frame;

use crate::sim::defect::{Defect, shorter};
use crate::sim::object_dictionary::SimulatedDictionary;

use super::places::Places;

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

    /// Writes the defective values to the dictionary; [`Truth::restore`] restores the true ones. Instead of the position,
    /// the feedback then has the torque (6077).
    pub fn falsify(&self, places: &Places, dictionary: &mut SimulatedDictionary) -> Truth {
        let shown = [places.statusword, places.mode_display, places.position];
        let truth = Truth(shown.map(|place| (place, dictionary.number_at(place).unwrap_or(0))));
        if let Some((set, clear)) = self.statusword {
            let word =
                dictionary.number_at(places.statusword).unwrap_or(0) & !i64::from(clear) | i64::from(set);
            dictionary.set_at(places.statusword, word);
        }
        if let Some(mode) = self.operation_mode {
            dictionary.set_at(places.mode_display, mode.into());
        }
        if self.is_other_object_mapped {
            let torque = dictionary.number_at(places.torque).unwrap_or(0);
            dictionary.set_at(places.position, torque);
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
