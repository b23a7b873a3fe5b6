//! Feedback that is false: a position where no joint can have got to, a statusword of a drive that still obeys.

use std::f64::consts::TAU;

use crate::fixture::{COUNTS_PER_TURN, LIMITS, PERIOD_NS, Rig, axis, axis_in, parameters, pdos, scale};
use takt_rt::{
    Axis, AxisParameters, Cia402Codec, CommandPdo, ControlLaw, DriveState, Goal, Id, Phase, Request, Rule,
    ShownStates, TransmissionType,
};

fn counts(radians: f64) -> i32 {
    (radians * COUNTS_PER_TURN / TAU) as i32
}

/// The targets on the wire of the first axis, since the beginning.
fn targets(rig: &Rig) -> Vec<i32> {
    let commands = rig.buses[0].sent.iter().filter(|(_, frame)| frame.id() == Id::canopen(0x200, 1));
    commands.map(|(_, frame)| (frame.first_word() >> 16) as i32).collect()
}

/// Checks that no target on the wire is further from the one before than the joint may go in a cycle.
fn assert_no_leap(rig: &Rig) {
    let most = counts(LIMITS.velocity * PERIOD_NS as f64 * 1e-9) + 1;
    for (cycle, pair) in targets(rig).windows(2).enumerate() {
        assert!((pair[1] - pair[0]).abs() <= most, "{} counts after {cycle} targets", pair[1] - pair[0]);
    }
}

/// Drives that still obey say for `cycles` cycles that they are disabled and `by` rad away, while the group is being
/// disabled. The first joint is 0.04 rad behind its target.
fn lied_about(by: f64, cycles: usize) -> Rig {
    let mut rig = Rig::enabled(3);
    rig.move_to(1.0);
    rig.run_until(Phase::Holding, 3_000);
    rig.drive(0).is_stuck = true;
    rig.drive(0).is_defiant = true;
    rig.drive(0).position -= counts(0.04);
    rig.run(4);
    rig.request(Request::Disable);
    let lie = (DriveState::SwitchOnDisabled, rig.drive(0).position + counts(by));
    rig.drive(0).lies.extend(vec![lie; cycles]);
    rig
}

#[test]
fn false_feedback_moves_no_target_of_a_drive_that_still_obeys_while_it_is_disabled() {
    for (by, cycles) in
        [(0.0, 2), (0.0, 3), (0.007, 2), (0.5, 1), (0.5, 2), (0.5, 7), (-2.0, 3), (0.5, 2_000)]
    {
        let mut rig = lied_about(by, cycles);
        rig.run(1_500);
        assert_no_leap(&rig);
    }
}

#[test]
fn two_false_reports_leave_the_target_where_it_was() {
    // The others take ten cycles to be disabled, so that the group is not disabled meanwhile.
    let mut rig = Rig::enabled(3);
    rig.drive(0).is_defiant = true;
    rig.drive(1).is_defiant = true;
    rig.request(Request::Disable);
    let before = *targets(&rig).last().unwrap();
    rig.drive(0).lies.extend([(DriveState::SwitchOnDisabled, before + counts(0.007)); 5]);
    rig.run(100);
    assert_eq!(rig.phase(), Phase::Disabling);
    assert!(targets(&rig)[10..].iter().all(|target| *target == before));
}

#[test]
fn a_position_that_no_joint_can_have_got_to_stops_the_group_and_is_not_believed_until_it_is_said_again() {
    let mut rig = Rig::enabled(3);
    rig.move_to(1.0);
    rig.run_until(Phase::Holding, 3_000);
    let truth = rig.engine.axes()[0].position();
    let there = rig.drive(0).position + counts(0.5);
    rig.drive(0).lies.push_back((DriveState::OperationEnabled, there));
    rig.run(2);
    assert_eq!(rig.engine.axes()[0].position(), truth);
    let stops = rig.stops();
    assert_eq!((stops.len(), stops[0].rule(), stops[0].axis()), (1, Rule::ImplausibleFeedback, Some(0)));
    assert!((stops[0].cause.numbers().0 - 0.5).abs() < 1e-4, "{stops:?}");
    // Four times what its speed allows, and 64 counts.
    let reach = 4.0 * LIMITS.velocity * PERIOD_NS as f64 * 1e-9 + 64.0 * TAU / COUNTS_PER_TURN;
    assert!((stops[0].cause.numbers().1 - reach).abs() < 1e-9, "{stops:?}, {reach}");

    rig.run_until(Phase::Disabled, 600);
    rig.drive(0).lies.extend([(DriveState::SwitchOnDisabled, there); 50]);
    rig.run(1);
    assert_eq!(rig.engine.axes()[0].position(), truth);
    rig.run(1);
    assert!((rig.engine.axes()[0].position() - truth - 0.5).abs() < 1e-4);
}

#[test]
fn one_false_position_does_not_reach_the_loops_that_are_closed_here() {
    let law = ControlLaw::Torque {
        stiffness: 400.0,
        damping: 40.0,
        inertia: 1.0,
        viscous_friction: 5.0,
        coulomb_friction: 0.0,
    };
    let mut parameters = parameters(1);
    parameters.axes[0] = axis_in(law, 0, 1);
    let mut rig = Rig::of(parameters).enable();
    rig.run(200);
    let quiet = rig.host.records.last().unwrap().axes[0].torque_set;
    let there = rig.drive(0).position + counts(0.5);
    rig.drive(0).lies.push_back((DriveState::OperationEnabled, there));
    rig.run(2);
    assert_eq!(rig.stops().len(), 1);
    let kick = (rig.host.records.last().unwrap().axes[0].torque_set - quiet).abs();
    assert!(kick < 1.0, "{kick} N·m");
}

#[test]
fn a_drive_is_enabled_with_its_target_where_the_joint_is() {
    let mut rig = Rig::enabled(3);
    rig.request(Request::Disable);
    rig.run_until(Phase::Disabled, 600);
    rig.run(10);
    // Somebody has turned the joint: faster than a drive may, and further than a target follows in a cycle.
    for _ in 0..100 {
        rig.drive(0).position += counts(0.006);
        rig.run(1);
    }
    // The target follows, as far as it may in a cycle, and is there when the drive is to be enabled.
    assert_no_leap(&rig);
    rig.request(Request::Enable);
    let mut cycles = 0;
    while rig.drive(0).state != DriveState::OperationEnabled {
        rig.run(1);
        cycles += 1;
        assert!(cycles < 100);
    }
    let (target, position) = (rig.engine.axes()[0].set_point().position, rig.drive(0).position);
    assert_eq!(scale().position_to_counts(target), position);
    rig.run_until(Phase::Holding, 10);
    rig.run(10);
    assert_eq!(rig.drive(0).position, position);
}

#[test]
fn a_drive_that_is_enabled_already_when_the_group_becomes_active_is_not_moved() {
    let mut rig = Rig::new(3);
    rig.drive(0).state = DriveState::OperationEnabled;
    rig.drive(0).position = counts(1.5);
    rig.drive(0).is_stuck = true;
    rig.request(Request::Sync(true));
    rig.run(5);
    rig.drive(0).is_stuck = false;
    rig.drive(0).is_defiant = true;
    rig.request(Request::Activate);
    rig.run(50);
    assert!(targets(&rig).iter().all(|target| *target == counts(1.5)), "{:?}", targets(&rig));
    assert_eq!(rig.drive(0).position, counts(1.5));
}

#[test]
fn a_drive_that_hears_its_controlword_now_and_then_only_is_told_again_however_disabled_it_seems() {
    let rare = |command: &mut CommandPdo| command.transmission = TransmissionType::OnControlword;
    let mut usual = axis(0, 1);
    pdos(&mut usual).commands.iter_mut().for_each(rare);
    let mut drive = Axis::new(
        0,
        AxisParameters {
            codec: Cia402Codec {
                states: ShownStates::EnabledAndFault { enabled: 0x37, fault: 0x08 },
                ..Cia402Codec::default()
            },
            controlword_spacing_cycles: 10,
            ..usual
        },
    );
    drive.set_reported_position(0);
    let told = (0..100).filter(|_| {
        assert!(!drive.is_enabled());
        drive.command(Goal::Disabled, None);
        drive.frames().next().is_some()
    });
    assert_eq!(told.count(), 10);
}
