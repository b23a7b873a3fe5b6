//! Motions: to targets, by distances, in profiles, and changes of the mode; and how they end.

use std::time::Duration;

use takt::{CommandError, MotionId, MoveOptions, OperationMode};

use crate::border::{self, Growing};
use crate::errors::{Failure, takt_result};
use crate::handles::takt_handle;
use crate::posix;
use crate::scope::Scope;

/// A motion that was begun, for takt_wait(). It needs not be closed. A copy of it is as good.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_motion {
    /// Not for you.
    pub number: u64,
}

/// How a move is made. Set `size` to `sizeof(takt_move_options)` and the rest to 0 for what is usual.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_move_options {
    /// `sizeof(takt_move_options)`
    pub size: u32,
    /// 0; for later.
    pub reserved: u32,
    /// Fraction of the velocity limits, up to 1; 0 for 1.
    pub velocity_scale: f64,
    /// Fraction of the acceleration and jerk limits, up to 1; 0 for 1.
    pub acceleration_scale: f64,
    /// The shortest duration of the move: s.
    pub minimum_duration_s: f64,
}

impl Default for takt_move_options {
    fn default() -> Self {
        let size = size_of::<Self>() as u32;
        Self { size, reserved: 0, velocity_scale: 0.0, acceleration_scale: 0.0, minimum_duration_s: 0.0 }
    }
}

// SAFETY: it begins with its size, and has only numbers.
unsafe impl Growing for takt_move_options {
    const FIRST_SIZE: usize = size_of::<Self>();
}

impl From<takt_move_options> for MoveOptions {
    fn from(options: takt_move_options) -> Self {
        let or_all = |scale: f64| if scale == 0.0 { 1.0 } else { scale };
        Self {
            velocity_scale: or_all(options.velocity_scale),
            acceleration_scale: or_all(options.acceleration_scale),
            minimum_duration_s: options.minimum_duration_s,
        }
    }
}

/// Moves the axes to targets, where they come to rest: rad (m), one for each axis of the handle. All of them arrive at the same time, as
/// soon as the limits and `options` allow; `options` may be NULL. A move under way is planned anew from where it is. A drive in profile
/// position plans by itself.
///
/// Any thread, not in a callback; does not wait for the motion. takt_wait() does, and tells of a refusal.
///
/// Errors: TAKT_ERROR_LIMIT for a target beyond the limits of its axis, TAKT_ERROR_ARGUMENT, TAKT_ERROR_FULL, TAKT_ERROR_ENDED,
/// TAKT_ERROR_HANDLE. Nothing has changed then.
///
/// # Safety
/// `targets` points to `axes` numbers; the others are null, or point to what they should.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_move_to(
    handle: takt_handle,
    targets: *const f64,
    axes: usize,
    options: *const takt_move_options,
    motion: *mut takt_motion,
) -> takt_result {
    let act = |scope: &Scope, targets: &[f64], options| scope.controller.move_with(targets, options);
    // SAFETY: the caller promises it.
    unsafe { move_axes(handle, (targets, axes, "targets"), options, motion, act) }
}

/// As takt_move_to(), by distances from the present set-points: of an axis in motion, from where it is to be at this moment.
///
/// # Safety
/// As takt_move_to().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_move_by(
    handle: takt_handle,
    distances: *const f64,
    axes: usize,
    options: *const takt_move_options,
    motion: *mut takt_motion,
) -> takt_result {
    let act = |scope: &Scope, distances: &[f64], options| scope.controller.move_by(distances, options);
    // SAFETY: the caller promises it.
    unsafe { move_axes(handle, (distances, axes, "distances"), options, motion, act) }
}

/// # Safety
/// As takt_move_to().
unsafe fn move_axes(
    handle: takt_handle,
    (numbers, count, name): (*const f64, usize, &str),
    options: *const takt_move_options,
    motion: *mut takt_motion,
    act: impl FnOnce(&Scope, &[f64], MoveOptions) -> Result<MotionId, CommandError>,
) -> takt_result {
    begin(handle, motion, |scope| {
        // SAFETY: the caller promises it.
        let numbers = unsafe { border::array(numbers, count, name) }?;
        // SAFETY: the caller promises it.
        let options: takt_move_options = unsafe { border::take_growing(options, "options") }?;
        Ok(act(scope, numbers, options.into()))
    })
}

/// Gives a drive in profile velocity a velocity: rad/s (m/s). `axis` is counted as in the handle. Unless it is given again within
/// `valid_s`, the group stops: nothing moves on behind a program that hangs.
///
/// Any thread, not in a callback; does not wait for the velocity. takt_wait() does.
///
/// Errors: TAKT_ERROR_MODE, TAKT_ERROR_LIMIT, TAKT_ERROR_ARGUMENT, TAKT_ERROR_FULL, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE.
///
/// # Safety
/// `motion` is null, or may be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_profile_velocity(
    handle: takt_handle,
    axis: u32,
    velocity: f64,
    valid_s: f64,
    motion: *mut takt_motion,
) -> takt_result {
    begin(handle, motion, |scope| {
        let valid_for = valid_for(valid_s)?;
        Ok(scope.axis(axis).and_then(|axis| scope.controller.velocity(axis, velocity, valid_for)))
    })
}

/// Gives a drive in profile torque a torque: N·m (N). As takt_profile_velocity().
///
/// # Safety
/// `motion` is null, or may be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_profile_torque(
    handle: takt_handle,
    axis: u32,
    torque: f64,
    valid_s: f64,
    motion: *mut takt_motion,
) -> takt_result {
    begin(handle, motion, |scope| {
        let valid_for = valid_for(valid_s)?;
        Ok(scope.axis(axis).and_then(|axis| scope.controller.torque(axis, torque, valid_for)))
    })
}

fn valid_for(seconds: f64) -> Result<Duration, Failure> {
    border::duration(seconds, "valid_s")
}

/// Changes the mode of operation of every axis of the handle: object 6060, 1 profile position, 3 profile velocity, 4 profile torque,
/// 8, 9 and 10 cyclic synchronous position, velocity and torque, as far as `modes` of the configuration allow. Many drives must be
/// disabled before. takt_wait() returns when the drives show the mode.
///
/// Any thread, not in a callback; does not wait for the change. takt_wait() does, and tells of a refusal.
///
/// Errors: TAKT_ERROR_ARGUMENT, TAKT_ERROR_FULL, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE.
///
/// # Safety
/// `motion` is null, or may be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_change_mode(
    handle: takt_handle,
    mode: i32,
    motion: *mut takt_motion,
) -> takt_result {
    begin(handle, motion, |scope| {
        let mode = operation_mode(mode)?;
        Ok(scope.controller.change_mode(mode))
    })
}

/// As takt_change_mode(), of one axis, counted as in the handle. The others of its group hold, or stay disabled.
///
/// # Safety
/// `motion` is null, or may be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_change_axis_mode(
    handle: takt_handle,
    axis: u32,
    mode: i32,
    motion: *mut takt_motion,
) -> takt_result {
    begin(handle, motion, |scope| {
        let mode = operation_mode(mode)?;
        Ok(scope.axis(axis).and_then(|axis| scope.controller.change_axis_mode(axis, mode)))
    })
}

fn operation_mode(mode: i32) -> Result<OperationMode, Failure> {
    let known = i8::try_from(mode).ok().and_then(OperationMode::from_number);
    known
        .ok_or_else(|| Failure::argument(format!("mode is {mode}, which is no mode of operation of CiA 402")))
}

/// Waits until a motion has reached its targets and the axes are at rest there, or until a velocity, a torque or a mode is reached. The
/// result is that of this motion, whatever came after it. `timeout_s` is from 0 on, or INFINITY.
///
/// Any thread, not in a callback; blocks for up to `timeout_s`.
///
/// Errors: TAKT_ERROR_TIMEOUT (the motion goes on), TAKT_ERROR_STOPPED, TAKT_ERROR_REFUSED, TAKT_ERROR_LIMIT, TAKT_ERROR_MODE,
/// TAKT_ERROR_REPLACED, TAKT_ERROR_OVERTAKEN, TAKT_ERROR_FORGOTTEN, TAKT_ERROR_ENDED, TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
#[unsafe(no_mangle)]
pub extern "C-unwind" fn takt_wait(handle: takt_handle, motion: takt_motion, timeout_s: f64) -> takt_result {
    let result = border::carry_out(|| {
        let scope = handle.scope()?;
        let timeout = border::duration(timeout_s, "timeout_s")?;
        let result = scope.controller.wait(motion.id()?, timeout);
        result.map_err(|error| Failure::of_motion(&error, &scope.axes))
    });
    posix::cancellation_point();
    result
}

/// How a motion has ended, without waiting: TAKT_UNDER_WAY, TAKT_OK, or an error of takt_wait(). Any thread, not in a callback; does not
/// block.
#[unsafe(no_mangle)]
pub extern "C" fn takt_motion_result(handle: takt_handle, motion: takt_motion) -> takt_result {
    border::enter(|| {
        let scope = handle.scope()?;
        match scope.controller.result_of(motion.id()?) {
            None => Ok(takt_result::TAKT_UNDER_WAY),
            Some(Ok(())) => Ok(takt_result::TAKT_OK),
            Some(Err(error)) => Err(Failure::of_motion(&error, &scope.axes)),
        }
    })
}

/// Begins a motion, and gives it to the caller. `motion` may be null, for a motion that nobody waits for.
pub(crate) fn begin(
    handle: takt_handle,
    motion: *mut takt_motion,
    act: impl FnOnce(&Scope) -> Result<Result<MotionId, CommandError>, Failure>,
) -> takt_result {
    border::carry_out(|| {
        if !motion.is_null() {
            border::check_pointer(motion, "motion")?;
        }
        let scope = handle.scope()?;
        let begun = act(&scope)?;
        let begun = begun.map_err(|error| Failure::of_command(&error, &scope))?;
        if motion.is_null() {
            return Ok(());
        }
        let number = begun.to_number();
        // SAFETY: the callers' callers promise it, and it was looked at.
        unsafe { border::put(motion, takt_motion { number }, "motion") }
    })
}

impl takt_motion {
    pub(crate) fn id(self) -> Result<MotionId, Failure> {
        if self.number == 0 {
            return Err(Failure::argument("the motion is none: no call has begun it"));
        }
        Ok(MotionId::from_number(self.number))
    }
}

impl Scope {
    /// The number of an axis of the handle among those of the controller.
    pub(crate) fn axis(&self, axis: u32) -> Result<usize, CommandError> {
        let own = self.axes.get(axis as usize).copied();
        own.ok_or(CommandError::NoSuchAxis { axis: axis as usize, axes: self.axes.len() })
    }
}
