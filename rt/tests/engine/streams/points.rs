//! Points through the look-ahead to the set-points of the engine: any rate, jitter, loss, disorder, chunks.

use crate::fixture::{PERIOD_NS, PERIOD_S, Rig, jerk_limited};
use proptest::prelude::*;
use takt_rt::plan::State;
use takt_rt::{
    AxisLimits, AxisPoint, Follow, LookAhead, LookAheadParameters, MAX_AXES, Phase, PointRole, PositionPoint,
    Request, StreamDelay, StreamPoint, StreamState,
};

const JERK: f64 = 100.0;

/// A point, and when it arrives.
#[derive(Clone, Copy, Debug)]
struct Arrival {
    at_s: f64,
    stamp_s: f64,
    role: PointRole,
    axis: AxisPoint,
}

fn single(at_s: f64, stamp_s: f64, axis: AxisPoint) -> Arrival {
    Arrival { at_s, stamp_s, role: PointRole::Single, axis }
}

/// What a stream was.
struct Streamed {
    rig: Rig,
    /// In each cycle: the time since the stream began, less the lag, and the set-point.
    set: Vec<(f64, f64)>,
}

/// Streams points to axes that stand at 0. Time begins a while after the stream was asked for.
fn stream(arrivals: &[Arrival], follow: Follow, delay: StreamDelay, duration_s: f64) -> Streamed {
    let mut parameters = jerk_limited(2, JERK);
    parameters.axes.iter_mut().for_each(|axis| axis.follow = follow);
    let limits = match follow {
        Follow::Smooth => parameters.axes.iter().map(|axis| axis.limits).collect(),
        Follow::Exact => parameters.axes.iter().map(|_| AxisLimits::NONE).collect(),
    };
    let mut rig = Rig::of(parameters).enable();
    rig.move_to(0.0);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(10);
    rig.host.records.clear();
    let parameters = LookAheadParameters { limits, period_ns: PERIOD_NS, delay };
    rig.host.points = Some(Box::new(LookAhead::new(vec![StreamPoint::default(); 256], parameters)));
    rig.request(Request::Stream);
    let begun_ns = rig.host.records.last().unwrap().timing.slot_start_ns + 10 * PERIOD_NS;
    let time_ns = |time_s: f64| begun_ns.wrapping_add_signed((time_s * 1e9).round() as i64);
    let mut order: Vec<&Arrival> = arrivals.iter().collect();
    order.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    let mut waiting = order.into_iter().peekable();
    let mut set = vec![];
    for _ in 0..(duration_s / PERIOD_S) as usize {
        let next_ns = rig.host.records.last().unwrap().timing.slot_start_ns + PERIOD_NS;
        while let Some(arrival) = waiting.next_if(|arrival| time_ns(arrival.at_s) <= next_ns) {
            let axes = [arrival.axis; MAX_AXES];
            let point = StreamPoint { at_ns: time_ns(arrival.stamp_s), role: arrival.role, axes };
            // What comes too late is counted.
            let _ = rig.host.points.as_mut().unwrap().insert(&point, next_ns);
        }
        rig.run(1);
        let record = rig.host.records.last().unwrap();
        let since_ns = record.timing.slot_start_ns as f64 - begun_ns as f64;
        let lag_ns = rig.host.snapshot.groups[0].stream.counts.lag_ns as f64;
        set.push(((since_ns - lag_ns) * 1e-9, record.axes[0].position_set));
    }
    rig.assert_differences_kept(JERK);
    Streamed { rig, set }
}

impl Streamed {
    /// The largest distance from a motion that is so far behind, between two times of it.
    fn error(&self, motion: impl Fn(f64) -> State, from_s: f64, to_s: f64) -> f64 {
        let within = self.set.iter().filter(|(time_s, _)| (from_s..to_s).contains(time_s));
        within.map(|(time_s, set)| (set - motion(*time_s).position).abs()).fold(0.0, f64::max)
    }
}

/// 0.2 rad to and fro at 0.5 Hz.
fn sine(time_s: f64) -> State {
    let rate = std::f64::consts::PI;
    let (sine, cosine) = (rate * time_s).sin_cos();
    State { position: 0.2 * sine, velocity: 0.2 * rate * cosine, acceleration: -0.2 * rate * rate * sine }
}

/// Points of a motion, in time.
fn points(motion: impl Fn(f64) -> State, rate_hz: f64, duration_s: f64, says_all: bool) -> Vec<Arrival> {
    let of = |state: State| {
        if says_all {
            AxisPoint::moving(state.position, state.velocity)
        } else {
            AxisPoint::position(state.position)
        }
    };
    (0..(duration_s * rate_hz) as u32)
        .map(|number| f64::from(number) / rate_hz)
        .map(|time_s| single(time_s, time_s, of(motion(time_s))))
        .collect()
}

#[test]
fn a_sine_of_any_rate_is_followed_within_half_a_milliradian_of_itself_so_far_behind() {
    for rate_hz in [30.0, 50.0, 100.0, 250.0, 500.0, 1000.0] {
        for says_all in [false, true] {
            let points = points(sine, rate_hz, 6.0, says_all);
            let streamed = stream(&points, Follow::Smooth, StreamDelay::Automatic, 5.9);
            assert_eq!((streamed.rig.stops(), streamed.rig.phase()), (vec![], Phase::Streaming));
            let error = streamed.error(sine, 1.0, 5.5);
            assert!(error < 2e-5, "{rate_hz} Hz: {error:e}");
            let lag_s = streamed.rig.host.snapshot.groups[0].stream.counts.lag_ns as f64 * 1e-9;
            assert!(lag_s < 2.3 / rate_hz + 3e-3, "{rate_hz} Hz: {lag_s} s behind");
        }
    }
}

#[test]
fn the_set_points_are_as_far_behind_as_was_asked_for() {
    for delay_ms in [0, 40, 200] {
        let delay = StreamDelay::Fixed(delay_ms * 1_000_000);
        let mut points = points(sine, 50.0, 6.0, false);
        // They come early enough.
        points.iter_mut().for_each(|point| point.at_s -= 0.06);
        let streamed = stream(&points, Follow::Smooth, delay, 5.0);
        assert_eq!(streamed.rig.host.snapshot.groups[0].stream.counts.lag_ns, delay_ms * 1_000_000);
        let error = streamed.error(sine, 1.0, 4.7);
        assert!(error < 2e-5, "{delay_ms} ms: {error:e}");
    }
}

#[test]
fn positions_that_step_are_followed_without_overshoot_at_any_rate() {
    for rate_hz in [5.0, 10.0, 30.0, 100.0, 1000.0] {
        for size in [1e-4, 0.003, 0.019, 0.2] {
            let step = |time_s: f64| State::rest(if time_s < 1.0 { 0.0 } else { size });
            for says_all in [false, true] {
                let points = points(step, rate_hz, 4.0, says_all);
                let streamed = stream(&points, Follow::Smooth, StreamDelay::Automatic, 3.9);
                let highest = streamed.set.iter().map(|(_, set)| *set).fold(0.0, f64::max);
                let lowest = streamed.set.iter().map(|(_, set)| *set).fold(0.0, f64::min);
                assert!(highest <= size + 1e-8, "{size} at {rate_hz} Hz: {highest}");
                assert!(lowest >= -1e-9, "{size} at {rate_hz} Hz: {lowest}");
            }
        }
    }
}

#[test]
fn a_joint_is_led_to_a_stream_that_begins_far_from_it() {
    let far = |time_s: f64| State { position: 1.5 + sine(time_s).position, ..sine(time_s) };
    let points = points(far, 50.0, 6.0, false);
    let streamed = stream(&points, Follow::Smooth, StreamDelay::Automatic, 5.9);
    assert_eq!(streamed.rig.stops(), []);
    let error = streamed.error(far, 2.5, 5.5);
    assert!(error < 2e-5, "{error:e}");
}

#[test]
fn what_a_standing_stream_says_of_its_velocity_moves_nothing() {
    for (velocity, acceleration) in [(1e9, None), (1.5, Some(-1e9)), (-1.5, Some(9.0)), (0.5, None)] {
        let point = |number: i32| {
            // Another one in each point.
            let velocity = Some(velocity * f64::from(number % 7 - 2));
            let time_s = 0.02 * f64::from(number);
            single(time_s, time_s, AxisPoint::motion(PositionPoint { position: 0.0, velocity, acceleration }))
        };
        let points: Vec<Arrival> = (0..100).map(point).collect();
        let streamed = stream(&points, Follow::Smooth, StreamDelay::Automatic, 1.9);
        assert!(streamed.set.iter().all(|(_, set)| set.abs() < 1e-12));
    }
}

#[test]
fn a_stream_of_the_cycle_s_rate_is_followed_exactly_where_that_is_asked_for() {
    // From rest, since it must begin where the joint is.
    let motion = |time_s: f64| {
        let (ease, state) = ((time_s - 0.2).clamp(0.0, 1.0), sine(time_s));
        let ease = ease * ease * ease * (10.0 + ease * (6.0 * ease - 15.0));
        State { position: state.position * ease, ..state }
    };
    let points = points(motion, 1000.0, 4.0, false);
    let streamed = stream(&points, Follow::Exact, StreamDelay::Automatic, 3.9);
    assert_eq!((streamed.rig.stops(), streamed.rig.phase()), (vec![], Phase::Streaming));
    assert!(streamed.error(motion, 0.1, 3.5) < 1e-12);
}

#[test]
fn points_in_any_order_and_twice_make_the_same_motion() {
    let in_order = points(sine, 100.0, 4.0, false);
    let delay = StreamDelay::Fixed(100_000_000);
    let reference = stream(&in_order, Follow::Smooth, delay, 3.9);
    let mut disordered = in_order.clone();
    for (index, point) in disordered.iter_mut().enumerate() {
        point.at_s += [0.0, 0.03, 0.01, 0.035, 0.005][index % 5];
    }
    disordered.extend(in_order.iter().step_by(3));
    let streamed = stream(&disordered, Follow::Smooth, delay, 3.9);
    for (one, other) in reference.set.iter().zip(&streamed.set) {
        assert!((one.1 - other.1).abs() < 1e-12, "{one:?} and {other:?}");
    }
}

/// Chunks of so many points, each of which replaces the future of the one before; each was begun so long before it comes.
fn chunks(
    motion: impl Fn(f64) -> State,
    length: usize,
    every_s: f64,
    latency_s: f64,
    duration_s: f64,
) -> Vec<Arrival> {
    let mut arrivals = vec![];
    let mut begun_s = 0.0;
    while begun_s < duration_s {
        for number in 0..length {
            let stamp_s = begun_s + number as f64 / 30.0;
            let role = PointRole::Chunk { is_first: number == 0, is_last: number + 1 == length };
            let axis = AxisPoint::position(motion(stamp_s).position);
            arrivals.push(Arrival { at_s: begun_s + latency_s, stamp_s, role, axis });
        }
        begun_s += every_s;
    }
    arrivals
}

#[test]
fn overlapping_chunks_that_come_late_are_followed_without_a_stop() {
    for latency_s in [0.05, 0.15, 0.3] {
        let points = chunks(sine, 24, 0.4, latency_s, 6.0);
        let streamed = stream(&points, Follow::Smooth, StreamDelay::Automatic, 5.5);
        assert_eq!((streamed.rig.stops(), streamed.rig.phase()), (vec![], Phase::Streaming));
        let error = streamed.error(sine, 1.2, 5.2);
        assert!(error < 5e-4, "{latency_s} s: {error:e}");
    }
}

#[test]
fn a_chunk_replaces_the_future_of_the_one_before() {
    // The second one, 0.2 s later, wants the other direction.
    let up = |time_s: f64| State::rest(0.2 * time_s);
    let down = |time_s: f64| State::rest(0.04 - 0.2 * (time_s - 0.2));
    let mut points = chunks(up, 30, 9.0, 0.0, 1.0);
    let mut second = chunks(down, 30, 9.0, 0.0, 1.0);
    second.iter_mut().for_each(|point| {
        point.at_s += 0.3;
        point.stamp_s += 0.2;
        point.axis = AxisPoint::position(down(point.stamp_s).position);
    });
    points.extend(second);
    let streamed = stream(&points, Follow::Smooth, StreamDelay::Automatic, 1.0);
    let error = streamed.error(down, 0.7, 0.95);
    assert!(error < 1e-6, "{error:e}");
    assert_eq!(streamed.rig.host.snapshot.groups[0].stream.counts.points, 60);
}

#[test]
fn a_stream_that_pauses_comes_to_rest_and_goes_on() {
    let mut points = points(sine, 50.0, 8.0, false);
    points.retain(|point| !(2.0..3.5).contains(&point.at_s));
    let streamed = stream(&points, Follow::Smooth, StreamDelay::Automatic, 7.5);
    assert_eq!((streamed.rig.stops(), streamed.rig.phase()), (vec![], Phase::Streaming));
    assert_eq!(streamed.rig.host.snapshot.groups[0].stream.state, StreamState::Following);
    let standing: Vec<f64> =
        streamed.set.iter().filter(|(time_s, _)| (2.7..3.4).contains(time_s)).map(|(_, set)| *set).collect();
    assert!(standing.len() > 500 && standing.windows(2).all(|set| set[0] == set[1]));
    assert!(streamed.error(sine, 4.5, 7.0) < 2e-5);
}

#[test]
fn points_that_are_all_late_make_the_stream_run_farther_behind() {
    let mut points = points(sine, 50.0, 8.0, false);
    points.iter_mut().filter(|point| point.at_s > 2.0).for_each(|point| point.at_s += 0.15);
    let streamed = stream(&points, Follow::Smooth, StreamDelay::Automatic, 7.5);
    assert_eq!((streamed.rig.stops(), streamed.rig.phase()), (vec![], Phase::Streaming));
    let counts = streamed.rig.host.snapshot.groups[0].stream.counts;
    assert!(counts.lag_ns > 150_000_000, "{counts:?}");
    assert!(streamed.error(sine, 4.0, 7.0) < 2e-5);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn no_stream_of_any_rate_and_disorder_breaks_a_limit_or_stops(
        seed in any::<u64>(),
        rate_hz in prop_oneof![5.0f64..30.0, 30.0..200.0, 200.0..1200.0],
        jitter in prop_oneof![Just(0.0), 0.0f64..0.6, 0.0..5.0],
        loss in prop_oneof![Just(0.0), 0.0f64..0.5],
        size in prop_oneof![0.01f64..0.3, 0.3..4.0],
        swing_hz in 0.1f64..4.0,
        says in 0u8..4,
        chunk in 1usize..40,
        is_unstamped in any::<bool>(),
    ) {
        let mut state = seed;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / (1u64 << 31) as f64
        };
        let mut arrivals = vec![];
        let mut count = 0;
        for number in 0..(1.5 * rate_hz) as u32 {
            let time_s = f64::from(number) / rate_hz;
            // The first one comes in time for the stream to begin.
            let (lost, late) = (random() < loss, random() * jitter / rate_hz);
            let (lost, at_s) = if number == 0 { (false, 0.0) } else { (lost, time_s + late) };
            if lost {
                continue;
            }
            let angle = std::f64::consts::TAU * swing_hz * time_s;
            let position = size * angle.sin();
            let velocity = size * std::f64::consts::TAU * swing_hz * angle.cos();
            let axis = match says {
                0 => AxisPoint::position(position),
                1 => AxisPoint::moving(position, velocity),
                2 => AxisPoint::from(State { position, velocity: -5.0 * velocity, acceleration: -1e3 * velocity }),
                _ => AxisPoint::from(State { position, velocity, acceleration: 0.0 }),
            };
            let role = match count % (chunk + 1) {
                _ if chunk < 3 => PointRole::Single,
                place => PointRole::Chunk { is_first: place == 0, is_last: place == chunk },
            };
            count += 1;
            arrivals.push(Arrival { at_s, stamp_s: if is_unstamped { at_s } else { time_s }, role, axis });
        }
        let streamed = stream(&arrivals, Follow::Smooth, StreamDelay::Automatic, 2.2);
        prop_assert_eq!(streamed.rig.stops(), vec![]);
    }
}
