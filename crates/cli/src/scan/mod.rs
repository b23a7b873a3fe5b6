//! `takt scan`: what is on a bus, and which configuration would drive it.

mod arguments;
mod beside;
mod can;
mod interruption;
mod line;
mod output;

use std::path::PathBuf;

use takt_rt::{BusState, Nanoseconds};

use takt::config::{Config, Interface};
use takt::family::cia402;
use takt::family::scan::{Scanned, can_drive, starting_configuration};
use takt::link::RealInterface;
use takt::schedule::{self, BusSchedule, Remedy};

use super::exit::Exit;
use super::print;
use super::usage_error::UsageError;
pub use arguments::{Arguments, with_end_of_help};
use interruption::Interruption;
use output::{ScannedBus, Watcher};

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
