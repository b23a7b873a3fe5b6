//! Simulated devices on serial lines, each on a pseudo-terminal.

use clap::ValueEnum;

use super::adapters::AdapterLink;
use crate::cli::exit::Exit;
use crate::cli::interruption;
use crate::cli::usage_error::UsageError;
use crate::hollow_lines::{console, registers, transparent};
use crate::sim::hollow_lines::{Bridge, Console, Encoder, PulseModule, RegisterBridge};
use crate::sim::line_faults::{FaultyLine, LineFault};
use crate::sim::pseudo_terminal::PseudoTerminal;
use crate::sim::serial_device::{LiveSerialDevice, SerialDevice};

/// The identifiers of the motors behind the RS-485 module.
const MOTORS: [u8; 4] = [1, 2, 3, 4];
/// Where the encoder stands in the example of the manual, in counts.
const ENCODER_COUNTS: u32 = 678_257;

/// A device on a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SerialKind {
    /// The RS-485 module of the hollow-shaft motors in transparent mode, with motors 1 to 4 behind it
    HollowRs485,
    /// The RS-485 module in its Modbus mode, with motors 1 to 4 behind it
    HollowModbus,
    /// The serial console of a hollow-shaft motor
    HollowConsole,
    /// The hollow encoder
    HollowEncoder,
    /// The pulse module
    HollowPulse,
}

impl SerialKind {
    /// The device with this name.
    pub fn named(text: &str) -> Result<Self, String> {
        Self::from_str(text, false).map_err(|_| {
            let names = Self::value_variants().iter().filter_map(ValueEnum::to_possible_value);
            let names: Vec<String> = names.map(|name| name.get_name().to_owned()).collect();
            format!("no device has this name; there are {}, and FAMILY:ADDRESS", names.join(", "))
        })
    }

    fn device(self) -> Box<dyn SerialDevice> {
        match self {
            Self::HollowRs485 => Box::new(Bridge::new(&MOTORS)),
            Self::HollowModbus => Box::new(RegisterBridge::new(&MOTORS)),
            Self::HollowPulse => Box::new(PulseModule::default()),
            Self::HollowConsole => Box::new(Console::new()),
            Self::HollowEncoder => Box::new(Encoder::new(ENCODER_COUNTS)),
        }
    }

    /// What a person has to know to talk to it.
    fn words(self) -> String {
        match self {
            Self::HollowRs485 => format!(
                "{} baud on a real line; frames of {} bytes: identifier, 16 bytes, CRC-32",
                transparent::BAUD_RATE,
                transparent::FRAME_BYTES
            ),
            Self::HollowConsole => {
                format!("{} baud on a real line; each command ends with LF CR", console::BAUD_RATE)
            }
            Self::HollowModbus => {
                format!("{} baud on a real line; Modbus-RTU, 16 registers from 0x0000", registers::BAUD_RATE)
            }
            Self::HollowPulse => "settings of six bytes; nothing is answered".to_owned(),
            Self::HollowEncoder => "a request and its reply have the form of the RS-485 module".to_owned(),
        }
    }
}

/// Runs the device until Ctrl-C or SIGTERM.
pub fn run(kind: SerialKind, faults: &[LineFault], wishes: &[AdapterLink]) -> Exit {
    let mut device = match open(kind, faults, wishes) {
        Ok(device) => device,
        Err(error) => return error.print(false),
    };
    let is_stopped = match interruption::watch() {
        Ok(is_stopped) => is_stopped,
        Err(error) => {
            say!("takt: cannot watch for Ctrl-C: {error}");
            return Exit::Stopped;
        }
    };
    say!("{}: {}; Ctrl-C ends it", device.path(), kind.words());
    match device.run(&is_stopped) {
        Ok(()) => Exit::Done,
        Err(error) => {
            say!("takt: {}: {error}", device.path());
            Exit::Stopped
        }
    }
}

fn open(
    kind: SerialKind,
    faults: &[LineFault],
    wishes: &[AdapterLink],
) -> Result<LiveSerialDevice, UsageError> {
    let failed = |error: std::io::Error| UsageError::from(format!("opening a pseudo-terminal: {error}"));
    let mut line = PseudoTerminal::open().map_err(failed)?;
    for link in wishes.iter().filter_map(AdapterLink::link) {
        line.link(link).map_err(|error| {
            UsageError::from(format!("naming the pseudo-terminal {}: {error}", link.display()))
        })?;
    }
    let device = FaultyLine::new(kind.device(), faults.to_vec());
    Ok(LiveSerialDevice::new(line, Box::new(device)))
}
