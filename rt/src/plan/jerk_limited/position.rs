//! Plans to a position, with the velocity and the acceleration there.

use super::super::choice::larger;
use super::super::error::PlanError;
use super::super::options::Return;
use super::super::problem::{Problem, State};
use super::super::profile::Profile;
use super::motion::{Scale, SevenPhases};
use super::step1::{Candidate, Candidates, Edges};
use super::step2::Slower;
use super::{ROUNDING, brake};

/// A duration this close to a blocked interval, relative to the duration, is at its edge.
const EDGE: f64 = 3e-11;

/// The problem behind the brake, without units. Both steps need it, and it is a third of the work of each.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Inside {
    edges: Edges,
    scale: Scale,
    brake_s: f64,
    reached: State,
    brake_phases: usize,
}

impl Inside {
    /// Begins the profile with the brake, and poses the problem behind it.
    fn of(problem: &Problem, return_to_limits: Return, profile: &mut Profile) -> Self {
        let Problem { start, target, limits } = problem;
        let reached = match return_to_limits {
            Return::Fastest => brake::brake(start, limits, profile),
            Return::Settled => brake::settle(start, limits, profile),
        };
        let scale = Scale::of(limits);
        let distance = target.position - reached.position;
        let mut inside = Self {
            edges: Edges::of(&scale.motion(&reached, distance, target, limits)),
            scale,
            brake_s: profile.duration_s(),
            reached,
            brake_phases: profile.phase_count(),
        };
        // A rounding error of the direct motion must not become a detour.
        let rounding = ROUNDING * (reached.position.abs() + target.position.abs()) / scale.distance;
        inside.edges.round(rounding);
        inside
    }

    fn is_representable(&self) -> bool {
        self.scale.distance > 0.0 && self.scale.distance.is_finite() && self.edges.motion.distance.is_finite()
    }

    /// Appends these phases to the profile, in the units of the problem.
    fn append(&self, phases: &SevenPhases, jerk_max: f64, profile: &mut Profile) {
        let durations_s = phases.durations.map(|duration| duration * self.scale.time_s);
        profile.shift_all(self.reached, &durations_s, &phases.jerks.map(|jerk| jerk * jerk_max));
    }
}

/// Plans the fastest profile to the target state, with its blocked intervals. A profile shorter than `least_s` gets no phases.
/// `kept` receives what [`position_lasting`] needs again.
///
/// # Errors
/// [`PlanError::NotRepresentable`] with axis 0.
pub(in super::super) fn fastest_position(
    problem: &Problem,
    return_to_limits: Return,
    least_s: f64,
    kept: &mut Option<Inside>,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let inside = kept.insert(Inside::of(problem, return_to_limits, profile));
    if !inside.is_representable() {
        return Err(PlanError::NotRepresentable { axis: 0 });
    }
    let mut candidates = Candidates::new();
    inside.edges.find(&mut candidates);
    let Some((fastest, others)) = candidates.split_first() else {
        return Err(PlanError::NotRepresentable { axis: 0 });
    };
    // A duration of zero must not become negative by rounding.
    let duration_s = |duration: f64| inside.brake_s + larger(duration, 0.0) * inside.scale.time_s;
    let fastest_s = duration_s(fastest.duration);
    profile.set_minimum_duration(fastest_s);
    if fastest_s < least_s {
        profile.leave_open(fastest_s)?;
    } else {
        inside.append(&inside.edges.phases(fastest), problem.limits.jerk_max, profile);
        profile.finish_at(problem.target, fastest_s)?;
    }
    for pair in others.chunks_exact(2) {
        if let [after, before] = pair {
            let rounding = ROUNDING * (1.0 + after.duration);
            profile.block(duration_s(after.duration + rounding), duration_s(before.duration));
        }
    }
    Ok(())
}

/// Plans the profile to the target state that lasts this long. `profile` must hold what [`fastest_position`] has made of it, and
/// `kept`, if there is something, what it has kept of this problem.
///
/// # Errors
/// [`PlanError::NotRepresentable`] with axis 0.
pub(in super::super) fn position_lasting(
    problem: &Problem,
    return_to_limits: Return,
    duration_s: f64,
    kept: &mut Option<Inside>,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let edge = profile.blocked().iter().any(|blocked| {
        let rounding_s = EDGE * duration_s;
        (blocked.before_s - duration_s).abs() <= rounding_s
            || (blocked.after_s - duration_s).abs() <= rounding_s
    });
    let inside = match kept {
        Some(inside) => {
            profile.return_to(inside.brake_phases, inside.brake_s, inside.reached);
            inside
        }
        None => kept.insert(Inside::of(problem, return_to_limits, profile)),
    };
    let duration = (duration_s - inside.brake_s) / inside.scale.time_s;
    let jerk_max = problem.limits.jerk_max;
    // At the edge of a blocked interval, the motion is the candidate there.
    let mut candidates = Candidates::new();
    if edge {
        inside.edges.find(&mut candidates);
    }
    let apart = |candidate: &Candidate| (candidate.duration - duration).abs();
    match candidates.iter().min_by(|one, other| apart(one).total_cmp(&apart(other))) {
        Some(candidate) => inside.append(&inside.edges.phases(candidate), jerk_max, profile),
        None => match inside.edges.lasting(duration) {
            Slower::Plain(phases) => inside.append(&phases, jerk_max, profile),
            Slower::Mixture { first, second, share } => {
                mix(inside, &first, &second, share, jerk_max, profile);
            }
        },
    }
    profile.finish_at(problem.target, duration_s)
}

/// Appends `share · first + (1 − share) · second`: at each time, the mixture of both jerks.
fn mix(
    inside: &Inside,
    first: &SevenPhases,
    second: &SevenPhases,
    share: f64,
    jerk_max: f64,
    profile: &mut Profile,
) {
    let mut both = [first, second]
        .map(|phases| phases.durations.iter().zip(&phases.jerks).filter(|(duration, _)| **duration > 0.0));
    let [first, second] = &mut both;
    let (mut one, mut other) = (first.next(), second.next());
    let (mut one_left, mut other_left) =
        (one.map_or(0.0, |(duration, _)| *duration), other.map_or(0.0, |(duration, _)| *duration));
    while let (Some((_, jerk)), Some((_, other_jerk))) = (one, other) {
        let duration = one_left.min(other_left);
        let mixed = share * jerk + (1.0 - share) * other_jerk;
        profile.shift(duration * inside.scale.time_s, mixed * jerk_max);
        one_left -= duration;
        other_left -= duration;
        if one_left <= 0.0 {
            one = first.next();
            one_left = one.map_or(0.0, |(duration, _)| *duration);
        }
        if other_left <= 0.0 {
            other = second.next();
            other_left = other.map_or(0.0, |(duration, _)| *duration);
        }
    }
}
