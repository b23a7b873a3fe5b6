//! How a callback is stopped, and what of it stops the group.

use std::cell::Cell;
use std::rc::Rc;

use super::rig::{
    BUDGET_NS, COMMANDED, JERK, PANICKED, at, followed, holding, lead, run, state_of, the_only_stop,
};
use crate::fixture::{Rig, jerk_limited};
use takt_rt::plan::State;
use takt_rt::{CallbackReturn, CallbackRun, Fault, Follow, MotionState, Phase, Request, Rule, StopCategory};

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
            lead(&mut rig, followed(follow), move |_, _, targets| {
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
            rig.assert_differences_kept(JERK);
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
    rig.assert_differences_kept(JERK);
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
            rig.assert_differences_kept(JERK);
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
