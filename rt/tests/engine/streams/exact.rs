//! `Follow::Exact`: every set-point is what the stream wants, or a fault.

use crate::fixture::{LIMITS, PERIOD_S, Rig, axis_in, parameters};
use takt_rt::plan::{self, Limits, Problem, Profile, State};
use takt_rt::{AxisLimits, ControlLaw, Follow, Phase, Request, Rule, StopCategory, StreamState};

const VELOCITY: ControlLaw = ControlLaw::Velocity { position_gain: 20.0 };
const TORQUE: ControlLaw = ControlLaw::Torque {
    stiffness: 400.0,
    damping: 40.0,
    inertia: 1.0,
    viscous_friction: 5.0,
    coulomb_friction: 0.0,
};

/// One axis that follows a stream exactly, standing at 0.
fn streaming(law: ControlLaw) -> Rig {
    streaming_within(LIMITS, law)
}

fn streaming_within(limits: AxisLimits, law: ControlLaw) -> Rig {
    let mut parameters = parameters(1);
    parameters.axes[0] = axis_in(law, 0, 1);
    parameters.axes[0].limits = limits;
    parameters.axes[0].follow = Follow::Exact;
    let mut rig = Rig::of(parameters).enable();
    rig.move_to(0.0);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(500);
    rig.request(Request::Stream);
    rig
}

/// From 0 to the highest position, at full velocity on the way, as fast as the limits allow.
fn to_the_limit(limits: &AxisLimits) -> Profile {
    let planned = Limits::asymmetric(
        limits.velocity,
        -limits.velocity,
        limits.acceleration,
        -limits.deceleration,
        limits.jerk,
    );
    let (start, target) = (State::rest(0.0), State::rest(limits.position_max));
    plan::position(&Problem { start, target, limits: planned }).unwrap()
}

#[test]
fn what_a_standing_stream_says_of_its_velocity_and_acceleration_turns_no_joint() {
    // More than the limits, as much as they allow, and the other way.
    for (velocity, acceleration) in
        [(1e9, 1e9), (LIMITS.velocity, LIMITS.acceleration), (-LIMITS.velocity, -1e300)]
    {
        for law in [VELOCITY, TORQUE] {
            let mut rig = streaming(law);
            rig.stream_state(State { position: 0.0, velocity, acceleration });
            for _ in 0..300 {
                rig.run(1);
                let turned = rig.engine.axes()[0].position().abs();
                assert!(turned < 0.03, "{law:?}: {turned} rad");
            }
            assert!(rig.engine.axes()[0].velocity().abs() < 0.05);
        }
    }
}

#[test]
fn a_stream_that_says_how_fast_it_is_is_followed_as_it_says() {
    let mut rig = streaming(VELOCITY);
    let (mut position, mut velocity) = (0.0, 0.0_f64);
    for _ in 0..400 {
        let acceleration = if velocity < 1.0 { 5.0 } else { 0.0 };
        velocity += acceleration * PERIOD_S;
        position += velocity * PERIOD_S;
        rig.stream_state(State { position, velocity, acceleration });
        rig.run(1);
        let set = rig.engine.axes()[0].set_point();
        assert_eq!((set.position, set.velocity), (position, velocity));
    }
    assert!(rig.stops().is_empty());
}

#[test]
fn a_stream_planned_at_the_very_limits_is_followed_and_can_be_stopped_anywhere() {
    for (acceleration, deceleration, jerk) in
        [(8.0, 8.0, 100.0), (6.0, 12.0, 1000.0), (12.0, 5.0, 60.0), (8.0, 8.0, f64::INFINITY)]
    {
        let limits = AxisLimits { acceleration, deceleration, jerk, ..LIMITS };
        let profile = to_the_limit(&limits);
        let cycles = (profile.duration_s() / PERIOD_S).ceil() as usize;
        for stopped_in in (1..=cycles).step_by(37).chain([cycles + 50]) {
            let mut rig = streaming_within(limits, ControlLaw::Position);
            let before = rig.host.records.len();
            for cycle in 1..=stopped_in {
                let position = profile.sample(cycle as f64 * PERIOD_S).position;
                // What it says of its velocity is not so.
                rig.stream(position, 0.0);
                rig.run(1);
                assert_eq!(rig.engine.axes()[0].set_point().position, position, "in cycle {cycle}");
            }
            rig.request(Request::Stop(StopCategory::Two));
            rig.run(2_000);
            let stops = rig.stops();
            assert_eq!(stops.len(), 1, "{stops:?}");
            assert_eq!((stops[0].rule(), rig.phase()), (Rule::Requested, Phase::Holding));
            let records = rig.host.records.iter().skip(before);
            let set: Vec<f64> = records.map(|record| record.axes[0].position_set).collect();
            for steps in set.windows(2) {
                let velocity = (steps[1] - steps[0]) / PERIOD_S;
                assert!(velocity.abs() <= limits.velocity * (1.0 + 2e-6), "{velocity}");
                assert!(steps[1] <= limits.position_max + 6e-6, "{}", steps[1]);
            }
        }
    }
}

#[test]
fn a_stream_planned_a_little_beyond_a_limit_is_refused_in_time() {
    let limits = AxisLimits { jerk: 100.0, ..LIMITS };
    let wider = [
        (Rule::VelocityLimit, AxisLimits { velocity: limits.velocity * 1.0001, ..limits }),
        (Rule::PositionLimit, AxisLimits { position_max: limits.position_max + 1e-4, ..limits }),
        (Rule::JerkLimit, AxisLimits { jerk: limits.jerk * 1.0001, ..limits }),
        (Rule::AccelerationLimit, AxisLimits { acceleration: limits.acceleration * 1.0001, ..limits }),
    ];
    for (rule, wider) in wider {
        let profile = to_the_limit(&wider);
        let mut rig = streaming_within(limits, ControlLaw::Position);
        let mut cycle = 0;
        while rig.phase() == Phase::Streaming || cycle == 0 {
            cycle += 1;
            rig.stream_state(profile.sample(f64::from(cycle) * PERIOD_S));
            rig.run(1);
        }
        rig.run_until(Phase::Holding, 5_000);
        let stops = rig.stops();
        assert_eq!(
            (stops.len(), stops[0].rule(), stops[0].category),
            (1, rule, StopCategory::Two),
            "{stops:?}"
        );
        let highest = rig.host.records.iter().map(|record| record.axes[0].position_set).fold(0.0, f64::max);
        assert!(highest <= limits.position_max + 6e-6, "{highest}");
    }
}

/// Within the limits of velocity and acceleration, and of the jerk too up to the cycle in which it leaps.
#[test]
fn a_stream_whose_acceleration_leaps_is_stopped_by_its_jerk() {
    const JERK: f64 = 200.0;
    let mut rig = streaming_within(AxisLimits { jerk: JERK, ..LIMITS }, ControlLaw::Position);
    let (mut position, mut velocity, mut acceleration) = (0.0, 0.0, 0.0);
    let mut go_on = |rig: &mut Rig, jerk: f64| {
        acceleration += jerk * PERIOD_S;
        velocity += acceleration * PERIOD_S;
        position += velocity * PERIOD_S;
        rig.stream_state(State { position, velocity, acceleration });
        rig.run(1);
    };
    (0..20).for_each(|_| go_on(&mut rig, 0.9 * JERK));
    assert_eq!((rig.phase(), rig.stops()), (Phase::Streaming, vec![]));
    go_on(&mut rig, 1.5 * JERK);
    let stops = rig.stops();
    assert_eq!((stops.len(), stops[0].rule(), stops[0].category), (1, Rule::JerkLimit, StopCategory::Two));
    let (jerk, limit) = stops[0].cause.numbers();
    assert!((jerk - 1.5 * JERK).abs() < 1e-3 && limit == JERK, "{stops:?}");
    rig.run_until(Phase::Holding, 1_000);
    rig.assert_limits_kept();
}

#[test]
fn a_stream_may_not_jump_at_its_start() {
    for (bad, rule) in [
        (0.1, Rule::StartPose),
        (0.01, Rule::VelocityLimit),
        (f64::NAN, Rule::NotFinite),
        (0.001, Rule::AccelerationLimit),
    ] {
        let mut rig = streaming(ControlLaw::Position);
        rig.stream(bad, 0.0);
        rig.run(2);
        assert_eq!(rig.stops().iter().map(|stop| stop.rule()).collect::<Vec<_>>(), [rule]);
        assert_eq!(rig.phase(), Phase::Holding);
        rig.assert_limits_kept();
    }
}

#[test]
fn what_is_no_number_is_refused() {
    for (velocity, acceleration) in [(f64::NAN, 0.0), (f64::INFINITY, 0.0), (0.0, f64::NEG_INFINITY)] {
        let mut rig = streaming(TORQUE);
        rig.stream_state(State { position: 0.0, velocity, acceleration });
        rig.run(2);
        let torque = rig.host.records.last().unwrap().axes[0].torque_set;
        assert!(torque.abs() < 5.0, "{torque} N·m");
        assert_eq!(rig.stops()[0].rule(), Rule::NotFinite);
    }
}

#[test]
fn a_stream_that_could_not_stop_before_its_limit_any_more_is_stopped_in_time() {
    let mut rig = streaming(ControlLaw::Position);
    let (mut position, mut velocity) = (0.0, 0.0_f64);
    for _ in 0..3_000 {
        velocity = (velocity + 5.0 * PERIOD_S).min(1.9);
        position += velocity * PERIOD_S;
        rig.stream(position, velocity);
        rig.run(1);
    }
    assert_eq!(rig.stops()[0].rule(), Rule::PositionLimit);
    assert_eq!(rig.phase(), Phase::Holding);
    let rest = rig.host.snapshot.axes[0].position_set;
    assert!(rest <= 3.0 + 1e-6 && rest > 2.9, "{rest}");
    rig.assert_limits_kept();
}

#[test]
fn a_stream_that_lies_about_its_velocity_is_stopped_from_the_velocity_that_it_has() {
    let mut rig = streaming(ControlLaw::Position);
    let (mut position, mut velocity) = (0.0, 0.0_f64);
    for _ in 0..300 {
        velocity = (velocity + 5.0 * PERIOD_S).min(1.0);
        position += velocity * PERIOD_S;
        rig.stream(position, 0.0);
        rig.run(1);
    }
    rig.stream(position + 0.1, 0.0);
    rig.run_until(Phase::Holding, 1_000);
    let stops = rig.stops();
    assert_eq!((stops.len(), stops[0].category), (1, StopCategory::Two), "{stops:?}");
    rig.assert_limits_kept();
}

#[test]
fn a_stream_that_runs_dry_comes_to_rest_and_goes_on_only_from_where_it_rests() {
    for goes_on_by in [0.0, 0.01] {
        let mut rig = streaming(ControlLaw::Position);
        let (mut position, mut velocity) = (0.0, 0.0_f64);
        for _ in 0..300 {
            velocity = (velocity + 5.0 * PERIOD_S).min(1.0);
            position += velocity * PERIOD_S;
            rig.stream(position, 0.0);
            rig.run(1);
        }
        rig.dry_up(position);
        rig.run(500);
        assert_eq!(
            (rig.phase(), rig.host.snapshot.groups[0].stream.state),
            (Phase::Streaming, StreamState::Dry)
        );
        let rest = rig.engine.axes()[0].set_point();
        // From 1 rad/s at 10 rad/s².
        assert!(rest.velocity == 0.0 && (rest.position - position - 0.05).abs() < 1e-3, "{rest:?}");
        rig.stream(rest.position + goes_on_by, 0.0);
        rig.run(5);
        let rules: Vec<Rule> = rig.stops().iter().map(|stop| stop.rule()).collect();
        assert_eq!(rules, if goes_on_by == 0.0 { vec![] } else { vec![Rule::VelocityLimit] });
        rig.assert_limits_kept();
    }
}
