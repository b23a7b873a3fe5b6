//! A gripper beside an arm, from a program: `configs/arm-and-gripper.toml`.

use std::path::Path;
use std::time::Duration;

use takt::controller::VirtualRun;
use takt::controller::{MotionError, Outcome};
use takt::{CommandError, Config, Controller, SessionOptions};
use takt_rt::{EventKind, Phase, Rule, StopCategory};

const LONG: Duration = Duration::from_secs(20);

fn config() -> Config {
    let mut config = Config::load(Path::new("configs/arm-and-gripper.toml")).unwrap();
    config.telemetry.is_recorded = false;
    config.telemetry.black_box_ns = None;
    config
}

#[test]
fn the_program_moves_the_arm_while_the_gripper_opens_and_closes() {
    let config = config();
    let mut run = VirtualRun::simulated(&config).unwrap().0;
    let mut both = 0;
    let outcome = run.run(60_000, |run| {
        let phases: Vec<Phase> = run.snapshot().groups().iter().map(|group| group.phase).collect();
        both += u32::from(phases == [Phase::Moving; 2]);
    });
    assert_eq!(outcome, Some(Outcome::Finished));
    assert!(both > 500, "only {both} cycles in which both moved");
    let targets = run.supervisor().targets();
    assert_eq!(targets, [Some(0.0), Some(0.0), Some(0.0), None]);
}

#[test]
fn a_torque_that_expires_stops_the_gripper_and_the_arm_arrives() {
    let controller = Controller::start(config(), SessionOptions::default()).unwrap();
    let (arm, gripper) = (controller.group("arm").unwrap(), controller.group("gripper").unwrap());
    let mut events = controller.events();
    let motion = arm.move_to(&[0.6, -0.3, 0.4]).unwrap();
    controller.torque(3, 1.0, Duration::from_millis(50)).unwrap();
    gripper.wait_for(Phase::Disabled, LONG).unwrap();
    assert_eq!(gripper.state().stop.unwrap().rule(), Rule::StaleCommand);
    controller.wait(motion, LONG).unwrap();
    assert_eq!((arm.state().phase, arm.state().stop), (Phase::Holding, None));
    let mut stops = Vec::new();
    for event in &mut events {
        if matches!(event.kind, EventKind::Stop(_)) {
            stops.push(event);
        }
    }
    assert!(matches!(stops[..], [stop] if stop.group == Some(1)), "{stops:?}");
    assert!(events.words(&stops[0]).starts_with("gripper: stop: "), "{}", events.words(&stops[0]));

    gripper.reset_faults().unwrap();
    gripper.enable().unwrap();
    gripper.wait_for(Phase::Holding, LONG).unwrap();
    let session = controller.finish().unwrap();
    assert_eq!(session.outcome, Outcome::Finished);
}

#[test]
fn a_stop_of_the_arm_stops_the_gripper_too_and_not_the_other_way_round() {
    let controller = Controller::start(config(), SessionOptions::default()).unwrap();
    let (arm, gripper) = (controller.group("arm").unwrap(), controller.group("gripper").unwrap());
    controller.torque(3, 1.0, LONG).unwrap();
    let motion = arm.move_to(&[1.0, -0.5, 0.5]).unwrap();
    gripper.stop(StopCategory::One).unwrap();
    gripper.wait_for(Phase::Disabled, LONG).unwrap();
    assert_eq!(arm.state().phase, Phase::Moving);
    gripper.enable().unwrap();
    gripper.wait_for(Phase::Holding, LONG).unwrap();
    arm.stop(StopCategory::One).unwrap();
    arm.wait_for(Phase::Disabled, LONG).unwrap();
    gripper.wait_for(Phase::Disabled, LONG).unwrap();
    assert!(matches!(controller.wait(motion, LONG), Err(MotionError::Stopped(_))));
    controller.finish().unwrap();
}

#[test]
fn what_is_meant_for_one_group_says_so_where_it_cannot_be_for_all() {
    let controller = Controller::start(config(), SessionOptions::default()).unwrap();
    let unknown = controller.group("hand").err().unwrap();
    assert_eq!(unknown.to_string(), "there is no group \"hand\": the groups are: arm, gripper");
    let of_all = controller.move_to(&[0.1, 0.1, 0.1, 0.1]).unwrap();
    let refused = controller.wait(of_all, LONG).unwrap_err().to_string();
    assert!(refused.contains("must name it: arm, gripper"), "{refused}");
    let arm = controller.group("arm").unwrap();
    assert!(matches!(arm.move_to(&[0.1; 4]), Err(CommandError::Count { given: 4, axes: 3 })));
    assert_eq!(arm.axes(), [0, 1, 2]);
    controller.finish().unwrap();
}
