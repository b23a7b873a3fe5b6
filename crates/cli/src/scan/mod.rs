//! `takt scan`: what is on a bus, and which configuration would drive it.

mod beside;
mod can;
mod line;
mod output;

use std::cell::Cell;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use takt_rt::{BusState, Nanoseconds};

use takt::config::{Config, Interface, Quantity};
use takt::family::scan::{PlaceOfScan, Scanned, can_drive, starting_configuration};
use takt::family::{self, cia402};
use takt::link::RealInterface;
use takt::schedule::{self, BusSchedule, Remedy};

use super::columns::paragraph;
use super::exit::Exit;
use super::interruption;
use super::print;
use super::usage_error::UsageError;
use output::{ScannedBus, Watcher};

/// Find what is on a bus, and which configuration would drive it
///
/// CANopen nodes are asked what they are (objects 1000, 1018, 1008, 100A), drives with a protocol of their vendor for their version and model,
/// Modbus slaves for registers; devices without a node ID are found by LSS. Nodes that only send are heard. Only reads are sent:
/// nothing moves, and nothing is written to a drive.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The interface: can0, vcan0 …, slcan:/dev/ttyACM0, rs485-canfd:/dev/ttyUSB0; serial:/dev/ttyUSB0[@RATE] for Modbus (may be given
    /// again)
    #[arg(long = "bus", value_name = "INTERFACE", required = true)]
    buses: Vec<Interface>,
    /// The lowest node ID, motor ID or slave address to ask
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=247))]
    from: u8,
    /// The highest one: up to 127 on a CAN bus, 247 on a serial line
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u8).range(1..=247))]
    to: u8,
    /// The bit rate of a CAN bus
    #[arg(long, value_name = "RATE", value_parser = bit_rate, default_value = "1 Mbit/s")]
    bit_rate: u32,
    /// The bit rate of the data phase of CAN FD, where the bus carries such frames
    #[arg(long, value_name = "RATE", value_parser = data_bit_rate)]
    data_bit_rate: Option<u32>,
    /// The bit rates of a serial line to try, one after the other; without it, that behind @, or 115200 bit/s
    #[arg(long, value_name = "RATE,…", value_delimiter = ',', value_parser = line_rate)]
    line_rate: Vec<u32>,
    /// The time to wait for an answer
    #[arg(long, value_name = "TIME", value_parser = wait, default_value = "100 ms")]
    wait: Nanoseconds,
    /// Listen to a CAN bus for so long at the least: a heartbeat usually comes once a second
    #[arg(long, value_name = "TIME", value_parser = listening, default_value = "1.2 s")]
    listen_for: Nanoseconds,
    /// Send nothing, and show who is heard: on a CAN interface of the kernel also beside a running controller
    #[arg(long, conflicts_with = "stop_motors")]
    listen: bool,
    /// Ask motors that answer nothing but commands, too, by the command that stops them: A MOTOR THAT HOLDS A LOAD LETS IT GO
    #[arg(long)]
    stop_motors: bool,
    /// Do not look for devices without a node ID (LSS fastscan)
    #[arg(long)]
    no_lss: bool,
    /// Print a configuration to start with, in place of the table; what only you can know is marked in it
    #[arg(long, conflicts_with = "json")]
    config: bool,
    /// A data sheet (EDS or DCF), which belongs to the nodes with its vendor and product (may be given again)
    #[arg(long, value_name = "FILE")]
    eds: Vec<PathBuf>,
    /// Show every frame on standard error
    #[arg(short, long)]
    verbose: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// The command with the end of its help: what is asked with the consent of a person alone. The descriptions of all drives are read for it.
pub fn with_end_of_help(command: clap::Command) -> clap::Command {
    command.after_help(only_with_consent())
}

fn only_with_consent() -> String {
    let protocols = family::all().into_iter().flat_map(|family| family.own_protocols());
    let asked: Vec<String> = protocols
        .filter_map(|protocol| Some(format!("  {}: {}", protocol.name(), protocol.consequence()?)))
        .map(|line| paragraph(&line, 4))
        .collect();
    let before = "Motors of these protocols are only listened for without --stop-motors, because each request changes what they do:";
    let behind = "Such a motor answers its master alone, so that nothing is heard of it on a silent bus.";
    format!("{}\n{}\n{}", paragraph(before, 0), asked.join("\n"), paragraph(behind, 0))
}

fn bit_rate(text: &str) -> Result<u32, String> {
    rate(text, 10_000.0, 1e6).ok_or_else(|| "write it as \"500 kbit/s\", at most 1 Mbit/s".to_owned())
}

fn data_bit_rate(text: &str) -> Result<u32, String> {
    rate(text, 1e5, 8e6).ok_or_else(|| "write it as \"5 Mbit/s\", at most 8 Mbit/s".to_owned())
}

fn line_rate(text: &str) -> Result<u32, String> {
    let plain = text.trim().parse().ok().filter(|rate| (1_200..=4_000_000).contains(rate));
    plain
        .or_else(|| rate(text, 1_200.0, 4e6))
        .ok_or_else(|| "write it as 19200, or \"19200 bit/s\"; several are parted by commas".to_owned())
}

fn rate(text: &str, lowest: f64, highest: f64) -> Option<u32> {
    let rate = Quantity::BIT_RATE.parse(text).ok().filter(|rate| (lowest..=highest).contains(rate));
    rate.map(|rate| rate as u32)
}

fn duration(text: &str, lowest_s: f64, highest_s: f64) -> Option<Nanoseconds> {
    let seconds =
        Quantity::DURATION.parse(text).ok().filter(|seconds| (lowest_s..=highest_s).contains(seconds));
    seconds.map(|seconds| (seconds * 1e9).round() as Nanoseconds)
}

fn wait(text: &str) -> Result<Nanoseconds, String> {
    duration(text, 0.001, 10.0).ok_or_else(|| "write it as \"100 ms\", 1 ms to 10 s".to_owned())
}

fn listening(text: &str) -> Result<Nanoseconds, String> {
    duration(text, 0.0, 3600.0).ok_or_else(|| "write it as \"2 s\", 0 s to 3600 s".to_owned())
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Exit {
    match scan(arguments) {
        Ok(exit) => exit,
        Err(error) => error.print(arguments.json),
    }
}

fn scan(arguments: &Arguments) -> Result<Exit, UsageError> {
    let sheets = sheets(arguments)?;
    let interfaces: Vec<RealInterface> =
        arguments.buses.iter().map(|bus| real(arguments, bus)).collect::<Result<_, _>>()?;
    let interruption = Interruption::watch()?;
    let mut buses = vec![];
    for interface in &interfaces {
        let name = interface.to_string();
        let watcher = Watcher::new(&name, arguments.verbose);
        let (place, mut found) = match interface {
            RealInterface::Serial(device) => line::scan(arguments, device, &interruption, &watcher)?,
            interface => can::scan(arguments, interface, &interruption, &watcher)?,
        };
        watcher.finish();
        sheets.iter().for_each(|sheet| sheet.name(&mut found));
        let is_interrupted = found.is_interrupted;
        buses.push(ScannedBus { name, place, found });
        if is_interrupted {
            break;
        }
    }
    Ok(finish(arguments, buses, interfaces.len()))
}

fn real(arguments: &Arguments, bus: &Interface) -> Result<RealInterface, UsageError> {
    let Some(interface) = RealInterface::of(bus) else {
        return Err("--bus sim: a simulated bus is within the process that simulates it; `takt sim … --pty` puts one behind an adapter".into());
    };
    let is_line = matches!(interface, RealInterface::Serial(_));
    let Arguments { from, to, .. } = arguments;
    if from > to {
        return Err(format!("--from {from} is above --to {to}").into());
    }
    if !is_line && *to > 127 {
        return Err(format!("--to {to}: {interface} is a CAN bus, whose node IDs are 1 to 127").into());
    }
    if !is_line && !arguments.line_rate.is_empty() {
        return Err(format!("--line-rate is for serial lines; for {interface} say --bit-rate").into());
    }
    if is_line && arguments.listen {
        return Err(format!("--listen: the slaves on {interface} say nothing unless they are asked").into());
    }
    Ok(interface)
}

fn finish(arguments: &Arguments, buses: Vec<ScannedBus>, wanted: usize) -> Exit {
    let is_interrupted = buses.len() < wanted || buses.iter().any(|bus| bus.found.is_interrupted);
    let exit = if is_interrupted { Exit::Interrupted } else { Exit::Done };
    let is_lost = |bus: &ScannedBus| matches!(bus.found.bus_state, BusState::BusOff | BusState::Down);
    let exit = if buses.iter().any(is_lost) { exit.and_failed() } else { exit };
    if arguments.json {
        return print::indented_json(&output::json(&buses, is_interrupted), exit);
    }
    if !arguments.config {
        return print::text(&output::text(&buses, is_interrupted), exit);
    }
    for remark in buses.iter().flat_map(|bus| &bus.found.remarks) {
        say!("note: {remark}");
    }
    let found: Vec<_> = buses.into_iter().map(|bus| (bus.place, bus.found.devices)).collect();
    if !found.iter().any(|(_, devices)| can_drive(devices)) {
        say!("takt: no drive was found that an axis could be written for");
        return exit.and_failed();
    }
    let text = starting_configuration(&found, None);
    match longer_period(&text) {
        None => print::text(&text, exit),
        longer => print::text(&starting_configuration(&found, longer), exit),
    }
}

/// The period at which every bus of a configuration carries its traffic, if its own is too short for that.
fn longer_period(text: &str) -> Option<Nanoseconds> {
    // What lacks a data sheet cannot be read yet.
    let config = Config::parse("takt scan", text).ok()?;
    let longer = |remedy: &Remedy| match remedy {
        Remedy::LongerPeriod { period_ns } => Some(*period_ns),
        _ => None,
    };
    let of_bus = |bus: BusSchedule| bus.remedies.iter().find_map(longer);
    schedule::analyse(&config).into_iter().filter(|bus| !bus.fits()).filter_map(of_bus).max()
}

/// A data sheet of the person's own.
struct Sheet {
    path: PathBuf,
    device: cia402::Device,
}

fn sheets(arguments: &Arguments) -> Result<Vec<Sheet>, UsageError> {
    let sheet = |path: &PathBuf| match cia402::Device::load(path, None) {
        Ok(device) => Ok(Sheet { path: path.clone(), device }),
        Err(reason) => Err(UsageError::from(format!("--eds {}: {reason}", path.display()))),
    };
    arguments.eds.iter().map(sheet).collect()
}

impl Sheet {
    /// Puts what it says to the nodes that it belongs to.
    fn name(&self, found: &mut Scanned) {
        found.devices.iter_mut().for_each(|device| cia402::name_by_sheet(device, &self.device, &self.path));
    }
}

/// Ctrl-C, or the wish of another takt to take the bus over.
pub struct Interruption {
    arrived: Arc<AtomicBool>,
    /// True if it has been seen once.
    is_over: Cell<bool>,
}

impl Interruption {
    fn watch() -> Result<Self, UsageError> {
        let arrived = interruption::watch().map_err(|error| format!("cannot watch for Ctrl-C: {error}"))?;
        Ok(Self { arrived, is_over: Cell::new(false) })
    }

    /// Ends the scan as Ctrl-C does.
    pub fn end(&self) {
        self.is_over.set(true);
    }

    /// Returns `true` if it has come.
    pub fn has_come(&self) -> bool {
        if self.arrived.load(Ordering::Relaxed) {
            self.is_over.set(true);
        }
        self.is_over.get()
    }
}

/// The place of a scan, for the configuration.
fn place(interface: &RealInterface, bit_rate: u32, data_bit_rate: Option<u32>) -> PlaceOfScan {
    PlaceOfScan { interface: interface.to_string(), bit_rate, data_bit_rate }
}
