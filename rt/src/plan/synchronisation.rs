//! Several axes, one duration (`otg.md` section 2, 4).

use super::error::PlanError;
use super::problem::{Limits, Problem, SIZE_MAX, State};
use super::profile::{BLOCKED_MAX, Profile};
use super::straight::Line;
use super::{jerk_limited, trapezoid, travel};

/// What the axes have in common.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Synchronisation {
    /// All axes arrive at the same time, as soon as the slowest can.
    #[default]
    Time,
    /// As [`Time`](Self::Time), and on a straight line where that takes no longer.
    Phase,
    /// On a straight line, be it slower; an error where start and target are not on one.
    Straight,
    /// Every axis takes its own shortest time, and goes on with its target velocity until all have arrived.
    Independent,
}

/// How a velocity beyond its limit, as after a limit was lowered in motion, comes back to it.
///
/// Second-order planning makes no difference: its deceleration can end in an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Return {
    /// As fast as possible. At the limit the deceleration is still large, so the velocity goes on below it
    /// before the motion to the target can take over, even to a reversal.
    #[default]
    Fastest,
    /// Such that the velocity ends at the limit without deceleration, and never went below.
    Settled,
}

/// When a motion shall end, and how it gets there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlanOptions {
    /// What the axes have in common.
    pub synchronisation: Synchronisation,
    /// The motion takes at least this long, in s. 0 for as fast as possible.
    pub minimum_duration_s: f64,
    /// The duration is a multiple of this cycle, in s.
    pub cycle_s: Option<f64>,
    /// How a velocity beyond its limit comes back to it.
    pub return_to_limits: Return,
}

impl PlanOptions {
    fn validate(&self) -> Result<(), PlanError> {
        let least_valid = self.minimum_duration_s >= 0.0 && self.minimum_duration_s < SIZE_MAX;
        let cycle_valid = self.cycle_s.is_none_or(|cycle_s| cycle_s > 1.0 / SIZE_MAX && cycle_s < SIZE_MAX);
        if least_valid && cycle_valid { Ok(()) } else { Err(PlanError::InvalidTiming) }
    }
}

/// What is controlled: where an axis arrives, or only how fast it then is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Interface {
    Position(Return),
    Velocity,
}

/// Plans the motion of all axes to their targets and gives its duration in s.
///
/// Profile by profile: from the start state, back into the limits if it is outside of them, to exactly the
/// target state, within the limits at every instant. A problem with an infinite jerk limit is planned in
/// second order.
///
/// The work is bounded: each axis is solved at most twice, and the search for a duration that no axis blocks
/// looks at each blocked interval at most once more than there are intervals.
///
/// # Errors
/// The first thing that is wrong with a problem, with the index of its axis; the profiles are then of no use,
/// except after [`PlanError::PositionBeyondLimit`], where they hold a coordinated [`stop`].
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

/// The first position limit that is left.
fn first_left(problems: &[Problem], profiles: &[Profile]) -> Option<PlanError> {
    let mut axes = problems.iter().zip(profiles).enumerate();
    axes.find_map(|(axis, (problem, profile))| {
        travel::limit_left(problem, profile).map(|limit| PlanError::PositionBeyondLimit { axis, limit })
    })
}

/// Replaces the motions that leave a position limit. Where that takes longer, all axes are planned once more for the
/// longer time.
fn keep_travel(
    problems: &[Problem],
    profiles: &mut [Profile],
    timing: PlanOptions,
    duration_s: f64,
) -> Result<f64, PlanError> {
    let manner = timing.return_to_limits;
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
            travel::motion_within(problem, manner, least_s, profile).map_err(on_axis)?;
            let own_s = on_grid(profile.duration_s(), timing.cycle_s);
            if own_s > profile.duration_s() {
                travel::motion_within(problem, manner, own_s, profile).map_err(on_axis)?;
            }
            longest_s = longest_s.max(profile.duration_s());
        }
        if own_time || longest_s == duration_s {
            return first_left(problems, profiles).map_or(Ok(longest_s), Err);
        }
        let timing =
            PlanOptions { minimum_duration_s: longest_s, synchronisation: Synchronisation::Time, ..timing };
        duration_s = plan(Interface::Position(manner), problems, profiles, timing)?;
        if first_left(problems, profiles).is_none() {
            return Ok(duration_s);
        }
    }
    Err(first_left(problems, profiles).unwrap_or(PlanError::InvalidTiming))
}

/// Plans the motion of all axes to their target velocities, wherever that leads, and gives its duration in s.
///
/// The target positions are not read. Limits of position and velocity are not looked at: leaving them may be the only way to
/// reach the velocity; see [`Profile::extrema`].
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

/// Plans the fastest coordinated stop: every axis comes to rest, all at the same time. Gives the duration in s.
///
/// An axis that would leave its position limits that way stops by itself and waits for the others: as fast as it can or,
/// where that leads beyond a limit, by decelerating further, so that it turns around just there and swings back. From
/// a start within the limits of acceleration,
///
/// - the position limit it runs towards is kept whenever any motion within the limits of acceleration and jerk keeps it; where none does,
///   the way beyond it is the shortest;
/// - the velocity limits are kept, too, whenever any such motion keeps them together with that position limit; where
///   none does, the position comes first and the swing back is as slow as it can be.
///
/// Where both position limits are nearer to each other than such a swing is wide, it may leave the other one. What the
/// motion does keep in the end is in [`Profile::extrema`].
///
/// # Errors
/// As [`synchronised`].
pub fn stop(starts: &[State], limits: &[Limits], profiles: &mut [Profile]) -> Result<f64, PlanError> {
    expect_length(starts.len(), limits.len())?;
    expect_length(starts.len(), profiles.len())?;
    halt(starts.iter().copied().zip(limits.iter().copied()), profiles)
}

/// Plans one axis to its target in the shortest time.
///
/// # Errors
/// As [`synchronised`], with axis 0.
pub fn position(problem: &Problem) -> Result<Profile, PlanError> {
    let mut profile = [Profile::hold(0.0)];
    synchronised(&[*problem], &mut profile, PlanOptions::default())?;
    let [profile] = profile;
    Ok(profile)
}

/// Plans one axis to its target velocity in the shortest time.
///
/// # Errors
/// As [`synchronised`], with axis 0.
pub fn velocity(problem: &Problem) -> Result<Profile, PlanError> {
    let mut profile = Profile::hold(0.0);
    fastest(Interface::Velocity, problem, 0.0, &mut profile)?;
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
        let fastest_s = fastest(Interface::Velocity, &problem, duration_s, profile)
            .map_err(|error| error.on_axis(axis))?;
        duration_s = duration_s.max(fastest_s);
    }
    let duration_s = unblocked(duration_s, profiles, None);
    let mut longest_s = duration_s;
    for (axis, (problem, profile)) in problems.clone().zip(profiles.iter_mut()).enumerate() {
        let on_axis = |error: PlanError| error.on_axis(axis);
        lasting(Interface::Velocity, &problem, duration_s, profile).map_err(on_axis)?;
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
    for (axis, (problem, profile)) in problems.iter().zip(profiles.iter_mut()).enumerate() {
        // An axis that will be made to last longer needs no phases yet.
        let least_s = if timing.synchronisation == Synchronisation::Independent { 0.0 } else { longest_s };
        let fastest_s = fastest(interface, problem, least_s, profile).map_err(|error| error.on_axis(axis))?;
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
        lasting(interface, problem, own_s, profile).map_err(|error| error.on_axis(axis))?;
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

/// Puts the axes on a straight line if the one with the longest way is on a profile that all can follow.
fn follow_line(problems: &[Problem], profiles: &mut [Profile]) {
    if let Ok(line) = Line::of(problems)
        && let Some(reference) = profiles.get(line.reference()).copied()
        && line.keeps_limits(&reference, problems)
    {
        line.follow(&reference, problems, profiles);
    }
}

/// Plans the motion on a straight line, within the limits of all axes projected on it.
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
    let fastest_s = fastest(interface, &projected, 0.0, &mut profile).map_err(on_line)?;
    let least_s = fastest_s.max(timing.minimum_duration_s);
    let duration_s = unblocked(least_s, core::slice::from_ref(&profile), timing.cycle_s);
    lasting(interface, &projected, duration_s, &mut profile).map_err(on_line)?;
    line.follow(&profile, problems, profiles);
    Ok(duration_s)
}

fn expect_length(expected: usize, received: usize) -> Result<(), PlanError> {
    if expected == received { Ok(()) } else { Err(PlanError::LengthMismatch { expected, received }) }
}

/// The fastest profile of one axis, and its duration in s. Its phases are left out where it lasts less than `least_s`.
fn fastest(
    interface: Interface,
    problem: &Problem,
    least_s: f64,
    profile: &mut Profile,
) -> Result<f64, PlanError> {
    problem.validate()?;
    if interface != Interface::Velocity {
        problem.validate_approach()?;
    }
    match (interface, problem.limits.is_second_order()) {
        (Interface::Position(_), true) => trapezoid::fastest_position(problem, least_s, profile),
        (Interface::Velocity, true) => trapezoid::fastest_velocity(problem, profile),
        (Interface::Position(manner), false) => {
            jerk_limited::fastest_position(problem, manner, least_s, profile)
        }
        (Interface::Velocity, false) => jerk_limited::fastest_velocity(problem, least_s, profile),
    }?;
    Ok(profile.minimum_duration_s())
}

/// The profile of one axis that lasts this long; it holds the fastest one before, unless that is shorter.
fn lasting(
    interface: Interface,
    problem: &Problem,
    duration_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    if profile.duration_s() == duration_s {
        return Ok(());
    }
    match (interface, problem.limits.is_second_order()) {
        (Interface::Position(_), true) => trapezoid::position_lasting(problem, duration_s, profile),
        (Interface::Velocity, true) => trapezoid::velocity_lasting(problem, duration_s, profile),
        (Interface::Position(manner), false) => {
            jerk_limited::position_lasting(problem, manner, duration_s, profile)
        }
        (Interface::Velocity, false) => jerk_limited::velocity_lasting(problem, duration_s, profile),
    }
}

/// Relative to a duration, being above a multiple of the cycle by this much is rounding.
const GRID_ROUNDING: f64 = 1e-11;

/// How often a longer time for one axis may ask for a longer time for another.
const ROUNDS_MAX: u32 = 3;

/// Relative to a duration, a difference up to this is rounding.
const ROUNDING: f64 = 1024.0 * f64::EPSILON;

/// The shortest duration from this one on that no axis blocks.
///
/// Every step jumps over at least one blocked interval and none comes back, so there are at most as many steps
/// as intervals.
fn unblocked(least_s: f64, profiles: &[Profile], cycle_s: Option<f64>) -> f64 {
    // Durations that differ by rounding are the same: two axes with the same motion must not block each other.
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

/// The first multiple of the cycle that is not less, apart from rounding.
fn on_grid(duration_s: f64, cycle_s: Option<f64>) -> f64 {
    match cycle_s {
        Some(cycle_s) => libm::ceil(duration_s / cycle_s * (1.0 - GRID_ROUNDING)) * cycle_s,
        None => duration_s,
    }
}
