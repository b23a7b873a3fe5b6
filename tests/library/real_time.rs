//! What a controller and its handles have in real time alone: threads that command, wait and observe while the loop runs, the end
//! of the owner, what the operating system grants, and the clock by which a callback is measured.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use takt::faults::{FaultInjector, Scenario};
use takt::rt::Fault;
use takt::rt::linux::{Policy, Step};
use takt::{
    CallbackOptions, CommandError, Config, Controller, Event, EventKind, Follow, Handle, MotionError,
    MoveOptions, Outcome, Phase, PointRefusal, RecoveryError, SessionOptions, Snapshot, StartFailure,
    StopCategory, StreamError, StreamState, WaitError,
};

const PATIENCE: Duration = Duration::from_secs(30);

fn config(name: &str) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name);
    let mut config = Config::load(&path).unwrap();
    config.telemetry.is_recorded = false;
    config.telemetry.black_box_ns = None;
    config
}

fn start(name: &str) -> Controller {
    Controller::start(config(name), SessionOptions::default()).unwrap()
}

#[test]
fn an_arm_that_is_left_disabled_can_be_enabled_at_once() {
    let arm = Controller::start_disabled(config("arm6-erob.toml"), SessionOptions::default()).unwrap();
    let is_off = |state: &Snapshot| state.axes().iter().all(|axis| !axis.drive_state.has_torque());
    assert!(is_off(&arm.state()));
    // Before its life cycle has looked at it again.
    arm.enable().unwrap();
    arm.wait_for(Phase::Holding, PATIENCE).unwrap();
    assert_eq!(arm.finish().unwrap().outcome, Outcome::Finished);
}

#[test]
fn drives_that_cannot_be_brought_up_are_named() {
    let mut config = config("single-erob.toml");
    config.axes[0].identity.vendor = Some(0x1234);
    let failure = Controller::start(config, SessionOptions::default()).err();
    let said = failure.as_ref().map(ToString::to_string).unwrap_or_default();
    assert!(
        said.starts_with("the drives could not be enabled: axis `joint` (node 1 on bus `can`)"),
        "{said}"
    );
    match failure {
        Some(StartFailure::NotEnabled(session)) => {
            assert!(matches!(session.outcome, Outcome::BringUpFailed(_)), "{:?}", session.outcome);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_motion_that_the_end_cuts_off_is_stopped_for_whoever_waits_for_it() {
    let joint = start("single-erob.toml");
    let slowly = MoveOptions { velocity_scale: 0.02, ..MoveOptions::default() };
    let motion = joint.move_with(&[1.0], slowly).unwrap();
    assert_eq!(joint.wait_for(Phase::Moving, PATIENCE), Ok(()));
    let waiting = {
        let handle = joint.handle();
        thread::spawn(move || handle.wait(motion, PATIENCE))
    };
    drop(joint);
    let result = waiting.join().unwrap();
    assert!(matches!(result, Err(MotionError::Stopped(_))), "{result:?}");
}

#[test]
fn cycles_are_waited_for_one_after_the_other() {
    let joint = start("single-erob.toml");
    let first = joint.state();
    let (mut slot, mut skipped) = (first.slot, 0);
    for _ in 0..500 {
        let state = joint.cycle_after(slot, PATIENCE).unwrap();
        assert!(state.slot > slot);
        skipped += state.slot - slot - 1;
        slot = state.slot;
    }
    assert_eq!(slot - first.slot, 500 + skipped);
    let present = joint.state().slot;
    assert!(joint.next_cycle(PATIENCE).unwrap().slot > present);
    assert_eq!(
        joint.cycle_after(slot + 1_000_000, Duration::from_millis(5)).err(),
        Some(WaitError::NotInTime)
    );
    assert_eq!(joint.cycle_after(0, Duration::ZERO).map(|state| state.slot >= slot), Ok(true));
}

#[test]
fn what_the_operating_system_has_granted_is_known_at_the_start() {
    let joint = start("single-erob.toml");
    let report = joint.realtime();
    let refused: Vec<Step> = report.refused().map(|result| result.step).collect();
    assert_eq!(report.scheduling.policy == Policy::Fifo, !refused.contains(&Step::Fifo), "{report:?}");
    assert_eq!(report.memory_locked, !refused.contains(&Step::LockMemory), "{report:?}");
    assert_eq!(joint.realtime(), joint.handle().realtime());
}

#[test]
fn a_recording_that_cannot_be_written_is_known_while_the_arm_moves() {
    let mut config = config("single-erob.toml");
    config.telemetry.is_recorded = true;
    config.telemetry.directory = "/proc/takt-cannot-write-here".into();
    let joint = Controller::start(config, SessionOptions::default()).unwrap();
    let motion = joint.move_to(&[0.1]).unwrap();
    assert_eq!(joint.wait(motion, PATIENCE), Ok(()));
    let not_written = joint.not_written();
    assert!(matches!(&not_written[..], [message] if message.starts_with("no recording")), "{not_written:?}");
}

/// Commands of one thread among many. Whatever the others do, each call returns, and each motion has one end.
fn command(handle: &Handle, own: usize, is_over: &AtomicBool) -> usize {
    let slowly = MoveOptions { velocity_scale: 0.1, ..MoveOptions::default() };
    let mut ended = 0;
    for number in 0.. {
        if is_over.load(Ordering::Relaxed) {
            break;
        }
        let target = 0.05 * ((own + number) % 5) as f64;
        let motion = match handle.move_with(&[target], slowly) {
            Ok(motion) => motion,
            Err(error) => {
                assert!(matches!(error, CommandError::Full { .. }), "{error}");
                continue;
            }
        };
        let result = handle.wait(motion, PATIENCE);
        // `Forgotten`: the operating system has paused this thread while the others began many motions.
        let ends = matches!(
            result,
            Ok(())
                | Err(MotionError::Replaced
                    | MotionError::Stopped(_)
                    | MotionError::Overtaken
                    | MotionError::Forgotten)
        );
        // A move during the deceleration of a stop is refused.
        let is_refused = matches!(&result, Err(MotionError::Refused(refused)) if refused.refusal.is_none_or(|why| why.phase == Phase::Stopping));
        assert!(ends || is_refused, "{result:?}");
        assert!(handle.result_of(motion).is_some());
        ended += 1;
    }
    ended
}

#[test]
fn many_threads_command_stop_wait_and_observe_at_once() {
    let joint = start("single-erob.toml");
    let is_over = AtomicBool::new(false);
    let (mut events, is_over) = (joint.events(), &is_over);
    let is_stop = |event: &Event| matches!(event.kind, EventKind::Stop(_));
    let mut stops = 0;
    thread::scope(|scope| {
        let handle = joint.handle();
        let commanding: Vec<_> = (0..4)
            .map(|own| {
                let handle = handle.clone();
                scope.spawn(move || command(&handle, own, is_over))
            })
            .collect();
        let stopping = {
            let handle = handle.clone();
            scope.spawn(move || {
                for _ in 0..40 {
                    thread::sleep(Duration::from_millis(37));
                    handle.stop(StopCategory::Two).unwrap();
                }
            })
        };
        let watching = {
            let handle = handle.clone();
            let (events, stops) = (&mut events, &mut stops);
            scope.spawn(move || {
                let mut slot = 0;
                while !is_over.load(Ordering::Relaxed) {
                    *stops += events.filter(is_stop).count();
                    let state = handle.cycle_after(slot, PATIENCE).unwrap();
                    assert!(state.slot > slot && state.groups[0].phase != Phase::Disabled);
                    slot = state.slot;
                }
            })
        };
        stopping.join().unwrap();
        is_over.store(true, Ordering::Relaxed);
        let ended: usize = commanding.into_iter().map(|thread| thread.join().unwrap()).sum();
        assert!(ended > 40, "{ended} motions");
        watching.join().unwrap();
    });
    stops += events.by_ref().filter(is_stop).count();
    assert!(stops > 20 && events.missed() == 0, "{stops} stops");
    assert_eq!(joint.finish().unwrap().outcome, Outcome::Finished);
}

#[test]
fn points_from_two_threads_are_followed_and_the_end_of_them_is_reported() {
    let arm = start("arm6-erob.toml");
    let home: Vec<f64> = arm.state().axes[..6].iter().map(|axis| axis.position_set).collect();
    arm.begin_stream().unwrap();
    let begun_ns = arm.now_ns();
    // Each thread has every second point of a slow ramp of 20 ms steps.
    thread::scope(|scope| {
        for half in 0..2 {
            let (stream, home) = (arm.stream(), &home);
            scope.spawn(move || {
                for number in (half..50).step_by(2) {
                    let point: Vec<f64> = home.iter().map(|axis| axis + 0.001 * number as f64).collect();
                    stream.push(begun_ns + 20_000_000 * (number + 5), &point).unwrap();
                    thread::sleep(Duration::from_millis(40));
                }
            });
        }
    });
    let is_dry = |state: &Snapshot| (state.groups[0].stream.state == StreamState::Dry).then_some(());
    arm.wait_until(PATIENCE, is_dry).unwrap();
    let state = arm.advance(300).unwrap();
    assert_eq!((state.groups[0].phase, state.groups[0].stop), (Phase::Streaming, None));
    assert_eq!(state.groups[0].stream.counts.points, 50);
    for (axis, home) in state.axes.iter().zip(&home) {
        assert!((axis.position_set - home - 0.05).abs() < 5e-3, "{} from {home}", axis.position_set);
    }
    assert!(matches!(arm.stream().push_now(&[0.0; 5]), Err(StreamError::Count { given: 5, axes: 6 })));
    assert!(matches!(
        arm.stream().push_now(&[f64::NAN; 6]),
        Err(StreamError::Refused { axis: 0, reason: PointRefusal::NotFinite { .. }, .. })
    ));
    arm.stop(StopCategory::Two).unwrap();
    assert_eq!(arm.wait_for(Phase::Holding, PATIENCE), Ok(()));
}

#[test]
fn a_call_that_is_too_slow_by_the_real_clock_is_a_stop_that_says_by_how_much() {
    let joint = start("single-erob.toml");
    let options = CallbackOptions { budget: None, overruns_allowed: 3, follow: Some(Follow::Smooth) };
    let is_slow = Arc::new(AtomicBool::new(false));
    let slows = Arc::clone(&is_slow);
    let callback = joint.in_loop_with(options, move |_, _, _| {
        if slows.load(Ordering::Relaxed) {
            thread::sleep(Duration::from_micros(300));
        }
    });
    let callback = callback.unwrap();
    joint.advance(50).unwrap();
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
fn a_callback_that_does_not_return_ends_the_run_and_every_wait_and_moves_nothing_afterwards() {
    let arm = start("single-erob.toml");
    let is_held = Arc::new(AtomicBool::new(true));
    let (holding, mut calls) = (Arc::clone(&is_held), 0);
    // The call that does not return shall be the first one that anything comes of, on a busy computer too.
    let options = CallbackOptions { overruns_allowed: u32::MAX, ..CallbackOptions::default() };
    let callback = arm
        .in_loop_with(options, move |_, _, command| {
            command.velocity(0, 0.1);
            calls += 1;
            while calls > 50 && holding.load(Ordering::Relaxed) {
                std::hint::spin_loop();
            }
        })
        .unwrap();
    let waiting = arm.handle();
    let waited = thread::spawn(move || waiting.wait_for(Phase::Disabled, PATIENCE));
    assert_eq!(waited.join().unwrap(), Err(WaitError::Ended));
    assert_eq!(arm.stop(StopCategory::One), Err(CommandError::Ended));
    let stopped_at = arm.state();
    // The thread that was given up does not go on when the callback returns at last.
    is_held.store(false, Ordering::Relaxed);
    thread::sleep(Duration::from_millis(300));
    assert_eq!(arm.state().slot, stopped_at.slot);
    drop(callback);
    let session = arm.finish().unwrap();
    let Outcome::Stalled { after, told } = session.outcome else { panic!("{:?}", session.outcome) };
    assert!(after >= Duration::from_secs(1), "{after:?}");
    assert_eq!(told, ["the drives of can are simulated"]);
    assert_eq!(session.unreached, [0]);
}

#[test]
fn a_bring_up_that_is_asked_for_again_at_once_is_carried_out() {
    let config = config("arm6-erob.toml");
    let stuck = "[[fault]]\nkind = \"stuck-sdo\"\naxis = \"joint2\"\nwhen = \"enabled\"\nat = \"100 ms\"\nfor = \"8 s\"\n";
    let injector = FaultInjector::new(Scenario::parse("stuck", stuck, &config).unwrap());
    let options = SessionOptions { fault_injector: Some(Arc::new(injector)), ..SessionOptions::default() };
    let arm = Controller::start(config, options).unwrap();
    thread::sleep(Duration::from_millis(200));
    arm.disable().unwrap();
    arm.wait_for(Phase::Disabled, PATIENCE).unwrap();
    let mut failures = 0;
    while let Err(error) = arm.bring_up(PATIENCE) {
        assert!(matches!(error, RecoveryError::NotBroughtUp { .. }), "{error}");
        failures += 1;
    }
    assert!(failures > 1, "{failures}");
    arm.enable().unwrap();
    arm.wait_for(Phase::Holding, PATIENCE).unwrap();
}
