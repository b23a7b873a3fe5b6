//! Buses that are CANopen networks, and others: what leaves on each.

use std::collections::BTreeSet;

use crate::fixture::{PERIOD_NS, Rig, flexible, parameters, pdos, scale};
use takt_rt::{
    BusPort, DriveState, Engine, EngineParameters, Fault, FeedbackSince, Frame, Id, MAX_AXES, MAX_BUSES,
    Phase, Request, Rule, SetUpError, StopCause, Supervision, nmt_command,
};

/// Three axes on a CANopen bus, three on one that is none, whose drives answer set-points. The drives are told the time of day.
fn two_kinds() -> EngineParameters {
    let mut parameters = parameters(6);
    parameters.buses[1].canopen = None;
    parameters.time_cycles = Some(10);
    for axis in &mut parameters.axes[3..] {
        axis.feedback_since = FeedbackSince::SetPoint;
        axis.stops_by_itself_cycles = None;
    }
    parameters
}

fn rig() -> Rig {
    prepared(Rig::of(two_kinds()))
}

fn prepared(mut rig: Rig) -> Rig {
    rig.buses[1].drives.iter_mut().for_each(|drive| drive.answers_set_points = true);
    // A drive that answers set-points gets the first one where it has said that it is.
    for axis in 3..6 {
        let counts = rig.drive(axis).position;
        rig.request(Request::Position { axis: axis as u8, counts });
    }
    rig.request(Request::TimeOfDay { at_zero_ns: 86_400_000_000_000 });
    rig
}

/// The identifiers that have been sent on a bus.
fn sent(rig: &Rig, bus: usize) -> BTreeSet<u32> {
    rig.buses[bus].sent.iter().map(|(_, frame)| frame.id().value()).collect()
}

const SET_POINTS: [u32; 3] = [0x201, 0x202, 0x203];

#[test]
fn on_a_bus_that_is_no_canopen_network_nothing_leaves_but_set_points() {
    let mut rig = rig().enable();
    rig.move_to(1.25);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(4);
    for axis in 0..6 {
        assert_eq!(rig.drive(axis).position, scale().position_to_counts(1.25), "axis {axis}");
    }
    // To another network this frame means nothing.
    rig.buses[1].inject(Frame::of(Id::canopen(0, 0), [nmt_command::STOP, 0]));
    rig.run(10);
    assert_eq!(rig.stops(), []);
    rig.request(Request::Disable);
    rig.run_until(Phase::Disabled, 500);
    assert_eq!(sent(&rig, 1), BTreeSet::from(SET_POINTS));
    let canopen = [0x080, 0x100, 0x77F].into_iter().chain(SET_POINTS);
    assert_eq!(sent(&rig, 0), canopen.collect());
}

#[test]
fn a_confirmation_that_was_lost_on_a_bus_without_sync_stops_nobody_either() {
    let mut rig = rig().enable();
    rig.move_to(1.25);
    for bus in [1, 0, 1] {
        rig.run(50);
        rig.buses[bus].loses_confirmation = true;
    }
    rig.run_until(Phase::Holding, 5_000);
    rig.assert_limits_kept();
    assert_eq!(rig.stops(), []);
    assert!(rig.buses.iter_mut().all(|bus| !bus.loses_confirmation && bus.unconfirmed(0) == 0));
}

#[test]
fn a_thread_that_is_always_late_takes_the_power_by_the_command_itself_where_there_is_no_sdo() {
    let mut rig = rig().enable();
    rig.move_to(2.0);
    rig.run(300);
    let first = rig.buses[1].sent.len();
    rig.clock.compute_ns = PERIOD_NS / 2;
    rig.run_until(Phase::Disabled, 500);
    // The drives that answer set-points are silent without them, which is no fault of theirs.
    assert_eq!(rig.stops()[0].rule(), Rule::TimingUnfit);
    assert!((0..6).all(|axis| !rig.drive(axis).state.has_torque()));
    let told = &rig.buses[1].sent[first..];
    assert!(told.iter().all(|(_, frame)| frame.payload().starts_with(&[0, 0])), "{told:?}");
    assert!((3..=3 * 40).contains(&told.len()), "told again from time to time: {}", told.len());
}

#[test]
fn a_silent_drive_that_never_had_a_heartbeat_is_not_taken_to_have_stopped_for_want_of_it() {
    let mut rig = rig().enable();
    rig.drive(4).is_defiant = true;
    rig.drive(4).is_silent = true;
    rig.run(50);
    let timeout_cycles = 200;
    assert_eq!(rig.stops()[0].rule(), Rule::MissedFeedback);
    rig.run(timeout_cycles + 50);
    assert_eq!(rig.phase(), Phase::Disabling, "the controller goes on to tell it");
    rig.run_until(Phase::Disabled, 500);
    assert_eq!(rig.drive(4).state, DriveState::OperationEnabled);
}

/// As [`rig`], with CAN FD frames and 29-bit identifiers on the second bus, whose drives reply by one identifier.
fn flexible_rig() -> Rig {
    let mut parameters = two_kinds();
    for axis in &mut parameters.axes[3..] {
        let node = axis.node;
        let pdos = pdos(axis);
        pdos.commands[0].pdo = flexible::command_pdo(&pdos.commands[0].pdo, node);
        pdos.feedback[0] = flexible::reply_pdo(&pdos.feedback[0], node);
    }
    let mut rig = Rig::of(parameters);
    rig.buses[1].is_flexible = true;
    prepared(rig).enable()
}

#[test]
fn drives_with_one_reply_identifier_are_moved_by_flexible_data_rate_frames_with_29_bit_identifiers() {
    let mut rig = flexible_rig();
    rig.move_to(1.25);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(4);
    for axis in 0..6 {
        assert_eq!(rig.drive(axis).position, scale().position_to_counts(1.25), "axis {axis}");
    }
    assert_eq!(rig.stops(), []);
    // A classic frame with the identifier of the replies is none of them, and the reply of another drive concerns nobody.
    let reply = Id::base(flexible::REPLY).unwrap();
    rig.buses[1].inject(Frame::of(reply, [0x37, 0x02, 0, 0, 0, 0, 2, 0]));
    rig.buses[1].inject(Frame::fd(reply, &[0x37, 0x02, 0, 0, 0, 0, 9, 0], false).unwrap());
    rig.run(1);
    assert_eq!((rig.host.received.len(), rig.stops()), (2, vec![]));
    // Of those that share the identifier, the one that stops to reply is known.
    rig.drive(4).is_silent = true;
    rig.run(5);
    assert_eq!((rig.stops()[0].rule(), rig.stops()[0].axis()), (Rule::MissedFeedback, Some(4)));
}

#[test]
fn a_set_point_from_somebody_else_is_noticed_whatever_its_identifier_and_kind() {
    let mut rig = flexible_rig();
    let own = rig.buses[1].sent.last().unwrap().1;
    assert!(own.id().is_extended() && own.is_fd());
    rig.buses[1].inject(own);
    rig.run(1);
    assert_eq!(rig.stops()[0].cause, StopCause::Fault(Fault::ForeignMaster { id: own.id() }));
}

fn error_of(change: impl Fn(&mut EngineParameters)) -> Option<SetUpError> {
    let mut parameters = two_kinds();
    change(&mut parameters);
    Engine::<MAX_AXES, MAX_BUSES>::new(parameters).err()
}

#[test]
fn an_axis_that_needs_sync_or_heartbeats_is_refused_where_there_are_none() {
    let no_canopen = Some(SetUpError::NotCanopen { axis: 4 });
    assert_eq!(error_of(|own| own.axes[4].feedback_since = FeedbackSince::Sync), no_canopen);
    assert_eq!(
        error_of(|own| own.axes[4].supervision = Supervision::Heartbeat { timeout_cycles: 100 }),
        no_canopen
    );
    assert_eq!(error_of(|_| {}), None);
}

#[test]
fn the_identifiers_of_canopen_services_are_free_where_there_are_none() {
    for function in [0x080, 0x700] {
        let taken = Id::canopen(function, 1);
        assert_eq!(error_of(|own| pdos(&mut own.axes[3]).feedback[0].id = taken), None);
        let refused = error_of(|own| pdos(&mut own.axes[0]).feedback[0].id = taken);
        assert_eq!(refused, Some(SetUpError::IdTaken { axis: 0, id: taken }));
    }
    // Nor does the node ID of the controller mean anything there.
    assert_eq!(error_of(|own| own.axes[3].node = 127), None);
}
