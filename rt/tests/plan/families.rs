//! Random problems, from the same families as those of the oracle's generator.

use super::checker::Arrival;
use super::random::Random;
use takt_rt::plan::{Limits, Problem, State};

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Family {
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

pub const FAMILIES: [Family; 12] = [
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

pub const AXES: [usize; 4] = [1, 3, 6, 7];

impl Family {
    pub fn arrival(self) -> Arrival {
        if matches!(self, Self::Velocity | Self::SecondVelocity) { Arrival::Velocity } else { Arrival::State }
    }

    /// A problem that may have no answer.
    pub fn draw(self, random: &mut Random) -> Problem {
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
    pub fn problem(self, random: &mut Random) -> Problem {
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
