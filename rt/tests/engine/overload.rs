//! After its deadline, or behind a backlog, nothing leaves except what stops the drives; and a machine that is always late comes
//! to a defined stop that takes the power.

use crate::fixture::{PERIOD_NS, Rig, parameters, pdos};
use takt_rt::{
    BusPort, Engine, EngineParameters, Frame, Id, MAX_AXES, MappedObject, Mapping, Pdo, Phase, Request, Rule,
    SetUpError, StopCategory,
};

/// Object 6040 = 0 (disable voltage), as an SDO download.
const DISABLE_VOLTAGE_BY_SDO: [u8; 8] = [0x2B, 0x40, 0x60, 0, 0, 0, 0, 0];
/// Object 6040 = 2 (quick stop), as an SDO download.
const QUICK_STOP_BY_SDO: [u8; 8] = [0x2B, 0x40, 0x60, 0, 2, 0, 0, 0];

fn sent_since(rig: &Rig, first: usize) -> Vec<Frame> {
    rig.buses[0].sent[first..].iter().map(|(_, frame)| *frame).collect()
}

fn function(frame: &Frame) -> u32 {
    frame.id().value() & 0x780
}

fn moving() -> Rig {
    let mut rig = Rig::enabled(3);
    rig.move_to(2.0);
    rig.run(300);
    rig
}

fn read_request() -> Frame {
    Frame::of(Id::canopen(0x600, 1), [0x40, 0, 0x10, 0, 0, 0, 0, 0])
}

#[test]
fn set_points_that_computing_has_made_too_late_leave_one_slot_later_and_nothing_else_leaves() {
    let mut rig = moving();
    let missed_before = rig.host.snapshot.missed_slots;
    rig.host.services.extend([read_request(); 2]);
    let first = rig.buses[0].sent.len();
    rig.clock.compute_ns = PERIOD_NS / 2;
    rig.run(1);
    rig.clock.compute_ns = 0;
    let sent = sent_since(&rig, first);
    assert!(sent.iter().all(|frame| frame.id() == Id::canopen(0x080, 0)), "{sent:?}");
    assert_eq!(rig.host.services.len(), 2, "service frames wait for their turn");
    assert_eq!(rig.host.snapshot.missed_slots, missed_before + 1);
    let waiting = rig.host.snapshot.axes[0].position_set;
    rig.run(1);
    assert_eq!(rig.host.snapshot.axes[0].position_set, waiting, "the set-point that was late leaves now");
    rig.run_until(Phase::Holding, 5_000);
    rig.assert_limits_kept();
    assert_eq!(rig.stops(), []);
}

#[test]
fn a_thread_whose_computing_is_always_too_slow_takes_the_power_by_sdo() {
    let mut rig = moving();
    rig.clock.compute_ns = PERIOD_NS / 2;
    let first = rig.buses[0].sent.len();
    rig.run_until(Phase::Disabled, 500);
    assert_eq!(rig.stops()[0].rule(), Rule::TimingUnfit);
    let sent = sent_since(&rig, first);
    assert!(
        sent.iter().all(|frame| matches!(function(frame), 0x080 | 0x600)),
        "no set-point and no heartbeat"
    );
    for node in 1..=3 {
        let is_told = |frame: &&Frame| {
            frame.id() == Id::canopen(0x600, node) && frame.payload() == DISABLE_VOLTAGE_BY_SDO
        };
        assert!(sent.iter().find(is_told).is_some(), "node {node}");
    }
    assert!((0..3).all(|axis| !rig.drive(axis).state.has_torque()));
}

#[test]
fn a_thread_that_always_wakes_too_late_goes_on_without_sync_and_takes_the_power_by_sdo() {
    let mut rig = moving();
    rig.clock.always_late_ns = PERIOD_NS / 2;
    let first = rig.buses[0].sent.len();
    rig.run_until(Phase::Disabled, 500);
    assert_eq!(rig.stops()[0].rule(), Rule::TimingUnfit);
    assert!(sent_since(&rig, first).iter().all(|frame| function(frame) == 0x600));
    assert!((0..3).all(|axis| !rig.drive(axis).state.has_torque()));
    // Requests are still handled: the loop can be left.
    rig.host.requests.push_back(Request::Shutdown);
    let flow = rig.cycle.run(&mut rig.engine, &mut rig.clock, &mut rig.buses, &mut rig.host);
    assert_eq!(flow, takt_rt::Flow::Shutdown);
}

#[test]
fn a_thread_that_is_late_for_some_cycles_goes_on_where_it_was() {
    let mut rig = moving();
    rig.clock.compute_ns = PERIOD_NS / 2;
    rig.run(4);
    rig.clock.compute_ns = 0;
    rig.run_until(Phase::Holding, 5_000);
    rig.assert_limits_kept();
    assert_eq!((rig.stops(), rig.host.snapshot.missed_slots), (vec![], 4));
}

#[test]
fn behind_a_backlog_nothing_leaves_except_what_stops_the_drives() {
    let mut rig = moving();
    rig.buses[0].unconfirmed = 3;
    rig.host.services.extend([read_request(); 20]);
    // The cycle in which the backlog is noticed has had its SYNC.
    rig.run(1);
    let first = rig.buses[0].sent.len();
    rig.run(400);
    let sent = sent_since(&rig, first);
    let (syncs, stopping): (Vec<_>, Vec<_>) = sent.iter().partition(|frame| function(frame) == 0x080);
    // After two slots, and each time that the bus has been behind for twice as long.
    assert!((2..=8).contains(&syncs.len()), "{}", syncs.len());
    let is_stopping = |frame: &&Frame| {
        function(frame) == 0x600
            && [QUICK_STOP_BY_SDO, DISABLE_VOLTAGE_BY_SDO].contains(&frame.payload().try_into().unwrap())
    };
    assert!(stopping.iter().all(is_stopping), "{sent:?}");
    assert!((1..=3 * 40).contains(&stopping.len()), "told again from time to time: {}", stopping.len());
    assert_eq!((rig.stops()[0].rule(), rig.host.services.len()), (Rule::NotTransmitted, 20));
}

#[test]
fn a_drive_on_a_bus_that_is_always_behind_is_told_to_stop_before_its_power_is_taken() {
    let mut rig = moving();
    rig.buses[0].unconfirmed = 3;
    let first = rig.buses[0].sent.len();
    rig.run_until(Phase::Disabled, 1_000);
    for node in 1..=3 {
        let told: Vec<Frame> = sent_since(&rig, first)
            .into_iter()
            .filter(|frame| frame.id() == Id::canopen(0x600, node))
            .collect();
        assert_eq!(told.first().unwrap().payload(), QUICK_STOP_BY_SDO, "node {node}");
    }
    assert!((0..3).all(|axis| !rig.drive(axis).state.has_torque()));
}

#[test]
fn a_confirmation_that_was_lost_on_a_free_bus_costs_some_slots_and_stops_nobody() {
    let mut rig = moving();
    for _ in 0..10 {
        rig.buses[0].loses_confirmation = true;
        rig.run(20);
        assert!(!rig.buses[0].loses_confirmation && rig.buses[0].unconfirmed(0) == 0);
    }
    rig.run_until(Phase::Holding, 5_000);
    rig.assert_limits_kept();
    assert_eq!(rig.stops(), []);
}

#[test]
fn a_bus_that_may_be_behind_for_one_slot_alone_is_not_stopped_by_a_lost_confirmation() {
    for allowed in 1..4 {
        let own = EngineParameters { not_transmitted_cycles: allowed, ..parameters(3) };
        let mut rig = Rig::of(own).enable();
        rig.move_to(1.0);
        rig.run(100);
        rig.buses[0].loses_confirmation = true;
        rig.run_until(Phase::Holding, 5_000);
        assert_eq!(rig.stops(), [], "{allowed}");
    }
}

#[test]
fn a_stop_decelerates_although_a_confirmation_was_lost() {
    let mut rig = moving();
    rig.buses[0].loses_confirmation = true;
    rig.request(Request::Stop(StopCategory::One));
    let before = rig.drive(0).position;
    rig.run_until(Phase::Disabled, 1_000);
    rig.assert_limits_kept();
    assert!(rig.drive(0).position > before);
    assert!(rig.stops().iter().all(|stop| stop.rule() == Rule::Requested));
}

#[test]
fn a_confirmation_that_was_lost_before_anything_is_enabled_holds_no_service_frame_back_for_long() {
    let mut rig = Rig::new(3);
    rig.buses[0].loses_confirmation = true;
    rig.host.services.extend([read_request(); 20]);
    rig.run(10);
    assert_eq!(rig.host.services.len(), 0);
}

#[test]
fn a_bus_that_has_caught_up_before_its_sync_gets_it() {
    let mut rig = moving();
    rig.buses[0].unconfirmed = 3;
    rig.run(1);
    rig.buses[0].unconfirmed = 0;
    let first = rig.buses[0].sent.len();
    rig.run(1);
    assert_eq!(sent_since(&rig, first)[0].id(), Id::canopen(0x080, 0));
    rig.run_until(Phase::Holding, 5_000);
    rig.assert_limits_kept();
    assert_eq!(rig.stops(), []);
}

#[test]
fn frames_that_do_not_fit_into_one_batch_are_refused_at_set_up() {
    let with = |axes: usize| {
        let mut wanted = parameters(axes);
        wanted.buses.truncate(1);
        for (axis, node) in wanted.axes.iter_mut().zip(1..) {
            (axis.bus, axis.node) = (0, node);
            pdos(axis).feedback[0].id = Id::canopen(0x180, node);
            let first = pdos(axis).commands[0].clone();
            let dummy = Mapping::commands(&[MappedObject::new(0x6040, 0, 16)]).unwrap();
            pdos(axis).commands.clear();
            for function in [0x200, 0x300, 0x400, 0x500] {
                let mapping = if function == 0x200 { first.pdo.mapping.clone() } else { dummy.clone() };
                let pdo = Pdo::classic(Id::canopen(function, node), mapping);
                pdos(axis).commands.push(takt_rt::CommandPdo::every_cycle(pdo));
            }
        }
        Engine::<MAX_AXES, 16>::new(wanted).err()
    };
    assert_eq!(with(15), None);
    assert_eq!(with(20), Some(SetUpError::TooManyFrames { bus: 0, frames: 84, limit: 64 }));
}

#[test]
fn slots_that_were_missed_before_enabling_do_not_make_it_fail() {
    let mut rig = Rig::new(3);
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(5);
    rig.clock.lateness_ns.push_back(600 * PERIOD_NS);
    rig.host.requests.push_back(Request::Enable);
    rig.run_until(Phase::Holding, 60);
    assert_eq!(rig.stops(), []);
    assert_eq!(rig.host.snapshot.timing, takt_rt::TimingLevel::Normal);
}
