//! What a page may break, and mend again.

use serde::Deserialize;

use takt::config::Config;
use takt::controller::VirtualController;
use takt::faults::{DriveEffect, Injectable};
use takt_sim::{Defect, DriveFault};

/// What is broken, or mended where `is_broken` says so.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Breakage {
    what: What,
    /// The axis; of the bus, any axis on it.
    axis: usize,
    is_broken: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum What {
    /// The cable of a drive is unplugged.
    Silent,
    /// The joint is blocked, so that it does not follow.
    Blocked,
    /// The drive detects an over-voltage.
    OverVoltage,
    /// The supply of the drive is cut for a moment.
    PowerCut,
    /// Somebody pulls the safe torque off.
    TorqueOff,
    /// The host's CAN controller has gone off the bus.
    BusOff,
}

impl Breakage {
    /// Breaks it.
    ///
    /// # Errors
    /// Why it cannot be, in words.
    pub fn carry_out(self, config: &Config, controller: &VirtualController) -> Result<(), String> {
        let Self { what, axis: number, is_broken } = self;
        let axis = config.axes.get(number).ok_or_else(|| format!("there is no axis {number}"))?;
        let effect = match what {
            What::Silent => DriveEffect::Silent,
            What::Blocked => DriveEffect::Defect(Defect::BlockedJoint),
            What::OverVoltage => DriveEffect::Cause(DriveFault::OverVoltage),
            What::PowerCut => DriveEffect::Reboot,
            What::TorqueOff => DriveEffect::Defect(Defect::TorqueOff),
            What::BusOff => return take_off_bus(controller, axis.bus, is_broken),
        };
        let broken = controller.with_ports(|ports| {
            let port = ports.get_mut(axis.bus).ok_or("there is no such bus")?;
            port.inject(axis.node, effect, is_broken).map_err(|error| error.to_string())
        });
        broken.unwrap_or_else(|| Err(NOT_SIMULATED.to_owned()))
    }
}

const NOT_SIMULATED: &str = "nothing here is simulated";

fn take_off_bus(controller: &VirtualController, bus: usize, is_off: bool) -> Result<(), String> {
    let taken = controller.with_ports(|ports| {
        let simulated = ports.get_mut(bus).and_then(|port| port.simulated_mut());
        simulated.map(|simulated| simulated.take_off_bus(is_off))
    });
    taken.flatten().ok_or_else(|| NOT_SIMULATED.to_owned())
}
