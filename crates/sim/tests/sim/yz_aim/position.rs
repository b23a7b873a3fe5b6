//! Profile position and velocity.

use takt::sim::plant::JointParameters;
use takt::sim::yz_aim::{Gearing, Model};

use super::{NODE, Quirks, YzAimParameters, bench, by_the_manual, description, parameters, with_quirks};

#[test]
fn an_absolute_target_is_followed_at_once_with_bit_5() {
    let mut bench = bench(by_the_manual(NODE));
    bench.control(0x0F);
    bench.write(0x6060, 0, 1, 1).unwrap();
    bench.control(0x2F);
    bench.write(0x607A, 0, 4, 50_000).unwrap();
    assert_eq!(bench.statusword(), 0x0037);
    bench.run_ms(1000);
    assert_eq!((bench.statusword(), bench.position()), (0x0437, 50_000));
}

#[test]
fn bit_4_starts_relative_moves_and_clears_itself() {
    let mut bench = bench(by_the_manual(NODE));
    bench.control(0x0F);
    bench.write(0x607A, 0, 4, -20_000).unwrap();
    bench.run_ms(50);
    assert_eq!(bench.position(), 0, "without bit 5 a target waits for bit 4");
    bench.control(0x4F);
    for moves in 1..=3 {
        bench.control(0x5F);
        assert_eq!(bench.read(0x6040, 0), Ok(0x4F));
        bench.run_ms(1000);
        assert_eq!((bench.statusword(), bench.position()), (0x0437, -20_000 * moves));
    }
}

/// Time in ms until a move of 10 turns at 1000 r/min has ended.
fn duration_ms(acceleration: i64) -> u64 {
    let mut bench = bench(by_the_manual(NODE));
    bench.write(0x6083, 0, 4, acceleration).unwrap();
    bench.control(0x2F);
    bench.write(0x607A, 0, 4, 327_680).unwrap();
    let began_ns = bench.now_ns;
    while bench.statusword() != 0x0437 {
        bench.run_ms(1);
    }
    (bench.now_ns - began_ns) / 1_000_000
}

#[test]
fn a_ramp_prolongs_the_move_and_60000_means_no_ramp() {
    // 10 turns at 1000 r/min take 600 ms. The ramp adds 1000 r/min divided by its slope.
    assert!(duration_ms(2_000).abs_diff(1_100) < 30);
    assert!(duration_ms(10_000).abs_diff(700) < 30);
    let without_ramp = duration_ms(60_000);
    assert!((600..690).contains(&without_ramp), "{without_ramp}");
}

#[test]
fn a_move_runs_at_6081_limited_to_the_highest_motor_speed() {
    for (asked, expected) in [(300, 300.0), (3_000, 1_500.0)] {
        let mut bench = bench(by_the_manual(NODE));
        bench.write(0x6081, 0, 4, asked).unwrap();
        bench.control(0x2F);
        bench.write(0x607A, 0, 4, 3_276_800).unwrap();
        bench.run_ms(500);
        let tenths = bench.read(0x606C, 0).unwrap() as i32;
        assert!((f64::from(tenths) / 10.0 - expected).abs() < 2.0, "{tenths}");
    }
}

#[test]
fn velocity_follows_60ff_and_bit_8_stops_it_with_the_shaft_held() {
    let mut bench = bench(by_the_manual(NODE));
    bench.write(0x6060, 0, 1, 3).unwrap();
    bench.write(0x60FF, 0, 4, -500).unwrap();
    bench.run_ms(100);
    assert_eq!(bench.position(), 0, "it waits for the controlword");
    bench.control(0x0F);
    bench.run_ms(300);
    assert_eq!(bench.statusword(), 0x0437);
    let velocity = bench.observe().velocity * super::RATIO * 60.0 / super::TAU;
    assert!((velocity + 500.0).abs() < 1.0, "{velocity}");
    bench.control(0x10F);
    assert_eq!(bench.statusword(), 0x0037);
    bench.run_ms(300);
    assert_eq!(bench.statusword(), 0x0437);
    let rest = bench.position();
    bench.bus.set_load_torque(NODE, 5.0).unwrap();
    bench.run_ms(500);
    assert!((bench.position() - rest).abs() < 20, "the shaft is held");
    bench.control(0x0F);
    bench.run_ms(300);
    assert_eq!(bench.statusword(), 0x0437);
    assert!(bench.position() < rest - 50_000);
}

#[test]
fn a_reversed_spindle_counts_in_the_other_direction() {
    let spindle = Gearing { ratio: 2.0, travel_per_turn: 0.005, is_reversed: true, zero_counts: 1_000.0 };
    // 100 kg on the spindle, seen from the nut.
    let nut = JointParameters {
        inertia: 100.0,
        viscous_friction: 200.0,
        coulomb_friction: 30.0,
        friction_shape: takt::config::FrictionShape::Constant,
        brake_torque: 0.0,
    };
    let servo = YzAimParameters::new(description(), NODE, Model::Aim57x30C, spindle, nut);
    let mut bench = bench(YzAimParameters { power_up_ns: 1_000_000, quirks: Quirks::none(), ..servo });
    assert_eq!(bench.position(), 1_000);
    bench.control(0x2F);
    bench.write(0x607A, 0, 4, 66_536).unwrap();
    bench.run_ms(1_500);
    assert_eq!((bench.position(), bench.statusword()), (66_536, 0x0437));
    assert!((bench.observe().position + 0.005).abs() < 1e-7);
}

#[test]
fn a_gear_converts_counts_and_torque_to_the_joint() {
    let screw = Gearing { ratio: 2.0, travel_per_turn: 0.005, is_reversed: true, zero_counts: 7.0 };
    let joint = parameters(NODE).joint;
    let parameters = YzAimParameters::new(description(), NODE, Model::Aim57x30C, screw, joint);
    assert_eq!(parameters.encoder.counts(0.005), -65_536 + 7);
    // 0.96 N·m over 2π rad do the same work as the force over 2.5 mm.
    assert!((parameters.rated_torque * 0.0025 - 0.96 * super::TAU).abs() < 1e-9);
}

#[test]
fn the_first_target_after_enabling_is_ignored_and_its_repetition_followed() {
    let mut bench = bench(parameters(NODE));
    bench.enable_in_steps();
    bench.control(0x2F);
    bench.write(0x607A, 0, 4, 5_000).unwrap();
    bench.run_ms(500);
    assert_eq!(bench.position(), 0);
    bench.write(0x607A, 0, 4, 5_000).unwrap();
    bench.run_ms(500);
    assert_eq!(bench.position(), 5_000);
    bench.write(0x607A, 0, 4, 6_000).unwrap();
    bench.run_ms(500);
    assert_eq!(bench.position(), 6_000, "only the first one");
}

#[test]
fn after_power_up_the_drive_holds_its_shaft_and_0006_releases_it() {
    let mut bench = bench(parameters(NODE));
    bench.bus.set_load_torque(NODE, 5.0).unwrap();
    bench.run_ms(300);
    assert_eq!(bench.statusword(), 0x0404);
    assert!(bench.position().abs() < 20);
    bench.control(0x0F);
    assert_eq!(bench.statusword(), 0x0404, "000Fh is nothing to a cold drive");
    bench.control(0x06);
    bench.run_ms(100);
    assert_eq!(bench.statusword() & 0x37, 0x31);
    assert!(bench.position() > 1_000);
}

#[test]
fn an_increment_is_counted_before_the_electronic_gear_and_acts_at_once() {
    let mut bench = bench(by_the_manual(NODE));
    bench.write(0x260C, 0, 4, -8192).unwrap();
    bench.run_ms(500);
    assert_eq!(bench.position(), -32_768);
    bench.write(0x260A, 0, 2, 3).unwrap();
    bench.write(0x260B, 0, 2, 2).unwrap();
    bench.write(0x260C, 0, 4, 1000).unwrap();
    bench.run_ms(500);
    assert_eq!(bench.position(), -32_768 + 1500);
}

#[test]
fn rpdo2_moves_the_motor_only_when_enabled_with_bit_5() {
    let mut bench = bench(by_the_manual(NODE));
    bench.nmt(0x01);
    let rpdo2 = [0x50, 0xC3, 0, 0, 0xE8, 0x03, 0, 0];
    bench.send_data(0x305, rpdo2);
    bench.run_ms(100);
    assert_eq!(super::decoded(&bench.take(0x285)[0]), (0, 0x0404));
    bench.send_data(0x205, [0x2F, 0, 1, 0x50, 0xC3, 0, 0]);
    bench.run_ms(1);
    assert_eq!(super::decoded(bench.take(0x185).last().unwrap()).1, 0x0037);
    bench.run_ms(1000);
    bench.send_data(0x305, rpdo2);
    bench.run_ms(1);
    assert_eq!(super::decoded(&bench.take(0x285)[0]), (50_000, 0x0437));
}

#[test]
fn tpdo3_contains_the_velocity_in_r_min_or_tenths_depending_on_the_unit() {
    for (has_fine_velocity_in_tpdo3, expected) in [(false, -600), (true, -6_000)] {
        let quirks = Quirks { has_fine_velocity_in_tpdo3, ..Quirks::none() };
        let mut bench = bench(YzAimParameters { quirks, ..parameters(NODE) });
        bench.nmt(0x01);
        for _ in 0..300 {
            bench.send_data(0x405, [0x0F, 0, 3, 0xA8, 0xFD, 0xFF, 0xFF]);
            bench.run_ms(1);
        }
        let answer = bench.take(0x385).pop().unwrap();
        assert_eq!(answer[4..], i32::to_le_bytes(expected));
        assert_eq!(bench.read(0x606C, 0), Ok(-6_000i32 as u32));
    }
}

#[test]
fn a_change_of_mode_during_a_move_ends_it() {
    let mut bench = bench(by_the_manual(NODE));
    bench.control(0x2F);
    bench.write(0x607A, 0, 4, 3_276_800).unwrap();
    bench.run_ms(300);
    bench.write(0x6060, 0, 1, 3).unwrap();
    bench.run_ms(300);
    assert_eq!((bench.statusword(), bench.observe().velocity.abs() < 1e-3), (0x0437, true));
    let rest = bench.position();
    bench.write(0x6060, 0, 1, 1).unwrap();
    bench.run_ms(300);
    assert!((bench.position() - rest).abs() < 5, "the old target was discarded");
}

#[test]
fn without_its_quirks_a_drive_answers_unknown_objects_with_an_abort() {
    let mut bench = bench(with_quirks(parameters(NODE), |device| device.is_silent_if_absent = false));
    assert_eq!(bench.read(0x6084, 0), Err(0x0602_0000));
}
