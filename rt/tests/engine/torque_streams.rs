//! Streams of torques, impedances and velocities, and torque that is fed forward.

use crate::fixture::{FRICTION, INERTIA, LIMITS, PERIOD_S, Rig, axis_in, parameters};
use proptest::prelude::*;
use takt_rt::plan::State;
use takt_rt::{
    AxisTarget, ControlLaw, DriveState, Fault, MAX_AXES, OperationMode, Phase, Request, Rule, StopCategory,
    StopCause, StreamState, StreamWish, TorqueLimits,
};

/// N·m/s
const RATE: f64 = 400.0;

const LAW: ControlLaw = ControlLaw::Torque {
    stiffness: 1600.0 * INERTIA,
    damping: 80.0 * INERTIA,
    inertia: INERTIA,
    viscous_friction: FRICTION,
    coulomb_friction: 0.0,
};

/// An axis of this law that streams, standing at 0.
fn streaming_in(law: ControlLaw) -> Rig {
    let mut parameters = parameters(1);
    parameters.axes[0] = axis_in(law, 0, 1);
    parameters.axes[0].torque_limits = TorqueLimits { stiffness: 2000.0, damping: 100.0, rate: RATE };
    parameters.axes[0].limits.jerk = 200.0;
    let mut rig = Rig::of(parameters).enable();
    rig.move_to(0.0);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(200);
    rig.host.records.clear();
    rig.request(Request::Stream);
    rig
}

fn streaming() -> Rig {
    streaming_in(LAW)
}

fn position(rig: &Rig) -> f64 {
    rig.engine.axes()[0].position()
}

fn torque(rig: &Rig) -> f64 {
    rig.host.snapshot.axes[0].torque_set
}

fn causes(rig: &Rig) -> Vec<StopCause> {
    rig.stops().iter().map(|stop| stop.cause).collect()
}

/// Checks that the torque has changed in no cycle by more than this. A count of the position is 12 mrad/s from one cycle to the
/// next, of which the damping of the law makes 1 N·m.
fn assert_torque_steps_within(rig: &Rig, most: f64) {
    let torques: Vec<f32> = rig.host.records.iter().map(|record| record.axes[0].torque_set).collect();
    for (cycle, pair) in torques.windows(2).enumerate() {
        let step = f64::from((pair[1] - pair[0]).abs());
        assert!(step <= most, "{pair:?} in cycle {cycle}");
    }
}

fn impedance(position: f64, stiffness: f64, damping: f64) -> AxisTarget {
    AxisTarget::Impedance { state: State::rest(position), stiffness, damping, torque: 0.0 }
}

#[test]
fn a_torque_is_reached_at_its_rate_and_drives_the_joint() {
    let mut rig = streaming();
    rig.stream_target(AxisTarget::Torque(5.0));
    rig.run(10);
    assert!((torque(&rig) - 10.0 * RATE * PERIOD_S).abs() < 0.5, "{}", torque(&rig));
    rig.run(400);
    assert_eq!(torque(&rig), 5.0);
    assert_torque_steps_within(&rig, RATE * PERIOD_S * 1.001);
    // The friction of the joint takes it all up at 1 rad/s, with a time constant of 0.2 s.
    let velocity = rig.engine.axes()[0].velocity();
    assert!((velocity - 5.0 / FRICTION).abs() < 0.2, "{velocity}");
    assert_eq!(causes(&rig), []);
    let set_point = rig.engine.axes()[0].set_point();
    assert!((set_point.position - position(&rig)).abs() < 0.01, "{set_point:?}");
}

#[test]
fn a_torque_begins_from_what_the_position_loop_has_made_against_a_load() {
    let mut rig = streaming();
    rig.stream(0.0, 0.0);
    rig.drive(0).load = -16.0;
    rig.run(1_000);
    rig.host.records.clear();
    rig.stream_target(AxisTarget::Torque(16.0));
    rig.run(200);
    assert_torque_steps_within(&rig, RATE * PERIOD_S * 1.001);
    assert_eq!((torque(&rig), causes(&rig)), (16.0, vec![]));
    // And back, where only the set-point that begins anew can be felt.
    rig.host.records.clear();
    rig.stream_target(AxisTarget::Torque(10.0));
    rig.run(50);
    rig.request(Request::Stop(StopCategory::Two));
    rig.run(1_000);
    assert_torque_steps_within(&rig, 2.5);
}

#[test]
fn a_joint_that_a_torque_drives_is_stopped_before_its_position_limit() {
    for sign in [1.0, -1.0] {
        let mut rig = streaming();
        rig.stream_target(AxisTarget::Torque(sign * 8.0));
        let mut farthest: f64 = 0.0;
        for _ in 0..5_000 {
            rig.run(1);
            farthest = farthest.max(position(&rig).abs());
        }
        let [StopCause::Fault(Fault::PositionLimit { limit, .. })] = causes(&rig)[..] else {
            panic!("{:?}", causes(&rig))
        };
        assert_eq!((limit, rig.phase()), (sign * LIMITS.position_max, Phase::Holding));
        assert!((2.9..=3.0).contains(&farthest), "{farthest}");
    }
}

#[test]
fn a_joint_that_a_torque_drives_is_stopped_in_time_where_set_points_wait_for_a_slower_bus() {
    let mut parameters = parameters(4);
    parameters.axes[0] = axis_in(LAW, 0, 1);
    parameters.axes[0].torque_limits = TorqueLimits { stiffness: 2000.0, damping: 100.0, rate: RATE };
    parameters.buses[1].divider = 4;
    let mut rig = Rig::of(parameters).enable();
    rig.request(Request::Stream);
    let here = |rig: &Rig, axis: usize| State::rest(rig.engine.axes()[axis].set_point().position);
    let mut targets = [AxisTarget::Torque(1.0); MAX_AXES];
    for (axis, target) in targets.iter_mut().enumerate().take(4).skip(1) {
        *target = AxisTarget::Position { state: here(&rig, axis), torque: 0.0 };
    }
    rig.host.wish = Some(StreamWish::Targets(targets));
    rig.run(18_000);
    assert!(
        matches!(causes(&rig)[..], [StopCause::Fault(Fault::PositionLimit { .. })]),
        "{:?}",
        causes(&rig)
    );
    assert_eq!(rig.phase(), Phase::Holding);
    let farthest = rig.host.records.iter().map(|record| record.axes[0].position_set).fold(0.0, f64::max);
    assert!(farthest <= LIMITS.position_max + 1e-9, "{farthest}");
}

#[test]
fn a_joint_that_a_torque_makes_too_fast_is_stopped_within_its_limits() {
    let mut rig = streaming();
    rig.stream_target(AxisTarget::Torque(1e6));
    rig.run(3_000);
    let [StopCause::Fault(Fault::VelocityLimit { velocity, limit })] = causes(&rig)[..] else {
        panic!("{:?}", causes(&rig))
    };
    assert!(limit == LIMITS.velocity && velocity < 1.1 * limit, "{velocity}");
    assert_eq!((rig.phase(), rig.stops()[0].category), (Phase::Holding, StopCategory::Two));
    assert!(rig.host.records.iter().all(|record| record.axes[0].torque_set.abs() <= LIMITS.torque as f32));
}

#[test]
fn a_stream_of_torques_that_runs_dry_leaves_the_joint_held_and_goes_on_without_a_bump() {
    let mut rig = streaming();
    rig.stream_target(AxisTarget::Torque(5.0));
    rig.run(300);
    let moving_at = position(&rig);
    rig.host.wish = Some(StreamWish::Dry([AxisTarget::Torque(5.0); MAX_AXES]));
    rig.run(1_000);
    assert_eq!(rig.host.snapshot.groups[0].stream.state, StreamState::Dry);
    assert!(rig.engine.axes()[0].velocity().abs() < 0.01);
    let way = position(&rig) - moving_at;
    assert!((0.0..0.3).contains(&way), "{way}");
    rig.drive(0).load = -10.0;
    rig.run(1_000);
    assert!((position(&rig) - moving_at - way).abs() < 0.01, "it is held against a load");
    rig.drive(0).load = 0.0;
    rig.run(1_000);
    rig.stream_target(AxisTarget::Torque(-2.0));
    rig.run(300);
    assert_eq!((rig.host.snapshot.groups[0].stream.state, torque(&rig)), (StreamState::Following, -2.0));
    assert_eq!(causes(&rig), []);
    assert_torque_steps_within(&rig, 2.5);
}

#[test]
fn a_stop_while_a_torque_drives_the_joint_begins_where_it_is() {
    for category in [StopCategory::Two, StopCategory::One] {
        let mut rig = streaming();
        rig.stream_target(AxisTarget::Torque(6.0));
        rig.run(400);
        rig.request(Request::Stop(category));
        rig.run(1_500);
        let end = if category == StopCategory::Two { Phase::Holding } else { Phase::Disabled };
        assert_eq!(rig.phase(), end);
        assert!(rig.engine.axes()[0].velocity().abs() < 0.01);
    }
    let mut rig = streaming();
    rig.stream_target(AxisTarget::Torque(6.0));
    rig.run(400);
    rig.request(Request::Stop(StopCategory::Two));
    rig.run(1_000);
    assert_torque_steps_within(&rig, 2.5);
}

#[test]
fn an_impedance_is_a_spring_that_may_be_pushed_away_and_is_no_following_error() {
    let mut rig = streaming();
    rig.stream_target(impedance(0.0, 50.0, 5.0));
    rig.run(200);
    rig.drive(0).load = 10.0;
    rig.run(3_000);
    assert_eq!((causes(&rig), rig.phase()), (vec![], Phase::Streaming));
    assert!((position(&rig) - 10.0 / 50.0).abs() < 0.005, "{}", position(&rig));
    assert!((torque(&rig) + 10.0).abs() < 0.2, "{}", torque(&rig));
    rig.drive(0).load = 0.0;
    rig.run(3_000);
    assert!(position(&rig).abs() < 0.005);
}

#[test]
fn the_torque_of_an_impedance_is_bounded_however_far_the_joint_is_pushed() {
    let mut rig = streaming();
    rig.stream_target(impedance(0.0, 100.0, 20.0));
    rig.run(200);
    rig.drive(0).load = 45.0;
    rig.run(400);
    assert_eq!(torque(&rig), -LIMITS.torque);
    assert_eq!(causes(&rig), []);
}

#[test]
fn a_joint_on_a_spring_that_is_pushed_beyond_its_position_limit_is_stopped() {
    let mut rig = streaming();
    rig.stream_target(impedance(2.9, 20.0, 5.0));
    rig.run(4_000);
    rig.drive(0).load = 20.0;
    rig.run(2_000);
    assert_eq!(rig.stops()[0].rule(), Rule::PositionLimit);
    assert!(position(&rig) < 3.1);
}

#[test]
fn what_comes_after_an_impedance_begins_where_the_joint_was_pushed_to() {
    let mut rig = streaming();
    rig.stream_target(impedance(0.0, 50.0, 5.0));
    rig.drive(0).load = 10.0;
    rig.run(3_000);
    let pushed = position(&rig);
    assert!(pushed > 0.15);
    rig.host.records.clear();
    rig.request(Request::Stop(StopCategory::Two));
    rig.run(1_000);
    assert_eq!(rig.phase(), Phase::Holding);
    assert!((position(&rig) - pushed).abs() < 0.02, "{} for {pushed}", position(&rig));
    assert_torque_steps_within(&rig, 2.5);
}

#[test]
fn a_change_of_gains_changes_the_torque_no_faster_than_its_rate() {
    let mut rig = streaming();
    rig.stream_target(impedance(0.0, 50.0, 10.0));
    rig.drive(0).load = 10.0;
    rig.run(3_000);
    rig.host.records.clear();
    rig.stream_target(impedance(0.0, 150.0, 20.0));
    rig.run(1);
    rig.stream_target(impedance(0.0, 100.0, 20.0));
    rig.run(3_000);
    assert!((position(&rig) - 0.1).abs() < 0.005, "{}", position(&rig));
    assert_torque_steps_within(&rig, RATE * PERIOD_S + 0.4);
}

#[test]
fn a_stream_of_an_impedance_that_runs_dry_stays_soft() {
    let mut rig = streaming();
    rig.stream_target(impedance(0.0, 50.0, 5.0));
    rig.run(100);
    rig.host.wish = Some(StreamWish::Dry([impedance(0.0, 50.0, 5.0); MAX_AXES]));
    rig.drive(0).load = 10.0;
    rig.run(3_000);
    assert_eq!(causes(&rig), []);
    assert!((position(&rig) - 0.2).abs() < 0.005);
}

#[test]
fn gains_whose_products_are_not_numbers_are_a_stop_and_the_torque_stays_as_it_was() {
    let mut parameters = parameters(1);
    parameters.axes[0] = axis_in(LAW, 0, 1);
    parameters.axes[0].torque_limits = TorqueLimits::NONE;
    let mut rig = Rig::of(parameters).enable();
    rig.run(200);
    rig.request(Request::Stream);
    rig.drive(0).load = -5.0;
    let state = State::rest(position(&rig));
    let mild = AxisTarget::Impedance { state, stiffness: 400.0, damping: 5.0, torque: 10.0 };
    rig.stream_target(mild);
    rig.run(20);
    // Its position has noise, of 1.5 rad/s from one report to the next.
    let here = rig.drive(0).position;
    let noise = [125, 0, 125, 0, 125].map(|counts| (DriveState::OperationEnabled, here + counts));
    rig.drive(0).lies.extend(noise);
    rig.stream_target(AxisTarget::Impedance { state, stiffness: f64::MAX, damping: f64::MAX, torque: 10.0 });
    rig.run(5);
    let [StopCause::Fault(Fault::NotFinite { .. })] = causes(&rig)[..] else { panic!("{:?}", rig.stops()) };
    rig.run_until(Phase::Holding, 2_000);
    let torques = || rig.host.records.iter().map(|record| f64::from(record.axes[0].torque_set));
    assert!(torques().all(|torque| torque.abs() <= LIMITS.torque));
    assert!(
        (torques().next_back().unwrap() - 5.0).abs() < 2.0,
        "the load is held: {:?}",
        torques().next_back()
    );
}

#[test]
fn gains_beyond_what_the_axis_allows_are_a_stop_before_they_act() {
    for (stiffness, damping, rule) in [
        (2000.1, 1.0, Rule::StiffnessLimit),
        (-1.0, 1.0, Rule::StiffnessLimit),
        (1.0, 100.1, Rule::DampingLimit),
        (1.0, -0.1, Rule::DampingLimit),
        (f64::NAN, 1.0, Rule::NotFinite),
    ] {
        let mut rig = streaming();
        rig.stream_target(impedance(0.0, stiffness, damping));
        rig.run(500);
        let stops = rig.stops();
        assert_eq!((stops.len(), stops[0].rule(), rig.phase()), (1, rule, Phase::Holding));
        assert!(position(&rig).abs() < 1e-3);
    }
}

#[test]
fn a_torque_or_an_impedance_in_a_mode_without_one_is_a_stop_before_anything_moves() {
    for (law, mode) in [
        (ControlLaw::Position, OperationMode::CyclicSynchronousPosition),
        (ControlLaw::Velocity { position_gain: 20.0 }, OperationMode::CyclicSynchronousVelocity),
        (ControlLaw::Interpolated, OperationMode::InterpolatedPosition),
    ] {
        for target in [AxisTarget::Torque(1.0), impedance(0.1, 1.0, 1.0)] {
            let mut rig = streaming_in(law);
            let before = position(&rig);
            rig.stream_target(target);
            rig.run(200);
            assert_eq!(causes(&rig), [StopCause::Fault(Fault::NoTorqueInMode { mode })]);
            assert_eq!((position(&rig), rig.phase()), (before, Phase::Holding));
        }
    }
}

#[test]
fn a_torque_that_is_fed_forward_carries_a_load() {
    let mut rig = streaming();
    rig.stream(0.0, 0.0);
    rig.run(100);
    rig.drive(0).load = -16.0;
    rig.run(1_000);
    assert!((position(&rig) + 16.0 / 1600.0).abs() < 1e-3, "{}", position(&rig));
    rig.host.records.clear();
    rig.stream_target(AxisTarget::Position { state: State::rest(0.0), torque: 16.0 });
    rig.run(1_000);
    assert!(position(&rig).abs() < 1e-4, "{}", position(&rig));
    assert_torque_steps_within(&rig, 2.5);
}

/// A velocity is led to by the set-point, so that it is the same in every law.
const LAWS: [ControlLaw; 4] =
    [ControlLaw::Position, ControlLaw::Velocity { position_gain: 20.0 }, LAW, ControlLaw::Interpolated];

#[test]
fn a_velocity_is_reached_within_the_limits_in_every_law() {
    for law in LAWS {
        let mut rig = streaming_in(law);
        rig.stream_target(AxisTarget::Velocity { velocity: 0.8, acceleration: 0.0 });
        rig.run(500);
        let set_point = rig.engine.axes()[0].set_point();
        assert!((set_point.velocity - 0.8).abs() < 1e-9, "{set_point:?}");
        assert!((rig.engine.axes()[0].velocity() - 0.8).abs() < 0.02);
        assert_eq!(causes(&rig), []);
        rig.assert_limits_kept();
    }
}

#[test]
fn a_velocity_towards_a_position_limit_ends_at_it_without_a_stop() {
    for law in LAWS {
        let mut rig = streaming_in(law);
        rig.stream_target(AxisTarget::Velocity { velocity: -1.9, acceleration: 0.0 });
        rig.run(4_000);
        assert_eq!((causes(&rig), rig.phase()), (vec![], Phase::Streaming));
        assert!((rig.engine.axes()[0].set_point().position - LIMITS.position_min).abs() < 1e-6);
        rig.stream_target(AxisTarget::Velocity { velocity: 0.5, acceleration: 0.0 });
        rig.run(500);
        assert!((rig.engine.axes()[0].velocity() - 0.5).abs() < 0.02);
        rig.assert_limits_kept();
    }
}

#[test]
fn a_stream_of_velocities_that_runs_dry_comes_to_rest_where_it_can_stop() {
    let mut rig = streaming_in(ControlLaw::Position);
    rig.stream_target(AxisTarget::Velocity { velocity: 1.0, acceleration: 0.0 });
    rig.run(500);
    let before = position(&rig);
    let last = AxisTarget::Velocity { velocity: 0.0, acceleration: 0.0 };
    rig.host.wish = Some(StreamWish::Dry([last; MAX_AXES]));
    rig.run(500);
    // 1 rad/s at 10 rad/s² and 200 rad/s³: 0.05 m and half a ramp of the deceleration more.
    let way = position(&rig) - before;
    assert!((way - 0.075).abs() < 0.01, "{way}");
    assert!(rig.engine.axes()[0].set_point().velocity.abs() < 1e-9);
    rig.assert_limits_kept();
}

fn target() -> impl Strategy<Value = AxisTarget> {
    let state = (-2.5f64..2.5, -1.0f64..1.0).prop_map(|(position, velocity)| State {
        position,
        velocity,
        acceleration: 0.0,
    });
    prop_oneof![
        (state.clone(), -50.0f64..50.0).prop_map(|(state, torque)| AxisTarget::Position { state, torque }),
        (state, 0.0f64..300.0, 5.0f64..30.0, -20.0f64..20.0).prop_map(
            |(state, stiffness, damping, torque)| AxisTarget::Impedance { state, stiffness, damping, torque }
        ),
        (-3.0f64..3.0).prop_map(|velocity| AxisTarget::Velocity { velocity, acceleration: 0.0 }),
        (-50.0f64..50.0).prop_map(AxisTarget::Torque),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn whatever_kinds_follow_each_other_the_torque_keeps_its_limit_and_the_joint_its_range(
        targets in prop::collection::vec((target(), 1usize..300, -10.0f64..10.0), 1..15),
    ) {
        let mut rig = streaming();
        for (target, cycles, load) in targets {
            if rig.phase() != Phase::Streaming {
                break;
            }
            rig.stream_target(target);
            rig.drive(0).load = load;
            for _ in 0..cycles {
                rig.run(1);
                prop_assert!(torque(&rig).abs() <= LIMITS.torque);
                prop_assert!(position(&rig).abs() < LIMITS.position_max + 0.05, "{}", position(&rig));
            }
        }
        // Nothing but the guard of the joint itself may stop it, or an error that a load and a wrong torque make.
        for stop in rig.stops() {
            prop_assert!(
                matches!(stop.rule(), Rule::PositionLimit | Rule::VelocityLimit | Rule::FollowingError),
                "{stop:?}"
            );
        }
        rig.drive(0).load = 0.0;
        rig.request(Request::Stop(StopCategory::Two));
        rig.run(3_000);
        prop_assert!(rig.engine.axes()[0].velocity().abs() < 0.02);
    }
}
