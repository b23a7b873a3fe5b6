//! The group of axes from power-up to motion and back, and every way in which it stops.

use crate::fixture::{Rig, jerk_limited, move_to, parameters, pdos, scale};
use proptest::prelude::*;
use takt_rt::{
    Answer, AxisParameters, AxisParametersError, BusState, ControlLaw, DriveState, Engine, EventKind, Follow,
    Frame, Id, MAX_AXES, Move, OperationMode, Origin, Phase, ProfileMove, ProfileTarget, RejectReason,
    Request, RequestId, Rule, SetUpError, StopCategory,
};

fn rules(rig: &Rig) -> Vec<Rule> {
    rig.stops().iter().map(|stop| stop.rule()).collect()
}

#[test]
fn a_passive_group_sends_no_set_points() {
    let mut rig = Rig::new(3);
    rig.run(50);
    assert!(rig.buses[0].sent.iter().all(|(_, frame)| frame.id().value() & 0x780 != 0x200));
}

#[test]
fn enabling_does_not_move_an_axis_by_a_single_count() {
    let mut rig = Rig::new(6);
    let before: Vec<i32> = (0..6).map(|axis| rig.drive(axis).position).collect();
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(5);
    rig.request(Request::Enable);
    rig.run_until(Phase::Holding, 50);
    rig.run(100);
    let after: Vec<i32> = (0..6).map(|axis| rig.drive(axis).position).collect();
    assert_eq!(before, after);
}

#[test]
fn a_move_arrives_on_the_count_and_says_so() {
    let mut rig = Rig::enabled(6);
    rig.move_to(1.25);
    assert_eq!(rig.phase(), Phase::Moving);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(3);
    assert_eq!(rig.finished_motions(), 1);
    for axis in 0..6 {
        assert_eq!(rig.drive(axis).position, scale().position_to_counts(1.25));
    }
    rig.assert_limits_kept();
}

#[test]
fn a_move_can_be_replanned_in_every_cycle_of_the_one_before() {
    let mut rig = Rig::enabled(3);
    for cycle in 0..600 {
        let target = if cycle % 7 < 4 { 1.0 } else { -0.5 };
        rig.move_to(target);
    }
    rig.move_to(0.25);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(3);
    rig.assert_limits_kept();
    assert_eq!(rig.stops(), []);
    assert_eq!(rig.drive(0).position, scale().position_to_counts(0.25));
}

#[test]
fn a_limit_that_is_lowered_in_motion_is_approached_without_undershoot_or_reversal() {
    let mut rig = Rig::of(jerk_limited(1, 20.0)).enable();
    let at_scale = |velocity_scale| {
        Request::Move(Move {
            target: [2.9; MAX_AXES],
            target_velocity: [0.0; MAX_AXES],
            velocity_scale,
            acceleration_scale: 1.0,
            minimum_duration_s: 0.0,
        })
    };
    rig.request(Request::Move(Move { target: [-2.9; MAX_AXES], ..moving(at_scale(1.0)) }));
    rig.run_until(Phase::Holding, 10_000);
    rig.request(at_scale(1.0));
    rig.run(1_000);
    let begun = rig.host.records.len();
    rig.request(at_scale(0.25));
    rig.run(1_500);
    let velocities: Vec<f64> =
        rig.host.records[begun..].iter().map(|cycle| cycle.axes[0].velocity_set.into()).collect();
    assert!(velocities[0] > 1.9);
    assert!(
        velocities.iter().all(|velocity| *velocity > 0.5 - 1e-6),
        "{:?}",
        velocities.iter().copied().reduce(f64::min)
    );
    assert!((velocities[velocities.len() - 1] - 0.5).abs() < 1e-6);
    rig.assert_limits_kept();
}

fn moving(request: Request) -> Move {
    match request {
        Request::Move(parameters) => parameters,
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_cannot_be_done_is_refused_and_changes_nothing() {
    let mut rig = Rig::enabled(3);
    let good = Move {
        target: [0.5; MAX_AXES],
        target_velocity: [0.0; MAX_AXES],
        velocity_scale: 1.0,
        acceleration_scale: 1.0,
        minimum_duration_s: 0.0,
    };
    let moved = |parameters| Request::Move(parameters);
    let at_speed = |target, velocity| {
        moved(Move { target: [target; MAX_AXES], target_velocity: [velocity; MAX_AXES], ..good })
    };
    let mut third = good;
    third.target[2] = -3.2;
    // What is asked for; what stands against it, at which axis, with which value and limit.
    let refused = [
        (at_speed(3.1, 0.0), RejectReason::PositionLimit { position: 3.1, limit: 3.0 }, Some(0)),
        (moved(third), RejectReason::PositionLimit { position: -3.2, limit: -3.0 }, Some(2)),
        (at_speed(f64::INFINITY, 0.0), RejectReason::NotFinite { value: f64::INFINITY }, Some(0)),
        (at_speed(0.5, -2.5), RejectReason::VelocityLimit { velocity: -2.5, limit: -2.0 }, Some(0)),
        (at_speed(0.5, f64::NEG_INFINITY), RejectReason::NotFinite { value: f64::NEG_INFINITY }, Some(0)),
        // A stop from there ends at ±3.05 rad, one cycle later.
        (at_speed(2.85, 2.0), RejectReason::NoRoomToStop { rest: 3.052, limit: 3.0 }, Some(0)),
        (at_speed(-2.85, -2.0), RejectReason::NoRoomToStop { rest: -3.052, limit: -3.0 }, Some(0)),
        (moved(Move { velocity_scale: 0.0, ..good }), RejectReason::VelocityScale { scale: 0.0 }, None),
        (moved(Move { velocity_scale: 1.5, ..good }), RejectReason::VelocityScale { scale: 1.5 }, None),
        (
            moved(Move { acceleration_scale: -1.0, ..good }),
            RejectReason::AccelerationScale { scale: -1.0 },
            None,
        ),
        (
            moved(Move { minimum_duration_s: f64::INFINITY, ..good }),
            RejectReason::MinimumDuration { duration_s: f64::INFINITY },
            None,
        ),
        (
            moved(Move { minimum_duration_s: -1.0, ..good }),
            RejectReason::MinimumDuration { duration_s: -1.0 },
            None,
        ),
        (at_speed_of_half(good), RejectReason::NoTrajectory, Some(0)),
        (
            profile(0, ProfileTarget::Velocity(0.1)),
            RejectReason::WrongMode { mode: OperationMode::CyclicSynchronousPosition },
            Some(0),
        ),
        (profile(9, ProfileTarget::Velocity(0.1)), RejectReason::UnknownAxis { axis: 9, axes: 3 }, None),
        (Request::Enable, RejectReason::Phase, None),
        (Request::Activate, RejectReason::Phase, None),
        (Request::RatedTorque { axis: 1, torque: 50.0, limit_per_mille: None }, RejectReason::Phase, None),
        (Request::Position { axis: 3, counts: 1 }, RejectReason::UnknownAxis { axis: 3, axes: 3 }, None),
        (Request::TimeOfDay { at_zero_ns: 1 }, RejectReason::NoTime, None),
    ];
    for (count, (request, reason, axis)) in (1..).zip(refused) {
        rig.request(request);
        assert_eq!((rig.host.snapshot.rejected, rig.phase()), (count, Phase::Holding), "{request:?}");
        let Some(rejection) = rig.rejections().pop() else { panic!("{request:?}: nobody was told") };
        let expected = (request.kind(), reason.number(), axis, Phase::Holding);
        assert_eq!((rejection.request, rejection.reason.number(), rejection.axis, rejection.phase), expected);
        let ((value, limit), (seen, allowed)) = (reason.numbers(), rejection.reason.numbers());
        assert_eq!(allowed, limit, "{request:?}");
        assert!(seen == value || (seen - value).abs() < 1e-9, "{rejection:?}");
        let answer = rig.host.snapshot.answers.of(RequestId(rig.host.taken));
        assert_eq!(answer, Answer::Rejected(Some(rejection)));
    }
    rig.request(Request::Move(Move { velocity_scale: f64::NAN, ..good }));
    assert!(rig.rejections().pop().is_some_and(|rejection| rejection.reason.numbers().0.is_nan()));
}

/// At the target it would go at the limit, which half the limit does not lead to.
fn at_speed_of_half(good: Move) -> Request {
    Request::Move(Move { target_velocity: [2.0; MAX_AXES], velocity_scale: 0.5, ..good })
}

fn profile(axis: u8, target: ProfileTarget) -> Request {
    Request::SetProfileTarget(ProfileMove { axis, target, valid_until_ns: u64::MAX })
}

#[test]
fn a_rated_torque_is_a_positive_one_of_an_axis_that_is_there() {
    let mut rig = Rig::new(3);
    for (axis, torque, reason) in [
        (1, 50.0, None),
        (1, -1.0, Some(RejectReason::RatedTorque { torque: -1.0 })),
        (1, f64::INFINITY, Some(RejectReason::RatedTorque { torque: f64::INFINITY })),
        (200, 1.0, Some(RejectReason::UnknownAxis { axis: 200, axes: 3 })),
    ] {
        rig.request(Request::RatedTorque { axis, torque, limit_per_mille: None });
        let answer = rig.host.snapshot.answers.of(RequestId(rig.host.taken));
        let told = match answer {
            Answer::Rejected(Some(rejection)) => Some(rejection.reason),
            answer => {
                assert_eq!(answer, Answer::Granted);
                None
            }
        };
        assert_eq!(told, reason, "{torque}");
    }
}

#[test]
fn what_is_latched_or_on_its_way_out_says_so_when_it_refuses() {
    let mut parameters = parameters(3);
    parameters.axes.iter_mut().for_each(|axis| axis.follow = Follow::Exact);
    let mut rig = Rig::of(parameters).enable();
    rig.stream(2.0, 0.0);
    rig.request(Request::Stream);
    rig.run(5);
    assert_eq!((rig.phase(), rig.stops()[0].rule()), (Phase::Holding, Rule::StartPose));
    for request in [Request::Stream, Request::Move(move_to(0.1)), profile(0, ProfileTarget::Velocity(0.1))] {
        rig.request(request);
        let rejection = rig.rejections().pop().unwrap();
        let expected = RejectReason::StopLatched { rule: Rule::StartPose };
        assert_eq!((rejection.reason, rejection.axis), (expected, Some(0)));
    }
    rig.request(Request::InhibitEnable);
    rig.request(Request::Disable);
    rig.run_until(Phase::Disabled, 400);
    rig.request(Request::Enable);
    assert_eq!(rig.rejections().pop().unwrap().reason, RejectReason::EnableInhibited);
}

#[test]
fn nobody_enables_a_group_that_is_on_its_way_out() {
    let mut rig = Rig::enabled(3);
    rig.request(Request::InhibitEnable);
    assert_eq!(rig.phase(), Phase::Holding, "what is enabled remains so until it is disabled");
    rig.request(Request::Disable);
    rig.run_until(Phase::Disabled, 400);
    rig.run(60);
    rig.request(Request::Enable);
    rig.run(60);
    assert_eq!((rig.phase(), rig.host.snapshot.rejected), (Phase::Disabled, 1));
}

#[test]
fn a_category_2_stop_decelerates_at_the_limits_and_holds() {
    let mut rig = Rig::enabled(3);
    rig.move_to(2.5);
    rig.run(400);
    rig.request(Request::Stop(StopCategory::Two));
    rig.run_until(Phase::Holding, 400);
    rig.assert_limits_kept();
    assert_eq!(rig.stops().len(), 1);
    assert_eq!(rig.drive(0).state, DriveState::OperationEnabled);
    rig.move_to(0.0);
    assert_eq!(rig.phase(), Phase::Moving, "a requested stop needs no reset");
}

#[test]
fn a_category_1_stop_decelerates_and_then_disables() {
    let mut rig = Rig::enabled(3);
    rig.move_to(2.5);
    rig.run(400);
    rig.request(Request::Stop(StopCategory::One));
    rig.run_until(Phase::Disabled, 500);
    rig.assert_limits_kept();
    assert!((0..3).all(|axis| rig.drive(axis).state == DriveState::ReadyToSwitchOn));
}

#[test]
fn a_category_0_stop_takes_the_power_at_once() {
    let mut rig = Rig::enabled(3);
    rig.move_to(2.5);
    rig.run(400);
    rig.request(Request::Stop(StopCategory::Zero));
    rig.run(4);
    assert_eq!(rig.phase(), Phase::Disabled);
    assert_eq!(rig.stops().len(), 1);
}

/// What was left of the way to rest when the power went must not be taken up at the next enabling.
#[test]
fn after_a_category_0_stop_in_motion_nothing_of_the_old_motion_comes_back() {
    let mut rig = Rig::enabled(3);
    rig.move_to(2.5);
    rig.run(400);
    rig.request(Request::Stop(StopCategory::Zero));
    rig.run_until(Phase::Disabled, 10);
    rig.request(Request::Enable);
    // The joints have stood for long enough, and the drives have torque.
    rig.run(24);
    rig.drive(1).is_silent = true;
    rig.run_until(Phase::Disabling, 10);
    rig.drive(1).is_silent = false;
    rig.run_until(Phase::Disabled, 10);
    rig.assert_limits_kept();
}

#[test]
fn a_drive_that_never_answers_again_is_waited_for_until_its_own_watchdog_has_fired() {
    let mut rig = Rig::enabled(3);
    rig.drive(1).is_silent = true;
    rig.run_until(Phase::Disabling, 10);
    rig.run(190);
    assert_eq!(rig.phase(), Phase::Disabling);
    rig.run_until(Phase::Disabled, 10);
    assert_eq!(rules(&rig), [Rule::MissedFeedback]);
}

/// Disables a group in which one drive never shows that it obeys.
fn disable_in_vain(mut rig: Rig) {
    rig.request(Request::Disable);
    rig.run(495);
    assert_eq!(rig.phase(), Phase::Disabling);
    rig.run_until(Phase::Disabled, 20);
}

#[test]
fn a_silent_drive_without_a_watchdog_is_waited_for_longer_whatever_heartbeats_leave_on_its_bus() {
    let mut unwatched = parameters(3);
    unwatched.axes[1].stops_by_itself_cycles = None;
    let mut rig = Rig::of(unwatched).enable();
    rig.drive(1).is_silent = true;
    disable_in_vain(rig);
}

#[test]
fn a_drive_that_answers_and_does_not_obey_is_waited_for_longer_than_its_watchdog_takes() {
    let mut rig = Rig::enabled(3);
    rig.drive(1).is_defiant = true;
    disable_in_vain(rig);
}

#[test]
fn a_fault_of_one_axis_stops_all_with_one_reason_and_needs_a_reset() {
    let mut rig = Rig::enabled(6);
    rig.move_to(2.5);
    rig.run(400);
    rig.buses[0].inject(Frame::of(Id::canopen(0x080, 2), [0x11, 0x32, 0x04, 1, 2, 3, 4, 5]));
    rig.drive(1).state = DriveState::Fault;
    rig.run_until(Phase::Disabled, 1_000);
    let stops = rig.stops();
    assert_eq!(stops.len(), 1);
    assert_eq!(
        (stops[0].rule(), stops[0].axis(), stops[0].cause.numbers().0),
        (Rule::DriveFault, Some(1), f64::from(0x3211))
    );
    assert_eq!(stops[0].phase, Phase::Moving);
    assert!(
        (0..6).filter(|axis| *axis != 1).all(|axis| rig.drive(axis).state == DriveState::ReadyToSwitchOn)
    );

    rig.request(Request::Enable);
    assert_eq!((rig.phase(), rig.host.snapshot.rejected), (Phase::Disabled, 1), "the fault is latched");
    rig.request(Request::ResetFaults);
    rig.run(30);
    rig.request(Request::Enable);
    rig.run_until(Phase::Holding, 50);
    assert_eq!(rig.host.snapshot.groups[0].stop, None);
}

#[test]
fn an_emergency_message_is_an_event_and_goes_through_the_door() {
    let mut rig = Rig::enabled(3);
    let emergency = Frame::of(Id::canopen(0x080, 3), [0x0F, 0x73, 0x81, 1, 2, 3, 4, 5]);
    rig.buses[0].inject(emergency);
    rig.run(1);
    let kind = EventKind::Emergency { axis: 2, code: 0x730F, register: 0x81, manufacturer: [1, 2, 3, 4, 5] };
    assert!(rig.host.events.iter().any(|event| event.kind == kind));
    assert_eq!(rig.host.received, [emergency]);
    assert_eq!(rig.host.snapshot.axes[2].error_code, 0x730F);
}

#[test]
fn a_silent_drive_is_bridged_for_the_allowed_cycles_and_then_stops_the_group() {
    let mut rig = Rig::enabled(3);
    rig.move_to(2.5);
    rig.run(300);
    rig.drive(0).is_silent = true;
    rig.run(3);
    rig.drive(0).is_silent = false;
    rig.run(5);
    assert_eq!(rules(&rig), []);
    rig.drive(0).is_silent = true;
    rig.run_until(Phase::Stopping, 5);
    assert_eq!(rules(&rig), [Rule::MissedFeedback]);
    rig.assert_limits_kept();
}

#[test]
fn a_joint_that_does_not_follow_stops_the_group() {
    let mut rig = Rig::enabled(3);
    rig.drive(2).is_stuck = true;
    rig.move_to(2.5);
    rig.run_until(Phase::Stopping, 500);
    let stop = rig.stops()[0];
    assert_eq!((stop.rule(), stop.axis()), (Rule::FollowingError, Some(2)));
    let (error, limit) = stop.cause.numbers();
    assert!(error.abs() > 0.05 && limit == 0.05);
    rig.run_until(Phase::Disabled, 1_000);
}

#[test]
fn a_drive_that_leaves_operation_enabled_stops_the_group() {
    let mut rig = Rig::enabled(3);
    rig.move_to(2.5);
    rig.run(300);
    rig.drive(1).state = DriveState::SwitchOnDisabled;
    rig.run_until(Phase::Stopping, 3);
    assert_eq!(rules(&rig), [Rule::DriveDisabled]);
}

#[test]
fn a_drive_that_cannot_be_enabled_ends_the_attempt() {
    let mut rig = Rig::new(3);
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(5);
    rig.drive(1).state = DriveState::NotReadyToSwitchOn;
    rig.request(Request::Enable);
    rig.run_until(Phase::Disabled, 600);
    let stop = rig.stops()[0];
    assert_eq!((stop.rule(), stop.axis()), (Rule::EnableTimeout, Some(1)));
}

#[test]
fn a_lost_bus_stops_the_group() {
    for state in [BusState::BusOff, BusState::Down] {
        let mut rig = Rig::enabled(6);
        rig.move_to(2.0);
        rig.run(100);
        rig.buses[1].state = state;
        rig.run(1);
        assert_eq!(rules(&rig), [Rule::BusLost]);
        assert_eq!(rig.stops()[0].origin, Origin::Bus(1));
        assert_eq!(rig.phase(), Phase::Stopping);
    }
}

#[test]
fn nothing_is_queued_behind_set_points_that_wait_for_the_wire() {
    let mut rig = Rig::enabled(3);
    rig.move_to(2.0);
    rig.run(100);
    rig.buses[0].unconfirmed = 3;
    let before = rig.buses[0].sent.len();
    let set_before = rig.host.snapshot.axes[0].position_set;
    rig.run(4);
    assert!(rig.buses[0].sent[before..].iter().all(|(_, frame)| frame.id().value() & 0x780 != 0x200));
    assert_eq!(rig.host.snapshot.axes[0].position_set, set_before, "the trajectory waits, too");
    rig.buses[0].unconfirmed = 0;
    rig.run(10);
    assert_eq!(rules(&rig), []);
    rig.assert_limits_kept();
    rig.buses[0].unconfirmed = 3;
    rig.run(7);
    assert_eq!(rules(&rig), [Rule::NotTransmitted]);
    assert_eq!(rig.stops()[0].origin, Origin::Bus(0));
}

#[test]
fn impossible_parameters_are_refused_with_the_axis() {
    let with = |change: fn(&mut AxisParameters)| {
        let mut parameters = parameters(2);
        change(&mut parameters.axes[1]);
        Engine::new(parameters).err()
    };
    assert_eq!(with(|axis| axis.bus = 9), Some(SetUpError::UnknownBus { axis: 1 }));
    assert_eq!(
        with(|axis| pdos(axis).commands.clear()),
        Some(SetUpError::Axis { axis: 1, error: AxisParametersError::NoPdo })
    );
    let changes: [fn(&mut AxisParameters); 5] = [
        |axis| axis.limits.velocity = f64::NAN,
        |axis| axis.following_error_limit = f64::NAN,
        |axis| axis.law = ControlLaw::Velocity { position_gain: f64::INFINITY },
        |axis| axis.node = 0,
        |axis| axis.node = 129,
    ];
    for change in changes {
        assert!(matches!(with(change), Some(SetUpError::Axis { axis: 1, .. })), "{:?}", with(change));
    }
    let taken = with(|axis| axis.node = 1);
    assert_eq!(taken, Some(SetUpError::DuplicateNodeId { axis: 1, node: 1 }));
    let same_id = with(|axis| pdos(axis).feedback[0].id = Id::canopen(0x180, 1));
    assert_eq!(same_id, Some(SetUpError::IdTaken { axis: 1, id: Id::canopen(0x180, 1) }));
    let mut none = parameters(1);
    none.axes.clear();
    assert_eq!(Engine::new(none).err(), Some(SetUpError::NoAxis));
}

fn any_request() -> impl Strategy<Value = Request> {
    let number = prop_oneof![4 => -3.5f64..3.5, 1 => Just(f64::NAN), 1 => Just(1e300)];
    prop_oneof![
        Just(Request::Enable),
        Just(Request::Disable),
        Just(Request::Activate),
        Just(Request::Stream),
        Just(Request::ResetFaults),
        Just(Request::Sync(true)),
        Just(Request::Stop(StopCategory::Zero)),
        Just(Request::Stop(StopCategory::One)),
        Just(Request::Stop(StopCategory::Two)),
        (number, -2.0f64..2.0, 0.0f64..1.1).prop_map(|(target, velocity, scale)| Request::Move(Move {
            target: [target; MAX_AXES],
            target_velocity: [if velocity.abs() < 1.0 { 0.0 } else { velocity }; MAX_AXES],
            velocity_scale: scale,
            acceleration_scale: scale,
            minimum_duration_s: 0.0,
        })),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn no_sequence_of_requests_streams_and_faults_moves_an_axis_beyond_its_limits(
        steps in prop::collection::vec((any_request(), 0usize..120, 0u8..12, -0.01f64..0.01), 1..60),
        jerk in prop_oneof![Just(f64::INFINITY), 20.0f64..2_000.0],
    ) {
        let mut rig = Rig::of(jerk_limited(3, jerk)).enable();
        for (request, cycles, fault, step) in steps {
            rig.request(request);
            match fault {
                0 => rig.drive(0).state = DriveState::Fault,
                1 => rig.drive(1).is_silent = true,
                2 => rig.drive(1).is_silent = false,
                3 => rig.buses[0].inject(Frame::of(Id::canopen(0x180, 1), [0xFF; 3])),
                4 => rig.clock.lateness_ns.extend([0, 7_300_000]),
                5 => {
                    let at = rig.host.snapshot.axes[0].position_set + step;
                    rig.stream(at, step * 10.0);
                }
                _ => {}
            }
            rig.run(cycles);
        }
        rig.assert_limits_kept();
    }

    #[test]
    fn frames_of_any_content_are_taken_without_a_panic(ids in prop::collection::vec((0u32..0x800, any::<u64>(), 0usize..9), 0..200)) {
        let mut rig = Rig::enabled(2);
        for (id, word, length) in ids {
            rig.buses[0].inject(Frame::data(Id::base(id).unwrap(), &word.to_le_bytes()[..length]).unwrap());
            rig.run(1);
        }
        prop_assert!(rig.host.snapshot.axes.iter().all(|axis| axis.position.is_finite()));
    }
}
