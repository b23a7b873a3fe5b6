//! Trajectories by the handle of an embedded controller, on simulated buses in virtual time.

use std::path::Path;
use std::time::Duration;

use takt::trajectory::{RateError, TrajectoryError, TrajectoryPoint};
use takt::{CommandError, Config, Handle, MotionError, Outcome, Phase, StopCategory, VirtualController};

const PATIENCE: Duration = Duration::from_secs(30);

fn start() -> VirtualController {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/arm6-erob.toml");
    VirtualController::start(&Config::load(&path).unwrap(), None).unwrap()
}

/// All joints by so much from these positions. The fourth has no room in the other direction.
fn beside(positions: &[f64], way: f64) -> Vec<f64> {
    positions.iter().enumerate().map(|(joint, at)| if joint == 3 { at - way } else { at + way }).collect()
}

fn here(arm: &Handle) -> Vec<f64> {
    arm.state().axes[..6].iter().map(|axis| axis.position_set).collect()
}

/// All joints by so much from where they are, at this time.
fn point(arm: &Handle, time_s: f64, way: f64) -> TrajectoryPoint {
    TrajectoryPoint { time_s, positions: beside(&here(arm), way), ..TrajectoryPoint::default() }
}

#[test]
fn a_trajectory_is_carried_out_paused_slowed_down_resumed_and_replaced() {
    let arm = start();
    let home = here(&arm);
    let points = [point(&arm, 0.5, 0.1), point(&arm, 2.0, 0.3)];
    let motion = arm.execute(&points).unwrap();
    arm.pause(motion).unwrap();
    let at_rest =
        |arm: &Handle| arm.trajectory_progress(motion).unwrap().is_some_and(|progress| progress.rate == 0.0);
    arm.wait_until(PATIENCE, |_| at_rest(&arm).then_some(())).unwrap();
    let paused = arm.state();
    assert_eq!(paused.groups[0].phase, Phase::Moving);
    let progress = arm.trajectory_progress(motion).unwrap().unwrap();
    assert!(progress.path_s > 0.0 && progress.path_s < progress.of_s);
    assert_eq!(progress.of_s, 2.0);
    arm.set_speed(motion, 0.5).unwrap();
    assert!(at_rest(&arm), "it stays paused");
    arm.resume(motion).unwrap();
    arm.set_speed(motion, 1.0).unwrap();
    assert!(matches!(arm.set_speed(motion, 50.0), Err(CommandError::Rate(RateError::Limit { .. }))));
    assert!(matches!(arm.set_speed(motion, -1.0), Err(CommandError::Rate(RateError::NotARate { .. }))));
    assert_eq!(arm.wait(motion, PATIENCE), Ok(()));
    for (at, expected) in here(&arm).iter().zip(beside(&home, 0.3)) {
        assert!((at - expected).abs() < 1e-12);
    }
    assert_eq!(arm.pause(motion), Err(CommandError::NoTrajectory));

    let first = arm.execute(&[point(&arm, 3.0, -0.3)]).unwrap();
    let second = arm.execute(&[point(&arm, 1.5, 0.0)]).unwrap();
    assert_eq!(arm.wait(first, PATIENCE), Err(MotionError::Replaced));
    assert_eq!(arm.wait(second, PATIENCE), Ok(()));
    assert_eq!((arm.state().groups[0].phase, arm.state().groups[0].stop), (Phase::Holding, None));
    assert_eq!(arm.finish(), Outcome::Finished);
}

#[test]
fn speed_0_pauses_and_what_no_resume_could_carry_out_is_refused_before_it() {
    let arm = start();
    let home = here(&arm);
    let motion = arm.execute(&[point(&arm, 2.0, 0.3)]).unwrap();
    arm.set_speed(motion, 0.0).unwrap();
    let rate = |arm: &Handle| arm.trajectory_progress(motion).unwrap().map(|progress| progress.rate);
    arm.wait_until(PATIENCE, |_| (rate(&arm) == Some(0.0)).then_some(())).unwrap();
    assert!(matches!(arm.set_speed(motion, 50.0), Err(CommandError::Rate(RateError::Limit { .. }))));
    arm.resume(motion).unwrap();
    assert_eq!(arm.wait(motion, PATIENCE), Ok(()));
    for (at, expected) in here(&arm).iter().zip(beside(&home, 0.3)) {
        assert!((at - expected).abs() < 1e-12);
    }
}

#[test]
fn what_breaks_a_limit_is_refused_before_anything_moves_and_a_stop_ends_what_moves() {
    let arm = start();
    let before = arm.state().axes;
    let refused = arm.execute(&[point(&arm, 1.0, 0.1), point(&arm, 1.1, 0.6)]).unwrap_err();
    let CommandError::Trajectory(TrajectoryError::Limit { point: number, axis, .. }) = refused else {
        panic!("{refused}")
    };
    assert_eq!((number, axis), (1, 0));
    assert!(refused.to_string().starts_with("point 1, axis 0: velocity 5"), "{refused}");
    let refused = arm.execute(&[point(&arm, 0.0, 0.1), point(&arm, 1.0, 0.2)]).unwrap_err();
    assert!(matches!(refused, CommandError::Trajectory(TrajectoryError::Start { .. })));
    for (now, before) in arm.state().axes.iter().zip(before) {
        assert_eq!(now.position_set, before.position_set);
    }
    let motion = arm.execute(&[point(&arm, 5.0, 0.3)]).unwrap();
    arm.stop(StopCategory::Two).unwrap();
    assert!(matches!(arm.wait(motion, PATIENCE), Err(MotionError::Stopped(_))));
    arm.wait_for(Phase::Holding, PATIENCE).unwrap();
    // More of them than can be under way at once.
    for _ in 0..40 {
        let motion = arm.execute(&[point(&arm, 0.05, 0.0)]).unwrap();
        assert_eq!(arm.wait(motion, PATIENCE), Ok(()));
    }
    assert_eq!(arm.finish(), Outcome::Finished);
}

#[test]
fn waypoints_are_passed_by_the_handle_too() {
    let arm = start();
    let from = here(&arm);
    let waypoints = [0.1, 0.25, 0.3].map(|way| beside(&from, way));
    let motion = arm.move_through(&waypoints).unwrap();
    assert_eq!(arm.wait(motion, PATIENCE), Ok(()));
    assert!((here(&arm)[5] - from[5] - 0.3).abs() < 1e-12);
    // In motion it goes on from there.
    let first = arm.move_through(std::slice::from_ref(&from)).unwrap();
    let second = arm.move_through(&waypoints).unwrap();
    assert_eq!(arm.wait(first, PATIENCE), Err(MotionError::Replaced));
    assert_eq!(arm.wait(second, PATIENCE), Ok(()));
    assert!((here(&arm)[5] - from[5] - 0.3).abs() < 1e-12);
    assert_eq!(arm.finish(), Outcome::Finished);
}
