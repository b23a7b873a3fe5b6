//! A task with a drive that has an object dictionary: it is carried out by SDO.

use takt_rt::Frame;

use super::running::DriveTask;
use super::{Failure, Report, SdoSession, TargetDrive, Task, objects, scan};
use crate::family;
use crate::procedure::{CanopenClient, CanopenSession, Procedure};

/// The task with this drive. Scanning, reading and writing are the same for every family; `carry_out` does the rest.
///
/// # Errors
/// An object that the task names is not known, or does not take the value. Nothing has been sent then.
pub fn over_sdo(
    target: TargetDrive,
    task: Task,
    carry_out: impl AsyncFnOnce(&SdoSession, &TargetDrive, Task) -> Result<Report, Failure> + 'static,
) -> Result<DriveTask<Frame>, Failure> {
    let work = SdoWork::of(&target, task)?;
    let quirks = family::sdo_quirks(&target.drive, target.family().sdo_quirks().timing);
    let session = CanopenSession::new(CanopenClient::new(target.node, quirks));
    let c = SdoSession::new(session.clone(), target.drive.node_axis);
    let mut words = target.family().frame_words(target.clone());
    let procedure = Procedure::new(session, async move {
        match work {
            SdoWork::Read(objects) => objects::read(&c, &target, &objects).await,
            SdoWork::Write(write) => objects::write(&c, &target, write).await,
            SdoWork::Scan => scan::scan(&c).await,
            SdoWork::Task(task) => carry_out(&c, &target, task).await,
        }
    });
    Ok(DriveTask::new(procedure, move |frame| words(frame)))
}

/// A task whose objects have been found.
enum SdoWork {
    Read(Vec<objects::ReadObject>),
    Write(objects::WriteObject),
    Scan,
    Task(Task),
}

impl SdoWork {
    fn of(target: &TargetDrive, task: Task) -> Result<Self, Failure> {
        Ok(match task {
            Task::Read { names, data_type } => Self::Read(objects::to_read(target, &names, data_type)?),
            Task::Write { name, value, data_type } => {
                Self::Write(objects::to_write(target, &name, &value, data_type)?)
            }
            Task::Scan => Self::Scan,
            task => Self::Task(task),
        })
    }
}
