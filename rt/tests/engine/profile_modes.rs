//! Drives that make their own way to a target, beside drives that follow set-points.

use crate::fixture::{FRICTION, INERTIA, LIMITS, PERIOD_NS, Rig, axis_in, move_to, parameters, scale};
use proptest::prelude::*;
use takt_rt::{
    ControlLaw, DriveState, EngineParameters, EventKind, Move, Phase, ProfileMove, ProfileTarget, Request,
    Rule, StopCategory,
};

const LAWS: [ControlLaw; 7] = [
    ControlLaw::Position,
    ControlLaw::ProfilePosition,
    ControlLaw::ProfileVelocity,
    ControlLaw::ProfileTorque,
    ControlLaw::Velocity { position_gain: 20.0 },
    ControlLaw::Torque {
        stiffness: 1600.0,
        damping: 80.0,
        inertia: INERTIA,
        viscous_friction: FRICTION,
        coulomb_friction: 0.0,
    },
    ControlLaw::Interpolated,
];
const POSITION: u8 = 1;
const VELOCITY: u8 = 2;
const TORQUE: u8 = 3;

/// An axis in every mode of operation; the fourth to sixth on a bus with a cycle in every second slot.
fn all_modes() -> EngineParameters {
    let mut parameters = parameters(LAWS.len());
    for (index, (axis, law)) in parameters.axes.iter_mut().zip(LAWS).enumerate() {
        *axis = axis_in(law, (index / 3) as u8, (index % 3 + 1) as u8);
    }
    parameters.buses[1].divider = 2;
    parameters
}

fn enabled() -> Rig {
    let mut rig = Rig::of(all_modes());
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(10);
    rig.request(Request::Enable);
    rig.run_until(Phase::Holding, 100);
    rig.run(10);
    rig
}

fn drive_to(rig: &mut Rig, axis: u8, target: ProfileTarget, valid_for_ns: u64) {
    let valid_until_ns = rig.clock.now_ns + valid_for_ns;
    rig.request(Request::SetProfileTarget(ProfileMove { axis, target, valid_until_ns }));
}

const LONG_NS: u64 = 3_600_000_000_000;

/// Not to where the last trajectory ended, nor to 0.
#[test]
fn while_one_axis_is_given_a_target_the_others_stay_where_they_are() {
    let mut rig = enabled();
    for _ in 0..2 {
        let before: Vec<i32> = [0, 4, 6].map(|axis| rig.drive(axis).position).to_vec();
        drive_to(&mut rig, VELOCITY, ProfileTarget::Velocity(0.5), LONG_NS);
        rig.run(100);
        let after: Vec<i32> = [0, 4, 6].map(|axis| rig.drive(axis).position).to_vec();
        assert_eq!((rig.phase(), rig.stops().len()), (Phase::Moving, 0));
        assert!(before.iter().zip(&after).all(|(before, after)| (before - after).abs() <= 1));
        // Once more from elsewhere: the joints are turned by hand while they are disabled.
        rig.request(Request::Disable);
        rig.run_until(Phase::Disabled, 3_000);
        for axis in [0, 4, 6] {
            rig.drive(axis).position += 40_000;
        }
        rig.run(10);
        rig.request(Request::Enable);
        rig.run_until(Phase::Holding, 400);
        rig.host.events.clear();
    }
}

#[test]
fn each_velocity_and_torque_has_an_expiry_of_its_own_and_a_position_has_none() {
    let mut rig = enabled();
    drive_to(&mut rig, VELOCITY, ProfileTarget::Velocity(0.1), 100 * PERIOD_NS);
    // What is asked of other axes neither prolongs nor shortens that.
    drive_to(&mut rig, TORQUE, ProfileTarget::Torque(1.0), LONG_NS);
    rig.run(10);
    drive_to(&mut rig, POSITION, ProfileTarget::Position(0.5), 0);
    rig.run(80);
    assert_eq!((rig.phase(), rig.stops().len()), (Phase::Moving, 0));
    rig.run(20);
    let stop = rig.stops()[0];
    assert_eq!((stop.rule(), stop.axis()), (Rule::StaleCommand, Some(VELOCITY)));
    rig.run_until(Phase::Disabled, 5_000);
    assert_eq!(rig.stops().len(), 1);
}

#[test]
fn a_move_takes_cyclic_axes_and_profile_position_along_and_is_finished_when_all_are_there() {
    let mut rig = enabled();
    let held = rig.drive(usize::from(VELOCITY)).position;
    rig.request(Request::Move(move_to(1.0)));
    rig.run_until(Phase::Holding, 5_000);
    rig.run(50);
    for axis in [0, usize::from(POSITION), 6] {
        assert_eq!(rig.drive(axis).position, scale().position_to_counts(1.0), "axis {axis}");
    }
    assert_eq!(rig.drive(usize::from(VELOCITY)).position, held);
    assert_eq!(rig.finished_motions(), 1);
    rig.assert_limits_kept();
    assert_eq!(rig.stops(), []);
}

#[test]
fn a_set_point_that_is_not_acknowledged_stops_the_group() {
    let mut rig = enabled();
    rig.drive(usize::from(POSITION)).is_deaf_to_set_points = true;
    drive_to(&mut rig, POSITION, ProfileTarget::Position(0.5), 0);
    rig.run(500);
    assert_eq!(rig.stops(), []);
    rig.run(10);
    let stop = rig.stops()[0];
    assert_eq!(
        (stop.rule(), stop.axis(), stop.cause.numbers().0),
        (Rule::NotAcknowledged, Some(POSITION), 501.0)
    );
    rig.run_until(Phase::Disabled, 5_000);
    assert_eq!(rig.stops().len(), 1);
}

#[test]
fn on_a_bus_with_fewer_cycles_the_acknowledgement_is_due_in_the_same_time() {
    let mut own = parameters(6);
    own.axes[4] = axis_in(ControlLaw::ProfilePosition, 1, 2);
    own.buses[1].divider = 2;
    let mut rig = Rig::of(own).enable();
    rig.drive(4).is_deaf_to_set_points = true;
    drive_to(&mut rig, 4, ProfileTarget::Position(0.5), 0);
    rig.run(490);
    assert_eq!(rig.stops(), []);
    rig.run(20);
    let stop = rig.stops()[0];
    assert_eq!((stop.rule(), stop.axis(), stop.cause.numbers().0), (Rule::NotAcknowledged, Some(4), 251.0));
}

/// The others decelerate meanwhile; what has fallen out is not led back by that.
#[test]
fn a_drive_that_falls_out_of_operation_enabled_is_not_enabled_again_by_the_stop() {
    let mut rig = enabled();
    rig.request(Request::Move(move_to(2.5)));
    rig.run(400);
    rig.drive(6).state = DriveState::SwitchOnDisabled;
    rig.run_until(Phase::Stopping, 10);
    while rig.phase() != Phase::Disabled {
        rig.run(1);
        assert_ne!(rig.drive(6).state, DriveState::OperationEnabled);
        assert_ne!(rig.drive(6).state, DriveState::SwitchedOn);
    }
    assert_eq!(rig.stops().iter().map(|stop| stop.rule()).collect::<Vec<_>>(), [Rule::DriveDisabled]);
}

fn any_target() -> impl Strategy<Value = ProfileTarget> {
    let value = prop_oneof![6 => -3.2f64..3.2, 1 => -50.0f64..50.0, 1 => Just(f64::NAN), 1 => Just(0.0)];
    (value, 0..3).prop_map(|(value, kind)| match kind {
        0 => ProfileTarget::Position(value),
        1 => ProfileTarget::Velocity(value),
        _ => ProfileTarget::Torque(value),
    })
}

fn any_request() -> impl Strategy<Value = Request> {
    let drive = (any_target(), 0..8u8, prop_oneof![Just(0), Just(50), Just(100_000)]);
    prop_oneof![
        6 => drive.prop_map(|(target, axis, valid_until_ns)| Request::SetProfileTarget(ProfileMove {
            axis,
            target,
            valid_until_ns: valid_until_ns * PERIOD_NS,
        })),
        3 => (-3.2f64..3.2, 0.05f64..1.0).prop_map(|(target, scale)| Request::Move(Move {
            velocity_scale: scale,
            acceleration_scale: scale,
            ..move_to(target)
        })),
        1 => Just(Request::Enable),
        1 => Just(Request::Disable),
        1 => Just(Request::ResetFaults),
        1 => Just(Request::Stop(StopCategory::Zero)),
        1 => Just(Request::Stop(StopCategory::One)),
        2 => Just(Request::Stop(StopCategory::Two)),
    ]
}

/// What is on the wire for the drives in profile modes keeps to the limits, too.
fn assert_targets_within_limits(rig: &Rig) {
    let scale = scale();
    let highest = [
        (VELOCITY, scale.velocity_to_drive(LIMITS.velocity)),
        (TORQUE, scale.torque_to_per_mille(LIMITS.torque)),
    ];
    for record in &rig.host.records {
        for (axis, highest) in highest {
            let raw = record.axes[usize::from(axis)].command_raw;
            assert!(raw.abs() <= highest, "{raw} for axis {axis} in slot {}", record.timing.slot);
        }
        let position = record.axes[usize::from(POSITION)].command_raw;
        assert!(position.abs() <= scale.position_command(LIMITS.position_max, &LIMITS), "{position}");
    }
}

/// No stop is told of twice, nor another one before it is over, but for a fault on the way of one that was asked for.
fn assert_one_reason_for_each_stop(rig: &Rig) {
    let mut phase = Phase::Passive;
    let mut told = None;
    for event in &rig.host.events {
        match event.kind {
            EventKind::PhaseChanged { to, .. } => {
                phase = to;
                told = told.filter(|_| matches!(to, Phase::Stopping | Phase::Disabling));
            }
            EventKind::Stop(reason) => {
                let is_stopping = matches!(phase, Phase::Stopping | Phase::Disabling);
                let is_worse = told == Some(Rule::Requested) && reason.rule() != Rule::Requested;
                assert!(told.is_none() || !is_stopping || is_worse, "{reason:?} during a stop");
                assert_eq!(reason.phase, phase);
                told = Some(reason.rule());
            }
            _ => {}
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(80))]

    #[test]
    fn no_sequence_of_requests_breaks_a_limit_hides_a_reason_or_leaves_the_group_stuck(
        steps in prop::collection::vec((any_request(), 0usize..150, 0u8..40), 1..50),
    ) {
        let mut rig = enabled();
        for (request, cycles, fault) in steps {
            let request = match request {
                Request::SetProfileTarget(wanted) => Request::SetProfileTarget(ProfileMove {
                    valid_until_ns: rig.clock.now_ns + wanted.valid_until_ns,
                    ..wanted
                }),
                request => request,
            };
            rig.request(request);
            match fault {
                0 => rig.drive(1).state = DriveState::Fault,
                1 => rig.drive(3).is_silent = true,
                2 => rig.drive(3).is_silent = false,
                3 => rig.drive(1).is_deaf_to_set_points = true,
                4 => rig.drive(1).is_deaf_to_set_points = false,
                5 => rig.drive(2).state = DriveState::SwitchOnDisabled,
                6 => rig.clock.lateness_ns.extend([0, 7_300_000]),
                _ => {}
            }
            rig.run(cycles);
        }
        rig.assert_limits_kept();
        assert_targets_within_limits(&rig);
        assert_one_reason_for_each_stop(&rig);

        // With drives that are well again everything can be disabled, reset and enabled.
        rig.drive(1).is_deaf_to_set_points = false;
        rig.drive(3).is_silent = false;
        rig.run(10);
        rig.request(Request::Disable);
        rig.run_until(Phase::Disabled, 6_000);
        rig.request(Request::ResetFaults);
        rig.run(60);
        rig.request(Request::Enable);
        rig.run_until(Phase::Holding, 200);
    }
}
