//! Opens an SLCAN adapter on a serial line as a bus port for the real-time thread.

use std::os::fd::AsRawFd;
use std::time::{Duration, Instant};

use takt_rt::linux::{DescriptorError, SlcanPort};
use takt_rt::slcan::{AdapterLine, BitRate, Command, DataBitRate, LineReader};
use thiserror::Error;

use super::interface::InterfaceSettings;
use super::serial_line::{SerialLine, SerialLineError, SerialSettings};
use crate::config::CanLine;

/// How long an adapter has to answer a command. A CANable never answers.
const ANSWER_TIME: Duration = Duration::from_millis(50);
/// The line is silent when nothing has come for this time.
const SILENCE: Duration = Duration::from_millis(20);
/// How long to wait for silence after the channel was closed. An adapter with full buffers still sends what it had received.
const CLOSING_TIME: Duration = Duration::from_millis(500);
/// Bytes that are read in one call.
const READ_BYTES: usize = 256;
/// Ends the line that another program may have left unfinished.
const LINE_ENDS: &[u8] = b"\r\r\r";

/// Why an adapter cannot be used. The message ends with the cure.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SlcanError {
    /// The serial line cannot be used.
    #[error(transparent)]
    Line(#[from] SerialLineError),
    /// The chip of the serial line does not have this baud rate.
    #[error("{device} cannot have {baud_rate} baud ({reason}); name another rate: \"slcan:{device}@115200\"")]
    BaudRate {
        /// The path.
        device: String,
        /// Baud.
        baud_rate: u32,
        /// What the system said.
        reason: String,
    },
    /// No command sets this bit rate.
    #[error("{device}: SLCAN has no command for {bit_rate} bit/s; it has {}", rates(allowed))]
    BitRate {
        /// The path.
        device: String,
        /// Bit/s.
        bit_rate: u32,
        /// The bit rates that there are.
        allowed: Vec<u32>,
    },
    /// The adapter refuses a command.
    #[error("the adapter on {device} refuses the command `{command}`: {cure}")]
    Refused {
        /// The path.
        device: String,
        /// The command.
        command: String,
        /// What may help.
        cure: &'static str,
    },
    /// The line cannot be handed to the real-time thread.
    #[error("{device}: {error}")]
    Descriptor {
        /// The path.
        device: String,
        /// What the system said.
        #[source]
        error: DescriptorError,
    },
}

fn rates(allowed: &[u32]) -> String {
    allowed.iter().map(u32::to_string).collect::<Vec<_>>().join(", ")
}

/// Opens the channel of an adapter at these bit rates.
///
/// This waits for the adapter, so it is not for the real-time thread. The port that it returns never waits.
///
/// # Errors
/// See [`SlcanError`]. The adapter is left closed.
pub fn open_slcan(line: &CanLine, settings: &InterfaceSettings) -> Result<SlcanPort, SlcanError> {
    let InterfaceSettings { bit_rate, data_bit_rate, .. } = *settings;
    let CanLine { device, baud_rate } = line;
    let commands = commands(device, bit_rate, data_bit_rate)?;
    let mut adapter = Adapter { line: open_line(device, *baud_rate)?, reader: LineReader::default() };
    adapter.close_channel()?;
    for command in commands {
        if let Err(error) = adapter.order(command) {
            // It is refused already: whether it takes this one as well changes nothing.
            let _ = adapter.line.write(&Command::Close.text());
            return Err(error);
        }
    }
    SlcanPort::new(adapter.line.descriptor().as_raw_fd(), bit_rate, data_bit_rate)
        .map_err(|error| SlcanError::Descriptor { device: device.clone(), error })
}

fn open_line(device: &str, baud_rate: u32) -> Result<SerialLine, SlcanError> {
    SerialLine::open(device, &SerialSettings::new(baud_rate)).map_err(|error| match error {
        SerialLineError::Settings { device, reason, .. } => {
            SlcanError::BaudRate { device, baud_rate, reason }
        }
        error => error.into(),
    })
}

/// The commands that open the channel.
fn commands(device: &str, bit_rate: u32, data_bit_rate: Option<u32>) -> Result<Vec<Command>, SlcanError> {
    let refused = |bit_rate, allowed: &[u32]| SlcanError::BitRate {
        device: device.to_owned(),
        bit_rate,
        allowed: allowed.to_vec(),
    };
    let nominal = BitRate::of(bit_rate).ok_or_else(|| refused(bit_rate, &BitRate::all()))?;
    let mut commands = vec![Command::SetBitRate(nominal)];
    if let Some(rate) = data_bit_rate {
        let data = DataBitRate::of(rate).ok_or_else(|| refused(rate, &DataBitRate::all()))?;
        commands.push(Command::SetDataBitRate(data));
    }
    commands.push(Command::Open);
    Ok(commands)
}

/// An adapter that is being opened.
struct Adapter {
    line: SerialLine,
    reader: LineReader,
}

impl Adapter {
    /// Closes a channel that another program may have left open, and waits until nothing more comes.
    fn close_channel(&mut self) -> Result<(), SlcanError> {
        self.line.write(LINE_ENDS)?;
        self.line.write(&Command::Close.text())?;
        let end = Instant::now() + CLOSING_TIME;
        let mut bytes = [0; READ_BYTES];
        while Instant::now() < end && self.line.read(&mut bytes, SILENCE)? > 0 {}
        self.reader.clear();
        Ok(())
    }

    /// Sends a command, and waits for the answer that some adapters give.
    fn order(&mut self, command: Command) -> Result<(), SlcanError> {
        self.line.write(&command.text())?;
        let end = Instant::now() + ANSWER_TIME;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(());
            }
            let mut bytes = [0; READ_BYTES];
            let count = self.line.read(&mut bytes, left)?;
            if count == 0 {
                return Ok(());
            }
            for byte in bytes.iter().take(count) {
                match self.reader.push(*byte).map(AdapterLine::decode) {
                    Some(Ok(AdapterLine::Refused)) => return Err(self.refused(command)),
                    Some(Ok(AdapterLine::Accepted)) => return Ok(()),
                    _ => {}
                }
            }
        }
    }

    fn refused(&self, command: Command) -> SlcanError {
        let cure = match command {
            Command::SetDataBitRate(_) => "it has no CAN FD, or not this bit rate of the data phase",
            Command::SetBitRate(_) => "it does not have this bit rate",
            _ => "unplug it and plug it in again",
        };
        let text = command.text();
        let command = String::from_utf8_lossy(&text).trim_end().to_owned();
        SlcanError::Refused { device: self.line.device().to_owned(), command, cure }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::thread;
    use takt_sim::pseudo_terminal::PseudoTerminal;

    const CLASSIC: InterfaceSettings =
        InterfaceSettings { bit_rate: 1_000_000, data_bit_rate: None, restart_ms: 100 };

    fn line(device: &str) -> CanLine {
        CanLine { device: device.to_owned(), baud_rate: 1_000_000 }
    }

    fn refused(device: &str, settings: &InterfaceSettings) -> SlcanError {
        open_slcan(&line(device), settings).unwrap_err()
    }

    /// Opens a pseudo-terminal behind which an adapter answers each line with `answer`. Returns what it was sent, too.
    fn opened(
        settings: &InterfaceSettings,
        answer: impl Fn(&str) -> &'static [u8] + Send,
    ) -> (Result<SlcanPort, SlcanError>, String) {
        let mut terminal = PseudoTerminal::open().unwrap();
        let device = terminal.path().display().to_string();
        thread::scope(|scope| {
            let port = scope.spawn(|| open_slcan(&line(&device), settings));
            let mut all = String::new();
            let mut answered = 0;
            while !port.is_finished() {
                let mut bytes = [0; 64];
                match terminal.read(&mut bytes) {
                    Ok(count) => all.push_str(std::str::from_utf8(&bytes[..count]).unwrap()),
                    Err(_) => thread::sleep(Duration::from_millis(1)),
                }
                while let Some(end) = all[answered..].find('\r') {
                    terminal.write_all(answer(&all[answered..answered + end])).unwrap();
                    answered += end + 1;
                }
            }
            let port = port.join().unwrap();
            let mut bytes = [0; 64];
            while let Ok(count) = terminal.read(&mut bytes) {
                all.push_str(std::str::from_utf8(&bytes[..count]).unwrap());
            }
            (port, all)
        })
    }

    #[test]
    fn the_channel_is_closed_set_and_opened_whether_or_not_the_adapter_answers() {
        let fd = InterfaceSettings { data_bit_rate: Some(5_000_000), ..CLASSIC };
        for answer in [&b""[..], b"\r"] {
            let (port, sent) = opened(&CLASSIC, |_| answer);
            assert!(port.is_ok());
            assert_eq!(sent, "\r\r\rC\rS8\rO\r");
            let (port, sent) = opened(&fd, |_| answer);
            assert!(port.is_ok());
            assert_eq!(sent, "\r\r\rC\rS8\rY5\rO\r");
        }
    }

    #[test]
    fn an_adapter_that_refuses_to_close_a_channel_that_is_closed_is_opened() {
        let (port, _) = opened(&CLASSIC, |line| if line == "C" { b"\x07" } else { b"\r" });
        assert!(port.is_ok());
    }

    #[test]
    fn what_an_adapter_refuses_is_named_and_its_channel_is_left_closed() {
        let fd = InterfaceSettings { data_bit_rate: Some(5_000_000), ..CLASSIC };
        let (port, sent) = opened(&fd, |line| if line == "Y5" { b"\x07" } else { b"\r" });
        let error = port.unwrap_err().to_string();
        assert!(error.contains("refuses the command `Y5`: it has no CAN FD"), "{error}");
        assert!(sent.ends_with("Y5\rC\r"), "{sent:?}");
    }

    #[test]
    fn bit_rates_without_a_command_are_refused_before_anything_is_opened() {
        let error = refused("/dev/takt-none", &InterfaceSettings { bit_rate: 83_333, ..CLASSIC }).to_string();
        assert!(error.contains("no command for 83333 bit/s; it has 10000, 20000"), "{error}");
        let fd = InterfaceSettings { data_bit_rate: Some(2_500_000), ..CLASSIC };
        let error = refused("/dev/takt-none", &fd).to_string();
        assert!(error.contains("no command for 2500000 bit/s; it has 1000000, 2000000"), "{error}");
    }

    #[test]
    fn a_device_that_is_no_serial_line_and_one_that_another_program_has_are_named() {
        let error = refused("/dev/null", &CLASSIC).to_string();
        assert!(error.starts_with("/dev/null is no serial line; "), "{error}");
        let terminal = PseudoTerminal::open().unwrap();
        let device = terminal.path().display().to_string();
        let port = open_slcan(&line(&device), &CLASSIC).unwrap();
        let error = refused(&device, &CLASSIC).to_string();
        assert!(error.contains(&format!("another program uses {device}")), "{error}");
        drop(port);
        assert!(open_slcan(&line(&device), &CLASSIC).is_ok());
    }
}
