//! What pages are shown, as JSON. Numbers are rad, rad/s, N·m (m, m/s, N), seconds and °C, unless their names say otherwise.

use std::time::{SystemTime, UNIX_EPOCH};

use serde::Serialize;
use takt_rt::{
    BusHealth, BusState, Event, EventKind, Nanoseconds, RequestTarget, Snapshot, StopReason, TimingLevel,
};

use super::pages::PageNumber;
use takt::command::AnyHandle;
use takt::telemetry::{Machine, words};
use takt::words::Words;

/// What does not change while the controller runs.
#[derive(Serialize)]
pub struct MachineView {
    name: String,
    cycle_ns: u64,
    version: &'static str,
    /// True if there is a monitor of the buses.
    has_frames: bool,
    axes: Vec<AxisDescriptionView>,
    groups: Vec<GroupDescriptionView>,
    buses: Vec<BusDescriptionView>,
}

#[derive(Serialize)]
struct AxisDescriptionView {
    name: String,
    group: usize,
    bus: Option<String>,
    family: Option<String>,
    /// `rad` or `m`
    unit: &'static str,
    position_min: f64,
    position_max: f64,
    velocity: f64,
    torque: f64,
}

#[derive(Serialize)]
struct GroupDescriptionView {
    /// Empty where all axes are one group.
    name: String,
    axes: Vec<usize>,
}

#[derive(Serialize)]
struct BusDescriptionView {
    name: String,
    interface: String,
}

impl MachineView {
    /// Of a controller.
    pub fn of(controller: &AnyHandle, has_frames: bool) -> Self {
        let machine = controller.machine();
        let axes = machine.axes.iter().enumerate().map(|(number, axis)| {
            let limits = controller.axis_properties(number).map(|axis| axis.limits);
            let limit = |of: fn(&takt_rt::AxisLimits) -> f64| limits.as_ref().map_or(f64::NAN, of);
            AxisDescriptionView {
                name: axis.name.clone(),
                group: axis.group,
                bus: axis.bus.clone(),
                family: axis.family.clone(),
                unit: axis.unit.symbol(),
                position_min: limit(|limits| limits.position_min),
                position_max: limit(|limits| limits.position_max),
                velocity: limit(|limits| limits.velocity),
                torque: limit(|limits| limits.torque),
            }
        });
        let all = || vec![GroupDescriptionView { name: String::new(), axes: controller.axis_numbers() }];
        let group = |(number, name): (u8, &String)| GroupDescriptionView {
            name: name.clone(),
            axes: controller.of(RequestTarget::Group(number)).axis_numbers(),
        };
        let bus = |bus: &takt::telemetry::BusDescription| BusDescriptionView {
            name: bus.name.clone(),
            interface: bus.interface.clone(),
        };
        Self {
            name: machine.name.clone(),
            cycle_ns: machine.cycle_ns,
            version: env!("CARGO_PKG_VERSION"),
            has_frames,
            axes: axes.collect(),
            groups: match machine.groups.is_empty() {
                true => all(),
                false => (0..).zip(&machine.groups).map(group).collect(),
            },
            buses: machine.buses.iter().map(bus).collect(),
        }
    }
}

/// The state after a cycle.
#[derive(Serialize)]
pub struct StateView {
    number: u64,
    slot: u64,
    time_ms: u64,
    missed_slots: u64,
    timing: &'static str,
    dropped: u64,
    rejected: u64,
    /// When in its slot the cycle was complete, in µs after the earliest that was seen; a sample for each state that was looked at.
    phase_us: Option<f64>,
    commander: Option<PageNumber>,
    pages: usize,
    has_ended: bool,
    groups: Vec<GroupView>,
    axes: Vec<AxisView>,
    buses: Vec<BusView>,
}

#[derive(Serialize)]
struct GroupView {
    phase: &'static str,
    remaining_s: f64,
    stop: Option<StopView>,
}

/// Why a group has stopped.
#[derive(Serialize)]
struct StopView {
    rule: &'static str,
    axis: Option<u8>,
    category: u8,
    /// True if it must be cleared.
    is_fault: bool,
    words: Words,
    cure: Option<Words>,
}

#[derive(Serialize)]
struct AxisView {
    position: f64,
    position_set: f64,
    velocity: f64,
    velocity_set: f64,
    following_error: f64,
    torque: Option<f64>,
    current_per_mille: Option<i16>,
    temperature: Option<f32>,
    mode: i8,
    mode_shown: Option<i8>,
    drive: &'static str,
    is_heard: bool,
    is_stale: bool,
    age_ms: Option<u64>,
    error: Option<ErrorView>,
}

/// The error that a drive shows.
#[derive(Serialize)]
struct ErrorView {
    code: u16,
    words: Words,
    cure: Words,
}

#[derive(Serialize)]
struct BusView {
    state: &'static str,
    load_percent: Option<f64>,
    tx_frames: u64,
    rx_frames: u64,
    tx_overruns: u64,
    rx_overruns: u64,
    errors: u64,
}

/// Makes the views of states, one after the other.
#[derive(Default)]
pub struct Viewer {
    number: u64,
    /// The cycle that was complete earliest in its slot: its slot and its time.
    earliest: Option<(u64, Nanoseconds)>,
    loads: Vec<BusLoad>,
}

/// How long a bus was busy until a time, and its load from there on.
#[derive(Clone, Copy, Default)]
struct BusLoad {
    at_ns: Nanoseconds,
    busy_ns: u64,
    percent: Option<f64>,
}

/// The load of a bus is that of so long.
const LOAD_OF_NS: Nanoseconds = 1_000_000_000;

impl BusLoad {
    fn see(&mut self, at_ns: Nanoseconds, busy_ns: u64) -> Option<f64> {
        let passed = at_ns.saturating_sub(self.at_ns);
        if self.at_ns == 0 {
            (self.at_ns, self.busy_ns) = (at_ns, busy_ns);
        } else if passed >= LOAD_OF_NS {
            let percent = 100.0 * busy_ns.saturating_sub(self.busy_ns) as f64 / passed as f64;
            *self = Self { at_ns, busy_ns, percent: Some(percent) };
        }
        self.percent
    }
}

impl Viewer {
    /// The view of a state, at this time of day.
    pub fn view(
        &mut self,
        controller: &AnyHandle,
        commander: Option<PageNumber>,
        pages: usize,
        time_ms: u64,
    ) -> StateView {
        let (state, machine) = (controller.state(), controller.machine());
        self.number += 1;
        self.loads.resize(state.buses().len(), BusLoad::default());
        let loads = self.loads.iter_mut().zip(state.buses());
        let loads: Vec<Option<f64>> = loads.map(|(load, bus)| load.see(state.at_ns, bus.busy_ns)).collect();
        StateView {
            number: self.number,
            slot: state.slot,
            time_ms,
            missed_slots: state.missed_slots,
            timing: timing(state.timing),
            dropped: state.dropped,
            rejected: state.rejected,
            phase_us: self.phase_us(&state, machine.cycle_ns),
            commander,
            pages,
            has_ended: controller.has_ended(),
            groups: state.groups().iter().map(|group| group_view(group, machine)).collect(),
            axes: (0..)
                .zip(state.axes())
                .map(|(number, axis)| axis_view(number, axis, &state, machine))
                .collect(),
            buses: state.buses().iter().zip(loads).map(|(bus, load)| bus_view(bus, load)).collect(),
        }
    }

    /// The slots stand on a grid, so that two times differ by whole slots and by how late either is.
    fn phase_us(&mut self, state: &Snapshot, cycle_ns: u64) -> Option<f64> {
        if state.at_ns == 0 {
            return None;
        }
        let (slot, at_ns) = *self.earliest.get_or_insert((state.slot, state.at_ns));
        let expected = at_ns as i128 + (i128::from(state.slot) - i128::from(slot)) * i128::from(cycle_ns);
        let late_ns = state.at_ns as i128 - expected;
        if late_ns < 0 {
            self.earliest = Some((state.slot, state.at_ns));
        }
        Some((late_ns.max(0) as f64 * 1e-3).min(1e9))
    }
}

fn group_view(group: &takt_rt::GroupSnapshot, machine: &Machine) -> GroupView {
    GroupView {
        phase: words::phase(group.phase),
        remaining_s: rounded(group.remaining_s),
        stop: group.stop.map(|stop| stop_view(&stop, machine)),
    }
}

fn stop_view(stop: &StopReason, machine: &Machine) -> StopView {
    StopView {
        rule: stop.rule().key(),
        axis: stop.axis(),
        category: stop.category as u8,
        is_fault: !stop.is_requested(),
        words: words::stop_cause(stop, machine),
        cure: words::stop_cure(stop, machine).map(Words::from),
    }
}

fn axis_view(number: u8, axis: &takt_rt::AxisSnapshot, state: &Snapshot, machine: &Machine) -> AxisView {
    let error = (axis.error_code != 0).then(|| ErrorView {
        code: axis.error_code,
        words: machine.drive_error(number, axis.error_code),
        cure: machine.drive_cure(number, axis.error_code).into(),
    });
    AxisView {
        position: rounded(axis.position),
        position_set: rounded(axis.position_set),
        velocity: rounded(axis.velocity),
        velocity_set: rounded(axis.velocity_set),
        following_error: rounded(axis.following_error),
        torque: axis.torque.map(rounded),
        current_per_mille: axis.current_per_mille,
        temperature: axis.temperature,
        mode: axis.mode_set,
        mode_shown: axis.mode,
        drive: axis.drive_state.name(),
        is_heard: axis.is_heard,
        is_stale: axis.is_stale(),
        age_ms: axis.feedback_age_ns(state.at_ns).map(|age_ns| age_ns / 1_000_000),
        error,
    }
}

/// The state of a bus as pages know it.
pub const fn bus_state(state: BusState) -> &'static str {
    match state {
        BusState::ErrorActive => "error_active",
        BusState::ErrorPassive => "error_passive",
        BusState::BusOff => "bus_off",
        BusState::Down => "down",
    }
}

fn bus_view(bus: &BusHealth, load_percent: Option<f64>) -> BusView {
    BusView {
        state: bus_state(bus.state),
        load_percent: load_percent.map(|percent| (percent * 10.0).round() / 10.0),
        tx_frames: bus.tx_frames,
        rx_frames: bus.rx_frames,
        tx_overruns: bus.tx_overruns,
        rx_overruns: bus.rx_overruns,
        errors: bus.errors,
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

/// An event, with its number, so that no page sees it twice.
#[derive(Serialize)]
pub struct EventView {
    /// It rises by one from event to event.
    pub number: u64,
    time_ms: u64,
    /// `fault`, `warning` or `info`
    level: &'static str,
    words: Words,
}

impl EventView {
    /// Of an event, at this time of day.
    pub fn of(number: u64, event: &Event, machine: &Machine, time_ms: u64) -> Self {
        let level = match event.kind {
            EventKind::Stop(stop) if !stop.is_requested() => "fault",
            EventKind::Emergency { code, .. } if code != 0 => "fault",
            EventKind::Rejected(_) | EventKind::MissedSlots { .. } | EventKind::Stop(_) => "warning",
            EventKind::Timing { level } if level != TimingLevel::Normal => "warning",
            _ => "info",
        };
        Self { number, time_ms, level, words: words::event(event, machine) }
    }

    /// What the panel itself has to say.
    pub fn said(number: u64, level: &'static str, words: Words) -> Self {
        Self { number, time_ms: time_ms(), level, words }
    }

    /// Of events that came faster than they were read.
    pub fn missed(number: u64, count: u64, time_ms: u64) -> Self {
        let words = takt::words!("{count} events were missed: they came too fast", count);
        Self { number, time_ms, level: "warning", words }
    }
}

/// The time of day, in ms since 1970.
pub fn time_ms() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_millis() as u64)
}

/// To a millionth: a page shows less.
pub fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_load_of_a_bus_is_that_of_the_last_second() {
        let mut load = BusLoad::default();
        assert_eq!(load.see(1_000, 0), None);
        assert_eq!(load.see(500_000_000, 100_000_000), None);
        assert_eq!(load.see(1_000_001_000, 250_000_000), Some(25.0));
        assert_eq!(load.see(1_500_000_000, 900_000_000), Some(25.0), "until the next second is over");
        assert_eq!(load.see(2_000_001_000, 250_000_000), Some(0.0));
    }

    #[test]
    fn a_cycle_is_as_late_as_it_is_after_the_earliest_one() {
        let mut viewer = Viewer::default();
        let mut late =
            |slot, at_ns| viewer.phase_us(&Snapshot { slot, at_ns, ..Snapshot::default() }, 1_000_000);
        assert_eq!(late(0, 0), None);
        assert_eq!(late(10, 10_400_000), Some(0.0));
        assert_eq!(late(12, 12_450_000), Some(50.0));
        assert_eq!(late(20, 20_390_000), Some(0.0), "it is the earliest now");
        assert_eq!(late(21, 21_400_000), Some(10.0));
    }
}
