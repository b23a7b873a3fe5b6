//! The modes in which the drive generates the trajectory: PP, PV, PT.

use takt_rt::statusword::{BIT_12, TARGET_REACHED};

use super::bench::{Bench, COUNTS_PER_RADIAN, NODE};

const TARGET_POSITION: u32 = 0x607A_0020;
const TARGET_VELOCITY: u32 = 0x60FF_0020;

fn in_profile_position(velocity: i64, acceleration: i64) -> Bench {
    let mut bench = Bench::new();
    bench.write(0x6081, 0, 4, velocity).unwrap();
    bench.write(0x6083, 0, 4, acceleration).unwrap();
    bench.write(0x6084, 0, 4, acceleration).unwrap();
    bench.enable(1, TARGET_POSITION, 0);
    bench
}

/// Runs until the target is reached. Returns the number of cycles and the last position.
fn until_reached(bench: &mut Bench, controlword: u16, target: i32) -> (usize, i32) {
    for cycle in 0..20_000 {
        let (statusword, position) = bench.cycle(controlword, target);
        if statusword & TARGET_REACHED != 0 {
            return (cycle, position);
        }
    }
    panic!("not reached");
}

#[test]
fn a_set_point_is_acknowledged_and_reached_in_the_time_of_its_profile() {
    let mut bench = in_profile_position(100_000, 400_000);
    assert_eq!(bench.cycle(0x0F, 50_000).0 & BIT_12, 0);
    for _ in 0..2 {
        bench.cycle(0x1F, 50_000);
    }
    let (statusword, _) = bench.cycle(0x1F, 50_000);
    assert_eq!(statusword & (BIT_12 | TARGET_REACHED), BIT_12);
    for _ in 0..2 {
        bench.cycle(0x0F, 50_000);
    }
    assert_eq!(bench.cycle(0x0F, 50_000).0 & BIT_12, 0);
    // 50000 counts at 100000 counts/s and 400000 counts/s²: 0.75 s.
    let (cycles, position) = until_reached(&mut bench, 0x0F, 50_000);
    assert!((735..765).contains(&(cycles + 6)), "{cycles}");
    assert!((position - 50_000).abs() <= 100);
    for _ in 0..1000 {
        bench.cycle(0x0F, 50_000);
    }
    assert!((bench.observe().position_counts - 50_000).abs() <= 1);
}

#[test]
fn enabling_does_not_move_and_bit_4_needs_a_rising_edge() {
    let mut bench = in_profile_position(100_000, 400_000);
    for _ in 0..200 {
        bench.cycle(0x0F, 50_000);
    }
    assert!(bench.observe().position_counts.abs() <= 1);
    bench.cycle(0x1F, 5_000);
    until_reached(&mut bench, 0x1F, 5_000);
    for _ in 0..500 {
        bench.cycle(0x1F, 9_000);
    }
    assert!((bench.observe().position_counts - 5_000).abs() <= 1);
}

#[test]
fn a_second_set_point_is_buffered_unless_bit_5_is_set() {
    for (bit_5, goes_beyond) in [(0x00, true), (0x20, false)] {
        let mut bench = in_profile_position(100_000, 400_000);
        for (controlword, target, cycles) in
            [(0x1F, 50_000, 3), (0x0F, 50_000, 300), (0x1F | bit_5, 20_000, 3)]
        {
            for _ in 0..cycles {
                bench.cycle(controlword, target);
            }
        }
        let mut highest = 0;
        for _ in 0..2_500 {
            highest = highest.max(bench.cycle(0x0F, 20_000).1);
        }
        assert_eq!(highest > 49_000, goes_beyond, "{highest}");
        assert!((bench.observe().position_counts - 20_000).abs() <= 1);
    }
}

#[test]
fn relative_targets_add_up() {
    let mut bench = in_profile_position(100_000, 400_000);
    for _ in 0..3 {
        for _ in 0..3 {
            bench.cycle(0x0F, 7_000);
        }
        bench.cycle(0x5F, 7_000);
        bench.cycle(0x5F, 7_000);
        bench.cycle(0x5F, 7_000);
        until_reached(&mut bench, 0x5F, 7_000);
    }
    for _ in 0..1000 {
        bench.cycle(0x0F, 7_000);
    }
    assert!((bench.observe().position_counts - 21_000).abs() <= 1);
}

#[test]
fn profile_velocity_0_pauses_a_move_and_another_value_resumes_it() {
    let mut bench = in_profile_position(100_000, 400_000);
    for _ in 0..300 {
        bench.cycle(0x1F, 90_000);
    }
    bench.write(0x6081, 0, 4, 0).unwrap();
    for _ in 0..500 {
        bench.cycle(0x1F, 90_000);
    }
    let stopped = bench.observe().position_counts;
    assert!((20_000..60_000).contains(&stopped) && bench.observe().velocity.abs() < 1e-3);
    bench.write(0x6081, 0, 4, 100_000).unwrap();
    until_reached(&mut bench, 0x1F, 90_000);
}

#[test]
fn halt_stops_a_profile_and_holds_the_position() {
    let mut bench = in_profile_position(100_000, 400_000);
    for _ in 0..300 {
        bench.cycle(0x1F, 90_000);
    }
    for _ in 0..500 {
        bench.cycle(0x11F, 90_000);
    }
    let (statusword, position) = bench.cycle(0x11F, 90_000);
    assert!((20_000..60_000).contains(&position));
    assert_ne!(statusword & TARGET_REACHED, 0);
    until_reached(&mut bench, 0x1F, 90_000);
}

#[test]
fn software_limits_stop_every_move() {
    let mut bench = Bench::new();
    bench.write(0x607D, 1, 4, -10_000).unwrap();
    bench.write(0x607D, 2, 4, 30_000).unwrap();
    bench.write(0x6081, 0, 4, 100_000).unwrap();
    bench.write(0x6083, 0, 4, 400_000).unwrap();
    bench.write(0x6084, 0, 4, 400_000).unwrap();
    bench.enable(1, TARGET_POSITION, 0);
    bench.cycle(0x1F, 50_000);
    until_reached(&mut bench, 0x1F, 50_000);
    for _ in 0..1000 {
        bench.cycle(0x1F, 50_000);
    }
    let (statusword, position) = bench.cycle(0x1F, 50_000);
    assert!((position - 30_000).abs() <= 1);
    assert_ne!(statusword & 0x0800, 0);
}

#[test]
fn profile_velocity_ramps_to_its_target_and_back() {
    let mut bench = Bench::new();
    bench.write(0x6083, 0, 4, 400_000).unwrap();
    bench.write(0x6084, 0, 4, 800_000).unwrap();
    bench.enable(3, TARGET_VELOCITY, 0);
    let (cycles, _) = {
        bench.cycle(0x0F, -160_000);
        bench.cycle(0x0F, -160_000);
        until_reached(&mut bench, 0x0F, -160_000)
    };
    assert!((390..430).contains(&cycles), "{cycles} ms for 0.4 s");
    for _ in 0..200 {
        bench.cycle(0x0F, -160_000);
    }
    let velocity = bench.observe().velocity * COUNTS_PER_RADIAN;
    assert!((velocity + 160_000.0).abs() < 10.0, "{velocity}");
    for _ in 0..210 {
        bench.cycle(0x0F, 0);
    }
    assert!(bench.observe().velocity.abs() < 0.01);
}

#[test]
fn profile_torque_rises_with_its_slope() {
    let mut bench = Bench::new();
    bench.write(0x6087, 0, 4, 1_000).unwrap();
    bench.enable(4, 0x6071_0010, 0);
    for _ in 0..100 {
        bench.cycle(0x0F, 200);
    }
    // 100 per mille of 31 N·m is less than the friction, so nothing moves yet.
    let torque = bench.observe().torque;
    assert!((2.9..3.2).contains(&torque), "{torque}");
    assert_eq!(bench.observe().velocity, 0.0);
    for _ in 0..2_000 {
        bench.cycle(0x0F, 200);
    }
    // 6.2 N·m against 4 N·m + 1.5 N·m·s/rad
    assert!((bench.observe().velocity - 2.2 / 1.5).abs() < 1e-2);
    assert_eq!(bench.read(0x6077, 0), Ok(200));
    assert_eq!(bench.bus.observe(NODE).unwrap().operation_mode, 4);
}
