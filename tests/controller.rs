//! The whole controller against the simulated arm, in virtual time.

use std::path::Path;

use takt::config::{Config, Control};
use takt::controller::{Interrupt, Outcome, VirtualRun};
use takt::sim::SimulatedBus;
use takt_rt::cia402::State;
use takt_rt::stop::Phase;

/// A minute is more than any of these programs takes.
const CYCLES_AT_MOST: u64 = 60_000;

fn load(name: &str) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name);
    Config::load(&path).unwrap_or_else(|error| panic!("{name}: {error:?}"))
}

fn start(config: &Config) -> VirtualRun<SimulatedBus> {
    VirtualRun::simulated(config).unwrap().0
}

/// How far each axis is from the last target when the group holds for the last time, in counts.
fn run_and_measure(config: &Config) -> Vec<f64> {
    let mut run = start(config);
    let mut errors = vec![];
    let outcome = run.run(CYCLES_AT_MOST, |run| {
        let snapshot = run.snapshot();
        if let (Phase::Holding, Some(target)) = (snapshot.phase, run.supervisor().target()) {
            errors = target
                .iter()
                .zip(&snapshot.axes)
                .zip(&config.axes)
                .map(|((target, axis), config)| {
                    (axis.position - target) * config.counts_per_turn * config.gear_ratio
                        / std::f64::consts::TAU
                })
                .collect();
        }
    });
    assert_eq!(outcome, Some(Outcome::Finished));
    assert_eq!(run.snapshot().missed_slots, 0);
    errors
}

#[test]
fn the_six_axis_arm_runs_its_program_and_every_axis_ends_within_two_counts() {
    let errors = run_and_measure(&load("arm6-erob.toml"));
    assert_eq!(errors.len(), 6);
    assert!(errors.iter().all(|error| error.abs() <= 2.0), "{errors:?}");
}

#[test]
fn the_same_program_runs_in_cyclic_synchronous_velocity() {
    let errors = run_and_measure(&load("arm6-erob-csv.toml"));
    assert!(errors.iter().all(|error| error.abs() <= 2.0), "{errors:?}");
}

/// A PD loop without an integral ends where its stiffness holds the joint's Coulomb friction.
#[test]
fn the_same_program_runs_in_cyclic_synchronous_torque() {
    let config = load("arm6-erob-cst.toml");
    let errors = run_and_measure(&config);
    for (error, axis) in errors.iter().zip(&config.axes) {
        let Control::Torque { stiffness, .. } = axis.control else { panic!("{} is not in CST", axis.name) };
        let bound =
            axis.simulated.coulomb_friction / stiffness * axis.counts_per_turn / std::f64::consts::TAU;
        assert!(error.abs() <= bound + 2.0, "{}: {error} counts, at most {bound} are friction", axis.name);
    }
}

#[test]
fn thirty_two_axes_run_on_eleven_buses() {
    let errors = run_and_measure(&load("axes32-erob.toml"));
    assert_eq!(errors.len(), 32);
    assert!(errors.iter().all(|error| error.abs() <= 2.0), "{errors:?}");
}

#[test]
fn after_a_run_every_drive_is_disabled_and_at_rest() {
    let config = load("arm6-erob.toml");
    let mut run = start(&config);
    run.run(CYCLES_AT_MOST, |_| {});
    for (axis, shown) in config.axes.iter().zip(run.snapshot().axes) {
        assert!(!State::decode(shown.statusword).has_torque(), "{}", axis.name);
    }
}

#[test]
fn ctrl_c_in_the_middle_stops_in_control_and_disables() {
    let config = load("arm6-erob.toml");
    let mut run = start(&config);
    while run.snapshot().phase != Phase::Moving {
        assert!(run.step());
    }
    run.run(300, |_| {});
    run.interrupt(Interrupt::Controlled);
    let mut phases = vec![];
    let outcome = run.run(CYCLES_AT_MOST, |run| {
        let phase = run.snapshot().phase;
        if phases.last() != Some(&phase) {
            phases.push(phase);
        }
    });
    assert_eq!(outcome, Some(Outcome::Interrupted));
    assert_eq!(phases, [Phase::Moving, Phase::Stopping, Phase::Holding, Phase::Disabling, Phase::Disabled]);
}

#[test]
fn a_second_ctrl_c_takes_the_power_at_once() {
    let config = load("arm6-erob.toml");
    let mut run = start(&config);
    while run.snapshot().phase != Phase::Moving {
        assert!(run.step());
    }
    run.run(300, |_| {});
    run.interrupt(Interrupt::Controlled);
    run.run(5, |_| {});
    run.interrupt(Interrupt::Immediate);
    let outcome = run.run(200, |_| {});
    assert_eq!(outcome, Some(Outcome::Interrupted));
}
