//! The six-axis arm with a scenario, in virtual time.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use takt::Port;
use takt::config::{Axis, Config, Feedback};
use takt::faults::{FaultEvents, FaultInjector, Scenario};
use takt::sim::Observation;
use takt::{Outcome, VirtualRun};
use takt_rt::{AxisSnapshot, DriveState, EventKind, Phase, StopReason};

/// Timeout: a minute is longer than the shortened program and every stage of its end.
const CYCLES_AT_MOST: u64 = 60_000;

pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs")
}

/// The example with two of its moves, fast-booting drives, and the mode of operation in the feedback.
pub fn arm() -> Config {
    let mut config = Config::load(&folder().join("arm6-erob.toml")).unwrap();
    config.program.moves.truncate(2);
    config.axes.iter_mut().for_each(|axis| {
        axis.power_up_ns = 5_000_000;
        axis.feedback = vec![Feedback::OperationMode];
    });
    config
}

pub fn scenario(text: &str, config: &Config) -> Scenario {
    Scenario::parse("scenario", text, config).unwrap_or_else(|error| {
        let problems: Vec<String> = error.problems().iter().map(ToString::to_string).collect();
        panic!("{text}: {problems:?}")
    })
}

/// The results of a run.
#[derive(Debug)]
pub struct Played {
    pub outcome: Option<Outcome>,
    /// Every phase of the group, in order.
    pub phases: Vec<Phase>,
    pub stops: Vec<StopReason>,
    /// Emergency messages: the axis and the code.
    pub emergencies: Vec<(u8, u16)>,
    pub missed_slots: u64,
    pub events: Vec<String>,
    /// The affected frames of each fault.
    pub frames: Vec<u64>,
    /// A hash of everything that the cycle recorded.
    pub fingerprint: u64,
    /// The largest step of any set-point between two cycles in which the drive was really enabled, in velocity limits
    /// of its axis.
    pub largest_step: f64,
    /// The largest true acceleration of each joint between two cycles, in acceleration limits of its axis.
    pub accelerations: Vec<f64>,
    /// Time from the beginning of the last fault to the command phase in which the first stop began.
    pub detection_ms: Option<f64>,
    /// The last state of each bus.
    pub health: Vec<takt_rt::BusHealth>,
    /// The true speed of the fastest joint at the end of the run.
    pub speed_at_end: f64,
}

pub fn play(config: &Config, text: &str) -> Played {
    play_scenario(config, scenario(text, config))
}

pub fn play_scenario(config: &Config, scenario: Scenario) -> Played {
    let fault_injector = Arc::new(FaultInjector::new(scenario));
    let (mut run, mut log) = VirtualRun::with_faults(config, Arc::clone(&fault_injector)).unwrap();
    let mut fault_events = FaultEvents::default();
    let mut hasher = DefaultHasher::new();
    let (mut phases, mut stops, mut emergencies, mut events) = (vec![], vec![], vec![], vec![]);
    let mut last: Vec<Option<f64>> = vec![None; config.axes.len()];
    let mut largest_step = 0.0_f64;
    let mut velocities = vec![0.0; config.axes.len()];
    let mut accelerations = vec![0.0_f64; config.axes.len()];
    let outcome = run.run(CYCLES_AT_MOST, |run| {
        while log
            .next_record(|record| format!("{:?}{:?}", record.timing, record.axes()).hash(&mut hasher))
            .is_some()
        {}
        while let Some(event) = log.take_event() {
            match event.kind {
                EventKind::Stop(stop) => stops.push(stop),
                EventKind::Emergency { axis, code, .. } => emergencies.push((axis, code)),
                _ => {}
            }
        }
        events.extend(fault_events.next(&fault_injector).iter().map(ToString::to_string));
        let snapshot = run.snapshot();
        if phases.last() != Some(&snapshot.groups[0].phase) {
            phases.push(snapshot.groups[0].phase);
        }
        let now = enabled_set_points(config, run);
        let period_s = config.cycle.period_ns as f64 * 1e-9;
        for ((now, last), axis) in now.iter().zip(&last).zip(&config.axes) {
            if let (Some(now), Some(last)) = (now, last) {
                largest_step = largest_step.max((now - last).abs() / period_s / axis.limits.velocity);
            }
        }
        last = now;
        for (index, axis) in config.axes.iter().enumerate() {
            let velocity = truth(run, axis).velocity;
            let acceleration = (velocity - velocities[index]).abs() / period_s / axis.limits.acceleration;
            accelerations[index] = accelerations[index].max(acceleration);
            velocities[index] = velocity;
        }
    });
    let snapshot = run.snapshot();
    let began_ns = fault_injector.progress().filter_map(|(_, progress)| progress.began_ns()).max();
    let stopped_ns = stops
        .first()
        .map(|stop: &StopReason| (stop.slot + 1) * config.cycle.period_ns + config.cycle.command_phase_ns);
    Played {
        outcome,
        phases,
        stops,
        emergencies,
        missed_slots: snapshot.missed_slots,
        events,
        frames: fault_injector.progress().map(|(_, progress)| progress.frames()).collect(),
        fingerprint: hasher.finish(),
        largest_step,
        accelerations,
        detection_ms: began_ns
            .zip(stopped_ns)
            .map(|(began_ns, stopped_ns)| (stopped_ns as f64 - began_ns as f64) * 1e-6),
        health: snapshot.buses[..config.buses.len()].to_vec(),
        speed_at_end: config.axes.iter().map(|axis| truth(&mut run, axis).velocity.abs()).fold(0.0, f64::max),
    }
}

/// The set-points of the drives that are really enabled.
fn enabled_set_points(config: &Config, run: &mut VirtualRun<Port>) -> Vec<Option<f64>> {
    let snapshot = run.snapshot();
    let of = |(axis, shown): (&Axis, &AxisSnapshot)| {
        let is_enabled = truth(run, axis).state == DriveState::OperationEnabled;
        is_enabled.then_some(shown.position_set)
    };
    config.axes.iter().zip(&snapshot.axes).map(of).collect()
}

/// The true state of the drive of an axis.
fn truth(run: &mut VirtualRun<Port>, axis: &Axis) -> Observation {
    match run.line(axis.bus) {
        Some(line) => line.lock().observe(axis.node).unwrap(),
        None => run.ports()[axis.bus].simulated_mut().unwrap().observe(axis.node).unwrap(),
    }
}
