//! The life of a controller: its end, its time, stops, and the power of its drives.

use std::ffi::c_char;
use std::sync::PoisonError;

use takt::{CommandError, Outcome, Phase, StopCategory};

use crate::border;
use crate::errors::{self, Failure, takt_result};
use crate::handles::{self, Entry, takt_handle};
use crate::posix;
use crate::scope::{Owner, Scope};
use crate::state::{put_state, takt_phase, takt_state};

/// How a stop is made (IEC 60204-1, 9.2.2). It is not safety-rated: for that the drives have STO, in hardware.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum takt_stop_category {
    /// Category 0: the power is removed from the drives at once, and the brakes engage.
    TAKT_STOP_POWER_OFF = 0,
    /// Category 1: decelerate within the limits, then remove the power.
    TAKT_STOP_THEN_POWER_OFF = 1,
    /// Category 2: decelerate within the limits, and hold.
    TAKT_STOP_AND_HOLD = 2,
}

/// The version of the library: "0.1.0". Any thread; does not block.
#[unsafe(no_mangle)]
pub extern "C" fn takt_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// Closes a handle. That of takt_open() ends the run with it: the axes come to rest, the drives are disabled and shut down. That of
/// takt_connect() ends nothing: the controller goes on in its process, and what moves goes on. Calls that
/// other threads are in return TAKT_ERROR_ENDED. Handles of its groups, events and callbacks stay open, to be closed as well.
///
/// Any thread, not in a callback; blocks until the drives are shut down and the calls of other threads with this handle have returned.
///
/// Errors: TAKT_ERROR_HANDLE; TAKT_ERROR_STOPPED when the run has not ended as it should, with the reason in the text. The handle is
/// closed then, too.
#[unsafe(no_mangle)]
pub extern "C" fn takt_close(handle: takt_handle) -> takt_result {
    border::carry_out(|| {
        let end = |entry: &Entry| match entry {
            Entry::Scope(scope) => end_of(scope),
            _ => Ok(()),
        };
        handles::close(handle.number, |entry| matches!(entry, Entry::Scope(_)), end)?
    })
}

fn end_of(scope: &Scope) -> Result<(), Failure> {
    let owned = scope.owner.lock().unwrap_or_else(PoisonError::into_inner).take();
    let Some(owner) = owned else { return Ok(()) };
    let failed = |words: String| Err(Failure::new(takt_result::TAKT_ERROR_STOPPED, words));
    let outcome = match owner {
        Owner::Real(controller) => controller.finish().map(|session| session.outcome),
        Owner::Virtual(controller) => Ok(controller.finish()),
    };
    match outcome {
        Ok(Outcome::Finished) => Ok(()),
        Ok(outcome) => failed(outcome.words(scope.controller.machine())),
        Err(error) => failed(error.to_string()),
    }
}

/// The present time of the controller in ns: CLOCK_MONOTONIC, or virtual time. The stamps of points are on this clock. 0 for a handle
/// that is null, closed or of another kind. Any thread, also in a callback and in a signal handler; does not block.
#[unsafe(no_mangle)]
pub extern "C" fn takt_now_ns(handle: takt_handle) -> u64 {
    let mut now_ns = 0;
    border::enter_without_words(|| {
        now_ns = handle.scope().map_or(0, |scope| scope.controller.now_ns());
        takt_result::TAKT_OK
    });
    now_ns
}

/// Stops the axes of the handle: `category` is a takt_stop_category. It is taken in the next cycle, and is never refused. What waits to
/// be carried out is discarded, so that nothing begins after the stop. takt_wait_phase() waits until the axes are at rest.
///
/// Any thread, also in a callback and in a signal handler: it is a few atomic operations, allocates nothing, takes no lock and does not
/// block. It leaves the last error as it is. Of a controller of another process it is two or three system calls that do not wait, and
/// needs no lease.
///
/// Errors: TAKT_ERROR_HANDLE, TAKT_ERROR_ENDED, TAKT_ERROR_ARGUMENT for another category; of another process TAKT_ERROR_LEASE without write
/// permission, and TAKT_ERROR_TIMEOUT if it has taken none of many stops.
#[unsafe(no_mangle)]
pub extern "C" fn takt_stop(handle: takt_handle, category: i32) -> takt_result {
    border::enter_without_words(|| {
        let category = match category {
            0 => StopCategory::Zero,
            1 => StopCategory::One,
            2 => StopCategory::Two,
            _ => return takt_result::TAKT_ERROR_ARGUMENT,
        };
        let scope = match handle.scope() {
            Ok(scope) => scope,
            Err(why) => return why.result(),
        };
        let stopped = scope.controller.stop(category);
        stopped.map_or_else(|error| errors::result_of(&error), |()| takt_result::TAKT_OK)
    })
}

/// Begins to bring the axes to rest and to disable their drives. takt_wait_phase() with TAKT_PHASE_DISABLED waits until they are. The
/// brakes engage.
///
/// Any thread; blocks for a cycle or two, until the real-time thread has granted it.
///
/// Errors: TAKT_ERROR_REFUSED, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE.
#[unsafe(no_mangle)]
pub extern "C" fn takt_disable(handle: takt_handle) -> takt_result {
    command(handle, |scope| scope.controller.disable())
}

/// Begins to enable the drives again: after takt_disable(), or after a fault and takt_clear_faults(). takt_wait_phase() with
/// TAKT_PHASE_HOLDING waits until they are.
///
/// Any thread; blocks for a cycle or two, until the real-time thread has granted it.
///
/// Errors: TAKT_ERROR_REFUSED unless the axes are disabled and no fault is left, TAKT_ERROR_FULL, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE.
#[unsafe(no_mangle)]
pub extern "C" fn takt_enable(handle: takt_handle) -> takt_result {
    command(handle, |scope| scope.controller.enable())
}

/// Clears the faults that have stopped the axes. Look at the machine first: takt does not know whether the cause is gone.
///
/// Any thread; blocks for a cycle or two, until the real-time thread has granted it.
///
/// Errors: TAKT_ERROR_REFUSED in motion, TAKT_ERROR_FULL, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE.
#[unsafe(no_mangle)]
pub extern "C" fn takt_clear_faults(handle: takt_handle) -> takt_result {
    command(handle, |scope| scope.controller.reset_faults())
}

pub(crate) fn command(
    handle: takt_handle,
    act: impl FnOnce(&Scope) -> Result<(), CommandError>,
) -> takt_result {
    border::carry_out(|| {
        let scope = handle.scope()?;
        act(&scope).map_err(|error| Failure::of_command(&error, &scope))
    })
}

/// Waits for a cycle that is later than `state->slot`, and reads the state after it. If there is one already, it does not wait. So a loop
/// of it sees every cycle as long as it is fast enough; one that was late sees the newest, and goes on. `timeout_s` is from 0 on, or
/// INFINITY. In virtual time it runs the cycle.
///
/// Any thread, not in a callback; blocks for up to `timeout_s`. It wakes some 20 µs after the set-points of the cycle have been sent, plus
/// what the operating system takes to wake a thread.
///
/// Errors: TAKT_ERROR_TIMEOUT, TAKT_ERROR_ENDED, TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
///
/// # Safety
/// `state` is null, or points to a structure of the size that it says.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn takt_wait_cycle(
    handle: takt_handle,
    timeout_s: f64,
    state: *mut takt_state,
) -> takt_result {
    let result = border::carry_out(|| {
        let scope = handle.scope()?;
        let timeout = border::duration(timeout_s, "timeout_s")?;
        border::check_pointer(state, "state")?;
        let reaches_slot = std::mem::offset_of!(takt_state, slot) + size_of::<u64>();
        // SAFETY: the caller promises that the size can be read.
        if (unsafe { (*state).size } as usize) < reaches_slot {
            return Err(Failure::argument("state->size is not set; set it to sizeof *state"));
        }
        // SAFETY: the caller promises that the structure is of the size that it says, and the slot is within it.
        let seen = unsafe { (*state).slot };
        let shown = scope.controller.cycle_after(seen, timeout)?;
        // SAFETY: the caller promises it.
        unsafe { put_state(&scope, &shown, state) }
    });
    posix::cancellation_point();
    result
}

/// Waits until every group of the handle is in a phase: a takt_phase. `timeout_s` is from 0 on, or INFINITY.
///
/// Any thread, not in a callback; blocks for up to `timeout_s`.
///
/// Errors: TAKT_ERROR_TIMEOUT, TAKT_ERROR_ENDED, TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
#[unsafe(no_mangle)]
pub extern "C-unwind" fn takt_wait_phase(handle: takt_handle, phase: i32, timeout_s: f64) -> takt_result {
    let result = border::carry_out(|| {
        let scope = handle.scope()?;
        let timeout = border::duration(timeout_s, "timeout_s")?;
        let wanted = Phase::ALL.into_iter().find(|known| *known as i32 == phase);
        let wanted =
            wanted.ok_or_else(|| Failure::argument(format!("phase is {phase}, which is no takt_phase")))?;
        Ok(scope.controller.wait_for(wanted, timeout)?)
    });
    posix::cancellation_point();
    result
}

/// Lets so many cycles pass, and reads the state after them; `state` may be NULL. In virtual time it runs them, as fast as this machine
/// can; in real time it waits for them.
///
/// Any thread, not in a callback; blocks until they have passed.
///
/// Errors: TAKT_ERROR_ENDED, TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
///
/// # Safety
/// `state` is null, or points to a structure of the size that it says.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn takt_advance(
    handle: takt_handle,
    cycles: u64,
    state: *mut takt_state,
) -> takt_result {
    let result = border::carry_out(|| {
        let scope = handle.scope()?;
        let shown = scope.controller.advance(cycles)?;
        if state.is_null() {
            return Ok(());
        }
        // SAFETY: the caller promises it.
        unsafe { put_state(&scope, &shown, state) }
    });
    posix::cancellation_point();
    result
}

const _: () = assert!(takt_phase::TAKT_PHASE_DISABLING as i32 == Phase::Disabling as i32);
