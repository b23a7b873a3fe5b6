//! The drive that is addressed: an axis of a configuration, or a node on an interface.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;

use takt::config::{DriveFamily, Interface, Quantity, SerialDevice};
use takt::family::cia402::{self, Device};
use takt::family::{self, Family};
use takt::link::RealInterface;
use takt_tools::commission::{Bus, TargetDrive};

use super::super::configuration;
use super::super::usage_error::UsageError;
use super::keys::{self, AxisKey, BusOfKeys};

/// The drive.
#[derive(Args, Debug)]
pub struct Target {
    /// The configuration (TOML)
    config: Option<PathBuf>,
    /// The name of the axis; may be left out if there is only one
    axis: Option<String>,
    /// The interface: can0, vcan0 …, slcan:/dev/ttyACM0, rs485-canfd:/dev/ttyUSB0; with a configuration also NAME=INTERFACE or sim; serial:/dev/ttyUSB0 for a drive on a serial line
    #[arg(long, value_name = "INTERFACE", global = true)]
    bus: Option<String>,
    /// The node ID
    #[arg(long, value_name = "N", global = true, value_parser = clap::value_parser!(u8).range(1..=127))]
    node: Option<u8>,
    /// The family, as `drive` names it in a configuration
    #[arg(long, value_name = "FAMILY", global = true, value_parser = family)]
    family: Option<NamedFamily>,
    /// A key that an axis has in a configuration, for a family whose drives are known by such keys: master_id=0x65,
    /// torque_constant=0.23, limits.velocity="2 rad/s" … (may be given again)
    #[arg(long = "set", value_name = "KEY=VALUE", global = true, requires = "family")]
    keys: Vec<AxisKey>,
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
    /// The bit rate of the data phase of CAN FD, for an interface without a configuration
    #[arg(long, value_name = "RATE", global = true, value_parser = data_bit_rate)]
    data_bit_rate: Option<u32>,
}

fn data_bit_rate(text: &str) -> Result<u32, String> {
    let rate = Quantity::BIT_RATE.parse(text).ok().filter(|rate| (1e5..=8e6).contains(rate));
    rate.map(|rate| rate as u32).ok_or_else(|| "write it as \"5 Mbit/s\", at most 8 Mbit/s".to_owned())
}

fn bit_rate(text: &str) -> Result<u32, String> {
    let rate = Quantity::BIT_RATE.parse(text).ok().filter(|rate| (10_000.0..=1_000_000.0).contains(rate));
    rate.map(|rate| rate as u32).ok_or_else(|| "write it as \"500 kbit/s\", at most 1 Mbit/s".to_owned())
}

/// How a serial line begins.
const SERIAL: &str = "serial:";
/// The bit rate of a serial line that says none.
pub const USUAL_LINE_RATE: u32 = 115_200;

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
        let line = text.parse::<SerialDevice>();
        line.map(Self::from).map_err(|error| format!("--bus {SERIAL}{text}: {error}: {}", error.help()))
    }
}

impl From<SerialDevice> for Line {
    fn from(line: SerialDevice) -> Self {
        Self { device: line.device, bit_rate: line.bit_rate.unwrap_or(USUAL_LINE_RATE) }
    }
}

/// A family on the command line.
#[derive(Clone, Copy)]
struct NamedFamily(&'static dyn Family);

impl fmt::Debug for NamedFamily {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.word())
    }
}

fn family(text: &str) -> Result<NamedFamily, String> {
    let Some(family) = family::named(text) else {
        let all = family::all();
        let is_named = |family: &&&dyn Family| family.unconfigured().is_some() || family.is_named_by_keys();
        let families = all.iter().filter(is_named);
        let words = families.map(|family| family.word()).collect::<Vec<_>>().join(", ");
        return Err(format!(
            "the families are {words}; another CiA 402 drive is named by its data sheet: --eds FILE"
        ));
    };
    if family.unconfigured().is_none() && !family.is_named_by_keys() {
        return Err(format!("a drive of the family {text} is named by its data sheet: --eds FILE"));
    }
    Ok(NamedFamily(family))
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

    /// Its family alone.
    pub fn family(&self) -> Result<&'static dyn Family, UsageError> {
        match &self.family {
            Some(NamedFamily(family)) => Ok(*family),
            None if self.config.is_some() => Ok(family::of(&self.resolve(false)?.0.drive)),
            None => Err("name the family: --family FAMILY, or CONFIG AXIS".into()),
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
        if let Some(NamedFamily(family)) = self.family.filter(|NamedFamily(family)| family.is_named_by_keys())
        {
            return self.of_keys(family);
        }
        if !self.keys.is_empty() {
            return Err(
                "--set is for a family whose drives are known by the keys of an axis; this one needs none"
                    .into(),
            );
        }
        let family = self.unconfigured_drive()?;
        let usual_node = usual_node.or_else(|| family::of(family.as_ref()?).usual_node());
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
        let interface = bus.parse::<Interface>();
        if let Some(reason) = interface.as_ref().ok().and_then(Interface::lacks_canopen) {
            return Err(format!("--bus {bus}: {reason}").into());
        }
        match interface.map(|interface| RealInterface::of(&interface)) {
            Ok(Some(RealInterface::Serial(line))) => Ok((unconfigured()?, Place::Line(line.into()))),
            Ok(Some(interface)) => Ok((
                unconfigured()?,
                Place::Bus(Bus::Interface {
                    interface,
                    bit_rate: self.bit_rate,
                    data_bit_rate: self.data_bit_rate,
                }),
            )),
            Ok(None) => {
                Err("a simulated drive needs a configuration that says what it is: takt drive CONFIG AXIS …"
                    .into())
            }
            Err(error) => Err(format!("--bus {bus}: {error}: {}", error.help()).into()),
        }
    }

    /// The drive by the keys that an axis has in a configuration.
    fn of_keys(&self, family: &dyn Family) -> Result<(TargetDrive, Place), UsageError> {
        let (Some(bus), Some(node)) = (&self.bus, self.node) else {
            return Err(format!(
                "name the drive: CONFIG AXIS, or --bus INTERFACE --node N --family {} --set KEY=VALUE …",
                family.word()
            )
            .into());
        };
        // A serial line is no bus: the keys are those of an axis on any.
        let line = bus.strip_prefix(SERIAL).map(str::parse::<Line>).transpose()?;
        let interface = if line.is_some() { "sim" } else { bus };
        let data_bit_rate = self.data_bit_rate.or(line.as_ref().map(|_| self.bit_rate));
        let bus = BusOfKeys { interface, bit_rate: self.bit_rate, data_bit_rate };
        let (config, has_limits) = keys::config_of(family, node, &bus, &self.keys)?;
        let unconverted = |error| format!("the units cannot be converted ({error:?})");
        let axis = config.axes.first().ok_or_else(|| "the keys name no drive".to_owned())?;
        let mut target = TargetDrive::of(axis).map_err(unconverted)?;
        target.limits = target.limits.filter(|_| has_limits);
        target.name = format!("node {node}");
        let place = match line {
            Some(line) => Place::Line(line),
            None => Place::Bus(Bus::Configured { config: Box::new(config), bus: 0 }),
        };
        Ok((target, place))
    }

    /// The drive by its family or its data sheet, if one of them is given.
    fn unconfigured_drive(&self) -> Result<Option<DriveFamily>, UsageError> {
        let Some(eds) = &self.eds else {
            return Ok(self.family.and_then(|NamedFamily(family)| family.unconfigured()));
        };
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
        if let Some(line) = self.bus.as_deref().and_then(|bus| bus.strip_prefix(SERIAL)) {
            let mut target = TargetDrive::of(&axis)
                .map_err(|error| format!("axis {}: its units cannot be converted ({error:?})", axis.name))?;
            target.node = self.node.unwrap_or(target.node);
            return Ok((target, Place::Line(line.parse()?)));
        }
        if let Some(bus) = &self.bus {
            let own = config.buses.get(axis.bus).map(|bus| bus.name.clone()).unwrap_or_default();
            let (name, interface) = bus.split_once('=').unwrap_or((&own, bus));
            config.override_interface(name, interface).map_err(|error| format!("--bus {bus}: {error}"))?;
        }
        let mut target = TargetDrive::of(&axis)
            .map_err(|error| format!("axis {}: its units cannot be converted ({error:?})", axis.name))?;
        if !self.keys.is_empty() {
            return Err("--set is for a drive without a configuration: write the keys into the axis".into());
        }
        if let Some(NamedFamily(family)) = self.family.filter(|family| family.0.word() != target.drive.word) {
            let (name, configured, other) = (&axis.name, target.drive.word, family.word());
            return Err(format!("the axis {name} is configured as {configured}, not {other}").into());
        }
        // A drive that still has the factory's node ID is addressed by that ID.
        target.node = self.node.unwrap_or(target.node);
        if let Some((Interface::Serial(line), bit_rate)) =
            config.buses.get(axis.bus).map(|bus| (&bus.interface, bus.bit_rate))
        {
            return Ok((target, Place::Line(Line { device: line.device.clone(), bit_rate })));
        }
        if config.is_serial_line(axis.bus) {
            return Err(format!(
                "the axis {} is on a simulated line, inside one process alone: name a real one, --bus {}=serial:/dev/ttyUSB0, or \
                 have it simulated behind a pseudo-terminal: takt sim --serial {}:{} --pty /tmp/line",
                axis.name,
                config.buses.get(axis.bus).map_or("line", |bus| &bus.name),
                axis.drive.word,
                axis.node
            )
            .into());
        }
        Ok((target, Place::Bus(Bus::Configured { config: Box::new(config), bus: axis.bus })))
    }
}
