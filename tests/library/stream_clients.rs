//! Clients that stream from ordinary threads, on the real clock, beside threads that keep every CPU busy: however late their
//! points come, they never stop the group.

use std::f64::consts::TAU;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use takt::{Config, Controller, Event, EventKind, Phase, SessionOptions};

/// The joints of the arm.
const JOINTS: usize = 6;

/// A gentle sine of every joint: 0.2 rad at 0.5 Hz, which begins at rest.
fn sine(home: &[f64; JOINTS], time_s: f64) -> [f64; JOINTS] {
    let amplitude = 0.2 * (time_s / 2.0).min(1.0).powi(3);
    home.map(|home| home + amplitude * (TAU * 0.5 * time_s).sin())
}

/// Streams at a rate for a time, on a machine that is busy with other things. Returns a summary.
fn stream_beside_load(rate_hz: u32, lasting: Duration) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/arm6-erob.toml");
    let mut config = Config::load(&path).unwrap();
    config.telemetry.is_recorded = false;
    config.telemetry.black_box_ns = None;
    let arm = Controller::start(config, SessionOptions::default()).unwrap();
    let state = arm.state();
    let home = std::array::from_fn(|joint| state.axes[joint].position_set);
    let (is_over, mut events) = (&AtomicBool::new(false), arm.events());
    let busy = 2 * thread::available_parallelism().map_or(2, usize::from);
    let is_stop = |event: &Event| matches!(event.kind, EventKind::Stop(_));
    let (mut latest, mut stops) = (Duration::ZERO, Vec::new());
    thread::scope(|scope| {
        for _ in 0..busy {
            scope.spawn(|| {
                while !is_over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let stream = arm.stream();
        arm.begin_stream().unwrap();
        let (begun, period) = (Instant::now(), Duration::from_secs(1) / rate_hz);
        let begun_ns = arm.now_ns();
        let mut due = Duration::ZERO;
        while due < lasting {
            let late = begun.elapsed().saturating_sub(due);
            latest = latest.max(late);
            let stamp_ns = begun_ns + due.as_nanos() as u64;
            // After a long pause of this thread, what is left of its backlog finds no room at once: those points are lost.
            let _ = stream.push(stamp_ns, &sine(&home, due.as_secs_f64()));
            due += period;
            stops.extend(events.by_ref().filter(is_stop));
            thread::sleep(due.saturating_sub(begun.elapsed()));
        }
        is_over.store(true, Ordering::Relaxed);
    });
    stops.extend(events.by_ref().filter(is_stop));
    let state = arm.state();
    assert!(stops.is_empty() && events.missed() == 0, "{rate_hz} Hz: {stops:?}, {} missed", events.missed());
    assert_eq!((state.groups[0].phase, state.groups[0].stop), (Phase::Streaming, None), "{rate_hz} Hz");
    format!(
        "{rate_hz} Hz for {lasting:?} beside {busy} busy threads: no stop; a point was {latest:?} late, {:?}, {} slots missed",
        arm.stream().report().counts,
        state.missed_slots
    )
}

#[test]
fn a_client_at_100_hz_and_one_at_1_khz_never_cause_a_stop_on_a_loaded_machine() {
    for rate_hz in [100, 1_000] {
        println!("{}", stream_beside_load(rate_hz, Duration::from_secs(4)));
    }
}

/// As above. `cargo test --release --test library stream_clients -- --ignored --nocapture`
#[test]
#[ignore = "takes twenty minutes"]
fn they_never_cause_one_in_ten_minutes_either() {
    for rate_hz in [100, 1_000] {
        println!("{}", stream_beside_load(rate_hz, Duration::from_secs(600)));
    }
}
