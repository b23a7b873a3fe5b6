//! All problems whose numbers are small integers. There, one type of profile often meets another.

use super::checker::{Arrival, judge};
use takt_rt::plan::{Limits, Problem, State, position, velocity};

fn integers(range: core::ops::RangeInclusive<i32>) -> Vec<f64> {
    range.map(f64::from).collect()
}

/// Every velocity and acceleration with a magnitude of at most `largest`.
fn rates(largest: i32) -> Vec<(f64, f64)> {
    let values = integers(-largest..=largest);
    values.iter().flat_map(|velocity| values.iter().map(|acceleration| (*velocity, *acceleration))).collect()
}

/// Every set of limits from 1 to `largest`, the same in both directions.
fn limits(largest: i32) -> Vec<Limits> {
    let sizes = integers(1..=largest);
    let mut all = Vec::new();
    for velocity in &sizes {
        for acceleration in &sizes {
            all.extend(sizes.iter().map(|jerk| Limits::symmetric(*velocity, *acceleration, *jerk)));
        }
    }
    all
}

/// Returns `true` if the target keeps the limits, and can be reached within them.
fn is_target(limits: &Limits, (velocity, acceleration): (f64, f64)) -> bool {
    let before = velocity - acceleration * acceleration.abs() / (2.0 * limits.jerk_max);
    velocity.abs() <= limits.velocity_max
        && acceleration.abs() <= limits.acceleration_max
        && before.abs() <= limits.velocity_max
}

fn state(position: f64, (velocity, acceleration): (f64, f64)) -> State {
    State { position, velocity, acceleration }
}

/// Solves all problems with rates up to `rate`, limits up to `limit`, and these distances. Returns how many there were, and how
/// many started within the limits.
fn solve(rate: i32, limit: i32, distances: &[f64]) -> (u32, u32) {
    let (mut solved, mut inside) = (0, 0);
    for limits in limits(limit) {
        for target in rates(rate) {
            for start in rates(rate) {
                // Backwards in time, the start is a target.
                let starts_inside = is_target(&limits, (start.0, -start.1));
                for distance in distances {
                    let problem =
                        Problem { start: state(0.0, start), target: state(*distance, target), limits };
                    let answer = position(&problem);
                    assert_eq!(answer.is_ok(), is_target(&limits, target), "{problem:?}");
                    let Ok(profile) = answer else { continue };
                    assert_eq!(judge(&problem, &profile, Arrival::State), Ok(()), "{problem:?}");
                    solved += 1;
                    inside += u32::from(starts_inside);
                }
            }
        }
    }
    (solved, inside)
}

/// Start and target positions from −2 to 2 are 25 pairs with nine distances. Pairs with the same distance are the same
/// problem.
#[test]
fn every_problem_of_small_integers_is_solved() {
    let (solved, inside) = solve(2, 3, &integers(-4..=4));
    assert_eq!((solved, inside), (97_875, 72_171));
}

/// Half integers and longer distances: distances from −10 to 10 in steps of a half, velocities and accelerations from −2
/// to 2, limits from 1 to 3.
#[test]
fn every_problem_of_small_integers_over_half_an_integer_is_solved() {
    let halves: Vec<f64> = integers(-20..=20).into_iter().map(|step| step / 2.0).collect();
    assert_eq!(solve(2, 3, &halves), (445_875, 328_779));
}

/// A wider range of everything: rates from −3 to 3, limits from 1 to 4, distances from −12 to 12.
#[test]
fn every_problem_of_integers_up_to_a_dozen_is_solved() {
    assert_eq!(solve(3, 4, &integers(-12..=12)), (1_930_600, 1_213_400));
}

#[test]
fn every_velocity_of_small_integers_is_reached() {
    for limits in limits(3) {
        for (start, target) in
            rates(2).into_iter().flat_map(|start| rates(2).into_iter().map(move |target| (start, target)))
        {
            let problem = Problem { start: state(0.0, start), target: state(0.0, target), limits };
            let Ok(profile) = velocity(&problem) else {
                assert!(target.0.abs() > limits.velocity_max || target.1.abs() > limits.acceleration_max);
                continue;
            };
            assert_eq!(judge(&problem, &profile, Arrival::Velocity), Ok(()), "{problem:?}");
        }
    }
}
