//! What the joint does in each mode of operation.

use super::bench::{Bench, COUNTS_PER_RADIAN};

const TARGET_POSITION: u32 = 0x607A_0020;

#[test]
fn csp_follows_a_move_and_rests_within_one_count() {
    let mut bench = Bench::new();
    bench.enable(8, TARGET_POSITION, 0);
    // A quintic of 2 rad in 2 s: 1.9 rad/s, 5.8 rad/s² at most.
    let target = |cycle: f64| {
        let s = (cycle / 2000.0).clamp(0.0, 1.0);
        let shape = s * s * s * (10.0 + s * (6.0 * s - 15.0));
        (2.0 * COUNTS_PER_RADIAN * shape).round() as i32
    };
    let mut worst = 0;
    for cycle in 0..2500 {
        // Sent in this cycle, latched at the next SYNC, reached at the one after: the position sampled now belongs
        // to what was sent two cycles ago.
        let (_, position) = bench.cycle(0x0F, target(f64::from(cycle)));
        let error = position - target(f64::from(cycle - 2));
        worst = worst.max(error.abs());
    }
    println!("worst error {worst} counts");
    assert!(worst < 100, "{worst} counts");
    let (statusword, position) = bench.cycle(0x0F, target(2500.0));
    assert!((position - target(2500.0)).abs() <= 1, "{position}");
    assert_eq!(statusword & 0x046F, 0x0427);
}
