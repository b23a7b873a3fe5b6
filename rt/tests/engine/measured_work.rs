//! What the benchmarks and the counting of instructions measure is what they say.

use crate::thinking::Thinking;

#[test]
fn the_group_whose_cycles_are_measured_is_in_motion_whatever_its_size() {
    for axes in [1, 6, 12, 32] {
        let mut thinking = Thinking::moving(axes);
        let moving = (0..10_000).filter(|_| {
            thinking.cycle();
            thinking.is_moving()
        });
        let moving = moving.count();
        assert!(moving > 9_900, "{axes} axes: {moving} cycles of 10,000");
    }
}

#[test]
fn the_group_that_is_planned_anew_in_every_cycle_keeps_moving() {
    let mut thinking = Thinking::moving(7);
    let moving = (0..10_000).filter(|_| {
        thinking.replan();
        thinking.cycle();
        thinking.is_moving()
    });
    let moving = moving.count();
    assert!(moving > 9_900, "{moving} cycles of 10,000");
}

#[test]
fn the_group_that_follows_a_stream_follows_it_for_as_long_as_it_is_measured() {
    for axes in [1, 6, 32] {
        let mut thinking = Thinking::streaming(axes);
        for cycle in 0..10_000 {
            thinking.cycle();
            assert!(thinking.is_streaming(), "{axes} axes, in cycle {cycle}");
        }
    }
}

#[test]
fn the_group_that_a_callback_leads_is_led_for_as_long_as_it_is_measured() {
    for axes in [1, 6, 32] {
        let mut thinking = Thinking::in_loop(axes);
        for cycle in 0..10_000 {
            thinking.cycle();
            assert!(thinking.is_streaming(), "{axes} axes, in cycle {cycle}");
        }
    }
}

#[test]
fn the_group_on_a_trajectory_is_on_one_for_as_long_as_it_is_measured() {
    for axes in [1, 6, 32] {
        let mut thinking = Thinking::executing(axes);
        for cycle in 0..10_000 {
            thinking.cycle();
            assert!(thinking.is_moving(), "{axes} axes, in cycle {cycle}");
        }
    }
}
