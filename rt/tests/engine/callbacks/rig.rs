//! What the tests of callbacks share: a rig that a function leads.

use crate::fixture::{Rig, TestCallback, jerk_limited};
use takt_rt::plan::State;
use takt_rt::{
    AxisSnapshot, AxisTarget, CallbackCycle, CallbackId, CallbackOutcome, CallbackReturn, CallbackRun, Fault,
    Follow, MAX_AXES, MotionState, Phase, Request, RequestId, StopCategory,
};

pub const JERK: f64 = 100.0;
pub const BUDGET_NS: u64 = 50_000;
pub const COMMANDED: CallbackReturn = CallbackReturn { outcome: CallbackOutcome::Commanded, spent_ns: 1_000 };
pub const FINISHED: CallbackReturn = CallbackReturn { outcome: CallbackOutcome::Finished, spent_ns: 1_000 };
pub const PANICKED: CallbackReturn = CallbackReturn { outcome: CallbackOutcome::Panicked, spent_ns: 1_000 };

pub type Targets = [Option<AxisTarget>; MAX_AXES];

pub const fn run(callback: u64) -> CallbackRun {
    CallbackRun {
        callback: CallbackId(callback),
        budget_ns: BUDGET_NS,
        overruns_allowed: 0,
        follow: Some(Follow::Smooth),
    }
}

/// The same, followed in this way.
pub const fn followed(follow: Follow) -> CallbackRun {
    CallbackRun { follow: Some(follow), ..run(1) }
}

/// Two axes that hold at 0.
pub fn holding(jerk: f64) -> Rig {
    let mut rig = Rig::of(jerk_limited(2, jerk)).enable();
    rig.move_to(0.0);
    rig.run_until(Phase::Holding, 5_000);
    rig.run(10);
    rig.host.records.clear();
    rig.host.events.clear();
    rig
}

pub fn give(
    rig: &mut Rig,
    (group, id): (u8, u64),
    body: impl FnMut(&CallbackCycle, &[AxisSnapshot; MAX_AXES], &mut Targets) -> CallbackReturn + 'static,
) {
    rig.host.callbacks.push(TestCallback { id: CallbackId(id), group, body: Box::new(body) });
}

/// Lets a function lead the only group, under the number 1.
pub fn lead(
    rig: &mut Rig,
    run: CallbackRun,
    body: impl FnMut(&CallbackCycle, &[AxisSnapshot; MAX_AXES], &mut Targets) -> CallbackReturn + 'static,
) -> RequestId {
    give(rig, (0, run.callback.0), body);
    rig.request(Request::RunCallback(run));
    RequestId(rig.host.taken)
}

pub fn at(state: State) -> Option<AxisTarget> {
    Some(state.into())
}

pub fn state_of(rig: &Rig, motion: RequestId) -> MotionState {
    rig.host.snapshot.motions.of(motion).unwrap()
}

pub fn set_point(rig: &Rig) -> State {
    rig.engine.axes()[0].set_point()
}

/// What leads the first axis to a position and rests there.
pub fn leading_to(
    position: f64,
) -> impl FnMut(&CallbackCycle, &[AxisSnapshot; MAX_AXES], &mut Targets) -> CallbackReturn {
    move |_, _, targets| {
        targets[0] = at(State::rest(position));
        COMMANDED
    }
}

/// A motion from rest with a jerk of 48 rad/s³, so many seconds after it has begun.
pub fn ramp(time_s: f64) -> State {
    State { position: 8.0 * time_s.powi(3), velocity: 24.0 * time_s.powi(2), acceleration: 48.0 * time_s }
}

pub fn the_only_stop(rig: &Rig) -> (Fault, StopCategory) {
    let stops = rig.stops();
    assert_eq!(stops.len(), 1, "{stops:?}");
    (stops[0].cause.fault().copied().expect("it is a fault"), stops[0].category)
}
