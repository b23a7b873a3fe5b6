//! What clients have handed over when a stop comes begins nothing after it, and a new stream begins empty.

use std::path::Path;
use std::time::Duration;

use takt::{
    CommandError, Config, MotionError, Phase, StopCategory, StreamError, StreamState, Trajectory,
    TrajectoryPoint, VirtualController,
};

const PATIENCE: Duration = Duration::from_secs(60);

fn simulated(name: &str) -> VirtualController {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name);
    VirtualController::start(&Config::load(&path).unwrap(), None).unwrap()
}

/// Streams for a while, so that the axes move.
fn stream_for_a_while(arm: &VirtualController) {
    arm.begin_stream().unwrap();
    for step in 0..60 {
        let mut pose = [0.0; 6];
        pose[0] = 0.003 * f64::from(step);
        arm.stream().push_now(&pose).unwrap();
        arm.advance(20).unwrap();
    }
}

fn joint(arm: &VirtualController) -> f64 {
    arm.state().axes()[0].position_set
}

#[test]
fn a_new_stream_carries_out_nothing_that_was_pushed_before_it() {
    let arm = simulated("arm6-erob.toml");
    stream_for_a_while(&arm);
    // A stop overtakes this one before the next cycle.
    let before = arm.stream().report().counts;
    arm.stream().push_now(&[0.18, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
    arm.stop(StopCategory::One).unwrap();
    arm.wait_for(Phase::Disabled, PATIENCE).unwrap();
    let after = arm.stream().report();
    assert_eq!(after.state, StreamState::Idle);
    assert_eq!((after.counts.points, after.counts.lost_points), (before.points + 1, before.lost_points + 1));
    arm.enable().unwrap();
    arm.wait_for(Phase::Holding, PATIENCE).unwrap();
    let home = arm.move_to(&[-0.5, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
    arm.wait(home, PATIENCE).unwrap();
    assert_eq!(arm.stream().push_now(&[0.0; 6]), Err(StreamError::NotStreaming));
    arm.begin_stream().unwrap();
    arm.pass(Duration::from_millis(800));
    assert_eq!(arm.stream().report().counts.points, 0);
    assert!((joint(&arm) + 0.5).abs() < 1e-9);
}

#[test]
fn points_are_taken_from_the_grant_of_a_stream_until_it_ends_and_refused_at_any_other_time() {
    let arm = simulated("arm6-erob.toml");
    let refused = |arm: &VirtualController| {
        let chunk = vec![[0.0; 6]; 4];
        let single = arm.stream().push_now(&[0.0; 6]);
        let chunk = arm.stream().push_chunk(arm.now_ns(), Duration::from_millis(10), &chunk);
        assert_eq!((single, chunk), (Err(StreamError::NotStreaming), Err(StreamError::NotStreaming)));
    };
    refused(&arm);
    for category in [StopCategory::Two, StopCategory::One] {
        arm.begin_stream().unwrap();
        assert_eq!(arm.stream().push_now(&[0.0; 6]), Ok(()), "right after the grant");
        arm.stop(category).unwrap();
        assert_eq!(arm.stream().push_now(&[0.0; 6]), Ok(()), "the stop has not been taken yet");
        arm.advance(1).unwrap();
        refused(&arm);
        arm.wait_for(if category == StopCategory::Two { Phase::Holding } else { Phase::Disabled }, PATIENCE)
            .unwrap();
        refused(&arm);
    }
    arm.enable().unwrap();
    arm.wait_for(Phase::Holding, PATIENCE).unwrap();
    let words = arm.stream().push_now(&[0.0; 6]).unwrap_err().to_string();
    assert_eq!(words, "no stream is running: begin one first; every stop ends it");
    let along = arm.in_loop(|_, _, command| (0..6).for_each(|axis| command.hold(axis))).unwrap();
    arm.advance(2).unwrap();
    refused(&arm);
    drop(along);
}

#[test]
fn a_stream_that_was_never_begun_or_ended_by_a_fault_takes_no_point() {
    let arm = simulated("arm6-erob.toml");
    arm.begin_stream().unwrap();
    // No point comes: the group stops by itself.
    arm.wait_until(PATIENCE, |state| state.groups()[0].stop).unwrap();
    assert_eq!(arm.stream().push_now(&[0.0; 6]), Err(StreamError::NotStreaming));
}

#[test]
fn each_group_takes_points_for_as_long_as_it_streams_itself() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/arm-and-gripper.toml");
    let mut config = Config::load(&path).unwrap();
    config.axes[3].control = config.axes[0].control;
    config.program.moves.retain(|program_move| program_move.group == 0);
    let controller = VirtualController::start(&config, None).unwrap();
    let (arm, gripper) = (controller.group("arm").unwrap(), controller.group("gripper").unwrap());
    arm.begin_stream().unwrap();
    assert_eq!(arm.stream().push_now(&[0.0; 3]), Ok(()));
    assert_eq!(gripper.stream().push_now(&[0.0]), Err(StreamError::NotStreaming));
    assert_eq!(controller.stream().push_now(&[0.0; 4]), Ok(()), "a group of it streams");
    arm.stop(StopCategory::Two).unwrap();
    controller.advance(1).unwrap();
    assert_eq!(controller.stream().push_now(&[0.0; 4]), Err(StreamError::NotStreaming));
}

#[test]
fn a_first_point_that_is_older_than_the_stream_can_lag_leads_nowhere() {
    let arm = simulated("arm6-erob.toml");
    arm.pass(Duration::from_secs(10));
    let home = joint(&arm);
    arm.begin_stream().unwrap();
    let old_ns = arm.now_ns() - 8_000_000_000;
    arm.stream().push(old_ns, &[home + 0.5; 6]).unwrap();
    arm.pass(Duration::from_millis(300));
    let report = arm.stream().report();
    assert_eq!((report.state, report.counts.points, report.counts.late_points), (StreamState::Awaited, 1, 1));
    assert_eq!(joint(&arm), home);
    arm.stream().push_now(&[home + 0.01; 6]).unwrap();
    arm.pass(Duration::from_millis(300));
    assert!(joint(&arm) > home);
}

#[test]
fn a_stop_overtakes_every_motion_that_waits() {
    let arm = simulated("arm6-erob.toml");
    let home = joint(&arm);
    let far = [home + 0.3, 0.0, 0.0, 0.0, 0.0, 0.0];
    // More than a cycle takes.
    let motions: Vec<_> = (0..20).map(|_| arm.move_to(&far).unwrap()).collect();
    arm.stop(StopCategory::Two).unwrap();
    arm.pass(Duration::from_secs(1));
    assert_eq!((joint(&arm), arm.state().groups()[0].phase), (home, Phase::Holding));
    for motion in motions {
        assert_eq!(arm.wait(motion, PATIENCE), Err(MotionError::Overtaken));
    }
    // And nothing of them is left behind.
    let again = arm.move_to(&far).unwrap();
    assert_eq!(arm.wait(again, PATIENCE), Ok(()));
}

#[test]
fn a_stop_overtakes_a_trajectory_that_is_still_computed() {
    let arm = simulated("arm6-erob.toml");
    let home: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set).collect();
    let positions: Vec<f64> = home.iter().map(|home| home + 0.05).collect();
    let points = [TrajectoryPoint { time_s: 2.0, positions, ..TrajectoryPoint::default() }];
    // Those before it do not concern it.
    arm.stop(StopCategory::Two).unwrap();
    arm.pass(Duration::from_millis(100));
    let along = arm.execute(&points).unwrap();
    arm.pass(Duration::from_millis(500));
    arm.stop(StopCategory::Two).unwrap();
    arm.wait_for(Phase::Holding, PATIENCE).unwrap();
    assert!(arm.wait(along, PATIENCE).is_err());
    let here = joint(&arm);
    let overtaken = arm.execute_with(|conditions| {
        arm.stop(StopCategory::Two).unwrap();
        Trajectory::new(&points, conditions)
    });
    assert_eq!(overtaken, Err(CommandError::Overtaken));
    arm.pass(Duration::from_secs(1));
    assert_eq!((joint(&arm), arm.state().groups()[0].phase), (here, Phase::Holding));
}
