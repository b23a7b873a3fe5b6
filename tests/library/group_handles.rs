//! A gripper beside an arm, from a program, in virtual time: `configs/arm-and-gripper.toml`.

use std::path::Path;
use std::time::Duration;

use takt::{
    AnyHandle, AxisPoint, CommandError, Config, MotionError, Outcome, TrajectoryPoint, VirtualController,
    VirtualRun,
};
use takt_rt::{ControlLaw, EventKind, OperationMode, Phase, RequestTarget, Rule, StopCategory, StreamState};

const LONG: Duration = Duration::from_secs(20);

fn config() -> Config {
    Config::load(Path::new("configs/arm-and-gripper.toml")).unwrap()
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
    let controller = VirtualController::start(&config(), None).unwrap();
    let (arm, gripper) = (controller.group("arm").unwrap(), controller.group("gripper").unwrap());
    let mut events = controller.events();
    let motion = arm.move_to(&[0.6, -0.3, 0.4]).unwrap();
    controller.torque(3, 1.0, Duration::from_millis(50)).unwrap();
    gripper.wait_for(Phase::Disabled, LONG).unwrap();
    assert_eq!(gripper.group_state().stop.unwrap().rule(), Rule::StaleCommand);
    controller.wait(motion, LONG).unwrap();
    assert_eq!((arm.group_state().phase, arm.group_state().stop), (Phase::Holding, None));
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
    assert_eq!(controller.finish(), Outcome::Finished);
}

#[test]
fn a_stop_of_the_arm_stops_the_gripper_too_and_not_the_other_way_round() {
    let controller = VirtualController::start(&config(), None).unwrap();
    let (arm, gripper) = (controller.group("arm").unwrap(), controller.group("gripper").unwrap());
    controller.torque(3, 1.0, LONG).unwrap();
    let motion = arm.move_to(&[1.0, -0.5, 0.5]).unwrap();
    gripper.stop(StopCategory::One).unwrap();
    gripper.wait_for(Phase::Disabled, LONG).unwrap();
    assert_eq!(arm.group_state().phase, Phase::Moving);
    gripper.enable().unwrap();
    gripper.wait_for(Phase::Holding, LONG).unwrap();
    arm.stop(StopCategory::One).unwrap();
    arm.wait_for(Phase::Disabled, LONG).unwrap();
    gripper.wait_for(Phase::Disabled, LONG).unwrap();
    assert!(matches!(controller.wait(motion, LONG), Err(MotionError::Stopped(_))));
    assert_eq!(controller.finish(), Outcome::Finished);
}

#[test]
fn what_is_meant_for_one_group_says_so_where_it_cannot_be_for_all() {
    let controller = VirtualController::start(&config(), None).unwrap();
    let unknown = controller.group("hand").err().unwrap();
    assert_eq!(unknown.to_string(), "there is no group \"hand\": the groups are: arm, gripper");
    let of_all = controller.move_to(&[0.1, 0.1, 0.1, 0.1]).unwrap();
    let refused = controller.wait(of_all, LONG).unwrap_err().to_string();
    assert!(refused.contains("must name it: arm, gripper"), "{refused}");
    let arm = controller.group("arm").unwrap();
    assert!(matches!(arm.move_to(&[0.1; 4]), Err(CommandError::Count { given: 4, axes: 3 })));
    assert_eq!(arm.axis_numbers(), [0, 1, 2]);
    assert_eq!(controller.finish(), Outcome::Finished);
}

#[test]
fn a_handle_of_any_controller_commands_a_group_and_names_the_others() {
    let controller = VirtualController::start(&config(), None).unwrap();
    let arm: AnyHandle = controller.group("arm").unwrap().into();
    assert_eq!((arm.target(), arm.axis_numbers()), (RequestTarget::Group(0), vec![0, 1, 2]));
    let motion = arm.move_to(&[0.1, -0.1, 0.1]).unwrap();
    assert_eq!(arm.wait(motion, LONG), Ok(()));
    let gripper = arm.group("gripper").unwrap();
    assert_eq!(gripper.axis_numbers(), [3]);
    gripper.disable().unwrap();
    gripper.wait_for(Phase::Disabled, LONG).unwrap();
    assert_eq!(arm.group_state().phase, Phase::Holding);
    assert_eq!(arm.of(RequestTarget::All).axis_numbers(), [0, 1, 2, 3]);
    assert_eq!(controller.finish(), Outcome::Finished);
}

/// As the configuration, with a gripper that follows positions.
fn with_positions() -> Config {
    let mut config = config();
    config.axes[3].control = ControlLaw::Position;
    config.program.moves.retain(|program_move| program_move.group == 0);
    config
}

#[test]
fn the_mode_of_one_group_is_changed_while_the_other_moves() {
    let mut config = with_positions();
    let velocity = ControlLaw::Velocity { position_gain: 20.0 };
    config.axes[3] = config.axes[3].clone().with_other_modes(vec![velocity]);
    let controller = VirtualController::start(&config, None).unwrap();
    let (arm, gripper) = (controller.group("arm").unwrap(), controller.group("gripper").unwrap());
    let csv = OperationMode::CyclicSynchronousVelocity;
    let of_all = controller.change_mode(csv).unwrap();
    let refused = controller.wait(of_all, LONG).unwrap_err().to_string();
    assert!(refused.contains("must name it: arm, gripper"), "{refused}");

    let motion = arm.move_to(&[0.6, -0.3, 0.4]).unwrap();
    gripper.disable().unwrap();
    gripper.wait_for(Phase::Disabled, LONG).unwrap();
    let change = gripper.change_mode(csv).unwrap();
    controller.wait(change, LONG).unwrap();
    assert_eq!(arm.group_state().phase, Phase::Moving);
    gripper.enable().unwrap();
    gripper.wait_for(Phase::Holding, LONG).unwrap();
    let closing = gripper.move_to(&[0.2]).unwrap();
    controller.wait(closing, LONG).unwrap();
    controller.wait(motion, LONG).unwrap();
    let modes: Vec<i8> = controller.state().axes().iter().map(|axis| axis.mode_set).collect();
    assert_eq!(modes, [8, 8, 8, 9]);
    assert_eq!(controller.finish(), Outcome::Finished);
}

const MILLISECOND_NS: u64 = 1_000_000;

#[test]
fn each_group_follows_a_stream_of_its_own() {
    let controller = VirtualController::start(&with_positions(), None).unwrap();
    let (arm, gripper) = (controller.group("arm").unwrap(), controller.group("gripper").unwrap());
    arm.begin_stream().unwrap();
    let now_ns = controller.now_ns();
    let at = |number: u64| now_ns + (100 + 10 * number) * MILLISECOND_NS;
    for number in 0..40 {
        let position = 0.002 * number.min(30) as f64;
        arm.stream().push(at(number), &[position, -position, 0.0]).unwrap();
    }
    gripper.begin_stream().unwrap();
    gripper.stream().push(at(0), &[AxisPoint::moving(0.0, 0.0)]).unwrap();
    gripper.stream().push(at(20), &[AxisPoint::moving(0.1, 0.0)]).unwrap();
    let refused = arm.stream().push(at(0), &[0.0; 4]).unwrap_err().to_string();
    assert_eq!(refused, "there are 3 axes, and the point has entries for 4");
    let rests = |state: &takt::Snapshot| {
        let are_dry = state.groups().iter().all(|group| group.stream.state == StreamState::Dry);
        (are_dry && state.axes().iter().all(|axis| axis.velocity_set.abs() < 1e-6)).then_some(*state)
    };
    let state = controller.wait_until(LONG, rests).unwrap();
    let counts = [0, 1].map(|group: usize| state.groups[group].stream.counts.points);
    assert_eq!(counts, [40, 2]);
    let expected = [0.06, -0.06, 0.0, 0.1];
    for (axis, expected) in state.axes().iter().zip(expected) {
        assert!((axis.position_set - expected).abs() < 1e-3, "{axis:?} for {expected}");
    }
    assert_eq!((arm.stream().report().counts.points, gripper.stream().report().counts.points), (40, 2));
    assert_eq!(controller.finish(), Outcome::Finished);
}

#[test]
fn a_group_is_carried_along_a_trajectory_while_the_other_one_streams() {
    let controller = VirtualController::start(&with_positions(), None).unwrap();
    let (arm, gripper) = (controller.group("arm").unwrap(), controller.group("gripper").unwrap());
    arm.begin_stream().unwrap();
    let point = TrajectoryPoint { time_s: 0.8, positions: vec![0.2], ..TrajectoryPoint::default() };
    let motion = gripper.execute(&[point]).unwrap();
    controller.set_speed(motion, 0.8).unwrap();
    assert!(controller.trajectory_progress(motion).unwrap().unwrap().of_s == 0.8);
    controller.wait(motion, LONG).unwrap();
    let state = controller.state();
    assert!((state.axes[3].position_set - 0.2).abs() < 1e-9);
    assert_eq!(
        state.groups().iter().map(|group| group.phase).collect::<Vec<_>>(),
        [Phase::Streaming, Phase::Holding]
    );

    arm.stop(StopCategory::Two).unwrap();
    arm.wait_for(Phase::Holding, LONG).unwrap();
    let motion = arm.move_through(&[vec![0.1, 0.0, 0.1], vec![0.2, 0.1, 0.0]]).unwrap();
    controller.wait(motion, LONG).unwrap();
    assert!((controller.state().axes[0].position_set - 0.2).abs() < 1e-9);

    let refused = controller.move_through(&[vec![0.1; 4]]).unwrap_err();
    assert_eq!(refused.to_string(), "it is for one group, and must name it: arm, gripper");
    assert_eq!(controller.finish(), Outcome::Finished);
}

#[test]
fn the_only_group_of_a_configuration_is_stopped_by_its_name() {
    let mut config = Config::load(Path::new("configs/single-erob.toml")).unwrap();
    config.groups = vec![takt::config::Group { name: "joint".to_owned(), axes: vec![0], stops_with: vec![] }];
    let controller = VirtualController::start(&config, None).unwrap();
    let joint = controller.group("joint").unwrap();
    let motion = joint.move_to(&[0.5]).unwrap();
    joint.wait_for(Phase::Moving, LONG).unwrap();
    joint.stop(StopCategory::One).unwrap();
    assert!(matches!(controller.wait(motion, LONG), Err(MotionError::Stopped(_))));
    joint.wait_for(Phase::Disabled, LONG).unwrap();
    joint.enable().unwrap();
    joint.wait_for(Phase::Holding, LONG).unwrap();
    assert_eq!(controller.finish(), Outcome::Finished);
}
