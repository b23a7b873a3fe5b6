//! Simulated devices on serial lines, each on a pseudo-terminal.

use super::adapters::AdapterLink;
use crate::exit::Exit;
use crate::interruption;
use crate::usage_error::UsageError;
use takt_sim::line_faults::{FaultyLine, LineFault};
use takt_sim::live_serial_device::{LiveSerialDevice, kinds};
use takt_sim::pseudo_terminal::PseudoTerminal;
use takt_sim::serial_device::SerialDeviceKind;

/// The kind of device with this name.
pub fn named(text: &str) -> Result<&'static SerialDeviceKind, String> {
    kinds().iter().find(|kind| kind.name == text).ok_or_else(|| {
        let names: Vec<&str> = kinds().iter().map(|kind| kind.name).collect();
        format!("no device has this name; there are {}, and FAMILY:ADDRESS", names.join(", "))
    })
}

/// The help on the devices.
pub fn help() -> String {
    let kinds: Vec<String> = kinds().iter().map(|kind| format!("{} ({})", kind.name, kind.what)).collect();
    format!(
        "Simulate what is on a serial line instead, on a pseudo-terminal: FAMILY:ADDRESS[,ADDRESS…], or a device\n\n\
         Devices: {}. Any master opens the line as it would open /dev/ttyUSB0; --pty LINK gives it a second name.",
        kinds.join(", ")
    )
}

/// Runs the device until Ctrl-C or SIGTERM.
pub fn run(kind: &SerialDeviceKind, faults: &[LineFault], wishes: &[AdapterLink]) -> Exit {
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
    say!("{}: {}; Ctrl-C ends it", device.path(), (kind.use_words)());
    match device.run(&is_stopped) {
        Ok(()) => Exit::Done,
        Err(error) => {
            say!("takt: {}: {error}", device.path());
            Exit::Stopped
        }
    }
}

fn open(
    kind: &SerialDeviceKind,
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
    let device = FaultyLine::new((kind.make)(), faults.to_vec());
    Ok(LiveSerialDevice::new(line, Box::new(device)))
}
