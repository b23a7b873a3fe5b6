//! A function of the owner in the real-time thread.

use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread::{self, ThreadId};
use std::time::Duration;

use takt::ring;
use takt::{CallbackOptions, Config, Controller, Follow, Outcome, Phase, SessionOptions, StreamState};

use crate::heap;

const PATIENCE: Duration = Duration::from_secs(30);

/// Says in which thread it is freed.
struct Freed(Arc<Mutex<Option<ThreadId>>>);

impl Drop for Freed {
    fn drop(&mut self) {
        *self.0.lock().unwrap() = Some(thread::current().id());
    }
}

#[test]
fn a_function_leads_an_arm_from_inside_the_real_time_thread_without_the_heap_and_is_freed_elsewhere() {
    let mut config =
        Config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/arm6-erob.toml")).unwrap();
    config.telemetry.is_recorded = false;
    config.telemetry.black_box_ns = None;
    let arm = Controller::start(config, SessionOptions::default()).unwrap();
    let home: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set).collect();
    // On a shared machine without a real-time kernel, any call may be interrupted.
    let patient = CallbackOptions { budget: None, overruns_allowed: 100, follow: Some(Follow::Smooth) };
    let freed = Arc::default();
    let (held, target) = (Freed(Arc::clone(&freed)), home.clone());
    let (mut seen_in, mut seen_out) = ring(4_000);
    let mut time_s = 0.0;
    let callback = arm.in_loop_with(patient, move |state, cycle, command| {
        let _held = &held;
        time_s += cycle.period_s;
        seen_in.push((thread::current().id(), heap().calls, *cycle, state[1].is_stale()));
        for (axis, target) in target.iter().enumerate() {
            command.position(axis, target + 0.02 * (1.0 - (3.0 * time_s).cos()));
        }
        if time_s > 1.0 {
            command.finish();
        }
    });
    let callback = callback.unwrap();
    let state = arm.state();
    assert_eq!(
        (state.groups[0].phase, state.groups[0].stream.state),
        (Phase::Streaming, StreamState::Callback)
    );
    assert_eq!(callback.result(), None);
    assert_eq!(callback.wait(PATIENCE), Ok(()));
    assert_eq!((arm.state().groups[0].phase, arm.state().groups[0].stop), (Phase::Holding, None));
    for (axis, home) in arm.state().axes().iter().zip(&home) {
        assert!((axis.position_set - home - 0.04).abs() < 0.005, "{} from {home}", axis.position_set);
    }

    let seen: Vec<_> = std::iter::from_fn(|| seen_out.pop()).collect();
    let (loop_thread, heap_calls, first, _) = seen[0];
    assert!(seen.iter().all(|(thread, ..)| *thread == loop_thread));
    assert_ne!(loop_thread, thread::current().id());
    assert!(seen.iter().all(|(_, calls, ..)| *calls == heap_calls), "the loop has used the heap");
    assert!(seen.iter().any(|(.., is_stale)| !is_stale));
    let freed_in = freed.lock().unwrap().expect("it has been freed");
    assert_ne!(freed_in, loop_thread);

    let times = callback.times();
    assert_eq!(times.calls, seen.len() as u64);
    assert!(times.longest >= times.last && times.longest > Duration::ZERO, "{times:?}");
    assert!((first.period_s, first.budget_ns) == (0.001, 125_000), "{first:?}");
    assert!(seen.iter().all(|(_, _, cycle, _)| cycle.time_left_ns <= cycle.budget_ns));
    let missed: u64 = seen.iter().map(|(_, _, cycle, _)| cycle.missed_slots).sum();
    assert_eq!(times.missed_slots, missed);
    let passed_s: f64 = seen.iter().skip(1).map(|(_, _, cycle, _)| cycle.dt_s).sum();
    let last = seen.last().unwrap().2;
    let slots = last.slot - first.slot;
    assert!((passed_s - slots as f64 * 0.001).abs() < 1e-9, "{passed_s} s are {slots} slots");
    assert_eq!(arm.finish().unwrap().outcome, Outcome::Finished);
}
