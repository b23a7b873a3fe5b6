//! The drive that is addressed: an axis of a configuration, or a node on an interface.

use std::path::{Path, PathBuf};

use clap::Args;

use takt::commission::TargetDrive;
use takt::config::{Config, DriveFamily, Interface, Quantity};
use takt::family;
use takt::family::cia402::{self, Device};

use super::super::configuration;
use super::super::usage_error::UsageError;

/// The drive.
#[derive(Args, Debug)]
pub struct Target {
    /// The configuration (TOML)
    config: Option<PathBuf>,
    /// The name of the axis; may be left out if there is only one
    axis: Option<String>,
    /// The interface: can0, vcan0 …; with a configuration also NAME=INTERFACE or sim
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
        /// Its name.
        name: String,
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
    pub fn resolve(&self) -> Result<(TargetDrive, Bus), UsageError> {
        let (target, bus) = match &self.config {
            Some(config) => self.of_configuration(config)?,
            None => self.of_interface()?,
        };
        Ok((target, bus))
    }

    fn of_interface(&self) -> Result<(TargetDrive, Bus), UsageError> {
        let family = self.unconfigured_drive()?;
        let (Some(bus), Some(node), Some(family)) = (&self.bus, self.node, &family) else {
            return Err(
                "name the drive: CONFIG AXIS, or --bus INTERFACE --node N --family FAMILY (or --eds FILE)"
                    .into(),
            );
        };
        let interface = bus.parse::<Interface>();
        match interface {
            Ok(Interface::SocketCan(name)) => {
                let target = TargetDrive::unconfigured(node, family.clone())
                    .map_err(|error| format!("the units cannot be converted ({error:?})"))?;
                Ok((target, Bus::Interface { name, bit_rate: self.bit_rate }))
            }
            Ok(Interface::Simulated) => {
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

    fn of_configuration(&self, path: &Path) -> Result<(TargetDrive, Bus), UsageError> {
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
        Ok((target, Bus::Configured { config: Box::new(config), bus: axis.bus }))
    }
}
