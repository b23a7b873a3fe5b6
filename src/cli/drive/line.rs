//! Opens a serial line, runs the procedure of a drive on it, and shows what happens.

use std::sync::atomic::Ordering;

use crate::commission::bus_session::SessionEvent;
use crate::commission::{DriveTask, Failure, ProcedureError, Report, TargetDrive, Task};
use crate::link::modbus_line::ModbusLine;
use crate::link::serial_line::SerialSettings;

use super::super::exit::Exit;
use super::super::interruption;
use super::super::usage_error::UsageError;
use super::Options;
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
    let DriveTask { mut procedure, mut words } =
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
    let mut show = |at_ns, direction: char, bytes: &Vec<u8>| {
        if options.verbose && !bytes.is_empty() {
            say!("{:9.3} {direction} {bytes:02X?}  {}", at_ns as f64 * 1e-9, words(bytes));
        }
    };
    let broken = |error: &dyn std::fmt::Display| {
        let failure = Failure::Request { what: error.to_string(), cure: None };
        Ok(Err(ProcedureError { step: "serial line", failure }))
    };
    loop {
        let received = match line.read() {
            Ok(received) => received,
            Err(error) => return broken(&error),
        };
        let at_ns = line.now_ns();
        show(at_ns, '<', &received);
        procedure.receive(&received);
        // When the readings can no longer be printed, the procedure ends as after Ctrl-C.
        if interrupted.swap(false, Ordering::Relaxed) {
            procedure.interrupt();
        }
        let mut sending = vec![];
        procedure.poll(at_ns, &mut |bytes| sending.push(bytes));
        while let Some(event) = procedure.take_event() {
            let is_shown = output.see(at_ns, SessionEvent::Procedure(event));
            interrupted.fetch_or(!is_shown, Ordering::Relaxed);
        }
        for bytes in sending {
            show(at_ns, '>', &bytes);
            if let Err(error) = line.write(&bytes) {
                return broken(&error);
            }
        }
        if let Some(outcome) = procedure.outcome() {
            return Ok(outcome.clone());
        }
    }
}
