//! What is detected beside the set-points and the feedback: nodes that start anew or fall silent, others who send what
//! only the master may, two nodes with one number, a thread that is late too often.

use crate::fixture::{PERIOD_NS, Rig, parameters, pdos};
use takt_rt::{
    BusState, EventKind, Frame, Id, MappedObject, Mapping, Origin, Phase, RejectReason, Request, Rule,
    StopCategory, Supervision, TimingLevel,
};

fn moving() -> Rig {
    let mut rig = Rig::enabled(3);
    rig.move_to(2.0);
    rig.run(200);
    assert_eq!(rig.phase(), Phase::Moving);
    rig
}

/// The one reason for which the group has stopped, with its value.
fn reason(rig: &Rig) -> (Rule, Origin, f64) {
    let stops = rig.stops();
    assert_eq!(stops.len(), 1, "{stops:?}");
    (stops[0].rule(), stops[0].origin, stops[0].cause.numbers().0)
}

#[test]
fn a_drive_that_boots_in_motion_stops_the_group() {
    let mut rig = moving();
    rig.buses[0].inject(Frame::of(Id::canopen(0x700, 2), [0]));
    rig.run(2);
    assert_eq!(reason(&rig), (Rule::UnexpectedBootUp, Origin::Axis(1), 0.0));
    rig.run_until(Phase::Disabled, 3_000);
    rig.assert_limits_kept();
}

#[test]
fn a_drive_that_has_not_reported_yet_is_silent_and_in_no_other_mode() {
    let mut parameters = parameters(1);
    let feedback = [0x6041_0010, 0x6064_0020, 0x6061_0008].map(MappedObject::from_parameter);
    pdos(&mut parameters.axes[0]).feedback[0].mapping = Mapping::feedback(&feedback).unwrap();
    let mut rig = Rig::of(parameters);
    rig.drive(0).is_silent = true;
    rig.host.requests.extend([Request::Sync(true), Request::Activate, Request::Enable]);
    rig.run(10);
    assert_eq!(reason(&rig), (Rule::MissedFeedback, Origin::Axis(0), 4.0));
}

#[test]
fn a_boot_up_before_the_drives_are_enabled_is_no_reason_to_stop() {
    let mut rig = Rig::new(3);
    rig.request(Request::Sync(true));
    rig.request(Request::Activate);
    rig.run(20);
    rig.buses[0].inject(Frame::of(Id::canopen(0x700, 2), [0]));
    rig.run(5);
    rig.request(Request::Enable);
    rig.run_until(Phase::Holding, 500);
    assert!(rig.stops().is_empty());
}

#[test]
fn a_node_that_leaves_operational_or_whose_heartbeat_ceases_stops_the_group() {
    let mut rig = moving();
    rig.buses[0].inject(Frame::of(Id::canopen(0x700, 3), [0x7F]));
    rig.run(2);
    assert_eq!(reason(&rig), (Rule::NodeNotOperational, Origin::Axis(2), 127.0));

    let mut watched = parameters(3);
    watched.axes[1].supervision = Supervision::Heartbeat { timeout_cycles: 50 };
    let mut rig = Rig::of(watched).enable();
    for _ in 0..5 {
        rig.buses[0].inject(Frame::of(Id::canopen(0x700, 2), [5]));
        rig.run(40);
    }
    assert!(rig.stops().is_empty());
    rig.run(60);
    assert_eq!(reason(&rig).0, Rule::NodeLost);
}

#[test]
fn whoever_else_sends_sync_set_points_or_commands_stops_the_group_and_is_named_by_the_identifier() {
    for id in [Id::canopen(0x080, 0), Id::canopen(0x200, 2), Id::canopen(0x000, 0), Id::canopen(0x700, 127)] {
        let mut rig = moving();
        rig.buses[0].inject(Frame::of(id, [0x81, 0]));
        rig.run(2);
        assert_eq!(reason(&rig), (Rule::ForeignMaster, Origin::Bus(0), id.value().into()));
        rig.run_until(Phase::Disabled, 3_000);
        rig.assert_limits_kept();
    }
}

#[test]
fn whoever_else_writes_to_a_drive_by_sdo_stops_the_group_and_may_read() {
    // Upload of 6041; the drive of another controller; a controlword, a segment, the begin of a block.
    let read = (1, [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]);
    let to_another_node = (99, [0x2B, 0x40, 0x60, 0, 6, 0, 0, 0]);
    let mut rig = moving();
    for (node, request) in [read, to_another_node] {
        rig.buses[0].inject(Frame::of(Id::canopen(0x600, node), request));
        rig.run(5);
        assert!(rig.stops().is_empty(), "{request:02X?}");
    }
    for first in [0x2B, 0x00, 0xC2] {
        let mut rig = moving();
        let id = Id::canopen(0x600, 1);
        rig.buses[0].inject(Frame::of(id, [first, 0x40, 0x60, 0, 6, 0, 0, 0]));
        rig.run(2);
        assert_eq!(reason(&rig), (Rule::ForeignMaster, Origin::Bus(0), id.value().into()));
        rig.run_until(Phase::Disabled, 3_000);
        rig.assert_limits_kept();
    }
}

#[test]
fn two_nodes_with_one_number_are_told_from_feedback_that_comes_late() {
    let twice = |rig: &mut Rig, every: usize| {
        for cycle in 0..300 {
            if cycle % every == 0 {
                let position = rig.drive(0).position.to_le_bytes();
                let [a, b, c, d] = position;
                rig.buses[0].inject(Frame::of(Id::canopen(0x180, 1), [0x37, 0x12, a, b, c, d]));
            }
            rig.run(1);
        }
    };
    let mut rig = Rig::enabled(3);
    twice(&mut rig, 10);
    assert!(rig.stops().is_empty());
    twice(&mut rig, 1);
    assert_eq!(reason(&rig), (Rule::DuplicateNode, Origin::Axis(0), 1.0));
}

#[test]
fn an_emergency_message_without_a_fault_stops_the_group_with_its_code() {
    let mut rig = moving();
    rig.buses[0].inject(Frame::of(Id::canopen(0x080, 2), [0x10, 0x43, 0x09, 0, 0, 0, 0, 0]));
    rig.run(6);
    assert_eq!(reason(&rig), (Rule::EmergencyMessage, Origin::Axis(1), f64::from(0x4310)));
}

#[test]
fn an_error_passive_interface_stops_the_group_where_it_is() {
    let mut rig = moving();
    rig.buses[0].state = BusState::ErrorPassive;
    rig.run(2);
    assert_eq!(reason(&rig), (Rule::BusErrorPassive, Origin::Bus(0), 0.0));
    rig.run_until(Phase::Holding, 3_000);
    rig.assert_limits_kept();
}

#[test]
fn slots_missed_too_often_are_told_then_keep_streams_away_and_then_stop_the_group() {
    let mut rig = Rig::enabled(3);
    let stall = |rig: &mut Rig, cycles: usize| {
        for _ in 0..cycles {
            rig.clock.lateness_ns.push_back(PERIOD_NS + PERIOD_NS / 2);
            rig.run(1);
        }
    };
    stall(&mut rig, 12);
    assert_eq!(rig.host.snapshot.timing, TimingLevel::Warning);
    stall(&mut rig, 45);
    assert_eq!(rig.host.snapshot.timing, TimingLevel::Degraded);
    let refused = rig.host.snapshot.rejected;
    rig.request(Request::Stream);
    rig.run(1);
    assert_eq!((rig.host.snapshot.rejected, rig.phase()), (refused + 1, Phase::Holding));
    let rejection = rig.rejections().pop().unwrap();
    assert!(
        matches!(rejection.reason, RejectReason::MissedSlots { missed: 50.., limit: 50 }),
        "{rejection:?}"
    );
    stall(&mut rig, 300);
    assert_eq!(reason(&rig).0, Rule::TimingUnfit);
    let levels: Vec<TimingLevel> = (rig.host.events.iter())
        .filter_map(|event| match event.kind {
            EventKind::Timing { level } => Some(level),
            _ => None,
        })
        .collect();
    assert_eq!(levels[..3], [TimingLevel::Warning, TimingLevel::Degraded, TimingLevel::Unfit]);
    rig.assert_limits_kept();
}

#[test]
fn the_category_of_a_rule_is_the_configured_one() {
    let configured = |category| {
        let mut parameters = parameters(3);
        parameters.categories.set(Rule::UnexpectedBootUp, category);
        let mut rig = Rig::of(parameters).enable();
        rig.buses[0].inject(Frame::of(Id::canopen(0x700, 2), [0]));
        rig.run(2);
        assert_eq!(rig.stops()[0].category, category);
        rig.run(1_000);
        rig.phase()
    };
    assert_eq!(configured(StopCategory::Two), Phase::Holding);
    assert_eq!(configured(StopCategory::One), Phase::Disabled);
    assert_eq!(configured(StopCategory::Zero), Phase::Disabled);
}
