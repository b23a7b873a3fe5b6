//! Many random problems, checked without the oracle.
//!
//! `TAKT_PLAN_PROBLEMS=1000000 cargo test --release -p takt-rt --test plan many` solves that many.

use super::checker::{Arrival, judge};
use super::families::{AXES, FAMILIES, Family};
use super::random::Random;
use takt_rt::plan::{PlanOptions, Problem, Profile, Synchronisation, synchronised, synchronised_velocity};

/// How many problems are solved by default.
const PROBLEMS: u64 = 100_000;

fn timing(random: &mut Random) -> PlanOptions {
    let modes =
        [Synchronisation::Time, Synchronisation::Time, Synchronisation::Phase, Synchronisation::Independent];
    let choice = random.uniform(0.0, 1.0);
    PlanOptions {
        synchronisation: modes[(random.next() % 4) as usize],
        cycle_s: (choice < 0.1).then_some(0.001),
        minimum_duration_s: if (0.1..0.2).contains(&choice) { random.uniform(1.0, 10.0) } else { 0.0 },
        ..PlanOptions::default()
    }
}

/// Plans, checks the result, and says what is wrong.
fn solve(family: Family, problems: &[Problem], timing: PlanOptions) -> Result<(), String> {
    let mut profiles = vec![Profile::hold(0.0); problems.len()];
    let arrival = family.arrival();
    let planner = if arrival == Arrival::State { synchronised } else { synchronised_velocity };
    let duration_s = planner(problems, &mut profiles, timing).map_err(|error| format!("{error:?}"))?;
    for (problem, profile) in problems.iter().zip(&profiles) {
        judge(problem, profile, arrival)?;
        let together = timing.synchronisation != Synchronisation::Independent;
        if together && profile.duration_s() != duration_s {
            return Err(format!("{} s in place of {duration_s} s", profile.duration_s()));
        }
        if let Some(cycle_s) = timing.cycle_s {
            let cycles = profile.duration_s() / cycle_s;
            if (cycles - cycles.round()).abs() > 1e-6 {
                return Err(format!("{cycles} cycles"));
            }
        }
    }
    Ok(())
}

#[test]
fn every_random_problem_is_solved() {
    let asked = std::env::var("TAKT_PLAN_PROBLEMS").ok().and_then(|count| count.parse().ok());
    let count: u64 = asked.unwrap_or(PROBLEMS);
    let mut failures = Vec::new();
    for number in 0..count {
        let mut random = Random(number);
        let family = FAMILIES[(number % 12) as usize];
        let axes = AXES[(number / 12 % 4) as usize];
        let problems: Vec<Problem> = (0..axes).map(|_| family.problem(&mut random)).collect();
        if let Err(why) = solve(family, &problems, timing(&mut random)) {
            failures.push(format!("{number} {family:?}: {why}"));
        }
    }
    assert!(failures.is_empty(), "{} of {count}: {failures:#?}", failures.len());
}
