//! The modes in which the master generates the trajectory: CSP, CSV, CST.

use takt::sim::cia402::{Cia402AxisParameters, Cia402Parameters};
use takt::sim::plant::Encoder;
use takt_rt::DriveState;

use super::bench::{Bench, COUNTS_PER_RADIAN, MILLISECOND_NS, NODE, axis, parameters};

const TARGET_POSITION: u32 = 0x607A_0020;
const TARGET_VELOCITY: u32 = 0x60FF_0020;
const TARGET_TORQUE: u32 = 0x6071_0010;

fn with_axis(axis: Cia402AxisParameters) -> Cia402Parameters {
    Cia402Parameters { axes: vec![axis], ..parameters(NODE) }
}

/// A quintic of 2 rad in 2 s in counts: 1.9 rad/s, 5.8 rad/s² at most.
fn quintic(cycle: i32) -> i32 {
    let s = (f64::from(cycle) / 2000.0).clamp(0.0, 1.0);
    (2.0 * COUNTS_PER_RADIAN * s * s * s * (10.0 + s * (6.0 * s - 15.0))).round() as i32
}

#[test]
fn csp_follows_a_move_and_rests_within_one_count() {
    let mut bench = Bench::new();
    bench.enable(8, TARGET_POSITION, 0);
    let mut worst = 0;
    for cycle in 0..2500 {
        // A target is sent in one cycle, latched at the next SYNC and reached at the one after.
        // The position sampled now therefore belongs to the target of two cycles ago.
        let (_, position) = bench.cycle(0x0F, quintic(cycle));
        worst = worst.max((position - quintic(cycle - 2)).abs());
    }
    assert!(worst < 40, "{worst} counts");
    let (statusword, position) = bench.cycle(0x0F, quintic(2500));
    assert!((position - quintic(2500)).abs() <= 1, "{position}");
    assert_eq!(statusword & 0x046F, 0x0427);
}

#[test]
fn csp_follows_a_ramp_with_an_error_that_does_not_grow() {
    let mut bench = Bench::new();
    bench.enable(8, TARGET_POSITION, 0);
    for cycle in 0..3_000 {
        let (_, position) = bench.cycle(0x0F, 150 * cycle);
        let error = position - 150 * (cycle - 2);
        // The control loops need about 100 ms for the velocity step at the beginning.
        assert!(cycle < 300 || error.abs() <= 3, "{error} in cycle {cycle}");
    }
}

#[test]
fn csp_rests_within_one_count_after_many_small_and_large_moves() {
    let mut bench = Bench::new();
    bench.enable(8, TARGET_POSITION, 0);
    let mut target = 0;
    for (distance, cycles) in [(1, 1), (-3, 1), (100, 10), (-40_000, 400), (7, 1), (80_000, 800), (-1, 1)] {
        let start = target;
        for cycle in 1..=cycles {
            bench.cycle(0x0F, start + distance * cycle / cycles);
        }
        target += distance;
        for _ in 0..800 {
            bench.cycle(0x0F, target);
        }
        for _ in 0..200 {
            let (_, position) = bench.cycle(0x0F, target);
            assert!((position - target).abs() <= 1, "{position} instead of {target}");
        }
    }
}

#[test]
fn a_reversed_joint_with_an_offset_moves_in_its_own_direction() {
    let encoder = Encoder { counts_per_unit: -COUNTS_PER_RADIAN, zero_counts: 1000.0 };
    let mut bench = Bench::with(vec![with_axis(Cia402AxisParameters { encoder, ..axis() })]);
    bench.enable(8, TARGET_POSITION, 1000);
    for cycle in 0..3000 {
        bench.cycle(0x0F, 1000 + quintic(cycle));
    }
    let observed = bench.observe();
    assert!((observed.position_counts - 1000 - quintic(2000)).abs() <= 1);
    assert!((observed.position + 2.0).abs() < 3.0 / COUNTS_PER_RADIAN);
}

#[test]
fn enabling_with_a_stale_target_makes_the_axis_jump() {
    let start = with_axis(Cia402AxisParameters { initial_position: 0.5, ..axis() });
    let mut bench = Bench::with(vec![start]);
    bench.enable(8, TARGET_POSITION, 0);
    let mut fastest = 0.0f64;
    for _ in 0..1000 {
        bench.cycle(0x0F, 0);
        fastest = fastest.max(bench.observe().velocity.abs());
    }
    assert!(fastest > 3.0, "{fastest} rad/s");
    assert!(bench.observe().position_counts.abs() <= 1);
}

#[test]
fn the_last_target_is_reached_and_held_when_sync_is_missing() {
    let mut bench = Bench::new();
    bench.enable(8, TARGET_POSITION, 0);
    for cycle in 0..1000 {
        bench.cycle(0x0F, 100 * cycle);
    }
    bench.run_ms(2_000);
    // The target of cycle 998 was latched at the last SYNC, and that of cycle 999 is still buffered.
    assert!((bench.observe().position_counts - 99_800).abs() <= 1);
    assert_eq!(bench.observe().state, DriveState::OperationEnabled);
}

#[test]
fn late_syncs_do_not_disturb_the_motion() {
    let mut bench = Bench::new();
    bench.enable(8, TARGET_POSITION, 0);
    for cycle in 0..1_500i32 {
        // Each SYNC is 0 to 300 µs late, in irregular order.
        let late_ns = (cycle * 7_919) % 300 * 1_000;
        bench.run_ns(late_ns as u64);
        bench.send_data(0x080, []);
        let [a, b, c, d] = (150 * cycle).to_le_bytes();
        bench.send_data(0x205, [0x0F, 0, a, b, c, d]);
        bench.run_ns(MILLISECOND_NS - late_ns as u64);
        if cycle > 300 {
            let velocity = bench.observe().velocity * COUNTS_PER_RADIAN;
            assert!((velocity - 150_000.0).abs() < 2_000.0, "{velocity} in cycle {cycle}");
        }
    }
}

#[test]
fn csp_also_works_with_event_driven_rpdos() {
    let mut bench = Bench::new();
    bench.enable(8, TARGET_POSITION, 0);
    bench.write(0x1400, 2, 1, 255).unwrap();
    let mut worst = 0;
    for cycle in 0..2_000 {
        let (_, position) = bench.cycle(0x0F, 100 * cycle);
        if cycle > 300 {
            // The target arrives at 0.7 of a cycle and is reached one period later, so a third is done at SYNC.
            worst = worst.max((position - 100 * (cycle - 2) - 33).abs());
        }
    }
    // How far the joint goes in a step of the loops: 250 µs.
    assert!(worst <= 25, "{worst}");
}

#[test]
fn csv_reaches_the_target_velocity() {
    let mut bench = Bench::new();
    bench.enable(9, TARGET_VELOCITY, 0);
    for _ in 0..300 {
        bench.cycle(0x0F, 100_000);
    }
    let velocity = bench.observe().velocity * COUNTS_PER_RADIAN;
    assert!((velocity - 100_000.0).abs() < 10.0, "{velocity}");
    for _ in 0..300 {
        bench.cycle(0x0F, 0);
    }
    assert!(bench.observe().velocity.abs() < 1e-4);
}

#[test]
fn cst_accelerates_the_inertia_with_the_torque_minus_friction() {
    let mut bench = Bench::new();
    bench.enable(10, TARGET_TORQUE, 0);
    // 400 per mille of 31 N·m less 4 N·m: 8.4 N·m on 0.4 kg·m².
    bench.cycle(0x0F, 400);
    for _ in 0..10 {
        bench.cycle(0x0F, 400);
    }
    let velocity = bench.observe().velocity;
    // SYNC takes 51 µs, so the last whole step of the loops ends 9.75 ms after the one that set the torque.
    assert!((velocity - 5.6 * (1.0 - (-3.75f64 * 9.75e-3).exp())).abs() < 0.001, "{velocity}");
    assert!((bench.observe().torque - 12.4).abs() < 1e-9);
}

#[test]
fn no_mode_exceeds_the_peak_torque_or_runs_away() {
    let mut bench = Bench::new();
    bench.enable(10, TARGET_TORQUE, 0);
    for _ in 0..3_000 {
        bench.cycle(0x0F, 30_000);
        let observed = bench.observe();
        assert!(observed.torque <= 56.0 && observed.velocity < 4.05, "{observed:?}");
    }
}

#[test]
fn torque_offset_and_velocity_offset_are_fed_forward() {
    let mut bench = Bench::new();
    bench.enable(9, TARGET_VELOCITY, 0);
    bench.write(0x60B1, 0, 4, 30_000).unwrap();
    for _ in 0..300 {
        bench.cycle(0x0F, 20_000);
    }
    let velocity = bench.observe().velocity * COUNTS_PER_RADIAN;
    assert!((velocity - 50_000.0).abs() < 10.0, "{velocity}");
    let mut bench = Bench::new();
    bench.enable(10, TARGET_TORQUE, 0);
    bench.write(0x60B2, 0, 2, 50).unwrap();
    bench.run_ns(MILLISECOND_NS);
    assert!((bench.observe().torque - 1.55).abs() < 1e-9);
}
