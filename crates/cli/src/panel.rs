//! `takt panel`, and the options of the panel that `takt run` has too.

use std::io::{self, Read};
use std::net::SocketAddr;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::Args;
use takt_wire::text_file;

use takt::config::Interface;
use takt::link::RealInterface;
use takt::link::modbus_line::ModbusLine;
use takt::link::ownership::Ownership;
use takt::link::serial_line::SerialSettings;
use takt_panel::{
    self, BenchBus, BenchDrive, BenchLink, Listening, Panel, PanelError, PanelOptions, PanelToken, Workplace,
};
use takt_tools::commission::{Bus, TargetDrive};
use takt_tools::monitor::BusDecoder;

use super::configuration;
use super::drive::USUAL_LINE_RATE;
use super::exit::Exit;
use super::interruption;
use super::monitor::bit_rate;
use super::ownership;
use super::usage_error::UsageError;

/// How often it is looked whether the panel is to end.
const LOOK: Duration = Duration::from_millis(50);

/// The largest file of a token, in bytes.
const TOKEN_FILE_AT_MOST: u64 = 4096;

/// Who may open the panel.
#[derive(Args, Debug)]
pub struct AccessArguments {
    /// File with the token that pages of the panel must give, readable by you alone (default: a new token, in the address that is
    /// printed)
    #[arg(long = "panel-token", value_name = "FILE")]
    token: Option<PathBuf>,
    /// Demand no token: every user of this computer may command (loopback only)
    #[arg(long = "panel-open", conflicts_with = "token")]
    is_open: bool,
    /// Where a reverse proxy shows the panel, as https://robot.example
    #[arg(long = "panel-origin", value_name = "ORIGIN")]
    origins: Vec<String>,
}

impl AccessArguments {
    /// Begins to listen.
    pub fn listen(&self, address: SocketAddr) -> Result<Listening, UsageError> {
        let token = match &self.token {
            Some(path) => PanelToken::Given(token(path)?),
            None if self.is_open => PanelToken::Open,
            None => PanelToken::New,
        };
        let options = PanelOptions { address, token, origins: self.origins.clone() };
        Listening::begin(&options).map_err(|error| error.to_string().into())
    }
}

/// The first line of a file that no other user can read or write.
fn token(path: &Path) -> Result<String, UsageError> {
    let path_shown = path.display();
    let failed = |error: io::Error| format!("the token cannot be read from {path_shown}: {error}");
    // A FIFO would keep the start waiting for ever.
    let file = text_file::open(path).map_err(failed)?;
    let mode = file.metadata().map_err(failed)?.permissions().mode() & 0o777;
    if mode & 0o077 != 0 {
        let words = format!(
            "other users can read or write the token in {path_shown} (mode {mode:o}, allowed: 600): make a new one, as with \
             `(umask 077; openssl rand -hex 16 > FILE)`"
        );
        return Err(words.into());
    }
    let mut text = String::new();
    file.take(TOKEN_FILE_AT_MOST).read_to_string(&mut text).map_err(failed)?;
    Ok(text.lines().next().unwrap_or_default().trim().to_owned())
}

/// Says where a panel is to be opened.
pub fn greeting(panel: &Panel) -> String {
    format!("the panel is at {}, until Ctrl-C", panel.url())
}

/// Show and command a controller of another process in the browser, or commission drives without one
///
/// NAME shows the controller that `takt run --serve NAME` runs. CONFIG.toml, or --bus alone, opens the buses itself, where no
/// controller runs: scan, information, motion of one drive at a time, monitor, free frames.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The name that a controller is served by, or the configuration (TOML) of the drives to commission
    #[arg(value_name = "NAME|CONFIG.toml", required_unless_present = "buses")]
    what: Option<String>,
    /// The interface whose drives are commissioned: can0, slcan:/dev/ttyACM0, serial:/dev/ttyUSB0; with a configuration
    /// NAME=INTERFACE (may be given again)
    #[arg(long = "bus", value_name = "INTERFACE")]
    buses: Vec<String>,
    /// The bit rate of an interface without a configuration
    #[arg(long, value_name = "RATE", value_parser = bit_rate, default_value = "1 Mbit/s")]
    bit_rate: u32,
    /// The bit rate of the data phase of CAN FD, for an interface without a configuration
    #[arg(long, value_name = "RATE", value_parser = bit_rate)]
    data_bit_rate: Option<u32>,
    /// Have another takt of this host that commands the buses stop in control first, and take them over
    #[arg(long)]
    take_over: bool,
    /// Where the panel listens: a host and a port, or a port on loopback
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080", value_parser = takt_panel::address)]
    address: SocketAddr,
    #[command(flatten)]
    access: AccessArguments,
}

/// Shows it until Ctrl-C, or until the controller ends.
pub fn run(arguments: &Arguments) -> Exit {
    show(arguments).unwrap_or_else(|error| error.print(false))
}

fn show(arguments: &Arguments) -> Result<Exit, UsageError> {
    let interrupted = interruption::watch().map_err(|error| format!("cannot watch for Ctrl-C: {error}"))?;
    match arguments.what.as_deref() {
        Some(name) if arguments.buses.is_empty() && !is_configuration(name) => {
            show_controller(arguments, name, &interrupted)
        }
        config => commission(arguments, config.map(Path::new), &interrupted),
    }
}

/// A configuration is a path, or ends as those that come with takt do; a name of a controller has no slash.
fn is_configuration(what: &str) -> bool {
    what.contains('/') || what.ends_with(".toml")
}

fn show_controller(arguments: &Arguments, name: &str, interrupted: &AtomicBool) -> Result<Exit, UsageError> {
    let client = takt_remote::connect(name).map_err(|error| error.to_string())?;
    let listening = arguments.access.listen(arguments.address)?;
    let lease = client.clone();
    let take_lease: takt_panel::TakeLease = Box::new(move || lease.take_over());
    let panel = listening.show(client.clone(), Some(take_lease), None);
    let is_over = |_: &Panel| {
        client.has_ended().then(|| {
            say!("takt: the controller has ended");
            Exit::Done
        })
    };
    Ok(keep_open(panel, is_over, interrupted))
}

fn commission(
    arguments: &Arguments,
    config: Option<&Path>,
    interrupted: &AtomicBool,
) -> Result<Exit, UsageError> {
    // Where nobody may look, nothing is opened.
    let listening = arguments.access.listen(arguments.address)?;
    let place = match config {
        Some(path) => of_configuration(arguments, path)?,
        None => of_interfaces(arguments)?,
    };
    let is_over = |panel: &Panel| {
        panel.is_taken_over().then(|| {
            say!("takt: another process takes the buses over");
            Exit::Interrupted
        })
    };
    Ok(keep_open(listening.commission(place), is_over, interrupted))
}

/// Says where the panel is, and keeps it until it is over or Ctrl-C comes.
fn keep_open(
    panel: Result<Panel, PanelError>,
    is_over: impl Fn(&Panel) -> Option<Exit>,
    interrupted: &AtomicBool,
) -> Exit {
    let panel = match panel {
        Ok(panel) => panel,
        Err(error) => {
            say!("takt: {error}");
            return Exit::Stopped;
        }
    };
    say!("takt: {}", greeting(&panel));
    while !interrupted.load(Ordering::Relaxed) {
        std::thread::sleep(LOOK);
        if let Some(exit) = is_over(&panel) {
            return exit;
        }
    }
    Exit::Interrupted
}

/// A bus before it is opened.
enum Place {
    Bus(Bus),
    Line { device: String, bit_rate: u32 },
}

fn of_configuration(arguments: &Arguments, path: &Path) -> Result<Workplace, UsageError> {
    let mut config = configuration::load(path, &[])?;
    for bus in &arguments.buses {
        let only = match config.buses.as_slice() {
            [only] => Some(only.name.clone()),
            _ => None,
        };
        let (name, interface) = match (bus.split_once('='), &only) {
            (Some(named), _) => named,
            (None, Some(only)) => (only.as_str(), bus.as_str()),
            (None, None) => return Err(format!("--bus {bus}: say which bus it is, as NAME={bus}").into()),
        };
        config.override_interface(name, interface).map_err(|error| format!("--bus {bus}: {error}"))?;
    }
    let mut places = vec![];
    let mut numbers = vec![None; config.buses.len()];
    for (number, bus) in config.buses.iter().enumerate() {
        let place = match &bus.interface {
            Interface::Serial(line) => Place::Line { device: line.device.clone(), bit_rate: bus.bit_rate },
            _ if config.is_serial_line(number) => {
                say!(
                    "takt: note: the line {} is simulated inside a controller alone: it is left out",
                    bus.name
                );
                continue;
            }
            _ => Place::Bus(Bus::Configured { config: Box::new(config.clone()), bus: number }),
        };
        if let Some(own) = numbers.get_mut(number) {
            *own = Some(places.len());
        }
        places.push((bus.name.clone(), bus.interface.to_string(), place));
    }
    let mut drives = vec![];
    for axis in &config.axes {
        let Some(bus) = numbers.get(axis.bus).copied().flatten() else { continue };
        let target = TargetDrive::of(axis)
            .map_err(|error| format!("axis {}: its units cannot be converted ({error:?})", axis.name))?;
        drives.push(BenchDrive { bus, target: Some(target) });
    }
    open(arguments, config.name.clone(), places, drives)
}

fn of_interfaces(arguments: &Arguments) -> Result<Workplace, UsageError> {
    let mut places = vec![];
    for bus in &arguments.buses {
        let parsed: Interface = bus.parse().map_err(|error: <Interface as std::str::FromStr>::Err| {
            format!("--bus {bus}: {error}: {}", error.help())
        })?;
        let place = match RealInterface::of(&parsed) {
            Some(RealInterface::Serial(line)) => {
                Place::Line { device: line.device, bit_rate: line.bit_rate.unwrap_or(USUAL_LINE_RATE) }
            }
            Some(interface) => Place::Bus(Bus::Interface {
                interface,
                bit_rate: arguments.bit_rate,
                data_bit_rate: arguments.data_bit_rate,
            }),
            None => {
                return Err("--bus sim: a simulated drive needs a configuration that says what it is".into());
            }
        };
        places.push((bus.clone(), bus.clone(), place));
    }
    open(arguments, arguments.buses.join(", "), places, vec![])
}

/// Owns the buses, and opens them.
fn open(
    arguments: &Arguments,
    name: String,
    places: Vec<(String, String, Place)>,
    drives: Vec<BenchDrive>,
) -> Result<Workplace, UsageError> {
    let claims = places.iter().filter_map(|(_, _, place)| match place {
        Place::Bus(bus) => bus.claim(None),
        Place::Line { .. } => None,
    });
    let ownership = Ownership::claim(claims.collect(), ownership::if_owned(arguments.take_over))
        .map_err(|error| ownership::usage_error(&error))?;
    let mut buses = vec![];
    for (name, interface, place) in places {
        let (link, decoder, has_fd) = match place {
            Place::Bus(bus) => {
                let port = bus.open().map_err(|error| error.to_string())?;
                (BenchLink::Bus(Box::new(port)), bus.decoder(), bus.has_fd())
            }
            Place::Line { device, bit_rate } => {
                let line = ModbusLine::open(&device, &SerialSettings::new(bit_rate))
                    .map_err(|error| format!("{name}: {error}"))?;
                (BenchLink::Line(line, bit_rate), BusDecoder::with_drives(&[]), false)
            }
        };
        buses.push(BenchBus { name, interface, link, decoder, has_fd });
    }
    Ok(Workplace { name, buses, drives, ownership })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_configuration_is_told_from_the_name_of_a_controller() {
        for config in ["arm.toml", "configs/arm", "./arm", "/etc/takt/arm.toml"] {
            assert!(is_configuration(config), "{config}");
        }
        for name in ["arm", "left-arm", "arm_2"] {
            assert!(!is_configuration(name), "{name}");
        }
    }
}
