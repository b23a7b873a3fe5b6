//! From a call of a handle to the wire, in cycles: counted in virtual time, where nothing else is late. `bindings/c/tests/c_api/latency.rs` and
//! `bindings/python/tests/test_latency.py` count the same of the other fronts.

use std::path::Path;
use std::time::Duration;

use takt::{Config, Phase, Snapshot, StopCategory, VirtualController};

const MILLISECOND_NS: u64 = 1_000_000;

fn simulated() -> VirtualController {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/first.toml");
    VirtualController::start(&Config::load(&path).unwrap(), None).unwrap()
}

/// Runs cycles until the state after one of them shows what was asked for, and counts them. The set-points of a state are those that its
/// cycle has sent.
fn cycles_until(arm: &VirtualController, is_there: impl Fn(&Snapshot) -> bool) -> u64 {
    let cycles = (1..1000).find(|_| arm.step(1) == 1 && is_there(&arm.state()));
    cycles.expect("it comes within a second")
}

fn is_moving(state: &Snapshot) -> bool {
    state.axes()[0].velocity_set != 0.0
}

#[test]
fn a_move_and_a_stop_are_on_the_wire_in_the_next_cycle() {
    let arm = simulated();
    arm.move_to(&[0.5]).unwrap();
    assert_eq!(cycles_until(&arm, is_moving), 1);
    arm.step(400);
    arm.stop(StopCategory::Two).unwrap();
    assert_eq!(cycles_until(&arm, |state| state.groups()[0].phase == Phase::Stopping), 1);
}

#[test]
fn a_callback_is_on_the_wire_in_the_cycle_that_grants_it() {
    let arm = simulated();
    let before = arm.state().slot;
    let _callback = arm.in_loop(|_, _, command| command.velocity(0, 0.1)).unwrap();
    assert_eq!(arm.state().slot, before + 1);
    assert!(is_moving(&arm.state()));
}

#[test]
fn a_point_is_on_the_wire_in_the_next_cycle_ahead_of_the_lag_that_the_state_shows() {
    let arm = simulated();
    arm.begin_stream().unwrap();
    let here = arm.state().axes()[0].position_set;
    for _ in 0..500 {
        arm.stream().push_now(&[here]).unwrap();
        arm.step(1);
    }
    let lag_cycles = arm.state().groups()[0].stream.counts.lag_ns.div_ceil(MILLISECOND_NS);
    arm.stream().push_now(&[here + 0.001]).unwrap();
    let taken = cycles_until(&arm, |state| state.axes()[0].position_set != here);
    assert!(taken <= lag_cycles + 1, "{taken} cycles, at a lag of {lag_cycles}");
    arm.stop(StopCategory::Two).unwrap();
    arm.wait_for(Phase::Holding, Duration::from_secs(30)).unwrap();
}
