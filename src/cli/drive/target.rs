//! The drive that is addressed: an axis of a configuration, or a node on an interface.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;

use crate::commission::TargetDrive;
use crate::config::{Config, DriveFamily, Interface, Quantity};
use crate::family;
use crate::family::cia402::{self, Device};
use crate::link::RealInterface;

use super::super::configuration;
use super::super::usage_error::UsageError;

/// The drive.
#[derive(Args, Debug)]
pub struct Target {
    /// The configuration (TOML)
    config: Option<PathBuf>,
    /// The name of the axis; may be left out if there is only one
    axis: Option<String>,
    /// The interface: can0, vcan0 …, slcan:/dev/ttyACM0; with a configuration also NAME=INTERFACE or sim; serial:/dev/ttyUSB0 for a drive on a serial line
    #[arg(long, value_name = "INTERFACE", global = true)]
    bus: Option<String>,
    /// The node ID
    #[arg(long, value_name = "N", global = true, value_parser = clap::value_parser!(u8).range(1..=127))]
    node: Option<u8>,
    /// The family, as `drive` names it in a configuration
    #[arg(long, value_name = "FAMILY", global = true, value_parser = family)]
    family: Option<DriveFamily>,
    /// The data sheet (EDS or DCF) of a CiA 402 drive, instead of a family
    #[arg(long, value_name = "FILE", global = true, conflicts_with = "family")]
    eds: Option<PathBuf>,
    /// The quirks of the drive, beside its data sheet
    #[arg(long, value_name = "FILE", global = true, requires = "eds")]
    quirks: Option<PathBuf>,
    /// The counts of one turn of the drive's position, if its data sheet does not say
    #[arg(long, value_name = "N", global = true, requires = "eds", value_parser = clap::value_parser!(u32).range(1..))]
    counts_per_turn: Option<u32>,
    /// The bit rate of an interface without a configuration
    #[arg(long, value_name = "RATE", global = true, value_parser = bit_rate, default_value = "1 Mbit/s")]
    bit_rate: u32,
}

fn bit_rate(text: &str) -> Result<u32, String> {
    let rate = Quantity::BIT_RATE.parse(text).ok().filter(|rate| (10_000.0..=1_000_000.0).contains(rate));
    rate.map(|rate| rate as u32).ok_or_else(|| "write it as \"500 kbit/s\", at most 1 Mbit/s".to_owned())
}

/// How a serial line begins.
const SERIAL: &str = "serial:";
/// The bit rate of a serial line that says none.
const USUAL_LINE_RATE: u32 = 115_200;

/// What the drive is connected to.
pub enum Place {
    /// A CAN bus.
    Bus(Bus),
    /// A serial line of this machine.
    Line(Line),
}

/// A serial line of this machine.
#[derive(Debug, PartialEq, Eq)]
pub struct Line {
    /// The path of the device.
    pub device: String,
    /// bit/s
    pub bit_rate: u32,
}

impl FromStr for Line {
    type Err = String;

    /// `/dev/ttyUSB0`, or with a bit rate `/dev/ttyUSB0@19200`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (device, bit_rate) = match text.rsplit_once('@') {
            Some((device, rate)) => (device, rate.parse().ok().filter(|rate| *rate > 0)),
            None => (text, Some(USUAL_LINE_RATE)),
        };
        match bit_rate {
            Some(bit_rate) if device.starts_with('/') => Ok(Self { device: device.to_owned(), bit_rate }),
            _ => Err(format!(
                "--bus {SERIAL}{text}: write the path of the device, and behind it a bit rate other than {USUAL_LINE_RATE}: \
                 {SERIAL}/dev/ttyUSB0@19200"
            )),
        }
    }
}

/// The bus of the drive.
pub enum Bus {
    /// A bus of a configuration.
    Configured {
        /// The configuration.
        config: Box<Config>,
        /// The index of the bus.
        bus: usize,
    },
    /// An interface of this machine.
    Interface {
        /// The interface.
        interface: RealInterface,
        /// bit/s
        bit_rate: u32,
    },
}

fn family(text: &str) -> Result<DriveFamily, String> {
    let Some(family) = family::named(text) else {
        let all = family::all();
        let families = all.iter().filter(|family| family.unconfigured().is_some());
        let words = families.map(|family| family.word()).collect::<Vec<_>>().join(", ");
        return Err(format!(
            "the families are {words}; another CiA 402 drive is named by its data sheet: --eds FILE"
        ));
    };
    let needs_sheet = || format!("a drive of the family {text} is named by its data sheet: --eds FILE");
    family.unconfigured().ok_or_else(needs_sheet)
}

impl Target {
    /// The drive and its bus.
    ///
    /// A scan asks every node ID, so it needs none.
    pub fn resolve(&self, is_scan: bool) -> Result<(TargetDrive, Place), UsageError> {
        match &self.config {
            Some(config) => self.of_configuration(config),
            None => self.of_interface(is_scan.then_some(1)),
        }
    }

    /// The drive without its bus.
    pub fn drive(&self) -> Result<DriveFamily, UsageError> {
        if self.config.is_some() {
            return Ok(self.resolve(false)?.0.drive);
        }
        self.unconfigured_drive()?
            .ok_or_else(|| "name the drive: CONFIG AXIS, or --family FAMILY (or --eds FILE)".into())
    }

    fn of_interface(&self, usual_node: Option<u8>) -> Result<(TargetDrive, Place), UsageError> {
        let family = self.unconfigured_drive()?;
        let (Some(bus), Some(node), Some(family)) = (&self.bus, self.node.or(usual_node), &family) else {
            return Err(
                "name the drive: CONFIG AXIS, or --bus INTERFACE --node N --family FAMILY (or --eds FILE)"
                    .into(),
            );
        };
        let unconfigured = || {
            TargetDrive::unconfigured(node, family.clone())
                .map_err(|error| format!("the units cannot be converted ({error:?})"))
        };
        if let Some(line) = bus.strip_prefix(SERIAL) {
            return Ok((unconfigured()?, Place::Line(line.parse()?)));
        }
        let interface = bus.parse::<Interface>().map(|interface| RealInterface::of(&interface));
        match interface {
            Ok(Some(interface)) => {
                Ok((unconfigured()?, Place::Bus(Bus::Interface { interface, bit_rate: self.bit_rate })))
            }
            Ok(None) => {
                Err("a simulated drive needs a configuration that says what it is: takt drive CONFIG AXIS …"
                    .into())
            }
            Err(error) => Err(format!("--bus {bus}: {error}: {}", error.help()).into()),
        }
    }

    /// The drive by its family or its data sheet, if one of them is given.
    fn unconfigured_drive(&self) -> Result<Option<DriveFamily>, UsageError> {
        let Some(eds) = &self.eds else { return Ok(self.family.clone()) };
        let device = Device::load(eds, self.quirks.as_deref())
            .map_err(|reason| format!("--eds {}: {reason}", eds.display()))?;
        let counts_per_turn = self.counts_per_turn.map(f64::from);
        if counts_per_turn.or(device.counts_per_turn()).is_none() {
            return Err(
                "the data sheet does not say how many counts a turn has: give --counts-per-turn N".into()
            );
        }
        Ok(Some(cia402::drive_with(device, counts_per_turn)))
    }

    fn of_configuration(&self, path: &Path) -> Result<(TargetDrive, Place), UsageError> {
        if self.eds.is_some() {
            return Err(
                "--eds names a drive without a configuration; in one, the axis says `eds = \"…\"`".into()
            );
        }
        let mut config = configuration::load(path, &[])?;
        let known: Vec<&str> = config.axes.iter().map(|axis| axis.name.as_str()).collect();
        let index = match (&self.axis, known.as_slice()) {
            (None, [_]) => Some(0),
            (None, _) => None,
            (Some(name), _) => known.iter().position(|axis| axis == name),
        };
        let Some(axis) = index.and_then(|index| config.axes.get(index)).cloned() else {
            let problem = match &self.axis {
                Some(name) => format!("there is no axis {name:?}"),
                None => "say which axis".to_owned(),
            };
            return Err(format!("{problem}; the axes are: {}", known.join(", ")).into());
        };
        if let Some(bus) = &self.bus {
            let own = config.buses.get(axis.bus).map(|bus| bus.name.clone()).unwrap_or_default();
            let (name, interface) = bus.split_once('=').unwrap_or((&own, bus));
            config.override_interface(name, interface).map_err(|error| format!("--bus {bus}: {error}"))?;
        }
        let mut target = TargetDrive::of(&axis)
            .map_err(|error| format!("axis {}: its units cannot be converted ({error:?})", axis.name))?;
        if let Some(family) = self.family.as_ref().filter(|family| **family != target.drive) {
            let (name, configured, other) = (&axis.name, target.drive.word, family.word);
            return Err(format!("the axis {name} is configured as {configured}, not {other}").into());
        }
        // A drive that still has the factory's node ID is addressed by that ID.
        target.node = self.node.unwrap_or(target.node);
        Ok((target, Place::Bus(Bus::Configured { config: Box::new(config), bus: axis.bus })))
    }
}
