//! Several axes with one duration (the paper's "time synchronisation").
//!
//! 1. Each axis finds its fastest profile and its blocked durations.
//! 2. The common duration is the shortest one that is long enough for every axis and that no axis blocks.
//! 3. Each axis finds the profile of exactly that duration.
//! 4. Where a profile leaves a position limit, `travel` replaces it.

use super::error::PlanError;
use super::jerk_limited::Inside;
use super::options::{PlanOptions, Return, Synchronisation};
use super::problem::{Limits, Problem, State};
use super::profile::{BLOCKED_MAX, Profile};
use super::straight::Line;
use super::{jerk_limited, trapezoid, travel};

/// What the target of an axis is: a position with the velocity and acceleration there, or a velocity alone.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Interface {
    Position(Return),
    Velocity,
}

/// Plans the motion of all axes to their targets and returns its duration in s.
///
/// Each profile goes from the start state to exactly the target state, within the limits at every instant. A start outside the
/// limits is first brought back into them. A problem with an infinite jerk limit is planned in second order.
///
/// The method is that of L. Berscheid and T. Kröger (RSS 2021). The work is bounded: see the [module](super).
///
/// # Errors
/// The first thing that is wrong with a problem, with the index of its axis. Do not use the profiles then, except after
/// [`PlanError::PositionBeyondLimit`]: there they hold a coordinated [`stop`].
pub fn synchronised(
    problems: &[Problem],
    profiles: &mut [Profile],
    timing: PlanOptions,
) -> Result<f64, PlanError> {
    let duration_s = plan(Interface::Position(timing.return_to_limits), problems, profiles, timing)?;
    let refuse = |error: PlanError, profiles: &mut [Profile]| {
        halt(problems.iter().map(|problem| (problem.start, problem.limits)), profiles)?;
        Err(error)
    };
    match first_left(problems, profiles) {
        None => Ok(duration_s),
        Some(error) if timing.synchronisation == Synchronisation::Straight => refuse(error, profiles),
        Some(_) => match keep_travel(problems, profiles, timing, duration_s) {
            Ok(duration_s) => Ok(duration_s),
            Err(error) => refuse(error, profiles),
        },
    }
}

/// The first axis that leaves a position limit.
fn first_left(problems: &[Problem], profiles: &[Profile]) -> Option<PlanError> {
    let mut axes = problems.iter().zip(profiles).enumerate();
    axes.find_map(|(axis, (problem, profile))| {
        travel::limit_left(problem, profile).map(|limit| PlanError::PositionBeyondLimit { axis, limit })
    })
}

/// Replaces the motions that leave a position limit. If a new one takes longer, all axes are planned again for the longer
/// time.
fn keep_travel(
    problems: &[Problem],
    profiles: &mut [Profile],
    timing: PlanOptions,
    duration_s: f64,
) -> Result<f64, PlanError> {
    let return_to_limits = timing.return_to_limits;
    let own_time = timing.synchronisation == Synchronisation::Independent;
    let mut duration_s = duration_s;
    for _ in 0..ROUNDS_MAX {
        let mut longest_s = duration_s;
        for (axis, (problem, profile)) in problems.iter().zip(profiles.iter_mut()).enumerate() {
            if travel::limit_left(problem, profile).is_none() {
                continue;
            }
            let on_axis = |error: PlanError| error.on_axis(axis);
            let least_s = if own_time { profile.duration_s() } else { duration_s };
            travel::motion_within(problem, return_to_limits, least_s, profile).map_err(on_axis)?;
            let own_s = on_grid(profile.duration_s(), timing.cycle_s);
            if own_s > profile.duration_s() {
                travel::motion_within(problem, return_to_limits, own_s, profile).map_err(on_axis)?;
            }
            longest_s = longest_s.max(profile.duration_s());
        }
        if own_time || longest_s == duration_s {
            return first_left(problems, profiles).map_or(Ok(longest_s), Err);
        }
        let timing =
            PlanOptions { minimum_duration_s: longest_s, synchronisation: Synchronisation::Time, ..timing };
        duration_s = plan(Interface::Position(return_to_limits), problems, profiles, timing)?;
        if first_left(problems, profiles).is_none() {
            return Ok(duration_s);
        }
    }
    Err(first_left(problems, profiles).unwrap_or(PlanError::InvalidTiming))
}

/// Plans the motion of all axes to their target velocities and returns its duration in s.
///
/// The target positions are not read. The limits of position and velocity are not checked, because a motion may have to leave
/// them to reach the velocity. [`Profile::extrema`] says what the motion keeps.
///
/// # Errors
/// As [`synchronised`].
pub fn synchronised_velocity(
    problems: &[Problem],
    profiles: &mut [Profile],
    timing: PlanOptions,
) -> Result<f64, PlanError> {
    plan(Interface::Velocity, problems, profiles, timing)
}

/// Plans the fastest coordinated stop: all axes come to rest at the same time. Returns the duration in s.
///
/// An axis that would leave a position limit in the coordinated stop does not take part in it. It stops as fast as it can
/// and waits for the others. If the fastest stop leaves the limit too, the axis goes on decelerating at the standstill: it
/// reverses its direction at the limit and comes to rest on the near side of it.
///
/// If the acceleration at the start is within its limits, then:
///
/// - The axis keeps the position limit that it moves towards whenever any motion within the limits of acceleration and jerk
///   keeps it. Where none does, the axis goes as little beyond the limit as possible.
/// - The axis keeps its velocity limits too, whenever any such motion keeps both. Where none does, the position limit comes
///   first, and the axis moves back as slowly as possible.
///
/// Where the two position limits are close together, the motion back may leave the other limit.
/// [`Profile::extrema`] says what the motion keeps.
///
/// # Errors
/// As [`synchronised`].
pub fn stop(starts: &[State], limits: &[Limits], profiles: &mut [Profile]) -> Result<f64, PlanError> {
    expect_length(starts.len(), limits.len())?;
    expect_length(starts.len(), profiles.len())?;
    halt(starts.iter().copied().zip(limits.iter().copied()), profiles)
}

/// Plans the motion of one axis to its target in the shortest time.
///
/// # Errors
/// As [`synchronised`], with axis 0.
pub fn position(problem: &Problem) -> Result<Profile, PlanError> {
    let mut profile = [Profile::hold(0.0)];
    synchronised(&[*problem], &mut profile, PlanOptions::default())?;
    let [profile] = profile;
    Ok(profile)
}

/// Plans the motion of one axis to its target velocity in the shortest time.
///
/// # Errors
/// As [`synchronised`], with axis 0.
pub fn velocity(problem: &Problem) -> Result<Profile, PlanError> {
    let mut profile = Profile::hold(0.0);
    fastest(Interface::Velocity, problem, 0.0, &mut None, &mut profile)?;
    Ok(profile)
}

/// The coordinated stop from these states.
fn halt(
    axes: impl Iterator<Item = (State, Limits)> + Clone,
    profiles: &mut [Profile],
) -> Result<f64, PlanError> {
    let target = State::rest(0.0);
    let problems = axes.map(|(start, limits)| Problem { start, target, limits });
    let mut duration_s: f64 = 0.0;
    for (axis, (problem, profile)) in problems.clone().zip(profiles.iter_mut()).enumerate() {
        let fastest_s = fastest(Interface::Velocity, &problem, duration_s, &mut None, profile)
            .map_err(|error| error.on_axis(axis))?;
        duration_s = duration_s.max(fastest_s);
    }
    let duration_s = unblocked(duration_s, profiles, None);
    let mut longest_s = duration_s;
    for (axis, (problem, profile)) in problems.clone().zip(profiles.iter_mut()).enumerate() {
        let on_axis = |error: PlanError| error.on_axis(axis);
        lasting(Interface::Velocity, &problem, duration_s, &mut None, profile).map_err(on_axis)?;
        if travel::limit_left(&problem, profile).is_some() {
            travel::stop_within(problem.start, &problem.limits, profile).map_err(on_axis)?;
            longest_s = longest_s.max(profile.duration_s());
        }
    }
    for profile in profiles.iter_mut() {
        profile.rest_until(longest_s);
    }
    Ok(longest_s)
}

fn plan(
    interface: Interface,
    problems: &[Problem],
    profiles: &mut [Profile],
    timing: PlanOptions,
) -> Result<f64, PlanError> {
    expect_length(problems.len(), profiles.len())?;
    timing.validate()?;
    let mut longest_s = timing.minimum_duration_s;
    // Not a constant, all of whose bytes would be written.
    let mut kept: [Option<Inside>; KEPT_MAX] = core::array::from_fn(|_| None);
    for (axis, (problem, profile)) in problems.iter().zip(profiles.iter_mut()).enumerate() {
        // An axis that must last longer than this needs no phases yet.
        let least_s = if timing.synchronisation == Synchronisation::Independent { 0.0 } else { longest_s };
        let mut spare = None;
        let kept = kept.get_mut(axis).unwrap_or(&mut spare);
        let fastest_s =
            fastest(interface, problem, least_s, kept, profile).map_err(|error| error.on_axis(axis))?;
        longest_s = longest_s.max(fastest_s);
    }
    let common_s = match timing.synchronisation {
        Synchronisation::Time | Synchronisation::Phase | Synchronisation::Straight => {
            Some(unblocked(longest_s, profiles, timing.cycle_s))
        }
        Synchronisation::Independent => None,
    };
    let mut duration_s = on_grid(timing.minimum_duration_s, timing.cycle_s);
    for (axis, (problem, profile)) in problems.iter().zip(profiles.iter_mut()).enumerate() {
        let own_s = common_s.unwrap_or_else(|| {
            unblocked(profile.duration_s(), core::slice::from_ref(profile), timing.cycle_s)
        });
        let mut spare = None;
        let kept = kept.get_mut(axis).unwrap_or(&mut spare);
        lasting(interface, problem, own_s, kept, profile).map_err(|error| error.on_axis(axis))?;
        duration_s = duration_s.max(own_s);
    }
    match (timing.synchronisation, interface) {
        (Synchronisation::Phase, Interface::Position(_)) => follow_line(problems, profiles),
        (Synchronisation::Straight, Interface::Position(_)) => {
            duration_s = straight(interface, problems, profiles, &timing)?;
        }
        _ => {}
    }
    Ok(duration_s)
}

/// Puts the axes on a straight line if all of them can follow the profile of the axis with the longest distance.
fn follow_line(problems: &[Problem], profiles: &mut [Profile]) {
    if let Ok(line) = Line::of(problems)
        && let Some(reference) = profiles.get(line.reference()).copied()
        && line.keeps_limits(&reference, problems)
    {
        line.follow(&reference, problems, profiles);
    }
}

/// Plans the motion on a straight line, within the limits of all axes projected on that line.
fn straight(
    interface: Interface,
    problems: &[Problem],
    profiles: &mut [Profile],
    timing: &PlanOptions,
) -> Result<f64, PlanError> {
    let line = Line::of(problems)?;
    let projected = line.projected(problems);
    let on_line = |error: PlanError| error.on_axis(line.reference());
    let mut profile = Profile::hold(0.0);
    let mut kept = None;
    let fastest_s = fastest(interface, &projected, 0.0, &mut kept, &mut profile).map_err(on_line)?;
    let least_s = fastest_s.max(timing.minimum_duration_s);
    let duration_s = unblocked(least_s, core::slice::from_ref(&profile), timing.cycle_s);
    lasting(interface, &projected, duration_s, &mut kept, &mut profile).map_err(on_line)?;
    line.follow(&profile, problems, profiles);
    Ok(duration_s)
}

fn expect_length(expected: usize, received: usize) -> Result<(), PlanError> {
    if expected == received { Ok(()) } else { Err(PlanError::LengthMismatch { expected, received }) }
}

/// Plans the fastest profile of one axis and returns its duration in s. A profile shorter than `least_s` gets no phases. `kept`
/// receives what [`lasting`] needs again.
fn fastest(
    interface: Interface,
    problem: &Problem,
    least_s: f64,
    kept: &mut Option<Inside>,
    profile: &mut Profile,
) -> Result<f64, PlanError> {
    problem.validate()?;
    if interface != Interface::Velocity {
        problem.validate_approach()?;
    }
    match (interface, problem.limits.is_second_order()) {
        (Interface::Position(_), true) => trapezoid::fastest_position(problem, least_s, profile),
        (Interface::Velocity, true) => trapezoid::fastest_velocity(problem, profile),
        (Interface::Position(return_to_limits), false) => {
            jerk_limited::fastest_position(problem, return_to_limits, least_s, kept, profile)
        }
        (Interface::Velocity, false) => jerk_limited::fastest_velocity(problem, least_s, profile),
    }?;
    Ok(profile.minimum_duration_s())
}

/// Plans the profile of one axis that lasts this long. `profile` must hold what [`fastest`] has made of it, and `kept`
/// what it has kept, or nothing.
fn lasting(
    interface: Interface,
    problem: &Problem,
    duration_s: f64,
    kept: &mut Option<Inside>,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    if profile.duration_s() == duration_s {
        return Ok(());
    }
    match (interface, problem.limits.is_second_order()) {
        (Interface::Position(_), true) => trapezoid::position_lasting(problem, duration_s, profile),
        (Interface::Velocity, true) => trapezoid::velocity_lasting(problem, duration_s, profile),
        (Interface::Position(return_to_limits), false) => {
            jerk_limited::position_lasting(problem, return_to_limits, duration_s, kept, profile)
        }
        (Interface::Velocity, false) => jerk_limited::velocity_lasting(problem, duration_s, profile),
    }
}

/// Number of axes of a plan that keep the problem behind the brake for the profile of the common duration. Further axes
/// compute it twice.
const KEPT_MAX: usize = 8;

/// A duration above a multiple of the cycle by this much, relative to it, counts as that multiple: the rest is rounding.
const GRID_ROUNDING: f64 = 1e-11;

/// How often a longer time for one axis may require a longer time for another axis.
const ROUNDS_MAX: u32 = 3;

/// A difference of two durations up to this, relative to them, is rounding.
const ROUNDING: f64 = 1024.0 * f64::EPSILON;

/// The shortest duration that is not below `least_s` and that no axis blocks.
///
/// Every step passes at least one blocked interval for good. So there are at most as many steps as intervals.
fn unblocked(least_s: f64, profiles: &[Profile], cycle_s: Option<f64>) -> f64 {
    // Durations that differ by rounding are equal. Two axes with the same motion must not block each other.
    let rounding = if cycle_s.is_some() { GRID_ROUNDING } else { ROUNDING };
    let mut duration_s = on_grid(least_s, cycle_s);
    for _ in 0..=profiles.len().saturating_mul(BLOCKED_MAX) {
        let blocking = profiles.iter().flat_map(Profile::blocked).find(|blocked| {
            let rounding_s = rounding * duration_s;
            duration_s > blocked.after_s + rounding_s && duration_s < blocked.before_s - 2.0 * rounding_s
        });
        match blocking {
            Some(blocked) => duration_s = on_grid(blocked.before_s, cycle_s),
            None => break,
        }
    }
    duration_s
}

/// The smallest multiple of the cycle that is not below this duration, apart from rounding.
fn on_grid(duration_s: f64, cycle_s: Option<f64>) -> f64 {
    match cycle_s {
        Some(cycle_s) => libm::ceil(duration_s / cycle_s * (1.0 - GRID_ROUNDING)) * cycle_s,
        None => duration_s,
    }
}
