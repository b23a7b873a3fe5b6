//! Nodes without a heartbeat are asked for their state: node guarding (CiA 301, 7.2.8.3.2.1).

use crate::fixture::{PERIOD_NS, Rig, parameters};
use takt_rt::{
    EngineParameters, Frame, FrameKind, Id, Origin, Phase, Request, Rule, SetUpError, Supervision, node_state,
};

const GUARD_CYCLES: u32 = 20;
const LIFE_CYCLES: u32 = 60;

/// Three axes, of which the second and the third are guarded.
fn guarded() -> EngineParameters {
    let mut parameters = parameters(3);
    for axis in &mut parameters.axes[1..] {
        axis.supervision = Supervision::Guarding { guard_cycles: GUARD_CYCLES, life_cycles: LIFE_CYCLES };
        axis.stops_by_itself_cycles = Some(LIFE_CYCLES);
    }
    parameters
}

fn moving() -> Rig {
    let mut rig = Rig::of(guarded()).enable();
    rig.move_to(2.0);
    rig.run(200);
    assert_eq!(rig.phase(), Phase::Moving);
    rig
}

/// The cycles in which requests have left, and to which node.
fn requests(rig: &Rig) -> Vec<(u64, u32)> {
    let requests = rig.buses[0].sent.iter().filter(|(_, frame)| frame.kind() == FrameKind::Remote);
    requests.map(|(at_ns, frame)| (at_ns / PERIOD_NS, frame.id().value())).collect()
}

#[track_caller]
fn assert_stopped(rig: &mut Rig, rule: Rule, value: Option<f64>) {
    let stops = rig.stops();
    assert_eq!(stops.len(), 1, "{stops:?}");
    assert_eq!((stops[0].rule(), stops[0].origin), (rule, Origin::Axis(1)));
    if let Some(value) = value {
        assert_eq!(stops[0].cause.numbers().0, value);
    }
    rig.run_until(Phase::Disabled, 3_000);
    rig.assert_limits_kept();
}

#[test]
fn guarded_nodes_are_asked_at_their_guard_time_one_in_a_cycle_and_the_others_never() {
    let mut rig = moving();
    rig.run(1_000);
    assert!(rig.stops().is_empty());
    let requests = requests(&rig);
    for node in [2, 3] {
        let of_node = requests.iter().filter(|(_, id)| *id == 0x700 + node);
        let cycles: Vec<u64> = of_node.map(|(cycle, _)| *cycle).collect();
        assert!(cycles.len() > 40);
        assert!(cycles.windows(2).all(|pair| pair[1] - pair[0] == GUARD_CYCLES.into()), "{cycles:?}");
    }
    assert!(requests.iter().all(|(_, id)| [0x702, 0x703].contains(id)));
    assert!(requests.windows(2).all(|pair| pair[0].0 != pair[1].0), "two in one cycle: {requests:?}");
}

#[test]
fn nobody_is_asked_before_the_nodes_are_operational() {
    let mut rig = Rig::of(guarded());
    rig.run(100);
    assert_eq!(requests(&rig), []);
    rig.request(Request::Sync(true));
    assert_eq!(requests(&rig).len(), 1);
}

#[test]
fn a_guarded_node_that_falls_silent_stops_the_group_after_its_life_time() {
    let mut rig = moving();
    rig.drive(1).guarding.is_silent = true;
    rig.run(LIFE_CYCLES as usize - 2);
    assert!(rig.stops().is_empty());
    rig.run(GUARD_CYCLES as usize + 4);
    assert_stopped(&mut rig, Rule::NodeLost, Some(f64::from(LIFE_CYCLES) + 1.0));
}

#[test]
fn one_reply_that_is_lost_stops_nothing() {
    let mut rig = moving();
    for _ in 0..20 {
        rig.drive(1).guarding.is_silent = true;
        rig.run(GUARD_CYCLES as usize);
        rig.drive(1).guarding.is_silent = false;
        rig.run(2 * GUARD_CYCLES as usize);
    }
    assert!(rig.stops().is_empty());
}

#[test]
fn replies_whose_toggle_bit_does_not_change_count_as_no_replies() {
    let mut rig = moving();
    rig.drive(1).guarding.is_stuck = true;
    rig.run((LIFE_CYCLES + 2 * GUARD_CYCLES) as usize + 4);
    assert_stopped(&mut rig, Rule::NodeLost, Some(f64::from(LIFE_CYCLES) + 1.0));
}

#[test]
fn a_guarded_node_that_is_not_operational_stops_the_group_with_its_state() {
    let mut rig = moving();
    rig.drive(1).guarding.state = node_state::PRE_OPERATIONAL;
    rig.run(GUARD_CYCLES as usize + 2);
    assert_stopped(&mut rig, Rule::NodeNotOperational, Some(127.0));
}

#[test]
fn a_guarded_node_that_starts_anew_stops_the_group() {
    let mut rig = moving();
    rig.buses[0].inject(Frame::of(Id::canopen(0x700, 2), [node_state::BOOT_UP]));
    rig.run(2);
    assert_stopped(&mut rig, Rule::UnexpectedBootUp, None);
}

#[test]
fn no_drive_is_enabled_before_its_node_has_replied() {
    let mut rig = Rig::of(guarded());
    rig.drive(2).guarding.is_silent = true;
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(5);
    rig.request(Request::Enable);
    rig.run(40);
    assert_eq!(rig.phase(), Phase::Enabling);
    rig.drive(2).guarding.is_silent = false;
    rig.run_until(Phase::Holding, 150);
    assert!(rig.stops().is_empty());
}

#[test]
fn a_guard_time_of_no_cycle_is_refused() {
    let mut parameters = guarded();
    parameters.axes[1].supervision = Supervision::Guarding { guard_cycles: 0, life_cycles: 3 };
    let error = takt_rt::Engine::new(parameters).err();
    assert!(matches!(error, Some(SetUpError::NoCycles { .. })), "{error:?}");
}
