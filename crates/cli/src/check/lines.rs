//! The serial lines of a configuration: how often each of their drives is spoken to.

use serde::Serialize;

use super::super::table::Table;
use takt::config::{Config, Interface};
use takt::family;
use takt::link::adapter_latency_ns;

/// A serial line.
#[derive(Clone, PartialEq, Serialize)]
pub struct LineCheck {
    name: String,
    interface: String,
    /// bit/s
    bit_rate: u32,
    /// The axes on it, which share it by turns.
    axes: Vec<String>,
    /// So long the adapter holds received bytes back; `None` where that is not known, or where it does not.
    adapter_latency_ns: Option<u64>,
    /// From one set-point, and one report, of each axis to the next, at the longest.
    round_ns: u64,
    /// The period in which a report of every axis is expected.
    period_ns: u64,
    /// So much of the time bytes are on it.
    load_percent: f64,
    /// So long after its last request a drive stops by itself, the longest of the line; `None` if one never does.
    watchdog_ns: Option<u64>,
}

impl LineCheck {
    /// Every serial line, in the order of the configuration.
    pub fn all(config: &Config) -> Vec<Self> {
        (0..config.buses.len()).filter_map(|bus| Self::of(config, bus)).collect()
    }

    fn of(config: &Config, bus: usize) -> Option<Self> {
        let settings = config.buses.get(bus).filter(|_| config.is_serial_line(bus))?;
        let budgets: Vec<_> = config
            .axes_of_bus(bus)
            .filter_map(|axis| family::of(&axis.drive).off_cycle_budget(axis, config))
            .collect();
        let adapter_latency_ns = match &settings.interface {
            Interface::Serial(device) => adapter_latency_ns(&device.device),
            _ => None,
        };
        let timeout_ns = |axis| family::stops_by_itself_after(axis, config).ok()?.timeout_ns;
        let watchdogs: Option<Vec<u64>> = config.axes_of_bus(bus).map(timeout_ns).collect();
        Some(Self {
            name: settings.name.clone(),
            interface: settings.interface.to_string(),
            bit_rate: settings.bit_rate,
            axes: config.axes_of_bus(bus).map(|axis| axis.name.clone()).collect(),
            adapter_latency_ns,
            round_ns: family::line_report_ns(config, bus).unwrap_or(0),
            period_ns: config.bus_cycle(bus).period_ns,
            load_percent: 100.0 * budgets.iter().map(|budget| budget.bus_share).sum::<f64>(),
            watchdog_ns: watchdogs.and_then(|watchdogs| watchdogs.into_iter().max()),
        })
    }
}

/// The lines as a table; `None` if there are none.
pub fn table(lines: &[LineCheck]) -> Option<Table> {
    let (first, rest) = lines.split_first()?;
    let mut table = Table::new([
        "line",
        "interface",
        ">bit/s",
        "axes by turns",
        ">adapter",
        ">set-point and report every",
        ">report due in",
        ">load",
        ">drive's time-out",
    ]);
    let milliseconds = |ns: u64| format!("{:.1} ms", ns as f64 / 1e6);
    for line in [first].into_iter().chain(rest) {
        table.row([
            line.name.clone(),
            line.interface.clone(),
            line.bit_rate.to_string(),
            line.axes.join(", "),
            line.adapter_latency_ns.map_or("-".to_owned(), milliseconds),
            milliseconds(line.round_ns),
            milliseconds(line.period_ns),
            format!("{:.1} %", line.load_percent),
            line.watchdog_ns.map_or("none".to_owned(), milliseconds),
        ]);
    }
    Some(table)
}
