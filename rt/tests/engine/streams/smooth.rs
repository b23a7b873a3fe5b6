//! `Follow::Smooth`: whatever a stream wants is followed as closely as the limits allow.

use crate::fixture::{LIMITS, PERIOD_S, Rig, jerk_limited};
use takt_rt::plan::State;
use takt_rt::{EventKind, Phase, Request, Rule, StopCategory, StreamState};

const JERK: f64 = 100.0;

/// Axes that are asked for a stream, standing at 0.
fn streaming(jerk: f64) -> Rig {
    let mut rig = Rig::of(jerk_limited(2, jerk)).enable();
    rig.move_to(0.0);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(10);
    rig.host.records.clear();
    rig.request(Request::Stream);
    rig
}

#[test]
fn a_stream_that_is_asked_for_and_never_begins_is_a_stop() {
    let mut rig = streaming(JERK);
    rig.run(450);
    assert_eq!(
        (rig.phase(), rig.host.snapshot.groups[0].stream.state),
        (Phase::Streaming, StreamState::Awaited)
    );
    rig.run(100);
    let stops = rig.stops();
    assert_eq!((stops.len(), stops[0].rule(), stops[0].category), (1, Rule::StaleCommand, StopCategory::Two));
    assert_eq!((rig.phase(), rig.host.snapshot.groups[0].stream.state), (Phase::Holding, StreamState::Idle));
}

#[test]
fn a_step_is_made_at_the_limits_and_not_overshot() {
    for jerk in [JERK, f64::INFINITY] {
        for step in [1e-6, 1e-4, 0.001, 0.019, 0.3, 2.0] {
            let mut rig = streaming(jerk);
            rig.stream(step, 0.0);
            rig.run(3_000);
            assert_eq!(rig.stops(), []);
            rig.assert_differences_kept(jerk);
            let set = rig.host.records.iter().map(|record| record.axes[0].position_set);
            let farthest = set.fold(0.0, f64::max);
            assert!(farthest <= step + 1e-9, "{farthest} for {step}");
            assert!((rig.engine.axes()[0].set_point().position - step).abs() < 1e-9);
        }
    }
}

#[test]
fn a_target_beyond_a_position_limit_is_approached_up_to_the_limit() {
    let mut rig = streaming(JERK);
    rig.stream(9.0, 1.0);
    rig.run(4_000);
    assert!(rig.stops().is_empty());
    let reached = rig.engine.axes()[0].set_point();
    assert!(
        (reached.position - LIMITS.position_max).abs() < 1e-6 && reached.velocity.abs() < 1e-9,
        "{reached:?}"
    );
    rig.assert_differences_kept(JERK);
}

#[test]
fn a_moving_target_is_met_and_followed_to_a_nanoradian() {
    for jerk in [JERK, f64::INFINITY] {
        let mut rig = streaming(jerk);
        let target = |time_s: f64| {
            let (sine, cosine) = (3.0 * time_s).sin_cos();
            State { position: 0.3 + 0.2 * sine, velocity: 0.6 * cosine, acceleration: -1.8 * sine }
        };
        for cycle in 0..4_000 {
            let wanted = target(f64::from(cycle) * PERIOD_S);
            rig.stream_state(wanted);
            rig.run(1);
            let error = (rig.engine.axes()[0].set_point().position - wanted.position).abs();
            assert!(cycle < 2_000 || error < 2e-9, "{error:e} in cycle {cycle}");
        }
        rig.assert_differences_kept(jerk);
    }
}

#[test]
fn what_is_no_number_stops_the_group_where_it_can() {
    for bad in [
        State { position: f64::NAN, ..State::default() },
        State { velocity: f64::INFINITY, ..State::default() },
        State { acceleration: f64::NAN, ..State::default() },
    ] {
        let mut rig = streaming(JERK);
        rig.stream(0.5, 0.0);
        rig.run(200);
        rig.stream_state(bad);
        rig.run_until(Phase::Holding, 1_000);
        let stops = rig.stops();
        assert_eq!(
            (stops.len(), stops[0].rule(), stops[0].category),
            (1, Rule::NotFinite, StopCategory::Two)
        );
        rig.assert_differences_kept(JERK);
    }
}

#[test]
fn a_stream_that_runs_dry_comes_to_rest_says_so_and_goes_on_without_a_bump() {
    let mut rig = streaming(JERK);
    let mut position = 0.0;
    for _ in 0..800 {
        position += 0.8 * PERIOD_S;
        rig.stream(position, 0.8);
        rig.run(1);
    }
    rig.dry_up(position);
    rig.run(600);
    let rest = rig.engine.axes()[0].set_point();
    assert!(rest.velocity.abs() < 1e-9 && rest.position > position, "{rest:?}");
    assert_eq!((rig.phase(), rig.host.snapshot.groups[0].stream.state), (Phase::Streaming, StreamState::Dry));
    rig.run(5_000);
    assert_eq!(rig.engine.axes()[0].set_point().position, rest.position, "it does not come back");
    rig.stream(position + 0.1, 0.0);
    rig.run(1_000);
    assert_eq!(rig.host.snapshot.groups[0].stream.state, StreamState::Following);
    let states: Vec<StreamState> = (rig.host.events.iter())
        .filter_map(|event| match event.kind {
            EventKind::Stream { state } => Some(state),
            _ => None,
        })
        .collect();
    assert_eq!(states, [StreamState::Following, StreamState::Dry, StreamState::Following]);
    assert_eq!(rig.stops(), []);
    rig.assert_differences_kept(JERK);
}

#[test]
fn an_axis_that_is_behind_its_stream_goes_on_to_the_last_point_when_the_stream_runs_dry() {
    let mut rig = streaming(JERK);
    rig.stream(0.7, 0.0);
    rig.run(50);
    rig.dry_up(0.7);
    rig.run(2_000);
    assert!((rig.engine.axes()[0].set_point().position - 0.7).abs() < 1e-9);
    rig.assert_differences_kept(JERK);
}

#[test]
fn a_flood_of_requests_is_taken_a_few_in_a_cycle_and_the_stream_goes_on() {
    let mut rig = streaming(JERK);
    for _ in 0..200 {
        rig.host.requests.extend([Request::Enable; 16]);
        rig.stream(0.0, 0.0);
        let before = rig.host.taken;
        rig.run(1);
        assert!(rig.host.taken - before <= 4);
    }
    assert_eq!(rig.phase(), Phase::Streaming);
    assert!(rig.stops().is_empty());
}

#[test]
fn a_stop_in_the_midst_of_a_stream_keeps_every_limit() {
    for cycles in [5, 40, 90, 200, 333, 700] {
        let mut rig = streaming(JERK);
        rig.stream(2.5, 1.0);
        rig.run(cycles);
        rig.request(Request::Stop(StopCategory::Two));
        rig.run(1_500);
        assert_eq!((rig.stops().len(), rig.phase()), (1, Phase::Holding));
        rig.assert_differences_kept(JERK);
    }
}

#[test]
fn points_that_wait_when_a_stream_ends_are_discarded_and_counted_in_the_cycle_that_ends_it() {
    for end in [
        Request::Stop(StopCategory::Zero),
        Request::Stop(StopCategory::One),
        Request::Stop(StopCategory::Two),
        Request::Disable,
    ] {
        let mut rig = streaming(JERK);
        rig.stream(0.5, 0.1);
        rig.run(100);
        rig.host.waiting_points = 3;
        rig.run(1);
        assert_eq!(rig.host.waiting_points, 3, "the stream takes them");
        rig.request(end);
        let report = rig.host.snapshot.groups[0].stream;
        assert_eq!((rig.host.waiting_points, report.state), (0, StreamState::Idle), "{end:?}");
        assert_eq!((report.counts.points, report.counts.lost_points), (3, 3), "{end:?}");
        // A thread that was held up in the middle of a call.
        rig.host.waiting_points = 1;
        rig.run(1);
        assert_eq!(rig.host.snapshot.groups[0].stream.counts.lost_points, 4, "{end:?}");
    }
}

#[test]
fn a_fault_that_ends_a_stream_discards_its_points_in_the_same_cycle() {
    let mut rig = streaming(JERK);
    rig.host.waiting_points = 2;
    rig.run_until(Phase::Holding, 1_000);
    assert_eq!(rig.stops().len(), 1, "no point was taken in time");
    assert_eq!(rig.host.snapshot.groups[0].stream.counts.lost_points, 2);
}
