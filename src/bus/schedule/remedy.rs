//! What would make a bus fit: each way is tried by analysing the configuration so changed.

use serde::Serialize;

use super::analyse_bus;
use crate::config::Config;

/// A change that makes a bus fit, alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", tag = "change")]
pub enum Remedy {
    /// Another command phase, within this range.
    CommandPhase {
        /// The earliest.
        earliest_ns: u64,
        /// The latest.
        latest_ns: u64,
    },
    /// No SDO transfers while the axes are enabled.
    SdoWhileDisabled,
    /// No heartbeats of the drives: their feedback shows that they live.
    DriveHeartbeatsOff,
    /// Statusword and position only.
    SmallerFeedback,
    /// Fewer axes on this bus.
    MoreBuses {
        /// How many of its axes fit, the first ones.
        axes_per_bus: usize,
        /// How many buses that makes of this one.
        buses: usize,
    },
    /// A longer cycle.
    LongerPeriod {
        /// The period.
        period_ns: u64,
    },
}

/// Multiples of the period that are tried.
const LONGER_PERIODS: [u64; 4] = [2, 4, 5, 10];

pub(super) fn remedies(config: &Config, bus: usize) -> Vec<Remedy> {
    let mut found = vec![];
    found.extend(command_phase(config, bus));
    if config.buses.get(bus).is_some_and(|bus| bus.sdo_while_enabled) {
        let without = changed(config, |config| {
            config.buses.iter_mut().for_each(|bus| bus.sdo_while_enabled = false);
        });
        found.extend(fits(&without, bus).then_some(Remedy::SdoWhileDisabled));
    }
    if has(config, bus, |axis| axis.heartbeat_ns.is_some()) {
        let without =
            changed(config, |config| config.axes.iter_mut().for_each(|axis| axis.heartbeat_ns = None));
        found.extend(fits(&without, bus).then_some(Remedy::DriveHeartbeatsOff));
    }
    if has(config, bus, |axis| !axis.feedback.is_empty()) {
        let without = changed(config, |config| config.axes.iter_mut().for_each(|axis| axis.feedback.clear()));
        found.extend(fits(&without, bus).then_some(Remedy::SmallerFeedback));
    }
    found.extend(more_buses(config, bus));
    found.extend(longer_period(config, bus));
    found
}

fn changed(config: &Config, change: impl FnOnce(&mut Config)) -> Config {
    let mut config = config.clone();
    change(&mut config);
    config
}

fn fits(config: &Config, bus: usize) -> bool {
    analyse_bus(config, bus).fits()
}

fn has(config: &Config, bus: usize, property: impl Fn(&crate::config::Axis) -> bool) -> bool {
    config.axes.iter().any(|axis| axis.bus == bus && property(axis))
}

fn command_phase(config: &Config, bus: usize) -> Option<Remedy> {
    let (earliest_ns, latest_ns) = analyse_bus(config, bus).slot.command_phases_ns?;
    let middle = changed(config, |config| config.cycle.command_phase_ns = earliest_ns.midpoint(latest_ns));
    fits(&middle, bus).then_some(Remedy::CommandPhase { earliest_ns, latest_ns })
}

fn more_buses(config: &Config, bus: usize) -> Option<Remedy> {
    let count = config.axes.iter().filter(|axis| axis.bus == bus).count();
    (1..count).rev().find_map(|axes_per_bus| {
        let fewer = changed(config, |config| {
            let mut seen = 0;
            config.axes.retain(|axis| {
                seen += usize::from(axis.bus == bus);
                axis.bus != bus || seen <= axes_per_bus
            });
        });
        let buses = count.div_ceil(axes_per_bus);
        fits(&fewer, bus).then_some(Remedy::MoreBuses { axes_per_bus, buses })
    })
}

fn longer_period(config: &Config, bus: usize) -> Option<Remedy> {
    LONGER_PERIODS.iter().find_map(|factor| {
        let longer = changed(config, |config| {
            config.cycle.period_ns *= factor;
            config.cycle.command_phase_ns *= factor;
        });
        fits(&longer, bus).then_some(Remedy::LongerPeriod { period_ns: longer.cycle.period_ns })
    })
}
