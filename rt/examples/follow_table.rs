//! How closely streams are followed: the same motions at several rates, clean and disturbed, through the whole engine in virtual
//! time. Beside it the tracking of `rsruckig`, and linear interpolation. Every run prints the same table.
//!
//! ```text
//! cargo run --release -p takt-rt --example follow_table
//! ```
//!
//! - `stops`: of the group; `beyond`: cycles in which a finite difference of the set-points is beyond a limit;
//! - `error`: the largest distance from the motion, so far behind as the controller states (`lag`), in mrad;
//! - `jerk`: the highest, of a limit of 100 rad/s³.
//!
//! `rsruckig` gets the newest point in each cycle, with its velocity where points have one, and linear interpolation runs behind as
//! takt does. They state no lag: their error is that with the lag that suits them best.

use std::f64::consts::PI;

use rsruckig::prelude::{InputParameter, OutputParameter, ThrowErrorHandler};
use rsruckig::trackig::{TargetState, Trackig};
use takt_rt::plan::State;
use takt_rt::{
    AxisLimits, AxisPoint, LookAhead, LookAheadParameters, MAX_AXES, PointRole, PositionPoint, Request,
    StreamDelay, StreamPoint,
};

#[path = "../tests/fixture/mod.rs"]
mod fixture;

use fixture::{PERIOD_NS, Rig, parameters};

const PERIOD_S: f64 = PERIOD_NS as f64 * 1e-9;
const DURATION_S: f64 = 6.0;
const LIMITS: AxisLimits = AxisLimits {
    position_min: -3.0,
    position_max: 3.0,
    velocity: 2.4,
    acceleration: 8.0,
    deceleration: 8.0,
    jerk: 100.0,
    torque: 40.0,
};
const RATES_HZ: [f64; 7] = [10.0, 30.0, 50.0, 100.0, 250.0, 500.0, 1000.0];

/// A motion to be streamed: where it is at a time, and from when on it is looked at.
struct Motion {
    name: &'static str,
    at: fn(f64) -> State,
    from_s: f64,
}

const MOTIONS: [Motion; 3] = [
    // It begins with a velocity, which has to be caught up with.
    Motion { name: "sine", at: sine, from_s: 1.0 },
    Motion { name: "reach", at: reach, from_s: 0.0 },
    Motion { name: "hand", at: hand, from_s: 0.0 },
];

/// 0.2 rad to and fro at 0.5 Hz.
fn sine(time_s: f64) -> State {
    let (sine, cosine) = (PI * time_s).sin_cos();
    State { position: 0.2 * sine, velocity: 0.2 * PI * cosine, acceleration: -0.2 * PI * PI * sine }
}

/// A stroke of minimum jerk (Flash and Hogan, 1985).
fn stroke(time_s: f64, begin_s: f64, duration_s: f64, way: f64) -> State {
    let u = ((time_s - begin_s) / duration_s).clamp(0.0, 1.0);
    State {
        position: way * u * u * u * (10.0 - 15.0 * u + 6.0 * u * u),
        velocity: way * 30.0 * u * u * (1.0 - u) * (1.0 - u) / duration_s,
        acceleration: way * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (duration_s * duration_s),
    }
}

/// 0.5 rad in 1.2 s.
fn reach(time_s: f64) -> State {
    stroke(time_s, 1.0, 1.2, 0.5)
}

/// Like a hand: strokes that overlap, of uneven length. It stands for a recording, of which it has the shape.
fn hand(time_s: f64) -> State {
    let strokes = [
        (0.5, 0.8, 0.25),
        (1.0, 0.7, -0.18),
        (1.6, 0.9, 0.3),
        (2.2, 0.6, -0.12),
        (2.7, 1.1, -0.35),
        (3.5, 0.7, 0.2),
        (4.1, 0.9, -0.15),
    ];
    strokes.iter().fold(State::default(), |sum, (begin_s, duration_s, way)| {
        let one = stroke(time_s, *begin_s, *duration_s, *way);
        State {
            position: sum.position + one.position,
            velocity: sum.velocity + one.velocity,
            acceleration: sum.acceleration + one.acceleration,
        }
    })
}

/// What happens to the points on their way.
#[derive(Clone, Copy, PartialEq)]
enum Way {
    Clean,
    /// Each arrives up to half an interval early or late.
    Jitter,
    /// One in twenty is lost.
    Loss,
    /// They come in chunks, which take 50 to 300 ms from their first point on.
    Chunks,
}

const WAYS: [(Way, &str); 4] =
    [(Way::Clean, "clean"), (Way::Jitter, "jitter"), (Way::Loss, "loss"), (Way::Chunks, "chunks")];
/// A chunk has no more points than this, so that at a high rate it is over before the next one comes.
const CHUNK_POINTS: usize = 64;
const CHUNK_RATE_AT_MOST_HZ: f64 = 100.0;

/// Numbers from 0 to 1, always the same.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / (1_u64 << 31) as f64
    }
}

/// A point, and when it arrives.
#[derive(Clone, Copy)]
struct Arrival {
    at_s: f64,
    stamp_s: f64,
    role: PointRole,
    axis: PositionPoint,
}

fn arrivals(motion: &Motion, says_velocity: bool, rate_hz: f64, way: Way) -> Vec<Arrival> {
    let mut dice = Dice(20_260_101);
    let interval_s = 1.0 / rate_hz;
    let axis = |time_s: f64| {
        let state = (motion.at)(time_s);
        let velocity = says_velocity.then_some(state.velocity);
        PositionPoint { position: state.position, velocity, acceleration: None }
    };
    let mut all = vec![];
    if way == Way::Chunks {
        let count = ((0.8 * rate_hz) as usize).clamp(16, CHUNK_POINTS);
        let mut begun_s = 0.0;
        while begun_s < DURATION_S {
            let latency_s = 0.05 + 0.25 * dice.roll();
            for number in 0..count {
                let stamp_s = begun_s + number as f64 * interval_s;
                let role = PointRole::Chunk { is_first: number == 0, is_last: number + 1 == count };
                all.push(Arrival { at_s: begun_s + latency_s, stamp_s, role, axis: axis(stamp_s) });
            }
            // The next one is thought about when this one has come.
            begun_s += latency_s;
        }
        return all;
    }
    for number in 0..(DURATION_S * rate_hz) as u32 {
        let stamp_s = f64::from(number) * interval_s;
        let roll = dice.roll();
        let late_s = if way == Way::Jitter { (roll - 0.5) * interval_s } else { 0.0 };
        if !(way == Way::Loss && roll < 0.05) {
            let at_s = (stamp_s + late_s).max(0.0);
            all.push(Arrival { at_s, stamp_s, role: PointRole::Single, axis: axis(stamp_s) });
        }
    }
    all.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    all
}

/// What became of a stream.
struct Followed {
    stops: usize,
    beyond: usize,
    error_mrad: f64,
    lag_ms: f64,
    jerk: f64,
}

/// Cycles with a difference beyond a limit, and the highest jerk from a cycle on.
fn differences(set: &[f64], from: usize) -> (usize, f64) {
    let (mut beyond, mut highest) = (0, 0.0_f64);
    for (cycle, set) in set.windows(4).enumerate() {
        let velocity = (set[3] - set[2]) / PERIOD_S;
        let acceleration = (set[3] - 2.0 * set[2] + set[1]) / PERIOD_S.powi(2);
        let jerk = (set[3] - 3.0 * set[2] + 3.0 * set[1] - set[0]) / PERIOD_S.powi(3);
        let is_beyond = velocity.abs() > LIMITS.velocity * (1.0 + 1e-6)
            || acceleration.abs() > LIMITS.acceleration * (1.0 + 1e-6) + 1e-8
            || jerk.abs() > LIMITS.jerk * (1.0 + 1e-5) + 1e-4;
        beyond += usize::from(is_beyond);
        if cycle >= from {
            highest = highest.max(jerk.abs());
        }
    }
    (beyond, highest)
}

fn followed(motion: &Motion, arrivals: &[Arrival]) -> (Followed, Vec<f64>) {
    let mut parameters = parameters(1);
    parameters.axes[0].limits = LIMITS;
    let mut rig = Rig::of(parameters).enable();
    rig.move_to(0.0);
    rig.run_until(takt_rt::Phase::Holding, 5_000);
    let look_ahead = LookAheadParameters {
        limits: [LIMITS].into_iter().collect(),
        period_ns: PERIOD_NS,
        delay: StreamDelay::Automatic,
    };
    rig.host.points = Some(Box::new(LookAhead::new(vec![StreamPoint::default(); 256], look_ahead)));
    rig.request(Request::Stream);
    let slot_start_ns = |rig: &Rig| rig.host.records.last().map_or(0, |record| record.timing.slot_start_ns);
    let begun_ns = slot_start_ns(&rig) + PERIOD_NS;
    rig.host.records.clear();
    let mut waiting = arrivals.iter().peekable();
    let (mut error, mut set) = (0.0_f64, vec![]);
    for cycle in 0..(DURATION_S / PERIOD_S) as u32 - 100 {
        let time_s = f64::from(cycle) * PERIOD_S;
        let now_ns = begun_ns + u64::from(cycle) * PERIOD_NS;
        while let Some(arrival) = waiting.next_if(|arrival| arrival.at_s <= time_s) {
            let at_ns = begun_ns + (arrival.stamp_s * 1e9).round() as u64;
            let point =
                StreamPoint { at_ns, role: arrival.role, axes: [AxisPoint::motion(arrival.axis); MAX_AXES] };
            if let Some(points) = &mut rig.host.points {
                // One that comes too late is counted.
                let _ = points.insert(&point, now_ns);
            }
        }
        rig.run(1);
        let set_point = rig.engine.axes()[0].set_point().position;
        set.push(set_point);
        let played_s = time_s - rig.host.snapshot.groups[0].stream.counts.lag_ns as f64 * 1e-9;
        if played_s > motion.from_s.max(0.0) {
            error = error.max((set_point - (motion.at)(played_s).position).abs());
        }
    }
    let (beyond, jerk) = differences(&set, (motion.from_s / PERIOD_S) as usize + 200);
    let lag_ms = rig.host.snapshot.groups[0].stream.counts.lag_ns as f64 * 1e-6;
    (Followed { stops: rig.stops().len(), beyond, error_mrad: error * 1e3, lag_ms, jerk }, set)
}

/// The error of set-points that state no lag, with the one that suits them best.
fn best_error_mrad(motion: &Motion, set: &[f64]) -> f64 {
    let error = |lag_cycles: usize| {
        let from = (motion.from_s / PERIOD_S) as usize + 300;
        let of = |(cycle, set): (usize, &f64)| {
            (set - (motion.at)((cycle - lag_cycles) as f64 * PERIOD_S).position).abs()
        };
        set.iter().enumerate().skip(from).map(of).fold(0.0, f64::max)
    };
    (0..300).map(error).fold(f64::INFINITY, f64::min) * 1e3
}

/// The tracking of `rsruckig`, with the newest point that has come.
fn by_rsruckig(motion: &Motion, arrivals: &[Arrival]) -> Option<(f64, usize)> {
    let mut tracker = Trackig::<1, ThrowErrorHandler>::new(None, PERIOD_S);
    let (mut input, mut output) = (InputParameter::<1>::new(None), OutputParameter::<1>::new(None));
    input.max_velocity[0] = LIMITS.velocity;
    input.max_acceleration[0] = LIMITS.acceleration;
    input.max_jerk[0] = LIMITS.jerk;
    let mut target = TargetState::<1>::new(None);
    let (mut waiting, mut newest_s, mut set) = (arrivals.iter().peekable(), -1.0, vec![]);
    for cycle in 0..(DURATION_S / PERIOD_S) as u32 - 100 {
        let time_s = f64::from(cycle) * PERIOD_S;
        while let Some(arrival) = waiting.next_if(|arrival| arrival.at_s <= time_s) {
            if arrival.stamp_s > newest_s && arrival.stamp_s <= time_s {
                newest_s = arrival.stamp_s;
                target.position[0] = arrival.axis.position;
                target.velocity[0] = arrival.axis.velocity.unwrap_or(0.0);
            }
        }
        tracker.update(&target, &input, &mut output).ok()?;
        set.push(output.new_position[0]);
        output.pass_to_input(&mut input);
    }
    Some((best_error_mrad(motion, &set), differences(&set, 0).0))
}

/// Straight lines between the points that have come, as far behind as takt.
fn by_lines(motion: &Motion, arrivals: &[Arrival], lag_ms: f64) -> (f64, usize) {
    let (mut known, mut waiting, mut set) = (Vec::<(f64, f64)>::new(), arrivals.iter().peekable(), vec![]);
    for cycle in 0..(DURATION_S / PERIOD_S) as u32 - 100 {
        let time_s = f64::from(cycle) * PERIOD_S;
        while let Some(arrival) = waiting.next_if(|arrival| arrival.at_s <= time_s) {
            let index = known.partition_point(|(stamp_s, _)| *stamp_s < arrival.stamp_s);
            known.truncate(if arrival.role == PointRole::Single { known.len() } else { index });
            known.insert(index, (arrival.stamp_s, arrival.axis.position));
        }
        let played_s = time_s - lag_ms * 1e-3;
        let behind = known.partition_point(|(stamp_s, _)| *stamp_s <= played_s);
        let position = match (behind.checked_sub(1).and_then(|before| known.get(before)), known.get(behind)) {
            (Some((t0, p0)), Some((t1, p1))) => p0 + (p1 - p0) * (played_s - t0) / (t1 - t0),
            (Some((_, position)), None) | (None, Some((_, position))) => *position,
            (None, None) => 0.0,
        };
        set.push(position);
    }
    (best_error_mrad(motion, &set), differences(&set, 0).0)
}

fn main() {
    println!(
        "| motion | points | rate | way | stops | beyond | error | lag | jerk | rsruckig: error | beyond | lines: error | beyond |"
    );
    println!("| --- | --- | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    let mut worst_mrad = 0.0_f64;
    for motion in &MOTIONS {
        for says_velocity in [false, true] {
            for rate_hz in RATES_HZ {
                for (way, name) in WAYS {
                    if way == Way::Chunks && rate_hz > CHUNK_RATE_AT_MOST_HZ {
                        continue;
                    }
                    let arrivals = arrivals(motion, says_velocity, rate_hz, way);
                    let (ours, _) = followed(motion, &arrivals);
                    let lines = by_lines(motion, &arrivals, ours.lag_ms);
                    let ruckig = by_rsruckig(motion, &arrivals).map_or_else(
                        || "failed | ".to_owned(),
                        |(error, beyond)| format!("{error:.2} | {beyond}"),
                    );
                    let says = if says_velocity { "p, v" } else { "p" };
                    println!(
                        "| {} | {says} | {rate_hz:.0} Hz | {name} | {} | {} | {:.4} mrad | {:.0} ms | {:.0} | {ruckig} | {:.2} | {} |",
                        motion.name,
                        ours.stops,
                        ours.beyond,
                        ours.error_mrad,
                        ours.lag_ms,
                        ours.jerk,
                        lines.0,
                        lines.1
                    );
                    if way == Way::Clean && rate_hz >= 30.0 {
                        worst_mrad = worst_mrad.max(ours.error_mrad);
                    }
                    assert_eq!((ours.stops, ours.beyond), (0, 0), "a stop, or a limit exceeded");
                }
            }
        }
    }
    println!("\nworst error of clean streams from 30 Hz on: {worst_mrad:.4} mrad");
    assert!(worst_mrad <= 0.5);
}
