//! The longest time that planning takes: every set of problems is planned in many passes, and its shortest time counts,
//! so that what the machine does besides does not.
//!
//! ```text
//! cargo run --release -p takt-rt --example plan_worst -- 7 200
//! ```
//!
//! The arguments are the number of axes and of passes.

use std::hint::black_box;
use std::time::{Duration, Instant};
use takt_rt::plan::{Problem, Profile, Timing, synchronised};

#[path = "../benches/plan_problems/mod.rs"]
mod plan_problems;
use plan_problems::{Order, problems};

const SETS: u64 = 4096;

fn main() {
    let mut arguments = std::env::args().skip(1).map(|argument| argument.parse::<usize>());
    let (Some(Ok(axes)), Some(Ok(passes))) = (arguments.next(), arguments.next()) else {
        eprintln!("usage: plan_worst AXES PASSES");
        std::process::exit(2);
    };
    for (name, order) in [("third order", Order::Third), ("second order", Order::Second)] {
        let sets: Vec<Vec<Problem>> = (0..SETS).map(|seed| problems(seed, axes, order)).collect();
        let mut best = vec![Duration::MAX; sets.len()];
        let mut profiles = vec![Profile::hold(0.0); axes];
        for _ in 0..passes {
            for (best, set) in best.iter_mut().zip(&sets) {
                let begun = Instant::now();
                let _ = black_box(synchronised(black_box(set), &mut profiles, Timing::default()));
                *best = begun.elapsed().min(*best);
            }
        }
        best.sort_unstable();
        let at = |part: f64| best[((best.len() - 1) as f64 * part) as usize];
        println!("{name}, {axes} axes: median {:?}, 99 % {:?}, worst {:?}", at(0.5), at(0.99), at(1.0));
    }
}
