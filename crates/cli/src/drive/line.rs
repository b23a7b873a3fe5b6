//! Opens a serial line, runs the procedure of a drive on it, and shows what happens.

use std::sync::atomic::Ordering;

use takt::link::modbus_line::ModbusLine;
use takt::link::serial_line::SerialSettings;
use takt_tools::commission::bus_session::SessionEvent;
use takt_tools::commission::line_session::{self, LineEvent};
use takt_tools::commission::{DriveTask, Failure, ProcedureError, Report, TargetDrive, Task};

use super::super::exit::Exit;
use super::super::interruption;
use super::super::usage_error::UsageError;
use super::options::Options;
use super::output::Output;
use super::target::Line;

/// Runs a task on a drive. The error is the end of the program: there was no line to run it on.
pub fn run(
    target: &TargetDrive,
    task: Task,
    line: &Line,
    options: Options,
    output: &mut Output,
) -> Result<Result<Report, ProcedureError>, Exit> {
    let Line { device, bit_rate } = line;
    let refused = |failure| Ok(Err(ProcedureError { step: "command line", failure }));
    let DriveTask { procedure, mut words } =
        match target.family().commission_on_line(target.clone(), task, *bit_rate) {
            Some(Ok(task)) => task,
            Some(Err(failure)) => return refused(failure),
            None => {
                let reason =
                    format!("the family {} is on a CAN bus, not on a serial line", target.drive.word);
                return refused(Failure::Unsuitable(reason));
            }
        };
    let mut line = match ModbusLine::open(device, &SerialSettings::new(*bit_rate)) {
        Ok(line) => line,
        Err(error) => return Err(UsageError::from(error.to_string()).print(options.json)),
    };
    let interrupted = match interruption::watch() {
        Ok(interrupted) => interrupted,
        Err(error) => {
            say!("takt: cannot watch for Ctrl-C: {error}");
            return Err(Exit::Stopped);
        }
    };
    let see = |at_ns, event: LineEvent<'_>| {
        let (direction, bytes) = match event {
            LineEvent::Procedure(event) => {
                // When the readings can no longer be printed, the procedure ends as after Ctrl-C.
                let is_shown = output.see(at_ns, SessionEvent::Procedure(event.clone()));
                interrupted.fetch_or(!is_shown, Ordering::Relaxed);
                return;
            }
            LineEvent::Sent(bytes) => ('>', bytes),
            LineEvent::Received(bytes) => ('<', bytes),
        };
        if options.verbose {
            say!("{:9.3} {direction} {bytes:02X?}  {}", at_ns as f64 * 1e-9, words(bytes));
        }
    };
    let is_interrupted = || interrupted.swap(false, Ordering::Relaxed);
    line_session::run(procedure, &mut line, is_interrupted, see).or_else(|error| {
        let failure = Failure::Request { what: error.to_string(), cure: None };
        Ok(Err(ProcedureError { step: "serial line", failure }))
    })
}
