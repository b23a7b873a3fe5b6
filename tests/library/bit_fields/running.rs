//! Whole controllers in virtual time that lead drives of bit fields.

use std::time::Duration;

use takt::config::Config;
use takt::sim::DriveFault;
use takt::{Outcome, VirtualController};
use takt_rt::OperationMode::{
    CyclicSynchronousPosition as CSP, CyclicSynchronousTorque as CST, CyclicSynchronousVelocity as CSV,
};
use takt_rt::{
    AxisPoint, DriveState, MAX_AXES, ModeChange, MotionState, Move, OperationMode, Phase, PointRole, Request,
    Rule, StopCategory, StreamPoint,
};

use crate::bit_fields::machine::{HOLLOW, HOLLOW_FD, MIT, one, text};
use crate::drive_modes::world::{World, load};

const FD_BUS: &str = "data_bit_rate = \"5 Mbit/s\"";

/// Runs a program to its end. No joint moves before the group does.
fn run(mut config: Config) -> World {
    for axis in &mut config.axes {
        axis.simulated.initial_position = 0.4;
    }
    let name = config.name.clone();
    let mut world = World::new(config);
    while !matches!(world.phase(), Phase::Moving) {
        assert!(world.step(), "{name}: {:?}", world.outcome());
        for axis in 0..world.config.axes.len() {
            let way = world.observe(axis).position - 0.4;
            assert!(way.abs() < 2e-3, "{name}: axis {axis} has moved by {way} while it was started");
        }
    }
    let outcome = world.run_to_the_end(|_| ());
    assert_eq!(outcome, Outcome::Finished, "{name}: {:?}", world.stops());
    world
}

#[test]
fn every_example_configuration_starts_without_a_jump_and_runs_its_program() {
    for name in ["hollow-arm.toml", "hollow-leg-fd.toml", "damiao-arm.toml"] {
        let mut world = run(load(name));
        for axis in 0..world.config.axes.len() {
            let seen = world.observe(axis);
            assert!(seen.position.abs() < 0.01, "{name}: {seen:?}");
            assert_eq!(seen.state, DriveState::SwitchOnDisabled, "{name}: {seen:?}");
        }
    }
}

#[test]
fn requests_leave_at_one_moment_of_the_slot_however_long_their_cycle_was_computed() {
    for (name, send_phase_ns) in
        [("hollow-arm.toml", 625_000), ("hollow-leg-fd.toml", 650_000), ("hollow-rs485.toml", 2_850_000)]
    {
        let mut world = World::new(load(name));
        let period_ns = world.config.cycle.period_ns;
        let mut computed_ns = 0;
        let outcome = world.run_to_the_end(|world| {
            computed_ns = (computed_ns + 7_000) % 75_000;
            world.run.clock().compute_for(computed_ns);
        });
        assert_eq!(outcome, Outcome::Finished, "{name}: {:?}", world.stops());
        let requests = world.port(0).sent_with(1);
        assert!(requests.len() > 200, "{name}");
        for (at_ns, _) in requests {
            assert_eq!(at_ns % period_ns, send_phase_ns, "{name}");
        }
    }
}

/// A machine with one drive of a description that ships with takt.
fn described(description: &str) -> Config {
    let scales = match description {
        _ if description.starts_with("odrive") => "drive = \"bit-fields\"\n".to_owned(),
        "mini-cheetah" => format!("{MIT}master_id = 0x65\n"),
        "damiao-dm-mit" => format!("{MIT}master_id = 0x11\n"),
        _ if description.starts_with("damiao") => {
            format!("{}master_id = 0x11\n", MIT.replace("kp = 60\nkd = 1.5\n", ""))
        }
        _ => MIT.to_owned(),
    };
    one("1 ms", "", &format!("{scales}description = {description:?}\nreversed = true\n"), "to = 1.2")
}

#[test]
fn every_description_that_comes_with_takt_leads_a_drive_to_its_target() {
    for description in [
        "damiao-dm-mit",
        "damiao-dm-position-velocity",
        "damiao-dm-velocity",
        "mini-cheetah",
        "t-motor-ak-mit",
        "odrive-can-simple",
        "odrive-can-simple-velocity",
    ] {
        let mut world = run(Config { name: description.to_owned(), ..described(description) });
        let seen = world.observe(0);
        assert!((seen.position - 1.2).abs() < 0.01, "{description}: {seen:?}");
    }
}

#[test]
fn hollow_motors_are_led_by_positions_velocities_and_torques_over_can_and_can_fd() {
    for (keys, bus) in [(HOLLOW, ""), (HOLLOW_FD, FD_BUS)] {
        for mode in ["csp", "csv", "cst"] {
            let keys =
                format!("{keys}master_id = 0x64\ngear_ratio = 2\nzero_counts = 1000\nmode = {mode:?}\n");
            let keys = if mode == "csp" { keys.replace("gear_ratio = 2", "gear_ratio = 1.5") } else { keys };
            let keys = format!(
                "{keys}limits = {{ position = [-1.5, 1.5], velocity = 2, acceleration = 10, jerk = 200, torque = 2 }}\n{JOINT}"
            );
            let mut world = run(one("1 ms", bus, &keys, "to = -1.2"));
            assert!((world.observe(0).position + 1.2).abs() < 0.01, "{mode}: {:?}", world.observe(0));
        }
    }
}

const JOINT: &str = "joint = { inertia = 0.03, viscous_friction = 0.05, coulomb_friction = 0.05 }\n";

fn holding(keys: &str) -> World {
    // Without the switch, two of them do not fit one millisecond.
    let (bus, switch) = if keys.contains("fd") { (FD_BUS, "bit_rate_switch = true\n") } else { ("", "") };
    let axes = [0x64, 0x65].map(|master| format!("{keys}{switch}master_id = {master}\n"));
    World::holding(Config::parse("two.toml", &text("1 ms", bus, &axes)).unwrap())
}

fn begin_move(world: &mut World, target: f64) {
    world.request(Request::Move(Move {
        target: [target; MAX_AXES],
        target_velocity: [0.0; MAX_AXES],
        velocity_scale: 1.0,
        acceleration_scale: 1.0,
        minimum_duration_s: 0.0,
    }));
    world.run_for(300);
    assert_eq!(world.phase(), Phase::Moving, "{:?}", world.stops());
}

#[test]
fn a_stop_brings_the_motors_to_rest_within_their_limits_and_takes_their_torque() {
    for keys in [HOLLOW, HOLLOW_FD] {
        let mut world = holding(keys);
        begin_move(&mut world, 2.0);
        world.request(Request::Stop(StopCategory::One));
        let before = world.observe(0).position;
        world.run_until(|world| world.phase() == Phase::Disabled);
        world.run_for(100);
        for axis in 0..2 {
            let seen = world.observe(axis);
            assert_eq!(seen.state, DriveState::SwitchOnDisabled);
            // From 2 rad/s at 10 rad/s², with the rise of the deceleration.
            let way = seen.position - before;
            assert!(seen.velocity.abs() < 1e-3 && (0.0..0.35).contains(&way), "{way} {seen:?}");
        }
    }
}

#[test]
fn a_motor_that_falls_silent_stops_the_group_which_is_not_enabled_without_it() {
    for keys in [HOLLOW, HOLLOW_FD] {
        let mut world = holding(keys);
        begin_move(&mut world, 2.0);
        world.port(0).bus.silence(1, true).unwrap();
        world.run_to_the_end(|_| ());
        assert_eq!(
            world.stops().first().map(|stop| stop.rule()),
            Some(Rule::MissedFeedback),
            "{:?}",
            world.stops()
        );
        let other = world.observe(1);
        assert!(other.velocity.abs() < 1e-2 && other.position < 1.5, "{other:?}");
        assert_eq!(other.state, DriveState::SwitchOnDisabled);
    }
}

#[test]
fn a_motor_whose_supply_dips_loses_extended_mode_and_stops_the_group() {
    let mut world = holding(&format!("{HOLLOW}extended = true\n"));
    begin_move(&mut world, 2.0);
    let began = world.observe(0).position;
    world.port(0).bus.power_cycle(1).unwrap();
    world.run_to_the_end(|_| ());
    assert_eq!(
        world.stops().first().map(|stop| stop.rule()),
        Some(Rule::MissedFeedback),
        "{:?}",
        world.stops()
    );
    // It coasts without torque, and nobody starts it again.
    assert_eq!(world.observe(0).state, DriveState::SwitchOnDisabled);
    assert!((world.observe(0).position - began) < 1.5);
}

#[test]
fn a_motor_whose_supply_dips_while_it_is_stopped_is_set_up_again_and_runs() {
    let mut world = holding(&format!("{HOLLOW}extended = true\n"));
    world.request(Request::Disable);
    world.run_until(|world| world.phase() == Phase::Disabled);
    world.port(0).bus.power_cycle(1).unwrap();
    world.run_for(600);
    world.request(Request::Enable);
    world.run_until(|world| world.phase() == Phase::Holding);
    assert_eq!(world.observe(0).state, DriveState::OperationEnabled);
}

#[test]
fn a_fault_that_a_motor_shows_stops_the_group() {
    let mit = format!("{MIT}description = \"damiao-dm-mit\"\n");
    for keys in [HOLLOW_FD, &mit] {
        let mut world = holding(keys);
        begin_move(&mut world, 2.0);
        world.port(0).bus.inject_fault(1, DriveFault::OverTemperature).unwrap();
        world.run_to_the_end(|_| ());
        let rules: Vec<Rule> = world.stops().iter().map(|stop| stop.rule()).collect();
        assert_eq!(rules.first(), Some(&Rule::DriveFault), "{rules:?}");
    }
}

#[test]
fn a_motor_that_shows_no_fault_stops_the_group_by_its_following_error() {
    let mut world = holding(HOLLOW);
    begin_move(&mut world, 2.0);
    world.port(0).bus.inject_fault(1, DriveFault::OverTemperature).unwrap();
    world.run_to_the_end(|_| ());
    assert_eq!(
        world.stops().first().map(|stop| stop.rule()),
        Some(Rule::FollowingError),
        "{:?}",
        world.stops()
    );
}

fn change(world: &mut World, mode: OperationMode) {
    let request = world.request(Request::ChangeMode(ModeChange { modes: [Some(mode); MAX_AXES] }));
    for _ in 0..200 {
        if world.run.snapshot().motions.of(request) == Some(MotionState::Finished) {
            return;
        }
        world.run_for(1);
    }
    panic!("{mode:?}: {:?}", world.run.snapshot().answers.of(request));
}

#[test]
fn the_mode_of_a_motor_changes_while_its_joint_is_at_rest_and_moves_nothing() {
    // By a coarse velocity, a joint is not held exactly enough for the change.
    let fine = HOLLOW.replace("velocity_full_scale = 200", "velocity_full_scale = 20");
    for keys in [&fine, HOLLOW_FD] {
        let mut world = holding(&format!("{keys}modes = [\"csp\", \"csv\", \"cst\"]\n"));
        let mut at = world.observe(0).position;
        for (mode, target) in [(CSV, 0.8), (CST, 0.2), (CSP, 0.6), (CST, -0.3), (CSV, 0.0)] {
            change(&mut world, mode);
            world.run_for(200);
            let seen = world.observe(0);
            assert_eq!(seen.operation_mode, mode as i8);
            assert!((seen.position - at).abs() < 5e-3, "{mode:?}: {} {seen:?}", at);
            begin_move(&mut world, target);
            world.run_until(|world| world.phase() == Phase::Holding);
            world.run_for(500);
            at = world.observe(0).position;
            assert!((at - target).abs() < 0.01, "{mode:?}: {at} instead of {target}");
        }
        assert_eq!(world.stops(), vec![]);
    }
}

/// A motor takes the frame of a mode with the numbers of its last command. The limits of position mode are no targets of the next one.
#[test]
fn a_motor_that_is_told_its_mode_by_a_frame_gets_no_limit_as_a_target() {
    let fine = HOLLOW.replace("velocity_full_scale = 200", "velocity_full_scale = 20");
    let mut world = holding(&format!("{fine}modes = [\"csp\", \"csv\", \"cst\"]\n"));
    for mode in [CSV, CSP, CST, CSP, CSV, CST] {
        world.run_for(300);
        let request = world.request(Request::ChangeMode(ModeChange { modes: [Some(mode); MAX_AXES] }));
        let mut fastest: f64 = 0.0;
        while world.run.snapshot().motions.of(request) != Some(MotionState::Finished) {
            world.run_for(1);
            fastest = fastest.max(world.observe(0).velocity.abs());
        }
        // A target of the velocity limit, or of the torque limit, would be 50 times as much after one cycle.
        assert!(fastest < 0.03, "{mode:?}: {fastest} rad/s");
    }
    assert_eq!(world.stops(), vec![]);
}

/// A spindle of extended mode turns beyond the range in which its motor reports its position.
#[test]
fn a_joint_turns_on_where_the_report_of_its_motor_wraps_around() {
    let fine = HOLLOW.replace("velocity_full_scale = 200", "velocity_full_scale = 500");
    let turns = "limits = { position = [\"-3000 turn\", \"3000 turn\"], velocity = 200, acceleration = 500, jerk = 20000, torque = 40 }";
    let keys = format!(
        "{fine}extended = true\nmaster_id = 0x64\ncounts_per_turn = 65536\ncurrent_full_scale = 100\n{turns}\n{JOINT}\
         simulated = {{ initial_position = \"2040 turn\", peak_torque = \"50 Nm\" }}\nfollowing_error = {{ limit = 20, time = \"50 ms\" }}\n"
    )
    .replacen("current_full_scale = 4\n", "", 1);
    let mut world = World::new(one("1 ms", "", &keys, "to = \"2060 turn\""));
    assert_eq!(world.run_to_the_end(|_| ()), Outcome::Finished, "{:?}", world.stops());
    let at = world.observe(0).position / std::f64::consts::TAU;
    assert!((at - 2060.0).abs() < 0.01, "{at}");
    let reported = world.run.snapshot().axes[0].position / std::f64::consts::TAU;
    assert!((reported - 2060.0).abs() < 0.01, "{reported}");
}

/// Streams a point once in ten cycles.
fn stream(world: &mut World, point: AxisPoint, cycles: usize) {
    for cycle in 0..cycles {
        if cycle % 10 == 0 {
            let (at_ns, axes) = (world.run.snapshot().at_ns, [point; MAX_AXES]);
            let point = StreamPoint { at_ns, role: PointRole::Single, axes };
            world.run.host().streamer().push(&[point]).unwrap();
        }
        assert!(world.step(), "{:?}", world.stops());
    }
}

/// A drive that is led by torques, with what a stream may ask of it.
fn compliant(keys: &str, bus: &str) -> Config {
    let keys = format!("{keys}mode = \"cst\"\ntorque_loop = {{ stiffness_max = 48, damping_max = 2.4 }}\n");
    one("1 ms", bus, &keys, "to = 0")
}

/// A stream of an impedance gives way to a load by its stiffness, and the torque that is fed forward takes the load.
#[test]
fn streams_of_impedances_and_torques_lead_motors_with_and_without_a_loop_of_their_own() {
    let mit = format!("{MIT}master_id = 0x11\ndescription = \"damiao-dm-mit\"\n");
    let flexible = format!("{HOLLOW_FD}master_id = 0x64\n");
    for (keys, bus) in [(&mit, ""), (&flexible, FD_BUS)] {
        let mut world = World::holding(compliant(keys, bus));
        world.request(Request::Stream);
        let soft = AxisPoint::position(0.4).with_impedance(10.0, 1.0);
        stream(&mut world, soft, 500);
        world.port(0).bus.set_load_torque(1, 1.0).unwrap();
        stream(&mut world, soft, 1_500);
        let sag = world.observe(0).position - 0.4;
        assert!((sag - 0.1).abs() < 0.02, "1 N·m at 10 N·m/rad: {sag}");
        stream(&mut world, soft.with_torque(-1.0), 1_500);
        let sag = world.observe(0).position - 0.4;
        assert!(sag.abs() < 0.02, "{sag}");
        assert_eq!((world.stops(), world.phase()), (vec![], Phase::Streaming));
    }
}

/// A drive of MIT mode gets the gains of the stream in its frames, and closes the loop itself.
#[test]
fn the_gains_of_a_stream_are_in_the_frames_of_a_drive_in_mit_mode() {
    let mit = format!("{MIT}master_id = 0x11\ndescription = \"damiao-dm-mit\"\n");
    let mut world = World::holding(compliant(&mit, ""));
    world.request(Request::Stream);
    stream(&mut world, AxisPoint::position(0.4).with_impedance(25.0, 1.0), 1_000);
    let sent = world.port(0).sent_with(1);
    let (_, payload) = sent.last().unwrap();
    let kp = u16::from_be_bytes([payload[3] & 0xF, payload[4]]);
    let kd = u16::from_be_bytes([payload[5], payload[6]]) >> 4;
    assert_eq!(
        (kp, kd),
        ((25.0_f64 / 500.0 * 4095.0).round() as u16, (1.0_f64 / 5.0 * 4095.0).round() as u16)
    );
}

#[test]
fn a_callback_leads_drives_by_stiffness_damping_and_torque() {
    let mit = format!("{MIT}master_id = 0x11\ndescription = \"damiao-dm-mit\"\n");
    let flexible = format!("{HOLLOW_FD}master_id = 0x64\n");
    for (keys, bus) in [(&mit, ""), (&flexible, FD_BUS)] {
        let arm = VirtualController::start(&compliant(keys, bus), None).unwrap();
        let home = arm.state().axes()[0].position_set;
        let mut elapsed_s = 0.0;
        let callback = arm.in_loop(move |_, cycle, command| {
            elapsed_s += cycle.period_s;
            command.impedance(0, home + 0.1 * (1.0 - (3.0 * elapsed_s).cos()), 40.0, 2.0, 0.1);
            if elapsed_s > 1.0 {
                command.finish();
            }
        });
        callback.unwrap().wait(Duration::from_secs(30)).unwrap();
        let way = arm.state().axes()[0].position - home;
        assert!((0.15..0.25).contains(&way), "{way}");
        assert_eq!(arm.finish(), Outcome::Finished);
    }
}
