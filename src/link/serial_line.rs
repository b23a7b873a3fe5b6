//! A serial line of this machine: `/dev/ttyUSB0`, `/dev/ttyACM0`, a pseudo-terminal.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use nix::unistd::{Gid, Group};
use serial2::rs4xx::{Rs485Config, TransceiverMode};
use serial2::{CharSize, FlowControl, KeepSettings, Parity, SerialPort, StopBits};
use thiserror::Error;

/// How a line is set up. Characters have eight data bits, no parity and one stop bit, as all devices here want them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SerialSettings {
    /// bit/s
    pub bit_rate: u32,
    /// Who switches an RS-485 line from receiving to sending.
    pub direction: Direction,
}

impl SerialSettings {
    /// With an adapter that switches by itself.
    pub const fn new(bit_rate: u32) -> Self {
        Self { bit_rate, direction: Direction::Adapter }
    }
}

/// Who switches an RS-485 line from receiving to sending.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Direction {
    /// The adapter, by itself, as all on USB do.
    #[default]
    Adapter,
    /// The kernel, by the signal RTS of a serial port on board.
    Kernel,
}

/// Why a line cannot be used. The message ends with the cure.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SerialLineError {
    /// There is no such device.
    #[error("there is no {device}{}", present(lines))]
    Missing {
        /// The path.
        device: String,
        /// The serial lines that this machine has.
        lines: Vec<String>,
    },
    /// The path is that of something else.
    #[error("{device} is no serial line{}", present(lines))]
    NotSerial {
        /// The path.
        device: String,
        /// The serial lines that this machine has.
        lines: Vec<String>,
    },
    /// This user may not open it.
    #[error("this user may not open {device}; to allow it: {cure}")]
    NotPermitted {
        /// The path.
        device: String,
        /// What allows it.
        cure: String,
    },
    /// Another program uses it.
    #[error("another program uses {device}; to see which: sudo fuser -v {device}")]
    Busy {
        /// The path.
        device: String,
    },
    /// The device does not have this bit rate.
    #[error(
        "{device} cannot have {bit_rate} bit/s ({reason}); set the drive and the line to another bit rate"
    )]
    Settings {
        /// The path.
        device: String,
        /// What was asked for.
        bit_rate: u32,
        /// What the system said.
        reason: String,
    },
    /// The kernel cannot switch the line from receiving to sending.
    #[error(
        "{device} has no RS-485 mode in the kernel ({reason}); use an adapter that switches by itself, and leave this setting out"
    )]
    NoDirection {
        /// The path.
        device: String,
        /// What the system said.
        reason: String,
    },
    /// The line does not work.
    #[error("{device}: {action}: {error}; unplug the adapter and plug it in again")]
    System {
        /// The path.
        device: String,
        /// What was tried.
        action: &'static str,
        /// What the system said.
        #[source]
        error: io::Error,
    },
}

fn present(lines: &[String]) -> String {
    match lines {
        [] => "; this machine has no serial line on USB: is the adapter plugged in?".to_owned(),
        lines => format!("; the serial lines of this machine: {}", lines.join(", ")),
    }
}

/// An open line. No other program that asks for the same lock uses it meanwhile.
#[derive(Debug)]
pub struct SerialLine {
    device: String,
    port: SerialPort,
    lock: File,
}

impl SerialLine {
    /// Opens a line.
    ///
    /// # Errors
    /// See [`SerialLineError`].
    pub fn open(device: &str, settings: &SerialSettings) -> Result<Self, SerialLineError> {
        device_number(device)?;
        let lock = lock(device)?;
        let mut port = SerialPort::open(device, KeepSettings).map_err(|error| refusal(device, error))?;
        set_up(device, &mut port, settings)?;
        // Some adapters send nothing before the host is ready (DTR). A pseudo-terminal has no such signal.
        let _ = port.set_dtr(true);
        // What came before is of no use; a line that cannot discard it delivers it.
        let _ = port.discard_buffers();
        Ok(Self { device: device.to_owned(), port, lock })
    }

    /// The path of the device.
    pub fn device(&self) -> &str {
        &self.device
    }

    /// A descriptor of the line. A duplicate of it keeps the lock.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.lock.as_fd()
    }

    /// Sends bytes. The kernel has them when this returns; they may not all have gone out yet.
    ///
    /// # Errors
    /// The line does not work any more.
    pub fn write(&self, bytes: &[u8]) -> Result<(), SerialLineError> {
        self.port.write_all(bytes).map_err(|error| self.failed("writing", error))
    }

    /// Waits for bytes until some come, not longer than a time. Returns how many came.
    ///
    /// # Errors
    /// The line does not work any more.
    pub fn read(&mut self, bytes: &mut [u8], within: Duration) -> Result<usize, SerialLineError> {
        let within = within.max(Duration::from_millis(1));
        let read = self.port.set_read_timeout(within).and_then(|()| self.port.read(bytes));
        match read {
            Ok(0) => Err(self.failed("reading", ErrorKind::UnexpectedEof.into())),
            Ok(count) => Ok(count),
            Err(error)
                if matches!(
                    error.kind(),
                    ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted
                ) =>
            {
                Ok(0)
            }
            Err(error) => Err(self.failed("reading", error)),
        }
    }

    fn failed(&self, action: &'static str, error: io::Error) -> SerialLineError {
        SerialLineError::System { device: self.device.clone(), action, error }
    }
}

/// The number of a device, which is the same for all of its paths. Looks at it without opening it: opening something else than a
/// serial line may have an effect.
pub(super) fn device_number(device: &str) -> Result<u64, SerialLineError> {
    let metadata = fs::metadata(device).map_err(|error| match error.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory => {
            SerialLineError::Missing { device: device.to_owned(), lines: serial_lines() }
        }
        _ => refusal(device, error),
    })?;
    if metadata.file_type().is_char_device() {
        Ok(metadata.rdev())
    } else {
        Err(SerialLineError::NotSerial { device: device.to_owned(), lines: serial_lines() })
    }
}

/// The lock that terminal programs ask for, too (flock): two masters on a line destroy each other's frames. It lasts until the last
/// duplicate of the descriptor is closed.
fn lock(device: &str) -> Result<File, SerialLineError> {
    let file = OpenOptions::new()
        .read(true)
        .write(true)
        .custom_flags(libc::O_NONBLOCK | libc::O_NOCTTY)
        .open(device)
        .map_err(|error| refusal(device, error))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(SerialLineError::Busy { device: device.to_owned() }),
        Err(TryLockError::Error(error)) => Err(refusal(device, error)),
    }
}

fn set_up(device: &str, port: &mut SerialPort, wanted: &SerialSettings) -> Result<(), SerialLineError> {
    let mut settings = port.get_configuration().map_err(|error| refusal(device, error))?;
    settings.set_raw();
    settings.set_char_size(CharSize::Bits8);
    settings.set_flow_control(FlowControl::None);
    settings.set_parity(Parity::None);
    settings.set_stop_bits(StopBits::One);
    let set = settings.set_baud_rate(wanted.bit_rate).and_then(|()| port.set_configuration(&settings));
    set.map_err(|error| SerialLineError::Settings {
        device: device.to_owned(),
        bit_rate: wanted.bit_rate,
        reason: error.to_string(),
    })?;
    if wanted.direction == Direction::Kernel {
        port.set_rs4xx_mode(TransceiverMode::from(Rs485Config::new())).map_err(|error| {
            SerialLineError::NoDirection { device: device.to_owned(), reason: error.to_string() }
        })?;
    }
    Ok(())
}

fn refusal(device: &str, error: io::Error) -> SerialLineError {
    let device = device.to_owned();
    match error.raw_os_error() {
        Some(libc::EACCES | libc::EPERM) => {
            let cure = permission(Path::new(&device));
            SerialLineError::NotPermitted { device, cure }
        }
        Some(libc::EBUSY) => SerialLineError::Busy { device },
        Some(libc::ENOTTY | libc::EINVAL) => SerialLineError::NotSerial { device, lines: serial_lines() },
        Some(libc::ENXIO | libc::ENODEV) => SerialLineError::Missing { device, lines: serial_lines() },
        _ => SerialLineError::System { device, action: "opening it", error },
    }
}

/// The command that gives this user the group of the device: `dialout` on Debian and Ubuntu, `uucp` on Arch Linux.
fn permission(device: &Path) -> String {
    let group = fs::metadata(device).ok().map(|metadata| Gid::from_raw(metadata.gid()));
    let named = group.filter(|gid| gid.as_raw() != 0).and_then(|gid| Group::from_gid(gid).ok().flatten());
    match named {
        Some(group) => format!("sudo usermod -aG {} $USER, then log in again", group.name),
        None => format!("sudo chmod a+rw {}", device.display()),
    }
}

/// The serial lines on USB of this machine. The ones on board (`ttyS…`) exist whether or not anything is connected.
fn serial_lines() -> Vec<String> {
    let lines: Vec<PathBuf> = SerialPort::available_ports().unwrap_or_default();
    let mut names: Vec<String> = lines.iter().map(|path| path.display().to_string()).collect();
    names.retain(|name| !name.starts_with("/dev/ttyS"));
    names.sort();
    names
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};

    use super::*;
    use takt_sim::pseudo_terminal::PseudoTerminal;

    const SETTINGS: SerialSettings = SerialSettings::new(115_200);

    #[test]
    fn bytes_cross_a_line_in_both_directions_and_silence_is_no_error() {
        let mut device = PseudoTerminal::open().unwrap();
        let mut line = SerialLine::open(&device.path().display().to_string(), &SETTINGS).unwrap();
        let mut bytes = [0; 16];
        assert_eq!(line.read(&mut bytes, Duration::from_millis(1)).unwrap(), 0);
        line.write(&[0x0D, 0x0A, 0x11, 0xFF, 0]).unwrap();
        device.wait(1_000_000_000);
        assert_eq!(device.read(&mut bytes).unwrap(), 5);
        assert_eq!(bytes[..5], [0x0D, 0x0A, 0x11, 0xFF, 0]);
        device.write_all(&[0x0A, 0x13, 0x03]).unwrap();
        assert_eq!(line.read(&mut bytes, Duration::from_secs(1)).unwrap(), 3);
        assert_eq!(bytes[..3], [0x0A, 0x13, 0x03]);
    }

    #[test]
    fn a_line_has_one_master() {
        let device = PseudoTerminal::open().unwrap();
        let path = device.path().display().to_string();
        let first = SerialLine::open(&path, &SETTINGS).unwrap();
        let error = SerialLine::open(&path, &SETTINGS).unwrap_err();
        assert_eq!(
            error.to_string(),
            format!("another program uses {path}; to see which: sudo fuser -v {path}")
        );
        drop(first);
        assert!(SerialLine::open(&path, &SETTINGS).is_ok());
    }

    #[test]
    fn a_device_that_is_not_there_or_no_serial_line_is_named() {
        let refused = |device: &str| SerialLine::open(device, &SETTINGS).unwrap_err();
        assert!(matches!(refused("/dev/takt-none"), SerialLineError::Missing { .. }));
        assert!(matches!(refused("/etc/passwd/x"), SerialLineError::Missing { .. }));
        for device in ["/etc/passwd", "/tmp", "/dev/null"] {
            let error = refused(device);
            assert!(matches!(error, SerialLineError::NotSerial { .. }), "{error}");
            assert!(error.to_string().starts_with(&format!("{device} is no serial line; ")), "{error}");
        }
    }

    #[test]
    fn the_cure_of_a_missing_right_is_the_group_of_the_device() {
        let error = refusal("/dev/null", io::Error::from_raw_os_error(libc::EACCES)).to_string();
        assert!(error.starts_with("this user may not open /dev/null; to allow it: sudo "), "{error}");
    }

    #[test]
    fn a_line_whose_direction_the_kernel_cannot_switch_is_told_so() {
        let device = PseudoTerminal::open().unwrap();
        let settings = SerialSettings { direction: Direction::Kernel, ..SETTINGS };
        let error = SerialLine::open(&device.path().display().to_string(), &settings).unwrap_err();
        assert!(matches!(error, SerialLineError::NoDirection { .. }), "{error}");
    }
}
