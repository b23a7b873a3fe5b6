//! `takt run --metrics`: what a run counts, for Prometheus.
//!
//! The logger's thread counts, the session's thread shows the state ten times a second, and the thread of [`takt_panel::MetricsServer`]
//! answers. None of them is real-time, and an answer is made of a copy.

mod text;

use std::collections::BTreeMap;
use std::net::{SocketAddr, ToSocketAddrs};
use std::sync::{Mutex, MutexGuard, PoisonError};

use takt_rt::{
    BusState, CycleRecord, DriveState, Event, EventKind, Phase, Snapshot, StopCategory, TimingLevel,
};

use takt::telemetry::{BusReport, LoopTiming, Machine, Unit, words};
use text::{Exposition, Kind, seconds};

/// The port of exporters of OpenTelemetry, where an address has none.
const PORT: u16 = 9464;

/// An address of a command line: `9464` and `:9464` are of this computer alone.
pub fn address(text: &str) -> Result<SocketAddr, String> {
    let wrong = || {
        format!("an address is HOST:PORT or a port of this computer alone, as in 127.0.0.1:{PORT} or {PORT}")
    };
    if let Ok(port) = text.trim_start_matches(':').parse::<u16>() {
        return Ok(SocketAddr::from(([127, 0, 0, 1], port)));
    }
    let mut found = text.to_socket_addrs().map_err(|_| wrong())?;
    found.next().ok_or_else(wrong)
}

/// What is counted of a run.
pub struct Metrics {
    machine: Machine,
    counts: Mutex<Counts>,
}

#[derive(Clone)]
struct Counts {
    timing: LoopTiming,
    cycles: u64,
    state: Snapshot,
    /// The largest magnitude of the following error of each axis while it was enabled, in rad (m).
    following_error_max: Vec<f64>,
    /// Stops by group, rule and category.
    stops: BTreeMap<(u8, &'static str, u8), u64>,
    /// Emergency messages by axis and code.
    emergencies: BTreeMap<(u8, u16), u64>,
}

impl Metrics {
    /// Nothing is counted yet.
    pub fn new(machine: Machine) -> Self {
        let counts = Counts {
            timing: LoopTiming::default(),
            cycles: 0,
            state: Snapshot::default(),
            following_error_max: vec![0.0; machine.axes.len()],
            stops: BTreeMap::new(),
            emergencies: BTreeMap::new(),
        };
        Self { machine, counts: Mutex::new(counts) }
    }

    fn counts(&self) -> MutexGuard<'_, Counts> {
        // A panic of another holder of the lock leaves numbers.
        self.counts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A cycle is over.
    pub fn cycle(&self, record: &CycleRecord) {
        let mut counts = self.counts();
        counts.timing.add(&record.timing);
        counts.cycles += 1;
        for ((largest, axis), description) in
            counts.following_error_max.iter_mut().zip(record.axes()).zip(&self.machine.axes)
        {
            let phase = record.groups().get(description.group).map_or(Phase::Passive, |group| group.phase);
            let is_enabled =
                matches!(phase, Phase::Holding | Phase::Moving | Phase::Streaming | Phase::Stopping);
            if is_enabled {
                // The larger one, also where the error is no number.
                *largest = largest.max(axis.following_error.abs().into());
            }
        }
    }

    /// Something has happened.
    pub fn event(&self, event: &Event) {
        let mut counts = self.counts();
        match event.kind {
            EventKind::Stop(stop) => {
                let key = (event.group.unwrap_or(0), words::rule_key(stop.rule()), category(stop.category));
                *counts.stops.entry(key).or_insert(0) += 1;
            }
            EventKind::Emergency { axis, code, .. } if code != 0 => {
                *counts.emergencies.entry((axis, code)).or_insert(0) += 1;
            }
            _ => {}
        }
    }

    /// The state is this.
    pub fn state(&self, state: &Snapshot) {
        self.counts().state = *state;
    }

    /// All of it, as Prometheus reads it.
    pub fn text(&self) -> String {
        let counts = self.counts().clone();
        let mut text = Exposition::default();
        of_loop(&mut text, &self.machine, &counts);
        self.of_groups(&mut text, &counts);
        self.of_axes(&mut text, &counts);
        self.of_buses(&mut text, &counts);
        text.into_text()
    }

    fn of_groups(&self, text: &mut Exposition, counts: &Counts) {
        let mut family =
            text.family("takt_group_state", Kind::Gauge, "1 for the phase that the group is in.");
        for (number, group) in (0u8..).zip(counts.state.groups()) {
            let name = self.group(number);
            family.states(
                &[("group", &name)],
                Phase::ALL.into_iter().map(words::phase),
                words::phase(group.phase),
            );
        }
        let mut family = text.family(
            "takt_stops_total",
            Kind::Counter,
            "Stops, by the rule that was broken and the category of IEC 60204-1.",
        );
        for ((group, rule, category), count) in &counts.stops {
            let (name, category) = (self.group(*group), category.to_string());
            family.sample(&[("group", &name), ("rule", rule), ("category", &category)], count);
        }
    }

    /// The name of a group; of the only one, that of the machine.
    fn group(&self, number: u8) -> String {
        if self.machine.groups.is_empty() {
            self.machine.name.clone()
        } else {
            self.machine.group_name(number)
        }
    }

    fn of_axes(&self, text: &mut Exposition, counts: &Counts) {
        let axes: Vec<_> = self.machine.axes.iter().zip(counts.state.axes()).collect();
        let mut family =
            text.family("takt_drive_state", Kind::Gauge, "1 for the state of CiA 402 that the drive shows.");
        for (axis, state) in &axes {
            let states = DriveState::ALL.into_iter().map(DriveState::name);
            family.states(&[("axis", &axis.name)], states, state.drive_state.name());
        }
        let mut family = text.family("takt_axis_position", Kind::Gauge, "Actual position, in rad or m.");
        for (axis, state) in axes.iter().filter(|(_, state)| state.is_heard) {
            family.sample(&[("axis", &axis.name), ("unit", axis.unit.symbol())], state.position);
        }
        let mut family = text.family(
            "takt_axis_following_error",
            Kind::Gauge,
            "Distance between set-point and reported position, in rad or m.",
        );
        for (axis, state) in
            axes.iter().filter(|(_, state)| state.is_heard && state.following_error.is_finite())
        {
            family.sample(&[("axis", &axis.name), ("unit", axis.unit.symbol())], state.following_error);
        }
        let mut family = text.family(
            "takt_axis_following_error_max",
            Kind::Gauge,
            "Largest magnitude of the following error since the start, while enabled, in rad or m.",
        );
        for (axis, largest) in self.machine.axes.iter().zip(&counts.following_error_max) {
            family.sample(&[("axis", &axis.name), ("unit", axis.unit.symbol())], largest);
        }
        let mut family =
            text.family("takt_axis_torque", Kind::Gauge, "Torque that the drive reports, in Nm or N.");
        for (axis, state) in &axes {
            let unit = if axis.unit == Unit::Radian { "Nm" } else { "N" };
            if let Some(torque) = state.torque {
                family.sample(&[("axis", &axis.name), ("unit", unit)], torque);
            }
        }
        let mut family =
            text.family("takt_axis_temperature_celsius", Kind::Gauge, "Temperature that the drive reports.");
        for (axis, state) in &axes {
            if let Some(celsius) = state.temperature {
                family.sample(&[("axis", &axis.name)], celsius);
            }
        }
        let mut family = text.family(
            "takt_axis_feedback_age_seconds",
            Kind::Gauge,
            "How old the last report of the drive is, at the last look.",
        );
        for (axis, state) in &axes {
            if let Some(age_ns) = state.feedback_age_ns(counts.state.at_ns) {
                family.sample(&[("axis", &axis.name)], seconds(age_ns));
            }
        }
        let mut family = text.family(
            "takt_emergencies_total",
            Kind::Counter,
            "Emergency messages of drives (CiA 301), by error code.",
        );
        for ((axis, code), count) in &counts.emergencies {
            let (axis, code) = (self.machine.axis_name(*axis), format!("0x{code:04X}"));
            family.sample(&[("axis", &axis), ("code", &code)], count);
        }
    }

    fn of_buses(&self, text: &mut Exposition, counts: &Counts) {
        let buses: Vec<_> = self.machine.buses.iter().zip(counts.state.buses()).collect();
        let mut family =
            text.family("takt_bus_state", Kind::Gauge, "1 for the fault confinement state of the bus.");
        let states = [BusState::ErrorActive, BusState::ErrorPassive, BusState::BusOff, BusState::Down];
        for (bus, health) in &buses {
            let labels = [("bus", bus.name.as_str()), ("interface", bus.interface.as_str())];
            let states = states.into_iter().map(BusReport::state_words);
            family.states(&labels, states, BusReport::state_words(health.state));
        }
        let mut family = text.family(
            "takt_bus_busy_seconds_total",
            Kind::Counter,
            "How long the wire was occupied; its rate is the load of the bus.",
        );
        for (bus, health) in &buses {
            family.sample(&[("bus", &bus.name)], seconds(health.busy_ns));
        }
        let mut family =
            text.family("takt_bus_frames_total", Kind::Counter, "Frames sent (tx) and received (rx).");
        for (bus, health) in &buses {
            family.sample(&[("bus", &bus.name), ("direction", "tx")], health.tx_frames);
            family.sample(&[("bus", &bus.name), ("direction", "rx")], health.rx_frames);
        }
        let mut family = text.family("takt_bus_errors_total", Kind::Counter, "Error frames and bus errors.");
        for (bus, health) in &buses {
            family.sample(&[("bus", &bus.name)], health.errors);
        }
        let mut family = text.family(
            "takt_bus_overruns_total",
            Kind::Counter,
            "Frames that found no room to be sent (tx), or were lost before they were read (rx).",
        );
        for (bus, health) in &buses {
            family.sample(&[("bus", &bus.name), ("direction", "tx")], health.tx_overruns);
            family.sample(&[("bus", &bus.name), ("direction", "rx")], health.rx_overruns);
        }
    }
}

fn of_loop(text: &mut Exposition, machine: &Machine, counts: &Counts) {
    let labels = [("version", env!("CARGO_PKG_VERSION")), ("machine", machine.name.as_str())];
    text.family("takt_info", Kind::Gauge, "The program and the machine that it controls.").sample(&labels, 1);
    text.family("takt_cycle_period_seconds", Kind::Gauge, "Period of the cycle.")
        .sample(&[], seconds(machine.cycle_ns));
    text.family("takt_cycles_total", Kind::Counter, "Cycles whose records reached the logger.")
        .sample(&[], counts.cycles);
    text.family(
        "takt_missed_slots_total",
        Kind::Counter,
        "Slots that passed unused because the thread was late.",
    )
    .sample(&[], counts.state.missed_slots);
    let levels = [TimingLevel::Normal, TimingLevel::Warning, TimingLevel::Degraded, TimingLevel::Unfit];
    text.family("takt_timing_state", Kind::Gauge, "1 for how late the controller has been of late.").states(
        &[],
        levels.into_iter().map(timing),
        timing(counts.state.timing),
    );
    let LoopTiming { wake, sync, compute } = &counts.timing;
    text.histogram("takt_wake_seconds", "How late the timer woke the real-time thread.", wake);
    text.histogram("takt_sync_release_seconds", "How late SYNC was handed over, against the grid.", sync);
    text.histogram(
        "takt_compute_seconds",
        "Computing time from feedback to set-points, without I/O.",
        compute,
    );
    text.family(
        "takt_telemetry_dropped_total",
        Kind::Counter,
        "Cycle records and events that found no room.",
    )
    .sample(&[], counts.state.dropped);
    text.family(
        "takt_requests_rejected_total",
        Kind::Counter,
        "Requests that were rejected and changed nothing.",
    )
    .sample(&[], counts.state.rejected);
}

const fn category(category: StopCategory) -> u8 {
    match category {
        StopCategory::Zero => 0,
        StopCategory::One => 1,
        StopCategory::Two => 2,
    }
}

const fn timing(level: TimingLevel) -> &'static str {
    match level {
        TimingLevel::Normal => "normal",
        TimingLevel::Warning => "warning",
        TimingLevel::Degraded => "degraded",
        TimingLevel::Unfit => "unfit",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_without_a_host_is_of_this_computer_alone() {
        let loopback = Ok(SocketAddr::from(([127, 0, 0, 1], 9464)));
        assert_eq!(address("9464"), loopback);
        assert_eq!(address(":9464"), loopback);
        assert_eq!(address("127.0.0.1:9464"), loopback);
        assert_eq!(address("0.0.0.0:1").map(|address| address.ip().is_loopback()), Ok(false));
        assert_eq!(address("[::1]:5").map(|address| address.port()), Ok(5));
        for wrong in ["", "127.0.0.1", "99999", "a b:1"] {
            assert!(address(wrong).is_err_and(|words| words.contains("HOST:PORT")), "{wrong}");
        }
    }
}
