//! Questions of clients to devices that are none of the configuration's.

use takt_rt::Frame;

use super::Handle;
use crate::channels::QUESTIONS_AT_MOST;
use crate::command::{CommandError, QuestionError};
use crate::family::{self, scan};

impl Handle {
    /// Sends a frame that only reads to a device on a bus which is none of the configuration's, through the service channel: within its
    /// room in the schedule, one frame in 2 ms, and only while the drives are up. SDO uploads and reads in the protocols of vendors are such
    /// frames. The reply is for whoever listens on the bus.
    ///
    /// # Errors
    /// [`CommandError::Question`], [`CommandError::Full`], [`CommandError::Ended`]; nothing is sent then.
    pub fn ask_device(&self, bus: usize, question: Frame) -> Result<(), CommandError> {
        if self.0.life.is_ending() {
            return Err(CommandError::Ended);
        }
        let buses = self.machine().buses.len();
        if bus >= buses {
            return Err(QuestionError::NoSuchBus { bus, buses }.into());
        }
        let reply = scan::reply_to_reading(&question).ok_or(QuestionError::NotReading { frame: question })?;
        let reaches = |ids: &[takt_rt::Id]| ids.contains(&question.id()) || ids.contains(&reply);
        let mut own = self.axes().iter().filter(|axis| axis.bus == bus);
        if let Some(axis) = own.find(|axis| reaches(&family::identifiers(&axis.drive, axis.node))) {
            return Err(QuestionError::OwnDrive { frame: question, axis: axis.name.clone() }.into());
        }
        match self.0.questions.put(bus, question) {
            true => Ok(()),
            false => Err(CommandError::Full { waiting: QUESTIONS_AT_MOST }),
        }
    }
}
