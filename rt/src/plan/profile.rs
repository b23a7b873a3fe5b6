//! The trajectory of one axis, made of phases of constant jerk.

use super::choice::{larger, smaller};
use super::error::PlanError;
use super::problem::{SIZE_MAX, State};

/// The most phases of a profile: two of the brake, and those of a mixture of two seven-phase profiles.
pub const PHASES_MAX: usize = 16;

/// A time in which the jerk is constant.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Phase {
    /// When the phase starts, in s after the start of the profile.
    pub start_s: f64,
    /// How long it lasts, in s.
    pub duration_s: f64,
    /// The state at its start.
    pub start: State,
    /// The jerk, in rad/s³.
    pub jerk: f64,
}

impl Phase {
    /// The state `elapsed_s` seconds after the start of the phase.
    #[inline]
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
    /// Acceleration. Where the acceleration jumps, both values count.
    pub acceleration: Range,
}

/// A blocked interval: the axis cannot make its motion in any duration inside it.
///
/// It occurs where the target moves: the durations before the interval belong to one motion, those behind it to another.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Blocked {
    /// The longest possible duration before the interval, in s.
    pub after_s: f64,
    /// The shortest possible duration behind the interval, in s.
    pub before_s: f64,
}

/// The most blocked intervals that are kept for an axis.
pub(super) const BLOCKED_MAX: usize = 4;

/// The trajectory of one axis: up to [`PHASES_MAX`] phases of constant jerk, then the target state.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Profile {
    // The start times are apart from the rest, so that finding a phase reads little. They are infinite behind the last phase.
    starts_s: [f64; PHASES_MAX],
    phases: [Coefficients; PHASES_MAX],
    count: usize,
    duration_s: f64,
    // This field stands between two numbers that are stored one by one and read together. Side by side, the compiler would
    // read them as a pair, and the processor would have to wait for the cache.
    minimum_duration_s: f64,
    end: State,
    blocked: [Blocked; BLOCKED_MAX],
    blocked_count: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
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
    /// A profile that lasts 0 s and rests at this position, in rad, ever after.
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

    /// The shortest time in which this axis alone could make the motion, in s.
    pub fn minimum_duration_s(&self) -> f64 {
        self.minimum_duration_s
    }

    /// The durations above [`minimum_duration_s`](Self::minimum_duration_s) that are impossible for this axis, in
    /// ascending order.
    pub fn blocked(&self) -> &[Blocked] {
        self.blocked.get(..self.blocked_count).unwrap_or_default()
    }

    /// The state `time_s` seconds after the start.
    ///
    /// Before the start it is the start state. At the end it is exactly the target state. After the end the axis goes on with
    /// the target velocity and without acceleration.
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
        // The phase is mostly the same as in the last cycle, so the processor predicts every comparison.
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

    /// The exact extrema from the start to the end. They are at the ends of the phases, and where the derivative is zero inside a
    /// phase.
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
            let velocity_extremum_s = -phase.start.acceleration / phase.jerk;
            if inside(velocity_extremum_s) {
                extrema.velocity.include(phase.sample(velocity_extremum_s).velocity);
            }
            for position_extremum_s in standstills_s(&phase) {
                if inside(position_extremum_s) {
                    extrema.position.include(phase.sample(position_extremum_s).position);
                }
            }
        }
        extrema
    }
}

/// When the velocity of the phase is zero, in s after its start; not a number where it never is.
fn standstills_s(phase: &Phase) -> [f64; 2] {
    let State { velocity, acceleration, .. } = phase.start;
    // The roots of v + a·t + j/2·t² = 0, in the form without cancellation.
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

// Building a profile, phase by phase.
impl Profile {
    /// Removes all phases and starts at this state. The minimum duration and the blocked intervals stay.
    pub(super) fn begin(&mut self, start: State) {
        self.starts_s = [f64::INFINITY; PHASES_MAX];
        self.count = 0;
        self.duration_s = 0.0;
        self.end = start;
    }

    /// Appends a phase of constant acceleration. A phase that is not longer than 0 s is left out.
    pub(super) fn accelerate(&mut self, duration_s: f64, acceleration: f64) {
        self.append(duration_s, acceleration, 0.0);
    }

    /// Appends phases of constant acceleration to the state that was reached. Phases that are not longer than 0 s are left
    /// out.
    #[inline]
    pub(super) fn accelerate_all<const COUNT: usize>(
        &mut self,
        reached: State,
        durations_s: &[f64; COUNT],
        accelerations: &[f64; COUNT],
    ) {
        self.append_all(reached, durations_s, accelerations, |_, acceleration| (acceleration, 0.0));
    }

    /// Appends a phase of constant jerk. A phase that is not longer than 0 s is left out.
    pub(super) fn shift(&mut self, duration_s: f64, jerk: f64) {
        self.append(duration_s, self.end.acceleration, jerk);
    }

    /// Appends phases of constant jerk to the state that was reached. Phases that are not longer than 0 s are left out.
    #[inline]
    pub(super) fn shift_all<const COUNT: usize>(
        &mut self,
        reached: State,
        durations_s: &[f64; COUNT],
        jerks: &[f64; COUNT],
    ) {
        self.append_all(reached, durations_s, jerks, |acceleration, jerk| (acceleration, jerk));
    }

    /// Cuts the acceleration that was reached off at its limits, which it exceeds only by rounding.
    pub(super) fn limit_acceleration(&mut self, min: f64, max: f64) {
        self.end.acceleration = smaller(larger(self.end.acceleration, min), max);
    }

    /// Appends a phase that starts with this acceleration.
    fn append(&mut self, duration_s: f64, acceleration: f64, jerk: f64) {
        self.append_all(self.end, &[duration_s], &[jerk], |_, jerk| (acceleration, jerk));
    }

    /// Appends phases. `rates` gives the acceleration at the start of a phase and its jerk, from the acceleration that was
    /// reached and the parameter of the phase.
    ///
    /// The caller hands in the state that was reached, because reading it again would wait for the cache. The processor cannot
    /// predict whether a phase is left out. So every phase is written, and only the count depends on its duration.
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
                // In this order, a duration that is not a number stays one, and does not become 0 s.
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

    /// Removes all phases but the first ones, which last this long and reach this state.
    pub(super) fn return_to(&mut self, count: usize, duration_s: f64, reached: State) {
        self.starts_s.iter_mut().skip(count).for_each(|start_s| *start_s = f64::INFINITY);
        (self.count, self.duration_s, self.end) = (count, duration_s, reached);
    }

    /// Returns the number of phases.
    pub(super) fn phase_count(&self) -> usize {
        self.count
    }

    /// Completes the profile. Its end is exactly the target.
    pub(super) fn finish(&mut self, target: State) -> Result<(), PlanError> {
        self.finish_at(target, self.duration_s)
    }

    /// Completes the profile. Its end is exactly the target, and it lasts exactly this long. The last phase takes up the
    /// rounding.
    ///
    /// # Errors
    /// [`PlanError::NotRepresentable`] with axis 0 if a number of the profile is not finite.
    pub(super) fn finish_at(&mut self, target: State, duration_s: f64) -> Result<(), PlanError> {
        if self.count == 0 && duration_s > 0.0 {
            // The whole duration is rounding, so every phase was left out.
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

    /// Leaves the profile without phases. It would last `duration_s`, but a longer one will replace it.
    pub(super) fn leave_open(&mut self, duration_s: f64) -> Result<(), PlanError> {
        // Not a number is equal to no duration, not even to one that has overflowed.
        self.duration_s = f64::NAN;
        if duration_s < SIZE_MAX { Ok(()) } else { Err(PlanError::NotRepresentable { axis: 0 }) }
    }

    /// The state that the phases reach so far.
    pub(super) fn reached(&self) -> State {
        self.end
    }

    /// Sets the minimum duration, and removes all blocked intervals.
    pub(super) fn set_minimum_duration(&mut self, minimum_duration_s: f64) {
        self.minimum_duration_s = minimum_duration_s;
        self.blocked_count = 0;
    }

    /// Adds a blocked interval, unless it is empty.
    pub(super) fn block(&mut self, after_s: f64, before_s: f64) {
        if after_s >= before_s {
            return;
        }
        if let Some(slot) = self.blocked.get_mut(self.blocked_count) {
            *slot = Blocked { after_s, before_s };
            self.blocked_count += 1;
        }
    }

    /// Takes over the motion of another profile. The minimum duration and the blocked intervals stay.
    pub(super) fn take_motion(&mut self, other: &Self) {
        self.starts_s = other.starts_s;
        // Most profiles have far fewer phases than there is room for.
        for (own, phase) in self.phases.iter_mut().zip(&other.phases).take(other.count) {
            *own = *phase;
        }
        (self.count, self.duration_s, self.end) = (other.count, other.duration_s, other.end);
    }

    /// Multiplies the profile by `ratio`, and moves it to this start position and this target.
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

    /// The minimum duration and the blocked intervals.
    pub(super) fn possible(&self) -> (f64, ([Blocked; BLOCKED_MAX], usize)) {
        (self.minimum_duration_s, (self.blocked, self.blocked_count))
    }

    /// Sets the minimum duration and the blocked intervals.
    pub(super) fn set_possible(&mut self, minimum_duration_s: f64, blocked: ([Blocked; BLOCKED_MAX], usize)) {
        self.minimum_duration_s = minimum_duration_s;
        (self.blocked, self.blocked_count) = blocked;
    }

    /// Extends a profile that ends at rest: it stays there until this time, in s after its start.
    pub(super) fn rest_until(&mut self, time_s: f64) {
        let target = self.end;
        self.append(time_s - self.duration_s, 0.0, 0.0);
        self.end = target;
        self.duration_s = self.duration_s.max(time_s);
    }

    /// Appends another profile, which starts where this one ends.
    pub(super) fn join(&mut self, next: &Self) {
        for phase in next.phases() {
            self.end = phase.start;
            self.append(phase.duration_s, phase.start.acceleration, phase.jerk);
        }
        self.end = next.end;
    }
}
