//! A drive whose position counter wraps not far beyond the limits of its joint.

use std::f64::consts::TAU;

use crate::fixture::{COUNTS_PER_TURN, RATED_TORQUE, Rig, parameters};
use takt_rt::{Phase, PositionCounter, RejectReason, Request, Scale, ScaleParameters};

/// The counter has 24 bits, and the joint is at 3.1 rad where it wraps. Its limits are ±3 rad.
const LAP: i32 = 1 << 24;
const WRAP: f64 = 3.1;

fn counts(position: f64) -> i32 {
    LAP / 2 + ((position - WRAP) * COUNTS_PER_TURN / TAU) as i32
}

/// A group with one such axis, whose joint is at a position when its drive is first heard.
fn rig(position: f64) -> Rig {
    let mut parameters = parameters(1);
    parameters.axes[0].counter = PositionCounter::new(-LAP / 2, LAP / 2 - 1).unwrap();
    parameters.axes[0].scale = Scale::new(ScaleParameters {
        counts_per_turn: COUNTS_PER_TURN,
        velocity_units_per_turn: COUNTS_PER_TURN,
        gear_ratio: 1.0,
        travel_per_turn: TAU,
        reversed: false,
        zero_counts: counts(0.0).into(),
        rated_torque: RATED_TORQUE,
    })
    .unwrap();
    let mut rig = Rig::of(parameters);
    (rig.drive(0).lap, rig.drive(0).position) = (Some(LAP), counts(position));
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(5);
    rig
}

/// Turns the joint by hand, at 1 rad/s.
fn push(rig: &mut Rig, to: f64) {
    let target = counts(to);
    while rig.drive(0).position != target {
        let way = target - rig.drive(0).position;
        rig.drive(0).position += way.clamp(-83, 83);
        rig.run(1);
    }
    rig.run(2_000);
}

#[track_caller]
fn assert_position(rig: &Rig, expected: f64) {
    let shown = rig.host.snapshot.axes[0].position;
    assert!((shown - expected).abs() < 1e-4, "{shown} for {expected}");
}

#[test]
fn a_joint_that_is_pushed_over_a_wrap_is_not_taken_to_be_on_the_other_side_of_the_world() {
    let mut rig = rig(2.9);
    for position in [3.3, 2.9, 3.5, 3.0] {
        push(&mut rig, position);
        assert_position(&rig, position);
    }
}

#[test]
fn a_joint_beyond_a_wrap_is_not_enabled_and_moves_the_short_way_after_it_was_pushed_back() {
    let mut rig = rig(2.9);
    push(&mut rig, 3.3);
    rig.request(Request::Enable);
    let refused = rig.rejections();
    let [refused] = refused[..] else { panic!("{refused:?}") };
    let RejectReason::BeyondCounter { position, limit } = refused.reason else { panic!("{refused:?}") };
    assert!((position - 3.3).abs() < 1e-4 && limit == 3.0, "{refused:?}");
    assert_eq!((refused.axis, rig.phase()), (Some(0), Phase::Disabled));

    // Outside of the limits, and not beyond the wrap.
    push(&mut rig, 3.05);
    rig.request(Request::Enable);
    rig.run_until(Phase::Holding, 100);
    rig.move_to(0.0);
    while rig.phase() != Phase::Holding {
        rig.run(1);
        assert!((counts(-0.01)..=counts(3.06)).contains(&rig.drive(0).position));
    }
    assert_position(&rig, 0.0);
}

#[test]
fn the_limits_say_where_a_joint_is_that_was_beyond_a_wrap_when_its_drive_was_first_heard() {
    for position in [3.3, 3.1, 3.0, 0.0, -3.0] {
        assert_position(&rig(position), position);
    }
}

#[test]
fn a_joint_that_was_pushed_over_a_wrap_while_its_drive_was_silent_is_where_the_limits_say() {
    let mut rig = rig(2.9);
    rig.drive(0).is_silent = true;
    rig.run(100);
    rig.drive(0).position = counts(3.3);
    rig.run(100);
    rig.drive(0).is_silent = false;
    rig.run(5);
    assert_position(&rig, 3.3);
}

#[test]
fn a_corrupted_position_is_no_wrap() {
    let mut rig = rig(2.9);
    push(&mut rig, 3.3);
    let state = rig.drive(0).state;
    for false_position in [counts(-3.0), counts(3.3 + 90.0), counts(3.3 - 90.0)] {
        rig.drive(0).lies.push_back((state, false_position));
        rig.run(5);
        assert_position(&rig, 3.3);
    }
}
