//! Defects of the servo or its joint: their signals and the drive's reactions.

use takt::sim::Defect;

use super::alarms::{speed_rpm, turning};
use super::{Bench, NODE, bench, by_the_manual, decoded, with_quirks};

impl Bench {
    fn inject_defect(&mut self, defect: Defect) {
        self.bus.inject_defect(NODE, defect, true).unwrap();
    }

    fn remove_defect(&mut self, defect: Defect) {
        self.bus.inject_defect(NODE, defect, false).unwrap();
    }
}

/// The TPDO that replies to RPDO4.
fn tpdo4(bench: &mut Bench) -> Vec<u8> {
    bench.send_data(0x500 + u32::from(NODE), [0; 4]);
    bench.run_ms(1);
    bench.take(0x480 + u32::from(NODE)).pop().unwrap()
}

#[test]
fn a_blocked_joint_does_not_move_until_the_servo_detects_the_blocked_rotor() {
    let mut bench = turning();
    bench.write(0x2618, 0, 2, 602).unwrap();
    bench.inject_defect(Defect::BlockedJoint);
    let before = bench.position();
    bench.run_ms(1_800);
    assert_eq!((bench.position(), bench.alarm()), (before, 0));
    assert!(bench.observe().torque > 1.0);
    bench.run_ms(700);
    assert_eq!((bench.position(), bench.alarm()), (before, 0x12));
    bench.remove_defect(Defect::BlockedJoint);
    bench.control(0x8F);
    bench.run_ms(500);
    assert!((speed_rpm(&mut bench) - 500.0).abs() < 1.0);
}

#[test]
fn a_silent_sdo_server_ignores_requests_and_everything_else_works() {
    let mut bench = turning();
    bench.inject_defect(Defect::SilentSdoServer);
    let halt = [0x2B, 0x40, 0x60, 0, 0x0F, 0x01, 0, 0];
    bench.send_data(0x600 + u32::from(NODE), halt);
    bench.take(0x705);
    bench.run_ms(300);
    assert!(bench.take(0x580 + u32::from(NODE)).is_empty());
    assert_eq!(bench.take(0x705), [[5]; 3]);
    assert!((speed_rpm(&mut bench) - 500.0).abs() < 1.0);
    bench.remove_defect(Defect::SilentSdoServer);
    assert_eq!(bench.read(0x6040, 0), Ok(0x0F));
}

#[test]
fn an_encoder_jump_changes_the_counts_at_once_and_the_servo_returns_to_the_target() {
    let mut bench = bench(by_the_manual(NODE));
    bench.control(0x2F);
    bench.run_ms(100);
    let (before, position) = (bench.observe(), bench.position());
    bench.inject_defect(Defect::EncoderJump { distance: 0.01 });
    let after = bench.observe();
    let counts = (0.01 / super::TAU * super::RATIO * 32_768.0).round() as i32;
    assert_eq!(after.position, before.position);
    assert_eq!(after.position_counts - before.position_counts, counts);
    bench.run_ms(500);
    assert!((bench.position() - position).abs() <= 1, "{} {position}", bench.position());
    assert!((bench.observe().position - before.position + 0.01).abs() < 1e-4);
}

#[test]
fn short_feedback_lacks_the_last_byte_of_every_tpdo_until_the_defect_is_removed() {
    let mut bench = turning();
    let whole = tpdo4(&mut bench).len();
    bench.inject_defect(Defect::ShortFeedback);
    assert_eq!((whole, tpdo4(&mut bench).len()), (6, 5));
    bench.remove_defect(Defect::ShortFeedback);
    assert_eq!(tpdo4(&mut bench).len(), 6);
}

#[test]
fn a_false_statusword_affects_the_tpdos_only_and_set_bits_win_over_cleared_ones() {
    let mut bench = turning();
    let defect = Defect::Statusword { set: 0x0048, clear: 0x0044 };
    bench.inject_defect(defect);
    assert_eq!(decoded(&tpdo4(&mut bench)).1, 0x047B);
    assert_eq!((bench.statusword(), bench.observe().statusword), (0x0437, 0x0437));
    bench.remove_defect(defect);
    assert_eq!(decoded(&tpdo4(&mut bench)).1, 0x0437);
}

#[test]
fn every_alarm_of_the_manual_except_the_battery_alarm_stops_the_motor() {
    for (code, turns) in [(0x10, true), (0x12, false), (0x14, false), (0x15, false), (0x20, false)] {
        let mut bench = turning();
        bench.inject_defect(Defect::Alarm { code });
        assert_eq!((bench.alarm(), bench.statusword() & 8), (u32::from(code), 8));
        bench.run_ms(2_000);
        assert_eq!(speed_rpm(&mut bench).abs() > 1.0, turns, "{code:#x}");
    }
}

#[test]
fn the_alarm_of_the_lost_communication_ends_with_the_next_heartbeat_of_the_master() {
    let mut bench = turning();
    bench.inject_defect(Defect::Alarm { code: 0x20 });
    bench.run_ms(500);
    bench.send_data(0x77F, [0x05]);
    bench.run_ms(500);
    assert_eq!(bench.alarm(), 0);
    assert!((speed_rpm(&mut bench) - 500.0).abs() < 1.0);
}

#[test]
fn an_unknown_alarm_code_is_refused_and_changes_nothing() {
    let without_battery = with_quirks(by_the_manual(NODE), |device| device.simulated.lacks_battery = true);
    for (parameters, code) in
        [(by_the_manual(NODE), 0), (by_the_manual(NODE), 0x7500), (without_battery, 0x10)]
    {
        let mut bench = bench(parameters);
        let before = bench.statusword();
        assert!(bench.bus.inject_defect(NODE, Defect::Alarm { code }, true).is_err(), "{code:#x}");
        assert_eq!((bench.alarm(), bench.statusword()), (0, before));
    }
}
