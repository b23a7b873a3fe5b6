//! Callbacks: a function of the program that leads axes from inside the real-time thread.

use std::ffi::c_void;

use takt::rt::AxisTarget;
use takt::rt::plan::State;
use takt::{
    AxisPoint, CallbackCommand, CallbackCycle, CallbackHandle, CallbackOptions, CallbackState, Follow,
};

use crate::border::{self, Growing};
use crate::errors::{Failure, takt_result};
use crate::handles::{self, Entry, Unusable, takt_callback, takt_handle};
use crate::posix;
use crate::state::takt_axis_state;
use crate::stream::takt_target;

/// What a callback returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum takt_callback_result {
    /// Go on: the targets are for the end of this slot, and it is called again in the next one. Any other number than these two is a stop
    /// of the group, by the category that the configuration has for the rule "callback_panicked".
    TAKT_GO_ON = 0,
    /// It is over: the axes come to rest and hold, and it is not called again.
    TAKT_FINISHED = 1,
}

/// When a callback is called.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_callback_cycle {
    /// The slot.
    pub slot: u64,
    /// Its start, on the clock of takt_now_ns().
    pub slot_start_ns: u64,
    /// How long this call may take: ns.
    pub time_left_ns: u64,
    /// Slots in which it was not called since the last call.
    pub missed_slots: u64,
    /// The period of the cycle: s.
    pub period_s: f64,
    /// The time from the slot of the last call to this one: s.
    pub dt_s: f64,
}

/// A function that leads the axes of a handle: it is called once in each slot, in the real-time thread, between the feedback and the
/// set-points. `axes` has what the drives have just reported, an entry for each axis of the handle, and `targets` as many entries, with
/// TAKT_HOLD in each, for what is wanted at the end of the slot. They pass the same limits as every other set-point.
///
/// It must not block, lock, allocate, or do input and output, and no C++ exception may leave it. The only functions of this header that it
/// may call are takt_stop() and takt_now_ns(). What it reads and writes of `user` beside the program must be atomic.
pub type takt_callback_function = Option<
    unsafe extern "C" fn(
        user: *mut c_void,
        cycle: *const takt_callback_cycle,
        axes: *const takt_axis_state,
        targets: *mut takt_target,
        axis_count: usize,
    ) -> i32,
>;

/// How a callback leads axes. Set `size` to `sizeof(takt_callback_options)` and the rest to 0 for what is usual.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_callback_options {
    /// `sizeof(takt_callback_options)`
    pub size: u32,
    /// How many calls in a row may take longer than the budget; one more is a stop. Without a real-time kernel the operating system may
    /// interrupt a call for milliseconds.
    pub overruns_allowed: u32,
    /// How long a call may take: ns. 0 for half of the time in which set-points must be ready, shared by all groups: 125 µs at 1 kHz.
    pub budget_ns: u64,
    /// What is done with a target beyond the limits: 0 as the axes are configured, 1 follow as far as they allow, 2 stop.
    pub follow: i32,
    /// 0; for later.
    pub reserved: i32,
}

impl Default for takt_callback_options {
    fn default() -> Self {
        Self { size: size_of::<Self>() as u32, overruns_allowed: 0, budget_ns: 0, follow: 0, reserved: 0 }
    }
}

// SAFETY: it begins with its size, and has only numbers.
unsafe impl Growing for takt_callback_options {
    const FIRST_SIZE: usize = size_of::<Self>();
}

/// How the calls of a callback have gone. Set `size` to `sizeof(takt_callback_times)`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_callback_times {
    /// `sizeof(takt_callback_times)`
    pub size: u32,
    /// 0; for later.
    pub reserved: u32,
    /// How often it was called.
    pub calls: u64,
    /// Slots between its calls in which it was not called.
    pub missed_slots: u64,
    /// Calls that took longer than their budget.
    pub overruns: u64,
    /// How long the last call took: ns.
    pub last_ns: u64,
    /// How long the longest one took: ns.
    pub longest_ns: u64,
}

// SAFETY: it begins with its size, and has only numbers.
unsafe impl Growing for takt_callback_times {
    const FIRST_SIZE: usize = size_of::<Self>();
}

/// A function of the program, with its pointer.
struct Given {
    function: unsafe extern "C" fn(
        *mut c_void,
        *const takt_callback_cycle,
        *const takt_axis_state,
        *mut takt_target,
        usize,
    ) -> i32,
    user: *mut c_void,
    axes: Vec<takt_axis_state>,
    targets: Vec<takt_target>,
}

// SAFETY: takt_begin_callback() says that the function is called in another thread, with this pointer.
unsafe impl Send for Given {}

/// Lets a function lead the axes of the handle, from the next cycle on. They must hold, or be led by another callback, which it replaces.
/// It leads them until it returns TAKT_FINISHED, until a stop, or until a move or another callback takes its place.
///
/// `user` is handed to each call. It must stay valid until takt_wait_callback() has returned anything but TAKT_ERROR_TIMEOUT, or until the
/// controller is closed. A call that takes longer than its budget is a stop. In virtual time the function is called in the thread that
/// waits, or is in takt_advance(). `options` may be NULL.
///
/// Any thread, not in a callback; blocks for a cycle or two, until the real-time thread has granted it. takt_close_callback() closes the
/// handle.
///
/// Errors: TAKT_ERROR_ARGUMENT, TAKT_ERROR_REFUSED in any other motion, TAKT_ERROR_FULL, TAKT_ERROR_OVERTAKEN, TAKT_ERROR_ENDED,
/// TAKT_ERROR_NOT_OWN for a controller of another process, TAKT_ERROR_HANDLE. Nothing has changed then.
///
/// # Safety
/// `function` does what is said of it, and `user` is valid for so long; the others are null, or point to what they should.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_begin_callback(
    handle: takt_handle,
    function: takt_callback_function,
    user: *mut c_void,
    options: *const takt_callback_options,
    callback: *mut takt_callback,
) -> takt_result {
    border::carry_out(|| {
        border::check_pointer(callback, "callback")?;
        let function = function.ok_or_else(|| Failure::argument("function is null"))?;
        // SAFETY: the caller promises it.
        let options: takt_callback_options = unsafe { border::take_growing(options, "options") }?;
        let follow = match options.follow {
            0 => None,
            1 => Some(Follow::Smooth),
            2 => Some(Follow::Exact),
            other => return Err(Failure::argument(format!("options->follow is {other}; it is 0, 1 or 2"))),
        };
        let options = CallbackOptions {
            budget: (options.budget_ns > 0).then(|| std::time::Duration::from_nanos(options.budget_ns)),
            overruns_allowed: options.overruns_allowed,
            follow,
        };
        let scope = handle.scope()?;
        let count = scope.axes.len();
        let (axes, targets) = (vec![takt_axis_state::NONE; count], vec![takt_target::HOLD; count]);
        let mut given = Given { function, user, axes, targets };
        let call =
            move |state: &CallbackState<'_>, cycle: &CallbackCycle, command: &mut CallbackCommand<'_>| {
                given.call(state, cycle, command);
            };
        let own =
            scope.own.as_ref().ok_or_else(|| Failure::not_own("a callback is in the real-time thread"))?;
        let begun = match scope.group_name() {
            Some(group) => own.group(group).and_then(|group| group.in_loop_with(options, call)),
            None => own.in_loop_with(options, call),
        };
        let begun = begun.map_err(|error| Failure::of_command(&error, &scope))?;
        let number = handles::open(Entry::Callback(begun, scope.axes.clone()))?;
        // SAFETY: the caller promises it.
        unsafe { border::put(callback, takt_callback { number }, "callback") }
    })
}

impl Given {
    /// Calls it once, in the real-time thread.
    fn call(&mut self, state: &CallbackState<'_>, cycle: &CallbackCycle, command: &mut CallbackCommand<'_>) {
        self.axes.iter_mut().zip(state.axes()).for_each(|(to, from)| *to = takt_axis_state::of(from));
        self.targets.fill(takt_target::HOLD);
        let shown = takt_callback_cycle {
            slot: cycle.slot,
            slot_start_ns: cycle.slot_start_ns,
            time_left_ns: cycle.time_left_ns,
            missed_slots: cycle.missed_slots,
            period_s: cycle.period_s,
            dt_s: cycle.dt_s,
        };
        let (axes, targets) = (self.axes.as_ptr(), self.targets.as_mut_ptr());
        let call = || {
            // SAFETY: whoever gave the function has promised that it may be called with its pointer; the arrays have as many entries.
            unsafe { (self.function)(self.user, &raw const shown, axes, targets, self.axes.len()) }
        };
        match border::in_callback(call) {
            0 => self.put_targets(command),
            1 => command.finish(),
            other => panic!("the callback has returned {other}"),
        }
    }

    fn put_targets(&self, command: &mut CallbackCommand<'_>) {
        for (axis, target) in self.targets.iter().enumerate() {
            match target.point() {
                Ok(None) => {}
                // By itself: its motion is that of the positions of the last calls.
                Ok(Some(AxisPoint::Position { motion, torque }))
                    if motion.velocity.is_none() && motion.acceleration.is_none() && torque == 0.0 =>
                {
                    command.position(axis, motion.position);
                }
                Ok(Some(point)) => command.target(axis, wanted(&point)),
                Err(kind) => panic!("the callback has given axis {axis} a target of kind {kind}"),
            }
        }
    }
}

/// What a point wants at the end of the slot. What it does not say of a motion is 0.
fn wanted(point: &AxisPoint) -> AxisTarget {
    let state = |motion: &takt::rt::PositionPoint| State {
        position: motion.position,
        velocity: motion.velocity.unwrap_or_default(),
        acceleration: motion.acceleration.unwrap_or_default(),
    };
    match point {
        AxisPoint::Position { motion, torque } => {
            AxisTarget::Position { state: state(motion), torque: *torque }
        }
        AxisPoint::Impedance { motion, stiffness, damping, torque } => AxisTarget::Impedance {
            state: state(motion),
            stiffness: *stiffness,
            damping: *damping,
            torque: *torque,
        },
        AxisPoint::Velocity(velocity) => AxisTarget::Velocity { velocity: *velocity, acceleration: 0.0 },
        AxisPoint::Torque(torque) => AxisTarget::Torque(*torque),
    }
}

fn using(
    callback: takt_callback,
    act: impl FnOnce(&CallbackHandle, &[usize]) -> Result<(), Failure>,
) -> takt_result {
    border::carry_out(|| {
        let used = handles::using(callback.number)?;
        let Entry::Callback(handle, axes) = &*used else { return Err(Unusable::Wrong.into()) };
        act(handle, axes)
    })
}

/// Waits until a callback is over and the axes have come to rest. It is not called any more then, and its `user` is the program's again,
/// unless this returns TAKT_ERROR_TIMEOUT. `timeout_s` is from 0 on, or INFINITY.
///
/// Any thread, not in a callback; blocks for up to `timeout_s`.
///
/// Errors: TAKT_ERROR_TIMEOUT, TAKT_ERROR_STOPPED after a call that took too long or returned another number and after every other stop,
/// TAKT_ERROR_REPLACED, TAKT_ERROR_FORGOTTEN, TAKT_ERROR_ENDED, TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
#[unsafe(no_mangle)]
pub extern "C-unwind" fn takt_wait_callback(callback: takt_callback, timeout_s: f64) -> takt_result {
    let result = using(callback, |handle, axes| {
        let timeout = border::duration(timeout_s, "timeout_s")?;
        handle.wait(timeout).map_err(|error| Failure::of_motion(&error, axes))
    });
    posix::cancellation_point();
    result
}

/// How the calls of a callback have gone until now.
///
/// Any thread, not in a callback; does not block.
///
/// Errors: TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
///
/// # Safety
/// `times` is null, or points to a structure of the size that it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_read_callback_times(
    callback: takt_callback,
    times: *mut takt_callback_times,
) -> takt_result {
    using(callback, |handle, _| {
        let shown = handle.times();
        let in_ns = |time: std::time::Duration| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        let shown = takt_callback_times {
            size: size_of::<takt_callback_times>() as u32,
            reserved: 0,
            calls: shown.calls,
            missed_slots: shown.missed_slots,
            overruns: shown.overruns,
            last_ns: in_ns(shown.last),
            longest_ns: in_ns(shown.longest),
        };
        // SAFETY: the caller promises it.
        unsafe { border::put_growing(times, &shown, "times") }
    })
}

/// Closes the handle of a callback. The callback goes on.
///
/// Any thread, not in a callback; blocks while another thread waits with it.
///
/// Errors: TAKT_ERROR_HANDLE.
#[unsafe(no_mangle)]
pub extern "C" fn takt_close_callback(callback: takt_callback) -> takt_result {
    border::carry_out(|| {
        handles::close(callback.number, |entry| matches!(entry, Entry::Callback(..)), |_| ())
    })
}
