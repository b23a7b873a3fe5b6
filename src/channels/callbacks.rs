//! Callbacks on their way to the real-time thread, their calls there, and their way back: the loop borrows them, and never frees one.

use std::ops::Index;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use takt_rt::plan::State;
use takt_rt::{
    AxisLimits, AxisSnapshot, AxisTarget, CallbackCycle, CallbackId, CallbackOutcome, CallbackReturn, Clock,
    MAX_AXES, Nanoseconds, PositionSequence,
};

use super::callback_panic::{self, CaughtPanic};
use super::callback_record::CallbackRecord;
use super::lending::{Borrower, LENT_AT_MOST, Lender, lending};
use crate::monotonic_clock::MonotonicClock;

/// A function that leads a group from inside the real-time thread.
pub type LoopCallback = dyn FnMut(&CallbackState<'_>, &CallbackCycle, &mut CallbackCommand<'_>) + Send;

/// What a callback sees of the axes of its group, in the order of the group: what the drives have reported in this very cycle, and how
/// old it is where they have not. `state[0]` is the first axis.
pub struct CallbackState<'a> {
    axes: &'a [AxisSnapshot; MAX_AXES],
    numbers: &'a [usize],
}

impl CallbackState<'_> {
    /// The axes of the group, in order.
    pub fn axes(&self) -> impl ExactSizeIterator<Item = &AxisSnapshot> {
        self.numbers.iter().map(|number| &self.axes[*number])
    }
}

impl Index<usize> for CallbackState<'_> {
    type Output = AxisSnapshot;

    /// # Panics
    /// If the group has no such axis. A callback that panics is a stop.
    fn index(&self, axis: usize) -> &AxisSnapshot {
        &self.axes[number_of(self.numbers, axis)]
    }
}

/// Takes what a callback wants of the axes of its group at the end of the slot. They are counted as in [`CallbackState`]. An axis of which
/// nothing is wanted comes to rest within its limits, and holds. The last wish of a call counts.
///
/// Every method panics if the group has no such axis. A callback that panics is a stop.
pub struct CallbackCommand<'a> {
    targets: &'a mut [Option<AxisTarget>; MAX_AXES],
    numbers: &'a [usize],
    positions: &'a mut [Option<f64>],
    is_finished: bool,
}

impl CallbackCommand<'_> {
    /// To be at a position (rad or m). Its velocity and acceleration are those that the positions of the last calls show; a position that
    /// is farther away than the limits allow is one to rest at.
    pub fn position(&mut self, axis: usize, position: f64) {
        self.set(axis, None, Some(position));
    }

    /// To move at a velocity (rad/s or m/s), within the limits, those of the position included.
    pub fn velocity(&mut self, axis: usize, velocity: f64) {
        self.target(axis, AxisTarget::Velocity { velocity, acceleration: 0.0 });
    }

    /// To be driven by a torque (N·m or N), without any loop. Only an axis in cyclic synchronous torque can be. Its velocity and its
    /// position limits are still guarded.
    pub fn torque(&mut self, axis: usize, torque: f64) {
        self.target(axis, AxisTarget::Torque(torque));
    }

    /// To be held by a spring and a damper at a position (rad or m), with a torque that is fed forward (N·m or N): stiffness in N·m/rad,
    /// damping in N·m·s/rad (N/m, N·s/m). Only an axis in cyclic synchronous torque can be, with gains up to those of its configuration. The
    /// position is led to within the limits.
    pub fn impedance(&mut self, axis: usize, position: f64, stiffness: f64, damping: f64, torque: f64) {
        self.target(axis, AxisTarget::Impedance { state: State::rest(position), stiffness, damping, torque });
    }

    /// Anything that an axis can be asked for: a position with a velocity, an acceleration, and a torque that is fed forward; and the
    /// like.
    pub fn target(&mut self, axis: usize, target: impl Into<AxisTarget>) {
        self.set(axis, Some(target.into()), None);
    }

    /// To come to rest and hold.
    pub fn hold(&mut self, axis: usize) {
        self.set(axis, None, None);
    }

    /// The callback is over: the axes come to rest and hold, and it is not called again. Nothing else that is wanted in this call counts.
    pub fn finish(&mut self) {
        self.is_finished = true;
    }

    fn set(&mut self, axis: usize, target: Option<AxisTarget>, position: Option<f64>) {
        self.targets[number_of(self.numbers, axis)] = target;
        self.positions[axis] = position;
    }
}

/// The number of an axis of a group among those of the controller.
fn number_of(numbers: &[usize], axis: usize) -> usize {
    let axes = numbers.len();
    numbers.get(axis).copied().unwrap_or_else(|| panic!("the group has no axis {axis}: it has {axes}"))
}

/// A callback for a group.
pub struct GivenCallback {
    group: u8,
    /// The numbers of the axes of the group, each below [`MAX_AXES`].
    numbers: Vec<usize>,
    limits: Vec<AxisLimits>,
    /// What was commanded by a position alone in this call.
    positions: Vec<Option<f64>>,
    /// The positions until now, where the last call has commanded one.
    sequences: Vec<Option<PositionSequence>>,
    body: Box<LoopCallback>,
    record: Arc<CallbackRecord>,
    panic: Option<CaughtPanic>,
}

impl GivenCallback {
    /// A callback for a group of axes with these numbers and limits.
    pub fn new(group: u8, axes: &[(usize, AxisLimits)], body: Box<LoopCallback>) -> Self {
        let (numbers, limits): (Vec<_>, Vec<_>) =
            axes.iter().copied().filter(|(number, _)| *number < MAX_AXES).unzip();
        Self {
            group,
            positions: vec![None; numbers.len()],
            sequences: vec![None; numbers.len()],
            numbers,
            limits,
            body,
            record: Arc::default(),
            panic: None,
        }
    }

    /// The group.
    pub fn group(&self) -> u8 {
        self.group
    }

    /// Where its calls are counted and measured.
    pub fn record(&self) -> Arc<CallbackRecord> {
        Arc::clone(&self.record)
    }

    /// Calls it once. What it panics with is kept, to be freed elsewhere.
    fn call(
        &mut self,
        cycle: &CallbackCycle,
        axes: &[AxisSnapshot; MAX_AXES],
        targets: &mut [Option<AxisTarget>; MAX_AXES],
    ) -> CallbackOutcome {
        self.positions.fill(None);
        let Self { numbers, positions, body, .. } = self;
        let state = CallbackState { axes, numbers };
        let mut command = CallbackCommand { targets, numbers, positions, is_finished: false };
        if let Err(panic) = callback_panic::catch(|| body(&state, cycle, &mut command)) {
            self.panic = Some(panic);
            return CallbackOutcome::Panicked;
        }
        if command.is_finished {
            return CallbackOutcome::Finished;
        }
        self.put_positions(cycle.period_s, axes, targets);
        CallbackOutcome::Commanded
    }

    /// Makes targets of the positions.
    fn put_positions(
        &mut self,
        period_s: f64,
        axes: &[AxisSnapshot; MAX_AXES],
        targets: &mut [Option<AxisTarget>; MAX_AXES],
    ) {
        let own = self.numbers.iter().zip(&self.limits).zip(&self.positions).zip(&mut self.sequences);
        for (((number, limits), position), sequence) in own {
            let Some(position) = *position else {
                *sequence = None;
                continue;
            };
            let sequence =
                sequence.get_or_insert_with(|| PositionSequence::at_rest(axes[*number].position_set));
            targets[*number] = Some(sequence.next(position, limits, period_s).into());
        }
    }
}

impl Drop for GivenCallback {
    /// Comes back from the real-time thread, or was not taken: keeps what it panicked with, for people.
    fn drop(&mut self) {
        let message = self.panic.take().map(|panic| panic.message());
        self.record.end(message);
    }
}

/// How long calls take.
#[derive(Clone, Copy, Debug)]
pub enum CallbackClock {
    /// By the clock of the loop.
    Monotonic(MonotonicClock),
    /// In virtual time, always so long.
    Virtual(Nanoseconds),
}

/// The two ends of the way there and back.
pub(super) fn callbacks() -> (CallbackGiver, CallbackTaker) {
    let (lender, borrower) = lending(LENT_AT_MOST);
    let clock = CallbackClock::Monotonic(MonotonicClock::default());
    (CallbackGiver(lender), CallbackTaker { borrower, clock })
}

/// The end that gives callbacks, and frees those that come back. Clone it for every thread.
#[derive(Clone)]
pub struct CallbackGiver(Lender<GivenCallback>);

impl CallbackGiver {
    /// Gives a callback, and returns its number. `None` if too many are with the real-time thread.
    pub fn give(&self, given: GivenCallback) -> Option<CallbackId> {
        self.release();
        callback_panic::keep_hooks_away();
        self.0.lend(Box::new(given)).ok().map(CallbackId)
    }

    /// Frees a callback that the real-time thread will not ask for: its request was not submitted, or was discarded.
    pub fn take_back(&self, CallbackId(id): CallbackId) {
        self.0.take_back(id).into_iter().for_each(free);
    }

    /// Frees what has come back.
    pub fn release(&self) {
        self.0.collect(free);
    }
}

/// Frees a callback in this thread, which does not end by a panic of what the callback owns.
fn free(given: Box<GivenCallback>) {
    let _ = catch_unwind(AssertUnwindSafe(|| drop(given)));
}

/// The end of the real-time thread.
pub(super) struct CallbackTaker {
    borrower: Borrower<GivenCallback>,
    clock: CallbackClock,
}

impl CallbackTaker {
    /// From now on calls are measured so.
    pub(super) fn measure_by(&mut self, clock: CallbackClock) {
        self.clock = clock;
    }

    /// See [`takt_rt::HostInterface::take_callback`].
    pub(super) fn take(&mut self, group: u8, CallbackId(id): CallbackId) -> bool {
        self.borrower.borrow(id).is_some_and(|given| given.group == group)
    }

    /// See [`takt_rt::HostInterface::callback`].
    pub(super) fn call(
        &mut self,
        group: u8,
        CallbackId(id): CallbackId,
        cycle: &CallbackCycle,
        axes: &[AxisSnapshot; MAX_AXES],
        targets: &mut [Option<AxisTarget>; MAX_AXES],
    ) -> CallbackReturn {
        let Some(given) = self.borrower.borrow(id).filter(|given| given.group == group) else {
            return CallbackReturn::default();
        };
        let begun_ns = self.clock.now_ns(cycle.now_ns);
        let outcome = given.call(&cycle.beginning_at(begun_ns), axes, targets);
        let spent_ns = match &mut self.clock {
            CallbackClock::Monotonic(clock) => clock.now_ns().saturating_sub(begun_ns),
            CallbackClock::Virtual(spent_ns) => *spent_ns,
        };
        given.record.count(cycle, spent_ns);
        CallbackReturn { outcome, spent_ns }
    }

    /// See [`takt_rt::HostInterface::keep_callback`].
    pub(super) fn keep(&mut self, group: u8, needed: Option<CallbackId>) {
        self.borrower.keep(|id, given| given.group != group || needed == Some(CallbackId(id)));
    }
}

impl CallbackClock {
    fn now_ns(&mut self, cycle_ns: Nanoseconds) -> Nanoseconds {
        match self {
            Self::Monotonic(clock) => clock.now_ns(),
            Self::Virtual(_) => cycle_ns,
        }
    }
}
