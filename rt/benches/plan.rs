//! The time of planning and sampling, over 1,024 random problems in motion, with the distribution of Ruckig's own benchmark.
//! `rsruckig` solves the same problems for comparison.

use criterion::{Criterion, criterion_group, criterion_main};
use rsruckig::prelude::{Ruckig, ThrowErrorHandler, Trajectory};
use std::hint::black_box;
use std::time::Duration;
use takt_rt::plan::{PlanOptions, Problem, Profile, State, synchronised, synchronised_velocity};

mod plan_problems;
use plan_problems::rsruckig::input;
use plan_problems::{Order, planned_anew, problems};

const SETS: u64 = 1024;

type Planner = fn(&[Problem], &mut [Profile], PlanOptions) -> Result<f64, takt_rt::plan::PlanError>;

/// Plans the sets one after another, with takt and with `rsruckig`.
fn compare<const AXES: usize>(
    criterion: &mut Criterion,
    name: &str,
    planner: Planner,
    draw: fn(u64, usize) -> Vec<Problem>,
) {
    let sets: Vec<Vec<Problem>> = (0..SETS).map(|seed| draw(seed, AXES)).collect();
    let mut profiles = [Profile::hold(0.0); AXES];
    let mut next = sets.iter().cycle();
    criterion.bench_function(&format!("plan/{name}/{AXES}"), |bencher| {
        bencher.iter(|| {
            let problems = next.next().map(Vec::as_slice).unwrap_or_default();
            planner(black_box(problems), &mut profiles, PlanOptions::default())
        });
    });
    let inputs: Vec<_> = sets.iter().map(|set| input::<AXES>(set, name == "velocity")).collect();
    let mut ruckig = Ruckig::<AXES, ThrowErrorHandler>::new(None, 0.001);
    let mut trajectory = Trajectory::<AXES>::new(None);
    let mut next = inputs.iter().cycle();
    criterion.bench_function(&format!("rsruckig/{name}/{AXES}"), |bencher| {
        bencher.iter(|| next.next().map(|input| ruckig.calculate(black_box(input), &mut trajectory).is_ok()));
    });
}

fn third_order(seed: u64, axes: usize) -> Vec<Problem> {
    problems(seed, axes, Order::Third)
}

fn second_order(seed: u64, axes: usize) -> Vec<Problem> {
    problems(seed, axes, Order::Second)
}

fn position(criterion: &mut Criterion) {
    compare::<1>(criterion, "position", synchronised, third_order);
    compare::<3>(criterion, "position", synchronised, third_order);
    compare::<6>(criterion, "position", synchronised, third_order);
    compare::<7>(criterion, "position", synchronised, third_order);
}

fn velocity(criterion: &mut Criterion) {
    compare::<1>(criterion, "velocity", synchronised_velocity, third_order);
    compare::<3>(criterion, "velocity", synchronised_velocity, third_order);
    compare::<6>(criterion, "velocity", synchronised_velocity, third_order);
    compare::<7>(criterion, "velocity", synchronised_velocity, third_order);
}

fn trapezoid(criterion: &mut Criterion) {
    compare::<1>(criterion, "trapezoid", synchronised, second_order);
    compare::<3>(criterion, "trapezoid", synchronised, second_order);
    compare::<6>(criterion, "trapezoid", synchronised, second_order);
    compare::<7>(criterion, "trapezoid", synchronised, second_order);
}

fn early(seed: u64, axes: usize) -> Vec<Problem> {
    planned_anew(seed, axes, 0.1)
}

fn late(seed: u64, axes: usize) -> Vec<Problem> {
    planned_anew(seed, axes, 0.9)
}

fn replan(criterion: &mut Criterion) {
    compare::<6>(criterion, "replan", synchronised, early);
    compare::<7>(criterion, "replan", synchronised, early);
    compare::<7>(criterion, "replan late", synchronised, late);
}

fn sample(criterion: &mut Criterion) {
    for axes in [1, 7] {
        let mut profiles = vec![Profile::hold(0.0); axes];
        let set = problems(1, axes, Order::Third);
        let duration_s = synchronised(&set, &mut profiles, PlanOptions::default()).unwrap_or_default();
        let mut states = vec![State::default(); axes];
        let mut cycle = 0_u32;
        criterion.bench_function(&format!("sample/{axes}"), |bencher| {
            bencher.iter(|| {
                cycle = (cycle + 1) % 1024;
                let time_s = duration_s * f64::from(cycle) / 1024.0;
                for (state, profile) in states.iter_mut().zip(&profiles) {
                    *state = profile.sample(black_box(time_s));
                }
                black_box(&mut states);
            });
        });
    }
}

fn quick() -> Criterion {
    Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(800))
}

criterion_group!(name = benches; config = quick(); targets = position, velocity, trapezoid, replan, sample);
criterion_main!(benches);
