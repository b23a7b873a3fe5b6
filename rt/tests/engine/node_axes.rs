//! Several axes of one node: process data of their own, and one node that lives, fails and is told for all of them.

use crate::fixture::{COUNTS_PER_TURN, PERIOD_NS, Rig, move_to, parameters};
use takt_rt::{
    Engine, EngineParameters, EventKind, Frame, FrameKind, GroupParameters, Id, MappedObject, Origin, Phase,
    Request, Rule, SetUpError, Supervision, nmt_command, node_state,
};

/// Two axes of node 1, each a group of its own, and one of node 3. The process data of the second axis have the identifiers of node 2,
/// which is not there.
fn two_in_one_node() -> EngineParameters {
    let mut parameters = parameters(3);
    (parameters.axes[1].node, parameters.axes[1].node_axis) = (1, 2);
    parameters.groups = (0..3)
        .map(|axis| GroupParameters { axes: [axis].into_iter().collect(), ..GroupParameters::default() })
        .collect();
    parameters
}

fn rig(parameters: EngineParameters) -> Rig {
    let mut rig = Rig::of(parameters);
    // The part of the drive that hears and answers for the second axis.
    rig.drive(1).node = 2;
    rig
}

fn enabled(parameters: EngineParameters) -> Rig {
    let mut rig = rig(parameters);
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(5);
    rig.host.requests.push_back(Request::Enable);
    for _ in 0..150 {
        rig.run(1);
    }
    assert_eq!([0, 1, 2].map(|group| rig.phase_of(group)), [Phase::Holding; 3]);
    rig
}

/// The rule and the origin of each stop, by the number of its axis.
fn stops(rig: &Rig) -> Vec<(Rule, Origin)> {
    let mut stops: Vec<_> = rig.stops().iter().map(|stop| (stop.rule(), stop.origin)).collect();
    stops.sort_by_key(|(_, origin)| format!("{origin:?}"));
    stops
}

fn of_both(rule: Rule) -> Vec<(Rule, Origin)> {
    vec![(rule, Origin::Axis(0)), (rule, Origin::Axis(1))]
}

#[test]
fn each_axis_of_a_node_moves_by_itself() {
    let mut rig = enabled(two_in_one_node());
    let before = [0, 1].map(|axis| rig.drive(axis).position);
    rig.host.group_requests.push_back((1, Request::Move(move_to(0.5))));
    rig.run(1_500);
    assert_eq!([rig.phase_of(0), rig.phase_of(1)], [Phase::Holding; 2]);
    assert_eq!(rig.drive(0).position, before[0]);
    let target = (0.5 * COUNTS_PER_TURN / std::f64::consts::TAU).round() as i32;
    assert_eq!(rig.drive(1).position, target);
}

#[test]
fn a_node_that_starts_anew_stops_all_of_its_axes() {
    let mut rig = enabled(two_in_one_node());
    rig.buses[0].inject(Frame::of(Id::canopen(0x700, 1), [node_state::BOOT_UP]));
    rig.run(3);
    assert_eq!(stops(&rig), of_both(Rule::UnexpectedBootUp));
    assert_eq!(rig.phase_of(2), Phase::Holding);
}

#[test]
fn a_node_that_is_not_operational_stops_all_of_its_axes() {
    let mut rig = enabled(two_in_one_node());
    rig.buses[0].inject(Frame::of(Id::canopen(0x700, 1), [node_state::STOPPED]));
    rig.run(3);
    assert_eq!(stops(&rig), of_both(Rule::NodeNotOperational));
}

#[test]
fn a_lost_heartbeat_of_a_node_stops_all_of_its_axes() {
    let mut parameters = two_in_one_node();
    for axis in &mut parameters.axes[..2] {
        axis.supervision = Supervision::Heartbeat { timeout_cycles: 300 };
    }
    let mut rig = enabled(parameters);
    rig.buses[0].inject(Frame::of(Id::canopen(0x700, 1), [node_state::OPERATIONAL]));
    rig.run(250);
    assert_eq!(stops(&rig), []);
    rig.run(100);
    assert_eq!(stops(&rig), of_both(Rule::NodeLost));
}

#[test]
fn an_emergency_message_of_a_node_reaches_all_of_its_axes() {
    let mut rig = enabled(two_in_one_node());
    rig.buses[0].inject(Frame::of(Id::canopen(0x080, 1), [0x10, 0x43, 0x09, 0, 0, 0, 0, 0]));
    rig.run(6);
    assert_eq!(stops(&rig), of_both(Rule::EmergencyMessage));
    let told: Vec<u8> = (rig.host.events.iter())
        .filter_map(|event| match event.kind {
            EventKind::Emergency { axis, code: 0x4310, .. } => Some(axis),
            _ => None,
        })
        .collect();
    assert_eq!(told, [0, 1]);
}

#[test]
fn a_guarded_node_is_asked_once_however_many_axes_it_has_and_its_silence_stops_all_of_them() {
    let mut parameters = two_in_one_node();
    for axis in &mut parameters.axes[..2] {
        axis.supervision = Supervision::Guarding { guard_cycles: 20, life_cycles: 60 };
        axis.stops_by_itself_cycles = Some(60);
    }
    let mut rig = enabled(parameters);
    rig.buses[0].sent.clear();
    rig.run(200);
    let requests = rig.buses[0].sent.iter().filter(|(_, frame)| frame.kind() == FrameKind::Remote).count();
    assert_eq!(requests, 10);
    rig.drive(0).guarding.is_silent = true;
    rig.run(100);
    assert_eq!(stops(&rig), of_both(Rule::NodeLost));
}

#[test]
fn the_axes_of_a_node_that_process_data_do_not_reach_are_stopped_by_sdo_one_after_the_other() {
    let mut rig = enabled(two_in_one_node());
    rig.buses[0].inject(Frame::of(Id::canopen(0, 0), [nmt_command::ENTER_PRE_OPERATIONAL, 1]));
    (rig.drive(0).is_silent, rig.drive(1).is_silent) = (true, true);
    rig.buses[0].sent.clear();
    rig.run(60);
    let written: Vec<(u64, u16)> = (rig.buses[0].sent.iter())
        .filter(|(_, frame)| frame.id() == Id::canopen(0x600, 1))
        .map(|(at_ns, frame)| {
            (at_ns / PERIOD_NS, u16::from_le_bytes([frame.payload()[1], frame.payload()[2]]))
        })
        .collect();
    for index in [0x6040, 0x6840] {
        assert!(written.iter().filter(|(_, written)| *written == index).count() >= 2, "{written:04X?}");
    }
    // A drive answers within some milliseconds.
    assert!(written.windows(2).all(|pair| pair[1].0 - pair[0].0 >= 5), "{written:?}");
}

#[test]
fn objects_of_a_further_axis_stand_0x800_higher_each() {
    let controlword = MappedObject::new(0x6040, 0, 16);
    let third = controlword.of_node_axis(3);
    assert_eq!(third.index, 0x7040);
    assert_eq!(third.as_of_first_axis(3), controlword);
    assert_ne!(third.as_of_first_axis(2), controlword, "it is of another axis");
    let vendors = MappedObject::new(0x2001, 1, 32);
    assert_eq!((vendors.of_node_axis(3), vendors.as_of_first_axis(3)), (vendors, vendors));
}

#[test]
fn axes_of_one_node_have_different_numbers_and_one_supervision() {
    let error_of = |change: fn(&mut EngineParameters)| {
        let mut parameters = two_in_one_node();
        change(&mut parameters);
        Engine::new(parameters).err()
    };
    assert_eq!(error_of(|_| ()), None);
    let duplicate = error_of(|own| own.axes[1].node_axis = 1);
    assert_eq!(duplicate, Some(SetUpError::DuplicateNodeId { axis: 1, node: 1 }));
    let different = error_of(|own| own.axes[1].supervision = Supervision::Heartbeat { timeout_cycles: 100 });
    assert_eq!(different, Some(SetUpError::NodeSupervision { axis: 0, node: 1 }));
}
