//! What it costs to observe and to command a controller of another process: `cargo bench -p takt-remote`.
//!
//! The controller is in this process, and the client uses it through the same memory and sockets as from another one.

use std::path::Path;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use takt::{AnyHandle, Config, Controller, EventKind, Phase, SessionOptions};
use takt_remote::ServeOptions;

fn calls(criterion: &mut Criterion) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/arm6-erob.toml");
    let mut config = Config::load(&path).unwrap();
    config.telemetry.is_recorded = false;
    config.telemetry.black_box_ns = None;
    let arm = Controller::start(config, SessionOptions::default()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("arm").display().to_string();
    let _server = takt_remote::serve(arm.handle(), &name, ServeOptions::default()).unwrap();
    let client = takt_remote::connect(&name).unwrap();

    let mut group = criterion.benchmark_group("another process");
    group.bench_function("state", |bencher| bencher.iter(|| client.state()));
    group.bench_function("state, own process", |bencher| bencher.iter(|| arm.state()));
    group.bench_function("command and its reply", |bencher| bencher.iter(|| client.take_lease().unwrap()));
    client.begin_stream().unwrap();
    let here: Vec<f64> = client.state().axes().iter().map(|axis| axis.position_set).collect();
    // A full ring takes a moment less than a point that is taken.
    group.bench_function("point of a stream and its reply", |bencher| {
        bencher.iter(|| client.stream().push_now(&here));
    });
    group.finish();

    client.stop(takt::StopCategory::Two).unwrap();
    client.wait_for(Phase::Holding, Duration::from_secs(10)).unwrap();
    let handle = arm.handle();
    println!("cycles from the state before a call to the one that shows the motion:");
    println!("  own process     {:?}", cycles_to_motion(&handle.into()));
    println!("  another process {:?}", cycles_to_motion(&client.into()));
}

/// How many of a hundred moves are first seen in motion so many cycles after the state that was seen before the call.
fn cycles_to_motion(controller: &AnyHandle) -> Vec<(u64, usize)> {
    let patience = Duration::from_secs(10);
    let mut all = vec![];
    for number in 0..100 {
        let here: Vec<f64> = controller.state().axes().iter().map(|axis| axis.position_set).collect();
        let step = if number % 2 == 0 { 0.01 } else { -0.01 };
        let target: Vec<f64> = here.iter().map(|position| position + step).collect();
        let mut events = controller.events();
        let before = controller.state().slot;
        let begun = controller.move_to(&target);
        let motion = begun.unwrap();
        loop {
            let event = events.wait(patience).unwrap();
            if matches!(event.kind, EventKind::PhaseChanged { to: Phase::Moving, .. }) {
                all.push(event.slot - before);
                break;
            }
        }
        controller.wait(motion, patience).unwrap();
    }
    all.sort_unstable();
    all.chunk_by(|a, b| a == b).map(|same| (same[0], same.len())).collect()
}

criterion_group!(benches, calls);
criterion_main!(benches);
