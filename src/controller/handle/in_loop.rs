//! Callbacks: a function of the owner that leads a group from inside the real-time thread.

use std::sync::Arc;
use std::time::Duration;

use takt_rt::{
    AxisLimits, CallbackCycle, CallbackId, CallbackRun, Follow, Nanoseconds, Request, RequestTarget, Rule,
};

use super::{Handle, OwnProcess};
use crate::channels::{CallbackCommand, CallbackRecord, CallbackState, CallbackTimes, GivenCallback};
use crate::command::{CommandError, MotionError, MotionId};

/// A callback that has panicked is back from the real-time thread within this time.
const COMING_BACK: Duration = Duration::from_secs(1);

/// How a callback leads a group.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CallbackOptions {
    /// How long a call may take. `None` is half of the time in which the set-points of a cycle must be ready, shared by all groups: 125 µs
    /// at 1 kHz for a single group.
    pub budget: Option<Duration>,
    /// How many calls in a row may take longer; one more is a stop. Without a real-time kernel the operating system may interrupt a call
    /// for milliseconds: set-points that are not ready then are a missed slot.
    pub overruns_allowed: u32,
    /// What is done with a command beyond the limits: [`Follow::Smooth`] tracks it within them, [`Follow::Exact`] stops the group. `None`
    /// is as each axis is configured.
    pub follow: Option<Follow>,
}

/// A callback that leads a group, or has led it. To drop the handle changes nothing.
#[derive(Clone)]
pub struct CallbackHandle {
    handle: Handle,
    motion: MotionId,
    record: Arc<CallbackRecord>,
}

impl Handle {
    /// Calls a function once in each slot, in the real-time thread, from the next cycle on: it leads the axes. It sees what the drives have
    /// just reported, the time since its last call and the time that it has left, and commands each axis anew; an axis that it does not
    /// command comes to rest and holds. Its commands pass the same guard as every other set-point. Returns when it leads the axes.
    ///
    /// The group must hold its position, or be led by another callback, which this one replaces. It leads until it calls
    /// [`CallbackCommand::finish`], until [`Handle::stop`], or until a move or another callback takes its place.
    ///
    /// # What the function may do
    /// It runs between the feedback and the set-points of a cycle. It must not block, lock, allocate, free, or do input and output. What it
    /// needs it owns, or it reads and writes atomics and lock-free queues. Its memory should be touched before. It is freed in another thread.
    ///
    /// A call that takes longer than its budget stops the group ([`Rule::CallbackOverrun`]), and so does a panic
    /// ([`Rule::CallbackPanicked`]), by the category that the configuration has for the rule; it is not called again. A call that never
    /// returns cannot be stopped by this computer: the drives get neither SYNC nor heartbeats any more, and stop by their own watchdogs.
    ///
    /// # Errors
    /// [`CommandError::Budget`], [`CommandError::Refused`] in any other motion, and see [`CommandError`]; nothing has changed then.
    pub fn in_loop(
        &self,
        callback: impl FnMut(&CallbackState<'_>, &CallbackCycle, &mut CallbackCommand<'_>) + Send + 'static,
    ) -> Result<CallbackHandle, CommandError> {
        self.in_loop_with(CallbackOptions::default(), callback)
    }

    /// The same as [`Handle::in_loop`], with options.
    ///
    /// # Errors
    /// As [`Handle::in_loop`].
    pub fn in_loop_with(
        &self,
        options: CallbackOptions,
        callback: impl FnMut(&CallbackState<'_>, &CallbackCycle, &mut CallbackCommand<'_>) + Send + 'static,
    ) -> Result<CallbackHandle, CommandError> {
        let (own, axes) = (self.backend(), self.axis_numbers());
        let group = match self.target() {
            RequestTarget::All => 0,
            RequestTarget::Group(number) => number,
        };
        let budget_ns = own.budget_ns(options.budget)?;
        let limits = |index: &usize| own.axes.get(*index).map(|axis| (*index, axis.limits));
        let axes: Vec<(usize, AxisLimits)> = axes.iter().filter_map(limits).collect();
        let given = GivenCallback::new(group, &axes, Box::new(callback));
        let record = given.record();
        let giver = &own.callbacks.giver;
        let callback = giver.give(given).ok_or(CommandError::TooManyCallbacks)?;
        let CallbackOptions { overruns_allowed, follow, .. } = options;
        let run = CallbackRun { callback, budget_ns, overruns_allowed, follow };
        match own.begin_callback(own.asked(self.target()), run) {
            Ok(motion) => Ok(CallbackHandle { handle: self.clone(), motion, record }),
            Err(error) => {
                // The real-time thread may not have asked for it, or gives it back.
                own.free_callback(callback);
                Err(error)
            }
        }
    }
}

impl OwnProcess {
    fn begin_callback(&self, target: RequestTarget, run: CallbackRun) -> Result<MotionId, CommandError> {
        let request = self.hand_in(target, Request::RunCallback(run))?;
        self.wait_for_grant(target, request)?;
        Ok(MotionId { request, target })
    }

    fn free_callback(&self, callback: CallbackId) {
        self.callbacks.giver.take_back(callback);
        self.callbacks.giver.release();
    }

    fn budget_ns(&self, budget: Option<Duration>) -> Result<Nanoseconds, CommandError> {
        let longest_ns = self.callbacks.longest_ns;
        let Some(budget) = budget else {
            let groups = self.groups.len().max(1) as u64;
            return Ok(longest_ns / 2 / groups);
        };
        let budget_ns = u64::try_from(budget.as_nanos()).unwrap_or(u64::MAX);
        if budget_ns == 0 || budget_ns > longest_ns {
            return Err(CommandError::Budget { budget, longest: Duration::from_nanos(longest_ns) });
        }
        Ok(budget_ns)
    }
}

impl CallbackHandle {
    /// The motion that it is, for [`Handle::wait`].
    pub const fn motion(&self) -> MotionId {
        self.motion
    }

    /// How often it was called, and how long the calls took.
    pub fn times(&self) -> CallbackTimes {
        self.record.times()
    }

    /// Waits until the callback is over and the axes have come to rest. The function has been freed then.
    ///
    /// # Errors
    /// [`MotionError::CallbackPanicked`], [`MotionError::Stopped`] after a call that took too long and after every other stop,
    /// [`MotionError::Replaced`], and see [`MotionError`].
    pub fn wait(&self, at_most: Duration) -> Result<(), MotionError> {
        let result = self.handle.wait(self.motion, at_most);
        self.handle.backend().callbacks.giver.release();
        result.map_err(|error| self.with_message(error))
    }

    /// How it has ended; `None` while it leads the axes, or they come to rest. Does not wait.
    pub fn result(&self) -> Option<Result<(), MotionError>> {
        let result = self.handle.result_of(self.motion)?;
        Some(result.map_err(|error| self.with_message(error)))
    }

    /// With the message of the panic, once the callback is back.
    fn with_message(&self, error: MotionError) -> MotionError {
        let MotionError::Stopped(stopped) = &error else { return error };
        if stopped.reason.rule() != Rule::CallbackPanicked {
            return error;
        }
        // It comes back with the cycle that stops the group, or just after it.
        let _ = self.handle.wait_until(COMING_BACK, |_| {
            self.handle.backend().callbacks.giver.release();
            self.record.is_over().then_some(())
        });
        match self.record.panic() {
            Some(message) => {
                MotionError::CallbackPanicked { message: message.to_owned(), stopped: stopped.clone() }
            }
            // Another group has panicked, and stops this one too.
            None => error,
        }
    }
}
