//! The programs of `examples/`, on simulated drives. Each module is the source of the program.

use std::path::Path;

use takt::{Config, Scenario};

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

#[test]
fn the_first_program_moves_an_arm() {
    embed::run(config("arm6-erob.toml")).unwrap();
}

#[test]
fn a_joint_is_soft_then_driven_by_a_torque_and_then_turns() {
    compliance::run(config("erob-modes/erob-cst.toml")).unwrap();
}

#[test]
fn a_joint_is_taken_through_its_three_modes() {
    change_mode::run(config("erob-modes/erob-changing.toml")).unwrap();
}

#[test]
fn a_configuration_in_code_moves_two_joints() {
    config_in_code::run(config_in_code::config()).unwrap();
}

#[test]
fn drives_that_plan_by_themselves_get_velocities_and_torques() {
    profile_modes::run(config("erob-modes/erob-pv.toml")).unwrap();
    profile_modes::run(config("erob-modes/erob-pt.toml")).unwrap();
}

#[test]
fn an_arm_is_moved_through_another_process() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("arm").display().to_string();
    let arm = takt::Controller::start(config("arm6-erob.toml"), takt::SessionOptions::default()).unwrap();
    let _server = takt::serve(arm.handle(), &name, takt::ServeOptions::default()).unwrap();
    let before = arm.state().axes[0].position_set;
    remote::run(&name).unwrap();
    // The point of the stream is followed after the program has gone.
    let patience = std::time::Duration::from_secs(30);
    let there =
        |state: &takt::Snapshot| ((state.axes[0].position_set - before - 0.06).abs() < 1e-6).then_some(());
    assert!(arm.wait_until(patience, there).is_ok(), "{}", arm.state().axes[0].position_set - before);
}

#[test]
fn a_circle_is_streamed() {
    stream::run(config("arm6-erob.toml")).unwrap();
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
    trajectory::run(config("arm6-erob.toml")).unwrap();
}

#[test]
fn an_arm_that_carries_its_own_weight_floats() {
    let farthest = gravity_compensation::run(config("arm6-erob-cst.toml")).unwrap();
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
