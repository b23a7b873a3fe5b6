//! A CAN bus.

use std::cell::Cell;

use takt_rt::linux::MonotonicClock;

use super::super::ownership;
use super::super::usage_error::UsageError;
use super::arguments::Arguments;
use super::beside;
use super::interruption::Interruption;
use super::output::Watcher;
use takt::family::scan::{BusScan, PlaceOfScan, Scanned};
use takt::link::ownership::{BusClaim, ClaimError, IfOwned, MasterTraffic, Ownership, Role};
use takt::link::{InterfaceSettings, RealInterface, SocketCanOptions, open_interface, open_to_listen};
use takt_tools::commission::bus_scan;

/// The time in milliseconds after which the kernel restarts a controller that is bus-off.
const RESTART_MS: u32 = 100;
/// Frames that the kernel keeps until they are read.
const RECEIVE_FRAMES: usize = 1 << 12;

/// Scans the bus.
pub fn scan(
    arguments: &Arguments,
    interface: &RealInterface,
    interruption: &Interruption,
    watcher: &Watcher,
) -> Result<(PlaceOfScan, Scanned), UsageError> {
    let (bit_rate, data_bit_rate) = (arguments.bit_rate, arguments.data_bit_rate);
    let settings = InterfaceSettings { bit_rate, data_bit_rate, restart_ms: RESTART_MS };
    let options = SocketCanOptions {
        bit_rate,
        data_bit_rate,
        receive_frames: RECEIVE_FRAMES,
        ..SocketCanOptions::default()
    };
    let name = interface.to_string();
    let what = BusScan {
        nodes: arguments.from..=arguments.to,
        wait_ns: arguments.wait,
        listening_ns: arguments.listen_for,
        only_listens: arguments.listen,
        may_take_torque: arguments.stop_motors,
        has_fd: data_bit_rate.is_some(),
        of_controller: None,
    };
    let listening = || {
        let opened = open_to_listen(&name, interface, &settings, &options);
        opened.map_err(|error| ownership::not_heard(&error))
    };
    // A drive has room for the requests of one master.
    let (mut ownership, mut port) = match arguments.listen {
        true => (None, listening()?),
        false => match claim(&name, interface, settings) {
            Ok(ownership) => {
                let opened = open_interface(&name, interface, &settings, &options);
                (Some(ownership), opened.map_err(|error| ownership::not_heard(&error))?)
            }
            Err(error) => {
                let owner = owner(arguments, interface, &error)?;
                return Ok(owner.scan(what, interface, listening()?, interruption, watcher));
            }
        },
    };
    let is_told = Cell::new(false);
    let mut is_interrupted = || {
        let is_asked = ownership.as_mut().is_some_and(|owned| owned.poll_release_request().is_some());
        if is_asked {
            interruption.end();
        }
        // Each `true` is an interruption of its own, and one is enough.
        interruption.has_come() && !is_told.replace(true)
    };
    let found = bus_scan::scan(
        &what,
        !arguments.no_lss,
        &mut port,
        &mut MonotonicClock::default(),
        &mut is_interrupted,
        &mut |at_ns, event| watcher.see(at_ns, &event),
    );
    Ok((PlaceOfScan { interface: name, bit_rate, data_bit_rate }, found))
}

/// The controller that has the interface and sends the questions.
fn owner(
    arguments: &Arguments,
    interface: &RealInterface,
    error: &ClaimError,
) -> Result<beside::Owner, UsageError> {
    let is_network = matches!(interface, RealInterface::SocketCan(_));
    match error {
        ClaimError::Held { role: Role::Master, .. } if is_network => {}
        ClaimError::OtherMaster { .. } if is_network => {
            return Err(
                format!("{error}, or add --listen, which sends nothing and shows who is heard").into()
            );
        }
        _ => return Err(error.to_string().into()),
    }
    let Some(owner) = beside::Owner::of(interface) else {
        return Err(format!(
            "{error}. A controller that is served (takt run … --serve NAME) and that you may command asks for a scan; --listen sends nothing \
             and shows who is heard"
        )
        .into());
    };
    if arguments.stop_motors {
        return Err("--stop-motors: a running controller sends no commands of others; stop it first"
            .to_owned()
            .into());
    }
    owner.verify()?;
    Ok(owner)
}

fn claim(
    name: &str,
    interface: &RealInterface,
    settings: InterfaceSettings,
) -> Result<Ownership, ClaimError> {
    let claim = BusClaim {
        bus: name.to_owned(),
        interface: interface.clone(),
        settings,
        traffic: MasterTraffic::of_any_node(),
    };
    Ownership::claim(vec![claim], IfOwned::Refuse)
}
