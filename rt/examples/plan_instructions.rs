//! Plans and samples a fixed set of problems, for counting instructions:
//!
//! ```text
//! valgrind --tool=callgrind target/release/examples/plan_instructions trapezoid-7 1000
//! ```
//!
//! The work is named by the first argument (`trapezoid-AXES`, `jerk-AXES`, `velocity-AXES` or
//! `sample-AXES`) and repeated as often as the second
//! says; the difference between two repetition counts is free of the start-up.

use std::hint::black_box;
use takt_rt::plan::{Profile, Timing, synchronised, synchronised_velocity};

#[path = "../benches/plan_problems/mod.rs"]
mod plan_problems;
use plan_problems::{Order, problems};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let work = arguments.first().and_then(|work| work.split_once('-'));
    let repetitions = arguments.get(1).and_then(|count| count.parse::<u32>().ok());
    let (Some((work, axes)), Some(repetitions)) = (work, repetitions) else {
        eprintln!("usage: plan_instructions trapezoid-AXES|jerk-AXES|velocity-AXES|sample-AXES REPETITIONS");
        std::process::exit(2);
    };
    let axes = axes.parse().unwrap_or(7);
    let order = if work == "trapezoid" { Order::Second } else { Order::Third };
    let sets: Vec<_> = (0..64).map(|seed| problems(seed, axes, order)).collect();
    let mut profiles = vec![Profile::hold(0.0); axes];
    for (repetition, set) in (0..repetitions).zip(sets.iter().cycle()) {
        if work == "sample" && repetition > 0 {
            let time_s = profiles[0].duration_s() * f64::from(repetition % 64) / 64.0;
            for profile in &profiles {
                black_box(profile.sample(black_box(time_s)));
            }
        } else if work == "velocity" {
            let _ = black_box(synchronised_velocity(black_box(set), &mut profiles, Timing::default()));
        } else {
            let _ = black_box(synchronised(black_box(set), &mut profiles, Timing::default()));
        }
    }
}
