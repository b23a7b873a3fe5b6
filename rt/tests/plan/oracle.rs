//! Problems with the answers of Ruckig 0.19.4, from `otg_oracle.py`, without the samples.

use super::checker::{Arrival, judge};
use serde_json::Value;
use takt_rt::plan::{
    Limits, PlanOptions, Problem, Profile, State, Synchronisation, position, synchronised,
    synchronised_velocity, velocity,
};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::INFINITY)
}

fn problems(line: &Value) -> Vec<Problem> {
    let axes = line["dofs"].as_u64().unwrap() as usize;
    let state = |axis: usize, [position, velocity, acceleration]: [&str; 3]| State {
        position: number(&line[position][axis]),
        velocity: number(&line[velocity][axis]),
        acceleration: number(&line[acceleration][axis]),
    };
    (0..axes)
        .map(|axis| {
            let limit = |name: &str| number(&line[name][axis]);
            Problem {
                start: state(axis, ["p0", "v0", "a0"]),
                target: state(axis, ["pf", "vf", "af"]),
                limits: Limits::asymmetric(
                    limit("vmax"),
                    limit("vmin"),
                    limit("amax"),
                    limit("amin"),
                    limit("jmax"),
                ),
            }
        })
        .collect()
}

/// Returns `true` if the duration is that of the oracle, or shorter. For a shorter one, the checker has accepted the trajectory, and the
/// oracle has missed it. The oracle does so for equal start and target states, and at the ends of its brake.
fn agrees(own_s: f64, oracle_s: f64) -> bool {
    own_s <= oracle_s + 1e-6 * oracle_s + 1e-9
}

/// Says where the planner and the oracle disagree, or what is wrong with the trajectory.
fn compare(line: &Value) -> Result<(), String> {
    let problems = problems(line);
    let timing = PlanOptions {
        synchronisation: match line["sync"].as_str() {
            Some("none") => Synchronisation::Independent,
            Some("phase") => Synchronisation::Phase,
            _ => Synchronisation::Time,
        },
        minimum_duration_s: line["min_duration"].as_f64().unwrap_or(0.0),
        cycle_s: line["dt"].as_f64(),
        ..PlanOptions::default()
    };
    let mut profiles = vec![Profile::hold(0.0); problems.len()];
    let (answer, arrival) = match line["interface"].as_str() {
        Some("velocity") => (synchronised_velocity(&problems, &mut profiles, timing), Arrival::Velocity),
        _ => (synchronised(&problems, &mut profiles, timing), Arrival::State),
    };
    let duration_s = answer.map_err(|error| format!("{error:?}"))?;
    for (problem, profile) in problems.iter().zip(&profiles) {
        judge(problem, profile, arrival)?;
        let alone = if arrival == Arrival::State { position(problem) } else { velocity(problem) };
        judge(problem, &alone.map_err(|error| format!("{error:?}"))?, arrival)?;
    }
    if line["result"] != "ok" {
        return Ok(());
    }
    // The oracle counts a position as reached that is 1e-8 away. So it may not move where it should.
    let near = |problem: &Problem| (problem.target.position - problem.start.position).abs() < 1e-8;
    let fastest: Vec<f64> = profiles.iter().map(Profile::minimum_duration_s).collect();
    let oracle: Vec<f64> = line["t_min"].as_array().unwrap().iter().map(number).collect();
    for (problem, (own_s, oracle_s)) in problems.iter().zip(fastest.iter().zip(&oracle)) {
        let compared = arrival == Arrival::Velocity || !near(problem);
        if compared && !agrees(*own_s, *oracle_s) {
            return Err(format!("fastest {fastest:?}, oracle {oracle:?}"));
        }
    }
    let oracle_s = number(&line["duration"]);
    let compared = arrival == Arrival::Velocity || !problems.iter().any(near);
    if agrees(duration_s, oracle_s) || !compared {
        Ok(())
    } else {
        Err(format!("{duration_s} s, oracle {oracle_s} s"))
    }
}

fn compare_all(lines: &str) {
    let mut failures = Vec::new();
    for line in lines.lines() {
        let problem: Value = serde_json::from_str(line).unwrap();
        if let Err(why) = compare(&problem) {
            failures.push(format!("{} {} {}: {why}", problem["id"], problem["family"], problem["result"]));
        }
    }
    assert!(failures.is_empty(), "{} of {}: {:#?}", failures.len(), lines.lines().count(), failures);
}

#[test]
fn durations_are_those_of_ruckig_or_shorter_in_every_family() {
    compare_all(include_str!("oracle/all.jsonl"));
}

/// More problems, from a file that the generator has written: `TAKT_ORACLE=problems.jsonl cargo test oracle`.
#[test]
fn the_answers_in_a_file_of_one_s_own_are_those_of_ruckig() {
    if let Some(path) = std::env::var_os("TAKT_ORACLE") {
        compare_all(&std::fs::read_to_string(path).unwrap());
    }
}

/// Fresh problems from the generator itself, which needs Python and the package `ruckig`:
/// `TAKT_ORACLE_GENERATOR="python3 otg_oracle.py" TAKT_ORACLE_SEED=7 TAKT_ORACLE_PROBLEMS=10000 cargo test oracle`.
#[test]
fn fresh_answers_of_the_generator_are_those_of_ruckig() {
    let Ok(generator) = std::env::var("TAKT_ORACLE_GENERATOR") else { return };
    let or = |name: &str, otherwise: &str| std::env::var(name).unwrap_or_else(|_| otherwise.into());
    let mut words = generator.split_whitespace();
    let output = std::process::Command::new(words.next().unwrap())
        .args(words)
        .args([or("TAKT_ORACLE_SEED", "1"), or("TAKT_ORACLE_PROBLEMS", "1200")])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).unwrap();
    assert!(!lines.is_empty());
    compare_all(&lines);
}
