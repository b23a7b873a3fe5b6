//! Commissioning of the simulated YZ-AIM, compared with the frames in its manual.

use std::f64::consts::TAU;
use std::sync::Arc;

use takt::config::{Limits, Travel};
use takt::family;
use takt::family::commission::{CommandValue, Failure, MotionProfile, MoveKind, TargetDrive, Task};
use takt::sim::homing_switches::{HomingSwitches, Switch};
use takt::sim::plant::{EndStops, JointParameters};
use takt::sim::yz_aim::{Gearing, Model, Quirks, YzAimJoint, YzAimParameters};
use takt::sim::{Drive, DriveFault, SimulatedBus, WireBitRates};
use takt_rt::{BusPort, Clock, Frame, Id, Scale, ScaleParameters};

use super::bench::*;

/// Turns of the motor for one turn of the joint.
const RATIO: f64 = 10.0;

/// The frames of the manual.
const VECTORS: &str = include_str!("../../../../../tests/vectors/yz-aim-vectors.csv");

/// The frame of a row.
fn vector(id: &str) -> Frame {
    let row = VECTORS.lines().find(|row| row.starts_with(&format!("{id},"))).unwrap();
    let wire = row.split("WIRE=").nth(1).unwrap().trim_end_matches('"');
    let (can_id, data) = wire.split_once('#').unwrap();
    let bytes: Vec<u8> =
        (0..data.len() / 2).map(|at| u8::from_str_radix(&data[2 * at..2 * at + 2], 16).unwrap()).collect();
    Frame::data(Id::base(u32::from_str_radix(can_id, 16).unwrap()).unwrap(), &bytes).unwrap()
}

fn parameters() -> YzAimParameters {
    let gearing = Gearing { ratio: RATIO, travel_per_turn: TAU, is_reversed: false, zero_counts: 0.0 };
    let joint = JointParameters {
        inertia: 0.02,
        viscous_friction: 0.1,
        coulomb_friction: 0.5,
        friction_shape: takt::config::FrictionShape::Constant,
        brake_torque: 0.0,
    };
    let device = family::yz_aim::device();
    let description = (Arc::new(device.dictionary.clone()), device.quirks.clone());
    YzAimParameters { seed: 7, ..YzAimParameters::new(description, NODE, Model::Aim57x30C, gearing, joint) }
}

fn limits() -> Limits {
    Limits {
        position_min: -20.0,
        position_max: 20.0,
        velocity: 15.0,
        acceleration: 400.0,
        deceleration: 400.0,
        jerk: f64::INFINITY,
        torque: 10.0,
    }
}

fn with(drives: Vec<YzAimParameters>) -> Bench {
    let scale = ScaleParameters {
        counts_per_turn: 32_768.0,
        velocity_units_per_turn: 60.0,
        gear_ratio: RATIO,
        travel_per_turn: TAU,
        reversed: false,
        zero_counts: 0.0,
        rated_torque: 1.0,
    };
    let target = TargetDrive {
        name: "joint".to_owned(),
        node: NODE,
        drive: family::YZ_AIM,
        travel: Travel::Rotary,
        counts_per_turn: 32_768.0,
        rated_torque: None,
        scale: Scale::new(scale).unwrap(),
        axis: None,
        limits: Some(limits()),
        patience_ns: SECOND,
    };
    let rates = WireBitRates { nominal: 1_000_000, data: None };
    let boxed = |parameters| -> Box<dyn Drive> { Box::new(YzAimJoint::new(parameters)) };
    let drives = drives.into_iter().map(boxed).collect();
    Bench::of(target, SimulatedBus::with_drives(rates, u64::MAX, drives))
}

fn bench() -> Bench {
    with(vec![parameters()])
}

/// 1000 r/min and 20000 (r/min)/s, as in the manual's examples.
fn profile() -> MotionProfile {
    MotionProfile {
        velocity: Some(CommandValue::Drive(1000)),
        acceleration: Some(CommandValue::Drive(20_000)),
        deceleration: None,
    }
}

fn move_to(kind: MoveKind) -> Task {
    Task::Move { kind, profile: profile(), keeps_enabled: false }
}

fn raw(position: i64) -> MoveKind {
    MoveKind::Absolute { to: CommandValue::Drive(position), is_immediate: false }
}

fn is_enabled(bench: &mut Bench) -> bool {
    bench.observe().statusword & 0x37 == 0x37
}

/// Asserts that the frames of these rows were sent in this order.
fn assert_sent(bench: &Bench, rows: &[&str]) {
    let mut from = 0;
    for row in rows {
        let frame = vector(row);
        let found = bench.sent[from..].iter().position(|sent| *sent == frame);
        from += 1 + found.unwrap_or_else(|| panic!("{row} {frame:?} not in {:?}", &bench.sent[from..]));
    }
}

#[test]
fn info_reports_alarm_supply_battery_gear_and_special_function() {
    let mut bench = bench();
    let report = bench.run(Task::Info).unwrap();
    assert_eq!(number(&report, "vendor_id"), f64::from(0x331));
    assert_eq!(number(&report, "alarm"), 0.0);
    assert!((number(&report, "voltage_v") - 24.0).abs() < 0.1, "{report:?}");
    assert_eq!(report.get("gear"), Some(&"32768:8192".into()));
    assert_eq!(number(&report, "special_function"), 0.0);
    assert!(number(&report, "battery_percent") > 0.0);
    assert!(bench.sent.iter().all(|frame| frame.payload()[0] == 0x40), "{:?}", bench.sent);
    assert_sent(&bench, &["D031"]);
}

#[test]
fn an_absolute_move_is_as_in_the_manual_and_survives_an_ignored_first_target() {
    for quirks in [Quirks::none(), Quirks::default()] {
        let mut bench = with(vec![YzAimParameters { quirks, ..parameters() }]);
        let report = bench.run(move_to(raw(50_000))).unwrap();
        // 6060 = 1, 6081 = 1000, 6083 = 20000, 6064?, 000F, 002F, 607A = 50000, 6041?
        assert_sent(&bench, &["V003", "V007", "V009", "V005", "V001", "V011", "V013", "V015"]);
        assert!(number(&report, "error_counts").abs() <= 10.0, "{report:?}");
        assert_eq!(bench.notes.is_empty(), !quirks.ignores_first_target, "{:?}", bench.notes);
        assert!(!is_enabled(&mut bench));
        let counts = bench.observe().position_counts;
        assert!((counts - 50_000).abs() < 100, "{counts}");
    }
}

#[test]
fn a_relative_move_is_as_in_the_manual_and_is_sent_once() {
    for quirks in [Quirks::none(), Quirks::default()] {
        let mut bench = with(vec![YzAimParameters { quirks, ..parameters() }]);
        for expected in [50_000, 100_000] {
            bench.run(move_to(MoveKind::Relative(CommandValue::Drive(50_000)))).unwrap();
            // 6060 = 1, 6081, 6083, 000F, 607A = 50000, 004F, 005F, 6041?
            assert_sent(&bench, &["V019", "V023", "V025", "V017", "V021", "V027", "V029", "V031"]);
            let counts = bench.observe().position_counts;
            assert!((counts - expected).abs() < 200, "{counts}");
        }
    }
}

#[test]
fn a_target_outside_the_limits_is_refused_and_the_drive_is_not_changed() {
    let mut bench = bench();
    for kind in [
        MoveKind::Absolute { to: CommandValue::Joint(20.1), is_immediate: false },
        MoveKind::Relative(CommandValue::Joint(-20.1)),
        MoveKind::Reciprocate { to: CommandValue::Joint(21.0), times: Some(1), dwell_ns: 0 },
    ] {
        let failed = bench.run(move_to(kind)).unwrap_err();
        assert!(matches!(failed.failure, Failure::OutsideLimits { .. }), "{failed:?}");
        assert!(bench.sent.iter().all(|frame| frame.payload()[0] == 0x40), "{:?}", bench.sent);
    }
}

#[test]
fn a_velocity_run_is_as_in_the_manual_and_ends_with_a_ramp() {
    let mut bench = bench();
    let request = Task::Velocity {
        velocity: CommandValue::Drive(1000),
        profile: MotionProfile::default(),
        duration_ns: Some(SECOND),
        keeps_enabled: false,
    };
    let report = bench.run(request).unwrap();
    assert_sent(&bench, &["V033", "V035", "V037", "V039"]);
    let rpm = number(&report, "highest_velocity") * RATIO * 60.0 / TAU;
    assert!((rpm - 1000.0).abs() < 20.0, "{rpm}");
    assert!((number(&report, "travelled") - 1000.0 / 60.0 * TAU / RATIO).abs() < 1.5, "{report:?}");
    assert!(!is_enabled(&mut bench));
}

#[test]
fn reciprocating_and_continuous_moves_end_at_standstill() {
    let mut bench = bench();
    let kind = MoveKind::Reciprocate { to: CommandValue::Joint(1.0), times: Some(2), dwell_ns: 20 * MS };
    let report = bench.run(move_to(kind)).unwrap();
    assert_eq!(number(&report, "moves"), 4.0);
    assert!(bench.observe().position.abs() < 1e-2);
    let kind = MoveKind::Continuous { is_forward: false, duration_ns: None };
    let failed = bench.run(move_to(kind)).unwrap_err();
    assert!(matches!(failed.failure, Failure::AtLimit { .. }), "{failed:?}");
    let position = bench.observe().position;
    assert!((-20.0..-15.0).contains(&position), "{position}");
    assert!(!is_enabled(&mut bench));
}

#[test]
fn ctrl_c_stops_and_disables_in_every_mode() {
    let forever = MoveKind::Continuous { is_forward: true, duration_ns: None };
    let slow = MotionProfile { velocity: Some(CommandValue::Drive(100)), ..profile() };
    let far = MoveKind::Absolute { to: CommandValue::Drive(200_000), is_immediate: false };
    for (kind, at) in
        [(forever, "run"), (far, "move"), (MoveKind::Relative(CommandValue::Joint(5.0)), "move")]
    {
        let mut bench = bench();
        let request = Task::Move { kind, profile: slow, keeps_enabled: true };
        let failed = bench.run_interrupted(request, |step| usize::from(step == at)).unwrap_err();
        assert_eq!((failed.failure, failed.step), (Failure::Interrupted, at));
        assert!(!is_enabled(&mut bench));
        assert!(bench.observe().velocity.abs() < 1e-3);
    }
}

#[test]
fn torque_stays_on_only_on_request() {
    let mut bench = bench();
    bench.run(Task::Enable { hold_ns: Some(SECOND / 5), keeps_enabled: false }).unwrap();
    assert!(!is_enabled(&mut bench));
    bench.run(Task::Enable { hold_ns: None, keeps_enabled: true }).unwrap();
    assert!(is_enabled(&mut bench));
    // Only a heartbeat would arm the heartbeat watchdog again, and no node sends one.
    bench.run(Task::Watch { every_ns: 100 * MS, duration_ns: Some(5 * SECOND) }).unwrap();
    assert!(is_enabled(&mut bench));
    assert_eq!(read(&mut bench, "consumer heartbeat time"), 0x007F_07D0);
    assert_eq!(bench.run(Task::Save).unwrap_err().failure, Failure::Enabled);
    bench.run(Task::Disable).unwrap();
    assert!(!is_enabled(&mut bench));
}

#[test]
fn an_enabled_axis_stays_enabled_for_the_next_motion() {
    let mut bench = bench();
    bench.run(Task::Enable { hold_ns: None, keeps_enabled: true }).unwrap();
    let velocity = Task::Velocity {
        velocity: CommandValue::Drive(300),
        profile: profile(),
        duration_ns: Some(SECOND / 2),
        keeps_enabled: true,
    };
    let kind = MoveKind::Relative(CommandValue::Drive(20_000));
    for request in [velocity, Task::Move { kind, profile: profile(), keeps_enabled: true }] {
        bench.run(request).unwrap();
        let shutdown = Frame::of(Id::canopen(0x600, NODE), [0x2B, 0x40, 0x60, 0, 0x06, 0, 0, 0]);
        assert!(!bench.sent.contains(&shutdown), "{:?}", bench.sent);
        assert!(is_enabled(&mut bench));
    }
}

#[test]
fn a_drive_stops_by_itself_when_its_master_dies_in_a_motion() {
    let mut bench = bench();
    let request = Task::Velocity {
        velocity: CommandValue::Drive(300),
        profile: profile(),
        duration_ns: None,
        keeps_enabled: false,
    };
    assert!(bench.run_for(request, 2 * SECOND, |_, _| {}).is_none());
    assert!(bench.observe().velocity > 2.0);
    bench.bus.send(6 * SECOND, &[]);
    assert!(bench.observe().velocity.abs() < 1e-3);
}

#[test]
fn homing_finds_the_switch_by_setting_the_mode() {
    let mut bench = with(vec![YzAimParameters {
        switches: HomingSwitches { dir: Some(Switch::below(-0.6)), pu: None },
        end_stops: Some(EndStops { lowest: -1.0, highest: 1.0 }),
        ..parameters()
    }]);
    let home = |method| Task::Home { method, within_ns: 30 * SECOND, is_forced: false };
    let report = bench.run(home(Some(17))).unwrap();
    assert_sent(&bench, &["V046", "V048", "V050"]);
    assert!(number(&report, "home_counts").abs() < 300.0, "{report:?}");
    assert!((bench.observe().position + 0.6).abs() < 0.02, "{:?}", bench.observe());
    assert!(matches!(
        bench.run(home(Some(20))).unwrap_err().failure,
        Failure::NeedsConsent { option: "--force", .. }
    ));
    assert!(matches!(bench.run(home(Some(1))).unwrap_err().failure, Failure::Unsupported { .. }));
    assert!(matches!(bench.run(home(None)).unwrap_err().failure, Failure::Missing { .. }));
}

#[test]
fn homing_that_takes_too_long_is_halted() {
    let mut bench = bench();
    let request = Task::Home { method: Some(17), within_ns: SECOND, is_forced: false };
    let failed = bench.run(request).unwrap_err();
    assert!(matches!(failed.failure, Failure::Homing(words) if words.contains("in time")), "{failed:?}");
    let seen = bench.observe();
    assert!(seen.velocity.abs() < 1e-3 && seen.statusword & 0x37 != 0x37, "{seen:?} {:?}", bench.steps);
}

#[test]
fn the_multi_turn_zero_is_set_with_consent_and_verified() {
    let mut bench = bench();
    bench.run(move_to(raw(40_000))).unwrap();
    assert!(bench.run(Task::Zero { is_confirmed: false }).unwrap_err().failure.is_refusal());
    let report = bench.run(Task::Zero { is_confirmed: true }).unwrap();
    assert_sent(&bench, &["D016", "D017"]);
    assert!((0.0..=9.0).contains(&number(&report, "after_counts")), "{report:?}");
}

#[test]
fn stored_parameters_survive_a_power_cycle() {
    let mut bench = bench();
    let gains = |position_proportional| Task::Gains {
        position_proportional,
        velocity_proportional: None,
        velocity_integration: None,
    };
    bench.run(gains(Some(2_500))).unwrap();
    bench.run(Task::Save).unwrap();
    assert_sent(&bench, &["D013", "D014"]);
    bench.run(gains(Some(900))).unwrap();
    bench.bus.power_cycle(NODE).unwrap();
    assert_eq!(number(&bench.run(gains(None)).unwrap(), "position_proportional"), 2_500.0);
}

#[test]
fn another_node_id_needs_the_drive_alone_on_its_bus() {
    let mut bench = with(vec![parameters(), YzAimParameters { node: 5, ..parameters() }]);
    let failed = bench.run(Task::SetId { node: 2 }).unwrap_err();
    assert!(matches!(&failed.failure, Failure::Unsuitable(words) if words.contains("(5)")), "{failed:?}");
    let mut bench = self::bench();
    bench.run(Task::SetId { node: 2 }).unwrap();
    assert_sent(&bench, &["D026", "D013", "D014"]);
    bench.bus.power_cycle(NODE).unwrap();
    bench.target.node = 2;
    bench.run(Task::Info).unwrap();
}

#[test]
fn the_bit_rate_is_changed_by_four_writes_in_order() {
    let mut bench = bench();
    bench.run(Task::SetBitRate { bit_rate: 500_000 }).unwrap();
    assert_sent(&bench, &["D019", "D021", "D024", "D025"]);
    assert!(bench.notes.iter().any(|note| note.contains("power-cycle") && note.contains("6083:00 = 20000")));
    let failed = bench.run(Task::SetBitRate { bit_rate: 800_000 }).unwrap_err();
    assert!(matches!(failed.failure, Failure::Unsupported { .. }), "{failed:?}");
}

#[test]
fn alarms_are_named_and_each_is_cleared_in_its_own_way() {
    let mut bench = bench();
    bench.run(Task::Info).unwrap();
    bench.bus.inject_fault(NODE, DriveFault::BlockedRotor).unwrap();
    let failed = bench.run(move_to(raw(1000))).unwrap_err();
    assert!(failed.failure.to_string().contains("12h (blocked rotor)"), "{failed:?}");
    bench.run(Task::ClearFault { is_confirmed: false }).unwrap();
    assert_sent(&bench, &["D027"]);
    bench.bus.inject_fault(NODE, DriveFault::MultiTurnBattery).unwrap();
    let failed = bench.run(Task::ClearFault { is_confirmed: false }).unwrap_err();
    assert!(matches!(failed.failure, Failure::NeedsConsent { .. }), "{failed:?}");
    bench.run(Task::ClearFault { is_confirmed: true }).unwrap();
    assert_sent(&bench, &["D016", "D017"]);
    bench.run(move_to(raw(1000))).unwrap();
}

#[test]
fn a_lost_master_is_cleared_by_a_heartbeat_without_motion() {
    let mut bench = bench();
    bench.run(Task::Enable { hold_ns: None, keeps_enabled: true }).unwrap();
    // Another master sent one heartbeat and then stopped.
    let now_ns = bench.clock.now_ns();
    bench.bus.send(now_ns, &[vector("D011")]);
    bench.run(Task::Watch { every_ns: 100 * MS, duration_ns: Some(3 * SECOND) }).unwrap();
    assert_eq!(read(&mut bench, "alarm code"), 0x20);
    let before = bench.observe().position_counts;
    let report = bench.run(Task::ClearFault { is_confirmed: false }).unwrap();
    assert_eq!(report.get("cleared"), Some(&true.into()));
    assert_sent(&bench, &["D011"]);
    bench.run(Task::Watch { every_ns: 100 * MS, duration_ns: Some(5 * SECOND) }).unwrap();
    assert_eq!(read(&mut bench, "alarm code"), 0);
    assert!((bench.observe().position_counts - before).abs() < 10);
    assert!(!is_enabled(&mut bench));
}

#[test]
fn motion_at_power_up_needs_consent() {
    let mut bench = bench();
    let auto_home = |is_on, is_confirmed| Task::AutoHome { is_on, is_confirmed };
    assert!(bench.run(auto_home(true, false)).unwrap_err().failure.is_refusal());
    let report = bench.run(auto_home(true, true)).unwrap();
    assert_sent(&bench, &["D018", "D013", "D014"]);
    assert_eq!(number(&report, "return_speed_rpm"), 100.0);
    bench.run(auto_home(false, false)).unwrap();
    assert_eq!(read(&mut bench, "special function"), 0);
}

#[test]
fn interpolation_is_set_up_and_stored_without_a_ramp() {
    let mut bench = bench();
    bench.run(Task::Interpolation).unwrap();
    assert_sent(&bench, &["D012", "D013", "D014"]);
    bench.bus.power_cycle(NODE).unwrap();
    assert_eq!(read(&mut bench, "special function"), 7);
    assert_eq!(read(&mut bench, "motor acceleration"), 60_000);
}

#[test]
fn the_gear_is_read_and_changed_and_command_keys_are_refused() {
    let mut bench = bench();
    let report = bench.run(Task::Gear { ratio: Some((256, 25)) }).unwrap();
    assert_eq!(number(&report, "pulses_per_turn"), 3200.0);
    let failed = bench.run(Task::Gear { ratio: Some((60_006, 1)) }).unwrap_err();
    assert!(failed.failure.is_refusal(), "{failed:?}");
    assert_eq!(read(&mut bench, "electronic gear numerator"), 256);
}

#[test]
fn a_missing_object_is_named_after_a_timeout() {
    let mut bench = bench();
    let failed = bench.run(Task::Read { names: vec!["6502".to_owned()], data_type: None }).unwrap_err();
    assert!(failed.failure.to_string().starts_with("reading 6502:00: no reply"), "{failed:?}");
    assert!(matches!(
        bench.run(Task::Torque { torque: CommandValue::Drive(1), velocity_limit: None, duration_ns: None }),
        Err(failed) if failed.failure.is_refusal()
    ));
}
