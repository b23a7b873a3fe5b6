//! A function of the owner in the real-time thread: on the real clock, and in virtual time.
#![allow(unsafe_code, reason = "a global allocator that counts cannot be written without")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, ThreadId};
use std::time::Duration;

use takt::internals::RunInside;
use takt::internals::channels::{CallbackRecord, GivenCallback};
use takt::ring;
use takt::rt::{AxisLimits, CallbackId, CallbackRun, Fault, MotionState};
use takt::sim::SimulatedBus;
use takt::{
    CallbackCommand, CallbackCycle, CallbackOptions, CallbackState, CommandError, Config, Controller, Follow,
    MotionError, Outcome, Phase, RejectReason, RequestId, Rule, SessionOptions, StopCategory, StreamState,
    VirtualRun,
};

thread_local! {
    static HEAP_CALLS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, with a count for each thread.
struct Counting;

// SAFETY: every call is handed on unchanged to the system's allocator; the count touches no memory of the heap.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = HEAP_CALLS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps the contract of `alloc`, which is the same here.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        let _ = HEAP_CALLS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: `pointer` came from `System` with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const PATIENCE: Duration = Duration::from_secs(30);

/// On a shared machine without a real-time kernel, any call may be interrupted.
const PATIENT: CallbackOptions =
    CallbackOptions { budget: None, overruns_allowed: 100, follow: Some(Follow::Smooth) };

fn config(name: &str) -> Config {
    let mut config = Config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name)).unwrap();
    config.telemetry.is_recorded = false;
    config.telemetry.black_box_ns = None;
    config
}

fn start(name: &str) -> Controller {
    Controller::start(config(name), SessionOptions::default()).unwrap()
}

/// Says in which thread it is freed.
struct Freed(Arc<Mutex<Option<ThreadId>>>);

impl Drop for Freed {
    fn drop(&mut self) {
        *self.0.lock().unwrap() = Some(thread::current().id());
    }
}

#[test]
fn a_function_leads_an_arm_from_inside_the_real_time_thread_without_the_heap_and_is_freed_elsewhere() {
    let arm = start("arm6-erob.toml");
    let home: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set).collect();
    let freed = Arc::default();
    let (held, target) = (Freed(Arc::clone(&freed)), home.clone());
    let (mut seen_in, mut seen_out) = ring(4_000);
    let mut time_s = 0.0;
    let callback = arm.in_loop_with(PATIENT, move |state, cycle, command| {
        let _held = &held;
        time_s += cycle.period_s;
        seen_in.push((thread::current().id(), HEAP_CALLS.with(Cell::get), *cycle, state[1].is_stale()));
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

#[test]
fn a_panic_is_a_stop_whose_message_the_owner_gets_and_the_function_is_not_called_again() {
    let joint = start("single-erob.toml");
    let freed = Arc::default();
    let held = Freed(Arc::clone(&freed));
    let calls = Arc::new(AtomicU64::new(0));
    let counting = Arc::clone(&calls);
    let callback = joint.in_loop_with(PATIENT, move |_, _, command| {
        let _held = &held;
        if counting.fetch_add(1, Ordering::Relaxed) == 99 {
            panic!("no solution for pose {}", 7);
        }
        command.position(0, 0.3);
    });
    let error = callback.unwrap().wait(PATIENCE).unwrap_err();
    let MotionError::CallbackPanicked { message, stopped } = &error else { panic!("{error}") };
    assert!(message.starts_with("no solution for pose 7, at tests/in_loop.rs:"), "{message}");
    assert_eq!(stopped.reason.category, StopCategory::Two);
    assert!(error.to_string().contains("no solution for pose 7"), "{error}");
    assert_eq!(joint.wait_for(Phase::Holding, PATIENCE), Ok(()));
    assert_eq!(calls.load(Ordering::Relaxed), 100);
    assert!(freed.lock().unwrap().is_some(), "it has been freed");
    // A defect of the function is none of the run: after a reset everything is possible again.
    assert!(matches!(joint.in_loop(|_, _, _| {}), Err(CommandError::Refused(_))));
    joint.reset_faults().unwrap();
    let again = joint.in_loop_with(PATIENT, |_, _, command| command.finish()).unwrap();
    assert_eq!(again.wait(PATIENCE), Ok(()));
    assert_eq!(joint.finish().unwrap().outcome, Outcome::Finished);
}

#[test]
fn an_axis_that_the_group_does_not_have_is_a_panic_that_names_it() {
    let joint = start("single-erob.toml");
    let callback = joint.in_loop_with(PATIENT, |state, _, command| command.position(1, state[0].position));
    let error = callback.unwrap().wait(PATIENCE).unwrap_err();
    assert!(error.to_string().contains("the group has no axis 1: it has 1"), "{error}");
}

#[test]
fn a_call_that_is_too_slow_by_the_real_clock_is_a_stop_that_says_by_how_much() {
    let joint = start("single-erob.toml");
    let is_slow = Arc::new(AtomicBool::new(false));
    let slows = Arc::clone(&is_slow);
    let callback = joint.in_loop_with(CallbackOptions { overruns_allowed: 3, ..PATIENT }, move |_, _, _| {
        if slows.load(Ordering::Relaxed) {
            thread::sleep(Duration::from_micros(300));
        }
    });
    let callback = callback.unwrap();
    thread::sleep(Duration::from_millis(50));
    assert_eq!(callback.result(), None);
    is_slow.store(true, Ordering::Relaxed);
    let error = callback.wait(PATIENCE).unwrap_err();
    let MotionError::Stopped(stopped) = &error else { panic!("{error}") };
    let Some(Fault::CallbackOverrun { spent_ns, budget_ns }) = stopped.reason.cause.fault() else {
        panic!("{error}")
    };
    assert!(*spent_ns >= 300_000 && *budget_ns == 125_000, "{error}");
    assert!(callback.times().overruns >= 4, "{:?}", callback.times());
    assert_eq!(joint.wait_for(Phase::Holding, PATIENCE), Ok(()));
}

#[test]
fn what_cannot_be_run_is_refused_and_the_function_is_freed() {
    let joint = start("single-erob.toml");
    let freed = Arc::<Mutex<Option<ThreadId>>>::default();
    let holding = || {
        let held = Freed(Arc::clone(&freed));
        move |_: &CallbackState<'_>, _: &CallbackCycle, _: &mut CallbackCommand<'_>| {
            let _held = &held;
        }
    };
    for budget in [Duration::ZERO, Duration::from_micros(251), Duration::MAX] {
        let options = CallbackOptions { budget: Some(budget), ..PATIENT };
        let longest = Duration::from_micros(250);
        assert_eq!(
            joint.in_loop_with(options, holding()).err(),
            Some(CommandError::Budget { budget, longest })
        );
        assert!(freed.lock().unwrap().take().is_some());
    }
    joint.disable().unwrap();
    joint.wait_for(Phase::Disabled, PATIENCE).unwrap();
    for _ in 0..40 {
        let Err(CommandError::Refused(refused)) = joint.in_loop(holding()) else { panic!("it is disabled") };
        assert_eq!(refused.refusal.map(|refusal| refusal.reason), Some(RejectReason::Phase));
        let begun = std::time::Instant::now();
        while freed.lock().unwrap().take().is_none() {
            assert!(begun.elapsed() < PATIENCE);
            thread::sleep(Duration::from_millis(1));
        }
    }
}

#[test]
fn moves_stops_and_other_functions_take_the_place_of_one_and_a_dropped_handle_does_not() {
    let joint = start("single-erob.toml");
    let home = joint.state().axes[0].position_set;
    let to = |offset: f64| {
        move |_: &CallbackState<'_>, _: &CallbackCycle, command: &mut CallbackCommand<'_>| {
            command.position(0, home + offset);
        }
    };
    let first = joint.in_loop_with(PATIENT, to(0.3)).unwrap();
    let first_motion = first.motion();
    drop(first);
    thread::sleep(Duration::from_millis(100));
    assert_eq!((joint.state().groups[0].phase, joint.result_of(first_motion)), (Phase::Streaming, None));
    let second = joint.in_loop_with(PATIENT, to(-0.2)).unwrap();
    assert_eq!(joint.result_of(first_motion), Some(Err(MotionError::Replaced)));
    thread::sleep(Duration::from_millis(100));
    let motion = joint.move_to(&[home + 0.1]).unwrap();
    assert_eq!(joint.wait(motion, PATIENCE), Ok(()));
    assert_eq!(second.wait(PATIENCE), Err(MotionError::Replaced));
    let third = joint.in_loop_with(PATIENT, to(0.0)).unwrap();
    joint.stop(StopCategory::Two).unwrap();
    assert!(matches!(third.wait(PATIENCE), Err(MotionError::Stopped(_))));
    assert_eq!(joint.wait_for(Phase::Holding, PATIENCE), Ok(()));
    joint.in_loop_with(PATIENT, to(0.0)).unwrap();
    assert_eq!(joint.finish().unwrap().outcome, Outcome::Finished, "it ends with the run");
}

#[test]
fn each_group_is_led_by_a_function_of_its_own() {
    let controller = start("arm-and-gripper.toml");
    let arm = controller.group("arm").unwrap();
    let refused = controller.in_loop(|_, _, _| {}).err();
    let Some(CommandError::Refused(refused)) = refused else { panic!("{refused:?}") };
    assert!(matches!(refused.refusal.unwrap().reason, RejectReason::GroupNotNamed { groups: 2 }));
    let home: Vec<f64> = arm.axes().iter().map(|axis| controller.state().axes[*axis].position_set).collect();
    let target = home.clone();
    let mut calls = 0;
    let leading = arm.in_loop_with(PATIENT, move |state, _, command| {
        assert_eq!(state.axes().len(), target.len());
        calls += 1;
        target.iter().enumerate().for_each(|(axis, home)| command.position(axis, home + 0.05));
        if calls == 1_500 {
            command.finish();
        }
    });
    // The gripper is in profile torque: a function can watch it, and it keeps what it was given.
    let gripper = controller.group("gripper").unwrap();
    let watching = gripper.in_loop_with(PATIENT, |state, _, _| assert_eq!(state.axes().len(), 1)).unwrap();
    assert_eq!((arm.state().phase, gripper.state().phase), (Phase::Streaming, Phase::Streaming));
    assert_eq!(leading.unwrap().wait(PATIENCE), Ok(()));
    for (axis, home) in arm.axes().iter().zip(&home) {
        let set = controller.state().axes[*axis].position_set;
        assert!((set - home - 0.05).abs() < 1e-3, "{set} from {home}");
    }
    assert_eq!((gripper.state().phase, watching.result()), (Phase::Streaming, None));
}

/// The budget of the calls in virtual time.
const BUDGET_NS: u64 = 50_000;

const RUN: CallbackRun =
    CallbackRun { callback: CallbackId(0), budget_ns: BUDGET_NS, overruns_allowed: 0, follow: None };

/// A joint that holds, in virtual time.
fn holding() -> VirtualRun<SimulatedBus> {
    let config = config("single-erob.toml");
    let ports = vec![SimulatedBus::new(&config, 0)];
    let mut run = VirtualRun::serving(&config, ports).unwrap().0;
    while run.snapshot().groups[0].phase != Phase::Holding {
        assert!(run.step());
    }
    run
}

fn lead(
    run: &mut VirtualRun<SimulatedBus>,
    body: impl FnMut(&CallbackState<'_>, &CallbackCycle, &mut CallbackCommand<'_>) + Send + 'static,
) -> (RequestId, Arc<CallbackRecord>) {
    let limits: AxisLimits = config("single-erob.toml").axes[0].limits;
    let given = GivenCallback::new(0, &[(0, limits)], Box::new(body));
    let record = given.record();
    (run.host().run_callback(given, RUN).unwrap(), record)
}

#[test]
fn in_virtual_time_a_call_takes_no_time_unless_it_is_said_how_long() {
    let mut run = holding();
    let (motion, record) = lead(&mut run, |_, cycle, command| {
        assert_eq!((cycle.time_left_ns, cycle.missed_slots), (BUDGET_NS, 0));
        command.position(0, 0.2);
    });
    (0..500).for_each(|_| assert!(run.step()));
    assert_eq!((run.snapshot().groups[0].phase, record.times().longest), (Phase::Streaming, Duration::ZERO));
    run.take_for_callbacks(BUDGET_NS);
    (0..50).for_each(|_| assert!(run.step()));
    assert_eq!(run.snapshot().groups[0].phase, Phase::Streaming);
    run.take_for_callbacks(BUDGET_NS + 1);
    (0..2).for_each(|_| assert!(run.step()));
    let stop = run.snapshot().groups[0].stop.unwrap();
    assert_eq!(stop.rule(), Rule::CallbackOverrun);
    assert_eq!(run.snapshot().motions.of(motion), Some(MotionState::Stopped(stop)));
    assert!(record.is_over());
    let times = record.times();
    assert_eq!((times.overruns, times.longest), (1, Duration::from_nanos(BUDGET_NS + 1)));
}

#[test]
fn the_same_function_gives_the_same_motion_in_every_virtual_run() {
    let motion = || {
        let mut run = holding();
        let mut phase = 0.0_f64;
        lead(&mut run, move |state, cycle, command| {
            phase += 2.0 * cycle.dt_s;
            command.position(0, 0.1 * phase.sin() + 0.001 * state[0].position);
        });
        let positions = (0..1_000).map(|_| {
            assert!(run.step());
            run.snapshot().axes[0].position_set.to_bits()
        });
        positions.collect::<Vec<_>>()
    };
    let first = motion();
    assert_eq!(first, motion());
    assert_ne!(first[0], first[999]);
}

#[test]
fn a_request_that_finds_no_room_gives_the_function_back() {
    let mut run = holding();
    let freed: Vec<Arc<Mutex<Option<ThreadId>>>> = (0..64).map(|_| Arc::default()).collect();
    let mut refused = 0;
    for freed in &freed {
        let held = Freed(Arc::clone(freed));
        let limits: AxisLimits = config("single-erob.toml").axes[0].limits;
        let given = GivenCallback::new(0, &[(0, limits)], Box::new(move |_, _, _| _ = &held));
        refused += usize::from(run.host().run_callback(given, RUN).is_err());
    }
    let count = || freed.iter().filter(|freed| freed.lock().unwrap().is_some()).count();
    assert!(refused > 0 && count() == refused, "{} of {refused}", count());
    (0..50).for_each(|_| assert!(run.step()));
    assert_eq!(count(), 63, "only the last one leads the joint");
}
