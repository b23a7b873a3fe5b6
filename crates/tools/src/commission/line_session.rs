//! Runs a procedure on a serial line of this machine.

use takt_rt::Nanoseconds;

use super::{ProcedureError, RunningTask};
use takt::link::modbus_line::ModbusLine;
use takt::link::serial_line::SerialLineError;
use takt::procedure::ProcedureEvent;

/// An event of the session, for an observer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LineEvent<'a> {
    /// An event of the procedure.
    Procedure(&'a ProcedureEvent),
    /// Bytes that the procedure sends.
    Sent(&'a Vec<u8>),
    /// Bytes that have come.
    Received(&'a Vec<u8>),
}

/// Runs a procedure to its end.
///
/// `is_interrupted` is called at each poll; each `true` interrupts the procedure once. `see` gets every event with the time since the line
/// was opened.
///
/// # Errors
/// The line does not work any more.
pub fn run<T: Clone>(
    mut procedure: Box<dyn RunningTask<Vec<u8>, T>>,
    line: &mut ModbusLine,
    mut is_interrupted: impl FnMut() -> bool,
    mut see: impl FnMut(Nanoseconds, LineEvent<'_>),
) -> Result<Result<T, ProcedureError>, SerialLineError> {
    loop {
        let received = line.read()?;
        let at_ns = line.now_ns();
        if !received.is_empty() {
            see(at_ns, LineEvent::Received(&received));
        }
        procedure.receive(&received);
        if is_interrupted() {
            procedure.interrupt();
        }
        let mut sending = vec![];
        procedure.poll(at_ns, &mut |bytes| sending.push(bytes));
        while let Some(event) = procedure.take_event() {
            see(at_ns, LineEvent::Procedure(&event));
        }
        for bytes in sending {
            see(at_ns, LineEvent::Sent(&bytes));
            line.write(&bytes)?;
        }
        if let Some(outcome) = procedure.outcome() {
            return Ok(outcome.clone());
        }
    }
}
