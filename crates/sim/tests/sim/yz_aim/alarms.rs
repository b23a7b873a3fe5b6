//! Alarms: their effect on the motor, their signals, and how they are cleared.

use takt::sim::DriveFault;
use takt::sim::plant::EndStops;
use takt_rt::DriveState;

use super::{Bench, NODE, Quirks, YzAimParameters, bench, by_the_manual, parameters};

/// An enabled drive that turns at 500 r/min in mode 3 with a heartbeat every 100 ms.
pub fn turning() -> Bench {
    let mut bench = bench(by_the_manual(NODE));
    bench.write(0x1017, 0, 2, 100).unwrap();
    bench.write(0x6060, 0, 1, 3).unwrap();
    bench.write(0x60FF, 0, 4, 500).unwrap();
    bench.nmt(0x01);
    bench.control(0x0F);
    bench.run_ms(300);
    bench
}

pub fn speed_rpm(bench: &mut Bench) -> f64 {
    bench.observe().velocity * super::RATIO * 60.0 / super::TAU
}

fn last_heartbeat(bench: &mut Bench) -> Vec<u8> {
    bench.take(0x705);
    bench.run_ms(100);
    bench.take(0x705).pop().unwrap()
}

#[test]
fn stopping_alarms_are_signalled_and_release_the_motor_until_they_are_cleared() {
    let faults = [
        (DriveFault::BlockedRotor, 0x12),
        (DriveFault::OverCurrent, 0x12),
        (DriveFault::Stall, 0x14),
        (DriveFault::OverVoltage, 0x15),
    ];
    for (fault, code) in faults {
        let mut bench = turning();
        bench.bus.inject_fault(NODE, fault).unwrap();
        bench.run_ms(2_000);
        assert_eq!((bench.alarm(), bench.statusword() & 0x0F), (code, 0x0B));
        assert_eq!((bench.observe().state, bench.observe().error_code), (DriveState::Fault, code as u16));
        assert_eq!(last_heartbeat(&mut bench), [0x04]);
        assert_eq!((speed_rpm(&mut bench), bench.observe().torque), (0.0, 0.0));
        assert_eq!(bench.read(0x2601, 0), Ok(0));
        bench.control(0x80);
        assert_eq!((bench.alarm(), bench.statusword() & 0x3F), (0, 0));
        assert_eq!(last_heartbeat(&mut bench), [0x05]);
        assert_eq!(bench.read(0x2601, 0), Ok(1));
        bench.control(0x0F);
        bench.run_ms(300);
        assert!((speed_rpm(&mut bench) - 500.0).abs() < 1.0);
    }
}

#[test]
fn the_output_enable_also_clears_an_alarm_and_restarts_the_motor() {
    let mut bench = turning();
    bench.bus.inject_fault(NODE, DriveFault::Stall).unwrap();
    bench.run_ms(1_000);
    bench.write(0x2601, 0, 2, 1).unwrap();
    bench.run_ms(500);
    assert_eq!(bench.alarm(), 0);
    assert!((speed_rpm(&mut bench) - 500.0).abs() < 1.0);
    bench.write(0x2601, 0, 2, 0).unwrap();
    bench.run_ms(2_000);
    assert_eq!((bench.alarm(), bench.statusword() & 0x0C), (0, 0));
    assert_eq!(speed_rpm(&mut bench), 0.0);
}

#[test]
fn an_over_voltage_appears_in_6079_and_cannot_be_cleared_while_it_lasts() {
    let mut bench = turning();
    assert_eq!(bench.read(0x6079, 0), Ok(24 * 327));
    bench.bus.inject_fault(NODE, DriveFault::OverVoltage).unwrap();
    bench.run_ms(10);
    assert!(bench.read(0x6079, 0).unwrap() > 52 * 327);
    bench.control(0x80);
    assert_eq!(bench.alarm(), 0x15);
    bench.run_ms(200);
    assert_eq!(bench.read(0x6079, 0), Ok(24 * 327));
    bench.control(0x80);
    assert_eq!(bench.alarm(), 0);
}

#[test]
fn the_battery_alarm_does_not_stop_the_motor_and_only_the_multi_turn_zero_clears_it() {
    let mut bench = turning();
    assert_eq!(bench.read(0x261E, 0), Ok(10));
    bench.bus.inject_fault(NODE, DriveFault::MultiTurnBattery).unwrap();
    bench.run_ms(500);
    assert!((speed_rpm(&mut bench) - 500.0).abs() < 1.0);
    assert_eq!((bench.alarm(), bench.statusword(), bench.read(0x261E, 0)), (0x10, 0x043F, Ok(0)));
    bench.control(0x80);
    bench.write(0x2601, 0, 2, 1).unwrap();
    bench.run_ms(2_000);
    assert_eq!(bench.alarm(), 0x10);
    let before = bench.position();
    bench.power_cycle();
    assert_eq!((bench.alarm(), bench.position()), (0x10, before.rem_euclid(32_768)));
    bench.write(0x260A, 0, 2, 60_016).unwrap();
    assert_eq!(bench.alarm(), 0x10, "the second step alone does nothing");
    bench.write(0x260A, 0, 2, 60_006).unwrap();
    bench.write(0x260A, 0, 2, 60_016).unwrap();
    assert_eq!((bench.alarm(), bench.read(0x260A, 0)), (0, Ok(32_768)));
    assert!((0..10).contains(&bench.position()));
    bench.power_cycle();
    assert!((0..10).contains(&bench.position()));
}

#[test]
fn statusword_bit_3_shows_the_battery_alarm_only_on_some_units() {
    let quirks = Quirks { shows_battery_alarm: false, ..Quirks::default() };
    let mut bench = bench(YzAimParameters { quirks, ..parameters(NODE) });
    bench.bus.inject_fault(NODE, DriveFault::MultiTurnBattery).unwrap();
    bench.run_ms(10);
    assert_eq!((bench.alarm(), bench.statusword()), (0x10, 0x0404));
}

/// Drives against an end stop with this value in object 2618 and waits 5 s.
fn against_the_end_stop(standstill_output: i64) -> Bench {
    let mut bench = bench(YzAimParameters {
        end_stops: Some(EndStops { lowest: -0.1, highest: 0.1 }),
        ..by_the_manual(NODE)
    });
    bench.write(0x2618, 0, 2, standstill_output).unwrap();
    bench.control(0x2F);
    bench.write(0x607A, 0, 4, 50_000).unwrap();
    bench.run_ms(1_500);
    assert_eq!(bench.alarm(), 0);
    bench.run_ms(3_500);
    bench
}

#[test]
fn a_blocked_rotor_is_detected_after_the_seconds_in_the_ones_digit_of_2618() {
    assert_eq!(against_the_end_stop(603).alarm(), 0x12);
    assert_eq!(against_the_end_stop(609).alarm(), 0);
    assert_eq!(against_the_end_stop(600).alarm(), 0);
}

#[test]
fn the_limits_of_current_and_output_bound_the_torque_at_standstill() {
    let full = against_the_end_stop(600).observe().torque;
    let half = against_the_end_stop(300).observe().torque;
    // 10 A in a motor that produces 0.96 N·m at 4.4 A.
    assert!((full - 10.0 / 4.4 * 0.96 * super::RATIO).abs() < 1e-9, "{full}");
    assert!((half - full / 2.0).abs() < 1e-9, "{half}");
    let mut bench = against_the_end_stop(600);
    // 4.4 A is the current at the rated torque. Object 6078 counts 2000 per ampere.
    bench.write(0x261D, 0, 2, 2_200).unwrap();
    bench.run_ms(10);
    assert!((bench.observe().torque - 0.48 * super::RATIO).abs() < 1e-9);
    assert_eq!(bench.read(0x6078, 0), Ok(4_400));
    bench.write(0x261D, 0, 2, 2_202).unwrap();
    bench.run_ms(2_100);
    assert_eq!(bench.alarm(), 0x12);
}

#[test]
fn a_load_that_limits_the_speed_is_a_stall() {
    let mut bench = turning();
    bench.write(0x60FF, 0, 4, 1_400).unwrap();
    bench.run_ms(500);
    bench.bus.set_load_torque(NODE, -35.0).unwrap();
    bench.run_ms(3_000);
    assert_eq!(bench.alarm(), 0x14);
}
