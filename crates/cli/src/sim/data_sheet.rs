//! `takt sim --eds`: one drive on an interface, made from its data sheet, without a configuration.

use std::path::PathBuf;

use clap::Args;
use takt_wire::canopen::eds;

use takt::config::FrictionShape;
use takt::config::quirks::{self, Quirks};
use takt::config::{Interface, InterfaceError};
use takt::link::ownership::{InterfaceLock, lock_for_simulator};
use takt::link::{InterfaceSettings, RealInterface, SocketCanOptions, open_interface};
use takt_sim::LiveDrives;
use takt_sim::cia402::{Cia402AxisParameters, Cia402Drive, Cia402Parameters, counts_per_turn};
use takt_sim::homing_switches::{ReferenceSwitches, Switch};
use takt_sim::plant::{Encoder, JointParameters};

use crate::usage_error::UsageError;

/// Position units for one turn where the data sheet gives none in 608F and 6092.
const USUAL_COUNTS_PER_TURN: f64 = 65_536.0;
const RESTART_MS: u32 = 100;

/// One drive, made from its data sheet.
#[derive(Args, Debug)]
pub struct DataSheetArguments {
    /// Put one CiA 402 drive on an interface that is made from this EDS or DCF file, instead of a configuration's
    #[arg(long = "eds", value_name = "FILE", requires_all = ["node", "interface"])]
    #[arg(conflicts_with_all = ["config", "buses", "adapters", "lss_devices"])]
    sheet: Option<PathBuf>,
    /// Its node ID
    #[arg(long, value_name = "N", requires = "sheet", value_parser = clap::value_parser!(u8).range(1..=127))]
    node: Option<u8>,
    /// The interface: can0, vcan0 …, slcan:/dev/ttyACM0
    #[arg(long, requires = "sheet", value_parser = real_interface)]
    interface: Option<RealInterface>,
    /// Its quirks, as in drives/*.toml
    #[arg(long, value_name = "FILE", requires = "sheet")]
    quirks: Option<PathBuf>,
    /// Its axes: objects of the second one stand 0x800 higher
    #[arg(long, value_name = "N", requires = "sheet", default_value_t = 1)]
    #[arg(value_parser = clap::value_parser!(u8).range(1..=8))]
    axes: u8,
    /// Position units for one turn, where the data sheet gives none in 608F and 6092 [65536]
    #[arg(long, value_name = "COUNTS", requires = "sheet")]
    counts_per_turn: Option<f64>,
    /// Bit/s
    #[arg(long, requires = "sheet", default_value_t = 1_000_000)]
    bit_rate: u32,
}

fn real_interface(text: &str) -> Result<RealInterface, String> {
    let interface: Interface =
        text.parse().map_err(|error: InterfaceError| format!("{error}: {}", error.help()))?;
    RealInterface::of(&interface).ok_or_else(|| "a simulated bus is inside one process alone".to_owned())
}

/// The drive on its interface; the lock is held until the drive is gone. `None` without `--eds`.
pub fn open(arguments: &DataSheetArguments) -> Result<Option<(LiveDrives, InterfaceLock)>, UsageError> {
    let (Some(path), Some(node), Some(interface)) = (&arguments.sheet, arguments.node, &arguments.interface)
    else {
        return Ok(None);
    };
    let words = |error: &dyn std::fmt::Display| UsageError::from(error.to_string());
    let sheet = eds::load(path).map_err(|findings| words(&findings))?.dictionary;
    let quirks = match &arguments.quirks {
        Some(path) => quirks::load(path)?,
        None => Quirks::default(),
    };
    let axes = (0..u16::from(arguments.axes)).map(|axis| {
        let by_objects = counts_per_turn(&sheet, node, axis);
        joint(by_objects.or(arguments.counts_per_turn).unwrap_or(USUAL_COUNTS_PER_TURN))
    });
    let parameters = Cia402Parameters {
        axes: axes.collect(),
        sheet,
        node,
        quirks,
        power_up_ns: 100_000_000,
        feedback_delay_ns: 50_000,
        seed: 1,
    };
    let drive = Cia402Drive::new(parameters).map_err(|error| words(&error))?;
    let name = interface.to_string();
    let lock = lock_for_simulator(&name, interface).map_err(|error| words(&error))?;
    let settings =
        InterfaceSettings { bit_rate: arguments.bit_rate, data_bit_rate: None, restart_ms: RESTART_MS };
    let options = SocketCanOptions { bit_rate: arguments.bit_rate, ..SocketCanOptions::default() };
    let port = open_interface(&name, interface, &settings, &options).map_err(|error| words(&error))?;
    Ok(Some((LiveDrives::new(vec![Box::new(drive)], port.into_live()), lock)))
}

/// A small joint: a motor of 0.5 kW with 15 turns of travel between its limit switches, and a home switch at its middle.
fn joint(counts_per_turn: f64) -> Cia402AxisParameters {
    const TURN: f64 = std::f64::consts::TAU;
    Cia402AxisParameters {
        joint: JointParameters {
            inertia: 0.005,
            viscous_friction: 0.002,
            coulomb_friction: 0.05,
            friction_shape: FrictionShape::Constant,
            brake_torque: 10.0,
        },
        encoder: Encoder { counts_per_unit: counts_per_turn / TURN, zero_counts: 0.0 },
        counts_per_turn,
        initial_position: 0.0,
        rated_torque: 1.6,
        peak_torque: 4.8,
        highest_velocity: 50.0 * TURN,
        switches: ReferenceSwitches {
            negative_limit: Some(Switch::below(-7.5 * TURN)),
            positive_limit: Some(Switch::above(7.5 * TURN)),
            home: Some(Switch { from: -0.1 * TURN, to: 0.1 * TURN }),
            index_distance: Some(TURN),
        },
        end_stops: None,
    }
}
