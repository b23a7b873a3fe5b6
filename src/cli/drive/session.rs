//! Opens the bus, carries the procedure out, and shows what happens.

use std::sync::atomic::Ordering;

use takt::bus::port::{OpenError, Port, open_configured};
use takt::bus::{InterfaceSettings, SocketCanOptions, open_socketcan, prepare_interface};
use takt::commission::{Failure, Request, Subject, bus_session, procedure};
use takt::controller::VirtualClock;
use takt::sim::SimulatedBus;
use takt_rt::linux::MonotonicClock;
use takt_rt::{BusPort, BusState};

use super::super::exit::Exit;
use super::super::interruption;
use super::super::refusal::Refusal;
use super::Options;
use super::output::Output;
use super::target::Bus;

/// How soon a controller that has gone off the bus comes back.
const RESTART_MS: u32 = 100;

/// Does what is asked for.
pub fn run(subject: Subject, request: Request, bus: Bus, options: Options, mut output: Output) -> Exit {
    let mut port = match open(&bus) {
        Ok(port) => port,
        Err(error) => return Refusal::from(error.to_string()).print(options.json),
    };
    let interrupted = match interruption::watch() {
        Ok(interrupted) => interrupted,
        Err(error) => {
            say!("takt: cannot watch for Ctrl-C: {error}");
            return Exit::Stopped;
        }
    };
    let is_simulated = matches!(port, Port::Simulated(_));
    let procedure = procedure(subject, request);
    let is_interrupted = || interrupted.swap(false, Ordering::Relaxed);
    // What nobody reads any more ends as on Ctrl-C.
    let see = |at_ns, seen| {
        let is_shown = output.see(at_ns, seen);
        interrupted.fetch_or(!is_shown, Ordering::Relaxed);
    };
    let outcome = if options.fast && is_simulated {
        let mut clock = VirtualClock::default();
        bus_session::run(procedure, &mut port, &mut clock, is_interrupted, see)
    } else {
        bus_session::run(procedure, &mut port, &mut MonotonicClock::default(), is_interrupted, see)
    };
    let is_silent = matches!(&outcome, Err(failed) if matches!(failed.failure, Failure::Silent { .. }));
    if is_silent && is_deaf(&mut port) {
        output.hint(
            "nobody acknowledges a frame on this bus: is it plugged in and terminated, is the drives' power on, is the \
             bit rate right?",
        );
    }
    output.finish(&outcome)
}

/// Whether nothing that was sent has been acknowledged by anybody.
fn is_deaf(port: &mut Port) -> bool {
    let health = port.health();
    health.tx_frames == 0 || health.state != BusState::ErrorActive
}

/// Everything on the bus is heard: a scan wants to know who is there.
fn open(bus: &Bus) -> Result<Port, OpenError> {
    match bus {
        Bus::Configured { config, bus } => {
            let settings = config.buses.get(*bus);
            let socket = SocketCanOptions {
                data_bit_rate: settings.and_then(|bus| bus.data_bit_rate),
                ..of_bit_rate(settings.map(|bus| bus.bit_rate))
            };
            Ok(match open_configured(config, *bus, &socket)? {
                Some(port) => Port::SocketCan(Box::new(port)),
                None => Port::Simulated(Box::new(SimulatedBus::new(config, *bus))),
            })
        }
        Bus::Interface { name, bit_rate } => {
            let settings =
                InterfaceSettings { bit_rate: *bit_rate, data_bit_rate: None, restart_ms: RESTART_MS };
            prepare_interface(name, &settings)
                .map_err(|error| OpenError::Interface { bus: name.clone(), error })?;
            let port = open_socketcan(name, &of_bit_rate(Some(*bit_rate)))
                .map_err(|error| OpenError::Socket { bus: name.clone(), error })?;
            Ok(Port::SocketCan(Box::new(port)))
        }
    }
}

fn of_bit_rate(bit_rate: Option<u32>) -> SocketCanOptions {
    let usual = SocketCanOptions::default();
    SocketCanOptions { bit_rate: bit_rate.unwrap_or(usual.bit_rate), ..usual }
}
