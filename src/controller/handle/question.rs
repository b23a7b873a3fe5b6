//! Questions of clients to devices that are none of the configuration's.

use takt_rt::Frame;

use super::OwnProcess;
use crate::channels::QUESTIONS_AT_MOST;
use crate::command::{CommandError, QuestionError};
use crate::family::{self, scan};

impl OwnProcess {
    /// Sends a frame that only reads to a device on a bus which is none of the configuration's.
    pub(super) fn ask_device(&self, bus: usize, question: Frame) -> Result<(), CommandError> {
        if self.life.is_ending() {
            return Err(CommandError::Ended);
        }
        let buses = self.machine.buses.len();
        if bus >= buses {
            return Err(QuestionError::NoSuchBus { bus, buses }.into());
        }
        let reply = scan::reply_to_reading(&question).ok_or(QuestionError::NotReading { frame: question })?;
        let reaches = |ids: &[takt_rt::Id]| ids.contains(&question.id()) || ids.contains(&reply);
        let mut own = self.axes.iter().filter(|axis| axis.bus == bus);
        if let Some(axis) = own.find(|axis| reaches(&family::identifiers(&axis.drive, axis.node))) {
            return Err(QuestionError::OwnDrive { frame: question, axis: axis.name.clone() }.into());
        }
        match self.questions.put(bus, question) {
            true => Ok(()),
            false => Err(CommandError::Full { waiting: QUESTIONS_AT_MOST }),
        }
    }
}
