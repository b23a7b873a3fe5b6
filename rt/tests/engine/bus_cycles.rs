//! Buses whose cycle has several slots, and what the controller does around an absence.

use crate::fixture::{LIMITS, PERIOD_NS, Rig, move_to, parameters, scale};
use takt_rt::{DriveState, EngineParameters, Id, Origin, Phase, Request, Rule};

/// Three axes on a bus with a cycle in every slot, three on one with a cycle in every second.
fn two_rates() -> EngineParameters {
    let mut parameters = parameters(6);
    parameters.buses[1].divider = 2;
    parameters
}

fn times_of(rig: &Rig, bus: usize, id: Id) -> Vec<u64> {
    rig.buses[bus].sent.iter().filter(|(_, frame)| frame.id() == id).map(|(at, _)| *at).collect()
}

#[test]
fn each_bus_has_sync_and_set_points_in_its_own_cycles_on_one_grid() {
    let mut rig = Rig::of(two_rates()).enable();
    rig.run(200);
    for (bus, period_ns) in [(0, PERIOD_NS), (1, 2 * PERIOD_NS)] {
        for id in [Id::canopen(0x080, 0), Id::canopen(0x200, 2)] {
            let times = times_of(&rig, bus, id);
            assert!(times.len() > 90);
            assert!(times.windows(2).all(|pair| pair[1] - pair[0] == period_ns), "{id:?} on bus {bus}");
        }
    }
    let fast = times_of(&rig, 0, Id::canopen(0x080, 0));
    assert!(times_of(&rig, 1, Id::canopen(0x080, 0)).iter().all(|at| fast.contains(at)));
}

#[test]
fn one_move_leads_the_axes_of_both_buses_to_their_targets_at_one_time() {
    let mut rig = Rig::of(two_rates()).enable();
    rig.move_to(1.25);
    let mut fastest = [0.0_f64; 6];
    while rig.phase() == Phase::Moving {
        rig.run(1);
        let shown = rig.host.snapshot.axes;
        fastest.iter_mut().zip(shown).for_each(|(fastest, axis)| *fastest = fastest.max(axis.velocity));
    }
    rig.run(4);
    for (axis, fastest) in fastest.into_iter().enumerate() {
        assert_eq!(rig.drive(axis).position, scale().position_to_counts(1.25));
        assert!((fastest - LIMITS.velocity).abs() < 0.1, "axis {axis} was seen at {fastest}");
    }
    assert_eq!(rig.stops(), []);
    rig.assert_limits_kept();
}

/// A fault reset is an edge of bit 7: the bus must carry the controlword before and after it, however rare its cycles are.
#[test]
fn a_fault_on_a_bus_with_a_period_of_more_than_10_ms_is_reset_by_one_request() {
    for divider in [11, 20, <EngineParameters>::LARGEST_DIVIDER] {
        let mut own = parameters(6);
        own.buses[1].divider = divider;
        let mut rig = Rig::of(own);
        let cycles = divider as usize;
        rig.host.requests.extend([Request::Sync(true), Request::Activate]);
        rig.run(10 * cycles);
        rig.request(Request::Enable);
        rig.run_until(Phase::Holding, 100 * cycles);
        rig.drive(4).state = DriveState::Fault;
        rig.run_until(Phase::Disabled, 100 * cycles);
        assert_eq!(
            rig.stops().iter().map(|stop| stop.rule()).collect::<Vec<_>>(),
            [Rule::DriveFault],
            "{divider}"
        );
        rig.request(Request::ResetFaults);
        rig.run(4 * cycles);
        assert_ne!(rig.drive(4).state, DriveState::Fault, "{divider}");
        rig.request(Request::Enable);
        rig.run_until(Phase::Holding, 100 * cycles);
        assert_eq!(rig.host.snapshot.groups[0].stop, None, "{divider}");
    }
}

/// Without that a path between axes with different limits would be bent.
#[test]
fn from_rest_to_rest_the_axes_stay_on_a_straight_line_whatever_their_limits() {
    let mut own = parameters(3);
    for (axis, factor) in own.axes.iter_mut().zip([1.0, 0.3, 2.0]) {
        axis.limits.velocity *= factor;
        axis.limits.acceleration /= factor;
        axis.limits.jerk = 50.0;
    }
    let mut rig = Rig::of(own).enable();
    let start: Vec<f64> = rig.host.snapshot.axes[..3].iter().map(|axis| axis.position_set).collect();
    let mut request = move_to(0.5);
    let ends = [1.0, -0.4, 0.25];
    request.target[..3].copy_from_slice(&ends);
    rig.request(Request::Move(request));
    let mut on_the_way = 0;
    while rig.phase() == Phase::Moving {
        rig.run(1);
        let set: Vec<f64> = rig.host.snapshot.axes[..3].iter().map(|axis| axis.position_set).collect();
        let share = (set[0] - start[0]) / (ends[0] - start[0]);
        on_the_way += usize::from(share > 0.01 && share < 0.99);
        for axis in 0..3 {
            let error = set[axis] - (start[axis] + share * (ends[axis] - start[axis]));
            assert!(error.abs() < 1e-9, "axis {axis} at {share}: {error}");
        }
    }
    assert!(on_the_way > 100);
}

#[test]
fn a_slow_bus_that_is_behind_in_each_of_its_cycles_and_catches_up_between_them_is_stopped_by_sdo() {
    let mut rig = Rig::of(two_rates()).enable();
    rig.move_to(2.0);
    rig.run(300);
    for _ in 0..4_000 {
        let is_between = rig.host.snapshot.slot.is_multiple_of(2);
        rig.buses[1].unconfirmed = usize::from(!is_between);
        rig.run(1);
    }
    let stops: Vec<_> = rig.stops().iter().map(|stop| (stop.rule(), stop.origin)).collect();
    assert_eq!(stops, [(Rule::NotTransmitted, Origin::Bus(1))]);
    assert_eq!(rig.phase(), Phase::Disabled);
    for axis in 3..6 {
        assert!(!rig.drive(axis).state.has_torque(), "axis {axis}: {:?}", rig.drive(axis).state);
    }
}

#[test]
fn missed_feedback_is_counted_in_cycles_of_the_own_bus() {
    let mut rig = Rig::of(two_rates()).enable();
    rig.drive(4).is_silent = true;
    // Three cycles are bridged; the fourth ends the eighth slot at the latest.
    rig.run(6);
    assert_eq!(rig.stops(), []);
    rig.run(3);
    assert_eq!(
        rig.stops().iter().map(|stop| (stop.rule(), stop.axis())).collect::<Vec<_>>(),
        [(Rule::MissedFeedback, Some(4))]
    );
}

#[test]
fn a_drive_of_which_the_position_is_not_known_is_sent_nothing_until_bring_up_tells_it() {
    let mut rig = Rig::new(2);
    rig.drive(1).is_silent = true;
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(20);
    assert!(!times_of(&rig, 0, Id::canopen(0x200, 1)).is_empty());
    assert!(times_of(&rig, 0, Id::canopen(0x200, 2)).is_empty());
    rig.request(Request::Position { axis: 1, counts: 2_345 });
    rig.run(3);
    let id = Id::canopen(0x200, 2);
    let targets: Vec<i32> = rig.buses[0]
        .sent
        .iter()
        .filter(|(_, frame)| frame.id() == id)
        .map(|(_, frame)| (frame.first_word() >> 16) as i32)
        .collect();
    assert!(targets.len() >= 3 && targets.iter().all(|target| *target == 2_345), "{targets:?}");
    rig.request(Request::Position { axis: 2, counts: 0 });
    assert_eq!(rig.host.snapshot.rejected, 1, "there is no such axis");
}

#[test]
fn what_has_been_reported_counts_more_than_what_bring_up_tells() {
    let mut rig = Rig::enabled(1);
    rig.request(Request::Position { axis: 0, counts: 77_777 });
    rig.run(5);
    assert_eq!((rig.drive(0).position, rig.stops().len()), (1_000, 0));
}

/// A drive that has stopped for want of our heartbeat may go on with its old target when it returns.
#[test]
fn after_an_absence_set_points_leave_on_every_bus_before_the_heartbeat_does() {
    // Stopped before a slot, or between SYNC and the set-points, with the heartbeat due in any of 50 slots.
    for stall in [vec![3_000_000_000], vec![0, 3_000_000_000]] {
        for before in 0..50 {
            let mut rig = Rig::of(two_rates()).enable();
            rig.run(before);
            let gone_ns = rig.clock.now_ns;
            rig.clock.lateness_ns.extend(stall.iter().copied());
            rig.run(100);
            for bus in 0..2 {
                let later =
                    |id| times_of(&rig, bus, id).into_iter().filter(|at| *at > gone_ns + 2_000_000_000);
                let beat_ns = later(Id::canopen(0x700, 127)).next().unwrap();
                let set_points = later(Id::canopen(0x200, 1)).filter(|at| *at < beat_ns).count();
                assert!(set_points >= 3, "{set_points} on bus {bus}, {stall:?}, {before}");
            }
        }
    }
}

#[test]
fn two_buses_that_are_behind_one_after_the_other_are_no_bus_that_does_not_transmit() {
    // Six cycles in a row are too many; each of them is behind for four.
    let mut rig = Rig::of(parameters(6)).enable();
    for (bus, cycles) in [(0, 4), (1, 4), (0, 4), (1, 4)] {
        rig.buses[bus].unconfirmed = 1;
        rig.run(cycles);
        rig.buses[bus].unconfirmed = 0;
    }
    rig.run(1);
    assert_eq!(rig.stops(), []);
    rig.buses[0].unconfirmed = 1;
    rig.run(2);
    rig.buses[1].unconfirmed = 1;
    rig.run(5);
    let stops = rig.stops();
    assert_eq!((stops.len(), stops[0].rule(), stops[0].origin), (1, Rule::NotTransmitted, Origin::Bus(0)));
}

#[test]
fn a_slow_bus_that_missed_its_slot_sends_the_way_of_one_of_its_cycles_and_not_more() {
    // Commands that are ready too late, or a wake-up that misses whole slots, in slots of both buses and of the fast one alone.
    for (compute_ns, late_ns) in [(PERIOD_NS, 0), (0, PERIOD_NS / 2), (0, 2 * PERIOD_NS)] {
        for before in 300..304 {
            let mut rig = Rig::of(two_rates()).enable();
            rig.move_to(1.25);
            rig.run(before);
            rig.clock.compute_ns = compute_ns;
            rig.clock.lateness_ns.push_back(late_ns);
            rig.run(1);
            rig.clock.compute_ns = 0;
            let mut last = rig.drive(3).position;
            let mut fastest = 0;
            for _ in 0..20 {
                rig.run(1);
                let position = rig.drive(3).position;
                fastest = fastest.max((position - last).abs());
                last = position;
            }
            let count = scale().resolution();
            let allowed = LIMITS.velocity * 2.0 * PERIOD_NS as f64 * 1e-9 * count + 1.0;
            assert!(f64::from(fastest) > 0.9 * allowed, "it is under way: {fastest} of {allowed}");
            assert!(
                f64::from(fastest) <= allowed,
                "{fastest} of {allowed} counts, {compute_ns} ns, {before}"
            );
        }
    }
}

#[test]
fn a_bus_that_was_behind_sends_the_way_of_one_of_its_cycles_and_not_more() {
    for (cycles_behind, jerk) in [(1, 100.0), (2, f64::INFINITY), (4, 100.0)] {
        // At full speed, and on the way from it to rest.
        for before in [300, 760, 800] {
            let mut own = parameters(6);
            own.axes.iter_mut().for_each(|axis| axis.limits.jerk = jerk);
            let mut rig = Rig::of(own).enable();
            rig.move_to(1.25);
            rig.run(before);
            rig.buses[0].unconfirmed = 1;
            rig.run(cycles_behind);
            rig.buses[0].unconfirmed = 0;
            let mut last = rig.drive(0).position;
            let mut fastest = 0;
            while rig.phase() == Phase::Moving {
                rig.run(1);
                let position = rig.drive(0).position;
                fastest = fastest.max((position - last).abs());
                last = position;
            }
            rig.run(100);
            let count = scale().resolution();
            let allowed = LIMITS.velocity * PERIOD_NS as f64 * 1e-9 * count + 1.0;
            assert!(f64::from(fastest) > 0.2 * allowed, "it is under way: {fastest} of {allowed}");
            assert!(
                f64::from(fastest) <= allowed,
                "{fastest} of {allowed} counts, {cycles_behind}, {before}"
            );
            // It has caught up.
            assert_eq!(rig.drive(0).position, scale().position_to_counts(1.25));
            assert_eq!(rig.stops(), []);
        }
    }
}
