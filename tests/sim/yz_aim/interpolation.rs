//! The 2 ms mode: RPDO4 to every axis, then SYNC.

use super::{Bench, NODE, YzAimParameters, bench, parameters};

/// A unit that was set up for interpolation, enabled in mode 7 while the cycle runs.
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
fn targets_are_followed_from_sync_to_sync() {
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
fn a_held_target_moves_nothing_before_sync() {
    let mut bench = interpolating();
    bench.hold_target(500);
    bench.run_ms(50);
    assert_eq!(bench.hold_target(500), (0, 0x0437));
    bench.say(0x080, []);
    bench.run_ms(500);
    assert_eq!(bench.position(), 500);
}

#[test]
fn a_step_beyond_the_highest_speed_is_followed_as_fast_as_the_motor_can() {
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
