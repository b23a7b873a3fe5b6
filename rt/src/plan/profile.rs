//! The trajectory of one axis: phases of constant jerk.

use super::choice::{larger, smaller};
use super::error::PlanError;
use super::problem::{SIZE_MAX, State};

/// The most phases a profile can have: two of the brake, and those of two seven-phase profiles laid over
/// each other.
pub const PHASES_MAX: usize = 16;

/// A stretch of time in which the jerk is constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phase {
    /// When the phase starts, in s from the start of the profile.
    pub start_s: f64,
    /// How long it lasts, in s.
    pub duration_s: f64,
    /// The state at its start.
    pub start: State,
    /// The jerk, rad/s³.
    pub jerk: f64,
}

impl Phase {
    /// The state `elapsed_s` after the start of the phase.
    pub fn sample(&self, elapsed_s: f64) -> State {
        integrate(&self.start, self.jerk, elapsed_s)
    }
}

/// Smallest and largest value of a quantity over a whole profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
}

impl Range {
    const fn at(value: f64) -> Self {
        Self { min: value, max: value }
    }

    fn include(&mut self, value: f64) {
        self.min = self.min.min(value);
        self.max = self.max.max(value);
    }
}

/// The exact extrema of a profile, from its start to its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extrema {
    /// Position.
    pub position: Range,
    /// Velocity.
    pub velocity: Range,
    /// Acceleration. At a jump of the acceleration both sides count.
    pub acceleration: Range,
}

/// A time interval in which the axis cannot arrive, in s: too late for one way, too early for the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blocked {
    /// The latest duration that is possible before the interval.
    pub after_s: f64,
    /// The earliest duration that is possible behind it.
    pub before_s: f64,
}

/// The most blocked intervals an axis can have.
pub(super) const BLOCKED_MAX: usize = 4;

/// The trajectory of one axis: up to [`PHASES_MAX`] phases of constant jerk, then the target state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    // Start times apart from the rest, infinite behind the last phase, so that finding a phase reads little.
    starts_s: [f64; PHASES_MAX],
    phases: [Coefficients; PHASES_MAX],
    count: usize,
    duration_s: f64,
    // Between two numbers that are stored one by one and read at the same time: read as a pair, they would have to wait for
    // the cache.
    minimum_duration_s: f64,
    end: State,
    blocked: [Blocked; BLOCKED_MAX],
    blocked_count: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Coefficients {
    start: State,
    jerk: f64,
}

const NO_PHASE: Coefficients = Coefficients { start: State::rest(0.0), jerk: 0.0 };

/// The state after this time of constant jerk.
#[inline]
pub(super) fn integrate(start: &State, jerk: f64, elapsed_s: f64) -> State {
    let State { position, velocity, acceleration } = *start;
    State {
        position: position
            + elapsed_s * (velocity + elapsed_s * (0.5 * acceleration + elapsed_s * (jerk * (1.0 / 6.0)))),
        velocity: velocity + elapsed_s * (acceleration + elapsed_s * (0.5 * jerk)),
        acceleration: acceleration + elapsed_s * jerk,
    }
}

impl Profile {
    /// Rest at this position, for 0 s and ever after.
    pub const fn hold(position: f64) -> Self {
        Self {
            starts_s: [f64::INFINITY; PHASES_MAX],
            phases: [NO_PHASE; PHASES_MAX],
            count: 0,
            duration_s: 0.0,
            end: State::rest(position),
            minimum_duration_s: 0.0,
            blocked: [Blocked { after_s: 0.0, before_s: 0.0 }; BLOCKED_MAX],
            blocked_count: 0,
        }
    }

    /// How long the motion takes, in s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// The shortest time in which this axis alone could have made the motion, in s.
    pub fn minimum_duration_s(&self) -> f64 {
        self.minimum_duration_s
    }

    /// The durations above [`minimum_duration_s`](Self::minimum_duration_s) that are impossible for this axis,
    /// in ascending order.
    pub fn blocked(&self) -> &[Blocked] {
        self.blocked.get(..self.blocked_count).unwrap_or_default()
    }

    /// The state `time_s` after the start.
    ///
    /// Before the start it is the start state. At the end it is exactly the target state, and from then on
    /// the axis goes on with the target velocity and without acceleration.
    #[inline]
    pub fn sample(&self, time_s: f64) -> State {
        if time_s >= self.duration_s {
            let State { position, velocity, acceleration } = self.end;
            let elapsed_s = time_s - self.duration_s;
            return State {
                position: position + velocity * elapsed_s,
                velocity,
                acceleration: if elapsed_s > 0.0 { 0.0 } else { acceleration },
            };
        }
        let time_s = if time_s > 0.0 { time_s } else { 0.0 };
        // From one cycle to the next the phase is the same: the processor guesses every comparison right.
        let index = self.starts_s.iter().skip(1).take_while(|start_s| **start_s <= time_s).count();
        match (self.phases.get(index), self.starts_s.get(index)) {
            (Some(phase), Some(start_s)) => integrate(&phase.start, phase.jerk, time_s - start_s),
            _ => self.end,
        }
    }

    /// The state at the start.
    pub fn start(&self) -> State {
        if self.count == 0 { self.end } else { self.phases[0].start }
    }

    /// The state at the end.
    pub fn end(&self) -> State {
        self.end
    }

    /// The phases in the order of time.
    pub fn phases(&self) -> impl Iterator<Item = Phase> + '_ {
        let ends = self.starts_s.iter().skip(1).map(|next_s| next_s.min(self.duration_s));
        self.starts_s.iter().zip(ends).zip(&self.phases).take(self.count).map(|((start_s, end_s), phase)| {
            Phase {
                start_s: *start_s,
                duration_s: (end_s - start_s).max(0.0),
                start: phase.start,
                jerk: phase.jerk,
            }
        })
    }

    /// The exact extrema from the start to the end, found where the derivative is zero within a phase.
    pub fn extrema(&self) -> Extrema {
        let mut extrema = Extrema {
            position: Range::at(self.end.position),
            velocity: Range::at(self.end.velocity),
            acceleration: Range::at(self.end.acceleration),
        };
        for phase in self.phases() {
            extrema.include(&phase.start);
            extrema.include(&phase.sample(phase.duration_s));
            let inside = |elapsed_s: f64| elapsed_s > 0.0 && elapsed_s < phase.duration_s;
            let velocity_turns_s = -phase.start.acceleration / phase.jerk;
            if inside(velocity_turns_s) {
                extrema.velocity.include(phase.sample(velocity_turns_s).velocity);
            }
            for position_turns_s in standstills_s(&phase) {
                if inside(position_turns_s) {
                    extrema.position.include(phase.sample(position_turns_s).position);
                }
            }
        }
        extrema
    }
}

/// When the velocity of the phase is zero; a time that is not a number means never.
fn standstills_s(phase: &Phase) -> [f64; 2] {
    let State { velocity, acceleration, .. } = phase.start;
    // v + a·t + j/2·t² = 0 in the form that does not cancel.
    let discriminant = acceleration * acceleration - 2.0 * phase.jerk * velocity;
    let q = -(acceleration + libm::copysign(libm::sqrt(discriminant), acceleration));
    [2.0 * velocity / q, q / phase.jerk]
}

impl Extrema {
    fn include(&mut self, state: &State) {
        self.position.include(state.position);
        self.velocity.include(state.velocity);
        self.acceleration.include(state.acceleration);
    }
}

/// Building a profile, phase by phase.
impl Profile {
    /// Forgets the phases and starts at this state. What durations are possible is kept.
    pub(super) fn begin(&mut self, start: State) {
        self.starts_s = [f64::INFINITY; PHASES_MAX];
        self.count = 0;
        self.duration_s = 0.0;
        self.end = start;
    }

    /// Appends a phase in which the acceleration is constant; one that is not longer than 0 s is left out.
    pub(super) fn accelerate(&mut self, duration_s: f64, acceleration: f64) {
        self.append(duration_s, acceleration, 0.0);
    }

    /// Appends phases of constant acceleration to the state that is reached, leaving out those that are not longer than 0 s.
    #[inline]
    pub(super) fn accelerate_all<const COUNT: usize>(
        &mut self,
        reached: State,
        durations_s: &[f64; COUNT],
        accelerations: &[f64; COUNT],
    ) {
        self.append_all(reached, durations_s, accelerations, |_, acceleration| (acceleration, 0.0));
    }

    /// Appends a phase of constant jerk; one that is not longer than 0 s is left out.
    pub(super) fn shift(&mut self, duration_s: f64, jerk: f64) {
        self.append(duration_s, self.end.acceleration, jerk);
    }

    /// Appends phases of constant jerk to the state that is reached, leaving out those that are not longer than 0 s.
    #[inline]
    pub(super) fn shift_all<const COUNT: usize>(
        &mut self,
        reached: State,
        durations_s: &[f64; COUNT],
        jerks: &[f64; COUNT],
    ) {
        self.append_all(reached, durations_s, jerks, |acceleration, jerk| (acceleration, jerk));
    }

    /// Takes away what rounding has put the acceleration beyond its limits.
    pub(super) fn limit_acceleration(&mut self, min: f64, max: f64) {
        self.end.acceleration = smaller(larger(self.end.acceleration, min), max);
    }

    /// Appends a phase that starts with this acceleration.
    fn append(&mut self, duration_s: f64, acceleration: f64, jerk: f64) {
        self.append_all(self.end, &[duration_s], &[jerk], |_, jerk| (acceleration, jerk));
    }

    /// Appends phases. `rates` gives the acceleration at the start and the jerk, from the acceleration reached and
    /// the parameter of the phase.
    ///
    /// The state that is reached comes from the caller, who has just made it: read again, it would have to wait for the cache.
    /// Whether a phase is left out is a coin toss, so it is written in any case and only the count depends on it.
    #[inline]
    fn append_all<const COUNT: usize>(
        &mut self,
        reached: State,
        durations_s: &[f64; COUNT],
        parameters: &[f64; COUNT],
        rates: impl Fn(f64, f64) -> (f64, f64),
    ) {
        let (mut end, mut time_s, mut count) = (reached, self.duration_s, self.count);
        for (duration_s, parameter) in durations_s.iter().zip(parameters) {
            let (acceleration, jerk) = rates(end.acceleration, *parameter);
            end.acceleration = acceleration;
            if let (Some(phase), Some(start_s)) = (self.phases.get_mut(count), self.starts_s.get_mut(count)) {
                *phase = Coefficients { start: end, jerk };
                *start_s = time_s;
                // Not the other way round: what is not a number must not look like no time.
                let elapsed_s = larger(0.0, *duration_s);
                count += 1 - usize::from(*duration_s <= 0.0);
                time_s += elapsed_s;
                end = integrate(&end, jerk, elapsed_s);
            }
        }
        if let Some(start_s) = self.starts_s.get_mut(count) {
            *start_s = f64::INFINITY;
        }
        (self.end, self.duration_s, self.count) = (end, time_s, count);
    }

    /// The profile is complete: at its end it is exactly at the target.
    pub(super) fn finish(&mut self, target: State) -> Result<(), PlanError> {
        self.finish_at(target, self.duration_s)
    }

    /// The profile is complete, and lasts exactly this long; the last phase takes up the rounding.
    pub(super) fn finish_at(&mut self, target: State, duration_s: f64) -> Result<(), PlanError> {
        if self.count == 0 && duration_s > 0.0 {
            // A time that is itself rounding: every phase of it was none.
            self.append(duration_s, self.end.acceleration, 0.0);
        }
        let reached = self.end;
        self.end = target;
        self.duration_s = duration_s;
        let State { position, velocity, acceleration } = reached;
        let finite =
            duration_s < SIZE_MAX && position.is_finite() && velocity.is_finite() && acceleration.is_finite();
        if finite { Ok(()) } else { Err(PlanError::NotRepresentable { axis: 0 }) }
    }

    /// Leaves the profile without its phases: it would last `duration_s`, and a longer one takes its place.
    pub(super) fn leave_open(&mut self, duration_s: f64) -> Result<(), PlanError> {
        // Equal to no duration, not even to one that has overflowed.
        self.duration_s = f64::NAN;
        if duration_s < SIZE_MAX { Ok(()) } else { Err(PlanError::NotRepresentable { axis: 0 }) }
    }

    /// Where the building has arrived.
    pub(super) fn reached(&self) -> State {
        self.end
    }

    /// Sets the shortest duration, not yet any blocked interval.
    pub(super) fn set_minimum_duration(&mut self, minimum_duration_s: f64) {
        self.minimum_duration_s = minimum_duration_s;
        self.blocked_count = 0;
    }

    /// Notes a blocked interval, unless it is empty.
    pub(super) fn block(&mut self, after_s: f64, before_s: f64) {
        if after_s >= before_s {
            return;
        }
        if let Some(slot) = self.blocked.get_mut(self.blocked_count) {
            *slot = Blocked { after_s, before_s };
            self.blocked_count += 1;
        }
    }

    /// Stretches the profile in space, from this start to this target.
    pub(super) fn scale(&mut self, ratio: f64, start_position: f64, target: State) {
        let from = self.start().position;
        for phase in self.phases.iter_mut().take(self.count) {
            let State { position, velocity, acceleration } = phase.start;
            phase.start = State {
                position: start_position + ratio * (position - from),
                velocity: ratio * velocity,
                acceleration: ratio * acceleration,
            };
            phase.jerk *= ratio;
        }
        self.end = target;
    }

    /// What durations are possible.
    pub(super) fn possible(&self) -> (f64, ([Blocked; BLOCKED_MAX], usize)) {
        (self.minimum_duration_s, (self.blocked, self.blocked_count))
    }

    /// Sets what durations are possible.
    pub(super) fn set_possible(&mut self, minimum_duration_s: f64, blocked: ([Blocked; BLOCKED_MAX], usize)) {
        self.minimum_duration_s = minimum_duration_s;
        (self.blocked, self.blocked_count) = blocked;
    }

    /// At rest at its end, the profile stays there until this time.
    pub(super) fn rest_until(&mut self, time_s: f64) {
        let target = self.end;
        self.append(time_s - self.duration_s, 0.0, 0.0);
        self.end = target;
        self.duration_s = self.duration_s.max(time_s);
    }

    /// Goes on with this profile, which starts where this one ends.
    pub(super) fn join(&mut self, next: &Self) {
        for phase in next.phases() {
            self.end = phase.start;
            self.append(phase.duration_s, phase.start.acceleration, phase.jerk);
        }
        self.end = next.end;
    }
}
