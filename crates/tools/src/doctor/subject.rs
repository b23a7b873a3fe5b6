//! What the machine is to be fit for.

use crate::jitter::JitterOptions;
use takt::config::{Config, Interface, Realtime};
use takt::controller::realtime_thread::ThreadSetup;

/// The loop that is to run.
#[derive(Clone, Debug, PartialEq)]
pub struct Subject {
    /// Its period.
    pub period_ns: u64,
    /// What it asks of the operating system.
    pub realtime: Realtime,
    /// The CPU that it runs on.
    pub cpu: usize,
    /// The interfaces that it needs; empty without a configuration: those there are count then.
    pub buses: Vec<WantedBus>,
    /// True if there is a configuration.
    pub is_configured: bool,
}

/// An interface that the loop needs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WantedBus {
    /// Its name.
    pub interface: String,
    /// Bit/s of classic frames and of the arbitration phase.
    pub bit_rate: u32,
    /// Bit/s of the data phase of CAN FD frames.
    pub data_bit_rate: Option<u32>,
    /// How long (ms) after bus-off the controller is to come back; 0 for never.
    pub restart_ms: u32,
}

impl Subject {
    /// The loop of a configuration, or else the one that a configuration has when it says nothing.
    pub fn new(config: Option<&Config>) -> Self {
        let usual = JitterOptions::default();
        let realtime = config.map_or(usual.realtime, |config| config.realtime);
        let wanted = |bus: &takt::config::Bus| match &bus.interface {
            Interface::SocketCan(interface) => Some(WantedBus {
                interface: interface.clone(),
                bit_rate: bus.bit_rate,
                data_bit_rate: bus.data_bit_rate,
                restart_ms: bus.restart_ms,
            }),
            _ => None,
        };
        Self {
            period_ns: config.map_or(usual.period_ns, |config| config.cycle.period_ns),
            cpu: ThreadSetup::of(&realtime).cpu.unwrap_or(0),
            realtime,
            buses: config.iter().flat_map(|config| &config.buses).filter_map(wanted).collect(),
            is_configured: config.is_some(),
        }
    }
}
