//! Callbacks: the owner's function leads a group, once a slot, behind the same guard as everything else.

mod fixture;

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use fixture::{FRICTION, INERTIA, LIMITS, PERIOD_NS, Rig, TestCallback, axis_in, jerk_limited, move_to};
use proptest::prelude::*;
use takt_rt::plan::State;
use takt_rt::{
    AxisParameters, AxisSnapshot, AxisTarget, CallbackCycle, CallbackId, CallbackOutcome, CallbackReturn,
    CallbackRun, ControlLaw, EventKind, Fault, Follow, GroupParameters, MAX_AXES, MotionState, Origin, Phase,
    RejectReason, Request, RequestId, Rule, StopCategory, StopReason, StreamState,
};

const PERIOD_S: f64 = PERIOD_NS as f64 * 1e-9;
const JERK: f64 = 100.0;
const BUDGET_NS: u64 = 50_000;
const COMMANDED: CallbackReturn = CallbackReturn { outcome: CallbackOutcome::Commanded, spent_ns: 1_000 };
const FINISHED: CallbackReturn = CallbackReturn { outcome: CallbackOutcome::Finished, spent_ns: 1_000 };
const PANICKED: CallbackReturn = CallbackReturn { outcome: CallbackOutcome::Panicked, spent_ns: 1_000 };

type Targets = [Option<AxisTarget>; MAX_AXES];

const fn run(callback: u64) -> CallbackRun {
    CallbackRun {
        callback: CallbackId(callback),
        budget_ns: BUDGET_NS,
        overruns_allowed: 0,
        follow: Some(Follow::Smooth),
    }
}

/// Two axes that hold at 0.
fn holding(jerk: f64) -> Rig {
    let mut rig = Rig::of(jerk_limited(2, jerk)).enable();
    rig.move_to(0.0);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(10);
    rig.host.records.clear();
    rig.host.events.clear();
    rig
}

fn give(
    rig: &mut Rig,
    (group, id): (u8, u64),
    body: impl FnMut(&CallbackCycle, &[AxisSnapshot; MAX_AXES], &mut Targets) -> CallbackReturn + 'static,
) {
    rig.host.callbacks.push(TestCallback { id: CallbackId(id), group, body: Box::new(body) });
}

/// Lets a function lead the only group, under the number 1.
fn lead(
    rig: &mut Rig,
    run: CallbackRun,
    body: impl FnMut(&CallbackCycle, &[AxisSnapshot; MAX_AXES], &mut Targets) -> CallbackReturn + 'static,
) -> RequestId {
    give(rig, (0, run.callback.0), body);
    rig.request(Request::RunCallback(run));
    RequestId(rig.host.taken)
}

fn at(state: State) -> Option<AxisTarget> {
    Some(state.into())
}

fn state_of(rig: &Rig, motion: RequestId) -> MotionState {
    rig.host.snapshot.motions.of(motion).unwrap()
}

fn set_point(rig: &Rig) -> State {
    rig.engine.axes()[0].set_point()
}

/// Checks that no finite difference of the set-points is beyond its limit.
fn assert_differences_kept(rig: &Rig, jerk: f64) {
    rig.assert_limits_kept();
    let set: Vec<f64> = rig.host.records.iter().map(|record| record.axes[0].position_set).collect();
    for (index, set) in set.windows(4).enumerate() {
        let highest = (set[3] - 3.0 * set[2] + 3.0 * set[1] - set[0]).abs() / PERIOD_S.powi(3);
        assert!(highest <= jerk * (1.0 + 1e-5) + 1e-4, "jerk {highest} in cycle {index}");
    }
}

fn the_only_stop(rig: &Rig) -> (Fault, StopCategory) {
    let stops = rig.stops();
    assert_eq!(stops.len(), 1, "{stops:?}");
    (stops[0].cause.fault().copied().expect("it is a fault"), stops[0].category)
}

#[test]
fn what_a_callback_commands_is_where_the_axis_is_at_the_end_of_the_slot_and_the_others_hold() {
    for follow in [Follow::Smooth, Follow::Exact] {
        let mut rig = holding(JERK);
        let mut cycles = 0;
        let begun =
            lead(&mut rig, CallbackRun { follow: Some(follow), ..run(1) }, move |cycle, _, targets| {
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
        assert_differences_kept(&rig, JERK);
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
        lead(&mut rig, CallbackRun { follow: Some(follow), ..run(1) }, move |cycle, axes, targets| {
            if !command.get() {
                since = None;
                return COMMANDED;
            }
            let (home, calls) = since.unwrap_or((axes[0].position_set, 0_u32));
            since = Some((home, calls + 1));
            let time_s = f64::from(calls + 1) * cycle.period_s;
            targets[0] = at(State {
                position: home + 8.0 * time_s.powi(3),
                velocity: 24.0 * time_s.powi(2),
                acceleration: 48.0 * time_s,
            });
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
        assert_differences_kept(&rig, JERK);
    }
}

#[test]
fn what_it_may_not_command_is_tracked_or_is_a_stop_as_was_asked_for() {
    let mut rig = holding(JERK);
    lead(&mut rig, run(1), |_, _, targets| {
        targets[0] = at(State::rest(9.0));
        COMMANDED
    });
    rig.run(4_000);
    assert!((set_point(&rig).position - LIMITS.position_max).abs() < 1e-6, "{:?}", set_point(&rig));
    assert_eq!(rig.stops(), []);
    assert_differences_kept(&rig, JERK);

    let mut rig = holding(JERK);
    lead(&mut rig, CallbackRun { follow: Some(Follow::Exact), ..run(1) }, |_, _, targets| {
        targets[0] = at(State::rest(0.5));
        COMMANDED
    });
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

#[test]
fn what_is_no_number_stops_the_group_where_it_can() {
    for bad in [
        State { position: f64::NAN, ..State::default() },
        State { velocity: f64::INFINITY, ..State::default() },
        State { acceleration: f64::NAN, ..State::default() },
    ] {
        for follow in [Follow::Smooth, Follow::Exact] {
            let mut rig = holding(JERK);
            let is_bad = Rc::new(Cell::new(false));
            let turns_bad = Rc::clone(&is_bad);
            lead(&mut rig, CallbackRun { follow: Some(follow), ..run(1) }, move |_, _, targets| {
                let is_tracked = follow == Follow::Smooth;
                targets[0] = if turns_bad.get() {
                    at(bad)
                } else {
                    at(State::rest(if is_tracked { 0.5 } else { 0.0 }))
                };
                COMMANDED
            });
            rig.run(200);
            is_bad.set(true);
            rig.run(1);
            rig.run_until(Phase::Holding, 1_000);
            let (fault, category) = the_only_stop(&rig);
            assert_eq!((fault.rule(), category), (Rule::NotFinite, StopCategory::Two));
            assert_differences_kept(&rig, JERK);
        }
    }
}

#[test]
fn a_call_that_takes_too_long_is_a_stop_and_the_callback_is_not_called_again() {
    let mut rig = holding(JERK);
    let calls = Rc::new(Cell::new(0));
    let calling = Rc::clone(&calls);
    let begun = lead(&mut rig, run(1), move |_, _, targets| {
        calling.set(calling.get() + 1);
        targets[0] = at(State::rest(0.5));
        let spent_ns = if calling.get() == 100 { BUDGET_NS + 1 } else { BUDGET_NS };
        CallbackReturn { spent_ns, ..COMMANDED }
    });
    rig.run(500);
    let overrun = Fault::CallbackOverrun { spent_ns: BUDGET_NS + 1, budget_ns: BUDGET_NS };
    assert_eq!(the_only_stop(&rig), (overrun, StopCategory::Two));
    assert_eq!(rig.stops()[0].phase, Phase::Streaming);
    assert_eq!((calls.get(), rig.phase()), (100, Phase::Holding));
    assert_eq!(state_of(&rig, begun), MotionState::Stopped(rig.stops()[0]));
    assert_eq!(rig.host.needed_callbacks, []);
    assert_differences_kept(&rig, JERK);
}

#[test]
fn as_many_calls_in_a_row_may_take_too_long_as_were_allowed() {
    let mut rig = holding(JERK);
    let mut calls = 0;
    lead(&mut rig, CallbackRun { overruns_allowed: 2, ..run(1) }, move |_, _, _| {
        calls += 1;
        // Two of three, and from the 300th on all.
        let is_slow = calls % 3 != 0 || calls >= 300;
        CallbackReturn { spent_ns: if is_slow { 2 * BUDGET_NS } else { 1 }, ..COMMANDED }
    });
    rig.run(298);
    assert_eq!(rig.stops(), []);
    rig.run(10);
    let (fault, _) = the_only_stop(&rig);
    assert_eq!(fault.rule(), Rule::CallbackOverrun);
}

#[test]
fn a_panic_is_a_stop_by_the_category_of_the_configuration_and_the_callback_is_not_called_again() {
    for category in [StopCategory::Two, StopCategory::One, StopCategory::Zero] {
        let mut parameters = jerk_limited(1, JERK);
        parameters.categories.set(Rule::CallbackPanicked, category);
        let mut rig = Rig::of(parameters).enable();
        rig.run(20);
        let calls = Rc::new(Cell::new(0));
        let calling = Rc::clone(&calls);
        lead(&mut rig, run(1), move |_, axes, targets| {
            calling.set(calling.get() + 1);
            targets[0] = at(State::rest(axes[0].position + 0.3));
            if calling.get() == 50 { PANICKED } else { COMMANDED }
        });
        rig.run(1_000);
        assert_eq!(the_only_stop(&rig), (Fault::CallbackPanicked, category));
        let expected = if category == StopCategory::Two { Phase::Holding } else { Phase::Disabled };
        assert_eq!((calls.get(), rig.phase()), (50, expected));
        assert_eq!(rig.host.needed_callbacks, []);
    }
}

#[test]
fn a_callback_that_is_over_lets_the_axes_come_to_rest_and_its_motion_is_done_then() {
    for follow in [Follow::Smooth, Follow::Exact] {
        let mut rig = holding(JERK);
        let mut calls = 0_u32;
        let begun =
            lead(&mut rig, CallbackRun { follow: Some(follow), ..run(1) }, move |cycle, _, targets| {
                calls += 1;
                let time_s = f64::from(calls) * cycle.period_s;
                targets[0] = at(State {
                    position: 8.0 * time_s.powi(3),
                    velocity: 24.0 * time_s.powi(2),
                    acceleration: 48.0 * time_s,
                });
                if calls == 150 { FINISHED } else { COMMANDED }
            });
        rig.run(148);
        assert_eq!(state_of(&rig, begun), MotionState::InProgress);
        rig.run(1);
        assert_eq!((rig.phase(), state_of(&rig, begun)), (Phase::Moving, MotionState::InProgress));
        assert_eq!(rig.host.needed_callbacks, [], "it goes back to the host");
        rig.run_until(Phase::Holding, 1_000);
        assert_eq!(state_of(&rig, begun), MotionState::Finished);
        assert_eq!((rig.finished_motions(), rig.stops()), (1, vec![]));
        assert_eq!(set_point(&rig).velocity, 0.0);
        assert_differences_kept(&rig, JERK);
    }
}

#[test]
fn a_move_takes_the_place_of_a_callback_in_motion_without_a_bump() {
    for follow in [Follow::Smooth, Follow::Exact] {
        let mut rig = holding(JERK);
        let mut calls = 0_u32;
        let begun =
            lead(&mut rig, CallbackRun { follow: Some(follow), ..run(1) }, move |cycle, _, targets| {
                calls += 1;
                let time_s = f64::from(calls) * cycle.period_s;
                // What it says of its velocity is wrong; where it leads is not.
                targets[0] = at(State { position: 8.0 * time_s.powi(3), ..State::default() });
                COMMANDED
            });
        rig.run(150);
        rig.request(Request::Move(move_to(9.0)));
        assert_eq!(
            rig.rejections().last().unwrap().reason,
            RejectReason::PositionLimit { position: 9.0, limit: 3.0 }
        );
        assert_eq!((rig.phase(), state_of(&rig, begun)), (Phase::Streaming, MotionState::InProgress));
        rig.request(Request::Move(move_to(-0.1)));
        let by = RequestId(rig.host.taken);
        assert_eq!((rig.phase(), state_of(&rig, begun)), (Phase::Moving, MotionState::Replaced { by }));
        assert_eq!(rig.host.needed_callbacks, []);
        rig.run_until(Phase::Holding, 3_000);
        assert!((set_point(&rig).position + 0.1).abs() < 1e-9);
        assert_eq!(rig.stops(), []);
        assert_differences_kept(&rig, JERK);
    }
}

#[test]
fn another_callback_takes_the_place_of_one_in_motion_and_nothing_else_does() {
    let mut rig = holding(JERK);
    let lead_to = |position: f64| {
        move |_: &CallbackCycle, _: &[AxisSnapshot; MAX_AXES], targets: &mut Targets| {
            targets[0] = at(State::rest(position));
            COMMANDED
        }
    };
    let first = lead(&mut rig, run(1), lead_to(0.5));
    rig.run(100);
    for request in [Request::Stream, Request::Enable, Request::Activate, Request::ResetFaults] {
        rig.request(request);
        assert_eq!(rig.rejections().last().unwrap().reason, RejectReason::Phase, "{request:?}");
    }
    rig.request(Request::RunCallback(run(7)));
    assert_eq!(rig.rejections().last().unwrap().reason, RejectReason::UnknownCallback);
    assert_eq!(rig.host.needed_callbacks, [(0, CallbackId(1))]);
    let second = lead(&mut rig, run(2), lead_to(-0.2));
    assert_eq!(rig.host.needed_callbacks, [(0, CallbackId(2))]);
    assert_eq!(state_of(&rig, first), MotionState::Replaced { by: second });
    rig.run(2_000);
    assert!((set_point(&rig).position + 0.2).abs() < 1e-6);
    assert_eq!((rig.phase(), rig.stops()), (Phase::Streaming, vec![]));
    assert_differences_kept(&rig, JERK);
}

#[test]
fn it_begins_only_while_the_group_holds_without_a_fault() {
    let mut rig = Rig::of(jerk_limited(2, JERK));
    give(&mut rig, (0, 1), |_, _, _| COMMANDED);
    let last = |rig: &Rig| rig.rejections().last().unwrap().reason;
    rig.request(Request::RunCallback(run(1)));
    assert_eq!(last(&rig), RejectReason::Phase);
    let mut rig = rig.enable();
    rig.move_to(0.5);
    rig.request(Request::RunCallback(run(1)));
    assert_eq!((last(&rig), rig.phase()), (RejectReason::Phase, Phase::Moving));
    rig.run_until(Phase::Holding, 3_000);
    give(&mut rig, (0, 2), |_, _, _| PANICKED);
    rig.request(Request::RunCallback(run(2)));
    rig.run(2);
    assert_eq!(rig.phase(), Phase::Holding);
    rig.request(Request::RunCallback(run(1)));
    assert_eq!(last(&rig), RejectReason::StopLatched { rule: Rule::CallbackPanicked });
    rig.request(Request::ResetFaults);
    rig.request(Request::RunCallback(run(1)));
    assert_eq!(rig.phase(), Phase::Streaming);
}

#[test]
fn a_stop_at_any_time_keeps_every_limit() {
    for cycles in [0, 5, 40, 90, 200, 333, 700] {
        for request in [Request::Stop(StopCategory::Two), Request::Stop(StopCategory::One), Request::Disable]
        {
            let mut rig = holding(JERK);
            lead(&mut rig, run(1), |_, _, targets| {
                targets[0] = at(State { position: 2.5, velocity: 1.0, acceleration: 0.0 });
                COMMANDED
            });
            rig.run(cycles);
            rig.request(request);
            assert_eq!(rig.host.needed_callbacks, []);
            rig.run(2_000);
            let is_held = request == Request::Stop(StopCategory::Two);
            assert_eq!(rig.phase(), if is_held { Phase::Holding } else { Phase::Disabled });
            assert_eq!(rig.stops().len(), 1);
            // The set-points of a disabled axis follow its encoder.
            rig.host.records.retain(|record| record.groups[0].phase != Phase::Disabled);
            assert_differences_kept(&rig, JERK);
        }
    }
}

#[test]
fn a_callback_that_the_host_loses_is_a_stop() {
    let mut rig = holding(JERK);
    lead(&mut rig, run(1), |_, _, _| COMMANDED);
    rig.run(10);
    rig.host.callbacks.clear();
    rig.run(2);
    assert_eq!(the_only_stop(&rig), (Fault::StaleCommand { age_cycles: 1 }, StopCategory::Two));
}

#[test]
fn it_is_not_called_in_a_cycle_that_stops_the_group() {
    let mut rig = holding(JERK);
    let calls = Rc::new(Cell::new(0));
    let calling = Rc::clone(&calls);
    lead(&mut rig, run(1), move |_, _, _| {
        calling.set(calling.get() + 1);
        COMMANDED
    });
    rig.drive(1).is_silent = true;
    let mut cycles = 1;
    while rig.stops().is_empty() {
        assert_eq!(calls.get(), cycles);
        rig.run(1);
        cycles += 1;
    }
    assert_eq!(calls.get(), cycles - 1, "not in the last one");
}

#[test]
fn two_groups_are_led_by_a_callback_each_and_the_fault_of_the_one_is_not_the_others() {
    let group =
        |axes: &[u8]| GroupParameters { axes: axes.iter().copied().collect(), ..GroupParameters::default() };
    let mut parameters = jerk_limited(6, JERK);
    parameters.groups = [group(&[0, 2, 4]), group(&[1, 3, 5])].into_iter().collect();
    let mut rig = Rig::of(parameters).enable();
    rig.run(20);
    let home = rig.host.snapshot.axes.map(|axis| axis.position_set);
    for group in [0_u8, 1] {
        let mut calls = 0;
        give(&mut rig, (group, 1), move |_, axes, targets| {
            // It may write to what is not its own: that leads nothing.
            targets.fill(at(State::rest(home[0] + if group == 0 { 0.2 } else { -0.2 })));
            assert!(axes[usize::from(group)].is_heard);
            calls += 1;
            if group == 1 && calls == 500 { PANICKED } else { COMMANDED }
        });
    }
    rig.request(Request::RunCallback(run(1)));
    assert_eq!(rig.rejections().last().unwrap().reason, RejectReason::GroupNotNamed { groups: 2 });
    for group in [0, 1] {
        rig.host.group_requests.push_back((group, Request::RunCallback(run(1))));
    }
    rig.run(1);
    assert_eq!(rig.host.needed_callbacks, [(0, CallbackId(1)), (1, CallbackId(1))]);
    rig.run(498);
    for (axis, set) in rig.host.snapshot.axes().iter().map(|axis| axis.position_set).enumerate() {
        let expected = home[0] + if axis % 2 == 0 { 0.2 } else { -0.2 };
        assert!((set - expected).abs() < 1e-3, "axis {axis} is led to {set}");
    }
    rig.run(500);
    assert_eq!((rig.phase_of(0), rig.phase_of(1)), (Phase::Streaming, Phase::Holding));
    assert_eq!(rig.stops().len(), 1);
    assert_eq!(rig.host.needed_callbacks, [(0, CallbackId(1))]);
}

const LAW: ControlLaw = ControlLaw::Torque {
    stiffness: 400.0,
    damping: 40.0,
    inertia: INERTIA,
    viscous_friction: FRICTION,
    coulomb_friction: 0.0,
};

/// An axis whose loop is closed here, at rest.
fn torque_axis() -> Rig {
    let mut parameters = jerk_limited(1, JERK);
    parameters.axes =
        [AxisParameters { limits: parameters.axes[0].limits, ..axis_in(LAW, 0, 1) }].into_iter().collect();
    let mut rig = Rig::of(parameters).enable();
    rig.run(50);
    rig.host.events.clear();
    rig
}

#[test]
fn a_torque_drives_the_joint_and_what_is_not_commanded_any_more_is_caught_where_the_joint_is() {
    let mut rig = torque_axis();
    let mut calls = 0;
    let begun = lead(&mut rig, run(1), move |_, _, targets| {
        calls += 1;
        targets[0] = if calls <= 300 { Some(AxisTarget::Torque(4.0)) } else { None };
        if calls == 1_000 { FINISHED } else { COMMANDED }
    });
    rig.run(298);
    let axis = rig.host.snapshot.axes[0];
    assert_eq!(axis.torque_set, 4.0);
    assert!(axis.velocity > 0.5, "{axis:?}");
    assert!((axis.position_set - axis.position).abs() < 0.01, "the set-point is on the joint: {axis:?}");
    rig.run(600);
    let axis = rig.host.snapshot.axes[0];
    assert!(axis.velocity.abs() < 0.01 && axis.following_error.abs() < 0.01, "{axis:?}");
    rig.run(500);
    assert_eq!((rig.stops(), rig.phase()), (vec![], Phase::Holding));
    assert_eq!(state_of(&rig, begun), MotionState::Finished);
}

#[test]
fn a_spring_gives_way_to_a_torque_and_a_velocity_leads_the_set_point() {
    let mut rig = torque_axis();
    let home = set_point(&rig).position;
    let stage = Rc::new(Cell::new(0));
    let staged = Rc::clone(&stage);
    lead(&mut rig, run(1), move |_, _, targets| {
        let spring = |torque| AxisTarget::Impedance {
            state: State::rest(home),
            stiffness: 50.0,
            damping: 10.0,
            torque,
        };
        targets[0] = Some(match staged.get() {
            0 => spring(0.0),
            1 => spring(5.0),
            _ => AxisTarget::Velocity { velocity: 0.3, acceleration: 0.0 },
        });
        COMMANDED
    });
    rig.run(300);
    assert!((rig.host.snapshot.axes[0].position - home).abs() < 1e-3);
    stage.set(1);
    rig.run(2_000);
    let bent = rig.host.snapshot.axes[0].position - home;
    assert!((bent - 5.0 / 50.0).abs() < 2e-3, "{bent} rad");
    stage.set(2);
    rig.run(1_000);
    assert!((set_point(&rig).velocity - 0.3).abs() < 1e-6, "{:?}", set_point(&rig));
    // In motion, a move takes over.
    rig.request(Request::Move(move_to(home)));
    rig.run_until(Phase::Holding, 5_000);
    rig.run(500);
    assert!((rig.host.snapshot.axes[0].position - home).abs() < 1e-3);
    assert_eq!(rig.stops(), []);
}

#[test]
fn a_move_and_a_stop_begin_where_the_joint_is_that_a_torque_has_driven() {
    for request in [Request::Move(move_to(0.5)), Request::Stop(StopCategory::Two)] {
        let mut rig = torque_axis();
        lead(&mut rig, run(1), |_, _, targets| {
            targets[0] = Some(AxisTarget::Torque(4.0));
            COMMANDED
        });
        rig.run(300);
        rig.request(request);
        let axis = rig.host.snapshot.axes[0];
        assert!((axis.position_set - axis.position).abs() < 0.02, "{axis:?}");
        rig.run_until(Phase::Holding, 5_000);
        assert!(rig.stops().iter().all(StopReason::is_requested), "{:?}", rig.stops());
        rig.run(500);
        assert!(rig.host.snapshot.axes[0].following_error.abs() < 0.01);
    }
}

#[test]
fn a_torque_in_a_mode_without_one_is_a_stop() {
    let mut rig = holding(JERK);
    lead(&mut rig, run(1), |_, _, targets| {
        targets[1] = Some(AxisTarget::Torque(1.0));
        COMMANDED
    });
    rig.run(2);
    let (fault, category) = the_only_stop(&rig);
    assert_eq!((fault.rule(), category), (Rule::NoTorqueInMode, StopCategory::Two));
    assert_eq!(rig.stops()[0].origin, Origin::Axis(1));
}

/// What a callback may do in a call.
#[derive(Clone, Copy, Debug)]
enum Deed {
    Command(State),
    Velocity(f64),
    Torque(f64),
    Nothing,
    Late,
}

fn deeds() -> impl Strategy<Value = Vec<(Deed, usize)>> {
    let numbers = prop_oneof![-4.0f64..4.0, -1e3f64..1e3, Just(f64::NAN), Just(f64::INFINITY), Just(1e300)];
    let likely = -2.5f64..2.5;
    let state = (prop_oneof![9 => likely, 1 => numbers], -3.0f64..3.0, -20.0f64..20.0);
    let commanded = state.prop_map(|(position, velocity, acceleration)| {
        Deed::Command(State { position, velocity, acceleration })
    });
    let deed = prop_oneof![
        8 => commanded,
        2 => prop_oneof![-2.5f64..2.5, -1e3f64..1e3, Just(f64::NAN)].prop_map(Deed::Velocity),
        1 => (-50.0f64..50.0).prop_map(Deed::Torque),
        2 => Just(Deed::Nothing),
        1 => Just(Deed::Late),
    ];
    prop::collection::vec((deed, 1usize..150), 1..20)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn whatever_a_callback_commands_no_limit_is_broken(
        deeds in deeds(),
        jerk in prop_oneof![50.0f64..1000.0, Just(f64::INFINITY)],
        follow in prop::sample::select(&[Follow::Smooth, Follow::Exact][..]),
    ) {
        let mut rig = holding(jerk);
        let mut script = deeds.into_iter().flat_map(|(deed, times)| std::iter::repeat_n(deed, times));
        let cycles = script.size_hint().0.max(500);
        let mut target = State::rest(0.0);
        lead(&mut rig, CallbackRun { follow: Some(follow), overruns_allowed: 10, ..run(1) }, move |_, _, targets| {
            match script.next() {
                None => return FINISHED,
                Some(Deed::Nothing) => {}
                Some(Deed::Torque(torque)) => targets[0] = Some(AxisTarget::Torque(torque)),
                Some(Deed::Velocity(velocity)) => {
                    targets[0] = Some(AxisTarget::Velocity { velocity, acceleration: 0.0 });
                }
                Some(Deed::Late) => return CallbackReturn { spent_ns: 2 * BUDGET_NS, ..COMMANDED },
                Some(Deed::Command(state)) => {
                    target = if follow == Follow::Smooth { state } else { target.after(PERIOD_S) };
                    targets[0] = at(target);
                }
            }
            COMMANDED
        });
        rig.run(cycles + 3_000);
        prop_assert!(matches!(rig.phase(), Phase::Holding), "{:?}", rig.phase());
        assert_differences_kept(&rig, if follow == Follow::Smooth { jerk } else { f64::INFINITY });
    }
}
