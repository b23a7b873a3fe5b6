//! The devices of a serial line behind a pseudo-terminal, in real time.

use std::io::{self, ErrorKind, Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use takt_rt::Nanoseconds;

use super::pseudo_terminal::PseudoTerminal;
use super::serial_line::DevicesOnLine;

/// How long the devices wait for the master: what they say is late by so much at most.
const TICK_NS: Nanoseconds = 1_000_000;

/// Lets the devices of a line live until `is_over`.
///
/// # Errors
/// The pseudo-terminal does not work any more.
pub fn host(
    line: &mut dyn DevicesOnLine,
    terminal: &mut PseudoTerminal,
    is_over: &AtomicBool,
) -> io::Result<()> {
    let began = Instant::now();
    let mut bytes = [0; 512];
    while !is_over.load(Ordering::Relaxed) {
        terminal.wait(TICK_NS);
        let now_ns = u64::try_from(began.elapsed().as_nanos()).unwrap_or(u64::MAX);
        match terminal.read(&mut bytes) {
            Ok(count) => line.send(now_ns, &bytes[..count]),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Err(error) => return Err(error),
        }
        match terminal.write_all(&line.receive(now_ns)) {
            // Nobody reads: a line without a listener loses its bytes.
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            outcome => outcome?,
        }
    }
    Ok(())
}
