//! How waypoints are passed: the velocity and the acceleration of every axis at each of them, so that the whole way takes little time.
//!
//! From one waypoint to the next, all axes take the shortest time that is possible for all of them. So the velocities and the
//! accelerations at the waypoints are all that is to be found. A pattern search finds them: it changes one of them a little, and keeps the
//! change if the time gets shorter. It begins at rest at every waypoint, which is always possible, and keeps only changes that are
//! possible. So it always ends with a motion within all limits.
//!
//! If only the slowest axis counted, the search would often end early: where two axes are equally slow, a change of one of them
//! gains nothing. So each axis counts, by a norm of the times of all axes, whose exponent grows until the slowest axis alone counts.
//! This also lets the axes that have time to spare pass at velocities that fit.

use arrayvec::ArrayVec;

use takt_rt::AxisLimits;
use takt_rt::plan::{self, Blocked, Limits, PlanError, PlanOptions, Problem, Profile, State};

/// The exponents of the norm, as powers of 2: 8, 32 and 128.
const NORM_DOUBLINGS: [u32; 3] = [3, 5, 7];
/// Rounds of changes with each exponent, at most.
const ROUNDS: usize = 60;
/// The first change of a velocity or of an acceleration, relative to its limit.
const FIRST_STEP: f64 = 0.1;
/// The search of a value ends with changes below this.
const LAST_STEP: f64 = 1e-4;
/// The factor of a change after a success, and after a failure.
const GROWTH: f64 = 1.6;
const SHRINKING: f64 = 0.5;
/// A gain below this, relative to the time, is rounding.
const ROUNDING: f64 = 1e-12;
/// The most blocked intervals that a profile has.
const BLOCKED_MAX: usize = 4;

/// The motion of all axes from one waypoint to the next.
pub(super) struct Motion {
    pub(super) duration_s: f64,
    pub(super) profiles: Vec<Profile>,
}

/// An axis cannot get from its state at a waypoint to the next one within its limits. The start is waypoint 0.
pub(super) struct Unreachable {
    pub(super) waypoint: usize,
    pub(super) axis: usize,
}

/// What is changed at a waypoint.
#[derive(Clone, Copy)]
enum Change {
    Velocity,
    Acceleration,
    /// The velocities at this waypoint and at the next one.
    TwoVelocities,
}

const CHANGES: [Change; 3] = [Change::Velocity, Change::Acceleration, Change::TwoVelocities];

/// In which times an axis can go from one waypoint to the next.
#[derive(Clone, Default)]
struct PossibleTimes {
    shortest_s: f64,
    blocked: ArrayVec<Blocked, BLOCKED_MAX>,
}

/// The states at the waypoints, and the times between them. The first waypoint is the start.
///
/// What belongs to one waypoint stands beside each other, an axis each: `waypoint * axes + axis` is the place of an axis.
pub(super) struct Passing<'a> {
    limits: &'a [AxisLimits],
    states: Vec<State>,
    /// From each waypoint to the next one.
    times: Vec<PossibleTimes>,
}

impl<'a> Passing<'a> {
    /// Finds how to pass these waypoints, from a state to rest at the last of them. The waypoints are within the position limits, and
    /// each differs from the one before.
    ///
    /// # Errors
    /// What cannot be reached from the start: see [`Unreachable`].
    pub(super) fn search(
        start: &[State],
        waypoints: &[&[f64]],
        limits: &'a [AxisLimits],
    ) -> Result<Self, Unreachable> {
        let mut states = start.to_vec();
        let positions = waypoints.iter().flat_map(|waypoint| waypoint.iter());
        states.extend(positions.map(|position| State::rest(*position)));
        let mut passing = Self { limits, states, times: vec![] };
        for place in 0..passing.states.len() - limits.len() {
            let (waypoint, axis) = (place / limits.len(), place % limits.len());
            let times = passing.possible_times(place).map_err(|_| Unreachable { waypoint, axis })?;
            passing.times.push(times);
        }
        passing.estimate();
        for doublings in NORM_DOUBLINGS {
            passing.improve(doublings);
        }
        Ok(passing)
    }

    /// The motions from each waypoint to the next one. They are never slower than with a stop at every waypoint.
    ///
    /// # Errors
    /// As [`Passing::search`].
    pub(super) fn motions(self) -> Result<Vec<Motion>, Unreachable> {
        let mut at_rest = Self { limits: self.limits, states: self.states.clone(), times: vec![] };
        for place in self.inner() {
            at_rest.states[place] = State::rest(at_rest.states[place].position);
        }
        let total_s = |motions: &Vec<Motion>| motions.iter().map(|motion| motion.duration_s).sum::<f64>();
        match (self.planned(), at_rest.planned()) {
            (Ok(passing), Ok(stopping)) if total_s(&stopping) < total_s(&passing) => Ok(stopping),
            (Err(_), stopping) => stopping,
            (passing, _) => passing,
        }
    }

    /// The motions of these states, with an axis at rest where its position limit is in the way.
    fn planned(mut self) -> Result<Vec<Motion>, Unreachable> {
        let waypoints = self.states.len() / self.limits.len();
        let mut motions = Vec::with_capacity(waypoints);
        while motions.len() + 1 < waypoints {
            let waypoint = motions.len();
            match self.motion(waypoint) {
                Ok(motion) => motions.push(motion),
                // An axis that waits for others may leave its position limit on the way. It does not if it waits at rest.
                Err(error) => {
                    let axis = error.axis().unwrap_or(0);
                    let changed = self.rest_around(waypoint, axis);
                    motions.truncate(changed.ok_or(Unreachable { waypoint, axis })?);
                }
            }
        }
        Ok(motions)
    }

    /// The motion of all axes from a waypoint to the next one.
    fn motion(&self, waypoint: usize) -> Result<Motion, PlanError> {
        let axes = self.limits.len();
        let problems: Vec<Problem> = (0..axes).map(|axis| self.problem(waypoint * axes + axis)).collect();
        let mut profiles = vec![Profile::hold(0.0); axes];
        let duration_s = plan::synchronised(&problems, &mut profiles, PlanOptions::default())?;
        Ok(Motion { duration_s, profiles })
    }

    /// Lets an axis rest at this waypoint and at the next one. Returns the first waypoint from which the motion is different now;
    /// `None` if the axis rests at both already.
    fn rest_around(&mut self, waypoint: usize, axis: usize) -> Option<usize> {
        let axes = self.limits.len();
        let mut is_changed = false;
        for waypoint in [waypoint, waypoint + 1].into_iter().filter(|waypoint| *waypoint > 0) {
            let state = self.states.get_mut(waypoint * axes + axis)?;
            let rest = State::rest(state.position);
            is_changed |= *state != rest;
            *state = rest;
        }
        is_changed.then_some(waypoint.saturating_sub(1))
    }

    /// What an axis has to do from a waypoint to the next one.
    fn problem(&self, place: usize) -> Problem {
        let axes = self.limits.len();
        let (start, limits) = (self.states[place], &self.limits[place % axes]);
        let limits = Limits::symmetric(limits.velocity, steepest(limits), limits.jerk)
            .with_position(limits.position_min.min(start.position), limits.position_max.max(start.position));
        Problem { start, target: self.states[place + axes], limits }
    }

    fn possible_times(&self, place: usize) -> Result<PossibleTimes, PlanError> {
        let profile = plan::position(&self.problem(place))?;
        let blocked = profile.blocked().iter().copied().take(BLOCKED_MAX).collect();
        Ok(PossibleTimes { shortest_s: profile.duration_s(), blocked })
    }

    /// The places of the waypoints that may be passed in motion: all but the start and the last one.
    fn inner(&self) -> std::ops::Range<usize> {
        self.limits.len()..self.states.len() - self.limits.len()
    }

    /// Where an axis goes on in the same direction, it passes with a velocity between the mean ones before and behind.
    fn estimate(&mut self) {
        let axes = self.limits.len();
        let durations_s: Vec<f64> = self.times.chunks_exact(axes).map(shortest_for_all_s).collect();
        for place in self.inner() {
            let mean = |place: usize| {
                let way = self.states[place + axes].position - self.states[place].position;
                way / durations_s[place / axes]
            };
            let (before, behind) = (mean(place - axes), mean(place));
            if before * behind > 0.0 {
                let velocity = 2.0 * before * behind / (before + behind);
                self.try_states(&[(place, State { velocity, ..self.states[place] })], 0);
            }
        }
    }

    /// Changes one value after the other, until no change makes the norm of the times smaller.
    fn improve(&mut self, doublings: u32) {
        let inner = self.inner();
        let mut steps = vec![[FIRST_STEP; CHANGES.len()]; inner.len()];
        for _ in 0..ROUNDS {
            let mut is_finished = true;
            for (place, steps) in inner.clone().zip(&mut steps) {
                for (change, step) in CHANGES.into_iter().zip(steps).filter(|(_, step)| **step >= LAST_STEP) {
                    let is_better = [*step, -*step].into_iter().any(|step| {
                        let changed = self.changed(place, change, step);
                        self.try_states(&changed, doublings)
                    });
                    *step *= if is_better { GROWTH } else { SHRINKING };
                    is_finished = false;
                }
            }
            if is_finished {
                return;
            }
        }
    }

    /// The states that are different after a change; none if that change is not possible here.
    fn changed(&self, place: usize, change: Change, step: f64) -> ArrayVec<(usize, State), 2> {
        let axes = self.limits.len();
        let limits = &self.limits[place % axes];
        let faster = |place: usize| {
            let state = self.states[place];
            (place, State { velocity: state.velocity + step * limits.velocity, ..state })
        };
        let mut changed: ArrayVec<(usize, State), 2> = ArrayVec::new();
        match change {
            Change::Velocity => changed.push(faster(place)),
            Change::Acceleration => {
                // Without a jerk limit the acceleration is free at every waypoint.
                if limits.jerk.is_finite() {
                    let state = self.states[place];
                    let acceleration = state.acceleration + step * steepest(limits);
                    changed.push((place, State { acceleration, ..state }));
                }
            }
            Change::TwoVelocities => {
                if self.inner().contains(&(place + axes)) {
                    changed.extend([faster(place), faster(place + axes)]);
                }
            }
        }
        changed.into_iter().map(|(place, state)| (place, within(state, limits))).collect()
    }

    /// Changes states of an axis at waypoints that follow one another. Returns false, and leaves everything as it was, if the motion is
    /// impossible then, or if the norm of the times is not smaller.
    fn try_states(&mut self, changed: &[(usize, State)], doublings: u32) -> bool {
        let axes = self.limits.len();
        let (Some((first, _)), Some((last, _))) = (changed.first(), changed.last()) else { return false };
        let ways = || (first - axes..=*last).step_by(axes);
        let norm_s =
            |passing: &Self| ways().map(|place| passing.norm_s(place / axes, doublings)).sum::<f64>();
        let before_s = norm_s(self);
        let states: ArrayVec<State, 2> = changed.iter().map(|(place, _)| self.states[*place]).collect();
        let times: ArrayVec<PossibleTimes, 3> = ways().map(|place| self.times[place].clone()).collect();
        for (place, state) in changed {
            self.states[*place] = *state;
        }
        let is_possible =
            ways().all(|place| self.possible_times(place).map(|times| self.times[place] = times).is_ok());
        if is_possible && norm_s(self) < before_s * (1.0 - ROUNDING) {
            return true;
        }
        for ((place, _), state) in changed.iter().zip(states) {
            self.states[*place] = state;
        }
        for (place, times) in ways().zip(times) {
            self.times[place] = times;
        }
        false
    }

    /// The shortest time for all axes from a waypoint to the next one, and the difference of the norm and of the slowest axis on top.
    fn norm_s(&self, waypoint: usize, doublings: u32) -> f64 {
        let axes = self.limits.len();
        let times = &self.times[waypoint * axes..(waypoint + 1) * axes];
        let slowest_s = times.iter().map(|times| times.shortest_s).fold(0.0, f64::max);
        let power = |ratio: f64| (0..doublings).fold(ratio, |power, _| power * power);
        let sum: f64 = times.iter().map(|times| power(times.shortest_s / slowest_s)).sum();
        let norm_s = slowest_s * (0..doublings).fold(sum, |root, _| root.sqrt());
        shortest_for_all_s(times) + (norm_s - slowest_s)
    }
}

/// The limit of speeding up and of slowing down: the direction may change on the way, so the smaller one holds for both.
const fn steepest(limits: &AxisLimits) -> f64 {
    limits.acceleration.min(limits.deceleration)
}

/// The state with its acceleration within the limits, and with a velocity that stays within its limit before and behind this state: the
/// acceleration takes some time to come, and to go.
fn within(state: State, limits: &AxisLimits) -> State {
    let steepest = steepest(limits).min((2.0 * limits.jerk * limits.velocity).sqrt());
    let acceleration = state.acceleration.clamp(-steepest, steepest);
    let change = acceleration * acceleration / (2.0 * limits.jerk);
    let largest = (limits.velocity - change).max(0.0);
    State { velocity: state.velocity.clamp(-largest, largest), acceleration, ..state }
}

/// The shortest time that is possible for all axes.
fn shortest_for_all_s(times: &[PossibleTimes]) -> f64 {
    let mut shortest_s = times.iter().map(|times| times.shortest_s).fold(0.0, f64::max);
    // Each round leaves a blocked interval behind for good.
    loop {
        let blocked = times.iter().flat_map(|times| &times.blocked);
        let around = |blocked: &&Blocked| blocked.after_s < shortest_s && shortest_s < blocked.before_s;
        match blocked.filter(around).map(|blocked| blocked.before_s).reduce(f64::max) {
            Some(before_s) => shortest_s = before_s,
            None => return shortest_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: AxisLimits = AxisLimits {
        position_min: -20.0,
        position_max: 20.0,
        velocity: 2.0,
        acceleration: 8.0,
        deceleration: 8.0,
        jerk: 100.0,
        torque: 50.0,
    };

    fn total_s(passing: &Passing<'_>) -> f64 {
        passing.times.chunks_exact(passing.limits.len()).map(shortest_for_all_s).sum()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20))]

        #[test]
        fn thousands_of_random_changes_make_the_way_hardly_faster(
            waypoints in prop::collection::vec([-1.0f64..1.0, -1.0f64..1.0], 2..5),
            changes in prop::collection::vec((any::<prop::sample::Index>(), -1.0f64..1.0, -1.0f64..1.0), 3_000),
        ) {
            let (limits, start) = ([LIMITS; 2], [State::rest(0.0); 2]);
            let positions: Vec<&[f64]> = waypoints.iter().map(|waypoint| &waypoint[..]).collect();
            let Ok(mut passing) = Passing::search(&start, &positions, &limits) else { panic!("it is possible") };
            let found_s = total_s(&passing);
            let inner = passing.inner();
            for (index, (place, velocity, acceleration)) in changes.into_iter().enumerate() {
                let place = inner.start + place.index(inner.len());
                let state = passing.states[place];
                let size = 0.1 / (1.0 + index as f64 / 300.0);
                let velocity = state.velocity + size * velocity * LIMITS.velocity;
                let acceleration = state.acceleration + size * acceleration * LIMITS.acceleration;
                let changed = within(State { velocity, acceleration, ..state }, &LIMITS);
                passing.try_states(&[(place, changed)], 9);
            }
            prop_assert!(found_s < 1.05 * total_s(&passing), "{found_s} and {}", total_s(&passing));
        }

        #[test]
        fn the_motions_take_the_time_that_was_found_unless_a_position_limit_is_in_the_way(
            waypoints in prop::collection::vec([-1.0f64..1.0, -1.0f64..1.0, -1.0f64..1.0], 1..6),
        ) {
            let (limits, start) = ([LIMITS; 3], [State::rest(0.0); 3]);
            let positions: Vec<&[f64]> = waypoints.iter().map(|waypoint| &waypoint[..]).collect();
            let Ok(passing) = Passing::search(&start, &positions, &limits) else { panic!("it is possible") };
            let found_s = total_s(&passing);
            let Ok(motions) = passing.motions() else { panic!("it is possible") };
            let actual_s: f64 = motions.iter().map(|motion| motion.duration_s).sum();
            prop_assert!((actual_s - found_s).abs() < 1e-9, "{actual_s} and {found_s}");
        }
    }
}
