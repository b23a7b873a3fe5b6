//! When a callback begins, what takes its place, and how it ends.

use super::rig::{
    COMMANDED, FINISHED, JERK, PANICKED, at, followed, give, holding, lead, leading_to, ramp, run, set_point,
    state_of,
};
use crate::fixture::{Rig, jerk_limited, move_to};
use takt_rt::plan::State;
use takt_rt::{
    CallbackId, Follow, GroupParameters, MotionState, Phase, RejectReason, Request, RequestId, Rule,
};

#[test]
fn it_begins_only_while_the_group_holds_without_a_fault() {
    let mut rig = Rig::of(jerk_limited(2, JERK));
    give(&mut rig, (0, 1), |_, _, _| COMMANDED);
    let last = |rig: &Rig| rig.rejections().last().unwrap().reason;
    rig.request(Request::RunCallback(run(1)));
    assert_eq!(last(&rig), RejectReason::Phase);
    let mut rig = rig.enable();
    rig.move_to(0.5);
    rig.request(Request::RunCallback(run(1)));
    assert_eq!((last(&rig), rig.phase()), (RejectReason::Phase, Phase::Moving));
    rig.run_until(Phase::Holding, 3_000);
    give(&mut rig, (0, 2), |_, _, _| PANICKED);
    rig.request(Request::RunCallback(run(2)));
    rig.run(2);
    assert_eq!(rig.phase(), Phase::Holding);
    rig.request(Request::RunCallback(run(1)));
    assert_eq!(last(&rig), RejectReason::StopLatched { rule: Rule::CallbackPanicked });
    rig.request(Request::ResetFaults);
    rig.request(Request::RunCallback(run(1)));
    assert_eq!(rig.phase(), Phase::Streaming);
}

#[test]
fn a_callback_that_is_over_lets_the_axes_come_to_rest_and_its_motion_is_done_then() {
    for follow in [Follow::Smooth, Follow::Exact] {
        let mut rig = holding(JERK);
        let mut calls = 0_u32;
        let begun = lead(&mut rig, followed(follow), move |cycle, _, targets| {
            calls += 1;
            let time_s = f64::from(calls) * cycle.period_s;
            targets[0] = at(ramp(time_s));
            if calls == 150 { FINISHED } else { COMMANDED }
        });
        rig.run(148);
        assert_eq!(state_of(&rig, begun), MotionState::InProgress);
        rig.run(1);
        assert_eq!((rig.phase(), state_of(&rig, begun)), (Phase::Moving, MotionState::InProgress));
        assert_eq!(rig.host.needed_callbacks, [], "it goes back to the host");
        rig.run_until(Phase::Holding, 1_000);
        assert_eq!(state_of(&rig, begun), MotionState::Finished);
        assert_eq!((rig.finished_motions(), rig.stops()), (1, vec![]));
        assert_eq!(set_point(&rig).velocity, 0.0);
        rig.assert_differences_kept(JERK);
    }
}

#[test]
fn a_move_takes_the_place_of_a_callback_in_motion_without_a_bump() {
    for follow in [Follow::Smooth, Follow::Exact] {
        let mut rig = holding(JERK);
        let mut calls = 0_u32;
        let begun = lead(&mut rig, followed(follow), move |cycle, _, targets| {
            calls += 1;
            let time_s = f64::from(calls) * cycle.period_s;
            // What it says of its velocity is wrong; where it leads is not.
            targets[0] = at(State::rest(ramp(time_s).position));
            COMMANDED
        });
        rig.run(150);
        rig.request(Request::Move(move_to(9.0)));
        assert_eq!(
            rig.rejections().last().unwrap().reason,
            RejectReason::PositionLimit { position: 9.0, limit: 3.0 }
        );
        assert_eq!((rig.phase(), state_of(&rig, begun)), (Phase::Streaming, MotionState::InProgress));
        rig.request(Request::Move(move_to(-0.1)));
        let by = RequestId(rig.host.taken);
        assert_eq!((rig.phase(), state_of(&rig, begun)), (Phase::Moving, MotionState::Replaced { by }));
        assert_eq!(rig.host.needed_callbacks, []);
        rig.run_until(Phase::Holding, 3_000);
        assert!((set_point(&rig).position + 0.1).abs() < 1e-9);
        assert_eq!(rig.stops(), []);
        rig.assert_differences_kept(JERK);
    }
}

#[test]
fn another_callback_takes_the_place_of_one_in_motion_and_nothing_else_does() {
    let mut rig = holding(JERK);
    let first = lead(&mut rig, run(1), leading_to(0.5));
    rig.run(100);
    for request in [Request::Stream, Request::Enable, Request::Activate, Request::ResetFaults] {
        rig.request(request);
        assert_eq!(rig.rejections().last().unwrap().reason, RejectReason::Phase, "{request:?}");
    }
    rig.request(Request::RunCallback(run(7)));
    assert_eq!(rig.rejections().last().unwrap().reason, RejectReason::UnknownCallback);
    assert_eq!(rig.host.needed_callbacks, [(0, CallbackId(1))]);
    let second = lead(&mut rig, run(2), leading_to(-0.2));
    assert_eq!(rig.host.needed_callbacks, [(0, CallbackId(2))]);
    assert_eq!(state_of(&rig, first), MotionState::Replaced { by: second });
    rig.run(2_000);
    assert!((set_point(&rig).position + 0.2).abs() < 1e-6);
    assert_eq!((rig.phase(), rig.stops()), (Phase::Streaming, vec![]));
    rig.assert_differences_kept(JERK);
}

#[test]
fn two_groups_are_led_by_a_callback_each_and_the_fault_of_the_one_is_not_the_others() {
    let group =
        |axes: &[u8]| GroupParameters { axes: axes.iter().copied().collect(), ..GroupParameters::default() };
    let mut parameters = jerk_limited(6, JERK);
    parameters.groups = [group(&[0, 2, 4]), group(&[1, 3, 5])].into_iter().collect();
    let mut rig = Rig::of(parameters).enable();
    rig.run(20);
    let home = rig.host.snapshot.axes.map(|axis| axis.position_set);
    for group in [0_u8, 1] {
        let mut calls = 0;
        give(&mut rig, (group, 1), move |_, axes, targets| {
            // It may write to what is not its own: that leads nothing.
            targets.fill(at(State::rest(home[0] + if group == 0 { 0.2 } else { -0.2 })));
            assert!(axes[usize::from(group)].is_heard);
            calls += 1;
            if group == 1 && calls == 500 { PANICKED } else { COMMANDED }
        });
    }
    rig.request(Request::RunCallback(run(1)));
    assert_eq!(rig.rejections().last().unwrap().reason, RejectReason::GroupNotNamed { groups: 2 });
    for group in [0, 1] {
        rig.host.group_requests.push_back((group, Request::RunCallback(run(1))));
    }
    rig.run(1);
    assert_eq!(rig.host.needed_callbacks, [(0, CallbackId(1)), (1, CallbackId(1))]);
    rig.run(498);
    for (axis, set) in rig.host.snapshot.axes().iter().map(|axis| axis.position_set).enumerate() {
        let expected = home[0] + if axis % 2 == 0 { 0.2 } else { -0.2 };
        assert!((set - expected).abs() < 1e-3, "axis {axis} is led to {set}");
    }
    rig.run(500);
    assert_eq!((rig.phase_of(0), rig.phase_of(1)), (Phase::Streaming, Phase::Holding));
    assert_eq!(rig.stops().len(), 1);
    assert_eq!(rig.host.needed_callbacks, [(0, CallbackId(1))]);
}
