//! The measurements as data: the output of `takt jitter --json`.

use serde::Serialize;
use takt_rt::BusHealth;

use super::measurement::{JitterOptions, Measurement, Pacing};
use takt::telemetry::{LatencyReport, RealtimeReport};

/// A whole measurement.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JitterReport {
    /// Period of the cycle.
    pub cycle_ns: u64,
    /// Cycles asked for, for each kind of pacing.
    pub cycles: u64,
    /// True if all of them are there.
    pub is_whole: bool,
    /// The interface that SYNC was sent to.
    pub bus: Option<String>,
    /// What the operating system granted.
    pub realtime: RealtimeReport,
    /// One entry for each kind of pacing, in the order of measurement.
    pub passes: Vec<PassReport>,
}

/// The measurement of one kind of pacing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PassReport {
    /// `sleep` or `sleep_then_spin`.
    pub pacing: &'static str,
    /// How long before a deadline the thread stopped sleeping and spun.
    pub spin_guard_ns: u64,
    /// Cycles that ran.
    pub cycles: u64,
    /// Slots that passed unused because the thread was late.
    pub missed_slots: u64,
    /// Cycles that ran and are not in the distributions: the reader of the records was late.
    pub records_dropped: u64,
    /// Page faults of the loop.
    pub page_faults: u64,
    /// How late the timer woke the thread.
    pub wake_ns: LatencyReport,
    /// SYNC release error: how late SYNC was handed over, or would have been, against the grid.
    pub sync_ns: LatencyReport,
    /// SYNC frames that were seen on the wire; `None` without a bus.
    pub sync_sent: Option<u64>,
    /// Frames that the interface had no room for; `None` without a bus.
    pub tx_overruns: Option<u64>,
    /// Error frames and bus errors; `None` without a bus.
    pub bus_errors: Option<u64>,
}

impl JitterReport {
    /// Puts together what was measured with the same options. `None` when there is no measurement.
    pub fn new(options: &JitterOptions, measurements: &[Measurement]) -> Option<Self> {
        let last = measurements.last()?;
        let page_faults = measurements.iter().map(|measurement| measurement.page_faults).sum();
        Some(Self {
            cycle_ns: options.period_ns,
            cycles: options.cycles,
            is_whole: measurements.iter().all(|measurement| measurement.is_whole),
            bus: options.interface.as_ref().map(ToString::to_string),
            realtime: RealtimeReport::new(&last.begun.report, last.spin_guard_ns, page_faults),
            passes: measurements.iter().map(PassReport::new).collect(),
        })
    }
}

impl PassReport {
    /// Puts one measurement in numbers.
    pub fn new(measurement: &Measurement) -> Self {
        let statistics = &measurement.statistics;
        let of_bus = |count: fn(&BusHealth) -> u64| measurement.bus.as_ref().map(count);
        Self {
            pacing: match measurement.pacing {
                Pacing::Sleep => "sleep",
                Pacing::SleepThenSpin => "sleep_then_spin",
            },
            spin_guard_ns: measurement.spin_guard_ns,
            cycles: statistics.cycles + measurement.records_dropped,
            missed_slots: statistics.missed_slots,
            records_dropped: measurement.records_dropped,
            page_faults: measurement.page_faults,
            wake_ns: LatencyReport::new(&statistics.wake),
            sync_ns: LatencyReport::new(&statistics.sync),
            sync_sent: of_bus(|bus| bus.tx_frames),
            tx_overruns: of_bus(|bus| bus.tx_overruns),
            bus_errors: of_bus(|bus| bus.errors),
        }
    }
}
