//! The paced loop on its grid: what leaves when, and what happens when the thread is late.

use crate::fixture::{PERIOD_NS, Rig};
use proptest::prelude::*;
use takt_rt::{Cycle, EventKind, Frame, Grid, Id, Phase, Request, SlotPlan};

const EPOCH_NS: u64 = 5 * PERIOD_NS;
const COMMAND_PHASE_NS: u64 = 550_000;
const SEND_PHASE_NS: u64 = 650_000;
const LATEST_SET_POINTS_NS: u64 = 800_000;

fn times_of(rig: &Rig, id: Id) -> Vec<u64> {
    rig.buses[0].sent.iter().filter(|(_, frame)| frame.id() == id).map(|(at, _)| *at).collect()
}

fn syncs(rig: &Rig) -> Vec<u64> {
    times_of(rig, Id::canopen(0x080, 0))
}

#[test]
fn sync_leaves_at_the_start_of_every_slot_and_set_points_in_the_command_phase() {
    let mut rig = Rig::enabled(6);
    rig.run(100);
    let syncs = syncs(&rig);
    assert!(syncs.iter().all(|at| (at - EPOCH_NS).is_multiple_of(PERIOD_NS)));
    assert!(syncs.windows(2).all(|pair| pair[1] - pair[0] == PERIOD_NS));
    for at in times_of(&rig, Id::canopen(0x200, 1)) {
        assert_eq!((at - EPOCH_NS) % PERIOD_NS, COMMAND_PHASE_NS);
    }
}

#[test]
fn a_late_thread_skips_slots_counts_them_and_stays_on_the_grid() {
    let mut rig = Rig::enabled(3);
    let before = rig.host.snapshot.slot;
    rig.clock.lateness_ns.push_back(30_400_000);
    rig.run(1);
    // Woken 30.4 periods late: slots 1 to 31 after `before` are lost, the next that can be met is the 32nd.
    assert_eq!(rig.host.snapshot.slot, before + 32);
    assert_eq!(rig.host.snapshot.missed_slots, 31);
    let timing = rig.host.records.last().unwrap().timing;
    assert_eq!((timing.missed_slots, timing.wake_ns), (31, 30_400_000));
    rig.run(10);
    assert_eq!(rig.host.snapshot.missed_slots, 31);
    let syncs = syncs(&rig);
    assert!(syncs.iter().all(|at| (at - EPOCH_NS).is_multiple_of(PERIOD_NS)));
    let gaps: Vec<u64> =
        syncs.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap != PERIOD_NS).collect();
    assert_eq!(gaps, [32 * PERIOD_NS], "one gap, and never two in the place of one");
    assert!(rig.host.events.iter().any(|event| event.kind == EventKind::MissedSlots { count: 31 }));
}

#[test]
fn a_sync_that_is_only_a_little_late_is_sent_and_its_error_recorded() {
    let mut rig = Rig::enabled(3);
    rig.clock.lateness_ns.push_back(60_000);
    rig.run(1);
    let timing = rig.host.records.last().unwrap().timing;
    assert_eq!((timing.sync_ns, timing.wake_ns, timing.missed_slots), (60_000, 60_000, 0));
}

#[test]
fn set_points_that_would_run_into_the_next_sync_are_not_sent_and_nothing_jumps() {
    let mut rig = Rig::enabled(3);
    rig.move_to(1.0);
    rig.run(200);
    let sent_before = rig.buses[0].sent.len();
    // In time for SYNC, then 600 µs late for the command phase: beyond the end of the slot.
    rig.clock.lateness_ns.extend([0, 600_000]);
    rig.run(1);
    let sent: Vec<Frame> = rig.buses[0].sent[sent_before..].iter().map(|(_, frame)| *frame).collect();
    assert!(sent.iter().all(|frame| frame.id().value() & 0x780 != 0x200), "{sent:?}");
    assert_eq!(rig.host.records.last().unwrap().timing.missed_slots, 1);
    rig.run_until(Phase::Holding, 5_000);
    rig.assert_limits_kept();
    assert_eq!(rig.stops(), []);
}

/// Axes that hold, with a send phase.
fn with_send_phase(axes: usize) -> Rig {
    let mut rig = Rig::new(axes);
    let usual = SlotPlan::usual(PERIOD_NS, COMMAND_PHASE_NS);
    assert_eq!(usual.latest_set_points_ns, LATEST_SET_POINTS_NS);
    let plan = SlotPlan { send_phase_ns: Some(SEND_PHASE_NS), ..usual };
    rig.cycle = Cycle::new(Grid::new(EPOCH_NS, PERIOD_NS).unwrap(), plan);
    rig.enable()
}

fn set_points(rig: &Rig) -> Vec<u64> {
    times_of(rig, Id::canopen(0x200, 1)).iter().map(|at| (at - EPOCH_NS) % PERIOD_NS).collect()
}

#[test]
fn with_a_send_phase_set_points_leave_at_its_beginning_however_long_computing_takes() {
    let mut rig = with_send_phase(3);
    rig.move_to(1.0);
    for compute_ns in (0..=100_000).step_by(5_000) {
        rig.clock.compute_ns = compute_ns;
        rig.run(1);
        assert_eq!(rig.host.records.last().unwrap().timing.compute_ns, compute_ns);
    }
    assert!(set_points(&rig).iter().all(|at| *at == SEND_PHASE_NS), "{:?}", set_points(&rig));
    assert!(syncs(&rig).iter().all(|at| (at - EPOCH_NS).is_multiple_of(PERIOD_NS)));
    assert_eq!(rig.host.snapshot.missed_slots, 0);
}

#[test]
fn set_points_that_are_ready_after_the_send_phase_has_begun_leave_as_soon_as_they_are_ready() {
    let mut rig = with_send_phase(3);
    for (compute_ns, leaves_ns) in
        [(100_001, 650_001), (250_000, LATEST_SET_POINTS_NS), (20_000, SEND_PHASE_NS)]
    {
        rig.clock.compute_ns = compute_ns;
        rig.run(1);
        assert_eq!(set_points(&rig).last(), Some(&leaves_ns));
    }
    let sent_before = set_points(&rig).len();
    rig.clock.compute_ns = 250_001;
    rig.run(1);
    assert_eq!(set_points(&rig).len(), sent_before, "after the deadline");
}

#[test]
fn the_deadline_is_met_by_the_clock_after_the_wait_for_the_send_phase() {
    let mut rig = with_send_phase(3);
    // The third wait of a cycle is the one for the send phase.
    rig.clock.lateness_ns.extend([0, 0, LATEST_SET_POINTS_NS - SEND_PHASE_NS]);
    rig.run(1);
    assert_eq!(set_points(&rig).last(), Some(&LATEST_SET_POINTS_NS));
    assert_eq!(rig.host.snapshot.missed_slots, 0);

    let sent_before = rig.buses[0].sent.len();
    rig.clock.lateness_ns.extend([0, 0, LATEST_SET_POINTS_NS - SEND_PHASE_NS + 1]);
    rig.run(1);
    let sent = rig.buses[0].sent[sent_before..].iter().map(|(_, frame)| frame.id()).collect::<Vec<_>>();
    assert_eq!(sent, [Id::canopen(0x080, 0)], "SYNC, and nothing after the deadline");
    assert_eq!(rig.host.snapshot.missed_slots, 1);
    rig.run(10);
    assert_eq!((rig.host.snapshot.missed_slots, rig.phase()), (1, Phase::Holding));
}

#[test]
fn after_a_stall_in_motion_the_set_points_go_on_by_one_period() {
    let mut rig = Rig::enabled(3);
    rig.move_to(2.0);
    rig.run(300);
    rig.clock.lateness_ns.push_back(30_000_000);
    rig.run_until(Phase::Holding, 5_000);
    rig.assert_limits_kept();
    assert_eq!(rig.stops(), []);
    assert_eq!(rig.finished_motions(), 1);
}

#[test]
fn the_heartbeat_leaves_once_in_its_period_behind_the_set_points() {
    let mut rig = Rig::enabled(3);
    rig.run(500);
    let beats = times_of(&rig, Id::canopen(0x700, 127));
    assert!(beats.len() >= 10);
    let gaps: Vec<u64> = beats.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let (hastened, regular) = gaps.split_at(2);
    assert!(
        hastened.iter().all(|gap| *gap < 50 * PERIOD_NS),
        "enabling hastens two, so that the drives watch before anything moves though one be lost: {gaps:?}"
    );
    assert!(regular.iter().all(|gap| *gap == 50 * PERIOD_NS), "{gaps:?}");
    let position = |id| rig.buses[0].sent.iter().rposition(|(_, frame)| frame.id() == id).unwrap();
    let beat = position(Id::canopen(0x700, 127));
    let behind =
        rig.buses[0].sent[..beat].iter().rev().take(3).all(|(_, frame)| frame.id().value() & 0x780 == 0x200);
    assert!(behind, "the frames before it are the set-points of its slot");
}

#[test]
fn service_frames_are_sent_up_to_the_budget_behind_the_set_points() {
    let mut rig = Rig::new(3);
    let request = Frame::of(Id::canopen(0x600, 1), [0x40, 0, 0x10, 0, 0, 0, 0, 0]);
    rig.host.services.extend([request; 20]);
    rig.run(1);
    assert_eq!(rig.host.services.len(), 12, "eight while the axes are passive");
    rig.host.requests.push_back(Request::Activate);
    rig.run(1);
    assert_eq!(rig.host.services.len(), 10, "two while set-points are sent");
}

#[test]
fn frames_that_are_no_process_data_go_through_the_door() {
    let mut rig = Rig::new(3);
    let answer = Frame::of(Id::canopen(0x580, 1), [0x60, 0x17, 0x10, 0, 0, 0, 0, 0]);
    rig.buses[0].inject(answer);
    rig.run(1);
    assert_eq!(rig.host.received, [answer]);
}

#[test]
fn a_full_ring_is_counted_and_waits_for_nobody() {
    let mut rig = Rig::enabled(3);
    rig.host.is_full = true;
    let before = rig.host.snapshot.dropped;
    rig.run(10);
    assert_eq!(rig.host.snapshot.dropped, before + 10);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn whatever_the_stalls_every_slot_is_used_or_counted_and_none_twice(
        stalls in prop::collection::vec(prop_oneof![4 => Just(0u64), 1 => 0u64..5_000_000], 1..200),
    ) {
        let mut rig = Rig::enabled(1);
        let first = rig.host.snapshot.slot;
        let records_before = rig.host.records.len();
        let missed_before = rig.host.snapshot.missed_slots;
        rig.clock.lateness_ns.extend(stalls);
        rig.run(100);
        let late_commands = rig.host.records[records_before..].iter().map(|record| record.timing.missed_slots).sum::<u64>();
        prop_assert_eq!(rig.host.snapshot.missed_slots - missed_before, late_commands);
        let slots: Vec<u64> = rig.host.records[records_before..].iter().map(|record| record.timing.slot).collect();
        prop_assert!(slots.windows(2).all(|pair| pair[0] < pair[1]));
        let skipped = slots[slots.len() - 1] - first - slots.len() as u64;
        prop_assert!(late_commands >= skipped);
        prop_assert!(syncs(&rig).iter().all(|at| (at - EPOCH_NS) % PERIOD_NS <= PERIOD_NS / 10));
    }
}
