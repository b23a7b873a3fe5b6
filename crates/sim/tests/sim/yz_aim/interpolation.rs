//! The 2 ms mode: RPDO4 to every axis, then SYNC.

use takt::sim::Drive;
use takt::sim::yz_aim::YzAimJoint;

use super::{Bench, MILLISECOND_NS, NODE, YzAimParameters, bench, by_the_manual, parameters};

/// A unit set up for interpolation and enabled in mode 7 while the cycle runs.
fn interpolating() -> Bench {
    let mut bench = bench(YzAimParameters { special_function: 7, ..parameters(NODE) });
    bench.write(0x6060, 0, 1, 7).unwrap();
    bench.nmt(0x01);
    bench.enable_in_steps();
    for _ in 0..5 {
        bench.interpolate(0);
    }
    bench
}

#[test]
fn targets_are_interpolated_from_sync_to_sync() {
    let mut bench = interpolating();
    let mut target = 0;
    // 1000 r/min are 1092 counts per 2 ms.
    for cycle in 0..500 {
        target += (cycle * 4).min(1092);
        let (_, statusword) = bench.interpolate(target);
        assert_eq!(statusword & 0x0B3F, 0x0037);
    }
    let (position, _) = bench.interpolate(target);
    assert!((position - target).abs() < 200, "{position} {target}");
    for _ in 0..100 {
        bench.interpolate(target);
    }
    assert_eq!(bench.interpolate(target), (target, 0x0437));
}

#[test]
fn a_target_has_no_effect_before_sync() {
    let mut bench = interpolating();
    bench.hold_target(500);
    bench.run_ms(50);
    assert_eq!(bench.hold_target(500), (0, 0x0437));
    bench.send_data(0x080, []);
    bench.run_ms(500);
    assert_eq!(bench.position(), 500);
}

#[test]
fn a_step_beyond_the_highest_speed_is_followed_at_the_highest_speed() {
    let mut bench = interpolating();
    bench.interpolate(50_000);
    bench.run_ms(18);
    let moved = bench.position();
    // 1500 r/min are 16384 counts in 20 ms.
    assert!((8_000..17_000).contains(&moved), "{moved}");
    bench.run_ms(200);
    assert_eq!((bench.position(), bench.alarm()), (50_000, 0));
    bench.interpolate(5_000_000);
    bench.run_ms(600);
    assert_eq!(bench.alarm(), 0x14);
}

#[test]
fn the_special_function_counts_from_the_power_up_after_it_was_stored() {
    let mut bench = bench(parameters(NODE));
    let moves = |bench: &mut Bench| {
        bench.write(0x6060, 0, 1, 7).unwrap();
        bench.nmt(0x01);
        bench.enable_in_steps();
        let began = bench.position();
        for k in 0..50 {
            bench.interpolate(began + 10 * k);
        }
        bench.run_ms(500);
        let moved = bench.position() - began;
        bench.control(0x00);
        bench.nmt(0x80);
        moved
    };
    assert_eq!(moves(&mut bench), 0, "not set");
    bench.write(0x2619, 0, 2, 7).unwrap();
    assert_eq!(moves(&mut bench), 0, "not stored");
    bench.power_cycle();
    assert_eq!(bench.read(0x2619, 0), Ok(0));
    bench.write(0x2619, 0, 2, 7).unwrap();
    bench.save();
    assert_eq!(moves(&mut bench), 0, "not power-cycled");
    bench.power_cycle();
    assert_eq!(moves(&mut bench), 490);
}

#[test]
fn the_first_target_after_enabling_is_ignored() {
    let mut bench = bench(YzAimParameters { special_function: 7, ..parameters(NODE) });
    bench.write(0x6060, 0, 1, 7).unwrap();
    bench.nmt(0x01);
    bench.enable_in_steps();
    bench.interpolate(700);
    bench.run_ms(500);
    assert_eq!(bench.position(), 0);
    bench.interpolate(700);
    bench.run_ms(500);
    assert_eq!(bench.position(), 700);
}

#[test]
fn the_newest_target_before_sync_applies_and_the_last_one_is_held() {
    let mut bench = interpolating();
    bench.hold_target(100);
    bench.hold_target(300);
    bench.send_data(0x080, []);
    bench.run_ms(500);
    assert_eq!(bench.position(), 300);
    for _ in 0..10 {
        bench.send_data(0x080, []);
        bench.run_ms(2);
    }
    assert_eq!((bench.position(), bench.statusword()), (300, 0x0437));
}

#[test]
fn after_a_halt_the_motor_runs_to_the_latest_target_at_full_speed() {
    let mut bench = interpolating();
    bench.control(0x10F);
    for k in 0..100 {
        bench.interpolate(50 * k);
    }
    assert_eq!(bench.position(), 0);
    bench.control(0x0F);
    bench.run_ms(10);
    let velocity = bench.observe().velocity * super::RATIO * 60.0 / super::TAU;
    assert!(velocity > 500.0, "{velocity}");
    bench.run_ms(500);
    assert_eq!(bench.position(), 50 * 99);
}

#[test]
fn after_a_lost_heartbeat_the_motor_runs_on_to_the_latest_target() {
    let mut bench = interpolating();
    bench.write(0x1016, 1, 4, 0x007F_0032).unwrap();
    bench.send_data(0x77F, [5]);
    for k in 0..200 {
        bench.interpolate(50 * k);
    }
    assert_eq!((bench.alarm(), bench.statusword() & 0x3F), (0x20, 0x3F));
    let stopped = bench.position();
    assert!((1_000..1_600).contains(&stopped), "{stopped}");
    for _ in 0..20 {
        bench.send_data(0x77F, [5]);
        bench.run_ms(25);
    }
    assert_eq!((bench.alarm(), bench.position()), (0, 50 * 199));
}

/// Three axes in the 2 ms mode.
fn three_axes(setting: fn(u8) -> YzAimParameters) -> Bench {
    let mut drives: Vec<Box<dyn Drive>> = vec![];
    for node in [NODE, 6, 7] {
        drives.push(Box::new(YzAimJoint::new(setting(node))));
    }
    let mut bench = Bench::of(drives);
    bench.send_data(0x000, [1, 0]);
    bench.run_ms(1);
    bench
}

#[test]
fn all_axes_apply_their_target_at_the_same_sync() {
    let mut bench = three_axes(|node| YzAimParameters { special_function: 7, ..by_the_manual(node) });
    for node in [NODE, 6, 7].map(u32::from) {
        bench.send_data(0x600 + node, [0x2F, 0x60, 0x60, 0, 7, 0, 0, 0]);
        bench.run_ms(1);
        bench.send_data(0x600 + node, [0x2B, 0x40, 0x60, 0, 0x0F, 0, 0, 0]);
        bench.run_ms(1);
    }
    for cycle in 0i32..500 {
        let target = cycle.pow(2).min(900 * cycle);
        for node in [NODE, 6, 7].map(u32::from) {
            bench.send_data(0x500 + node, target.to_le_bytes());
            bench.run_ns(200_000);
        }
        bench.send_data(0x080, []);
        for _ in 0..7 {
            bench.run_ns(200_000);
            let counts = [NODE, 6, 7].map(|node| bench.bus.observe(node).unwrap().position_counts);
            assert!(counts.iter().all(|other| (other - counts[0]).abs() <= 1), "{counts:?}");
        }
    }
    assert!(bench.bus.observe(7).unwrap().position_counts > 100_000);
}

#[test]
fn the_control_loops_restart_with_every_sync() {
    // Between two SYNCs, the result would depend on the number of control steps so far.
    let positions = |phase_ns: u64| {
        let mut bench = interpolating();
        // No other frame on the bus may delay SYNC.
        for (index, subindex) in [(0x1017, 0), (0x1800, 5), (0x1802, 5)] {
            bench.write(index, subindex, 2, 0).unwrap();
        }
        bench.run_ns(phase_ns);
        let mut answers = vec![];
        for cycle in 0i32..100 {
            answers.push(bench.hold_target(cycle.pow(2)).0);
            bench.send_data(0x080, []);
            bench.run_ns(1_500_000);
        }
        answers
    };
    let first = positions(0);
    for phase_ns in [30_000, 60_000, 90_000] {
        assert_eq!(positions(phase_ns), first);
    }
}

#[test]
fn without_interpolation_sync_starts_profiles_together() {
    let mut bench = three_axes(by_the_manual);
    for node in [NODE, 6, 7].map(u32::from) {
        bench.send_data(0x600 + node, [0x2B, 0x40, 0x60, 0, 0x2F, 0, 0, 0]);
        bench.run_ms(1);
        bench.send_data(0x500 + node, 20_000i32.to_le_bytes());
        bench.run_ms(20);
    }
    let positions =
        |bench: &mut Bench| [NODE, 6, 7].map(|node| bench.bus.observe(node).unwrap().position_counts);
    assert_eq!(positions(&mut bench), [0; 3]);
    bench.send_data(0x080, []);
    bench.run_ms(100);
    let [first, others @ ..] = positions(&mut bench);
    assert!(first > 5_000 && others.iter().all(|other| (other - first).abs() <= 1));
    bench.run_ms(1_000);
    assert_eq!(positions(&mut bench), [20_000; 3]);
}

#[test]
fn the_frames_do_not_depend_on_how_often_the_drive_is_polled() {
    let live = |glances: u64| {
        let mut bench = interpolating();
        bench.heard.clear();
        let began_ns = bench.now_ns;
        for cycle in 0..300i32 {
            bench.send_data(0x500 + u32::from(NODE), (cycle * 100).to_le_bytes());
            bench.run_ns(MILLISECOND_NS);
            bench.send_data(0x080, []);
            for _ in 0..glances {
                bench.run_ns(MILLISECOND_NS / glances);
                bench.observe();
            }
        }
        let frames: Vec<_> = bench.heard.iter().map(|heard| (heard.at_ns - began_ns, heard.frame)).collect();
        (frames, bench.observe())
    };
    let (frames, observation) = live(1);
    assert!(frames.len() > 600);
    assert_eq!(live(1), (frames.clone(), observation));
    assert_eq!(live(8), (frames, observation));
}
