//! Random problems in large numbers, from the families of `otg_oracle.py`, judged without the oracle.
//!
//! `TAKT_PLAN_PROBLEMS=1000000 cargo test --release -p takt-rt --test plan many` solves that many.

use super::checker::{Arrival, judge};
use takt_rt::plan::{
    Limits, Problem, Profile, State, Synchronisation, Timing, synchronised, synchronised_velocity,
};

/// How many problems are solved when nobody asks for more.
const PROBLEMS: u64 = 100_000;

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn integer(&mut self, low: i32, high: i32) -> f64 {
        self.uniform(f64::from(low), f64::from(high) + 1.0).floor()
    }

    fn gaussian(&mut self, deviation: f64) -> f64 {
        let (radius, angle) = (self.uniform(1e-300, 1.0), self.uniform(0.0, core::f64::consts::TAU));
        deviation * (-2.0 * radius.ln()).sqrt() * angle.cos()
    }

    /// Gaussian with this probability, otherwise exactly zero.
    fn sometimes(&mut self, probability: f64) -> f64 {
        if self.uniform(0.0, 1.0) < probability { self.gaussian(0.8) } else { 0.0 }
    }

    fn decades(&mut self, low: f64, high: f64) -> f64 {
        10_f64.powf(self.uniform(low, high))
    }

    fn one_of<const N: usize>(&mut self, values: [f64; N]) -> f64 {
        values[(self.next() % N as u64) as usize]
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Family {
    Bench,
    Asymmetric,
    Arm,
    Rest,
    Second,
    SecondAsymmetric,
    Velocity,
    SecondVelocity,
    Tiny,
    Brake,
    Integers,
    Edge,
}

const FAMILIES: [Family; 12] = [
    Family::Bench,
    Family::Asymmetric,
    Family::Arm,
    Family::Rest,
    Family::Second,
    Family::SecondAsymmetric,
    Family::Velocity,
    Family::SecondVelocity,
    Family::Tiny,
    Family::Brake,
    Family::Integers,
    Family::Edge,
];

const AXES: [usize; 4] = [1, 3, 6, 7];

impl Family {
    fn arrival(self) -> Arrival {
        if matches!(self, Self::Velocity | Self::SecondVelocity) { Arrival::Velocity } else { Arrival::State }
    }

    /// A problem that may have no answer.
    fn draw(self, random: &mut Random) -> Problem {
        let mut start = State {
            position: random.gaussian(4.0),
            velocity: random.sometimes(0.9),
            acceleration: random.sometimes(0.8),
        };
        let mut target = State {
            position: random.gaussian(4.0),
            velocity: random.sometimes(0.7),
            acceleration: random.sometimes(0.6),
        };
        let mut limit = |admitted: f64| random.uniform(0.1, 12.0) + admitted.abs();
        let mut limits = Limits::symmetric(limit(target.velocity), limit(target.acceleration), limit(0.0));
        match self {
            Self::Asymmetric | Self::SecondAsymmetric => {
                limits.velocity_min = -limit(target.velocity);
                limits.acceleration_min = -limit(target.acceleration);
            }
            Self::Arm => {
                limits = Limits::symmetric(
                    random.uniform(1.5, 4.0),
                    random.uniform(8.0, 25.0),
                    random.decades(2.0, 4.0),
                );
                let (velocity, acceleration) = (limits.velocity_max, limits.acceleration_max);
                start = State {
                    position: random.uniform(-3.0, 3.0),
                    velocity: velocity * random.uniform(-0.9, 0.9),
                    acceleration: acceleration * random.uniform(-0.3, 0.3),
                };
                let passing = velocity * random.uniform(-0.5, 0.5);
                target = State {
                    position: random.uniform(-3.0, 3.0),
                    velocity: random.one_of([0.0, 0.0, passing]),
                    acceleration: 0.0,
                };
            }
            Self::Rest => {
                start = State::rest(start.position);
                target = State::rest(target.position);
            }
            Self::Tiny => {
                target.position = start.position + random.gaussian(1.0) * random.decades(-9.0, -1.0);
                start.velocity *= random.decades(-9.0, 0.0);
                start.acceleration *= random.decades(-9.0, 0.0);
                let slow = target.velocity * random.decades(-9.0, 0.0);
                target.velocity = random.one_of([0.0, slow]);
                target.acceleration = 0.0;
            }
            Self::Brake => {
                let velocity = random.uniform(0.2, 1.2) + target.velocity.abs();
                let acceleration = random.uniform(0.2, 1.2) + target.acceleration.abs();
                limits = Limits::symmetric(velocity, acceleration, limits.jerk_max);
                start.velocity = random.gaussian(2.0 * velocity);
                start.acceleration = random.gaussian(2.0 * acceleration);
            }
            Self::Integers => {
                let [p0, v0, a0, pf, vf, af] = [(); 6].map(|()| random.integer(-2, 2));
                start = State { position: p0, velocity: v0, acceleration: a0 };
                target = State { position: pf, velocity: vf, acceleration: af };
                let [velocity, acceleration, jerk] = [(); 3].map(|()| random.integer(1, 3));
                limits = Limits::symmetric(velocity, acceleration, jerk);
            }
            Self::Edge => (start, target, limits) = edge(random),
            Self::Bench | Self::Second | Self::Velocity | Self::SecondVelocity => {}
        }
        if matches!(self, Self::Second | Self::SecondAsymmetric | Self::SecondVelocity) {
            limits.jerk_max = f64::INFINITY;
            start.acceleration = 0.0;
            target.acceleration = 0.0;
        }
        Problem { start, target, limits }
    }

    /// A problem that has an answer.
    fn problem(self, random: &mut Random) -> Problem {
        loop {
            let problem = self.draw(random);
            let Problem { start, target, limits } = problem;
            let kept = |of: &State, acceleration: f64| {
                let bound_for = of.velocity + acceleration * acceleration.abs() / (2.0 * limits.jerk_max);
                let velocities = limits.velocity_min..=limits.velocity_max;
                velocities.contains(&of.velocity)
                    && velocities.contains(&bound_for)
                    && (limits.acceleration_min..=limits.acceleration_max).contains(&of.acceleration)
            };
            let starts_anywhere = self == Self::Brake;
            if kept(&target, -target.acceleration) && (starts_anywhere || kept(&start, start.acceleration)) {
                return problem;
            }
        }
    }
}

/// Rest to rest, exactly where two types of profile meet.
fn edge(random: &mut Random) -> (State, State, Limits) {
    let velocity = random.integer(1, 60) * 0.05;
    let acceleration = random.integer(2, 40) * 0.5;
    let jerk = random.integer(1, 100) * 50.0;
    let from = random.integer(-3000, 3000) * 0.001 * random.one_of([0.0, 1.0]);
    let distance = if velocity < acceleration * acceleration / jerk {
        2.0 * velocity * (velocity / jerk).sqrt()
    } else {
        let acceleration_reached = 2.0 * acceleration.powi(3) / (jerk * jerk);
        random.one_of([acceleration_reached, velocity * (velocity / acceleration + acceleration / jerk)])
    };
    (State::rest(from), State::rest(from + distance), Limits::symmetric(velocity, acceleration, jerk))
}

fn timing(random: &mut Random) -> Timing {
    let modes =
        [Synchronisation::Time, Synchronisation::Time, Synchronisation::Phase, Synchronisation::Independent];
    let choice = random.uniform(0.0, 1.0);
    Timing {
        synchronisation: modes[(random.next() % 4) as usize],
        cycle_s: (choice < 0.1).then_some(0.001),
        minimum_duration_s: if (0.1..0.2).contains(&choice) { random.uniform(1.0, 10.0) } else { 0.0 },
        ..Timing::default()
    }
}

/// Plans and judges; says what is wrong.
fn solve(family: Family, problems: &[Problem], timing: Timing) -> Result<(), String> {
    let mut profiles = vec![Profile::hold(0.0); problems.len()];
    let arrival = family.arrival();
    let planner = if arrival == Arrival::State { synchronised } else { synchronised_velocity };
    let duration_s = planner(problems, &mut profiles, timing).map_err(|error| format!("{error:?}"))?;
    for (problem, profile) in problems.iter().zip(&profiles) {
        judge(problem, profile, arrival)?;
        let together = timing.synchronisation != Synchronisation::Independent;
        if together && profile.duration_s() != duration_s {
            return Err(format!("{} s in place of {duration_s} s", profile.duration_s()));
        }
        if let Some(cycle_s) = timing.cycle_s {
            let cycles = profile.duration_s() / cycle_s;
            if (cycles - cycles.round()).abs() > 1e-6 {
                return Err(format!("{cycles} cycles"));
            }
        }
    }
    Ok(())
}

#[test]
fn every_random_problem_is_solved() {
    let asked = std::env::var("TAKT_PLAN_PROBLEMS").ok().and_then(|count| count.parse().ok());
    let count: u64 = asked.unwrap_or(PROBLEMS);
    let mut failures = Vec::new();
    for number in 0..count {
        let mut random = Random(number);
        let family = FAMILIES[(number % 12) as usize];
        let axes = AXES[(number / 12 % 4) as usize];
        let problems: Vec<Problem> = (0..axes).map(|_| family.problem(&mut random)).collect();
        if let Err(why) = solve(family, &problems, timing(&mut random)) {
            failures.push(format!("{number} {family:?}: {why}"));
        }
    }
    assert!(failures.is_empty(), "{} of {count}: {failures:#?}", failures.len());
}
