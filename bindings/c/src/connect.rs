//! A controller of another process: connecting to it, and who commands it.

use std::ffi::c_char;

use crate::border::{self, Growing};
use crate::errors::takt_result;
use crate::handles::{self, Entry, takt_handle};
use crate::life::command;
use crate::scope::Scope;

/// Who commands a controller that is served to other processes. Set `size` to `sizeof(takt_lease)`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_lease {
    /// `sizeof(takt_lease)`
    pub size: u32,
    /// The process that commands; 0 if no other process does.
    pub process: u32,
    /// When it may be followed by another one, unless it gives another command: ns from now.
    pub expires_in_ns: u64,
}

// SAFETY: it begins with its size, and has only numbers.
unsafe impl Growing for takt_lease {
    const FIRST_SIZE: usize = size_of::<Self>();
}

/// Connects to a controller that another process of this computer serves by a name: `takt run CONFIG --serve NAME`. The handle is taken by
/// every call of this header, with the same meaning and the same errors, but for takt_begin_callback(): a callback is a function of the
/// process of the controller.
///
/// Any number of processes observe; one commands. The first command takes the lease, each command renews it, and it expires 1 s after the
/// last one, or when its process ends. Until then the commands of others are TAKT_ERROR_LEASE; takt_take_over() takes it. takt_stop() needs
/// none. When the process of the controller ends, every call is TAKT_ERROR_ENDED, and takt_read_state() reads the last state.
///
/// Any thread, not in a callback; blocks until the other process answers: up to seconds if that is overloaded. takt_close() ends the
/// connection, and not the controller.
///
/// Errors: TAKT_ERROR_START (none is served by the name, it is of another version, or its permissions do not let this process observe),
/// TAKT_ERROR_ARGUMENT, TAKT_ERROR_FULL.
///
/// # Safety
/// The pointers are null, or point to what they should.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_connect(name: *const c_char, handle: *mut takt_handle) -> takt_result {
    border::carry_out(|| {
        border::check_pointer(handle, "handle")?;
        // SAFETY: the caller promises it.
        let name = unsafe { border::text(name, "name") }?;
        let scope = Scope::all(takt_remote::connect(name)?.into(), None, None);
        let number = handles::open(Entry::Scope(scope))?;
        // SAFETY: the caller promises it.
        unsafe { border::put(handle, takt_handle { number }, "handle") }
    })
}

/// Takes the lease of a controller of another process from whoever has it. What moves goes on. That process gets TAKT_ERROR_LEASE from
/// then on, until it takes it over itself. A controller of this process needs no lease: then it does nothing.
///
/// Any thread, not in a callback; blocks until the other process answers.
///
/// Errors: TAKT_ERROR_LEASE without write permission, TAKT_ERROR_TIMEOUT, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE.
#[unsafe(no_mangle)]
pub extern "C" fn takt_take_over(handle: takt_handle) -> takt_result {
    command(handle, |scope| scope.controller.take_over())
}

/// Gives the lease of a controller of another process back, so that others need not wait for its end. As takt_take_over().
#[unsafe(no_mangle)]
pub extern "C" fn takt_release(handle: takt_handle) -> takt_result {
    command(handle, |scope| scope.controller.release())
}

/// Reads who commands.
///
/// Any thread, not in a callback; does not block.
///
/// Errors: TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
///
/// # Safety
/// `lease` is null, or points to a structure of the size that it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_read_lease(handle: takt_handle, lease: *mut takt_lease) -> takt_result {
    border::carry_out(|| {
        let holder = handle.scope()?.controller.lease();
        let expires_in = holder.map_or(0, |holder| holder.expires_in.as_nanos());
        let shown = takt_lease {
            size: size_of::<takt_lease>() as u32,
            process: holder.map_or(0, |holder| holder.process),
            expires_in_ns: u64::try_from(expires_in).unwrap_or(u64::MAX),
        };
        // SAFETY: the caller promises it.
        unsafe { border::put_growing(lease, &shown, "lease") }
    })
}
