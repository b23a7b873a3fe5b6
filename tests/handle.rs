//! The controller as a program embeds it, on simulated buses in real time.

use std::path::Path;
use std::time::Duration;

use takt::plan::State;
use takt::rt::RequestKind;
use takt::{
    CommandError, Config, Controller, MotionError, MoveOptions, Outcome, Phase, Rule, SessionOptions,
    StartFailure, StopCategory,
};

const PATIENCE: Duration = Duration::from_secs(30);

fn start(name: &str) -> Controller {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name);
    let mut config = Config::load(&path).unwrap();
    config.telemetry.is_recorded = false;
    config.telemetry.black_box_ns = None;
    Controller::start(config, SessionOptions::default()).unwrap()
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
fn an_impossible_command_is_an_error_before_it_is_sent() {
    let arm = start("erob-modes/erob-pv.toml");
    assert_eq!(arm.move_to(&[0.0, 0.0]), Err(CommandError::Count { given: 2, axes: 1 }));
    assert!(matches!(arm.torque(0, 1.0, PATIENCE), Err(CommandError::WrongMode { .. })));
    assert!(matches!(arm.velocity(0, 99.0, PATIENCE), Err(CommandError::OutsideLimits { .. })));
    assert!(matches!(arm.velocity(0, f64::NAN, PATIENCE), Err(CommandError::OutsideLimits { .. })));
    assert_eq!(arm.velocity(7, 0.1, PATIENCE), Err(CommandError::NoSuchAxis { axis: 7, axes: 1 }));
    assert_eq!((arm.state().phase, arm.state().stop), (Phase::Holding, None));
}

#[test]
fn a_velocity_is_reached_and_ended_and_an_expired_one_stops_the_group() {
    let joint = start("erob-modes/erob-pv.toml");
    let going = joint.velocity(0, 0.5, PATIENCE).unwrap();
    assert_eq!(joint.wait(going, PATIENCE), Ok(()));
    assert_eq!(joint.state().phase, Phase::Moving);
    let ending = joint.velocity(0, 0.0, PATIENCE).unwrap();
    assert_eq!(joint.wait(ending, PATIENCE), Ok(()));
    joint.velocity(0, 0.2, Duration::from_millis(300)).unwrap();
    let _ = joint.wait_for(Phase::Stopping, PATIENCE);
    assert_eq!(joint.wait_for(Phase::Holding, PATIENCE), Ok(()));
    assert_eq!(joint.state().stop.map(|stop| stop.rule()), Some(Rule::StaleCommand));
}

#[test]
fn after_a_fault_each_request_is_refused_with_the_reason_until_the_fault_is_reset() {
    let joint = start("single-erob.toml");
    joint.begin_stream().unwrap();
    let far = State { position: 1.0, ..State::default() };
    joint.stream(&[far], PATIENCE).unwrap();
    let begun = std::time::Instant::now();
    while joint.state().stop.is_none() && begun.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(joint.state().stop.map(|stop| stop.rule()), Some(Rule::StartPose));
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
    let stop = joint.state().stop.unwrap();
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
