//! Drives are brought up again while the run goes on: after one has lost its power, or did not answer.

use std::path::Path;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use takt::faults::{DriveEffect, Injectable};
use takt::rt::RequestTarget;
use takt::{
    CommandError, Config, Handle, Outcome, Phase, RecoveryError, RejectReason, Rule, Snapshot, StopCategory,
    VirtualController,
};

const PATIENCE: Duration = Duration::from_secs(60);
const MACHINES: [&str; 7] = [
    "arm6-erob.toml",
    "gantry-yz-aim.toml",
    "hollow-arm.toml",
    "damiao-arm.toml",
    "mixed-arm.toml",
    "turntable-modbus.toml",
    "turntable-erob-can.toml",
];

fn config(name: &str) -> Config {
    Config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name)).unwrap()
}

fn start(name: &str) -> VirtualController {
    VirtualController::start(&config(name), None).unwrap()
}

/// Does something to the drive of an axis.
fn does(arm: &VirtualController, axis: usize, effect: DriveEffect, is_present: bool) {
    let drive = &arm.axes()[axis];
    let done = arm.with_ports(|ports| ports[drive.bus].inject(drive.node, effect, is_present));
    done.unwrap().unwrap();
}

/// Cuts the power of a drive for a moment, and waits for the stop that follows. A drive that answers as before, and has lost its power
/// alone, stops nothing while its joint rests.
fn reboot(arm: &VirtualController, axis: usize) {
    does(arm, axis, DriveEffect::Reboot, true);
    let group = arm.groups().iter().position(|group| group.axes.contains(&axis)).unwrap_or(0);
    let is_disabled = |state: &Snapshot| state.groups()[group].phase == Phase::Disabled;
    if arm.wait_until(Duration::from_secs(10), |state| is_disabled(state).then_some(())).is_err() {
        arm.disable().unwrap();
        arm.wait_until(PATIENCE, |state| is_disabled(state).then_some(())).unwrap();
    }
}

/// Moves every axis a little, and back.
fn moves(arm: &VirtualController, name: &str) {
    let limits = arm.axes().iter().map(|axis| axis.limits);
    let state = arm.state();
    let beside = state.axes().iter().zip(limits).map(|(axis, limits)| {
        let step = if axis.position_set + 0.01 < limits.position_max { 0.01 } else { -0.01 };
        axis.position_set + step
    });
    let motion = arm.move_to(&beside.collect::<Vec<f64>>()).unwrap();
    assert_eq!(arm.wait(motion, PATIENCE), Ok(()), "{name}");
    for (axis, own) in arm.state().axes().iter().zip(arm.axes()) {
        assert!((axis.position - axis.position_set).abs() < 2e-3, "{name}, {}: {axis:?}", own.name);
    }
}

#[test]
fn an_arm_with_a_drive_that_lost_its_power_recovers_and_moves() {
    for name in MACHINES {
        let arm = start(name);
        let before: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position).collect();
        reboot(&arm, 0);
        arm.recover(PATIENCE).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((arm.state().groups[0].phase, arm.fault()), (Phase::Holding, None), "{name}");
        for (axis, before) in arm.state().axes().iter().zip(before) {
            assert!((axis.position_set - before).abs() < 5e-3, "{name}: {axis:?}");
        }
        moves(&arm, name);
        assert_eq!(arm.finish(), Outcome::Finished, "{name}");
    }
}

#[test]
fn one_group_is_brought_up_again_while_the_other_moves() {
    let arm_and_gripper = start("arm-and-gripper.toml");
    let (arm, gripper) = (arm_and_gripper.group("arm").unwrap(), arm_and_gripper.group("gripper").unwrap());
    reboot(&arm_and_gripper, 3);
    let motion = arm.move_to(&[2.0, 1.0, -1.0]).unwrap();
    arm.wait_for(Phase::Moving, PATIENCE).unwrap();
    gripper.bring_up(PATIENCE).unwrap();
    let state = gripper.group_state();
    let rule = state.stop.map(|stop| stop.rule());
    assert_eq!((state.phase, rule.is_some()), (Phase::Disabled, true), "the fault stays: {state:?}");
    assert_eq!(arm.group_state().phase, Phase::Moving, "it took no notice");
    gripper.reset_faults().unwrap();
    gripper.enable().unwrap();
    gripper.wait_for(Phase::Holding, PATIENCE).unwrap();
    assert_eq!(arm_and_gripper.wait(motion, PATIENCE), Ok(()));
    assert_eq!(arm_and_gripper.finish(), Outcome::Finished);
}

#[test]
fn all_groups_recover_though_only_one_of_them_has_stopped() {
    let controller = start("arm-and-gripper.toml");
    reboot(&controller, 3);
    assert_eq!(controller.group("arm").unwrap().group_state().phase, Phase::Holding);
    controller.recover(PATIENCE).unwrap();
    assert!(controller.state().groups().iter().all(|group| group.phase == Phase::Holding));
    assert_eq!(controller.finish(), Outcome::Finished);
}

#[test]
fn a_drive_that_does_not_answer_is_named_and_the_group_stays_disabled_until_it_does() {
    let arm = start("arm6-erob.toml");
    does(&arm, 2, DriveEffect::Silent, true);
    arm.wait_for(Phase::Disabled, PATIENCE).unwrap();
    let failed = arm.bring_up(PATIENCE);
    let Err(RecoveryError::NotBroughtUp { words }) = failed else { panic!("{failed:?}") };
    assert!(words.contains(&arm.axes()[2].name) && words.contains("try: "), "{words}");
    assert!(!words.contains(&arm.axes()[1].name), "{words}");
    assert_eq!(arm.state().groups[0].phase, Phase::Disabled);
    assert!(matches!(arm.recover(PATIENCE), Err(RecoveryError::NotBroughtUp { .. })));
    assert!(arm.state().axes().iter().all(|axis| !axis.drive_state.has_torque()));
    does(&arm, 2, DriveEffect::Silent, false);
    arm.recover(PATIENCE).unwrap();
    moves(&arm, "arm6-erob.toml");
}

#[track_caller]
fn assert_needs_bring_up(asked: Result<(), CommandError>) {
    let Err(CommandError::Refused(refused)) = asked else { panic!("{asked:?}") };
    assert_eq!(refused.refusal.unwrap().reason, RejectReason::NotBroughtUp);
    assert!(refused.to_string().contains("call `bring_up`"), "{refused}");
}

#[test]
fn a_group_whose_bring_up_has_failed_is_enabled_only_after_one_that_succeeds() {
    let controller = start("arm-and-gripper.toml");
    let (arm, gripper) = (controller.group("arm").unwrap(), controller.group("gripper").unwrap());
    does(&controller, 1, DriveEffect::Silent, true);
    arm.wait_for(Phase::Disabled, PATIENCE).unwrap();
    assert!(matches!(arm.bring_up(PATIENCE), Err(RecoveryError::NotBroughtUp { .. })));
    arm.reset_faults().unwrap();
    assert_needs_bring_up(arm.enable());
    assert_needs_bring_up(controller.enable());
    arm.stop(StopCategory::Two).unwrap();
    arm.disable().unwrap();
    arm.reset_faults().unwrap();
    // The other group is not concerned.
    gripper.recover(PATIENCE).unwrap();

    does(&controller, 1, DriveEffect::Silent, false);
    controller.pass(Duration::from_secs(1));
    assert_needs_bring_up(arm.enable());
    assert_eq!((arm.group_state().phase, controller.fault()), (Phase::Disabled, None));
    controller.pass(Duration::from_secs(10));
    // The others confirmed that they are disabled before their bring-up.
    let unconfirmed = arm.fault().unwrap().reason;
    assert_eq!((unconfirmed.rule(), unconfirmed.axis()), (Rule::NotDisabled, Some(1)));
    arm.bring_up(PATIENCE).unwrap();
    controller.recover(PATIENCE).unwrap();
    let motion = arm.move_to(&[0.1, 0.1, 0.1]).unwrap();
    assert_eq!(controller.wait(motion, PATIENCE), Ok(()));
    assert_eq!(controller.finish(), Outcome::Finished);
}

#[test]
fn drives_that_report_after_a_bring_up_that_has_failed_are_brought_up_by_a_recovery() {
    // Their drives report whatever was configured.
    for name in ["hollow-arm.toml", "damiao-arm.toml"] {
        let arm = start(name);
        does(&arm, 1, DriveEffect::Silent, true);
        arm.wait_for(Phase::Disabled, PATIENCE).unwrap();
        assert!(matches!(arm.bring_up(PATIENCE), Err(RecoveryError::NotBroughtUp { .. })), "{name}");
        does(&arm, 1, DriveEffect::Silent, false);
        arm.pass(Duration::from_secs(5));
        arm.reset_faults().unwrap();
        assert_needs_bring_up(arm.enable());
        arm.recover(PATIENCE).unwrap_or_else(|error| panic!("{name}: {error}"));
        moves(&arm, name);
    }
}

#[test]
fn a_run_ends_as_usual_after_a_bring_up_that_has_failed() {
    let arm = start("arm6-erob.toml");
    does(&arm, 2, DriveEffect::Silent, true);
    arm.wait_for(Phase::Disabled, PATIENCE).unwrap();
    assert!(matches!(arm.bring_up(PATIENCE), Err(RecoveryError::NotBroughtUp { .. })));
    does(&arm, 2, DriveEffect::Silent, false);
    arm.reset_faults().unwrap();
    assert_eq!(arm.finish(), Outcome::Finished);
}

#[test]
fn drives_under_power_are_not_brought_up_again() {
    let arm = start("arm6-erob.toml");
    let refused = arm.bring_up(PATIENCE);
    assert!(matches!(refused, Err(RecoveryError::Command(CommandError::Refused(_)))), "{refused:?}");
    assert_eq!(arm.state().groups[0].phase, Phase::Holding);
    arm.recover(PATIENCE).unwrap();
    assert_eq!(arm.state().groups[0].phase, Phase::Holding, "nothing was to be recovered");
    moves(&arm, "arm6-erob.toml");
}

#[test]
fn axes_that_were_only_disabled_are_enabled_without_another_bring_up() {
    let arm = start("arm6-erob.toml");
    arm.disable().unwrap();
    arm.wait_for(Phase::Disabled, PATIENCE).unwrap();
    let before_ns = arm.now_ns();
    arm.recover(PATIENCE).unwrap();
    assert!(arm.now_ns() - before_ns < 200_000_000, "a bring-up takes longer");
    arm.disable().unwrap();
    arm.wait_for(Phase::Disabled, PATIENCE).unwrap();
    arm.bring_up(PATIENCE).unwrap();
    arm.enable().unwrap();
    arm.wait_for(Phase::Holding, PATIENCE).unwrap();
    moves(&arm, "arm6-erob.toml");
}

#[test]
fn a_stop_during_a_recovery_leaves_the_arm_disabled() {
    let handle: Arc<OnceLock<Handle>> = Arc::default();
    let (stopping, mut was_passive) = (Arc::clone(&handle), false);
    let each_cycle = Box::new(move |record: &takt_rt::CycleRecord| {
        if let Some(handle) = stopping.get() {
            let is_passive = record.groups[0].phase == Phase::Passive;
            if is_passive && !was_passive {
                handle.stop(StopCategory::Zero).unwrap();
            }
            was_passive = is_passive;
        }
    });
    let arm = VirtualController::start(&config("arm6-erob.toml"), Some(each_cycle)).unwrap();
    reboot(&arm, 1);
    assert!(handle.set(arm.handle()).is_ok());
    let recovered = arm.recover(PATIENCE);
    assert_eq!(recovered, Err(RecoveryError::Command(CommandError::Overtaken)));
    arm.pass(Duration::from_secs(5));
    assert_eq!(arm.state().groups[0].phase, Phase::Disabled);
    arm.recover(PATIENCE).unwrap();
}

#[test]
fn a_run_that_ends_while_a_group_is_brought_up_disables_the_others_and_shuts_all_down() {
    let controller = start("arm-and-gripper.toml");
    reboot(&controller, 3);
    controller.of(RequestTarget::Group(1)).begin_bring_up().unwrap();
    assert_eq!(controller.state().groups[1].phase, Phase::Passive);
    controller.disable().unwrap();
    controller.group("arm").unwrap().wait_for(Phase::Disabled, PATIENCE).unwrap();
    controller.group("arm").unwrap().enable().unwrap();
    controller.group("arm").unwrap().wait_for(Phase::Holding, PATIENCE).unwrap();
    let outcome = controller.finish();
    assert!(matches!(outcome, Outcome::Stopped(stop) if stop.rule() != Rule::NotDisabled), "{outcome:?}");
}

#[test]
fn a_mode_that_was_changed_is_that_of_the_configuration_again_after_another_bring_up() {
    let name = "erob-modes/erob-changing.toml";
    let joint = start(name);
    let first = joint.state().axes[0].mode_set;
    let other = joint.axes()[0].controls().map(|control| control.operation_mode()).nth(1).unwrap();
    joint.disable().unwrap();
    joint.wait_for(Phase::Disabled, PATIENCE).unwrap();
    let change = joint.change_mode(other).unwrap();
    joint.wait(change, PATIENCE).unwrap();
    assert_ne!(joint.state().axes[0].mode_set, first);
    joint.bring_up(PATIENCE).unwrap();
    assert_eq!(joint.state().axes[0].mode_set, first);
    joint.enable().unwrap();
    joint.wait_for(Phase::Holding, PATIENCE).unwrap();
    moves(&joint, name);
}
