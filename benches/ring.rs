//! What the real-time thread pays for being seen: handing a cycle record to the logger (bar: below 100 ns) and
//! publishing the snapshot; and what the logger, which is not real-time, pays for each record.
#![allow(missing_docs, reason = "criterion_main makes undocumented items")]

use std::hint::black_box;
use std::io;
use std::time::{Duration, Instant};

use criterion::{Criterion, criterion_group, criterion_main};
use takt::channels::{ChannelSizes, GroupStream, HostSide, LogSide, RtSide, channels};
use takt::telemetry::{
    AxisDescription, Logger, LoggerOptions, Machine, RecordingDestination, RecordingOptions,
    SetPointMagnitudes, Unit, WallClock,
};
use takt_rt::{CycleRecord, HostInterface, Snapshot};

/// The ring holds eight seconds of records at 1 ms.
const RECORDS: usize = 8192;
/// The logger comes round after so many.
const PUSHES: u64 = 32;

fn sides(axes: usize) -> (RtSide, HostSide, LogSide) {
    channels(&ChannelSizes {
        groups: vec![GroupStream::default()],
        axes,
        buses: axes.div_ceil(3),
        records: RECORDS,
        events: 64,
        requests: 16,
        service_out: 64,
        service_in: 64,
    })
}

fn record_push(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("record push");
    for axes in [1, 6, 12, 32] {
        let (mut rt, _host, mut log) = sides(axes);
        let record = CycleRecord { axis_count: axes as u8, ..CycleRecord::default() };
        group.bench_function(format!("{axes} axes"), |bencher| {
            bencher.iter_custom(|iterations| {
                let mut elapsed = Duration::ZERO;
                let mut left = iterations;
                while left > 0 {
                    let pushes = left.min(PUSHES);
                    let start = Instant::now();
                    for _ in 0..pushes {
                        assert!(rt.record(black_box(&record)));
                    }
                    elapsed += start.elapsed();
                    // The logger's work is its own: it is done outside the measured time.
                    while log.next_record(|_| ()).is_some() {}
                    left -= pushes;
                }
                elapsed
            });
        });
    }
    group.finish();
}

fn snapshot(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("snapshot");
    for axes in [6, 32] {
        let (mut rt, host, _log) = sides(axes);
        let snapshot =
            Snapshot { axis_count: axes as u8, bus_count: axes.div_ceil(3) as u8, ..host.snapshot() };
        group.bench_function(format!("publish {axes} axes"), |bencher| {
            bencher.iter(|| rt.publish(black_box(&snapshot)));
        });
        group.bench_function(format!("read {axes} axes"), |bencher| bencher.iter(|| host.snapshot()));
    }
    group.finish();
}

fn logger(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("logger per record");
    for (axes, is_recorded) in [(6, false), (6, true), (32, true)] {
        let (mut rt, _host, log) = sides(axes);
        let axis = |index| AxisDescription {
            name: format!("joint{index}"),
            bus: None,
            group: 0,
            family: None,
            own_errors: vec![],
            unit: Unit::Radian,
            plans_own_profile: false,
            counts_per_unit: 83_443.0,
            limits: SetPointMagnitudes::default(),
        };
        let options = LoggerOptions {
            machine: Machine {
                name: "bench".to_owned(),
                cycle_ns: 1_000_000,
                axes: (0..axes).map(axis).collect(),
                buses: Vec::new(),
                groups: Vec::new(),
            },
            wall_clock: WallClock::fixed(0),
            started_ns: 0,
            recording: is_recorded
                .then(|| RecordingDestination::Stream("nowhere".to_owned(), Box::new(io::sink()))),
            recording_options: RecordingOptions::default(),
            candump: None,
            black_box: None,
            traces: Vec::new(),
        };
        let mut logger = Logger::new(log, options, Box::new(|_| ()));
        let record = CycleRecord { axis_count: axes as u8, ..CycleRecord::default() };
        let name = format!("{axes} axes, {}", if is_recorded { "MCAP" } else { "statistics only" });
        group.bench_function(name, |bencher| {
            bencher.iter_custom(|iterations| {
                let mut elapsed = Duration::ZERO;
                let mut left = iterations;
                while left > 0 {
                    let pushes = left.min(RECORDS as u64);
                    (0..pushes).for_each(|_| assert!(rt.record(&record)));
                    let start = Instant::now();
                    assert_eq!(logger.drain() as u64, pushes);
                    elapsed += start.elapsed();
                    left -= pushes;
                }
                elapsed
            });
        });
    }
    group.finish();
}

criterion_group!(benches, record_push, snapshot, logger);
criterion_main!(benches);
