//! Stored parameters, parameters that need a power cycle, and the drive's own move after power-up.

use takt::sim::yz_aim::{Model, YzAimJoint};
use takt::sim::{Drive, Mailbox, QueueOrder};
use takt_rt::{Frame, Id};

use super::{Bench, MILLISECOND_NS, NODE, YzAimParameters, bench, by_the_manual, parameters, with_quirks};

#[test]
fn parameters_survive_a_power_cycle_only_after_storing_has_finished() {
    let mut bench = bench(parameters(NODE));
    bench.write(0x6083, 0, 4, 5_000).unwrap();
    bench.write(0x2614, 0, 2, 1).unwrap();
    bench.power_cycle();
    assert_eq!(bench.read(0x6083, 0), Ok(20_000), "the supply went while it was storing");
    bench.write(0x6083, 0, 4, 5_000).unwrap();
    bench.write(0x607A, 0, 4, 99).unwrap();
    bench.save();
    bench.power_cycle();
    assert_eq!([0x6083, 0x607A, 0x2614].map(|index| bench.read(index, 0)), [Ok(5_000), Ok(0), Ok(0)]);
}

#[test]
fn a_new_node_id_applies_after_storing_and_a_power_cycle() {
    let mut bench = bench(parameters(NODE));
    bench.write(0x2615, 0, 2, 9).unwrap();
    bench.power_cycle();
    assert_eq!(bench.read(0x2615, 0), Ok(5));
    bench.write(0x2615, 0, 2, 9).unwrap();
    bench.save();
    assert_eq!(bench.read(0x1400, 1), Ok(0x205));
    bench.bus.power_cycle(NODE).unwrap();
    bench.run_ms(10);
    assert_eq!(bench.bus.nodes().collect::<Vec<_>>(), [9]);
    assert_eq!(bench.take(0x709), [[0]]);
    bench.send_data(0x609, [0x40, 0x00, 0x14, 1, 0, 0, 0, 0]);
    bench.send_data(0x605, [0x40, 0x00, 0x14, 1, 0, 0, 0, 0]);
    bench.run_ms(5);
    assert_eq!(bench.take(0x589), [[0x43, 0x00, 0x14, 1, 0x09, 0x02, 0, 0]]);
    assert!(bench.heard.is_empty());
    for address in [0, 128] {
        bench.send_data(0x609, [0x2B, 0x15, 0x26, 0, address, 0, 0, 0]);
        bench.run_ms(5);
        assert_eq!(bench.take(0x589)[0][0], 0x80);
    }
}

#[test]
fn after_a_change_of_bit_rate_the_drive_is_unreachable_on_the_old_bus() {
    let mut drive = YzAimJoint::new(parameters(NODE));
    let mut mailbox = Mailbox::new(QueueOrder::Priority, 16);
    let mut now_ns = 10 * MILLISECOND_NS;
    let mut ask = |drive: &mut YzAimJoint, request: [u8; 8]| {
        drive.receive(now_ns, &Frame::of(Id::canopen(0x600, NODE), request), &mut mailbox);
        now_ns += MILLISECOND_NS;
        drive.advance(now_ns, &mut mailbox);
        std::iter::from_fn(|| mailbox.pop()).count()
    };
    drive.advance(10 * MILLISECOND_NS, &mut Mailbox::new(QueueOrder::Priority, 16));
    for request in [
        [0x2B, 0x00, 0x26, 0, 1, 0, 0, 0],
        [0x23, 0x83, 0x60, 0, 0x22, 3, 0, 0],
        [0x2B, 0x04, 0x26, 0, 129, 0, 0, 0],
        [0x2B, 0x00, 0x26, 0, 0xFA, 1, 0, 0],
    ] {
        assert_eq!(ask(&mut drive, request), 1);
    }
    assert_eq!(drive.bit_rate(), 1_000_000, "until the supply returns");
    drive.power_cycle(20 * MILLISECOND_NS, &mut Mailbox::new(QueueOrder::Priority, 16));
    assert_eq!(drive.bit_rate(), 500_000);
    for _ in 0..2_000 {
        assert_eq!(ask(&mut drive, [0x40, 0, 0x10, 0, 0, 0, 0, 0]), 0);
    }
}

#[test]
fn without_a_battery_the_position_after_power_up_is_within_one_turn() {
    let single_turn = YzAimParameters { initial_position: -3.0, ..by_the_manual(NODE) };
    let mut single = bench(with_quirks(single_turn, |device| device.simulated.lacks_battery = true));
    let first = single.position();
    assert!((0..32_768).contains(&first));
    single.write(0x260C, 0, 4, 5 * 8192).unwrap();
    single.run_ms(1_000);
    assert_eq!(single.position(), first + 5 * 32_768);
    single.power_cycle();
    assert!((single.position() - first).abs() < 2);
    assert!(!Model::Aim42x10C.ratings().has_battery);
    let mut multi = bench(YzAimParameters { initial_position: -3.0, ..by_the_manual(NODE) });
    let first = multi.position();
    assert!(first < -32_768);
    multi.power_cycle();
    assert!((multi.position() - first).abs() < 2);
}

/// A drive at 50 000 counts, set up with this special function and ramp, directly after power-up.
fn after_power_up(special_function: i64, acceleration: i64) -> Bench {
    let mut bench = bench(by_the_manual(NODE));
    bench.write(0x260C, 0, 4, 12_500).unwrap();
    bench.run_ms(1_000);
    assert_eq!(bench.position(), 50_000);
    bench.write(0x2619, 0, 2, special_function).unwrap();
    bench.write(0x6083, 0, 4, acceleration).unwrap();
    bench.save();
    assert_eq!(bench.position(), 50_000);
    bench.power_cycle();
    bench
}

#[test]
fn special_function_6_returns_to_zero_at_the_speed_in_6083() {
    for (acceleration, speed) in [(20_000, 100.0), (20_004, 500.0)] {
        let mut bench = after_power_up(6, acceleration);
        bench.run_ms(100);
        let rpm = bench.observe().velocity * super::RATIO * 60.0 / super::TAU;
        assert!((rpm + speed).abs() < 2.0, "{rpm}");
        bench.run_ms(1_500);
        assert_eq!((bench.position(), bench.statusword()), (0, 0x0404));
    }
}

#[test]
fn special_functions_from_30_on_move_to_an_angle() {
    let mut bench = after_power_up(1_000, 20_009);
    bench.run_ms(1_000);
    assert_eq!(bench.position(), 32_768 + 1_000);
}

#[test]
fn after_the_move_at_power_up_the_speed_of_moves_is_6081() {
    let mut bench = after_power_up(6, 20_000);
    bench.run_ms(2_000);
    bench.write(0x260C, 0, 4, 100_000).unwrap();
    bench.run_ms(300);
    let rpm = bench.observe().velocity * super::RATIO * 60.0 / super::TAU;
    assert!((rpm - 1_000.0).abs() < 2.0, "{rpm}");
}

#[test]
fn a_controlword_ends_the_move_after_power_up() {
    let mut bench = after_power_up(6, 20_000);
    bench.run_ms(100);
    bench.control(0x0F);
    bench.run_ms(500);
    let stopped = bench.position();
    assert!((30_000..49_000).contains(&stopped), "{stopped}");
    bench.run_ms(500);
    assert!((bench.position() - stopped).abs() < 3);
}

#[test]
fn a_stored_gear_numerator_of_0_starts_with_modbus_enabled() {
    let mut bench = bench(parameters(NODE));
    assert_eq!(bench.read(0x2600, 0), Ok(0));
    bench.write(0x260A, 0, 2, 0).unwrap();
    bench.save();
    assert_eq!(bench.read(0x2600, 0), Ok(0));
    bench.power_cycle();
    assert_eq!((bench.read(0x2600, 0), bench.read(0x260A, 0)), (Ok(1), Ok(0)));
}

#[test]
fn writes_that_the_dictionary_does_not_allow_are_aborted() {
    let mut bench = bench(parameters(NODE));
    assert_eq!(bench.write(0x6064, 0, 4, 0), Err(0x0601_0002));
    assert_eq!(bench.write(0x1400, 1, 4, 0x206), Err(0x0601_0002));
    assert_eq!(bench.write(0x1600, 0, 1, 0), Err(0x0601_0002));
    assert_eq!(bench.write(0x6083, 0, 2, 100), Err(0x0607_0013));
    for (index, bytes, value) in [
        (0x6060, 1, 8),
        (0x6060, 1, 2),
        (0x6098, 1, 16),
        (0x60FF, 4, 3001),
        (0x60FF, 4, -3001),
        (0x2600, 2, 2),
    ] {
        assert_eq!(bench.write(index, 0, bytes, value), Err(0x0609_0030), "{index:04X} = {value}");
    }
    // Segmented transfer.
    assert_eq!(bench.sdo([0x21, 0x83, 0x60, 0, 4, 0, 0, 0]), [0x80, 0x83, 0x60, 0, 0x01, 0, 0x04, 0x05]);
}

#[test]
fn unpadded_requests_are_accepted() {
    let mut bench = bench(parameters(NODE));
    bench.send_data(0x605, [0x2F, 0x60, 0x60, 0, 3]);
    bench.run_ms(2);
    bench.send_data(0x605, [0x40, 0x60, 0x60, 0]);
    bench.run_ms(2);
    assert_eq!(bench.take(0x585), [[0x60, 0x60, 0x60, 0, 0, 0, 0, 0], [0x4F, 0x60, 0x60, 0, 3, 0, 0, 0]]);
}
