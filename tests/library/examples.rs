//! The programs of `examples/`, on simulated drives: in virtual time where a program moves the arm of a handle, and in real time where
//! it starts a controller with faults, threads or a server. Each module is the source of the program.

use std::path::Path;
use std::time::Duration;

use takt::{Config, Controller, Handle, Outcome, Scenario, SessionOptions, Snapshot, VirtualController};

/// The programs that read the configuration of an arm, or of a joint.
macro_rules! programs {
    ($($name:ident: $path:literal),* $(,)?) => {$(
        #[path = $path]
        #[expect(dead_code, reason = "`main` reads the arguments of a command line")]
        mod $name;
    )*};
}

programs! {
    after_a_stop: "../../examples/after_a_stop.rs",
    change_mode: "../../examples/change_mode.rs",
    compliance: "../../examples/compliance.rs",
    config_in_code: "../../examples/config_in_code.rs",
    embed: "../../examples/embed.rs",
    gravity_compensation: "../../examples/gravity_compensation.rs",
    hand_guiding: "../../examples/hand_guiding.rs",
    impedance: "../../examples/impedance.rs",
    profile_modes: "../../examples/profile_modes.rs",
    remote: "../../examples/remote.rs",
    stream: "../../examples/stream.rs",
    supervise: "../../examples/supervise.rs",
    trajectory: "../../examples/trajectory.rs",
    virtual_time: "../../examples/virtual_time.rs",
}

fn config(name: &str) -> Config {
    let mut config = Config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name)).unwrap();
    config.telemetry.is_recorded = false;
    config.telemetry.black_box_ns = None;
    config
}

/// Does a program's work with a controller in virtual time.
#[track_caller]
fn in_virtual_time<T>(config: &Config, work: impl FnOnce(&Handle) -> takt::Result<T>) -> T {
    let arm = VirtualController::start(config, None).unwrap();
    let done = work(&arm).unwrap();
    assert_eq!(arm.finish(), Outcome::Finished);
    done
}

#[test]
fn the_first_program_moves_an_arm() {
    in_virtual_time(&config("arm6-erob.toml"), embed::run);
}

#[test]
fn a_joint_is_soft_then_driven_by_a_torque_and_then_turns() {
    in_virtual_time(&config("erob-modes/erob-cst.toml"), compliance::run);
}

#[test]
fn a_joint_is_taken_through_its_three_modes() {
    in_virtual_time(&config("erob-modes/erob-changing.toml"), change_mode::run);
}

#[test]
fn a_configuration_in_code_moves_two_joints() {
    in_virtual_time(&config_in_code::config(), config_in_code::run);
}

#[test]
fn drives_that_plan_by_themselves_get_velocities_and_torques() {
    in_virtual_time(&config("erob-modes/erob-pv.toml"), profile_modes::run);
    in_virtual_time(&config("erob-modes/erob-pt.toml"), profile_modes::run);
}

#[test]
fn an_arm_is_moved_through_another_process() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("arm").display().to_string();
    let arm = Controller::start(config("arm6-erob.toml"), SessionOptions::default()).unwrap();
    let _server = takt_remote::serve(arm.handle(), &name, takt_remote::ServeOptions::default()).unwrap();
    let before = arm.state().axes[0].position_set;
    remote::run(&name).unwrap();
    // The point of the stream is followed after the program has gone.
    let patience = Duration::from_secs(30);
    let there = |state: &Snapshot| ((state.axes[0].position_set - before - 0.06).abs() < 1e-6).then_some(());
    assert!(arm.wait_until(patience, there).is_ok(), "{}", arm.state().axes[0].position_set - before);
}

#[test]
fn a_circle_is_streamed() {
    in_virtual_time(&config("arm6-erob.toml"), stream::run);
}

#[test]
fn three_threads_move_watch_and_print() {
    supervise::run(config("arm6-erob.toml")).unwrap();
}

#[test]
fn after_each_stop_the_arm_is_enabled_again() {
    let config = config("arm6-erob.toml");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/faults/bus-off.toml");
    let scenario = Scenario::load(&path, &config).unwrap();
    assert!(after_a_stop::run(config, 4.0, Some(scenario)).unwrap() > 0, "the fault stops the arm");
}

#[test]
fn a_program_runs_in_virtual_time() {
    virtual_time::run(config("arm6-erob.toml")).unwrap();
}

#[test]
fn a_trajectory_is_executed_slowed_down_and_paused() {
    in_virtual_time(&config("arm6-erob.toml"), trajectory::run);
}

#[test]
fn an_arm_that_carries_its_own_weight_floats() {
    let farthest = in_virtual_time(
        &gravity_compensation::with_gravity(config("arm6-erob-cst.toml")),
        gravity_compensation::run,
    );
    assert!(farthest < 0.05, "it has moved by {farthest} rad");
}

#[test]
fn a_joint_on_a_spring_gives_way_and_comes_back() {
    let (farthest, away) = impedance::run(config("arm6-erob-cst.toml")).unwrap();
    // 20 Nm bend 200 Nm/rad by 0.1 rad; static friction takes a tenth of it, and holds the joint off in the end.
    assert!((0.08..0.11).contains(&farthest) && away < 0.02, "{farthest} rad, then {away} rad");
}

#[test]
fn an_arm_is_guided_by_hand_and_replays_it() {
    let (guided, off) = hand_guiding::run(config("arm6-erob-cst.toml")).unwrap();
    assert!(guided > 0.1 && off < 0.02, "guided by {guided} rad, {off} rad off");
}
