//! The power of drives that do not obey: a disabled group has no drive with torque, or a latched fault says which one has.

use core::f64::consts::PI;

use crate::fixture::{IdealDrive, PERIOD_NS, Rig, parameters, scale};
use takt_rt::{DriveState, EngineParameters, Fault, Frame, Id, Phase, Request, Rule, StopCause, StopReason};

/// The stop that a group shows.
fn latched(rig: &Rig) -> Option<(Rule, Option<u8>)> {
    rig.host.snapshot.groups[0].stop.map(|stop| (stop.rule(), stop.axis()))
}

fn rules(rig: &Rig) -> Vec<(Rule, Option<u8>)> {
    rig.stops().iter().map(|stop| (stop.rule(), stop.axis())).collect()
}

/// The last controlword on the wire of a node of the first bus.
fn last_word(rig: &Rig, node: u8) -> u16 {
    let commands = rig.buses[0].sent.iter().rev();
    commands
        .map(|(_, frame)| frame)
        .find(|frame| frame.id() == Id::canopen(0x200, node))
        .unwrap()
        .first_word() as u16
}

/// Disables an enabled group whose drives have been changed.
fn disabled(change: impl Fn(&mut IdealDrive), axis: usize) -> Rig {
    let mut rig = Rig::enabled(3);
    change(rig.drive(axis));
    rig.request(Request::Disable);
    rig.run_until(Phase::Disabled, 600);
    rig
}

#[test]
fn a_drive_that_does_not_obey_shutdown_is_a_latched_fault_when_its_group_is_disabled() {
    let mut rig = disabled(|drive| drive.is_defiant = true, 1);
    assert_eq!(rules(&rig), [(Rule::NotDisabled, Some(1))]);
    let StopReason { cause, phase, .. } = rig.stops()[0];
    let fault = Fault::NotDisabled { state: DriveState::OperationEnabled, silent_cycles: 0 };
    assert_eq!((cause, phase), (StopCause::Fault(fault), Phase::Disabling));
    assert_eq!(StopCause::from_numbers(Rule::NotDisabled, cause.numbers().0, cause.numbers().1), Some(cause));
    rig.request(Request::Enable);
    assert_eq!(rig.phase(), Phase::Disabled);
}

#[test]
fn a_drive_that_has_not_given_up_its_torque_is_told_to_have_no_voltage_until_it_has_none() {
    let mut rig = disabled(|drive| drive.is_defiant = true, 1);
    rig.run(100);
    assert_eq!((last_word(&rig, 1), last_word(&rig, 2)), (0x06, 0x00));
    rig.drive(1).is_defiant = false;
    rig.run(10);
    assert_eq!(last_word(&rig, 2), 0x06);
    assert!(!rig.drive(1).state.has_torque());
}

#[test]
fn a_drive_that_its_disabled_group_has_not_waited_for_is_switched_off_by_sdo_when_it_is_reached_again() {
    let mut rig = Rig::enabled(3);
    // Its node was reset meanwhile: it takes no process data, and sends none.
    (rig.drive(1).is_silent, rig.drive(1).is_cut_off) = (true, true);
    rig.run_until(Phase::Disabled, 1_000);
    assert!(rig.drive(1).state.has_torque());
    rig.drive(1).is_cut_off = false;
    rig.drive(1).is_pre_operational = true;
    rig.drive(1).is_silent = false;
    rig.run(100);
    assert!(!rig.drive(1).state.has_torque());
    rig.request(Request::ResetFaults);
    assert_eq!(latched(&rig), None);
}

/// A thread that is always late takes the power by SDO.
#[test]
fn a_drive_that_confirms_its_controlword_by_sdo_and_goes_on_to_report_torque_is_not_disabled() {
    let mut rig = Rig::enabled(3);
    let lie = (DriveState::OperationEnabled, rig.drive(1).position);
    rig.drive(1).lies.extend([lie; 2_000]);
    rig.clock.compute_ns = PERIOD_NS / 2;
    rig.run_until(Phase::Disabled, 1_000);
    assert!(!rig.drive(1).state.has_torque());
    assert_eq!(rules(&rig), [(Rule::TimingUnfit, None), (Rule::NotDisabled, Some(1))]);
}

#[test]
fn the_fault_of_a_drive_with_torque_is_back_after_a_reset_until_the_drive_has_none() {
    let mut rig = disabled(|drive| drive.is_defiant = true, 1);
    rig.host.requests.extend([Request::ResetFaults, Request::Enable]);
    rig.run(2);
    assert_eq!((rig.phase(), latched(&rig)), (Phase::Disabled, Some((Rule::NotDisabled, Some(1)))));
    rig.drive(1).is_defiant = false;
    rig.run(10);
    assert_eq!(latched(&rig), Some((Rule::NotDisabled, Some(1))), "it stays until somebody resets it");
    rig.host.requests.extend([Request::ResetFaults, Request::Enable]);
    rig.run_until(Phase::Holding, 150);
    assert_eq!(latched(&rig), None);
}

#[test]
fn a_drive_that_does_not_obey_takes_the_place_of_the_fault_that_the_group_has_stopped_for() {
    let mut rig = Rig::enabled(3);
    rig.drive(0).is_defiant = true;
    rig.buses[0].inject(Frame::of(Id::canopen(0x700, 2), [0]));
    rig.run_until(Phase::Disabled, 1_000);
    assert_eq!(rules(&rig), [(Rule::UnexpectedBootUp, Some(1)), (Rule::NotDisabled, Some(0))]);
    assert_eq!(latched(&rig), Some((Rule::NotDisabled, Some(0))));
}

#[test]
fn a_drive_that_fell_silent_with_torque_stays_a_fault_until_it_is_heard_without_torque() {
    let mut rig = Rig::enabled(3);
    rig.drive(1).is_silent = true;
    rig.run_until(Phase::Disabled, 1_000);
    assert_eq!(rules(&rig), [(Rule::MissedFeedback, Some(1))], "the fault that explains it is kept");
    rig.request(Request::ResetFaults);
    assert_eq!(latched(&rig), Some((Rule::NotDisabled, Some(1))));
    let Some(StopCause::Fault(Fault::NotDisabled { silent_cycles, .. })) =
        rig.stops().last().map(|stop| stop.cause)
    else {
        panic!("{:?}", rig.stops())
    };
    assert!(silent_cycles >= 200, "{silent_cycles}");
    rig.drive(1).is_silent = false;
    rig.run(10);
    rig.request(Request::ResetFaults);
    assert_eq!(latched(&rig), None);
}

#[test]
fn a_reset_in_the_cycle_in_which_a_silent_drive_reports_that_it_is_off_leaves_no_fault() {
    let mut rig = disabled(|_| {}, 0);
    rig.drive(1).is_silent = true;
    rig.request(Request::Enable);
    rig.run_until(Phase::Disabled, 100);
    rig.run(20);
    assert_eq!(latched(&rig), Some((Rule::MissedFeedback, Some(1))));
    rig.drive(1).is_silent = false;
    rig.request(Request::ResetFaults);
    assert_eq!(rig.host.snapshot.axes[1].feedback_age, 0);
    assert_eq!(latched(&rig), None);
}

#[test]
fn a_silent_drive_without_another_fault_is_one_when_its_group_is_disabled() {
    let mut patient = parameters(3);
    patient.axes[1].missed_feedback_cycles = u16::MAX;
    let mut rig = Rig::of(patient).enable();
    rig.drive(1).is_silent = true;
    rig.request(Request::Disable);
    rig.run_until(Phase::Disabled, 600);
    assert_eq!(rules(&rig), [(Rule::NotDisabled, Some(1))]);
}

#[test]
fn a_drive_that_falls_silent_after_it_has_confirmed_that_it_is_disabled_is_no_fault() {
    let mut rig = disabled(|_| {}, 0);
    rig.drive(1).is_silent = true;
    rig.run(2_000);
    assert_eq!((rig.phase(), rules(&rig)), (Phase::Disabled, vec![]));
}

#[test]
fn a_drive_that_enables_itself_while_its_group_is_disabled_is_a_latched_fault() {
    for has_been_enabled in [true, false] {
        let mut rig = if has_been_enabled { disabled(|_| {}, 0) } else { Rig::new(3) };
        if !has_been_enabled {
            rig.host.requests.extend([Request::Sync(true), Request::Activate]);
        }
        rig.run(20);
        rig.drive(2).enables_itself = true;
        rig.run(10);
        assert_eq!((rig.phase(), rules(&rig)), (Phase::Disabled, vec![(Rule::DriveEnabled, Some(2))]));
        assert_eq!(last_word(&rig, 3), 0x00);
        rig.host.requests.extend([Request::ResetFaults, Request::Enable]);
        rig.run(2);
        assert_eq!((rig.phase(), latched(&rig)), (Phase::Disabled, Some((Rule::DriveEnabled, Some(2)))));
        rig.drive(2).enables_itself = false;
        rig.run(5);
        rig.host.requests.extend([Request::ResetFaults, Request::Enable]);
        rig.run_until(Phase::Holding, 150);
    }
}

#[test]
fn some_false_statuswords_of_a_disabled_drive_are_no_torque() {
    let mut rig = disabled(|_| {}, 0);
    let lie = (DriveState::OperationEnabled, rig.drive(1).position);
    for _ in 0..20 {
        rig.drive(1).lies.extend([lie; 2]);
        rig.run(5);
    }
    assert_eq!(rules(&rig), []);
}

#[test]
fn a_drive_that_is_enabled_when_its_group_becomes_active_has_some_time_to_obey() {
    for obeys in [true, false] {
        let mut rig = Rig::new(3);
        rig.drive(0).state = DriveState::OperationEnabled;
        rig.drive(0).is_defiant = !obeys;
        rig.host.requests.extend([Request::Sync(true), Request::Activate]);
        rig.run(490);
        assert_eq!(rules(&rig), []);
        rig.run(20);
        let expected = if obeys { vec![] } else { vec![(Rule::NotDisabled, Some(0))] };
        assert_eq!((rig.phase(), rules(&rig)), (Phase::Disabled, expected));
    }
}

#[test]
fn a_drive_that_has_never_reported_is_a_fault_of_an_active_group_after_some_time() {
    let mut rig = Rig::new(3);
    rig.drive(2).is_silent = true;
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(600);
    assert_eq!(rules(&rig), [(Rule::NotDisabled, Some(2))]);
}

#[test]
fn an_enabled_drive_that_goes_local_is_a_fault_and_is_not_taken_for_disabled() {
    let mut rig = Rig::enabled(3);
    rig.drive(1).is_local = true;
    rig.run(4);
    assert_eq!(rules(&rig), []);
    rig.run(3);
    assert_eq!(rules(&rig), [(Rule::DriveLocal, Some(1))]);
    let cause = rig.stops()[0].cause;
    assert_eq!(StopCause::from_numbers(Rule::DriveLocal, cause.numbers().0, cause.numbers().1), Some(cause));
    rig.run_until(Phase::Disabled, 600);
    assert_eq!(latched(&rig), Some((Rule::NotDisabled, Some(1))));
}

#[test]
fn a_remote_bit_that_is_away_for_some_reports_is_no_local_drive() {
    let mut rig = Rig::enabled(3);
    for _ in 0..20 {
        rig.drive(1).is_local = true;
        rig.run(4);
        rig.drive(1).is_local = false;
        rig.run(2);
    }
    assert_eq!((rig.phase(), rules(&rig)), (Phase::Holding, vec![]));
}

#[test]
fn a_drive_without_a_remote_bit_works() {
    let mut rig = Rig::new(3);
    rig.drive(1).has_no_remote_bit = true;
    let mut rig = rig.enable();
    rig.move_to(0.5);
    rig.run_until(Phase::Holding, 3_000);
    assert_eq!(rules(&rig), []);
}

#[test]
fn a_drive_that_enables_itself_while_its_group_is_enabled_is_named_when_that_takes_too_long() {
    let mut rig = Rig::new(3);
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(20);
    rig.request(Request::Enable);
    rig.drive(1).enables_itself = true;
    rig.run(510);
    assert_eq!(rules(&rig)[0], (Rule::EnableTimeout, Some(1)));
}

/// A joint that is turned by hand, in rad per cycle, while its group is disabled and then to be enabled.
fn turned_by_hand(parameters: EngineParameters, disabled_cycles: usize, step: impl Fn(usize) -> f64) -> Rig {
    let mut rig = Rig::of(parameters);
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(5);
    let mut position = scale().position_from_counts(rig.drive(0).position);
    let mut turn = |rig: &mut Rig, cycle| {
        position += step(cycle);
        rig.drive(0).position = scale().position_to_counts(position);
        rig.run(1);
    };
    (0..disabled_cycles).for_each(|cycle| turn(&mut rig, cycle));
    rig.request(Request::Enable);
    for cycle in disabled_cycles..disabled_cycles + 600 {
        if rig.phase() == Phase::Holding {
            break;
        }
        turn(&mut rig, cycle);
    }
    rig
}

#[test]
fn a_joint_is_enabled_where_it_has_been_turned_by_hand_however_fast() {
    let mut slow = parameters(1);
    slow.axes[0].limits.velocity = 5.0_f64.to_radians();
    // 90 degrees in 0.2 s, and a jump of the count of turns. Both took longer than a set-point at the limit had until it was enabled.
    for step in [(200, 0.5 * PI / 200.0), (1, 2.0)] {
        let rig = turned_by_hand(slow.clone(), 400, |cycle| if cycle < step.0 { step.1 } else { 0.0 });
        assert_eq!((rig.phase(), rules(&rig)), (Phase::Holding, vec![]));
        let axis = &rig.host.snapshot.axes()[0];
        assert!((axis.position_set - axis.position).abs() < 1e-4, "{axis:?}");
    }
}

#[test]
fn a_joint_that_moves_is_not_enabled_and_is_named_as_the_reason() {
    let swing = |cycle: usize| 2e-5 * if (cycle / 100).is_multiple_of(2) { 1.0 } else { -1.0 };
    let steps: [&dyn Fn(usize) -> f64; 2] = [&|_| 2e-5, &swing];
    for step in steps {
        let rig = turned_by_hand(parameters(1), 100, step);
        let StopCause::Fault(Fault::NotAtRest { velocity, limit }) = rig.stops()[0].cause else {
            panic!("{:?}", rig.stops());
        };
        assert!((velocity - 0.02).abs() < 0.01 && velocity > limit, "{velocity} {limit}");
        assert_eq!(rig.host.snapshot.axes()[0].drive_state, DriveState::ReadyToSwitchOn);
    }
}
