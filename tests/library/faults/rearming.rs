//! Recovery after a fault: reset and enable.

use std::sync::Arc;

use takt::Port;
use takt::VirtualRun;
use takt::config::Config;
use takt::controller::AfterBringUp;
use takt::faults::FaultInjector;
use takt_rt::{Fault, Phase, Request, Rule, StopCause, StopReason};

use crate::faults::arm::{arm, folder, scenario};

const CYCLES_AT_MOST: usize = 20_000;

/// An enabled group without a program, with this fault of its first axis.
fn faulted(config: &Config, kind: &str) -> VirtualRun<Port> {
    let axis = &config.axes[0].name;
    let fault =
        format!("[[fault]]\nkind = \"{kind}\"\naxis = \"{axis}\"\nwhen = \"enabled\"\nat = \"100 ms\"\n");
    let fault_injector = Arc::new(FaultInjector::new(scenario(&fault, config)));
    let simulated = |bus| Port::Simulated(Box::new(takt::simulated_bus(config, bus)));
    let ports = (0..config.buses.len()).map(|bus| fault_injector.wrap(bus, simulated(bus))).collect();
    let (mut run, _) = VirtualRun::serving(config, ports, AfterBringUp::Enable).unwrap();
    run_until(&mut run, |run| {
        fault_injector.observe(&run.snapshot());
        latched(run).is_some() && run.snapshot().groups[0].phase == Phase::Disabled
    });
    run
}

fn run_until(run: &mut VirtualRun<Port>, is_there: impl Fn(&VirtualRun<Port>) -> bool) {
    for _ in 0..CYCLES_AT_MOST {
        if is_there(run) {
            return;
        }
        assert!(run.step(), "the run has ended");
    }
    panic!("still {:?}", run.snapshot());
}

fn latched(run: &VirtualRun<Port>) -> Option<StopReason> {
    run.snapshot().groups[0].stop.filter(|stop| stop.rule() != Rule::Requested)
}

fn machines() -> [Config; 2] {
    let mut gantry = Config::load(&folder().join("gantry-yz-aim.toml")).unwrap();
    gantry.axes.iter_mut().for_each(|axis| axis.power_up_ns = 5_000_000);
    [arm(), gantry]
}

#[test]
fn a_group_that_is_reset_and_enabled_at_once_holds_again() {
    for config in machines() {
        let mut run = faulted(&config, "over-voltage");
        // A YZ-AIM cannot be reset before the over-voltage is over.
        (0..200).for_each(|_| assert!(run.step()));
        run.host().request(Request::ResetFaults).unwrap();
        run.host().request(Request::Enable).unwrap();
        run_until(&mut run, |run| run.snapshot().groups[0].phase == Phase::Holding);
        assert_eq!(latched(&run), None, "{}", config.name);
    }
}

#[test]
fn a_fault_that_a_reset_does_not_clear_stops_the_group_again_with_its_code() {
    let config = arm();
    let mut run = faulted(&config, "battery");
    let first = latched(&run).unwrap();
    run.host().request(Request::ResetFaults).unwrap();
    run.host().request(Request::Enable).unwrap();
    run_until(&mut run, |run| run.snapshot().groups[0].phase == Phase::Enabling);
    run_until(&mut run, |run| run.snapshot().groups[0].phase == Phase::Disabled);
    let again = latched(&run).unwrap();
    assert_eq!((again.rule(), again.axis()), (Rule::DriveFault, Some(0)));
    let fault = StopCause::Fault(Fault::DriveFault { error_code: 0x730F });
    assert_eq!((again.cause, first.cause), (fault, fault));
}
