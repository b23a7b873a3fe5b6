//! Callbacks that command torques and springs.

use std::cell::Cell;
use std::rc::Rc;

use super::rig::{COMMANDED, FINISHED, JERK, holding, lead, run, set_point, state_of, the_only_stop};
use crate::fixture::{FRICTION, INERTIA, Rig, axis_in, jerk_limited, move_to};
use takt_rt::plan::State;
use takt_rt::{
    AxisParameters, AxisTarget, ControlLaw, MotionState, Origin, Phase, Request, Rule, StopCategory,
    StopReason,
};

const LAW: ControlLaw = ControlLaw::Torque {
    stiffness: 400.0,
    damping: 40.0,
    inertia: INERTIA,
    viscous_friction: FRICTION,
    coulomb_friction: 0.0,
};

/// An axis whose loop is closed here, at rest.
fn torque_axis() -> Rig {
    let mut parameters = jerk_limited(1, JERK);
    parameters.axes =
        [AxisParameters { limits: parameters.axes[0].limits, ..axis_in(LAW, 0, 1) }].into_iter().collect();
    let mut rig = Rig::of(parameters).enable();
    rig.run(50);
    rig.host.events.clear();
    rig
}

#[test]
fn a_torque_drives_the_joint_and_what_is_not_commanded_any_more_is_caught_where_the_joint_is() {
    let mut rig = torque_axis();
    let mut calls = 0;
    let begun = lead(&mut rig, run(1), move |_, _, targets| {
        calls += 1;
        targets[0] = if calls <= 300 { Some(AxisTarget::Torque(4.0)) } else { None };
        if calls == 1_000 { FINISHED } else { COMMANDED }
    });
    rig.run(298);
    let axis = rig.host.snapshot.axes[0];
    assert_eq!(axis.torque_set, 4.0);
    assert!(axis.velocity > 0.5, "{axis:?}");
    assert!((axis.position_set - axis.position).abs() < 0.01, "the set-point is on the joint: {axis:?}");
    rig.run(600);
    let axis = rig.host.snapshot.axes[0];
    assert!(axis.velocity.abs() < 0.01 && axis.following_error.abs() < 0.01, "{axis:?}");
    rig.run(500);
    assert_eq!((rig.stops(), rig.phase()), (vec![], Phase::Holding));
    assert_eq!(state_of(&rig, begun), MotionState::Finished);
}

#[test]
fn a_spring_gives_way_to_a_torque_and_a_velocity_leads_the_set_point() {
    let mut rig = torque_axis();
    let home = set_point(&rig).position;
    let stage = Rc::new(Cell::new(0));
    let staged = Rc::clone(&stage);
    lead(&mut rig, run(1), move |_, _, targets| {
        let spring = |torque| AxisTarget::Impedance {
            state: State::rest(home),
            stiffness: 50.0,
            damping: 10.0,
            torque,
        };
        targets[0] = Some(match staged.get() {
            0 => spring(0.0),
            1 => spring(5.0),
            _ => AxisTarget::Velocity { velocity: 0.3, acceleration: 0.0 },
        });
        COMMANDED
    });
    rig.run(300);
    assert!((rig.host.snapshot.axes[0].position - home).abs() < 1e-3);
    stage.set(1);
    rig.run(2_000);
    let bent = rig.host.snapshot.axes[0].position - home;
    assert!((bent - 5.0 / 50.0).abs() < 2e-3, "{bent} rad");
    stage.set(2);
    rig.run(1_000);
    assert!((set_point(&rig).velocity - 0.3).abs() < 1e-6, "{:?}", set_point(&rig));
    // In motion, a move takes over.
    rig.request(Request::Move(move_to(home)));
    rig.run_until(Phase::Holding, 5_000);
    rig.run(500);
    assert!((rig.host.snapshot.axes[0].position - home).abs() < 1e-3);
    assert_eq!(rig.stops(), []);
}

#[test]
fn a_move_and_a_stop_begin_where_the_joint_is_that_a_torque_has_driven() {
    for request in [Request::Move(move_to(0.5)), Request::Stop(StopCategory::Two)] {
        let mut rig = torque_axis();
        lead(&mut rig, run(1), |_, _, targets| {
            targets[0] = Some(AxisTarget::Torque(4.0));
            COMMANDED
        });
        rig.run(300);
        rig.request(request);
        let axis = rig.host.snapshot.axes[0];
        assert!((axis.position_set - axis.position).abs() < 0.02, "{axis:?}");
        rig.run_until(Phase::Holding, 5_000);
        assert!(rig.stops().iter().all(StopReason::is_requested), "{:?}", rig.stops());
        rig.run(500);
        assert!(rig.host.snapshot.axes[0].following_error.abs() < 0.01);
    }
}

#[test]
fn a_torque_in_a_mode_without_one_is_a_stop() {
    let mut rig = holding(JERK);
    lead(&mut rig, run(1), |_, _, targets| {
        targets[1] = Some(AxisTarget::Torque(1.0));
        COMMANDED
    });
    rig.run(2);
    let (fault, category) = the_only_stop(&rig);
    assert_eq!((fault.rule(), category), (Rule::NoTorqueInMode, StopCategory::Two));
    assert_eq!(rig.stops()[0].origin, Origin::Axis(1));
}
