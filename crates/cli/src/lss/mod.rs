//! `takt lss`: node IDs and bit rates for devices that are set up by their identity.

mod output;
mod simulated_device;

use std::sync::atomic::Ordering;

use clap::{Args, Subcommand};

use takt::config::{Interface, Quantity};
use takt::controller::VirtualClock;
use takt::family;
use takt::link::ownership::{BusClaim, IfOwned, MasterTraffic, Ownership};
use takt::link::{InterfaceSettings, RealInterface, SocketCanOptions, open_interface};
use takt_rt::linux::MonotonicClock;
use takt_rt::{BusPort, Clock, Nanoseconds};
use takt_sim::lss::LssBus;
use takt_tools::commission::layer_settings::{DeviceSelection, LayerSettingFailure, LayerSettings, NO_NODE};
use takt_wire::canopen::lss::{BitTiming, Inquiry, LssAddress, LssOutcome, LssTask};

use super::columns::paragraph;
use super::exit::Exit;
use super::interruption;
use super::usage_error::UsageError;
use output::{Device, Output, Report};
pub use simulated_device::SimulatedDevice;
use simulated_device::{address, node};

/// For the help: what those families have instead whose drives have no LSS.
fn families_without_lss() -> String {
    let instead = family::all().into_iter().filter_map(|family| family.instead_of_lss());
    let mut lines: Vec<String> = instead.map(|words| paragraph(&format!("  {words}"), 4)).collect();
    // Several families have the same.
    lines.dedup();
    format!("Drives without LSS:\n{}", lines.join("\n"))
}

/// In the help of an action, its own options come first.
const OF_EVERY_ACTION: &str = "Options of every action";
/// The time in milliseconds after which the kernel restarts a controller that is bus-off.
const RESTART_MS: u32 = 100;

/// Give devices their node ID and bit rate by their identity (LSS, CiA 305)
///
/// The device is the one with the identity after --device, or the only one on the bus (--only), or else one without a
/// node ID, which a scan finds. What is set is forgotten at power-down unless --store is given.
#[derive(Args, Debug)]
#[command(subcommand_value_name = "ACTION", subcommand_help_heading = "Actions", after_help = families_without_lss())]
pub struct Arguments {
    /// The interface: can0, vcan0 …, slcan:/dev/ttyACM0; or sim, with the devices of --simulate
    #[arg(long, value_name = "INTERFACE")]
    bus: Interface,
    /// The bit rate of the interface
    #[arg(long, value_name = "RATE", global = true, help_heading = OF_EVERY_ACTION, value_parser = bit_rate, default_value = "1 Mbit/s")]
    bit_rate: u32,
    /// The device with this identity (1018:1 to 4): VENDOR:PRODUCT:REVISION:SERIAL
    #[arg(long, value_name = "IDENTITY", global = true, help_heading = OF_EVERY_ACTION, value_parser = address)]
    device: Option<LssAddress>,
    /// The only device on the bus, whatever it is
    #[arg(long, global = true, help_heading = OF_EVERY_ACTION, conflicts_with = "device")]
    only: bool,
    /// The time to wait for the answer to each of the 130 requests of a scan
    ///
    /// Longer waits are for slow devices and slow adapters: a device that answers too late is lost.
    #[arg(long, value_name = "TIME", global = true, help_heading = OF_EVERY_ACTION, value_parser = scan_wait, default_value = "20 ms")]
    scan_wait: Nanoseconds,
    /// A device on a simulated bus: IDENTITY, or IDENTITY@NODE where it has a node ID already
    ///
    /// Behind a comma it gets a behaviour: `canopennode` answers every scan request in configuration state,
    /// `no-boot-up` does not boot with its new node ID.
    #[arg(long, value_name = "DEVICE", global = true, help_heading = OF_EVERY_ACTION)]
    simulate: Vec<SimulatedDevice>,
    /// Show every frame
    #[arg(short, long, global = true, help_heading = OF_EVERY_ACTION)]
    verbose: bool,
    /// Print the result as one JSON object
    #[arg(long, global = true, help_heading = OF_EVERY_ACTION)]
    json: bool,
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand, Clone, Copy, Debug)]
enum Action {
    /// List the devices that have no node ID
    Scan,
    /// Show the identity and the node ID of the device
    Inquire,
    /// Give the device a node ID
    SetId {
        /// The node ID; or none, to take it away
        #[arg(value_parser = node)]
        id: u8,
        /// Keep it over power-down
        #[arg(long)]
        store: bool,
    },
    /// Give the device a bit rate, which holds from its next start, or from --activate on
    #[command(name = "set-bitrate")]
    SetBitRate {
        /// "500 kbit/s"; one of 10, 20, 50, 125, 250, 500, 800 kbit/s and 1 Mbit/s
        #[arg(value_parser = timing)]
        rate: BitTiming,
        /// Change to it now: all devices are silent for this many milliseconds before and after the change
        #[arg(long, value_name = "MS")]
        activate: Option<u16>,
        /// Keep it over power-down
        #[arg(long)]
        store: bool,
    },
    /// Have the device keep its node ID and bit rate over power-down
    Store,
    /// End configuration on every device, as after a change of the bit rate
    Wait,
}

impl Action {
    const fn name(self) -> &'static str {
        match self {
            Self::Scan => "scan",
            Self::Inquire => "inquire",
            Self::SetId { .. } => "set-id",
            Self::SetBitRate { .. } => "set-bitrate",
            Self::Store => "store",
            Self::Wait => "wait",
        }
    }
}

fn bit_rate(text: &str) -> Result<u32, String> {
    let rate = Quantity::BIT_RATE.parse(text).ok().filter(|rate| (10_000.0..=1_000_000.0).contains(rate));
    rate.map(|rate| rate as u32).ok_or_else(|| "write it as \"500 kbit/s\", at most 1 Mbit/s".to_owned())
}

fn scan_wait(text: &str) -> Result<Nanoseconds, String> {
    let seconds = Quantity::DURATION.parse(text).ok().filter(|seconds| (0.001..=1.0).contains(seconds));
    let wait = seconds.map(|seconds| (seconds * 1e9).round() as Nanoseconds);
    wait.ok_or_else(|| "write it as \"50 ms\", 1 ms to 1 s".to_owned())
}

fn timing(text: &str) -> Result<BitTiming, String> {
    let rate = bit_rate(text)?;
    BitTiming::of(rate)
        .ok_or_else(|| "LSS knows 10, 20, 50, 125, 250, 500, 800 kbit/s and 1 Mbit/s".to_owned())
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Exit {
    let interrupted = match interruption::watch() {
        Ok(interrupted) => interrupted,
        Err(error) => {
            say!("takt: cannot watch for Ctrl-C: {error}");
            return Exit::Stopped;
        }
    };
    let is_interrupted = || interrupted.load(Ordering::Relaxed);
    let refuse = |words: String| UsageError::from(words).print(arguments.json);
    if let Some(reason) = arguments.bus.lacks_canopen() {
        return refuse(reason);
    }
    match RealInterface::of(&arguments.bus) {
        None if arguments.simulate.is_empty() => {
            refuse("a simulated bus has no devices of its own: add --simulate IDENTITY".to_owned())
        }
        None => {
            let devices = arguments.simulate.iter();
            let mut bus = LssBus::new(devices.map(|device| device.device()));
            lead(arguments, &mut bus, &mut VirtualClock::default(), is_interrupted)
        }
        Some(_) if !arguments.simulate.is_empty() => {
            refuse("--simulate is for a simulated bus: --bus sim".to_owned())
        }
        Some(interface) => {
            let (name, bit_rate) = (interface.to_string(), arguments.bit_rate);
            let settings = InterfaceSettings { bit_rate, data_bit_rate: None, restart_ms: RESTART_MS };
            let claim = BusClaim {
                bus: name.clone(),
                interface: interface.clone(),
                settings,
                traffic: MasterTraffic::without_configuration(None),
            };
            let mut ownership = match Ownership::claim(vec![claim], IfOwned::Refuse) {
                Ok(ownership) => ownership,
                Err(error) => return refuse(error.to_string()),
            };
            let mut is_taken_over = false;
            let is_interrupted = || {
                is_taken_over |= ownership.poll_release_request().is_some();
                is_taken_over || is_interrupted()
            };
            let options = SocketCanOptions { bit_rate, ..SocketCanOptions::default() };
            match open_interface(&name, &interface, &settings, &options) {
                Ok(mut port) => lead(arguments, &mut port, &mut MonotonicClock::default(), is_interrupted),
                Err(error) => refuse(error.to_string()),
            }
        }
    }
}

fn lead(
    arguments: &Arguments,
    port: &mut impl BusPort,
    clock: &mut impl Clock,
    mut is_interrupted: impl FnMut() -> bool,
) -> Exit {
    let output = Output { action: arguments.action.name(), is_json: arguments.json };
    let is_verbose = arguments.verbose;
    let mut see = |at_ns, seen| {
        if is_verbose {
            output::show(at_ns, &seen);
        }
    };
    let mut report = Report::default();
    let mut settings =
        LayerSettings::new(port, clock, &mut is_interrupted, &mut see).with_scan_timeout(arguments.scan_wait);
    let outcome = carry_out(arguments, &mut settings, &mut report);
    output.finish(&report, outcome)
}

fn carry_out<P: BusPort, C: Clock>(
    arguments: &Arguments,
    settings: &mut LayerSettings<'_, P, C>,
    report: &mut Report,
) -> Result<(), LayerSettingFailure> {
    let mut awaited = None;
    let outcome = act(arguments, settings, report, &mut awaited);
    if report.is_activated {
        // A frame at the old bit rate would only disturb the devices at the new one.
        return outcome;
    }
    // In every case, no device is left in the LSS state configuration.
    let awaited = awaited.filter(|_| outcome.is_ok());
    let has_booted = settings.release(awaited);
    outcome?;
    let has_booted = has_booted?;
    report.booted_node = awaited.filter(|_| has_booted);
    report.is_boot_up_missing = awaited.is_some() && !has_booted;
    Ok(())
}

fn act<P: BusPort, C: Clock>(
    arguments: &Arguments,
    settings: &mut LayerSettings<'_, P, C>,
    report: &mut Report,
    awaited: &mut Option<u8>,
) -> Result<(), LayerSettingFailure> {
    let choice = match (arguments.device, arguments.only) {
        (Some(address), _) => DeviceSelection::Identity(address),
        (None, true) => DeviceSelection::Only,
        (None, false) => DeviceSelection::Unconfigured,
    };
    let mut is_stored = false;
    match arguments.action {
        Action::Wait => return Ok(()),
        Action::Scan => {
            let mut found = vec![];
            let outcome = settings.scan_all(&mut found);
            report.devices = Some(found.into_iter().map(Device::from).collect());
            report.remark = outcome?.map(|identity| identity.to_string());
            return Ok(());
        }
        Action::Inquire => {
            settings.select(choice)?;
            if let LssOutcome::Device(address) = settings.perform(LssTask::InquireAddress)? {
                report.device = Some(address.into());
            }
            report.node = node_of(settings)?;
            return Ok(());
        }
        Action::SetId { id, store } => {
            report.device = settings.select(choice)?.map(Device::from);
            let before = node_of(settings)?;
            settings.configure_node(id, before)?;
            report.node = (id != NO_NODE).then_some(id);
            // A device that had a node ID before keeps it until it is reset.
            *awaited = report.node.filter(|_| before.is_none());
            report.is_reset_needed = before.is_some();
            is_stored = store;
        }
        Action::SetBitRate { rate, activate, store } => {
            report.device = settings.select(choice)?.map(Device::from);
            settings.perform(LssTask::ConfigureBitTiming(rate))?;
            report.bit_rate = rate.bit_rate();
            if store {
                settings.perform(LssTask::Store)?;
                report.is_stored = true;
            }
            if let Some(delay_ms) = activate {
                settings.perform(LssTask::ActivateBitTiming { delay_ms })?;
                report.is_activated = true;
            }
        }
        Action::Store => {
            report.device = settings.select(choice)?.map(Device::from);
            is_stored = true;
        }
    }
    if is_stored {
        settings.perform(LssTask::Store)?;
        report.is_stored = true;
    }
    Ok(())
}

fn node_of<P: BusPort, C: Clock>(
    settings: &mut LayerSettings<'_, P, C>,
) -> Result<Option<u8>, LayerSettingFailure> {
    Ok(match settings.perform(LssTask::Inquire(Inquiry::Node))? {
        LssOutcome::Value(number) => u8::try_from(number).ok().filter(|node| *node != NO_NODE),
        _ => None,
    })
}
