//! The handle of an embedded controller, on simulated buses in virtual time. What only real time has is in `real_time`.

use std::path::Path;
use std::time::Duration;

use takt::config::{Feedback, Follow};
use takt::rt::RequestKind;
use takt::{
    AxisPoint, CommandError, Config, DriveState, EventKind, Events, MotionError, MoveOptions, OperationMode,
    Outcome, Phase, Rule, Snapshot, StopCategory, StreamError, VirtualController, WaitError,
};

const PATIENCE: Duration = Duration::from_secs(30);

fn config(name: &str) -> Config {
    Config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name)).unwrap()
}

fn start(name: &str) -> VirtualController {
    VirtualController::start(&config(name), None).unwrap()
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
    assert_eq!(arm.finish(), Outcome::Finished);
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
    let joint = VirtualController::start(&config, None).unwrap();
    joint.begin_stream().unwrap();
    joint.stream().push_now(&[1.0]).unwrap();
    let stop = joint.wait_until(PATIENCE, |state| state.groups[0].stop).unwrap();
    assert_eq!(stop.rule(), Rule::StartPose);
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
        "the group has stopped: a stop was requested while moving; category 1: decelerate, then remove power"
    );
    assert_eq!(joint.wait_for(Phase::Disabled, PATIENCE), Ok(()));
    joint.enable().unwrap();
    assert_eq!(joint.wait_for(Phase::Holding, PATIENCE), Ok(()));
}

/// Four requests are handled in a cycle.
const CYCLES_OF_A_STOP: u64 = 4;

#[test]
fn a_stop_does_not_wait_behind_a_flood_of_requests() {
    let joint = start("single-erob.toml");
    let moves: Vec<_> = (0..100_000_u32)
        .map_while(|number| joint.move_to(&[0.2 + 0.1 * f64::from(number % 2)]).ok())
        .collect();
    assert!(matches!(joint.move_to(&[0.4]), Err(CommandError::Full { .. })));
    // Handled in their order, they would take longer than a stop may.
    assert!(moves.len() as u64 > 8 * CYCLES_OF_A_STOP, "{} requests wait", moves.len());
    let slot = joint.state().slot;
    joint.stop(StopCategory::One).unwrap();
    assert_eq!(joint.wait_for(Phase::Disabled, PATIENCE), Ok(()));
    let stop = joint.state().groups[0].stop.unwrap();
    assert_eq!((stop.rule(), stop.category), (Rule::Requested, StopCategory::One));
    assert!(stop.slot - slot < CYCLES_OF_A_STOP, "{} slots after its request", stop.slot - slot);
    assert!(joint.wait(moves[moves.len() - 1], PATIENCE).is_err());
    assert_eq!(joint.finish(), Outcome::Finished);
}

/// `tests/loom/tests/client_requests.rs` has the same for threads that interleave in any order.
#[test]
fn a_stop_that_was_requested_before_a_motion_is_never_the_result_of_the_motion() {
    let joint = start("single-erob.toml");
    let home = joint.state().axes[0].position_set;
    for cycles in 0..10 {
        joint.stop(StopCategory::Two).unwrap();
        joint.step(cycles);
        let target = home + if cycles % 2 == 0 { 1e-3 } else { 0.0 };
        let motion = joint.move_to(&[target]).unwrap();
        assert_eq!(joint.wait(motion, PATIENCE), Ok(()), "{cycles} cycles between them");
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

fn rejections(events: &mut Events) -> usize {
    events.filter(|event| matches!(event.kind, EventKind::Rejected(_))).count()
}

#[test]
fn each_observer_gets_every_event_or_the_number_of_those_that_it_was_too_slow_for() {
    const REJECTED: usize = 3_000;
    let joint = start("single-erob.toml");
    let (mut quick, mut slow) = (joint.events(), joint.events());
    let too_fast = MoveOptions { velocity_scale: 2.0, ..MoveOptions::default() };
    let (mut sent, mut seen) = (0, 0);
    while seen < REJECTED {
        while sent < REJECTED && joint.move_with(&[0.0], too_fast).is_ok() {
            sent += 1;
        }
        let event = quick.wait(PATIENCE).unwrap();
        if let EventKind::Rejected(rejected) = event.kind {
            assert_eq!(rejected.request, RequestKind::Move);
            assert!(quick.words(&event).starts_with("the move was rejected"), "{}", quick.words(&event));
            seen += 1;
        }
    }
    assert_eq!(quick.missed(), 0);
    let late = rejections(&mut slow);
    assert!(late < REJECTED && slow.missed() > 0, "{late} seen and {} missed", slow.missed());
    assert!(late as u64 + slow.missed() >= REJECTED as u64);
    joint.finish();
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
    assert_eq!(joint.finish(), Outcome::Finished);
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
fn everything_that_a_drive_reports_is_in_the_state_with_the_time_that_it_is_from() {
    let mut config = config("single-erob.toml");
    config.axes[0].feedback = vec![Feedback::OperationMode, Feedback::Torque, Feedback::Current];
    let joint = VirtualController::start(&config, None).unwrap();
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
    joint.begin_stream().unwrap();
    assert_eq!(joint.stream().push_now(&torque), Ok(()));
    joint.stop(StopCategory::Two).unwrap();
    joint.wait_for(Phase::Holding, PATIENCE).unwrap();
    let motion = joint.move_to(&[0.3]).unwrap();
    assert_eq!(joint.wait(motion, PATIENCE), Ok(()));
    assert_eq!(joint.finish(), Outcome::Finished);
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
    let field = printed(VirtualController::start(&config, None).err().unwrap());
    assert!(field.contains("`axis.node` cannot be 200") && field.len() < 1_000, "{field}");

    let joint = start("single-erob.toml");
    let count = joint.move_to(&[0.0, 0.0]).unwrap_err();
    assert_eq!(printed(count.clone()), count.to_string());
    assert_eq!(printed(WaitError::Ended), "the controller has ended");
    assert_eq!(format!("{:?}", MotionError::Replaced), "a later motion has replaced the motion");
}
