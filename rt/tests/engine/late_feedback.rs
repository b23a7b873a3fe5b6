//! Feedback that comes too late: it counts as missed in its own cycle and is never taken for that of a later one, however
//! regularly it comes.

use std::f64::consts::TAU;

use crate::fixture::{
    COUNTS_PER_TURN, FRICTION, INERTIA, LIMITS, PERIOD_NS, Rig, axis, axis_in, move_to, parameters, scale,
};
use takt_rt::{
    Axis, AxisParameters, ControlLaw, DriveState, Fault, FeedbackSince, Frame, Id, Move, Phase, Request,
    Rule, StopCause, controlword,
};

fn moving() -> Rig {
    let mut rig = Rig::enabled(3);
    rig.move_to(2.0);
    rig.run(200);
    assert_eq!(rig.phase(), Phase::Moving);
    rig
}

#[test]
fn feedback_that_is_late_by_whole_cycles_counts_as_missed_and_stops_the_group_after_the_hold_over() {
    for late_cycles in [1, 2, 3, 7, 40] {
        let mut rig = moving();
        rig.buses[0].lies_ns = late_cycles * PERIOD_NS;
        rig.run(3);
        assert!(rig.stops().is_empty(), "{late_cycles} cycles late: three may be missing");
        assert_eq!(rig.host.records.last().unwrap().axes[0].feedback_age, 3);
        rig.run(1);
        let stops = rig.stops();
        assert_eq!((stops.len(), stops[0].rule()), (1, Rule::MissedFeedback), "{late_cycles} cycles late");
        assert_eq!(stops[0].cause, StopCause::Fault(Fault::MissedFeedback { cycles: 4, limit: 3 }));
        rig.run_until(Phase::Disabled, 3_000);
        rig.assert_limits_kept();
    }
}

#[test]
fn feedback_that_misses_its_command_phase_by_a_little_counts_as_missed_too() {
    let mut rig = moving();
    rig.buses[0].lies_ns = 600_000;
    rig.run(5);
    assert_eq!(rig.stops()[0].rule(), Rule::MissedFeedback);
}

#[test]
fn feedback_that_comes_later_but_in_time_is_taken() {
    let mut rig = moving();
    rig.buses[0].lies_ns = 500_000;
    rig.run(100);
    assert!(rig.stops().is_empty());
    assert_eq!(rig.host.records.last().unwrap().axes[0].feedback_age, 0);
}

#[test]
fn feedback_that_is_late_for_a_few_cycles_is_borne_and_what_has_piled_up_is_neither_used_nor_another_node() {
    let mut rig = moving();
    for _ in 0..20 {
        rig.buses[0].lies_ns = 3 * PERIOD_NS;
        rig.run(3);
        // All of it at once, the late and the fresh.
        rig.buses[0].lies_ns = 0;
        rig.run(1);
        let record = rig.host.records.last().unwrap().axes[0];
        assert_eq!(record.feedback_age, 0);
        assert_eq!(record.position_raw, rig.drive(0).position);
        rig.run(10);
    }
    assert!(rig.stops().is_empty());
}

#[test]
fn a_late_report_of_where_the_joint_was_is_not_where_it_is() {
    let mut rig = moving();
    let old = rig.drive(0).position.to_le_bytes();
    rig.run(1);
    rig.drive(0).is_silent = true;
    let before = rig.engine.axes()[0].position();
    // It arrived before this cycle's SYNC, and is taken after it.
    rig.buses[0].lies_ns = PERIOD_NS - 100_000;
    let [a, b, c, d] = old;
    rig.buses[0].inject(Frame::of(Id::canopen(0x180, 1), [0x37, 0x12, a, b, c, d]));
    rig.run(1);
    assert_eq!(rig.engine.axes()[0].position(), before);
    assert_eq!(rig.engine.axes()[0].feedback_age(), 1);
}

#[test]
fn a_drive_that_reports_by_itself_is_heard_from_one_command_phase_to_the_next() {
    let mut parameters = parameters(1);
    parameters.axes[0].feedback_since = FeedbackSince::CommandPhase;
    let mut rig = Rig::of(parameters).enable();
    rig.move_to(2.0);
    let report = |rig: &mut Rig| {
        let [a, b, c, d] = rig.drive(0).position.to_le_bytes();
        rig.buses[0].inject(Frame::of(Id::canopen(0x180, 1), [0x37, 0x12, a, b, c, d]));
    };
    rig.drive(0).is_silent = true;
    for _ in 0..200 {
        // Between the command phase before and the present SYNC.
        rig.buses[0].lies_ns = PERIOD_NS - 200_000;
        report(&mut rig);
        rig.run(1);
        assert_eq!(rig.engine.axes()[0].feedback_age(), 0);
    }
    for _ in 0..4 {
        rig.buses[0].lies_ns = PERIOD_NS + 200_000;
        report(&mut rig);
        rig.run(1);
    }
    assert_eq!((rig.stops().len(), rig.stops()[0].rule()), (1, Rule::MissedFeedback));
}

/// Drives that answer so many whole cycles late, and a little more, from the first SYNC on.
fn steadily_late(cycles: u64) -> Rig {
    let mut rig = Rig::new(3);
    rig.buses[0].late_ns = cycles * PERIOD_NS + 100_000;
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(100);
    rig
}

fn syncs(rig: &Rig) -> Vec<u64> {
    let sent = rig.buses[0].sent.iter().filter(|(_, frame)| frame.id().value() == 0x80);
    sent.map(|(at_ns, _)| *at_ns).collect()
}

#[test]
fn a_drive_that_always_answers_whole_cycles_late_is_never_led_up_and_its_lateness_is_told() {
    for cycles in [1, 2, 3, 10] {
        let mut rig = steadily_late(cycles);
        assert_eq!(rig.host.snapshot.axes[0].unanswered, cycles as u16);
        for attempt in 1..=2 {
            rig.request(Request::Enable);
            rig.run_until(Phase::Disabled, 200);
            let stops = rig.stops();
            assert_eq!(
                (stops.len(), stops[0].rule(), stops[0].axis()),
                (attempt, Rule::MissedFeedback, Some(0))
            );
            assert_eq!(
                (stops[0].cause, stops[0].phase),
                (StopCause::Fault(Fault::LateFeedback { cycles: cycles as u16 }), Phase::Enabling)
            );
            rig.request(Request::ResetFaults);
        }
        let sent = rig.buses[0].sent.iter().filter(|(_, frame)| frame.id() == Id::canopen(0x200, 1));
        let words: Vec<u16> = sent.map(|(_, frame)| frame.first_word() as u16).collect();
        assert!(words.len() > 100 && words.iter().all(|word| *word == controlword::SHUTDOWN));
        // The drives answer in time from now on.
        rig.buses[0].late_ns = 0;
        rig.run(100);
        rig.request(Request::Enable);
        rig.run_until(Phase::Holding, 200);
    }
}

#[test]
fn no_sync_is_left_out_where_every_one_has_been_answered_in_time() {
    let mut rig = Rig::enabled(3);
    rig.run(200);
    assert!(syncs(&rig).windows(2).all(|pair| pair[1] - pair[0] == PERIOD_NS));
}

#[test]
fn an_answer_that_was_lost_before_costs_one_sync_and_nothing_else() {
    let mut rig = Rig::new(3);
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(50);
    rig.drive(1).is_silent = true;
    rig.run(2);
    rig.drive(1).is_silent = false;
    rig.run(50);
    assert_eq!(rig.host.snapshot.axes[1].unanswered, 2);
    rig.request(Request::Enable);
    rig.run_until(Phase::Holding, 50);
    let left_out = syncs(&rig).windows(2).filter(|pair| pair[1] - pair[0] == 2 * PERIOD_NS).count();
    assert_eq!((left_out, rig.stops().len()), (1, 0));
    assert_eq!(rig.host.snapshot.axes[1].unanswered, 0);
}

/// The velocities that an axis makes of a joint's reports, while its drive is asked for them so much too late.
fn velocities(feedback_since: FeedbackSince, late_ns: &[u64], missed_every: u64) -> Vec<f64> {
    let period_s = PERIOD_NS as f64 * 1e-9;
    let mut axis = Axis::new(0, AxisParameters { feedback_since, ..axis(0, 1) });
    axis.set_cycle(period_s);
    let (mut velocities, mut last_slot) = (vec![], 0);
    for (slot, late_ns) in (1..400).zip(late_ns.iter().cycle()).filter(|(slot, _)| slot % missed_every != 0) {
        let asked_ns = slot * PERIOD_NS + late_ns;
        axis.expect_feedback(asked_ns);
        let position = scale().position_to_counts(LIMITS.velocity * asked_ns as f64 * 1e-9);
        let [s0, s1] = (DriveState::OperationEnabled.statusword_bits() | 0x0290).to_le_bytes();
        let [p0, p1, p2, p3] = position.to_le_bytes();
        let report = Frame::of(Id::canopen(0x180, 1), [s0, s1, p0, p1, p2, p3]);
        axis.receive(0, &report, asked_ns + 100_000).unwrap();
        axis.begin_cycle(period_s * (slot - last_slot) as f64);
        last_slot = slot;
        velocities.push(axis.velocity());
    }
    velocities.split_off(2)
}

#[test]
fn a_joint_is_no_faster_because_its_drive_is_asked_late() {
    for feedback_since in [FeedbackSince::Sync, FeedbackSince::SetPoint] {
        for missed_every in [1_000, 7] {
            let late_ns = [0, 250_000, 100_000, 0, 400_000];
            for velocity in velocities(feedback_since, &late_ns, missed_every) {
                let error = velocity / LIMITS.velocity - 1.0;
                // The positions are rounded to counts.
                assert!(error.abs() < 0.02, "{feedback_since:?}: {error}");
            }
        }
    }
}

/// The age in the last record, the same in the last snapshot, and how many slots ago the last feedback was.
fn ages(rig: &Rig) -> (u16, u16, u64) {
    let (record, snapshot) = (rig.host.records.last().unwrap(), rig.host.snapshot);
    let shown = snapshot.axes[0];
    assert_eq!(shown.is_stale(), shown.feedback_age > 0);
    (record.axes[0].feedback_age, shown.feedback_age, snapshot.slot - shown.feedback_slot)
}

#[test]
fn feedback_is_shown_with_its_age_also_in_cycles_in_which_none_was_asked_for() {
    let mut rig = moving();
    assert_eq!(ages(&rig), (0, 0, 0));
    for age in 1..=3 {
        rig.drive(0).is_silent = true;
        rig.run(1);
        assert_eq!(ages(&rig), (age, age, age.into()));
    }
    rig.drive(0).is_silent = false;
    rig.run(1);
    assert_eq!(ages(&rig), (0, 0, 0));
    // Behind a frame that the bus has not taken, no SYNC is sent: no drive is asked, and none has missed its answer.
    rig.buses[0].unconfirmed = 1;
    rig.run(2);
    let (record, shown, slots) = ages(&rig);
    assert!(record >= 1 && record == shown && u64::from(record) == slots, "{record} {shown} {slots}");
    assert!(rig.engine.axes()[0].feedback_age() < record);
}

fn with_law(law: ControlLaw) -> Rig {
    let mut parameters = parameters(1);
    parameters.axes[0] = axis_in(law, 0, 1);
    Rig::of(parameters).enable()
}

/// In CSV and CST the position loop is closed over the bus.
#[test]
fn a_joint_whose_loop_is_closed_over_the_bus_follows_its_set_point_to_rest_when_its_drive_falls_silent() {
    let torque = ControlLaw::Torque {
        stiffness: 1600.0 * INERTIA,
        damping: 80.0 * INERTIA,
        inertia: INERTIA,
        viscous_friction: FRICTION,
        coulomb_friction: 0.0,
    };
    // Nobody corrects what friction and inertia make of a torque: there the joint may drift a little.
    for (law, slack) in [(ControlLaw::Velocity { position_gain: 20.0 }, 0.01), (torque, 0.1)] {
        let mut rig = with_law(law);
        rig.move_to(2.0);
        rig.run(200);
        let counts_per_unit = COUNTS_PER_TURN / TAU;
        let speed_before = rig.engine.axes()[0].set_point().velocity;
        rig.drive(0).is_silent = true;
        let mut last = rig.drive(0).position;
        while rig.phase() != Phase::Disabled {
            rig.run(1);
            let now = rig.drive(0).position;
            let speed = f64::from(now - last) / counts_per_unit / 1e-3;
            assert!(speed <= speed_before * 1.05 && speed > -slack, "{law:?}: {speed} of {speed_before}");
            last = now;
        }
        let joint = f64::from(last) / counts_per_unit;
        let set_point = rig.engine.axes()[0].set_point().position;
        assert!((joint - set_point).abs() < slack, "{law:?}: {joint}, {set_point}");
    }
}

#[test]
fn one_report_that_is_lost_does_not_move_a_joint_whose_loop_is_closed_over_the_bus() {
    let mut rig = with_law(ControlLaw::Velocity { position_gain: 20.0 });
    rig.request(Request::Move(Move { velocity_scale: 0.5, ..move_to(2.0) }));
    rig.run(400);
    let velocity = |rig: &mut Rig| {
        let before = rig.drive(0).position;
        rig.run(1);
        rig.drive(0).position - before
    };
    let even = velocity(&mut rig);
    rig.drive(0).is_silent = true;
    let mut seen = vec![velocity(&mut rig), velocity(&mut rig)];
    rig.drive(0).is_silent = false;
    seen.extend((0..4).map(|_| velocity(&mut rig)));
    assert!(seen.iter().all(|way| (way - even).abs() <= 1), "{even}: {seen:?}");
}
