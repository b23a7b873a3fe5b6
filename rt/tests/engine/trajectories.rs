//! Trajectories of the host, carried out by the engine.

use crate::fixture::{LIMITS, PERIOD_NS, Rig, TestTrajectory, axis_in, move_to, parameters};
use takt_rt::plan::State;
use takt_rt::{
    ControlLaw, EventKind, ExecutionStart, MotionState, Phase, Polynomial, ProfileMove, ProfileTarget,
    RejectReason, Request, RequestId, Rule, StopCategory, TimeLawPhase, TrajectoryId,
};

const PERIOD_S: f64 = 0.001;

/// From `from` to `to` with the least jerk, then on to rest there.
fn least_jerk(from: f64, to: f64, duration_s: f64) -> [Polynomial; 2] {
    let way = to - from;
    let [c3, c4, c5] = [10.0, -15.0, 6.0].map(|factor| factor * way);
    let cube = duration_s * duration_s * duration_s;
    [
        Polynomial([
            from,
            0.0,
            0.0,
            c3 / cube,
            c4 / (cube * duration_s),
            c5 / (cube * duration_s * duration_s),
        ]),
        Polynomial::linear(to, 0.0),
    ]
}

fn trajectory(polynomials: &[[Polynomial; 2]], duration_s: f64) -> TestTrajectory {
    let at = |point: usize| polynomials.iter().map(move |axis| axis[point]);
    TestTrajectory {
        id: TrajectoryId(0),
        axes: polynomials.len(),
        times_s: vec![0.0, duration_s],
        polynomials: at(0).chain(at(1)).collect(),
        law: vec![TimeLawPhase::constant(0.0, 0.0, 1.0)],
        duration_s,
    }
}

/// Where the axes of a rig hold.
fn here(rig: &Rig) -> Vec<f64> {
    rig.engine.axes().iter().map(|axis| axis.set_point().position).collect()
}

/// A trajectory of every axis by 0.5 rad in 1.0005 s: half a cycle more than a number of them.
fn from_here(rig: &Rig) -> TestTrajectory {
    let polynomials: Vec<[Polynomial; 2]> =
        here(rig).iter().map(|from| least_jerk(*from, from + 0.5, 1.0005)).collect();
    trajectory(&polynomials, 1.0005)
}

/// Asks for a trajectory, and returns the number of the request. Its own number is ten times that.
fn execute(rig: &mut Rig, trajectory: TestTrajectory, start: ExecutionStart) -> RequestId {
    let request = RequestId(rig.host.taken + 1);
    rig.host.trajectories.push(TestTrajectory { id: of(request), ..trajectory });
    rig.request(Request::Execute { trajectory: of(request), start });
    request
}

/// The number of the trajectory of a request.
fn of(request: RequestId) -> TrajectoryId {
    TrajectoryId(10 * request.0)
}

fn state(rig: &Rig, request: RequestId) -> Option<MotionState> {
    rig.host.snapshot.motions.of(request)
}

fn last_rejection(rig: &Rig) -> RejectReason {
    rig.rejections().last().expect("nothing was rejected").reason
}

/// What a trajectory under way is to be replaced after: so many cycles of it.
fn after(request: RequestId, cycles: u64, is_same_motion: bool) -> ExecutionStart {
    ExecutionStart::After { trajectory: of(request), cycles, is_same_motion }
}

#[test]
fn a_trajectory_is_carried_out_exactly_and_reported_when_it_is_finished() {
    let mut rig = Rig::enabled(2);
    let begun = from_here(&rig);
    let copy = TestTrajectory { id: TrajectoryId(0), ..from_here(&rig) };
    let request = execute(&mut rig, begun, ExecutionStart::Now);
    for cycle in 1..=1_001 {
        let wanted = copy.sample(f64::from(cycle) * PERIOD_S);
        for axis in rig.engine.axes() {
            assert_eq!(axis.set_point(), wanted.states[usize::from(axis.number())], "cycle {cycle}");
        }
        if cycle < 1_001 {
            assert_eq!((rig.phase(), state(&rig, request)), (Phase::Moving, Some(MotionState::InProgress)));
            assert!(
                (rig.host.snapshot.groups[0].remaining_s - (1.0005 - f64::from(cycle) * PERIOD_S)).abs()
                    < 1e-12
            );
            rig.run(1);
        }
    }
    assert_eq!((rig.phase(), state(&rig, request)), (Phase::Holding, Some(MotionState::Finished)));
    assert_eq!(rig.finished_motions(), 1);
    rig.run(1);
    assert_eq!(rig.host.needed, [None; 2], "it is not needed any more");
    rig.assert_limits_kept();
    assert!(rig.stops().is_empty());
}

#[test]
fn a_slot_that_is_missed_delays_a_trajectory_and_leaves_nothing_of_it_out() {
    let mut rig = Rig::enabled(1);
    let begun = from_here(&rig);
    let request = execute(&mut rig, begun, ExecutionStart::Now);
    for _ in 0..100 {
        rig.run(3);
        rig.clock.lateness_ns.push_back(3 * PERIOD_NS / 2);
    }
    rig.run_until(Phase::Holding, 2_000);
    assert_eq!(state(&rig, request), Some(MotionState::Finished));
    rig.assert_limits_kept();
    assert!(rig.stops().is_empty());
}

#[test]
fn a_trajectory_that_does_not_begin_where_the_axes_are_is_refused() {
    let mut rig = Rig::enabled(2);
    let at = here(&rig);
    let beside = [least_jerk(at[0], 0.5, 1.0), least_jerk(at[1] + 1e-6, 0.5, 1.0)];
    execute(&mut rig, trajectory(&beside, 1.0), ExecutionStart::Now);
    let rejection = *rig.rejections().last().unwrap();
    let mismatch = RejectReason::StartMismatch { position: at[1] + 1e-6, present: at[1] };
    assert_eq!((rejection.axis, rejection.reason), (Some(1), mismatch));
    let moving = at.iter().map(|from| [Polynomial::linear(*from, 0.1), Polynomial::linear(*from, 0.1)]);
    execute(&mut rig, trajectory(&moving.collect::<Vec<_>>(), 1.0), ExecutionStart::Now);
    assert!(matches!(last_rejection(&rig), RejectReason::StartMismatch { .. }));
    rig.request(Request::Execute { trajectory: TrajectoryId(7), start: ExecutionStart::Now });
    assert_eq!(last_rejection(&rig), RejectReason::UnknownTrajectory);
    assert_eq!((rig.phase(), here(&rig)), (Phase::Holding, at));
}

#[test]
fn a_trajectory_begins_only_while_the_group_holds() {
    let mut rig = Rig::enabled(1);
    rig.move_to(1.0);
    rig.run(100);
    let begun = from_here(&rig);
    execute(&mut rig, begun, ExecutionStart::Now);
    assert_eq!(last_rejection(&rig), RejectReason::Phase);
    let begun = from_here(&rig);
    execute(&mut rig, begun, after(RequestId(1), 500, false));
    assert_eq!(last_rejection(&rig), RejectReason::Phase);
    rig.run_until(Phase::Holding, 2_000);
    assert_eq!(rig.host.needed, [None; 2]);
}

#[test]
fn a_stop_from_anywhere_on_a_trajectory_keeps_the_limits() {
    for cycles in [1, 10, 137, 500, 700, 999] {
        let mut rig = Rig::enabled(2);
        let begun = from_here(&rig);
        let request = execute(&mut rig, begun, ExecutionStart::Now);
        rig.run(cycles);
        rig.request(Request::Stop(StopCategory::Two));
        rig.run_until(Phase::Holding, 2_000);
        rig.run(1);
        let Some(MotionState::Stopped(stop)) = state(&rig, request) else { panic!() };
        assert_eq!((stop.rule(), stop.phase), (Rule::Requested, Phase::Moving));
        assert_eq!((rig.host.needed, rig.finished_motions()), ([None; 2], 0));
        rig.assert_limits_kept();
    }
}

#[test]
fn a_move_takes_over_from_a_trajectory_without_a_step() {
    let mut rig = Rig::enabled(2);
    let begun = from_here(&rig);
    let request = execute(&mut rig, begun, ExecutionStart::Now);
    rig.run(400);
    rig.move_to(-0.2);
    let by = RequestId(rig.host.taken);
    assert_eq!(state(&rig, request), Some(MotionState::Replaced { by }));
    rig.run_until(Phase::Holding, 3_000);
    rig.run(1);
    assert_eq!(state(&rig, by), Some(MotionState::Finished));
    rig.assert_limits_kept();
}

#[test]
fn a_last_point_that_is_passed_in_motion_is_followed_by_a_stop() {
    let mut rig = Rig::enabled(1);
    let from = here(&rig)[0];
    // 5 rad/s² for 0.2 s, then on at 1 rad/s.
    let away = [Polynomial([from, 0.0, 2.5, 0.0, 0.0, 0.0]), Polynomial::linear(from + 0.1, 1.0)];
    let request = execute(&mut rig, trajectory(&[away], 0.2), ExecutionStart::Now);
    rig.run_until(Phase::Stopping, 300);
    assert_eq!(state(&rig, request), Some(MotionState::Finished));
    rig.run_until(Phase::Holding, 2_000);
    let expected = from + 0.1 + 1.0 / (2.0 * LIMITS.deceleration);
    assert!((here(&rig)[0] - expected).abs() < 0.002);
    assert_eq!(rig.stops().len(), 1);
    rig.assert_limits_kept();
}

#[test]
fn what_the_guard_does_not_let_pass_stops_the_group_from_where_it_was() {
    let mut rig = Rig::enabled(1);
    let from = here(&rig)[0];
    // A host that has checked nothing.
    let leap = [least_jerk(from, from + 0.2, 1.0)[0], Polynomial::linear(from + 0.9, 0.0)];
    let request = execute(&mut rig, trajectory(&[leap], 0.5), ExecutionStart::Now);
    rig.run_until(Phase::Stopping, 1_000);
    let Some(MotionState::Stopped(stop)) = state(&rig, request) else { panic!() };
    assert_eq!(stop.rule(), Rule::VelocityLimit);
    rig.run(500);
    rig.assert_limits_kept();
}

#[test]
fn a_host_that_loses_a_trajectory_stops_the_group() {
    let mut rig = Rig::enabled(1);
    let begun = from_here(&rig);
    let request = execute(&mut rig, begun, ExecutionStart::Now);
    rig.run(300);
    rig.host.trajectories.clear();
    rig.run(1);
    let Some(MotionState::Stopped(stop)) = state(&rig, request) else { panic!() };
    assert_eq!(stop.rule(), Rule::StaleCommand);
    rig.run(500);
    rig.assert_limits_kept();
}

/// The same path at half the speed, from where it is after so many cycles, reached with a rate that falls within 0.2 s.
fn slower(from: &TestTrajectory, cycles: u64) -> TestTrajectory {
    let at_s = cycles as f64 * PERIOD_S;
    // s' = 1 - 0.5 (3u² - 2u³), u = t / T
    let t: f64 = 0.2;
    let path_s = [at_s, 1.0, 0.0, -0.5 / (t * t), 0.25 / (t * t * t)];
    let ramp = TimeLawPhase { from_s: 0.0, path_s };
    let end = ramp.at(t);
    TestTrajectory {
        id: TrajectoryId(0),
        axes: from.axes,
        times_s: from.times_s.clone(),
        polynomials: from.polynomials.clone(),
        law: vec![ramp, TimeLawPhase::constant(t, end.path_s, end.rate)],
        duration_s: t + (from.duration_s - end.path_s) / end.rate,
    }
}

#[test]
fn the_same_path_goes_on_at_another_speed_as_the_same_motion() {
    let mut rig = Rig::enabled(2);
    let (begun, copy) = (from_here(&rig), from_here(&rig));
    let request = execute(&mut rig, begun, ExecutionStart::Now);
    rig.run(200);
    let slow = execute(&mut rig, slower(&copy, 300), after(request, 300, true));
    assert_eq!(rig.host.needed, [Some(of(request)), Some(of(slow))]);
    assert_eq!(rig.engine.axes()[0].set_point(), copy.sample(202.0 * PERIOD_S).states[0]);
    rig.run(98);
    assert_eq!(rig.engine.axes()[0].set_point(), copy.sample(0.3).states[0]);
    rig.run(1);
    assert_eq!(rig.engine.axes()[0].set_point(), slower(&copy, 300).sample(PERIOD_S).states[0]);
    rig.run(1);
    assert_eq!(rig.host.needed, [Some(of(slow)), None]);
    let velocity = rig.engine.axes()[0].set_point().velocity;
    rig.run(400);
    assert!(rig.engine.axes()[0].set_point().velocity < velocity);
    assert_eq!(state(&rig, request), Some(MotionState::InProgress));
    rig.run_until(Phase::Holding, 3_000);
    assert_eq!((state(&rig, request), state(&rig, slow)), (Some(MotionState::Finished), None));
    assert_eq!(rig.finished_motions(), 1);
    assert_eq!(rig.engine.axes()[0].set_point(), copy.sample(9.0).states[0]);
    rig.assert_limits_kept();
}

#[test]
fn a_trajectory_that_has_taken_over_is_the_present_one_before_its_first_cycle() {
    let mut rig = Rig::enabled(1);
    let (begun, copy) = (from_here(&rig), from_here(&rig));
    let request = execute(&mut rig, begun, ExecutionStart::Now);
    let slow = execute(&mut rig, slower(&copy, 300), after(request, 300, true));
    rig.run(298);
    assert_eq!(rig.engine.axes()[0].set_point(), copy.sample(0.3).states[0]);
    execute(&mut rig, slower(&copy, 310), after(slow, 50, true));
    let reason = last_rejection(&rig);
    assert!(matches!(reason, RejectReason::StartMismatch { .. }), "{reason:?}");
}

#[test]
fn another_trajectory_takes_over_where_it_was_said_and_is_a_motion_of_its_own() {
    let mut rig = Rig::enabled(1);
    let (begun, copy) = (from_here(&rig), from_here(&rig));
    let request = execute(&mut rig, begun, ExecutionStart::Now);
    rig.run(100);
    let State { position, velocity, acceleration } = copy.sample(0.3).states[0];
    // The acceleration ends within 0.1 s, the velocity stays.
    let fading = Polynomial([position, velocity, acceleration / 2.0, -acceleration / 0.6, 0.0, 0.0]);
    let end = fading.state(0.1);
    let onward = trajectory(&[[fading, Polynomial::linear(end.position, end.velocity)]], 0.1);
    let second = execute(&mut rig, onward, after(request, 300, false));
    assert_eq!(state(&rig, request), Some(MotionState::InProgress));
    assert_eq!(state(&rig, second), Some(MotionState::InProgress));
    rig.run(250);
    assert_eq!(state(&rig, request), Some(MotionState::Replaced { by: second }));
    rig.run_until(Phase::Holding, 2_000);
    rig.run(1);
    assert_eq!(state(&rig, second), Some(MotionState::Finished));
    rig.assert_limits_kept();
}

#[test]
fn what_is_to_take_over_must_fit_and_be_in_time() {
    let mut rig = Rig::enabled(1);
    let (begun, copy) = (from_here(&rig), from_here(&rig));
    let request = execute(&mut rig, begun, ExecutionStart::Now);
    rig.run(200);
    execute(&mut rig, slower(&copy, 150), after(request, 150, true));
    assert_eq!(last_rejection(&rig), RejectReason::TooLate, "that cycle has passed");
    execute(&mut rig, slower(&copy, 1_200), after(request, 1_200, true));
    assert_eq!(last_rejection(&rig), RejectReason::TooLate, "it will be over");
    execute(&mut rig, slower(&copy, 300), after(RequestId(99), 300, true));
    assert_eq!(last_rejection(&rig), RejectReason::TooLate, "that one is not under way");
    execute(&mut rig, slower(&copy, 310), after(request, 300, true));
    assert!(matches!(last_rejection(&rig), RejectReason::StartMismatch { .. }));
    execute(&mut rig, slower(&copy, 300), after(request, 300, true));
    assert_eq!(rig.rejections().len(), 4);
    execute(&mut rig, slower(&copy, 310), after(request, 310, true));
    assert_eq!(last_rejection(&rig), RejectReason::SuccessorPending);
    rig.run_until(Phase::Holding, 3_000);
    assert_eq!(state(&rig, request), Some(MotionState::Finished));
    rig.assert_limits_kept();
}

#[test]
fn a_stop_ends_a_trajectory_that_waits_to_take_over_too() {
    let mut rig = Rig::enabled(1);
    let (begun, copy) = (from_here(&rig), from_here(&rig));
    let request = execute(&mut rig, begun, ExecutionStart::Now);
    rig.run(200);
    let second = execute(&mut rig, slower(&copy, 300), after(request, 300, false));
    rig.request(Request::Stop(StopCategory::Two));
    rig.run_until(Phase::Holding, 3_000);
    for request in [request, second] {
        assert!(matches!(state(&rig, request), Some(MotionState::Stopped(_))));
    }
}

#[test]
fn a_drive_in_a_profile_mode_keeps_its_target_while_the_others_are_on_a_trajectory() {
    let mut parameters = parameters(2);
    parameters.axes[1] = axis_in(ControlLaw::ProfilePosition, 0, 2);
    let mut rig = Rig::of(parameters).enable();
    let begun = from_here(&rig);
    let stays = rig.drive(1).position;
    let request = execute(&mut rig, begun, ExecutionStart::Now);
    rig.run(100);
    let wanted = ProfileMove { axis: 1, target: ProfileTarget::Position(0.2), valid_until_ns: u64::MAX };
    rig.request(Request::SetProfileTarget(wanted));
    assert_eq!(last_rejection(&rig), RejectReason::Phase, "its group is on a trajectory");
    rig.run_until(Phase::Holding, 2_000);
    assert_eq!((state(&rig, request), rig.drive(1).position), (Some(MotionState::Finished), stays));
    assert!(rig.stops().is_empty());
}

#[test]
fn a_trajectory_finished_is_an_event_of_its_request() {
    let mut rig = Rig::enabled(1);
    let begun = from_here(&rig);
    let request = execute(&mut rig, begun, ExecutionStart::Now);
    rig.run_until(Phase::Holding, 2_000);
    rig.request(Request::Move(move_to(0.1)));
    rig.run_until(Phase::Holding, 2_000);
    let finished: Vec<RequestId> = rig
        .host
        .events
        .iter()
        .filter_map(|event| match event.kind {
            EventKind::MotionFinished { request } => Some(request),
            _ => None,
        })
        .collect();
    assert_eq!(finished, [request, RequestId(request.0 + 1)]);
}
