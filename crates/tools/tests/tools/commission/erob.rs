//! Commissioning of the simulated eRob.

use std::path::Path;

use takt::config::Config;
use takt::family;
use takt::family::commission::{CommandValue, Failure, MotionProfile, MoveKind, TargetDrive, Task};
use takt::sim::{DriveFault, SimulatedBus};
use takt_rt::{BusPort, Clock, DriveState, Frame, Id};

use super::bench::*;

fn bench() -> Bench {
    changed(|_| {})
}

fn changed(change: impl FnOnce(&mut Config)) -> Bench {
    let mut config = Config::load(Path::new("../../configs/single-erob.toml")).unwrap();
    config.simulation.longest_gap_ns = u64::MAX;
    change(&mut config);
    Bench::of(TargetDrive::of(&config.axes[0]).unwrap(), takt::simulated_bus(&config, 0))
}

#[test]
fn info_reports_identity_ratings_and_state() {
    let mut bench = bench();
    let report = bench.run(Task::Info).unwrap();
    assert_eq!(report.get("vendor_id"), Some(&0x5A65_726F_u32.into()));
    assert_eq!(report.get("state"), Some(&"switch on disabled".into()));
    assert_eq!(number(&report, "rated_torque"), 31.0);
    assert_eq!(number(&report, "rated_current_a"), 6.3);
    assert_eq!(number(&report, "error_code"), 0.0);
    // The drive has no device name (1008), so the report has none.
    assert_eq!(report.get("device_name"), None);
    // Only SDO uploads were sent.
    assert!(bench.sent.iter().all(|frame| frame.payload()[0] == 0x40), "{:?}", bench.sent);
}

#[test]
fn an_absolute_move_uses_the_handshake_and_ends_at_the_target_without_torque() {
    let mut bench = bench();
    let report = bench.run(move_to(absolute(30.0))).unwrap();
    let seen = bench.observe();
    assert!((seen.position - 30_f64.to_radians()).abs() < 1e-4, "{seen:?}");
    assert_eq!((seen.state, seen.is_braked), (DriveState::SwitchOnDisabled, true));
    assert!(number(&report, "error_counts").abs() <= 100.0, "{report:?}");
    let target_at = bench.sent_at(Frame::of(Id::canopen(0x600, NODE), {
        let [a, b, c, d] = 43_691_i32.to_le_bytes();
        [0x23, 0x7A, 0x60, 0, a, b, c, d]
    }));
    let order = [0x06, 0x07, 0x0F, 0x1F].map(|word| bench.sent_at(write_u16(0x6040, word)));
    assert!(order.is_sorted() && target_at < order[3], "{order:?} {target_at}");
    assert!(bench.fastest > 50_f64.to_radians() && bench.fastest < 61_f64.to_radians(), "{}", bench.fastest);
}

#[test]
fn an_immediate_target_is_marked_by_bit_5() {
    let mut bench = bench();
    bench.run(move_to(MoveKind::Absolute { to: degrees(5.0), is_immediate: true })).unwrap();
    bench.sent_at(write_u16(0x6040, 0x3F));
}

#[test]
fn a_move_without_a_profile_takes_a_tenth_of_the_limits() {
    let mut bench = bench();
    let request =
        Task::Move { kind: absolute(10.0), profile: MotionProfile::default(), keeps_enabled: false };
    bench.run(request).unwrap();
    assert!((8.9..9.2).contains(&bench.fastest.to_degrees()), "{}", bench.fastest.to_degrees());
}

#[test]
fn relative_and_reciprocating_moves_start_at_the_actual_position() {
    let mut bench = bench();
    bench.run(move_to(absolute(20.0))).unwrap();
    bench.run(move_to(MoveKind::Relative(degrees(-5.0)))).unwrap();
    assert!((bench.observe().position.to_degrees() - 15.0).abs() < 0.01);
    let kind = MoveKind::Reciprocate { to: degrees(30.0), times: Some(2), dwell_ns: 50 * MS };
    let report = bench.run(move_to(kind)).unwrap();
    assert_eq!(number(&report, "moves"), 4.0);
    assert!((bench.observe().position.to_degrees() - 15.0).abs() < 0.01);
    let starts = bench.sent.iter().filter(|frame| **frame == write_u16(0x6040, 0x1F)).count();
    assert_eq!(starts, 4);
}

#[test]
fn a_reversed_geared_and_shifted_axis_moves_in_joint_units() {
    let mut bench = changed(|config| {
        let axis = &mut config.axes[0];
        (axis.reversed, axis.gear_ratio, axis.zero_counts) = (true, 2.0, 1000);
    });
    bench.run(move_to(absolute(30.0))).unwrap();
    assert!((bench.observe().position.to_degrees() - 30.0).abs() < 0.01);
    bench.run(move_to(MoveKind::Relative(degrees(-10.0)))).unwrap();
    assert!((bench.observe().position.to_degrees() - 20.0).abs() < 0.01);
    let forward = MoveKind::Continuous { is_forward: true, duration_ns: Some(SECOND / 2) };
    bench.run(move_to(forward)).unwrap();
    assert!(bench.observe().position.to_degrees() > 30.0);
}

#[test]
fn targets_outside_the_limits_are_refused_and_nothing_moves() {
    let mut bench = bench();
    bench.run(move_to(absolute(100.0))).unwrap();
    let before = bench.observe().position;
    let too_fast = MotionProfile { velocity: Some(degrees(91.0)), ..brisk() };
    for request in [
        move_to(absolute(170.5)),
        move_to(MoveKind::Relative(degrees(71.0))),
        move_to(MoveKind::Reciprocate { to: degrees(-171.0), times: Some(1), dwell_ns: 0 }),
        Task::Move { kind: absolute(0.0), profile: too_fast, keeps_enabled: false },
        Task::Velocity {
            velocity: degrees(-91.0),
            profile: brisk(),
            duration_ns: None,
            keeps_enabled: false,
        },
        Task::Torque { torque: CommandValue::Joint(31.5), velocity_limit: None, duration_ns: None },
        Task::Torque { torque: CommandValue::Drive(1100), velocity_limit: None, duration_ns: None },
    ] {
        let failed = bench.run(request.clone()).unwrap_err();
        assert!(matches!(failed.failure, Failure::OutsideLimits { .. }), "{request:?}: {failed:?}");
        assert!(failed.failure.is_refusal());
        let seen = bench.observe();
        assert!((seen.position - before).abs() < 1e-6 && !seen.state.has_torque(), "{request:?}: {seen:?}");
    }
}

#[test]
fn a_velocity_run_lasts_its_time_and_ends_with_a_ramp_to_standstill() {
    let mut bench = bench();
    let request = Task::Velocity {
        velocity: degrees(-40.0),
        profile: brisk(),
        duration_ns: Some(SECOND),
        keeps_enabled: false,
    };
    let report = bench.run(request).unwrap();
    assert!((number(&report, "highest_velocity").to_degrees() + 40.0).abs() < 0.5, "{report:?}");
    assert!((number(&report, "travelled").to_degrees() + 40.0).abs() < 3.0, "{report:?}");
    assert_eq!(bench.observe().state, DriveState::SwitchOnDisabled);
    // The ramp came before the quick stop: the drive was at standstill when its torque went off.
    assert!(bench.steps.contains(&"ramp to standstill"), "{:?}", bench.steps);
}

#[test]
fn an_axis_that_runs_towards_a_limit_stops_before_it() {
    let mut bench = bench();
    let profile = MotionProfile { velocity: Some(degrees(80.0)), ..brisk() };
    let kind = MoveKind::Continuous { is_forward: false, duration_ns: None };
    let failed = bench.run(Task::Move { kind, profile, keeps_enabled: true }).unwrap_err();
    assert!(matches!(failed.failure, Failure::AtLimit { .. }) && failed.step == "run", "{failed:?}");
    let seen = bench.observe();
    let degrees_at = seen.position.to_degrees();
    assert!(degrees_at > -170.0 && degrees_at < -150.0, "{seen:?}");
    assert_eq!(seen.state, DriveState::SwitchOnDisabled);
}

#[test]
fn a_torque_is_sent_in_per_mille_of_the_rated_torque_and_ends_at_standstill() {
    let mut bench = bench();
    let request = Task::Torque {
        torque: CommandValue::Joint(0.93),
        velocity_limit: None,
        duration_ns: Some(SECOND / 2),
    };
    let report = bench.run(request).unwrap();
    assert_eq!(number(&report, "torque_per_mille"), 30.0);
    bench.sent_at(write_u16(0x6071, 30));
    assert!(number(&report, "travelled") > 0.0);
    let seen = bench.observe();
    assert_eq!((seen.state, seen.velocity), (DriveState::SwitchOnDisabled, 0.0));
}

#[test]
fn a_torque_run_ends_when_the_axis_is_too_fast() {
    let mut bench = bench();
    let limit = degrees(10.0);
    let request =
        Task::Torque { torque: CommandValue::Joint(10.0), velocity_limit: Some(limit), duration_ns: None };
    let failed = bench.run(request).unwrap_err();
    assert!(matches!(failed.failure, Failure::AtLimit { .. }) && failed.step == "torque", "{failed:?}");
    assert!(bench.fastest.to_degrees() < 20.0, "{}", bench.fastest.to_degrees());
    assert_eq!(bench.observe().state, DriveState::SwitchOnDisabled);
}

#[test]
fn ctrl_c_stops_a_motion_and_disables() {
    let mut bench = bench();
    let kind = MoveKind::Continuous { is_forward: true, duration_ns: None };
    for keeps_enabled in [false, true] {
        let request = Task::Move { kind, profile: brisk(), keeps_enabled };
        let failed = bench.run_interrupted(request, |step| usize::from(step == "run")).unwrap_err();
        assert_eq!(failed.failure, Failure::Interrupted);
        let seen = bench.observe();
        assert_eq!((seen.state, seen.velocity), (DriveState::SwitchOnDisabled, 0.0));
    }
    let quick_stop_at = bench.sent_at(write_u16(0x6040, 0x02));
    let off_at = bench.sent.iter().rposition(|frame| *frame == write_u16(0x6040, 0)).unwrap();
    assert!(quick_stop_at < off_at);
}

#[test]
fn a_second_ctrl_c_takes_the_torque_off_at_once() {
    let mut bench = changed(|config| config.axes[0].limits.deceleration = 0.2);
    let profile = MotionProfile { deceleration: None, ..brisk() };
    let request =
        Task::Velocity { velocity: degrees(30.0), profile, duration_ns: Some(SECOND), keeps_enabled: false };
    let asked = |step: &str| match step {
        "ramp to standstill" => 1,
        "stop in control" => 2,
        _ => 0,
    };
    let failed = bench.run_interrupted(request, asked).unwrap_err();
    assert_eq!(failed.failure, Failure::Interrupted);
    assert!(bench.steps.contains(&"torque off at once"), "{:?}", bench.steps);
    assert_eq!(bench.observe().state, DriveState::SwitchOnDisabled);
}

#[test]
fn torque_stays_on_only_on_request() {
    let mut bench = bench();
    bench.run(Task::Enable { hold_ns: Some(SECOND / 5), keeps_enabled: false }).unwrap();
    assert!(!bench.observe().state.has_torque());
    bench.run(Task::Enable { hold_ns: None, keeps_enabled: true }).unwrap();
    assert_eq!(bench.observe().state, DriveState::OperationEnabled);
    let request = Task::Move { kind: absolute(5.0), profile: brisk(), keeps_enabled: true };
    bench.run(request).unwrap();
    let seen = bench.observe();
    assert_eq!(seen.state, DriveState::OperationEnabled);
    assert!((seen.position.to_degrees() - 5.0).abs() < 0.01);
    // The drive no longer consumes a heartbeat, so it stays enabled.
    let every = Task::Watch { every_ns: 100 * MS, duration_ns: Some(2 * SECOND) };
    bench.run(every).unwrap();
    assert_eq!(bench.observe().state, DriveState::OperationEnabled);
    let report = bench.run(Task::Disable).unwrap();
    assert_eq!(report.get("was_enabled"), Some(&true.into()));
    assert_eq!(bench.observe().state, DriveState::SwitchOnDisabled);
}

#[test]
fn a_drive_stops_by_itself_when_its_master_dies_in_a_motion() {
    let mut bench = bench();
    let velocity = degrees(20.0);
    let request = Task::Velocity { velocity, profile: brisk(), duration_ns: None, keeps_enabled: false };
    // The program runs for two seconds and then stops.
    assert!(bench.run_for(request, 2 * SECOND, |_, _| {}).is_none());
    assert!(bench.observe().velocity.to_degrees() > 19.0);
    bench.bus.send(22 * SECOND, &[]);
    let seen = bench.observe();
    assert!(!seen.state.has_torque() && seen.velocity == 0.0, "{seen:?}");
}

#[test]
fn a_drive_in_a_fault_is_not_moved_and_the_fault_is_named() {
    let mut bench = bench();
    bench.run(Task::Info).unwrap();
    bench.bus.inject_fault(NODE, DriveFault::OverVoltage).unwrap();
    let failed = bench.run(move_to(absolute(10.0))).unwrap_err();
    let words = failed.failure.to_string();
    assert!(
        words.contains("0x3210 (DC link over-voltage); check the supply; a hard deceleration"),
        "{words}"
    );
    assert_eq!(failed.failure.advice(), None, "the cure is in the words");
    let report = bench.run(Task::ClearFault { is_confirmed: false }).unwrap();
    assert_eq!(report.get("cleared"), Some(&true.into()));
    bench.run(move_to(absolute(10.0))).unwrap();
}

#[test]
fn a_fault_during_a_motion_ends_it_and_is_named() {
    let mut bench = bench();
    let breaks = |bus: &mut SimulatedBus, now_ns: u64| {
        if now_ns == SECOND {
            bus.inject_fault(NODE, DriveFault::OverTemperature).unwrap();
        }
    };
    let failed = bench.run_for(move_to(absolute(90.0)), 5 * SECOND, breaks).unwrap().unwrap_err();
    assert!(
        matches!(&failed.failure, Failure::Faulted { what, .. } if what.to_string().starts_with("0x4310")),
        "{failed:?}"
    );
    assert_eq!((failed.step, bench.observe().state), ("move", DriveState::Fault));
}

#[test]
fn the_battery_fault_is_cleared_only_with_consent() {
    let mut bench = bench();
    bench.run(move_to(MoveKind::Relative(degrees(-40.0)))).unwrap();
    bench.bus.inject_fault(NODE, DriveFault::MultiTurnBattery).unwrap();
    let failed = bench.run(Task::ClearFault { is_confirmed: false }).unwrap_err();
    assert!(matches!(failed.failure, Failure::NeedsConsent { option: "--yes", .. }), "{failed:?}");
    assert_eq!(bench.observe().state, DriveState::Fault);
    bench.run(Task::ClearFault { is_confirmed: true }).unwrap();
    let seen = bench.observe();
    assert_eq!((seen.state, seen.error_code), (DriveState::SwitchOnDisabled, 0));
    assert!((0..524_288).contains(&seen.position_counts), "{seen:?}");
}

#[test]
fn zero_clears_the_turn_count_with_consent_and_never_with_torque() {
    let mut bench = bench();
    assert!(bench.run(Task::Zero { is_confirmed: false }).unwrap_err().failure.is_refusal());
    bench.run(move_to(absolute(-90.0))).unwrap();
    bench.run(Task::Enable { hold_ns: None, keeps_enabled: true }).unwrap();
    let failed = bench.run(Task::Zero { is_confirmed: true }).unwrap_err();
    assert_eq!(failed.failure, Failure::Enabled);
    assert_eq!(bench.run(Task::Save).unwrap_err().failure, Failure::Enabled);
    bench.run(Task::Disable).unwrap();
    let report = bench.run(Task::Zero { is_confirmed: true }).unwrap();
    assert!((number(&report, "before_counts") + 131_072.0).abs() < 200.0, "{report:?}");
    assert!((number(&report, "after_counts") - 393_216.0).abs() < 200.0, "{report:?}");
}

#[test]
fn saved_parameters_survive_a_power_cycle_and_others_do_not() {
    let mut bench = bench();
    bench.run(write("profile velocity", 12_345)).unwrap();
    bench.run(Task::Save).unwrap();
    bench.run(write("profile acceleration", 54_321)).unwrap();
    bench.bus.power_cycle(NODE).unwrap();
    assert_eq!(read(&mut bench, "profile velocity"), 12_345);
    assert_ne!(read(&mut bench, "profile acceleration"), 54_321);
}

#[test]
fn a_missing_node_is_named_and_a_stopped_node_is_woken() {
    let mut bench = bench();
    let absent = TargetDrive { node: 9, ..bench.target.clone() };
    let failed = bench.run_as(absent, Task::Info, |_| 0).unwrap_err();
    assert!(matches!(failed.failure, Failure::Silent { node: 9, other_protocol: None, .. }), "{failed:?}");
    bench.sent_at(Frame::of(Id::base(0x649).unwrap(), [0x00, 0x02]));
    let stop = Frame::of(Id::base(0).unwrap(), [0x02, NODE]);
    let now_ns = bench.clock.now_ns();
    bench.bus.send(now_ns, &[stop]);
    bench.run(Task::Info).unwrap();
    assert!(bench.steps.contains(&"wake from NMT state stopped"), "{:?}", bench.steps);
}

#[test]
fn a_drive_of_another_family_is_read_but_not_moved() {
    let mut bench = bench();
    let other = TargetDrive { drive: family::YZ_AIM, ..bench.target.clone() };
    let request = Task::Move { kind: absolute(1.0), profile: brisk(), keeps_enabled: false };
    let failed = bench.run_as(other, request, |_| 0).unwrap_err();
    assert!(matches!(failed.failure, Failure::OtherDrive { expected: 0x331, .. }), "{failed:?}");
    assert!(!bench.observe().state.has_torque());
}

#[test]
fn homing_is_refused_with_the_modes_that_the_drive_has() {
    let mut bench = bench();
    let home = |method| Task::Home { method, within_ns: SECOND, is_forced: false };
    let words = bench.run(home(None)).unwrap_err().failure.to_string();
    assert!(words.contains("does not declare homing: 6502 names profile position"), "{words}");
    let words = bench.run(home(Some(17))).unwrap_err().failure.to_string();
    assert!(words.contains("needs switches"), "{words}");
}

#[test]
fn tasks_of_the_other_family_are_refused_with_an_alternative() {
    let mut bench = bench();
    for (request, way) in [
        (Task::SetId { node: 5 }, "object 0043"),
        (Task::SetBitRate { bit_rate: 500_000 }, "1 Mbit/s"),
        (Task::Gear { ratio: None }, "gear_ratio"),
        (Task::Interpolation, "interpolate"),
        (Task::AutoHome { is_on: true, is_confirmed: true }, "`move`"),
    ] {
        let failed = bench.run(request.clone()).unwrap_err();
        assert!(failed.failure.is_refusal() && failed.failure.to_string().contains(way), "{failed:?}");
        assert!(bench.sent.is_empty());
    }
}

#[test]
fn the_same_procedure_twice_sends_the_same_frames() {
    let once = || {
        let mut bench = bench();
        bench.run(move_to(absolute(30.0))).unwrap();
        bench.sent
    };
    assert_eq!(once(), once());
}
