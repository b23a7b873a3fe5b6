//! A controller in virtual time, commanded by the same calls as one in real time.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use takt::config::Interface;
use takt::rt::RequestTarget;
use takt::{
    Config, MotionError, MoveOptions, Outcome, Phase, Snapshot, StartFailure, StopCategory, StreamState,
    TrajectoryPoint, VirtualController, WaitError,
};

const PATIENCE: Duration = Duration::from_secs(60);

fn config(name: &str) -> Config {
    Config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name)).unwrap()
}

fn simulated(name: &str) -> VirtualController {
    VirtualController::start(&config(name), None).unwrap()
}

fn set_points(state: &Snapshot) -> Vec<f64> {
    state.axes().iter().map(|axis| axis.position_set).collect()
}

#[test]
fn drives_that_are_left_disabled_report_where_they_are_and_have_no_torque_until_they_are_enabled() {
    for name in
        ["arm6-erob.toml", "gantry-yz-aim.toml", "hollow-arm.toml", "damiao-arm.toml", "mixed-arm.toml"]
    {
        let arm = VirtualController::start_disabled(&config(name), None).unwrap();
        let is_off = |state: &Snapshot| {
            state.groups().iter().all(|group| group.phase == Phase::Disabled)
                && state.axes().iter().all(|axis| axis.is_heard && !axis.drive_state.has_torque())
        };
        assert!(is_off(&arm.state()), "{name}");
        // Longer than every stage of the life cycle may take.
        arm.pass(Duration::from_secs(20));
        assert!(is_off(&arm.state()), "{name}");
        let moving = arm.move_by(&vec![0.001; arm.axes().len()], MoveOptions::default());
        assert!(moving.is_err() || arm.wait(moving.unwrap(), PATIENCE).is_err(), "{name}");
        assert!(is_off(&arm.state()), "{name}");
        arm.enable().unwrap();
        arm.wait_for(Phase::Holding, PATIENCE).unwrap();
        arm.disable().unwrap();
        arm.wait_for(Phase::Disabled, PATIENCE).unwrap();
        assert_eq!(arm.finish(), Outcome::Finished, "{name}");
    }
}

#[test]
fn drives_that_are_left_disabled_are_shut_down_without_having_been_enabled() {
    let arm = VirtualController::start_disabled(&config("arm6-erob.toml"), None).unwrap();
    assert_eq!(arm.finish(), Outcome::Finished);
}

#[test]
fn the_same_calls_give_the_same_run() {
    let run = || {
        let arm = simulated("arm6-erob.toml");
        let home = set_points(&arm.state());
        let near: Vec<f64> = home.iter().map(|home| home + 0.03).collect();
        let moving = arm.move_to(&near).unwrap();
        arm.wait(moving, PATIENCE).unwrap();
        let point = |time_s, offset: f64| TrajectoryPoint {
            time_s,
            positions: near.iter().map(|near| near + offset).collect(),
            ..TrajectoryPoint::default()
        };
        let along = arm.execute(&[point(1.0, 0.05), point(2.0, 0.0)]).unwrap();
        arm.set_speed(along, 0.5).unwrap();
        arm.wait(along, PATIENCE).unwrap();
        arm.begin_stream().unwrap();
        for step in 0..100 {
            let pose: Vec<f64> = near.iter().map(|near| near + 0.0005 * f64::from(step)).collect();
            arm.stream().push_now(&pose).unwrap();
            arm.advance(7).unwrap();
        }
        let state = arm.state();
        assert_eq!(state.groups()[0].stream.state, StreamState::Following);
        assert_eq!(arm.finish(), Outcome::Finished);
        state
    };
    let first = run();
    assert_eq!(first, run());
    assert!(first.axes()[0].position_set > 0.05);
}

#[test]
fn an_axis_that_waits_in_a_trajectory_stands_still_and_one_that_goes_on_is_nowhere_beyond_its_points() {
    for velocities in [vec![], vec![0.0]] {
        let arm = simulated("first.toml");
        let home = set_points(&arm.state())[0];
        let point = |time_s, offset: f64| TrajectoryPoint {
            time_s,
            positions: vec![home + offset],
            velocities: velocities.clone(),
            ..TrajectoryPoint::default()
        };
        let along =
            arm.execute(&[point(20.0, 0.0), point(21.5, 0.1), point(31.5, 0.1), point(33.0, 0.0)]).unwrap();
        let mut seen = vec![];
        while arm.result_of(along).is_none() {
            seen.push(set_points(&arm.advance(1).unwrap())[0] - home);
        }
        assert!(seen[..19_900].iter().all(|offset| *offset == 0.0), "{velocities:?}");
        assert!(seen[21_600..31_400].iter().all(|offset| (offset - 0.1).abs() < 1e-12), "{velocities:?}");
        assert!(seen.iter().all(|offset| (-1e-12..=0.1 + 1e-12).contains(offset)), "{velocities:?}");
    }
}

#[test]
fn time_passes_only_while_somebody_waits() {
    let arm = simulated("first.toml");
    let (before, now_ns) = (arm.state(), arm.now_ns());
    thread::sleep(Duration::from_millis(5));
    assert_eq!((arm.state(), arm.now_ns()), (before, now_ns));
    assert_eq!(arm.advance(0).unwrap().slot, before.slot);
    assert_eq!(arm.advance(1_000).unwrap().slot, before.slot + 1_000);
    assert_eq!(arm.now_ns(), now_ns + 1_000_000_000);
    assert_eq!(arm.next_cycle(PATIENCE).unwrap().slot, before.slot + 1_001);
    assert_eq!(arm.wait_for(Phase::Moving, Duration::from_millis(50)), Err(WaitError::NotInTime));
    assert_eq!(arm.state().slot, before.slot + 1_051);
}

#[test]
fn a_move_by_a_distance_begins_at_the_set_points() {
    let arm = simulated("arm6-erob.toml");
    let home = set_points(&arm.state());
    let distance = [0.1, -0.1, 0.05, 0.0, 0.02, -0.02];
    for _ in 0..2 {
        let motion = arm.move_by(&distance, MoveOptions::default()).unwrap();
        arm.wait(motion, PATIENCE).unwrap();
    }
    for ((now, home), distance) in set_points(&arm.state()).iter().zip(&home).zip(distance) {
        assert!((now - home - 2.0 * distance).abs() < 1e-9);
    }
    assert!(arm.move_by(&[0.1], MoveOptions::default()).is_err());
    assert!(arm.move_by(&[0.0; 7], MoveOptions::default()).is_err());
}

#[test]
fn a_group_is_moved_by_a_distance_alone() {
    let config = config("arm-and-gripper.toml");
    let controller = VirtualController::start(&config, None).unwrap();
    let arm = controller.group("arm").unwrap();
    let before = set_points(&controller.state());
    let distance: Vec<f64> = arm.axis_numbers().iter().map(|_| 0.05).collect();
    let motion = arm.move_by(&distance, MoveOptions::default()).unwrap();
    controller.wait(motion, PATIENCE).unwrap();
    for (axis, (now, before)) in set_points(&controller.state()).iter().zip(&before).enumerate() {
        let expected = if arm.axis_numbers().contains(&axis) { 0.05 } else { 0.0 };
        assert!((now - before - expected).abs() < 1e-9, "axis {axis}");
    }
}

#[test]
fn a_stop_of_the_only_group_by_its_number_stops_it() {
    let arm = simulated("first.toml");
    let only = RequestTarget::Group(0);
    let motion = arm.of(only).move_with(&[0.5], MoveOptions::default()).unwrap();
    arm.step(200);
    let before = arm.of(only).newest_stop();
    arm.of(only).stop(StopCategory::Two).unwrap();
    assert_eq!(arm.of(only).wait_until_still(before, PATIENCE), Ok(()));
    assert!(matches!(arm.wait(motion, PATIENCE), Err(MotionError::Stopped(_))));
    assert_eq!(arm.state().groups()[0].phase, Phase::Holding);
}

#[test]
fn clients_of_several_threads_take_turns() {
    let arm = simulated("arm6-erob.toml");
    let is_over = Arc::new(AtomicBool::new(false));
    let watching: Vec<_> = (0..3)
        .map(|_| {
            let (handle, is_over) = (arm.handle(), Arc::clone(&is_over));
            thread::spawn(move || {
                let mut slot = 0;
                while !is_over.load(Ordering::Relaxed) {
                    let state = handle.cycle_after(slot, PATIENCE).unwrap();
                    assert!(state.slot > slot);
                    slot = state.slot;
                }
                slot
            })
        })
        .collect();
    let home = set_points(&arm.state());
    let near: Vec<f64> = home.iter().map(|home| home + 0.08).collect();
    for target in [&near, &home, &near] {
        let motion = arm.move_to(target).unwrap();
        arm.wait(motion, PATIENCE).unwrap();
    }
    is_over.store(true, Ordering::Relaxed);
    assert!(watching.into_iter().all(|thread| thread.join().unwrap() > 100));
}

#[test]
fn a_stop_from_another_thread_ends_a_wait() {
    let arm = simulated("arm6-erob.toml");
    let far: Vec<f64> = arm.axes().iter().map(|axis| 0.9 * axis.limits.position_max).collect();
    let motion = arm.move_to(&far).unwrap();
    arm.wait_for(Phase::Moving, PATIENCE).unwrap();
    let stopping = arm.handle();
    thread::spawn(move || stopping.stop(StopCategory::Two)).join().unwrap().unwrap();
    assert!(matches!(arm.wait(motion, PATIENCE), Err(MotionError::Stopped(_))));
    arm.wait_for(Phase::Holding, PATIENCE).unwrap();
    let mut events = arm.events();
    assert_eq!(events.wait(Duration::from_millis(100)), Err(WaitError::NotInTime));
}

#[test]
fn every_bus_is_simulated_whatever_its_interface() {
    let mut config = config("first.toml");
    config.buses[0].interface = Interface::SocketCan("no-such-can".into());
    let arm = VirtualController::start(&config, None).unwrap();
    arm.wait(arm.move_to(&[0.5]).unwrap(), PATIENCE).unwrap();
    assert!((arm.state().axes[0].position - 0.5).abs() < 0.01);
}

#[test]
fn nobody_can_command_or_wait_after_the_end() {
    let arm = simulated("first.toml");
    let handle = arm.handle();
    assert_eq!(arm.finish(), Outcome::Finished);
    assert!(handle.has_ended());
    assert_eq!(handle.next_cycle(PATIENCE).unwrap_err(), WaitError::Ended);
    assert_eq!(handle.advance(1).unwrap_err(), WaitError::Ended);
    assert!(handle.move_to(&[0.1]).is_err() && handle.stop(StopCategory::Two).is_err());
    assert_eq!(handle.state().groups()[0].phase, Phase::Disabled);
}

#[test]
fn a_drive_that_cannot_be_enabled_is_told() {
    let mut config = config("first.toml");
    config.axes[0].identity.vendor = Some(0xDEAD);
    let failure = VirtualController::start(&config, None).err();
    assert!(matches!(failure, Some(StartFailure::NotEnabledVirtually { .. })), "{failure:?}");
}

#[test]
fn a_callback_leads_the_axes_of_whoever_waits() {
    let arm = simulated("first.toml");
    let mut calls = 0_u32;
    let leading = arm.in_loop(move |_, _, command| {
        calls += 1;
        command.target(0, takt::rt::AxisTarget::Velocity { velocity: 0.2, acceleration: 0.0 });
        if calls == 500 {
            command.finish();
        }
    });
    let leading = leading.unwrap();
    leading.wait(PATIENCE).unwrap();
    assert_eq!(leading.times().calls, 500);
    assert!((arm.state().axes[0].position - 0.1).abs() < 0.02);
}
