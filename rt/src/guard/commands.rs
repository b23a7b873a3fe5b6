//! The last commands of a stream for one axis, judged as what they are: samples of its owner's motion, with gaps between them.

use super::stream::ROUNDINGS;
use super::{AxisLimits, TOLERANCE};
use crate::fault::Fault;
use crate::plan::{self, Limits, Problem, State};

/// How many are kept: a third difference needs four.
const KEPT: usize = 4;

/// The last commands of a stream, newest first, and how many cycles ago each of them came.
///
/// A motion that keeps a limit keeps it in the divided differences of any of its samples, however far apart they are: the third
/// one is a mean of the jerk between the first and the last of the four. So commands are judged at their own times, and no
/// command needs to be let pass because the one before it did not come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StreamCommands {
    positions: [f64; KEPT],
    ages: [u32; KEPT],
}

/// Which mean of the stream's motion a divided difference stands for.
#[derive(Clone, Copy)]
enum Difference {
    Velocity,
    Acceleration,
    Jerk,
}

/// Divided differences of the last commands, from the velocity to the jerk divided by 3!, and the spans between them.
struct Differences {
    first: f64,
    second: f64,
    third: f64,
    /// From the newest command to each older one: seconds.
    spans_s: [f64; KEPT - 1],
}

impl StreamCommands {
    /// A stream that is about to begin. `sent` are the set-points of the last three cycles, newest first: they count as the
    /// commands before the first one.
    pub fn begin(sent: [f64; 3]) -> Self {
        let [newest, last, before] = sent;
        Self { positions: [newest, last, before, before], ages: [0, 1, 2, 3] }
    }

    /// Lets a cycle pass.
    pub fn pass(&mut self) {
        self.ages = self.ages.map(|age| age.saturating_add(1));
    }

    /// Takes the command of this cycle.
    pub fn take(&mut self, position: f64) {
        let ([p0, p1, p2, _], [a0, a1, a2, _]) = (self.positions, self.ages);
        (self.positions, self.ages) = ([position, p0, p1, p2], [0, a0, a1, a2]);
    }

    fn differences(&self, period_s: f64) -> Differences {
        let [p0, p1, p2, p3] = self.positions;
        let [a0, a1, a2, a3] = self.ages.map(f64::from);
        let span_s = |from: f64, to: f64| (to - from).max(1.0) * period_s;
        let (f01, f12, f23) =
            ((p0 - p1) / span_s(a0, a1), (p1 - p2) / span_s(a1, a2), (p2 - p3) / span_s(a2, a3));
        let (f012, f123) = ((f01 - f12) / span_s(a0, a2), (f12 - f23) / span_s(a1, a3));
        Differences {
            first: f01,
            second: f012,
            third: (f012 - f123) / span_s(a0, a3),
            spans_s: [span_s(a0, a1), span_s(a0, a2), span_s(a0, a3)],
        }
    }

    /// Checks what the commands ask for by themselves: position, velocity, acceleration and jerk.
    ///
    /// # Errors
    /// The first limit that they break.
    pub fn check(&self, limits: &AxisLimits, period_s: f64) -> Result<(), Fault> {
        let [position, last, ..] = self.positions;
        let room = TOLERANCE * (limits.position_max - limits.position_min);
        for (limit, is_deeper) in [
            (limits.position_max, position > limits.position_max + room && position > last),
            (limits.position_min, position < limits.position_min - room && position < last),
        ] {
            if is_deeper {
                return Err(Fault::PositionLimit { position, limit });
            }
        }
        let Differences { first, second, third, spans_s: [nearest_s, middle_s, farthest_s] } =
            self.differences(period_s);
        let noise = ROUNDINGS * f64::EPSILON * (1.0 + position.abs()) / nearest_s.min(middle_s - nearest_s);
        let shortest_s = middle_s.min(farthest_s - nearest_s);
        let steepest = limits.acceleration.max(limits.deceleration);
        let checks = [
            (Difference::Velocity, first, limits.velocity, noise),
            (Difference::Acceleration, 2.0 * second, steepest, noise / shortest_s),
            (Difference::Jerk, 6.0 * third, limits.jerk, noise / shortest_s / farthest_s * 6.0),
        ];
        for (of, value, limit, noise) in checks {
            // Not a number is beyond every limit.
            if value.is_nan() || value.abs() > limit * (1.0 + TOLERANCE) + noise {
                return Err(match of {
                    Difference::Velocity => Fault::VelocityLimit { velocity: value, limit },
                    Difference::Acceleration => Fault::AccelerationLimit { acceleration: value, limit },
                    Difference::Jerk => Fault::JerkLimit { jerk: value, limit },
                });
            }
        }
        Ok(())
    }

    /// The motion of which these are samples, in this cycle: with its acceleration and jerk for as long as the newest command
    /// was waited for, and from then on at its velocity.
    pub fn motion(&self, period_s: f64, limits: &AxisLimits) -> StreamMotion {
        let Differences { first, second, third, spans_s: [nearest_s, middle_s, _] } =
            self.differences(period_s);
        let jerk = if limits.jerk.is_finite() { (6.0 * third).clamp(-limits.jerk, limits.jerk) } else { 0.0 };
        let steepest = limits.acceleration.max(limits.deceleration);
        let acceleration = 2.0 * second + (nearest_s + middle_s) / 3.0 * jerk;
        let velocity = first + nearest_s * (second + middle_s / 6.0 * jerk);
        let newest = StreamMotion {
            state: State {
                position: self.positions[0],
                velocity: velocity.clamp(-limits.velocity, limits.velocity),
                acceleration: acceleration.clamp(-steepest, steepest),
            },
            jerk,
        };
        let since_s = f64::from(self.ages[0]) * period_s;
        if since_s <= nearest_s {
            return newest.after(since_s);
        }
        let then = newest.after(nearest_s).state;
        let state = State { acceleration: 0.0, ..then }.after(since_s - nearest_s);
        StreamMotion { state, jerk: 0.0 }
    }
}

/// How the motion that a stream shows goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StreamMotion {
    /// Where it is, how fast, and with what acceleration.
    pub state: State,
    /// With what jerk: rad/s³ (m/s³).
    pub jerk: f64,
}

/// The share of the jerk limit with which a motion is followed at most; the rest is for catching up with it.
const FOLLOWED_SHARE: f64 = 0.95;

impl StreamMotion {
    /// After this time with the same jerk; before it, if the time is negative.
    pub fn after(&self, time_s: f64) -> Self {
        let Self { state, jerk } = *self;
        let even = state.after(time_s);
        Self {
            state: State {
                position: even.position + jerk * time_s * time_s * time_s / 6.0,
                velocity: even.velocity + jerk * time_s * time_s / 2.0,
                acceleration: even.acceleration + jerk * time_s,
            },
            jerk,
        }
    }

    /// The next state of an axis at `start` on the fastest way to meet this motion and go on with it, which is where it will
    /// be at the end of the cycle. `None` where nothing within the limits leads there.
    ///
    /// Seen from the motion the axis has to come to rest, with what the motion leaves of the limits.
    pub fn meet(&self, start: &State, limits: &AxisLimits, period_s: f64) -> Option<State> {
        let most = FOLLOWED_SHARE * limits.jerk;
        let followed = if limits.jerk.is_finite() { self.jerk.clamp(-most, most) } else { 0.0 };
        let (now, then) = (Self { jerk: followed, ..*self }.after(-period_s).state, self.state);
        let (rising, falling) = limits.rising_and_falling(start.velocity);
        let problem = Problem {
            start: State {
                position: start.position - now.position,
                velocity: start.velocity - now.velocity,
                acceleration: start.acceleration - now.acceleration,
            },
            target: State::rest(0.0),
            limits: Limits::asymmetric(
                limits.velocity - now.velocity.max(then.velocity),
                -limits.velocity - now.velocity.min(then.velocity),
                rising - now.acceleration.max(then.acceleration),
                -falling - now.acceleration.min(then.acceleration),
                limits.jerk - followed.abs(),
            ),
        };
        let seen = plan::position(&problem).ok()?.sample(period_s);
        Some(State {
            position: then.position + seen.position,
            velocity: then.velocity + seen.velocity,
            acceleration: then.acceleration + seen.acceleration,
        })
    }
}
