//! The time of a cycle without any input or output: feedback, requests, supervision, trajectory, guard, set-points, record.
//!
//! The goal: at most 500 ns for each cycle and 250 ns more for each axis.

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use takt_rt::{CommandSlot, FeedbackSlot, Frame, MappedObject, Mapping, ProcessImage};

#[path = "../tests/fixture/mod.rs"]
mod fixture;
#[path = "../tests/fixture/thinking.rs"]
mod thinking;

use thinking::Thinking;

fn cycle(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("cycle");
    for axes in [1, 6, 12, 32] {
        group.throughput(Throughput::Elements(axes as u64));
        group.bench_function(BenchmarkId::new("moving", axes), |bencher| {
            let mut thinking = Thinking::moving(axes);
            bencher.iter(|| black_box(thinking.cycle()));
        });
        group.bench_function(BenchmarkId::new("streaming", axes), |bencher| {
            let mut thinking = Thinking::streaming(axes);
            bencher.iter(|| black_box(thinking.cycle()));
        });
        group.bench_function(BenchmarkId::new("on a trajectory", axes), |bencher| {
            let mut thinking = Thinking::executing(axes);
            bencher.iter(|| black_box(thinking.cycle()));
        });
        group.bench_function(BenchmarkId::new("led by a callback", axes), |bencher| {
            let mut thinking = Thinking::in_loop(axes);
            bencher.iter(|| black_box(thinking.cycle()));
        });
        group.bench_function(BenchmarkId::new("replanned every cycle", axes), |bencher| {
            let mut thinking = Thinking::moving(axes);
            bencher.iter(|| {
                thinking.replan();
                black_box(thinking.cycle())
            });
        });
    }
    group.finish();
}

fn pdo(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("pdo");
    let commands = [MappedObject::new(0x6040, 0, 16), MappedObject::new(0x607A, 0, 32)];
    let feedback = [MappedObject::new(0x6041, 0, 16), MappedObject::new(0x6064, 0, 32)];
    let (Ok(commands), Ok(feedback)) = (Mapping::commands(&commands), Mapping::feedback(&feedback)) else {
        return;
    };
    let mut image = ProcessImage::default();
    image.set(CommandSlot::TargetPosition, 2_225_000);
    group.bench_function("pack", |bencher| bencher.iter(|| black_box(commands.pack(black_box(&image)))));
    group.bench_function("unpack", |bencher| {
        bencher.iter(|| {
            let mut image = ProcessImage::default();
            let _ = feedback.unpack(black_box(0x0021_F368_1637), black_box(6), &mut image);
            black_box(image.feedback(FeedbackSlot::Position))
        });
    });
    group.bench_function("frame", |bencher| {
        let id = takt_rt::Id::canopen(0x200, 1);
        bencher.iter_batched(|| [1u8; 6], |payload| Frame::of(id, black_box(payload)), BatchSize::SmallInput);
    });
    group.finish();
}

criterion_group!(benches, cycle, pdo);
criterion_main!(benches);
