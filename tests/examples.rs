//! The programs of `examples/`, on simulated drives. Each module is the source of the program.

use std::path::Path;

use takt::Config;

/// The programs that read the configuration of an arm, or of a joint.
macro_rules! programs {
    ($($name:ident: $path:literal),* $(,)?) => {$(
        #[path = $path]
        #[expect(dead_code, reason = "`main` reads the arguments of a command line")]
        mod $name;
    )*};
}

programs! {
    config_in_code: "../examples/config_in_code.rs",
    embed: "../examples/embed.rs",
    profile_modes: "../examples/profile_modes.rs",
    stream: "../examples/stream.rs",
    supervise: "../examples/supervise.rs",
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
fn a_configuration_in_code_moves_two_joints() {
    config_in_code::run(config_in_code::config()).unwrap();
}

#[test]
fn drives_that_plan_by_themselves_get_velocities_and_torques() {
    profile_modes::run(config("erob-modes/erob-pv.toml")).unwrap();
    profile_modes::run(config("erob-modes/erob-pt.toml")).unwrap();
}

#[test]
fn a_circle_is_streamed() {
    stream::run(config("arm6-erob.toml")).unwrap();
}

#[test]
fn three_threads_move_watch_and_print() {
    supervise::run(config("arm6-erob.toml")).unwrap();
}
