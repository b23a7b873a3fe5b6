//! What a callback sees and commands, and how it is followed.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use super::rig::{
    BUDGET_NS, COMMANDED, JERK, Targets, at, followed, holding, lead, leading_to, ramp, run, set_point,
    state_of, the_only_stop,
};
use crate::fixture::{LIMITS, PERIOD_NS, PERIOD_S, Rig, jerk_limited};
use takt_rt::plan::State;
use takt_rt::{
    AxisSnapshot, CallbackCycle, CallbackRun, EventKind, Follow, MAX_AXES, MotionState, Origin, Phase,
    Request, Rule, StopCategory, StreamState,
};

#[test]
fn what_a_callback_commands_is_where_the_axis_is_at_the_end_of_the_slot_and_the_others_hold() {
    for follow in [Follow::Smooth, Follow::Exact] {
        let mut rig = holding(JERK);
        let mut cycles = 0;
        let begun = lead(&mut rig, followed(follow), move |cycle, _, targets| {
            cycles += 1;
            // The square of a raised cosine begins without a leap of its acceleration.
            let (time_s, rate) = (f64::from(cycles) * cycle.period_s, std::f64::consts::TAU / 2.0);
            let ((sine, cosine), scale) = ((rate * time_s).sin_cos(), 0.05);
            targets[0] = at(State {
                position: scale * (1.0 - cosine).powi(2),
                velocity: scale * 2.0 * (1.0 - cosine) * sine * rate,
                acceleration: scale * 2.0 * rate * rate * (sine * sine + (1.0 - cosine) * cosine),
            });
            COMMANDED
        });
        assert_eq!(
            (rig.phase(), rig.host.snapshot.groups[0].stream.state),
            (Phase::Streaming, StreamState::Callback)
        );
        assert_eq!(state_of(&rig, begun), MotionState::InProgress);
        rig.run(999);
        // A thousand calls are half a turn.
        assert!((set_point(&rig).position - 0.2).abs() < 1e-6, "{:?}", set_point(&rig));
        assert_eq!(rig.engine.axes()[1].set_point().position, 0.0);
        assert_eq!(rig.stops(), []);
        rig.assert_differences_kept(JERK);
        let begun = EventKind::Stream { state: StreamState::Callback };
        assert!(rig.host.events.iter().any(|event| event.kind == begun));
    }
}

#[test]
fn it_is_told_the_real_time_since_its_last_call_and_what_was_missed() {
    let mut rig = holding(JERK);
    let told = Rc::new(RefCell::new(vec![]));
    let telling = Rc::clone(&told);
    lead(&mut rig, run(1), move |cycle, _, _| {
        telling.borrow_mut().push(*cycle);
        COMMANDED
    });
    rig.run(5);
    // The thread sleeps through three slots.
    rig.clock.lateness_ns.extend([0, 3 * PERIOD_NS]);
    rig.run(5);
    let told = told.borrow();
    let whole = |cycle: &CallbackCycle| ((cycle.dt_s / PERIOD_S).round() as u64, cycle.missed_slots);
    assert_eq!(whole(&told[0]), (1, 0));
    let missed: Vec<u64> = told.iter().map(|cycle| cycle.missed_slots).filter(|missed| *missed > 0).collect();
    assert!(!missed.is_empty() && missed.iter().sum::<u64>() >= 3, "{missed:?}");
    for pair in told.windows(2) {
        let slots = pair[1].slot - pair[0].slot;
        assert_eq!(whole(&pair[1]), (slots, slots - 1));
        assert_eq!(pair[1].slot_start_ns - pair[0].slot_start_ns, slots * PERIOD_NS);
        assert_eq!((pair[1].period_s, pair[1].budget_ns), (PERIOD_S, BUDGET_NS));
        assert_eq!(pair[1].set_points_due_ns - pair[1].slot_start_ns, 800_000);
    }
}

#[test]
fn it_sees_what_the_drives_have_reported_in_this_very_cycle_and_how_old_it_is() {
    let mut rig = holding(JERK);
    let seen: Rc<Cell<(u64, AxisSnapshot)>> = Rc::default();
    let seeing = Rc::clone(&seen);
    lead(&mut rig, run(1), move |cycle, axes, _| {
        seeing.set((cycle.slot, axes[0]));
        COMMANDED
    });
    rig.drive(0).is_stuck = true;
    rig.drive(0).position += 7;
    rig.run(2);
    let (slot, axis) = seen.get();
    let counts = rig.drive(0).position;
    assert_eq!(axis.position, rig.engine.axes()[0].parameters().scale.position_from_counts(counts));
    assert!(!axis.is_stale());
    assert_eq!((axis.feedback_slot, axis.feedback_age), (slot, 0));
    rig.drive(0).is_silent = true;
    rig.run(2);
    let (slot, axis) = seen.get();
    assert!(axis.is_stale(), "it has not reported in this cycle");
    assert!(axis.feedback_slot < slot && axis.feedback_age > 0, "{axis:?} in slot {slot}");
}

#[test]
fn an_axis_that_is_commanded_no_longer_comes_to_rest_within_its_limits_and_goes_on_without_a_bump() {
    for follow in [Follow::Smooth, Follow::Exact] {
        let mut rig = holding(JERK);
        let is_commanding = Rc::new(Cell::new(true));
        let command = Rc::clone(&is_commanding);
        let mut since = None;
        lead(&mut rig, followed(follow), move |cycle, axes, targets| {
            if !command.get() {
                since = None;
                return COMMANDED;
            }
            let (home, calls) = since.unwrap_or((axes[0].position_set, 0_u32));
            since = Some((home, calls + 1));
            let time_s = f64::from(calls + 1) * cycle.period_s;
            targets[0] = at(State { position: home + ramp(time_s).position, ..ramp(time_s) });
            COMMANDED
        });
        rig.run(150);
        assert!(set_point(&rig).velocity > 0.1, "{:?}", set_point(&rig));
        is_commanding.set(false);
        rig.run(1_500);
        let rest = set_point(&rig);
        assert!(rest.velocity.abs() < 1e-9 && rest.position > 0.01, "{rest:?}");
        rig.run(100);
        assert_eq!(set_point(&rig).position, rest.position, "it does not come back");
        is_commanding.set(true);
        rig.run(150);
        assert!(set_point(&rig).velocity > 0.1, "{:?}", set_point(&rig));
        assert_eq!((rig.stops(), rig.phase()), (vec![], Phase::Streaming), "{follow:?}");
        rig.assert_differences_kept(JERK);
    }
}

#[test]
fn what_it_may_not_command_is_tracked_or_is_a_stop_as_was_asked_for() {
    let mut rig = holding(JERK);
    lead(&mut rig, run(1), leading_to(9.0));
    rig.run(4_000);
    assert!((set_point(&rig).position - LIMITS.position_max).abs() < 1e-6, "{:?}", set_point(&rig));
    assert_eq!(rig.stops(), []);
    rig.assert_differences_kept(JERK);

    let mut rig = holding(JERK);
    lead(&mut rig, followed(Follow::Exact), leading_to(0.5));
    rig.run(100);
    let (fault, category) = the_only_stop(&rig);
    assert_eq!((fault.rule(), category), (Rule::VelocityLimit, StopCategory::Two));
    assert_eq!(rig.stops()[0].origin, Origin::Axis(0));
    assert_eq!((rig.phase(), set_point(&rig).position), (Phase::Holding, 0.0));
}

#[test]
fn without_a_wish_each_axis_is_followed_as_it_is_configured_and_a_wish_ends_with_the_callback() {
    let mut parameters = jerk_limited(1, JERK);
    parameters.axes[0].follow = Follow::Exact;
    let mut rig = Rig::of(parameters).enable();
    rig.run(20);
    let leap = |_: &CallbackCycle, axes: &[AxisSnapshot; MAX_AXES], targets: &mut Targets| {
        targets[0] = at(State::rest(axes[0].position + 0.3));
        COMMANDED
    };
    lead(&mut rig, run(1), leap);
    rig.run(50);
    assert_eq!(rig.stops(), [], "it is tracked");
    rig.request(Request::Stop(StopCategory::Two));
    rig.run_until(Phase::Holding, 2_000);
    lead(&mut rig, CallbackRun { follow: None, ..run(2) }, leap);
    rig.run(1);
    assert_eq!(rig.stops().last().unwrap().rule(), Rule::VelocityLimit);
}
