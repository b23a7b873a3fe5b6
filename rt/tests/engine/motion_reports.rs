//! Each motion is answered for by the request that began it, whatever the group did before and does afterwards.

use crate::fixture::{PERIOD_NS, Rig, axis_in, move_to, parameters};
use takt_rt::{
    ControlLaw, MotionState, Move, Phase, ProfileMove, ProfileTarget, Request, RequestId, Rule, StopCategory,
};

fn state(rig: &Rig, request: u64) -> Option<MotionState> {
    rig.host.snapshot.motions.of(RequestId(request))
}

/// Asks for something, and returns the number of the request.
fn ask(rig: &mut Rig, request: Request) -> u64 {
    rig.request(request);
    rig.host.taken
}

#[test]
fn each_of_several_moves_reports_that_it_is_finished() {
    let mut rig = Rig::enabled(2);
    for (count, target) in [0.3, 0.1, 0.2, 0.3].into_iter().enumerate() {
        let request = ask(&mut rig, Request::Move(move_to(target)));
        assert_eq!(state(&rig, request), Some(MotionState::InProgress));
        rig.run_until(Phase::Holding, 5_000);
        rig.run(1);
        assert_eq!(state(&rig, request), Some(MotionState::Finished));
        assert_eq!(rig.finished_motions(), count + 1);
    }
}

#[test]
fn a_stop_before_a_motion_is_not_what_became_of_it() {
    for cycles_between in 0..5 {
        let mut rig = Rig::enabled(1);
        rig.host.requests.push_back(Request::Stop(StopCategory::Two));
        rig.run(cycles_between);
        let motion = ask(&mut rig, Request::Move(move_to(0.1)));
        for _ in 0..3 {
            assert_eq!(state(&rig, motion), Some(MotionState::InProgress), "{cycles_between} cycles between");
            rig.run(1);
        }
        rig.run_until(Phase::Holding, 5_000);
        rig.run(1);
        assert_eq!(state(&rig, motion), Some(MotionState::Finished), "{cycles_between} cycles between");
    }
}

#[test]
fn a_motion_that_was_stopped_says_why_for_as_long_as_it_is_remembered() {
    let mut rig = Rig::enabled(1);
    let motion = ask(&mut rig, Request::Move(move_to(2.0)));
    rig.run(100);
    rig.request(Request::Stop(StopCategory::Two));
    rig.run_until(Phase::Holding, 5_000);
    let next = ask(&mut rig, Request::Move(move_to(0.0)));
    rig.run_until(Phase::Holding, 5_000);
    rig.run(1);
    let Some(MotionState::Stopped(stop)) = state(&rig, motion) else { panic!("{:?}", state(&rig, motion)) };
    assert_eq!((stop.rule(), stop.category, stop.phase), (Rule::Requested, StopCategory::Two, Phase::Moving));
    assert_eq!(state(&rig, next), Some(MotionState::Finished));
}

#[test]
fn a_motion_that_is_replanned_was_replaced_by_the_request_for_the_new_one() {
    let mut rig = Rig::enabled(1);
    let first = ask(&mut rig, Request::Move(move_to(2.0)));
    rig.run(50);
    let refused = ask(&mut rig, Request::Move(Move { velocity_scale: 7.0, ..move_to(0.5) }));
    assert_eq!((state(&rig, first), state(&rig, refused)), (Some(MotionState::InProgress), None));
    let second = ask(&mut rig, Request::Move(move_to(0.5)));
    assert_eq!(state(&rig, first), Some(MotionState::Replaced { by: RequestId(second) }));
    rig.run_until(Phase::Holding, 5_000);
    rig.run(1);
    assert_eq!(state(&rig, second), Some(MotionState::Finished));
    assert_eq!(state(&rig, first), Some(MotionState::Replaced { by: RequestId(second) }));
}

/// A drive in profile position, and one in profile velocity.
fn profile_drives() -> Rig {
    let mut parameters = parameters(2);
    let laws = [ControlLaw::ProfilePosition, ControlLaw::ProfileVelocity];
    for ((node, axis), law) in (1..).zip(&mut parameters.axes).zip(laws) {
        *axis = axis_in(law, 0, node);
    }
    Rig::of(parameters).enable()
}

fn target(rig: &Rig, axis: u8, target: ProfileTarget) -> Request {
    let valid_until_ns = rig.clock.now_ns + 60_000 * PERIOD_NS;
    Request::SetProfileTarget(ProfileMove { axis, target, valid_until_ns })
}

#[test]
fn the_motions_of_two_drives_do_not_replace_one_another() {
    let mut rig = profile_drives();
    let (to, speed) =
        (target(&rig, 0, ProfileTarget::Position(1.0)), target(&rig, 1, ProfileTarget::Velocity(0.5)));
    let (position, velocity) = (ask(&mut rig, to), ask(&mut rig, speed));
    assert_eq!(state(&rig, position), Some(MotionState::InProgress));
    let speed = target(&rig, 1, ProfileTarget::Velocity(0.2));
    let slower = ask(&mut rig, speed);
    assert_eq!(state(&rig, position), Some(MotionState::InProgress));
    assert_eq!(state(&rig, velocity), Some(MotionState::Replaced { by: RequestId(slower) }));
    // A move takes the drive in profile position along, and leaves the other one as it is.
    let all = ask(&mut rig, Request::Move(move_to(0.5)));
    assert_eq!(state(&rig, position), Some(MotionState::Replaced { by: RequestId(all) }));
    rig.run(5_000);
    assert_eq!(state(&rig, slower), Some(MotionState::Finished));
    assert_eq!((state(&rig, all), rig.phase()), (Some(MotionState::Finished), Phase::Moving));
    rig.request(Request::Stop(StopCategory::Two));
    assert_eq!(
        state(&rig, slower),
        Some(MotionState::Finished),
        "the speed had been reached before the stop"
    );
}
