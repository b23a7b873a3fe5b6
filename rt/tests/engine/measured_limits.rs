//! Limits that the joint of an enabled drive breaks by what it is reported to do, whatever it was told.

use crate::fixture::{LIMITS, PERIOD_S, RATED_TORQUE, Rig, axis_in, changeable_axis, parameters, scale};
use core::f64::consts::TAU;
use takt_rt::{
    ControlLaw, EngineParameters, Fault, ModeChanges, ModeCondition, Phase, Request, Rule, Scale,
    ScaleParameters, StopCategory, StopCause,
};

/// A drive that plans its own way: no following error tells what it does.
fn in_profile_velocity() -> EngineParameters {
    let mut parameters = parameters(1);
    parameters.axes[0] = axis_in(ControlLaw::ProfileVelocity, 0, 1);
    parameters
}

/// An enabled axis whose joint goes where the test puts it.
fn loose() -> Rig {
    let mut rig = Rig::of(in_profile_velocity()).enable();
    rig.drive(0).is_stuck = true;
    rig
}

/// Moves the joint at a velocity for so many cycles, or until its group stops.
fn push(rig: &mut Rig, velocity: f64, cycles: usize) {
    let from = scale().position_from_counts(i64::from(rig.drive(0).position));
    for cycle in 1..=cycles {
        if !rig.stops().is_empty() {
            return;
        }
        rig.drive(0).position = scale().position_to_counts(from + velocity * PERIOD_S * cycle as f64);
        rig.run(1);
    }
}

fn position(rig: &Rig) -> f64 {
    rig.engine.axes()[0].position()
}

fn rules(rig: &Rig) -> Vec<Rule> {
    rig.stops().iter().map(|stop| stop.rule()).collect()
}

#[test]
fn an_enabled_joint_beyond_a_position_limit_is_a_fault_by_the_margin_of_the_following_error() {
    for direction in [-1.0, 1.0] {
        let mut rig = loose();
        let margin = rig.engine.axes()[0].parameters().following_error_limit;
        push(&mut rig, direction, 4_000);
        let StopCause::Fault(Fault::MeasuredPosition { position: seen, limit }) = rig.stops()[0].cause else {
            panic!("{:?}", rig.stops())
        };
        assert_eq!(limit, direction * 3.0);
        assert!((seen.abs() - 3.0 - margin - 0.008).abs() < 2e-3, "{seen}");
        assert_eq!((rules(&rig).len(), rig.stops()[0].category), (1, StopCategory::One));
    }
}

#[test]
fn a_joint_that_was_enabled_outside_its_limits_may_go_back_and_not_farther() {
    let mut rig = Rig::of(in_profile_velocity());
    rig.drive(0).position = scale().position_to_counts(3.5);
    let mut rig = rig.enable();
    rig.drive(0).is_stuck = true;
    push(&mut rig, -1.0, 300);
    assert_eq!(rules(&rig), []);
    push(&mut rig, 1.0, 1_000);
    assert_eq!(rules(&rig), [Rule::MeasuredPosition]);
    assert!(position(&rig) < 3.5, "{}", position(&rig));
}

#[test]
fn a_joint_that_is_moved_while_it_is_disabled_breaks_no_limit() {
    let mut rig = loose();
    rig.request(Request::Disable);
    rig.run_until(Phase::Disabled, 100);
    push(&mut rig, 1.5 * LIMITS.velocity, 1_500);
    assert!(position(&rig) > 3.5);
    assert_eq!(rules(&rig), []);
}

#[test]
fn an_enabled_joint_that_is_too_fast_for_some_reports_is_a_fault() {
    let mut rig = loose();
    push(&mut rig, 1.15 * LIMITS.velocity, 200);
    push(&mut rig, 1.5 * LIMITS.velocity, 5);
    push(&mut rig, 0.0, 100);
    assert_eq!(rules(&rig), []);
    push(&mut rig, -1.5 * LIMITS.velocity, 100);
    let StopCause::Fault(Fault::MeasuredVelocity { velocity, limit }) = rig.stops()[0].cause else {
        panic!("{:?}", rig.stops())
    };
    assert!((velocity + 3.0).abs() < 0.05 && limit == LIMITS.velocity, "{velocity} {limit}");
}

#[test]
fn a_count_more_in_one_cycle_is_no_speed() {
    let mut parameters = in_profile_velocity();
    // One count in a cycle is 0.75 rad/s.
    parameters.axes[0].limits.velocity = 0.3;
    parameters.axes[0].scale = Scale::new(ScaleParameters {
        counts_per_turn: 8_192.0,
        velocity_units_per_turn: 8_192.0,
        gear_ratio: 1.0,
        travel_per_turn: TAU,
        reversed: false,
        zero_counts: 0.0,
        rated_torque: RATED_TORQUE,
    })
    .unwrap();
    let mut rig = Rig::of(parameters).enable();
    rig.drive(0).is_stuck = true;
    for cycle in 0..400 {
        rig.drive(0).position += i32::from(cycle % 3 == 0);
        rig.run(1);
        let velocity = rig.engine.axes()[0].velocity();
        assert!(cycle < 20 || (velocity - 0.256).abs() < 0.1, "{velocity} in cycle {cycle}");
    }
    assert_eq!(rules(&rig), []);
}

#[test]
fn an_enabled_drive_with_too_much_torque_is_a_fault_unless_it_limits_itself_to_that() {
    let modes = ModeChanges {
        laws: [ControlLaw::Velocity { position_gain: 20.0 }].into_iter().collect(),
        condition: ModeCondition::AtRest,
        timeout_cycles: 100,
    };
    let highest = 1.5 * LIMITS.torque;
    let per_mille = (highest * 1_000.0 / RATED_TORQUE).round() as u16;
    for (limit_per_mille, expected) in [
        (None, Some(Rule::MeasuredTorque)),
        (Some(per_mille), None),
        (Some(per_mille / 2), Some(Rule::MeasuredTorque)),
    ] {
        let mut parameters = parameters(1);
        parameters.axes[0] = changeable_axis(ControlLaw::Position, modes.clone(), 0, 1);
        let mut rig = Rig::of(parameters);
        rig.request(Request::RatedTorque { axis: 0, torque: RATED_TORQUE, limit_per_mille });
        let mut rig = rig.enable();
        rig.drive(0).load = -1.1 * LIMITS.torque;
        rig.run(100);
        assert_eq!(rules(&rig), []);
        rig.drive(0).load = -highest;
        let patience = rig.engine.axes()[0].parameters().following_error_cycles as usize;
        rig.run(3 * patience);
        assert_eq!(rules(&rig), []);
        rig.run(2 * patience + 10);
        assert_eq!(rig.stops().first().map(|stop| stop.rule()), expected, "{limit_per_mille:?}");
    }
}
