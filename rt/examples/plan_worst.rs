//! The longest time of planning. Every set of problems is planned in many passes and its shortest time counts, so other work of
//! the machine does not. `rsruckig` plans the same sets of 7 axes for comparison.
//!
//! ```text
//! cargo run --release -p takt-rt --example plan_worst -- 7 200
//! ```
//!
//! The arguments are the number of axes and the number of passes.

use std::hint::black_box;
use std::time::{Duration, Instant};

use ::rsruckig::prelude::{Ruckig, ThrowErrorHandler, Trajectory};
use takt_rt::plan::{PlanOptions, Problem, Profile, synchronised};

#[path = "../benches/plan_problems/mod.rs"]
mod plan_problems;
use plan_problems::rsruckig::input;
use plan_problems::{Order, planned_anew, problems};

const SETS: u64 = 4096;

fn main() {
    let mut arguments = std::env::args().skip(1).map(|argument| argument.parse::<usize>());
    let (Some(Ok(axes)), Some(Ok(passes))) = (arguments.next(), arguments.next()) else {
        eprintln!("usage: plan_worst AXES PASSES");
        std::process::exit(2);
    };
    let draw = |problems: &dyn Fn(u64) -> Vec<Problem>| (0..SETS).map(problems).collect::<Vec<_>>();
    let kinds = [
        ("third order", draw(&|seed| problems(seed, axes, Order::Third))),
        ("planned anew at 10 %", draw(&|seed| planned_anew(seed, axes, 0.1))),
        ("planned anew at 90 %", draw(&|seed| planned_anew(seed, axes, 0.9))),
        ("second order", draw(&|seed| problems(seed, axes, Order::Second))),
    ];
    for (name, sets) in kinds {
        let mut profiles = vec![Profile::hold(0.0); axes];
        let own = shortest(&sets, passes, |set| {
            let _ = black_box(synchronised(black_box(set), &mut profiles, PlanOptions::default()));
        });
        println!("{name}, {axes} axes: {}", spread(own));
        if axes == 7 {
            let inputs: Vec<_> = sets.iter().map(|set| input::<7>(set, false)).collect();
            let mut ruckig = Ruckig::<7, ThrowErrorHandler>::new(None, 0.001);
            let mut trajectory = Trajectory::<7>::new(None);
            let other = shortest(&inputs, passes, |input| {
                let _ = black_box(ruckig.calculate(black_box(input), &mut trajectory));
            });
            println!("{name}, {axes} axes, rsruckig: {}", spread(other));
        }
    }
}

/// The shortest time of all passes for each of the sets.
fn shortest<Set>(sets: &[Set], passes: usize, mut plan: impl FnMut(&Set)) -> Vec<Duration> {
    let mut best = vec![Duration::MAX; sets.len()];
    for _ in 0..passes {
        for (best, set) in best.iter_mut().zip(sets) {
            let begun = Instant::now();
            plan(set);
            *best = begun.elapsed().min(*best);
        }
    }
    best
}

fn spread(mut times: Vec<Duration>) -> String {
    times.sort_unstable();
    let at = |part: f64| times[((times.len() - 1) as f64 * part) as usize];
    let mean = times.iter().sum::<Duration>() / times.len() as u32;
    format!("mean {mean:?}, median {:?}, 99 % {:?}, worst {:?}", at(0.5), at(0.99), at(1.0))
}
