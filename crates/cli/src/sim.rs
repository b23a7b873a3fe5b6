//! `takt sim`: the configured drives, or one made from its data sheet, simulated on real interfaces or behind adapters on
//! pseudo-terminals.

mod adapters;
mod data_sheet;
mod serial;
mod serial_line;

use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use clap::Args;

use takt::config::Config;
use takt::controller::opening::open_configured;
use takt::family::simulated_drives;
use takt::link::ownership::{ClaimError, InterfaceLock, lock_for_simulator};
use takt::link::{OpenError, RealInterface, SocketCanOptions};
use takt_sim::LiveDrives;
use takt_sim::line_faults::LineFault;
use takt_sim::serial_device::SerialDeviceKind;

use super::configuration::{self, BusOverride};
use super::exit::Exit;
use super::interruption;
use super::lss::SimulatedDevice;
use super::usage_error::UsageError;
use adapters::AdapterLink;
use data_sheet::DataSheetArguments;
use serial_line::LineDrives;

/// Put the drives of a configuration, simulated, on real interfaces or pseudo-terminals, for any master to talk to.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The configuration (TOML)
    #[arg(required_unless_present_any = ["sheet", "serial"])]
    config: Option<PathBuf>,
    /// Connect a bus to another interface than the configuration says: can0, vcan0 …, slcan:/dev/ttyACM0,
    /// rs485-canfd:/dev/ttyUSB0
    #[arg(long = "bus", value_name = "[NAME=]INTERFACE")]
    buses: Vec<BusOverride>,
    /// Put every simulated bus behind an SLCAN adapter on a pseudo-terminal, and say its path
    ///
    /// Another program opens it as it would open /dev/ttyACM0: takt run CONFIG --bus NAME=slcan:/dev/pts/N. With LINK the
    /// path has a second name, which you choose. Needs no root and no CAN support in the kernel.
    #[arg(long = "pty", value_name = "[BUS=]LINK", num_args = 0..=1, default_missing_value = "")]
    adapters: Vec<AdapterLink>,
    /// Simulate what is on a serial line instead, on a pseudo-terminal: FAMILY:ADDRESS[,ADDRESS…], or a device
    #[arg(
        long,
        value_name = "DRIVES",
        conflicts_with_all = ["config", "buses", "lss_devices", "sheet"],
        long_help = serial::help()
    )]
    serial: Option<OnSerialLine>,
    /// Give the line of such a device a fault: disturbed=N (a wrong bit in each Nth byte), silent=S (nothing from S seconds after the first byte)
    #[arg(long = "line-fault", value_name = "FAULT", requires = "serial")]
    line_faults: Vec<LineFault>,
    /// Put a device beside the drives that has LSS and nothing else: [BUS=]IDENTITY, as in `takt lss --simulate`
    ///
    /// Without BUS it is on the first bus that has a real interface.
    #[arg(long = "lss", value_name = "[BUS=]DEVICE")]
    lss_devices: Vec<LssOnBus>,
    #[command(flatten)]
    data_sheet: DataSheetArguments,
}

/// What is simulated on a serial line.
#[derive(Clone, Debug)]
enum OnSerialLine {
    /// Drives of a family.
    Drives(LineDrives),
    /// Another device.
    Device(&'static SerialDeviceKind),
}

impl FromStr for OnSerialLine {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if let Some((name, _)) = text.split_once(':') {
            match serial::named(name) {
                Ok(kind) => Err(format!("{0} has no addresses: write --serial {0}", kind.name)),
                Err(_) => text.parse().map(Self::Drives),
            }
        } else {
            serial::named(text).map(Self::Device)
        }
    }
}

/// A device with LSS, and the name of its bus.
#[derive(Clone, Debug)]
struct LssOnBus {
    bus: Option<String>,
    device: SimulatedDevice,
}

impl FromStr for LssOnBus {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (bus, device) = match text.split_once('=') {
            Some((bus, device)) => (Some(bus.to_owned()), device),
            None => (None, text),
        };
        Ok(Self { bus, device: device.parse()? })
    }
}

/// Runs until Ctrl-C or SIGTERM.
pub fn run(arguments: &Arguments) -> Exit {
    match &arguments.serial {
        Some(OnSerialLine::Drives(drives)) => return serial_line::host(drives, &arguments.adapters),
        Some(OnSerialLine::Device(kind)) => {
            return serial::run(kind, &arguments.line_faults, &arguments.adapters);
        }
        None => {}
    }
    match data_sheet::open(&arguments.data_sheet) {
        Err(error) => return error.print(false),
        Ok(Some((drives, _lock))) => return host(vec![("can".to_owned(), drives)]),
        Ok(None) => {}
    }
    let Some(path) = &arguments.config else {
        return UsageError::from("name a configuration, or a data sheet with --eds".to_owned()).print(false);
    };
    let config = match configuration::load(path, &arguments.buses) {
        Ok(config) => config,
        Err(error) => return error.print(false),
    };
    // Held until the drives are gone.
    let locked = match lock(&config) {
        Ok(locked) => locked,
        Err(error) => return UsageError::from(error.to_string()).print(false),
    };
    if let Err(error) = config.validate() {
        return UsageError::from(error).print(false);
    }
    let mut drives = match open(&config) {
        Ok(drives) => drives,
        Err(error) => return UsageError::from(error.to_string()).print(false),
    };
    match adapters::open(&config, &arguments.adapters) {
        Ok(behind_adapters) => drives.extend(behind_adapters),
        Err(error) => return error.print(false),
    }
    for LssOnBus { bus, device } in &arguments.lss_devices {
        let is_its_bus = |(name, _): &&mut (String, LiveDrives)| bus.as_ref().is_none_or(|bus| bus == name);
        match drives.iter_mut().find(is_its_bus) {
            Some((_, drives)) => drives.add_lss_device(device.device()),
            None => {
                let bus = bus.as_deref().unwrap_or_else(|| first_bus(&config));
                return UsageError::from(format!("--lss: the bus `{bus}` has no real interface"))
                    .print(false);
            }
        }
    }
    if drives.is_empty() {
        say!(
            "takt: no bus has a real interface; name one, for example: --bus {}=vcan0, or put the simulated buses behind \
             adapters: --pty",
            first_bus(&config)
        );
        return Exit::Usage;
    }
    let exit = host(drives);
    drop(locked);
    exit
}

/// Runs the drives of every bus until the program is asked to stop.
fn host(drives: Vec<(String, LiveDrives)>) -> Exit {
    let is_stopped = match interruption::watch() {
        Ok(is_stopped) => is_stopped,
        Err(error) => {
            say!("takt: cannot watch for Ctrl-C: {error}");
            return Exit::Stopped;
        }
    };
    let has_panicked = AtomicBool::new(false);
    thread::scope(|scope| {
        let threads: Vec<_> = drives
            .into_iter()
            .map(|(name, mut drives)| {
                let nodes: Vec<String> = drives.nodes().map(|node| node.to_string()).collect();
                say!("bus `{name}`: nodes {}; Ctrl-C ends them", nodes.join(", "));
                let is_stopped = Arc::clone(&is_stopped);
                scope.spawn(move || drives.run(&is_stopped))
            })
            .collect();
        for thread in threads {
            if thread.join().is_err() {
                has_panicked.store(true, Ordering::Relaxed);
            }
        }
    });
    if has_panicked.into_inner() { Exit::Stopped } else { Exit::Done }
}

/// One simulator for each interface: two would play drives with duplicate node IDs.
fn lock(config: &Config) -> Result<Vec<InterfaceLock>, ClaimError> {
    let real = config.buses.iter().filter_map(|bus| Some((&bus.name, RealInterface::of(&bus.interface)?)));
    real.map(|(bus, interface)| lock_for_simulator(bus, &interface)).collect()
}

/// The drives of every bus that has a real interface. Their port has no filters: a node on a bus receives every frame.
fn open(config: &Config) -> Result<Vec<(String, LiveDrives)>, OpenError> {
    let mut all = vec![];
    for (index, bus) in config.buses.iter().enumerate() {
        let options = SocketCanOptions {
            bit_rate: bus.bit_rate,
            data_bit_rate: bus.data_bit_rate,
            ..SocketCanOptions::default()
        };
        if let Some(port) = open_configured(config, index, &options)? {
            all.push((bus.name.clone(), LiveDrives::new(simulated_drives(config, index), port.into_live())));
        }
    }
    Ok(all)
}

fn first_bus(config: &Config) -> &str {
    config.buses.first().map_or("NAME", |bus| &bus.name)
}
