//! Drives that can no longer be reached, and the end of a run without them.

use std::sync::Arc;

use takt::Port;
use takt::config::Config;
use takt::faults::FaultInjector;
use takt::{Outcome, VirtualRun};
use takt_rt::{Phase, Rule};

use crate::faults::arm::{arm, scenario};

const SECOND_NS: u64 = 1_000_000_000;
const BUS_OFF: &str = "kind = \"bus-off\"\nbus = \"wrist\"";

struct Ended {
    run: VirtualRun<Port>,
    began_ns: u64,
    disabled_ns: u64,
    over_ns: u64,
}

/// Runs to the end with a fault that begins in motion.
fn ended(config: &Config, fault: &str) -> Ended {
    let text = format!("[[fault]]\n{fault}\nwhen = \"moving\"\nat = \"300 ms\"");
    let fault_injector = Arc::new(FaultInjector::new(scenario(&text, config)));
    let (mut run, _) = VirtualRun::with_faults(config, Arc::clone(&fault_injector)).unwrap();
    let mut disabled_ns = None;
    while run.step() {
        if fault_injector.progress().any(|(_, progress)| progress.began_ns().is_some())
            && run.snapshot().groups[0].phase == Phase::Disabled
        {
            disabled_ns = disabled_ns.or(Some(run.snapshot().at_ns));
        }
    }
    let began_ns = fault_injector.progress().find_map(|(_, progress)| progress.began_ns()).unwrap();
    Ended { began_ns, disabled_ns: disabled_ns.unwrap(), over_ns: run.snapshot().at_ns, run }
}

/// The axes of a bus, and whether their drives really have torque.
fn torques(config: &Config, run: &mut VirtualRun<Port>, bus: &str) -> Vec<(usize, bool)> {
    let mut torques = Vec::new();
    for (index, axis) in config.axes.iter().enumerate().filter(|(_, axis)| config.buses[axis.bus].name == bus)
    {
        let drive = run.ports()[axis.bus].simulated_mut().unwrap().observe(axis.node).unwrap();
        torques.push((index, drive.state.has_torque()));
    }
    torques
}

#[test]
fn a_run_with_unreachable_drives_ends_after_their_watchdogs_have_fired_and_names_them() {
    let config = arm();
    let mut ended = ended(&config, BUS_OFF);
    let Some(Outcome::Stopped(stop)) = ended.run.supervisor().outcome().cloned() else {
        panic!("not stopped")
    };
    assert_eq!(stop.rule(), Rule::BusLost);
    let wrist = torques(&config, &mut ended.run, "wrist");
    assert_eq!(ended.run.supervisor().unreached(), wrist.iter().map(|(axis, _)| *axis).collect::<Vec<_>>());
    for bus in ["base", "wrist"] {
        let torques = torques(&config, &mut ended.run, bus);
        assert!(torques.iter().all(|(_, has_torque)| !has_torque), "{bus}: {torques:?}");
    }
    let timeout_ns = config.master.heartbeat_timeout_ns;
    let waited_ns = ended.disabled_ns - ended.began_ns;
    assert!((timeout_ns..timeout_ns + SECOND_NS / 4).contains(&waited_ns), "{waited_ns} ns");
    // The shutdown command is sent three times.
    assert!(ended.over_ns - ended.disabled_ns < 2 * SECOND_NS);
}

#[test]
fn drives_without_a_watchdog_are_waited_for_longer() {
    let mut config = arm();
    config.master.heartbeat_ns = None;
    let ended = ended(&config, BUS_OFF);
    assert!(ended.disabled_ns - ended.began_ns > 4 * SECOND_NS);
    assert_eq!(ended.run.supervisor().unreached().len(), 3);
}

#[test]
fn a_drive_that_answers_again_at_the_end_is_not_named() {
    for fault in
        [format!("{BUS_OFF}\nrestart = \"0.3 s\""), "kind = \"over-current\"\naxis = \"joint2\"".to_owned()]
    {
        let ended = ended(&arm(), &fault);
        assert_eq!(ended.run.supervisor().unreached(), [0; 0], "{fault}");
    }
}
