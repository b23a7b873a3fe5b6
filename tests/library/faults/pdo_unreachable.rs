//! Drives that another master has made PDO-unreachable, before the run shuts the drives down.

use std::sync::Arc;

use takt::Port;
use takt::config::Config;
use takt::faults::FaultInjector;
use takt::sim::NodeState;
use takt::{Interrupt, VirtualRun};
use takt_rt::Phase;

use crate::faults::arm::{folder, scenario};

/// The machines: every way in which a drive can move when it becomes PDO-unreachable.
const MACHINES: [&str; 6] = [
    "arm6-erob",
    "erob-modes/erob-csv",
    "erob-modes/erob-cst",
    "erob-modes/erob-pv",
    "erob-modes/erob-pt",
    "gantry-yz-aim",
];
const COMMANDS: [&str; 3] = ["reset-communication", "pre-operational", "stop"];

fn machine(name: &str) -> Config {
    let mut config = Config::load(&folder().join(format!("{name}.toml"))).unwrap();
    config.axes.iter_mut().for_each(|axis| axis.power_up_ns = 5_000_000);
    config
}

fn nmt_fault(config: &Config, command: &str) -> String {
    let axis = &config.axes[0].name;
    format!(
        "[[fault]]\nkind = \"foreign-nmt\"\naxis = \"{axis}\"\ncommand = \"{command}\"\nwhen = \"moving\"\nat = \"300 ms\"\n"
    )
}

/// Runs until the fault has begun.
fn run_until_fault(config: &Config, command: &str) -> VirtualRun<Port> {
    play_until_fault(config, &nmt_fault(config, command))
}

fn play_until_fault(config: &Config, faults: &str) -> VirtualRun<Port> {
    let fault_injector = Arc::new(FaultInjector::new(scenario(faults, config)));
    let (mut run, _) = VirtualRun::with_faults(config, Arc::clone(&fault_injector)).unwrap();
    while !fault_injector.progress().any(|(_, progress)| progress.began_ns().is_some()) {
        assert!(run.step(), "{}: over before the fault", config.name);
    }
    run
}

fn first_drive(config: &Config, run: &mut VirtualRun<Port>) -> takt::sim::Observation {
    let axis = &config.axes[0];
    run.ports()[axis.bus].simulated_mut().unwrap().observe(axis.node).unwrap()
}

#[test]
fn a_pdo_unreachable_drive_is_stopped_and_disabled_by_sdo_before_the_shutdown() {
    for name in MACHINES {
        let config = machine(name);
        for command in COMMANDS {
            let mut run = run_until_fault(&config, command);
            let began_ns = run.snapshot().at_ns;
            let mut ended_ns = None;
            while run.snapshot().groups[0].phase != Phase::Disabled {
                assert!(run.step(), "{name}, {command}: never disabled");
                let drive = first_drive(&config, &mut run);
                if !drive.state.has_torque() {
                    ended_ns = ended_ns.or(Some(run.snapshot().at_ns));
                }
            }
            let of_group_ms = (run.snapshot().at_ns - began_ns) / 1_000_000;
            let of_drive_ms = ended_ns.map(|ns| (ns - began_ns) / 1_000_000);
            assert!(of_drive_ms.is_some_and(|ms| ms <= 700), "{name}, {command}: {of_drive_ms:?} ms");
            assert!(of_group_ms <= 1200, "{name}, {command}: the group waits {of_group_ms} ms");
            let speed = first_drive(&config, &mut run).velocity.abs() / config.axes[0].limits.velocity;
            assert!(speed < 0.01, "{name}, {command}: {speed} of its velocity limit");
        }
    }
}

#[test]
fn an_interrupted_run_leaves_no_pdo_unreachable_drive_enabled() {
    for name in MACHINES {
        let config = machine(name);
        for command in COMMANDS {
            let mut run = run_until_fault(&config, command);
            run.interrupt(Interrupt::Immediate);
            while run.step() {}
            let state = first_drive(&config, &mut run).state;
            assert!(!state.has_torque(), "{name}, {command}: {state:?}");
        }
    }
}

/// After its reset the drive consumes no heartbeat. While no frame gets to it, the run can only wait.
#[test]
fn a_run_waits_for_a_full_queue_before_it_leaves_a_drive_without_a_heartbeat_watchdog() {
    for name in MACHINES {
        let config = machine(name);
        let bus = &config.buses[config.axes[0].bus].name;
        let full = format!(
            "[[fault]]\nkind = \"full-queue\"\nbus = \"{bus}\"\nwhen = \"moving\"\nat = \"300 ms\"\nfor = \"400 ms\"\n"
        );
        for interrupt in [None, Some(Interrupt::Controlled), Some(Interrupt::Immediate)] {
            let mut run =
                play_until_fault(&config, &(full.clone() + &nmt_fault(&config, "reset-communication")));
            interrupt.into_iter().for_each(|interrupt| run.interrupt(interrupt));
            while run.step() {}
            let state = first_drive(&config, &mut run).state;
            assert!(!state.has_torque(), "{name}, {interrupt:?}: {state:?}");
        }
    }
}

/// The drive may be absent when the shutdown begins, and a command that is sent only once may be lost.
#[test]
fn a_drive_that_comes_back_during_the_shutdown_ends_without_torque_and_pre_operational() {
    for name in MACHINES {
        let mut config = machine(name);
        // A run waits longer for drives whose watchdogs take longer.
        config.master.heartbeat_ns = Some(100_000_000);
        config.master.heartbeat_timeout_ns = 500_000_000;
        for away_ms in [600, 900, 1200, 1500] {
            let silent = format!(
                "[[fault]]\nkind = \"silent-node\"\naxis = \"{}\"\nwhen = \"moving\"\nat = \"300 ms\"\nfor = \"{away_ms} ms\"\n",
                config.axes[0].name
            );
            let mut run = play_until_fault(&config, &silent);
            while run.step() {}
            assert_eq!(run.supervisor().unreached(), [0usize; 0], "{name}, {away_ms} ms");
            let drive = first_drive(&config, &mut run);
            assert!(!drive.state.has_torque(), "{name}, {away_ms} ms: {:?}", drive.state);
            assert_eq!(drive.nmt, NodeState::PreOperational, "{name}, {away_ms} ms");
        }
    }
}
