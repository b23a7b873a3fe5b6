//! The controller as a program embeds it, on simulated buses in real time.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use takt::config::{Feedback, Follow};
use takt::rt::RequestKind;
use takt::rt::linux::{Policy, Step};
use takt::{
    AxisPoint, CommandError, Config, Controller, DriveState, Event, EventKind, Events, Handle, MotionError,
    MoveOptions, OperationMode, Outcome, Phase, PointRefusal, Rule, SessionOptions, Snapshot, StartFailure,
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
fn an_arm_is_moved_by_calls_and_shut_down() {
    let arm = start("arm6-erob.toml");
    let home: Vec<f64> = arm.state().axes[..6].iter().map(|axis| axis.position_set).collect();
    let target: Vec<f64> = home.iter().map(|position| position + 0.05).collect();
    let options = MoveOptions { velocity_scale: 0.5, ..MoveOptions::default() };
    let motion = arm.move_with(&target, options).unwrap();
    assert_eq!(arm.wait(motion, PATIENCE), Ok(()));
    for (axis, target) in arm.state().axes.iter().zip(&target) {
        assert!((axis.position_set - target).abs() < 1e-9);
    }
    assert_eq!(arm.finish().unwrap().outcome, Outcome::Finished);
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
fn an_impossible_command_is_an_error_before_it_is_sent() {
    let arm = start("erob-modes/erob-pv.toml");
    assert_eq!(arm.move_to(&[0.0, 0.0]), Err(CommandError::Count { given: 2, axes: 1 }));
    assert!(matches!(arm.torque(0, 1.0, PATIENCE), Err(CommandError::WrongMode { .. })));
    assert!(matches!(arm.velocity(0, 99.0, PATIENCE), Err(CommandError::OutsideLimits { .. })));
    assert!(matches!(arm.velocity(0, f64::NAN, PATIENCE), Err(CommandError::OutsideLimits { .. })));
    assert_eq!(arm.velocity(7, 0.1, PATIENCE), Err(CommandError::NoSuchAxis { axis: 7, axes: 1 }));
    assert_eq!((arm.state().groups[0].phase, arm.state().groups[0].stop), (Phase::Holding, None));
}

#[test]
fn a_velocity_is_reached_and_ended_and_an_expired_one_stops_the_group() {
    let joint = start("erob-modes/erob-pv.toml");
    let going = joint.velocity(0, 0.5, PATIENCE).unwrap();
    assert_eq!(joint.wait(going, PATIENCE), Ok(()));
    assert_eq!(joint.state().groups[0].phase, Phase::Moving);
    let ending = joint.velocity(0, 0.0, PATIENCE).unwrap();
    assert_eq!(joint.wait(ending, PATIENCE), Ok(()));
    joint.velocity(0, 0.2, Duration::from_millis(300)).unwrap();
    let _ = joint.wait_for(Phase::Stopping, PATIENCE);
    assert_eq!(joint.wait_for(Phase::Holding, PATIENCE), Ok(()));
    assert_eq!(joint.state().groups[0].stop.map(|stop| stop.rule()), Some(Rule::StaleCommand));
}

#[test]
fn after_a_fault_each_request_is_refused_with_the_reason_until_the_fault_is_reset() {
    let mut config = config("single-erob.toml");
    config.axes[0].follow = Follow::Exact;
    let joint = Controller::start(config, SessionOptions::default()).unwrap();
    joint.begin_stream().unwrap();
    joint.stream().push_now(&[1.0]).unwrap();
    let begun = std::time::Instant::now();
    while joint.state().groups[0].stop.is_none() && begun.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(joint.state().groups[0].stop.map(|stop| stop.rule()), Some(Rule::StartPose));
    assert_eq!(joint.wait_for(Phase::Holding, PATIENCE), Ok(()));
    let refused = joint.move_to(&[0.2]).unwrap();
    let Err(MotionError::Refused(refused)) = joint.wait(refused, PATIENCE) else { panic!("it was granted") };
    assert_eq!(
        refused.to_string(),
        "the move was rejected while holding: the group has stopped for a fault of joint (start_pose), which must be \
         reset first"
    );
    let Err(CommandError::Refused(refused)) = joint.begin_stream() else { panic!("it was granted") };
    assert_eq!(refused.refusal.map(|refusal| refusal.request), Some(RequestKind::Stream));
    let Err(CommandError::Refused(refused)) = joint.enable() else { panic!("it was granted") };
    assert_eq!(refused.to_string(), "enabling was rejected: not possible while holding");
    joint.reset_faults().unwrap();
    let motion = joint.move_to(&[0.2]).unwrap();
    assert!(matches!(joint.reset_faults(), Err(CommandError::Refused(_))), "it moves");
    assert_eq!(joint.wait(motion, PATIENCE), Ok(()));
    let slowly = MoveOptions { velocity_scale: 0.02, ..MoveOptions::default() };
    let motion = joint.move_with(&[-0.2], slowly).unwrap();
    assert_eq!(joint.wait_for(Phase::Moving, PATIENCE), Ok(()));
    joint.stop(StopCategory::One).unwrap();
    let stopped = joint.wait(motion, PATIENCE).unwrap_err();
    assert_eq!(
        stopped.to_string(),
        "the group has stopped: a stop was requested while moving; category 1: decelerated, then power removed"
    );
    assert_eq!(joint.wait_for(Phase::Disabled, PATIENCE), Ok(()));
    joint.enable().unwrap();
    assert_eq!(joint.wait_for(Phase::Holding, PATIENCE), Ok(()));
}

/// Four requests are handled in a cycle. A stop behind so many would begin half a minute after its request.
const FLOOD: usize = 100_000;

#[test]
fn a_stop_does_not_wait_behind_a_flood_of_requests() {
    let joint = start("single-erob.toml");
    let mut accepted = 0;
    for number in 0..FLOOD {
        match joint.move_to(&[0.2 + 0.1 * (number % 2) as f64]) {
            Ok(_) => accepted += 1,
            Err(error) => assert!(matches!(error, CommandError::Full { .. }), "{error}"),
        }
    }
    assert!(accepted < FLOOD, "the number of waiting requests is bounded");
    let last = loop {
        if let Ok(motion) = joint.move_to(&[0.4]) {
            break motion;
        }
    };
    let slot = joint.state().slot;
    joint.stop(StopCategory::One).unwrap();
    assert_eq!(joint.wait_for(Phase::Disabled, PATIENCE), Ok(()));
    let stop = joint.state().groups[0].stop.unwrap();
    assert_eq!((stop.rule(), stop.category), (Rule::Requested, StopCategory::One));
    assert!(stop.slot - slot < 2_000, "{} slots after its request", stop.slot - slot);
    assert!(joint.wait(last, PATIENCE).is_err());
    assert_eq!(joint.finish().unwrap().outcome, Outcome::Finished);
}

/// The number of stops, each followed by a motion.
const STOPS_BEFORE_MOTIONS: u64 = 200;

#[test]
fn a_stop_that_was_requested_before_a_motion_is_never_the_result_of_the_motion() {
    let joint = start("single-erob.toml");
    let home = joint.state().axes[0].position_set;
    for number in 0..STOPS_BEFORE_MOTIONS {
        joint.stop(StopCategory::Two).unwrap();
        // From 0 to 5 ms, in steps that are not multiples of the cycle.
        std::thread::sleep(Duration::from_micros(number * 1_700 % 5_000));
        let target = home + if number % 2 == 0 { 1e-3 } else { 0.0 };
        let motion = joint.move_to(&[target]).unwrap();
        assert_eq!(joint.wait(motion, PATIENCE), Ok(()), "try {number}");
    }
}

#[test]
fn each_wait_returns_the_result_of_its_own_motion() {
    let joint = start("single-erob.toml");
    let slowly = MoveOptions { velocity_scale: 0.02, ..MoveOptions::default() };
    let replaced = joint.move_with(&[0.5], slowly).unwrap();
    assert_eq!(joint.wait_for(Phase::Moving, PATIENCE), Ok(()));
    let arrived = joint.move_to(&[0.1]).unwrap();
    assert_eq!(joint.wait(replaced, PATIENCE), Err(MotionError::Replaced));
    assert_eq!(joint.wait(arrived, PATIENCE), Ok(()));
    let stopped = joint.move_with(&[0.5], slowly).unwrap();
    assert_eq!(joint.wait_for(Phase::Moving, PATIENCE), Ok(()));
    joint.stop(StopCategory::Two).unwrap();
    let why = joint.wait(stopped, PATIENCE);
    assert!(
        matches!(&why, Err(MotionError::Stopped(stopped)) if stopped.reason.rule() == Rule::Requested),
        "{why:?}"
    );
    assert_eq!(joint.wait_for(Phase::Holding, PATIENCE), Ok(()));
    let last = joint.move_to(&[0.1]).unwrap();
    assert_eq!(joint.wait(last, PATIENCE), Ok(()));
    // The results of the earlier motions are still the same.
    assert_eq!(joint.wait(replaced, PATIENCE), Err(MotionError::Replaced));
    assert_eq!(joint.wait(arrived, PATIENCE), Ok(()));
    assert_eq!(joint.wait(stopped, PATIENCE), why);
}

#[test]
fn drives_that_cannot_be_brought_up_are_named() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/single-erob.toml");
    let mut config = Config::load(&path).unwrap();
    config.telemetry.is_recorded = false;
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

/// Sends moves that the real-time thread rejects, until so many were accepted into the queue.
fn send_rejected_moves(handle: &Handle, count: usize) {
    let too_fast = MoveOptions { velocity_scale: 2.0, ..MoveOptions::default() };
    let mut sent = 0;
    while sent < count {
        match handle.move_with(&[0.0], too_fast) {
            Ok(_) => sent += 1,
            Err(error) => {
                assert!(matches!(error, CommandError::Full { .. }), "{error}");
                std::thread::sleep(Duration::from_millis(1));
            }
        }
    }
}

fn rejections(events: &mut Events) -> usize {
    events.filter(|event| matches!(event.kind, EventKind::Rejected(_))).count()
}

#[test]
fn each_observer_gets_every_event_or_the_number_of_those_that_it_was_too_slow_for() {
    const REJECTED: usize = 3_000;
    let joint = start("single-erob.toml");
    let (mut quick, mut slow) = (joint.events(), joint.events());
    let sending = {
        let handle = joint.handle();
        std::thread::spawn(move || send_rejected_moves(&handle, REJECTED))
    };
    let mut seen = 0;
    while seen < REJECTED {
        let event = quick.wait(PATIENCE).unwrap();
        if let EventKind::Rejected(rejected) = event.kind {
            assert_eq!(rejected.request, RequestKind::Move);
            assert!(quick.words(&event).starts_with("the move was rejected"), "{}", quick.words(&event));
            seen += 1;
        }
    }
    sending.join().unwrap();
    assert_eq!(quick.missed(), 0);
    let late = rejections(&mut slow);
    assert!(late < REJECTED && slow.missed() > 0, "{late} seen and {} missed", slow.missed());
    assert!(late as u64 + slow.missed() >= REJECTED as u64);
    joint.finish().unwrap();
    // The stop at the end and the changes of phase are there after the end, and then the observer is told of the end.
    let rest: Vec<EventKind> = quick.by_ref().map(|event| event.kind).collect();
    assert!(rest.iter().any(|kind| matches!(kind, EventKind::PhaseChanged { to: Phase::Disabled, .. })));
    assert_eq!(quick.wait(PATIENCE), Err(WaitError::Ended));
}

#[test]
fn a_handle_says_after_the_end_that_the_controller_has_ended() {
    let joint = start("single-erob.toml");
    let handle = joint.handle();
    let motion = handle.move_to(&[0.1]).unwrap();
    assert_eq!(handle.wait(motion, PATIENCE), Ok(()));
    assert!(!handle.has_ended());
    assert_eq!(joint.finish().unwrap().outcome, Outcome::Finished);
    assert!(handle.has_ended());
    assert_eq!(handle.move_to(&[0.0]), Err(CommandError::Ended));
    assert_eq!(handle.stop(StopCategory::Zero), Err(CommandError::Ended));
    let answers = [handle.disable(), handle.enable(), handle.reset_faults(), handle.begin_stream()];
    assert_eq!(answers, [const { Err(CommandError::Ended) }; 4]);
    assert_eq!(handle.stream().push_now(&[0.0]), Err(StreamError::Ended));
    assert_eq!(handle.next_cycle(PATIENCE).err(), Some(WaitError::Ended));
    assert_eq!(handle.wait_for(Phase::Moving, PATIENCE), Err(WaitError::Ended));
    // What was before the end is still known.
    assert_eq!(handle.wait(motion, PATIENCE), Ok(()));
    assert_eq!(handle.wait_for(Phase::Disabled, PATIENCE), Ok(()));
}

#[test]
fn a_motion_that_the_end_cuts_off_is_stopped_for_whoever_waits_for_it() {
    let joint = start("single-erob.toml");
    let slowly = MoveOptions { velocity_scale: 0.02, ..MoveOptions::default() };
    let motion = joint.move_with(&[1.0], slowly).unwrap();
    assert_eq!(joint.wait_for(Phase::Moving, PATIENCE), Ok(()));
    let waiting = {
        let handle = joint.handle();
        std::thread::spawn(move || handle.wait(motion, PATIENCE))
    };
    drop(joint);
    let result = waiting.join().unwrap();
    assert!(matches!(result, Err(MotionError::Stopped(_))), "{result:?}");
}

#[test]
fn a_signal_handler_stops_the_motion() {
    let joint = start("single-erob.toml");
    let handle = joint.handle();
    let stop = move || {
        let _ = handle.stop(StopCategory::Two);
    };
    // SAFETY: a stop is a few atomic operations. It takes no lock and allocates nothing.
    let registered = unsafe { signal_hook::low_level::register(signal_hook::consts::SIGUSR1, stop) };
    let slowly = MoveOptions { velocity_scale: 0.02, ..MoveOptions::default() };
    for _ in 0..20 {
        let motion = joint.move_with(&[1.0], slowly).unwrap();
        assert_eq!(joint.wait_for(Phase::Moving, PATIENCE), Ok(()));
        signal_hook::low_level::raise(signal_hook::consts::SIGUSR1).unwrap();
        let result = joint.wait(motion, PATIENCE);
        assert!(matches!(result, Err(MotionError::Stopped(_))), "{result:?}");
        assert_eq!(joint.wait_for(Phase::Holding, PATIENCE), Ok(()));
    }
    signal_hook::low_level::unregister(registered.unwrap());
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
fn everything_that_a_drive_reports_is_in_the_state_with_the_time_that_it_is_from() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/single-erob.toml");
    let mut config = Config::load(&path).unwrap();
    config.telemetry.is_recorded = false;
    config.axes[0].feedback = vec![Feedback::OperationMode, Feedback::Torque, Feedback::Current];
    let joint = Controller::start(config, SessionOptions::default()).unwrap();
    let motion = joint.move_to(&[0.5]).unwrap();
    let is_fast = |state: &Snapshot| (state.axes[0].velocity_set > 0.3).then_some(*state);
    let state = joint.wait_until(PATIENCE, is_fast).unwrap();
    let axis = &state.axes()[0];
    assert!((axis.velocity - axis.velocity_set).abs() < 0.2 && axis.following_error.abs() < 0.1, "{axis:?}");
    assert!(axis.torque.is_some_and(|torque| torque != 0.0) && axis.current_per_mille.is_some(), "{axis:?}");
    assert_eq!((axis.mode, axis.drive_state), (Some(8), DriveState::OperationEnabled));
    assert_eq!((axis.is_stale(), axis.feedback_slot), (false, state.slot));
    let age_ns = axis.feedback_age_ns(state.at_ns).unwrap();
    assert!(age_ns < 1_000_000, "{age_ns} ns");
    assert_eq!(joint.wait(motion, PATIENCE), Ok(()));
}

#[test]
fn a_mode_is_changed_while_the_joint_is_disabled_and_what_cannot_be_is_refused_in_words() {
    let joint = start("erob-modes/erob-changing.toml");
    let torque = [AxisPoint::Torque(0.0)];
    let refused = |mode: OperationMode| {
        let change = joint.change_mode(mode).unwrap();
        match joint.wait(change, PATIENCE) {
            Err(MotionError::Refused(refused)) => refused.to_string(),
            other => panic!("{other:?}"),
        }
    };
    let words = refused(OperationMode::CyclicSynchronousTorque);
    assert!(words.contains("the drive of joint must be disabled for it"), "{words}");
    let words = refused(OperationMode::ProfilePosition);
    assert!(words.contains("joint cannot be in mode 1 (profile position)"), "{words}");
    let csv = OperationMode::CyclicSynchronousVelocity;
    assert_eq!(joint.change_axis_mode(7, csv), Err(CommandError::NoSuchAxis { axis: 7, axes: 1 }));
    let in_csp = joint.stream().push_now(&torque).unwrap_err().to_string();
    assert!(in_csp.contains("CyclicSynchronousPosition"), "{in_csp}");

    joint.disable().unwrap();
    joint.wait_for(Phase::Disabled, PATIENCE).unwrap();
    let change = joint.change_axis_mode(0, OperationMode::CyclicSynchronousTorque).unwrap();
    assert_eq!(joint.wait(change, PATIENCE), Ok(()));
    let axis = joint.state().axes[0];
    assert_eq!((axis.mode, axis.mode_set), (Some(10), 10));
    joint.enable().unwrap();
    joint.wait_for(Phase::Holding, PATIENCE).unwrap();
    // What a point may ask for is what the present mode takes.
    assert_eq!(joint.stream().push_now(&torque), Ok(()));
    let motion = joint.move_to(&[0.3]).unwrap();
    assert_eq!(joint.wait(motion, PATIENCE), Ok(()));
    assert_eq!(joint.finish().unwrap().outcome, Outcome::Finished);
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
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/single-erob.toml");
    let mut config = Config::load(&path).unwrap();
    config.telemetry.is_recorded = true;
    config.telemetry.black_box_ns = None;
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
    std::thread::scope(|scope| {
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
                    std::thread::sleep(Duration::from_millis(37));
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

/// What `main` prints of an error.
fn printed(error: impl Into<takt::Error>) -> String {
    let error: takt::Error = error.into();
    format!("{error:?}")
}

#[test]
fn main_prints_errors_as_sentences_and_a_wrong_file_with_its_lines() {
    let text = include_str!("../../configs/single-erob.toml").replace("node = 1\n", "node = 1000\n");
    let wrong = printed(Config::parse("joint.toml", &text).unwrap_err());
    assert!(
        wrong.contains("joint.toml:") && wrong.contains("node = 1000") && wrong.contains("1 to 127"),
        "{wrong}"
    );
    assert!(wrong.len() < 1_000 && !wrong.contains("ConfigError"), "{wrong}");

    let mut config = Config::parse("joint.toml", include_str!("../../configs/single-erob.toml")).unwrap();
    config.axes[0].node = 200;
    let field = printed(Controller::start(config, SessionOptions::default()).err().unwrap());
    assert!(field.contains("`axis.node` cannot be 200") && field.len() < 1_000, "{field}");

    let joint = start("single-erob.toml");
    let count = joint.move_to(&[0.0, 0.0]).unwrap_err();
    assert_eq!(printed(count.clone()), count.to_string());
    assert_eq!(printed(WaitError::Ended), "the controller has ended");
    assert_eq!(format!("{:?}", MotionError::Replaced), "a later motion has replaced the motion");
}

#[test]
fn points_from_two_threads_are_followed_and_the_end_of_them_is_reported() {
    let arm = start("arm6-erob.toml");
    let home: Vec<f64> = arm.state().axes[..6].iter().map(|axis| axis.position_set).collect();
    arm.begin_stream().unwrap();
    let begun_ns = arm.now_ns();
    // Each thread has every second point of a slow ramp of 20 ms steps.
    std::thread::scope(|scope| {
        for half in 0..2 {
            let (stream, home) = (arm.stream(), &home);
            scope.spawn(move || {
                for number in (half..50).step_by(2) {
                    let point: Vec<f64> = home.iter().map(|axis| axis + 0.001 * number as f64).collect();
                    stream.push(begun_ns + 20_000_000 * (number + 5), &point).unwrap();
                    std::thread::sleep(Duration::from_millis(40));
                }
            });
        }
    });
    let begun = std::time::Instant::now();
    while arm.stream().report().state != StreamState::Dry {
        assert!(begun.elapsed() < PATIENCE, "{:?}", arm.stream().report());
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::sleep(Duration::from_millis(300));
    let state = arm.state();
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
