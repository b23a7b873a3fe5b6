//! Plans and samples a fixed set of problems, for counting instructions:
//!
//! ```text
//! valgrind --tool=callgrind target/release/examples/plan_instructions trapezoid-7 1024
//! ```
//!
//! The first argument names the work: `position-AXES`, `velocity-AXES`, `trapezoid-AXES`, `replan-AXES`, `late-AXES` or
//! `sample-AXES`. All but the last also exist with `rsruckig-` in front. The second argument says how often the work is
//! repeated. The difference between two repetition counts does not contain the start-up.

use std::hint::black_box;

use ::rsruckig::prelude::{Ruckig, ThrowErrorHandler, Trajectory};
use takt_rt::plan::{PlanOptions, Problem, Profile, synchronised, synchronised_velocity};

#[path = "../benches/plan_problems/mod.rs"]
mod plan_problems;
use plan_problems::rsruckig::input;
use plan_problems::{Order, planned_anew, problems};

const SETS: u64 = 1024;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, repetitions] = arguments.as_slice() else { usage() };
    let Ok(repetitions) = repetitions.parse::<usize>() else { usage() };
    let (name, is_other) = name.strip_prefix("rsruckig-").map_or((name.as_str(), false), |name| (name, true));
    let Some((work, axes)) = name.split_once('-') else { usage() };
    let Ok(axes) = axes.parse::<usize>() else { usage() };
    if work == "sample" {
        return sample(axes, repetitions);
    }
    let draw = |seed| match work {
        "position" | "velocity" => problems(seed, axes, Order::Third),
        "trapezoid" => problems(seed, axes, Order::Second),
        "replan" => planned_anew(seed, axes, 0.1),
        "late" => planned_anew(seed, axes, 0.9),
        _ => usage(),
    };
    let sets: Vec<_> = (0..SETS).map(draw).collect();
    let is_velocity = work == "velocity";
    match (is_other, axes) {
        (false, _) => plan(&sets, is_velocity, axes, repetitions),
        (true, 1) => plan_with_rsruckig::<1>(&sets, is_velocity, repetitions),
        (true, 3) => plan_with_rsruckig::<3>(&sets, is_velocity, repetitions),
        (true, 6) => plan_with_rsruckig::<6>(&sets, is_velocity, repetitions),
        (true, 7) => plan_with_rsruckig::<7>(&sets, is_velocity, repetitions),
        _ => usage(),
    }
}

fn usage() -> ! {
    eprintln!(
        "usage: plan_instructions [rsruckig-]{{position|velocity|trapezoid|replan|late|sample}}-AXES REPETITIONS"
    );
    std::process::exit(2);
}

fn plan(sets: &[Vec<Problem>], is_velocity: bool, axes: usize, repetitions: usize) {
    let planner = if is_velocity { synchronised_velocity } else { synchronised };
    let mut profiles = vec![Profile::hold(0.0); axes];
    for set in sets.iter().cycle().take(repetitions) {
        let _ = black_box(planner(black_box(set), &mut profiles, PlanOptions::default()));
    }
}

fn plan_with_rsruckig<const AXES: usize>(sets: &[Vec<Problem>], is_velocity: bool, repetitions: usize) {
    let inputs: Vec<_> = sets.iter().map(|set| input::<AXES>(set, is_velocity)).collect();
    let mut ruckig = Ruckig::<AXES, ThrowErrorHandler>::new(None, 0.001);
    let mut trajectory = Trajectory::<AXES>::new(None);
    for input in inputs.iter().cycle().take(repetitions) {
        let _ = black_box(ruckig.calculate(black_box(input), &mut trajectory));
    }
}

fn sample(axes: usize, repetitions: usize) {
    let mut profiles = vec![Profile::hold(0.0); axes];
    let set = problems(1, axes, Order::Third);
    let duration_s = synchronised(&set, &mut profiles, PlanOptions::default()).unwrap_or_default();
    for repetition in 0..repetitions {
        let time_s = duration_s * (repetition % 1024) as f64 / 1024.0;
        for profile in &profiles {
            black_box(profile.sample(black_box(time_s)));
        }
    }
}
