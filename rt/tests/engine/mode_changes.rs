//! Changes of the mode of operation at run time.

use crate::fixture::{
    FRICTION, INERTIA, LIMITS, PERIOD_NS, Rig, TakenModes, axis_in, changeable_axis, move_to, parameters,
    pdos,
};
use arrayvec::ArrayVec;
use takt_rt::OperationMode::{
    CyclicSynchronousPosition as CSP, CyclicSynchronousTorque as CST, CyclicSynchronousVelocity as CSV,
};
use takt_rt::{
    ControlLaw, DriveState, Fault, FeedForward, Frame, Id, MAX_AXES, MappedObject, Mapping, ModeChange,
    ModeChanges, ModeCondition, MotionState, OperationMode, Phase, RejectReason, Request, RequestId,
    RequestKind, Rule, StopCategory, StopCause,
};

const PERIOD_S: f64 = PERIOD_NS as f64 * 1e-9;
/// N·m
const GRAVITY: f64 = -12.0;
const TIMEOUT_CYCLES: u32 = 50;

const VELOCITY: ControlLaw = ControlLaw::Velocity { position_gain: 20.0 };
const TORQUE: ControlLaw = ControlLaw::Torque {
    stiffness: 1600.0 * INERTIA,
    damping: 80.0 * INERTIA,
    inertia: INERTIA,
    viscous_friction: FRICTION,
    coulomb_friction: 0.0,
};

/// One axis that starts in CSP and may be changed to CSV and CST, under a load.
fn rig_with(condition: ModeCondition) -> Rig {
    let mut parameters = parameters(1);
    let laws = ArrayVec::from([VELOCITY, TORQUE]);
    let modes = ModeChanges { laws, condition, timeout_cycles: TIMEOUT_CYCLES };
    parameters.axes[0] = changeable_axis(ControlLaw::Position, modes, 0, 1);
    let mut rig = Rig::of(parameters);
    let while_enabled = condition == ModeCondition::AtRest;
    rig.drive(0).modes = TakenModes { while_enabled, after_cycles: Some(3) };
    rig.drive(0).load = GRAVITY;
    rig
}

/// The same, enabled and at rest away from zero.
fn holding(condition: ModeCondition) -> Rig {
    let mut rig = rig_with(condition).enable();
    rig.move_to(0.5);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(20);
    rig.host.events.clear();
    rig
}

fn disabled(condition: ModeCondition) -> Rig {
    let mut rig = holding(condition);
    rig.request(Request::Disable);
    rig.run_until(Phase::Disabled, 1_000);
    rig.run(20);
    rig.host.events.clear();
    rig
}

fn to(mode: OperationMode) -> Request {
    Request::ChangeMode(ModeChange { modes: [Some(mode); MAX_AXES] })
}

/// Asks for a mode in the next cycle. The number of the request.
fn ask(rig: &mut Rig, mode: OperationMode) -> RequestId {
    rig.request(to(mode));
    RequestId(rig.host.taken)
}

fn result(rig: &Rig, request: RequestId) -> Option<MotionState> {
    rig.host.snapshot.motions.of(request)
}

/// Changes the mode, which must succeed.
fn change(rig: &mut Rig, mode: OperationMode) {
    let request = ask(rig, mode);
    for _ in 0..TIMEOUT_CYCLES {
        if result(rig, request) != Some(MotionState::InProgress) {
            break;
        }
        rig.run(1);
    }
    assert_eq!(result(rig, request), Some(MotionState::Finished), "{mode:?} {:?}", rig.rejections());
}

fn refusal(rig: &mut Rig, request: Request) -> Option<RejectReason> {
    let before = rig.rejections().len();
    rig.request(request);
    rig.rejections().get(before).map(|rejection| rejection.reason)
}

/// Objects 6060 and 607A, 60FF, 6071 as they were sent last.
fn commanded(rig: &Rig) -> (i8, i32, i32, i16) {
    let last = |function| {
        let is_own = |sent: &&(u64, Frame)| sent.1.id() == Id::canopen(function, 1);
        rig.buses[0].sent.iter().rfind(is_own).unwrap().1.first_word().to_le_bytes()
    };
    let [_, _, mode, p0, p1, p2, p3, _] = last(0x200);
    let [v0, v1, v2, v3, t0, t1, ..] = last(0x300);
    let number = |bytes| i32::from_le_bytes(bytes);
    (mode as i8, number([p0, p1, p2, p3]), number([v0, v1, v2, v3]), i16::from_le_bytes([t0, t1]))
}

fn stop_causes(rig: &Rig) -> Vec<StopCause> {
    rig.stops().iter().map(|stop| stop.cause).collect()
}

#[test]
fn an_enabled_joint_under_load_keeps_its_place_in_every_change_from_mode_to_mode() {
    // Every way from one of the three modes to another.
    for after_cycles in [0, 3, 20] {
        let mut rig = holding(ModeCondition::AtRest);
        rig.drive(0).modes.after_cycles = Some(after_cycles);
        rig.host.records.clear();
        let (place, set_point) = (rig.drive(0).position, rig.engine.axes()[0].set_point());
        for mode in [CSV, CST, CSP, CST, CSV, CSP] {
            change(&mut rig, mode);
            for _ in 0..200 {
                rig.run(1);
                let moved = rig.drive(0).position - place;
                // A count is 12 µrad; what the drive reports of its torque is rounded by as much.
                assert!(moved.abs() <= 10, "{mode:?} after {after_cycles}: {moved} counts");
            }
            let axis = rig.host.snapshot.axes[0];
            assert_eq!((axis.mode, axis.mode_set), (Some(mode as i8), mode as i8));
            assert_eq!(rig.engine.axes()[0].set_point(), set_point);
            assert_eq!((rig.phase(), rig.drive(0).mode), (Phase::Holding, mode));
        }
        rig.assert_limits_kept();
        assert_eq!((rig.stops(), rig.rejections()), (vec![], vec![]));
    }
}

#[test]
fn the_axis_moves_in_its_new_mode_within_its_limits_and_the_torque_of_the_load_stays_fed_forward() {
    let mut rig = holding(ModeCondition::AtRest);
    for (mode, target) in [(CSV, -0.4), (CST, 0.6), (CSP, 0.1), (CST, -0.2)] {
        change(&mut rig, mode);
        rig.move_to(target);
        rig.run_until(Phase::Holding, 5_000);
        rig.run(500);
        let error = rig.engine.axes()[0].position() - target;
        // Without it the joint would hang 7.5 mrad low in CST.
        assert!(error.abs() < 1e-3, "{mode:?}: {error}");
    }
    rig.assert_limits_kept();
    assert_eq!(rig.stops(), vec![]);
}

#[test]
fn the_torque_begins_at_what_the_drive_has_reported_and_a_stream_takes_it_over_at_its_rate() {
    let mut rig = holding(ModeCondition::AtRest);
    rig.host.records.clear();
    change(&mut rig, CST);
    rig.run(20);
    let torques: Vec<f64> = rig.host.records.iter().map(|record| record.axes[0].torque_set.into()).collect();
    let first = torques.iter().position(|torque| *torque != 0.0).unwrap();
    // Per mille of 31 N·m, and what a count of the position makes in the loop.
    for torque in &torques[first..] {
        assert!((torque + GRAVITY).abs() < 1.2, "{torque}");
    }
    let (_, _, _, raw) = commanded(&rig);
    assert!((f64::from(raw) - 387.0).abs() < 40.0, "{raw}");
}

#[test]
fn the_torque_that_holds_the_load_goes_over_into_the_offset_of_csp_and_back() {
    let mut parameters = parameters(1);
    let laws = ArrayVec::from([VELOCITY, TORQUE]);
    let modes = ModeChanges { laws, condition: ModeCondition::AtRest, timeout_cycles: TIMEOUT_CYCLES };
    let mut axis = changeable_axis(ControlLaw::Position, modes, 0, 1);
    let objects =
        [(0x60FF, 32), (0x6071, 16), (0x60B2, 16)].map(|(index, bits)| MappedObject::new(index, 0, bits));
    pdos(&mut axis).commands[1].pdo.mapping = Mapping::commands(&objects).unwrap();
    axis.feed_forward = FeedForward::Torque;
    parameters.axes[0] = axis;
    let mut rig = Rig::of(parameters);
    rig.drive(0).modes = TakenModes { while_enabled: true, after_cycles: Some(3) };
    rig.drive(0).load = GRAVITY;
    let mut rig = rig.enable();
    rig.run(20);
    let place = rig.drive(0).position;
    let torques = |rig: &Rig| {
        let sent = rig.buses[0].sent.iter().rfind(|sent| sent.1.id() == Id::canopen(0x300, 1)).unwrap();
        let [.., t0, t1, o0, o1] = sent.1.first_word().to_le_bytes();
        [[t0, t1], [o0, o1]].map(|bytes| f64::from(i16::from_le_bytes(bytes)) * 0.031)
    };
    let holds = |torque: f64| (torque + GRAVITY).abs() < 1.2;
    change(&mut rig, CST);
    for mode in [CSP, CST, CSP] {
        let request = ask(&mut rig, mode);
        while result(&rig, request) == Some(MotionState::InProgress) {
            let [target, offset] = torques(&rig);
            assert!(holds(target + offset), "on the way to {mode:?}: {target} {offset}");
            rig.run(1);
        }
        rig.run(100);
        let [target, offset] = torques(&rig);
        let (held_by, other) = if mode == CSP { (offset, target) } else { (target, offset) };
        assert!(holds(held_by) && other == 0.0, "{mode:?}: {target} {offset}");
        let moved = rig.drive(0).position - place;
        assert!(moved.abs() <= 10, "{mode:?}: {moved} counts");
    }
    assert_eq!(rig.stops(), vec![]);
}

#[test]
fn a_drive_that_takes_no_mode_while_enabled_is_changed_while_it_is_disabled_and_enabled_again() {
    let mut rig = holding(ModeCondition::Disabled);
    assert_eq!(refusal(&mut rig, to(CSV)), Some(RejectReason::NotDisabled));
    for mode in [CSV, CST, CSP] {
        rig.request(Request::Disable);
        rig.run_until(Phase::Disabled, 1_000);
        rig.run(10);
        let request = ask(&mut rig, mode);
        assert_eq!(refusal(&mut rig, Request::Enable), Some(RejectReason::ModeChanging));
        assert_eq!(result(&rig, request), Some(MotionState::InProgress));
        rig.run(10);
        assert_eq!(result(&rig, request), Some(MotionState::Finished));
        // Without load: a joint under load sags when a drive in CST gets its power.
        rig.drive(0).load = 0.0;
        rig.request(Request::Enable);
        rig.run_until(Phase::Holding, 100);
        let target = if mode == CSV { -0.3 } else { 0.3 };
        rig.move_to(target);
        rig.run_until(Phase::Holding, 5_000);
        rig.run(200);
        assert!((rig.engine.axes()[0].position() - target).abs() < 1e-3, "{mode:?}");
    }
    rig.assert_limits_kept();
    assert_eq!(rig.stops(), vec![]);
}

#[test]
fn a_change_is_refused_in_every_phase_but_at_rest() {
    let mut rig = rig_with(ModeCondition::AtRest);
    assert_eq!(refusal(&mut rig, to(CSV)), Some(RejectReason::Phase), "passive");
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(5);
    rig.request(Request::Enable);
    assert_eq!(rig.phase(), Phase::Enabling);
    assert_eq!(refusal(&mut rig, to(CSV)), Some(RejectReason::Phase), "enabling");
    rig.run_until(Phase::Holding, 100);
    rig.move_to(0.5);
    rig.run(100);
    assert_eq!(refusal(&mut rig, to(CSV)), Some(RejectReason::Phase), "moving");
    rig.request(Request::Stop(StopCategory::Two));
    assert_eq!(rig.phase(), Phase::Stopping);
    assert_eq!(refusal(&mut rig, to(CSV)), Some(RejectReason::Phase), "stopping");
    rig.run_until(Phase::Holding, 1_000);
    rig.request(Request::Stream);
    assert_eq!(refusal(&mut rig, to(CSV)), Some(RejectReason::Phase), "streaming");
    rig.request(Request::Disable);
    rig.run_until(Phase::Disabling, 100);
    assert_eq!(refusal(&mut rig, to(CSV)), Some(RejectReason::Phase), "disabling");
    rig.run_until(Phase::Disabled, 100);
    assert_eq!(refusal(&mut rig, to(CSV)), None, "disabled");
    assert_eq!(refusal(&mut rig, to(CST)), Some(RejectReason::ModeChanging), "changing already");
    assert!(rig.rejections().iter().all(|rejected| rejected.request == RequestKind::ChangeMode));
}

#[test]
fn a_change_is_refused_behind_a_fault_until_it_is_reset() {
    let mut rig = holding(ModeCondition::AtRest);
    rig.drive(0).state = DriveState::Fault;
    rig.run_until(Phase::Disabled, 500);
    let refused = refusal(&mut rig, to(CSV));
    assert_eq!(refused, Some(RejectReason::StopLatched { rule: Rule::DriveFault }));
    rig.request(Request::ResetFaults);
    rig.run(50);
    change(&mut rig, CSV);
}

#[test]
fn a_mode_that_is_none_of_those_of_an_axis_that_can_change_is_refused() {
    let mut rig = holding(ModeCondition::AtRest);
    let mode = OperationMode::ProfilePosition;
    assert_eq!(refusal(&mut rig, to(mode)), Some(RejectReason::UnknownMode { mode }));
}

#[test]
fn an_axis_that_cannot_change_its_mode_refuses_every_other_one() {
    let mut parameters = parameters(1);
    parameters.axes[0] = axis_in(ControlLaw::Position, 0, 1);
    let mut rig = Rig::of(parameters).enable();
    assert_eq!(refusal(&mut rig, to(CSV)), Some(RejectReason::UnknownMode { mode: CSV }));
    // The mode that it is in is no change.
    assert_eq!(refusal(&mut rig, to(CSP)), None);
    assert_eq!(rig.finished_motions(), 1);
}

#[test]
fn the_process_data_must_carry_what_a_change_needs() {
    let laws = ArrayVec::from([VELOCITY, TORQUE]);
    let modes = ModeChanges { laws, condition: ModeCondition::AtRest, timeout_cycles: TIMEOUT_CYCLES };
    let whole = changeable_axis(ControlLaw::Position, modes, 0, 1);
    let plain = pdos(&mut axis_in(ControlLaw::Position, 0, 1)).clone();
    let object = MappedObject::new;
    let lacking = |commands: bool, feedback: usize| {
        let mut axis = whole.clone();
        if !commands {
            pdos(&mut axis).commands = plain.commands.clone();
        }
        pdos(&mut axis).feedback.truncate(feedback);
        if feedback == 0 {
            pdos(&mut axis).feedback = plain.feedback.clone();
        }
        axis
    };
    for (axis, mode, missing) in [
        (lacking(false, 2), CSV, object(0x6060, 0, 8)),
        (lacking(true, 0), CSV, object(0x6061, 0, 8)),
        (lacking(true, 1), CST, object(0x6077, 0, 16)),
    ] {
        let mut parameters = parameters(1);
        parameters.axes[0] = axis;
        let mut rig = Rig::of(parameters).enable();
        rig.run(20);
        let reason = RejectReason::ObjectNotMapped { object: missing };
        assert_eq!(refusal(&mut rig, to(mode)), Some(reason));
    }
}

#[test]
fn a_joint_that_moves_or_is_off_its_set_point_keeps_its_mode() {
    let mut rig = holding(ModeCondition::AtRest);
    rig.drive(0).is_stuck = true;
    rig.move_to(0.503);
    rig.run_until(Phase::Holding, 500);
    rig.run(20);
    let Some(RejectReason::OffSetPoint { distance, limit }) = refusal(&mut rig, to(CSV)) else {
        panic!("{:?}", rig.rejections())
    };
    assert!((distance - 3e-3).abs() < 1e-4 && (limit - LIMITS.velocity * PERIOD_S).abs() < 1e-9);

    let mut rig = holding(ModeCondition::AtRest);
    change(&mut rig, CST);
    rig.drive(0).load = 60.0;
    rig.run(12);
    assert!(matches!(refusal(&mut rig, to(CSP)), Some(RejectReason::NotAtRest { .. })));
}

#[test]
fn a_disabled_drive_that_does_not_show_its_mode_in_time_is_a_fault_and_keeps_its_former_mode() {
    let mut rig = disabled(ModeCondition::Disabled);
    rig.drive(0).modes.after_cycles = None;
    let request = ask(&mut rig, CSV);
    assert_eq!(commanded(&rig).0, CSV as i8);
    rig.run(TIMEOUT_CYCLES as usize - 1);
    assert_eq!(stop_causes(&rig), vec![]);
    rig.run(3);
    let fault = Fault::ModeNotShown { shown: CSP as i8, expected: CSV };
    assert_eq!(stop_causes(&rig), vec![StopCause::Fault(fault)]);
    assert!(matches!(result(&rig, request), Some(MotionState::Stopped(reason)) if reason.axis() == Some(0)));
    assert_eq!((rig.phase(), commanded(&rig).0), (Phase::Disabled, CSP as i8));
    let refused = refusal(&mut rig, Request::Enable);
    assert_eq!(refused, Some(RejectReason::StopLatched { rule: Rule::ModeNotShown }));
    rig.request(Request::ResetFaults);
    rig.run(40);
    rig.request(Request::Enable);
    rig.run_until(Phase::Holding, 100);
}

#[test]
fn an_enabled_drive_that_does_not_show_its_mode_in_time_is_stopped_and_disabled() {
    let mut rig = holding(ModeCondition::AtRest);
    rig.drive(0).modes.after_cycles = None;
    let place = rig.drive(0).position;
    ask(&mut rig, CST);
    for _ in 0..TIMEOUT_CYCLES {
        rig.run(1);
        assert_eq!((rig.phase(), rig.drive(0).position), (Phase::Holding, place));
    }
    rig.run_until(Phase::Disabled, 50);
    let fault = Fault::ModeNotShown { shown: CSP as i8, expected: CST };
    assert_eq!(stop_causes(&rig), vec![StopCause::Fault(fault)]);
    assert_eq!(rig.stops()[0].category, StopCategory::One);
    assert_eq!(commanded(&rig).0, CSP as i8);
}

#[test]
fn nothing_else_begins_while_a_mode_is_changed() {
    let mut rig = holding(ModeCondition::AtRest);
    rig.drive(0).modes.after_cycles = Some(20);
    ask(&mut rig, CSV);
    for request in [Request::Move(move_to(0.0)), Request::Stream, Request::ResetFaults, to(CSP)] {
        assert_eq!(refusal(&mut rig, request), Some(RejectReason::ModeChanging), "{request:?}");
    }
    rig.run(30);
    assert_eq!(rig.host.snapshot.axes[0].mode, Some(CSV as i8));
}

#[test]
fn what_takes_the_power_ends_a_change_and_the_former_mode_is_commanded_again() {
    for stop in [Request::Disable, Request::Stop(StopCategory::One), Request::Stop(StopCategory::Zero)] {
        let mut rig = holding(ModeCondition::AtRest);
        rig.drive(0).modes.after_cycles = Some(20);
        let request = ask(&mut rig, CSV);
        rig.run(5);
        rig.request(stop);
        rig.run_until(Phase::Disabled, 100);
        let Some(MotionState::Stopped(reason)) = result(&rig, request) else { panic!("{stop:?}") };
        assert!(reason.is_requested());
        assert_eq!(commanded(&rig).0, CSP as i8);
        rig.run(20);
        rig.request(Request::Enable);
        rig.run_until(Phase::Holding, 100);
        assert_eq!(rig.drive(0).mode, CSP);
    }
}

#[test]
fn a_stop_of_category_two_leaves_a_change_under_way() {
    let mut rig = holding(ModeCondition::AtRest);
    rig.drive(0).modes.after_cycles = Some(20);
    let request = ask(&mut rig, CSV);
    rig.request(Request::Stop(StopCategory::Two));
    assert!(matches!(result(&rig, request), Some(MotionState::Stopped(_))));
    rig.run(30);
    assert_eq!((rig.phase(), rig.host.snapshot.axes[0].mode), (Phase::Holding, Some(CSV as i8)));
    rig.move_to(0.0);
    rig.run_until(Phase::Holding, 5_000);
}

#[test]
fn a_run_that_ends_ends_a_change_and_begins_none() {
    let mut rig = disabled(ModeCondition::Disabled);
    rig.drive(0).modes.after_cycles = None;
    let request = ask(&mut rig, CSV);
    rig.request(Request::InhibitEnable);
    assert!(matches!(result(&rig, request), Some(MotionState::Stopped(reason)) if reason.is_requested()));
    assert_eq!(refusal(&mut rig, to(CSV)), Some(RejectReason::EnableInhibited));
    // As when the drives leave NMT operational.
    rig.drive(0).is_silent = true;
    rig.run(2 * TIMEOUT_CYCLES as usize);
    assert_eq!((stop_causes(&rig), commanded(&rig).0), (vec![StopCause::Requested], CSP as i8));
}

#[test]
fn a_drive_that_leaves_its_new_mode_by_itself_is_a_fault_against_that_mode() {
    let mut rig = holding(ModeCondition::AtRest);
    change(&mut rig, CSV);
    rig.drive(0).modes.after_cycles = None;
    rig.drive(0).mode = CSP;
    rig.run_until(Phase::Disabled, 100);
    let fault = Fault::ModeChanged { shown: CSP as i8, expected: CSV };
    assert_eq!(stop_causes(&rig)[0], StopCause::Fault(fault));
}

#[test]
fn the_targets_of_the_other_modes_are_at_rest_in_every_cycle() {
    let mut rig = holding(ModeCondition::AtRest);
    for mode in [CSP, CSV, CST] {
        change(&mut rig, mode);
        rig.move_to(if mode == CSV { -0.5 } else { 0.5 });
        while rig.phase() == Phase::Moving {
            rig.run(1);
            let (_, position, velocity, torque) = commanded(&rig);
            let joint = rig.drive(0).position;
            assert!((position - joint).abs() <= 600, "{mode:?} {position} {joint}");
            assert!(mode == CSV || velocity == 0, "{mode:?} {velocity}");
            assert!(mode == CST || torque == 0, "{mode:?} {torque}");
        }
        rig.run(300);
    }
}

#[test]
fn only_the_named_axes_of_a_group_change_and_the_others_hold() {
    let mut parameters = parameters(2);
    let laws = ArrayVec::from_iter([VELOCITY]);
    let modes = ModeChanges { laws, condition: ModeCondition::AtRest, timeout_cycles: TIMEOUT_CYCLES };
    parameters.axes[0] = changeable_axis(ControlLaw::Position, modes, 0, 1);
    let mut rig = Rig::of(parameters);
    rig.drive(0).modes.while_enabled = true;
    let mut rig = rig.enable();
    rig.run(20);
    assert_eq!(refusal(&mut rig, to(CSV)), Some(RejectReason::UnknownMode { mode: CSV }));
    assert_eq!(rig.rejections()[0].axis, Some(1));
    assert_eq!(rig.drive(0).mode, CSP);
    let mut modes = [None; MAX_AXES];
    modes[0] = Some(CSV);
    rig.request(Request::ChangeMode(ModeChange { modes }));
    rig.run(20);
    assert_eq!((rig.drive(0).mode, rig.drive(1).mode), (CSV, CSP));
    rig.move_to(0.3);
    rig.run_until(Phase::Holding, 5_000);
    rig.assert_limits_kept();
}
