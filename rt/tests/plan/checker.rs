//! Checks profiles. It shares no code with the planner, and reads the phases only.

use takt_rt::plan::{Limits, Problem, Profile, State};

/// The end that a profile must have.
#[derive(Clone, Copy, PartialEq)]
pub enum Arrival {
    /// At the target state.
    State,
    /// At the target velocity and acceleration, at any position.
    Velocity,
}

/// The tolerance of each quantity, from the sizes that occur in the profile.
struct Tolerance {
    position: f64,
    velocity: f64,
    acceleration: f64,
}

impl Tolerance {
    fn of(problem: &Problem, profile: &Profile) -> Self {
        const RELATIVE: f64 = 1e-11;
        let mut sizes = [0.0_f64; 3];
        for state in profile.phases().map(|phase| phase.start).chain([problem.start, problem.target]) {
            for (size, value) in sizes.iter_mut().zip([state.position, state.velocity, state.acceleration]) {
                *size = size.max(value.abs());
            }
        }
        let Limits { velocity_max, velocity_min, acceleration_max, acceleration_min, jerk_max, .. } =
            problem.limits;
        let second_order = jerk_max.is_infinite();
        let velocity = sizes[1].max(velocity_max).max(-velocity_min);
        let reach = velocity * (profile.duration_s() + velocity / acceleration_max.min(-acceleration_min));
        // Times have a limited number of digits too. Where the distance is small beside the positions, the digits of the
        // positions do not determine the times, so a multiple of the cycle may be met a little early.
        let digits = 4.0 * f64::EPSILON;
        let open = (digits * sizes[0] / sizes[1].max(f64::MIN_POSITIVE)).min(1e-11 * profile.duration_s());
        let time = if second_order { 0.0 } else { digits * profile.duration_s() + open };
        Self {
            position: RELATIVE * (sizes[0] + reach),
            velocity: RELATIVE * velocity + time * sizes[2].max(acceleration_max).max(-acceleration_min),
            acceleration: RELATIVE * sizes[2].max(acceleration_max).max(-acceleration_min)
                + time * jerk_max.min(f64::MAX),
        }
    }
}

fn polynomial(start: &State, jerk: f64, t: f64) -> State {
    State {
        position: start.position
            + start.velocity * t
            + start.acceleration * t * t / 2.0
            + jerk * t * t * t / 6.0,
        velocity: start.velocity + start.acceleration * t + jerk * t * t / 2.0,
        acceleration: start.acceleration + jerk * t,
    }
}

fn check(kept: bool, what: impl Fn() -> String) -> Result<(), String> {
    if kept { Ok(()) } else { Err(what()) }
}

/// Says what is wrong with the profile as the answer to the problem.
pub fn judge(problem: &Problem, profile: &Profile, arrival: Arrival) -> Result<(), String> {
    let tolerance = Tolerance::of(problem, profile);
    let second_order = problem.limits.jerk_max.is_infinite();
    let (mut state, mut time_s) = (problem.start, 0.0);
    let mut inside = Inside { now: false, velocity_matters: arrival == Arrival::State };
    for (index, phase) in profile.phases().enumerate() {
        let duration_s = phase.duration_s;
        check(duration_s >= 0.0, || format!("phase {index} has a negative length"))?;
        check((phase.start_s - time_s).abs() <= 1e-12 * (1.0 + time_s), || {
            format!("phase {index} starts late")
        })?;
        check((phase.start.position - state.position).abs() <= tolerance.position, || {
            format!("position jumps into phase {index}: {state:?} {phase:?}")
        })?;
        check((phase.start.velocity - state.velocity).abs() <= tolerance.velocity, || {
            format!("velocity jumps into phase {index}: {state:?} {phase:?}")
        })?;
        check(
            second_order || (phase.start.acceleration - state.acceleration).abs() <= tolerance.acceleration,
            || format!("acceleration jumps into phase {index}: {state:?} {phase:?}"),
        )?;
        check(phase.jerk.abs() <= problem.limits.jerk_max * (1.0 + 1e-11), || {
            format!("jerk in phase {index}")
        })?;
        inside.look(&problem.limits, &phase.start, phase.jerk, duration_s, &tolerance)?;
        state = polynomial(&phase.start, phase.jerk, duration_s);
        time_s = phase.start_s + duration_s;
    }
    check((time_s - profile.duration_s()).abs() <= 1e-12 * (1.0 + time_s), || "phases end elsewhere".into())?;
    arrives(problem, profile, &state, &tolerance, arrival, second_order)
}

fn arrives(
    problem: &Problem,
    profile: &Profile,
    state: &State,
    tolerance: &Tolerance,
    arrival: Arrival,
    second_order: bool,
) -> Result<(), String> {
    let target = &problem.target;
    let end = profile.sample(profile.duration_s());
    if arrival == Arrival::State {
        check(end.position == target.position, || "the end is not the target".into())?;
        let miss = state.position - target.position;
        check(miss.abs() <= tolerance.position, || format!("the target is missed by {miss:e}"))?;
    }
    check(end.velocity == target.velocity, || "the final velocity is not the target's".into())?;
    let miss = state.velocity - target.velocity;
    check(miss.abs() <= tolerance.velocity, || format!("the target velocity is missed by {miss:e}"))?;
    let miss = state.acceleration - target.acceleration;
    check(second_order || miss.abs() <= tolerance.acceleration, || format!("acceleration missed by {miss:e}"))
}

/// True if the motion has entered the limits. From then on it must keep them.
struct Inside {
    now: bool,
    velocity_matters: bool,
}

impl Inside {
    fn look(
        &mut self,
        limits: &Limits,
        start: &State,
        jerk: f64,
        duration_s: f64,
        tolerance: &Tolerance,
    ) -> Result<(), String> {
        let acceleration_matters = limits.jerk_max.is_finite();
        let keeps_velocity = |velocity: f64| {
            !self.velocity_matters
                || (limits.velocity_min - tolerance.velocity..=limits.velocity_max + tolerance.velocity)
                    .contains(&velocity)
        };
        let keeps_acceleration = |acceleration: f64| {
            (limits.acceleration_min - tolerance.acceleration
                ..=limits.acceleration_max + tolerance.acceleration)
                .contains(&acceleration)
        };
        // A state is inside only if it can stay there: the jerk can take the acceleration away in time.
        let bound_for =
            start.velocity + start.acceleration * start.acceleration.abs() / (2.0 * limits.jerk_max);
        self.now |= keeps_velocity(start.velocity)
            && (!acceleration_matters || keeps_acceleration(start.acceleration))
            && keeps_velocity(bound_for);
        if !self.now {
            return Ok(());
        }
        let end = polynomial(start, jerk, duration_s);
        let turn_s = -start.acceleration / jerk;
        let turn = if turn_s > 0.0 && turn_s < duration_s { turn_s } else { 0.0 };
        for velocity in [start.velocity, polynomial(start, jerk, turn).velocity, end.velocity] {
            check(keeps_velocity(velocity), || format!("velocity {velocity} in {start:?}"))?;
        }
        for acceleration in [start.acceleration, end.acceleration] {
            check(keeps_acceleration(acceleration), || format!("acceleration {acceleration} in {start:?}"))?;
        }
        Ok(())
    }
}
