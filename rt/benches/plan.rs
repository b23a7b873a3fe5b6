//! The time that planning and sampling take (second order; rest to rest, as a motion program asks for it, and
//! motion).

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use takt_rt::plan::{Problem, Profile, State, Timing, synchronised};

mod plan_problems;
use plan_problems::{Order, problems};

fn plan(criterion: &mut Criterion) {
    for axes in [1, 3, 6, 7] {
        let sets: Vec<Vec<Problem>> = (0..256).map(|seed| problems(seed, axes, Order::Second)).collect();
        let mut profiles = vec![Profile::hold(0.0); axes];
        let mut next = sets.iter().cycle();
        criterion.bench_function(&format!("trapezoid/plan/{axes}"), |bencher| {
            bencher.iter(|| {
                let problems = next.next().map(Vec::as_slice).unwrap_or_default();
                synchronised(black_box(problems), &mut profiles, Timing::default())
            });
        });
    }
}

fn sample(criterion: &mut Criterion) {
    for axes in [1, 7] {
        let mut profiles = vec![Profile::hold(0.0); axes];
        let duration_s =
            synchronised(&problems(1, axes, Order::Second), &mut profiles, Timing::default()).unwrap();
        let mut states = vec![State::default(); axes];
        let mut cycle = 0_u32;
        criterion.bench_function(&format!("sample/{axes}"), |bencher| {
            bencher.iter(|| {
                cycle = (cycle + 617) % 1024;
                let time_s = duration_s * f64::from(cycle) / 1024.0;
                for (state, profile) in states.iter_mut().zip(&profiles) {
                    *state = profile.sample(black_box(time_s));
                }
                black_box(&mut states);
            });
        });
    }
}

criterion_group!(benches, plan, sample);
criterion_main!(benches);
