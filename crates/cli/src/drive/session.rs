//! Opens the bus, runs the procedure, and shows what happens.

use std::cell::Cell;
use std::sync::atomic::Ordering;

use takt::config::Interface;
use takt::controller::VirtualClock;
use takt::controller::port::Port;
use takt::link::ownership::{IfOwned, Ownership};
use takt_rt::linux::MonotonicClock;
use takt_rt::{BusPort, BusState};
use takt_tools::commission::{
    Bus, DriveTask, Failure, ProcedureError, Report, TargetDrive, Task, bus_session,
};

use super::super::exit::Exit;
use super::super::interruption;
use super::super::ownership;
use super::super::usage_error::UsageError;
use super::options::Options;
use super::output::Output;

/// Runs a task on a drive. The error is the end of the program: there was no bus to run it on.
pub fn run(
    target: &TargetDrive,
    task: Task,
    bus: &Bus,
    if_owned: IfOwned,
    options: Options,
    output: &mut Output,
) -> Result<Result<Report, ProcedureError>, Exit> {
    if let Some(failure) = not_carried(bus, &task) {
        return Ok(Err(ProcedureError { step: "command line", failure }));
    }
    let DriveTask { procedure, words } = match target.family().commission(target.clone(), task) {
        Ok(task) => task,
        Err(failure) => return Ok(Err(ProcedureError { step: "command line", failure })),
    };
    output.describe_frames(words);
    // Reading needs it, too: a drive has room for the SDO requests of one master, and a silent one is sent an NMT command.
    let claim = bus.claim(Some(target.node));
    let mut ownership = match Ownership::claim(claim.into_iter().collect(), if_owned) {
        Ok(ownership) => ownership,
        Err(error) => return Err(ownership::usage_error(&error).print(options.json)),
    };
    let mut port = match bus.open() {
        Ok(port) => port,
        Err(error) => return Err(UsageError::from(error.to_string()).print(options.json)),
    };
    let interrupted = match interruption::watch() {
        Ok(interrupted) => interrupted,
        Err(error) => {
            say!("takt: cannot watch for Ctrl-C: {error}");
            return Err(Exit::Stopped);
        }
    };
    let is_simulated = matches!(port, Port::Simulated(_));
    let taken_over_by = Cell::new(None);
    let is_interrupted = || {
        let asking = ownership.poll_release_request();
        taken_over_by.set(asking.or(taken_over_by.get()));
        interrupted.swap(false, Ordering::Relaxed) || asking.is_some()
    };
    // When the readings can no longer be printed, the procedure ends as after Ctrl-C.
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
    if let Some(process) = taken_over_by.get() {
        output.hint(&format!("{process} takes the bus over"));
    }
    let is_silent = matches!(&outcome, Err(failed) if matches!(failed.failure, Failure::Silent { .. }));
    if is_silent && is_unacknowledged(&mut port) {
        output.hint(
            "no node on this bus acknowledges a frame: is it plugged in and terminated, is the drives' power on, is the \
             bit rate right?",
        );
    }
    Ok(outcome)
}

/// Why a converter between the line and the bus does not carry a task.
fn not_carried(bus: &Bus, task: &Task) -> Option<Failure> {
    let Bus::Configured { config, bus } = bus else { return None };
    let interface = &config.buses.get(*bus)?.interface;
    let is_lost = matches!((interface, task), (Interface::Converter(_), Task::GainFactors(_)));
    is_lost.then(|| Failure::Unsupported {
        what: "the converter between RS-485 and CAN FD does not carry the frames that multiply gains"
            .to_owned(),
        instead: "send them over a CAN bus".to_owned(),
    })
}

/// Returns `true` if no frame that was sent has been acknowledged.
fn is_unacknowledged(port: &mut Port) -> bool {
    let health = port.health();
    health.tx_frames == 0 || health.state != BusState::ErrorActive
}
