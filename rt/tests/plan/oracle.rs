//! Problems with the answers of Ruckig 0.19.4, from `otg_oracle.py`, without the samples.

use super::checker::{Arrival, judge};
use serde_json::Value;
use takt_rt::plan::{
    Limits, Problem, Profile, State, Synchronisation, Timing, synchronised, synchronised_velocity,
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

fn agrees(own_s: f64, oracle_s: f64) -> bool {
    (own_s - oracle_s).abs() <= 1e-6 * oracle_s + 1e-9
}

/// Says where the planner and the oracle disagree, or what is wrong with the trajectory.
fn compare(line: &Value) -> Result<(), String> {
    let problems = problems(line);
    let timing = Timing {
        synchronisation: match line["sync"].as_str() {
            Some("none") => Synchronisation::Independent,
            _ => Synchronisation::Time,
        },
        minimum_duration_s: line["min_duration"].as_f64().unwrap_or(0.0),
        cycle_s: line["dt"].as_f64(),
    };
    let mut profiles = vec![Profile::hold(0.0); problems.len()];
    let (answer, arrival) = match line["interface"].as_str() {
        Some("velocity") => (synchronised_velocity(&problems, &mut profiles, timing), Arrival::Velocity),
        _ => (synchronised(&problems, &mut profiles, timing), Arrival::State),
    };
    let duration_s = answer.map_err(|error| format!("{error:?}"))?;
    for (problem, profile) in problems.iter().zip(&profiles) {
        judge(problem, profile, arrival)?;
    }
    if line["result"] != "ok" {
        return Ok(());
    }
    let fastest: Vec<f64> = profiles.iter().map(Profile::minimum_duration_s).collect();
    let oracle: Vec<f64> = line["t_min"].as_array().unwrap().iter().map(number).collect();
    if !fastest.iter().zip(&oracle).all(|(own_s, oracle_s)| agrees(*own_s, *oracle_s)) {
        return Err(format!("fastest {fastest:?}, oracle {oracle:?}"));
    }
    let oracle_s = number(&line["duration"]);
    if agrees(duration_s, oracle_s) { Ok(()) } else { Err(format!("{duration_s} s, oracle {oracle_s} s")) }
}

fn compare_all(lines: &str) {
    let mut failures = Vec::new();
    for line in lines.lines() {
        let problem: Value = serde_json::from_str(line).unwrap();
        if let Err(why) = compare(&problem) {
            failures.push(format!("{}: {why}", problem["id"]));
        }
    }
    assert!(failures.is_empty(), "{} of {}: {:#?}", failures.len(), lines.lines().count(), failures);
}

#[test]
fn second_order_durations_are_those_of_ruckig() {
    compare_all(include_str!("oracle/second.jsonl"));
}
