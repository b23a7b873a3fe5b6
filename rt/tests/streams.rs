//! Streams of set-points: what becomes of one that does not begin, that says of itself what is not so, that is not renewed.

mod fixture;

use fixture::{LIMITS, PERIOD_NS, Rig, axis_in, jerk_limited, parameters};
use takt_rt::plan::{self, Limits, Problem, Profile, State};
use takt_rt::{
    AxisLimits, ControlLaw, MAX_AXES, OnViolation, Phase, Request, Rule, StopCategory, StreamCommand,
};

const VELOCITY: ControlLaw = ControlLaw::Velocity { position_gain: 20.0 };
const TORQUE: ControlLaw = ControlLaw::Torque {
    stiffness: 400.0,
    damping: 40.0,
    inertia: 1.0,
    viscous_friction: 5.0,
    coulomb_friction: 0.0,
};

/// One axis that follows a stream, standing at 0.
fn streaming(law: ControlLaw, on_violation: OnViolation) -> Rig {
    streaming_within(LIMITS, law, on_violation)
}

fn streaming_within(limits: AxisLimits, law: ControlLaw, on_violation: OnViolation) -> Rig {
    let mut parameters = parameters(1);
    parameters.axes[0] = axis_in(law, 0, 1);
    parameters.axes[0].limits = limits;
    parameters.axes[0].on_violation = on_violation;
    let mut rig = Rig::of(parameters).enable();
    rig.move_to(0.0);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(500);
    let mut numbers = 0;
    let _ = numbers;
    rig.request(Request::Stream);
    rig
}

fn stream(rig: &mut Rig, set_point: State) {
    let valid_until_ns = rig.clock.now_ns + 5 * PERIOD_NS;
    rig.host.stream = Some(StreamCommand { valid_until_ns, set_points: [set_point; MAX_AXES] });
}

#[test]
fn a_stream_that_is_asked_for_and_never_begins_is_a_stop() {
    let mut rig = Rig::enabled(3);
    rig.request(Request::Stream);
    rig.run(450);
    assert_eq!(rig.phase(), Phase::Streaming);
    rig.run(100);
    let stops = rig.stops();
    assert_eq!((stops.len(), stops[0].rule(), stops[0].category), (1, Rule::StaleCommand, StopCategory::Two));
    assert_eq!(rig.phase(), Phase::Holding);
}

#[test]
fn a_command_that_had_expired_before_the_stream_began_does_not_begin_it() {
    let mut rig = Rig::enabled(3);
    rig.move_to(0.0);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(10);
    rig.request(Request::Stream);
    let set_points = [State { position: 0.001, velocity: 1.0, acceleration: 0.0 }; MAX_AXES];
    rig.host.stream = Some(StreamCommand { valid_until_ns: rig.clock.now_ns - 1, set_points });
    rig.run(50);
    assert_eq!(
        (rig.phase(), rig.stops().len()),
        (Phase::Streaming, 0),
        "it still waits for its first command"
    );
    assert_eq!(rig.engine.axes()[0].set_point().position, 0.0);
}

#[test]
fn what_a_standing_stream_says_of_its_velocity_and_acceleration_turns_no_joint() {
    // More than the limits, as much as they allow, and the other way.
    for (velocity, acceleration) in
        [(1e9, 1e9), (LIMITS.velocity, LIMITS.acceleration), (-LIMITS.velocity, -1e300)]
    {
        for law in [VELOCITY, TORQUE] {
            let mut rig = streaming(law, OnViolation::Reject);
            for _ in 0..300 {
                stream(&mut rig, State { position: 0.0, velocity, acceleration });
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
    let mut rig = streaming(VELOCITY, OnViolation::Reject);
    let period_s = PERIOD_NS as f64 * 1e-9;
    let (mut position, mut velocity) = (0.0, 0.0_f64);
    for _ in 0..400 {
        let acceleration = if velocity < 1.0 { 5.0 } else { 0.0 };
        velocity += acceleration * period_s;
        position += velocity * period_s;
        stream(&mut rig, State { position, velocity, acceleration });
        rig.run(1);
        let set = rig.engine.axes()[0].set_point();
        assert_eq!((set.position, set.velocity), (position, velocity));
    }
    assert!(rig.stops().is_empty());
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
fn a_stream_of_positions_planned_at_the_very_limits_is_followed_and_can_be_stopped_anywhere() {
    for (acceleration, deceleration, jerk) in
        [(8.0, 8.0, 100.0), (6.0, 12.0, 1000.0), (12.0, 5.0, 60.0), (8.0, 8.0, f64::INFINITY)]
    {
        let limits = AxisLimits { acceleration, deceleration, jerk, ..LIMITS };
        let profile = to_the_limit(&limits);
        let period_s = PERIOD_NS as f64 * 1e-9;
        let cycles = (profile.duration_s() / period_s).ceil() as usize;
        for expired_in in (1..=cycles).step_by(37).chain([cycles + 50]) {
            let mut rig = streaming_within(limits, ControlLaw::Position, OnViolation::Reject);
            let before = rig.host.records.len();
            for cycle in 1..=expired_in {
                let position = profile.sample(cycle as f64 * period_s).position;
                // What it says of its velocity is left out, and it is never carried on.
                let valid_until_ns = rig.clock.now_ns + PERIOD_NS;
                let set_points = [State::rest(position); MAX_AXES];
                rig.host.stream = Some(StreamCommand { valid_until_ns, set_points });
                rig.run(1);
                assert_eq!(rig.engine.axes()[0].set_point().position, position, "in cycle {cycle}");
            }
            rig.run(2_000);
            let stops = rig.stops();
            assert_eq!(stops.len(), 1, "{stops:?}");
            assert_eq!((stops[0].rule(), stops[0].category), (Rule::StaleCommand, StopCategory::Two));
            assert_eq!(rig.phase(), Phase::Holding);
            let records = rig.host.records.iter().skip(before);
            let set: Vec<f64> = records.map(|record| record.axes[0].position_set).collect();
            for steps in set.windows(2) {
                let velocity = (steps[1] - steps[0]) / period_s;
                assert!(velocity.abs() <= limits.velocity * (1.0 + 2e-6), "{velocity}");
                assert!(steps[1] <= limits.position_max + 6e-6, "{}", steps[1]);
            }
        }
    }
}

const JERK: f64 = 100.0;

/// An axis with this limit of the jerk that holds, for a stream that has not been asked for yet; and the number of records so far.
fn holding(jerk: f64) -> (Rig, usize) {
    let mut rig = Rig::of(jerk_limited(1, jerk)).enable();
    rig.move_to(0.0);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(10);
    let before = rig.host.records.len();
    (rig, before)
}

/// The highest jerk that the drive has been asked for since so many records, as it sees it: by the third differences of its
/// set-points.
fn highest_jerk(rig: &Rig, before: usize) -> f64 {
    let set: Vec<f64> =
        rig.host.records[before - 3..].iter().map(|record| record.axes[0].position_set).collect();
    let period_s = PERIOD_NS as f64 * 1e-9;
    let jerk = |set: &[f64]| (set[3] - 3.0 * set[2] + 3.0 * set[1] - set[0]).abs() / period_s.powi(3);
    set.windows(4).map(jerk).fold(0.0, f64::max)
}

/// The jerk limit, with room for the rounding of positions.
const JERK_AT_MOST: f64 = JERK * (1.0 + 1e-5) + 1e-5;

#[test]
fn a_stream_that_leaps_at_its_start_is_refused_however_long_its_first_command_is_waited_for() {
    let period_s = PERIOD_NS as f64 * 1e-9;
    for waited_for in [0, 1, 2, 5, 40] {
        let (mut rig, before) = holding(JERK);
        rig.host.requests.push_back(Request::Stream);
        rig.run(waited_for);
        for cycle in 1..100 {
            // At once at an acceleration below its limit, with a hundred times the jerk.
            let (time_s, acceleration) = (f64::from(cycle) * period_s, 0.9 * LIMITS.acceleration);
            let position = acceleration * time_s * time_s / 2.0;
            stream(&mut rig, State { position, velocity: acceleration * time_s, acceleration });
            rig.run(1);
        }
        let highest = highest_jerk(&rig, before);
        assert!(highest <= JERK_AT_MOST, "{highest} after {waited_for} cycles");
        let rules: Vec<Rule> = rig.stops().iter().map(|stop| stop.rule()).collect();
        assert_eq!(rules, [Rule::JerkLimit], "after {waited_for} cycles");
    }
}

/// Near all limits, on the way to the highest position.
fn near_its_limits(limits: &AxisLimits) -> (Profile, i32) {
    let nearly = AxisLimits {
        velocity: 0.95 * limits.velocity,
        acceleration: 0.9 * limits.acceleration,
        deceleration: 0.9 * limits.deceleration,
        jerk: 0.9 * limits.jerk,
        position_max: 0.99 * limits.position_max,
        ..*limits
    };
    let profile = to_the_limit(&nearly);
    let cycles = (profile.duration_s() / (PERIOD_NS as f64 * 1e-9)).ceil() as i32;
    (profile, cycles)
}

/// Streams a motion near all limits, of which commands come only in some cycles. Returns how far the set-points have been from
/// it at most, while it moved and at its end.
fn streamed_with_gaps(rig: &mut Rig, says_all: bool, comes: impl Fn(i32) -> bool) -> (f64, f64) {
    let (profile, cycles) = near_its_limits(&rig.engine.axes()[0].parameters().limits);
    rig.request(Request::Stream);
    let (mut farthest, mut last) = (0.0_f64, 0.0);
    for cycle in 1..=cycles + 100 {
        let state = profile.sample(f64::from(cycle) * PERIOD_NS as f64 * 1e-9);
        if comes(cycle) {
            stream(rig, if says_all { state } else { State::rest(state.position) });
        }
        rig.run(1);
        last = (rig.engine.axes()[0].set_point().position - state.position).abs();
        farthest = farthest.max(last);
    }
    (farthest, last)
}

/// As clients do that wake up a little late: the set-point of one cycle never comes, and the next one is on time.
#[test]
fn a_stream_near_its_limits_that_misses_a_command_now_and_then_goes_on_whether_it_says_its_velocity_or_not() {
    for missing in 2..40 {
        for says_all in [false, true] {
            let (mut rig, before) = holding(JERK);
            let (farthest, last) = streamed_with_gaps(&mut rig, says_all, |cycle| cycle % 40 != missing);
            assert_eq!((rig.stops(), rig.phase()), (vec![], Phase::Streaming), "{missing}, {says_all}");
            let highest = highest_jerk(&rig, before);
            assert!(highest <= JERK_AT_MOST, "{missing}, {says_all}: {highest}");
            assert!(farthest > 0.0 && farthest < 1e-4, "{missing}, {says_all}: {farthest:e}");
            assert!(last < 1e-9, "{missing}, {says_all}: {last:e} at the end");
        }
    }
}

#[test]
fn a_stream_near_its_limits_that_is_slower_than_the_cycle_is_followed_within_all_of_them() {
    for every in 2..=5 {
        for (says_all, jerk) in [(false, JERK), (true, JERK), (false, f64::INFINITY)] {
            let (mut rig, before) = holding(jerk);
            let (farthest, last) = streamed_with_gaps(&mut rig, says_all, |cycle| cycle % every == 0);
            let what = format!("every {every}, {says_all}, jerk {jerk}");
            assert_eq!((rig.stops(), rig.phase()), (vec![], Phase::Streaming), "{what}");
            rig.assert_limits_kept();
            let highest = highest_jerk(&rig, before);
            assert!(jerk.is_infinite() || highest <= JERK_AT_MOST, "{what}: {highest}");
            // It is near its limits too when it has to catch up.
            assert!(farthest < 2e-3, "{what}: {farthest:e}");
            assert!(last < 1e-9, "{what}: {last:e} at the end");
        }
    }
}

/// Numbers that look random, the same ones in each run: xorshift.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % end
    }
}

/// A swing whose commands stay away for some cycles again and again, and in the end for good. What has fallen behind such a
/// stream catches up with it by all that the limits allow.
#[test]
fn a_stream_that_is_caught_up_with_is_stopped_within_the_limits_when_its_commands_stay_away_again() {
    let period_s = PERIOD_NS as f64 * 1e-9;
    for (seed, jerk) in (1..).zip([30.0, 60.0, 100.0, 200.0].repeat(100)) {
        let mut numbers = Numbers(seed);
        let limits = AxisLimits { jerk, ..LIMITS };
        let (speed, acceleration) = (0.85 * limits.velocity, 0.4 * limits.acceleration);
        let rate = acceleration / speed;
        let mut rig = streaming_within(limits, ControlLaw::Position, OnViolation::Clamp);
        let mut absent_cycles = 0;
        for cycle in 1..=1000 {
            if absent_cycles == 0 && numbers.below(3) == 0 {
                absent_cycles = 1 + numbers.below(20);
            }
            if absent_cycles == 0 {
                let time_s = f64::from(cycle) * period_s;
                // It begins gently.
                let share = (time_s / 0.5).min(1.0);
                let share = share * share * share * (10.0 + share * (6.0 * share - 15.0));
                let position = share * speed / rate * (1.0 - (rate * time_s).cos());
                let valid_until_ns = rig.clock.now_ns + 50 * PERIOD_NS;
                rig.host.stream =
                    Some(StreamCommand { valid_until_ns, set_points: [State::rest(position); MAX_AXES] });
            }
            absent_cycles = absent_cycles.saturating_sub(1);
            rig.run(1);
        }
        rig.run(2000);
        rig.assert_limits_kept();
        // A stop whose first step breaks a limit would take the power.
        assert_eq!(rig.phase(), Phase::Holding, "{seed}: {:?}", rig.stops());
    }
}

#[test]
fn a_stream_that_is_slower_than_the_cycle_and_leaps_is_stopped_by_its_jerk() {
    let period_s = PERIOD_NS as f64 * 1e-9;
    for every in 1..=5 {
        for says_all in [false, true] {
            let (mut rig, before) = holding(JERK);
            rig.request(Request::Stream);
            let (mut position, mut velocity, mut acceleration) = (0.0, 0.0, 0.0);
            for cycle in 1..=100 {
                // From an acceleration of 3.6 rad/s² to its opposite.
                let is_leaping = cycle == 41;
                acceleration = match cycle {
                    ..=40 => acceleration + 0.9 * JERK * period_s,
                    _ if is_leaping => -acceleration,
                    _ => acceleration,
                };
                velocity += acceleration * period_s;
                position += velocity * period_s;
                if cycle % every == 0 {
                    let state = State { position, velocity, acceleration };
                    stream(&mut rig, if says_all { state } else { State::rest(position) });
                }
                rig.run(1);
                assert!(
                    cycle > 40 || rig.stops().is_empty(),
                    "every {every}: {:?} in cycle {cycle}",
                    rig.stops()
                );
            }
            let highest = highest_jerk(&rig, before);
            assert!(highest <= JERK_AT_MOST, "every {every}, {says_all}: {highest}");
            let rules: Vec<Rule> = rig.stops().iter().map(|stop| stop.rule()).collect();
            assert_eq!(rules, [Rule::JerkLimit], "every {every}, {says_all}");
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
        let period_s = PERIOD_NS as f64 * 1e-9;
        let mut rig = streaming_within(limits, ControlLaw::Position, OnViolation::Reject);
        let mut cycle = 0;
        while rig.phase() == Phase::Streaming || cycle == 0 {
            cycle += 1;
            stream(&mut rig, profile.sample(f64::from(cycle) * period_s));
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
    let mut parameters = parameters(1);
    parameters.axes[0].limits.jerk = JERK;
    let mut rig = Rig::of(parameters).enable();
    rig.move_to(0.0);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(10);
    rig.request(Request::Stream);
    let period_s = PERIOD_NS as f64 * 1e-9;
    let (mut position, mut velocity, mut acceleration) = (0.0, 0.0, 0.0);
    let mut go_on = |rig: &mut Rig, jerk: f64| {
        acceleration += jerk * period_s;
        velocity += acceleration * period_s;
        position += velocity * period_s;
        stream(rig, State { position, velocity, acceleration });
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
fn what_is_no_number_is_refused_whether_streams_are_clamped_or_not() {
    for on_violation in [OnViolation::Reject, OnViolation::Clamp] {
        for (velocity, acceleration) in [(f64::NAN, 0.0), (f64::INFINITY, 0.0), (0.0, f64::NEG_INFINITY)] {
            let mut rig = streaming(TORQUE, on_violation);
            stream(&mut rig, State { position: 0.0, velocity, acceleration });
            rig.run(2);
            let torque = rig.host.records.last().unwrap().axes[0].torque_set;
            assert!(torque.abs() < 5.0, "{torque} N·m");
            let is_stopped = rig.stops().iter().any(|stop| stop.rule() == Rule::NotFinite);
            assert_eq!(is_stopped, on_violation == OnViolation::Reject);
            assert_eq!(rig.host.snapshot.clamped > 0, on_violation == OnViolation::Clamp);
        }
    }
}

#[test]
fn a_flood_of_requests_is_taken_a_few_in_a_cycle_and_the_stream_goes_on() {
    let mut rig = Rig::enabled(3);
    rig.move_to(0.0);
    rig.run_until(Phase::Holding, 5_000);
    rig.request(Request::Stream);
    for _ in 0..200 {
        rig.host.requests.extend([Request::Enable; 16]);
        rig.stream(0.0, 0.0, 5 * PERIOD_NS);
        let before = rig.host.taken;
        rig.run(1);
        assert!(rig.host.taken - before <= 4);
    }
    assert_eq!(rig.phase(), Phase::Streaming);
    assert!(rig.stops().is_empty());
}
