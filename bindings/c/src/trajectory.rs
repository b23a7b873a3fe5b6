//! Trajectories: points with times, waypoints, and the speed along them.

use takt::TrajectoryPoint;

use crate::border::{self, Growing};
use crate::errors::{Failure, takt_result};
use crate::handles::takt_handle;
use crate::motion::{begin, takt_motion};
use crate::scope::Scope;

/// How far a trajectory is. Set `size` to `sizeof(takt_progress)`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_progress {
    /// `sizeof(takt_progress)`
    pub size: u32,
    /// 0; for later.
    pub reserved: u32,
    /// The time on the path: s.
    pub path_s: f64,
    /// The time of its last point: s.
    pub of_s: f64,
    /// Seconds of the path in a second: 1 as it was written, 0 while it is paused.
    pub rate: f64,
}

// SAFETY: it begins with its size, and has only numbers.
unsafe impl Growing for takt_progress {
    const FIRST_SIZE: usize = size_of::<Self>();
}

/// Carries out a trajectory through points with times, as ROS' JointTrajectory has them.
///
/// `times_s` has a time for each of `points` points: seconds after the beginning, each later than the one before. `positions` (rad, m)
/// has `axes` numbers for the first point, then as many for the second, and so on; so have `velocities` (rad/s, m/s) and `accelerations`
/// (rad/s^2, m/s^2), which may be NULL. Without velocities a smooth curve leads through the points and ends at rest; nowhere is it beyond the
/// points on both sides of it. A first point at the time 0 must be where the axes are; otherwise the trajectory goes there first: a way
/// from rest that would swing far back, for the velocity of that point, is TAKT_ERROR_ARGUMENT. All of it is checked before anything moves.
/// While another trajectory is under way, this one takes its place without a step.
///
/// Any thread, not in a callback; blocks until it is computed and granted: some cycles, more for thousands of points. takt_wait() waits
/// for its end.
///
/// Errors: TAKT_ERROR_LIMIT, with the first point, axis and limit in takt_last_error(); TAKT_ERROR_ARGUMENT, TAKT_ERROR_REFUSED in any
/// other motion, TAKT_ERROR_MODE, TAKT_ERROR_FULL, TAKT_ERROR_OVERTAKEN, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE. Nothing has changed then.
///
/// # Safety
/// The arrays are null, or have as many numbers as is said above; `motion` is null, or may be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_execute(
    handle: takt_handle,
    times_s: *const f64,
    positions: *const f64,
    velocities: *const f64,
    accelerations: *const f64,
    points: usize,
    axes: usize,
    motion: *mut takt_motion,
) -> takt_result {
    begin(handle, motion, |scope| {
        check_axes(scope, axes)?;
        let count = values(points, axes)?;
        // SAFETY: the caller promises it.
        let times_s = unsafe { border::array(times_s, points, "times_s") }?;
        // SAFETY: the caller promises it.
        let positions = unsafe { border::array(positions, count, "positions") }?;
        // SAFETY: the caller promises it.
        let velocities = unsafe { optional(velocities, count, "velocities") }?;
        // SAFETY: the caller promises it.
        let accelerations = unsafe { optional(accelerations, count, "accelerations") }?;
        let row = |of: &[f64], point: usize| of.chunks(axes).nth(point).unwrap_or_default().to_vec();
        let point = |(point, time_s): (usize, &f64)| TrajectoryPoint {
            time_s: *time_s,
            positions: row(positions, point),
            velocities: row(velocities, point),
            accelerations: row(accelerations, point),
        };
        let points: Vec<TrajectoryPoint> = times_s.iter().enumerate().map(point).collect();
        Ok(scope.controller.execute(&points))
    })
}

/// Moves the axes through waypoints without stopping, to rest at the last one, in nearly the shortest time that the limits allow.
/// `waypoints` has `axes` positions (rad, m) for the first one, then as many for the second, and so on. The speed along it can be
/// changed as of takt_execute().
///
/// Any thread, not in a callback; blocks until it is computed and granted.
///
/// Errors: as takt_execute().
///
/// # Safety
/// `waypoints` is null, or has `points` times `axes` numbers; `motion` is null, or may be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_move_through(
    handle: takt_handle,
    waypoints: *const f64,
    points: usize,
    axes: usize,
    motion: *mut takt_motion,
) -> takt_result {
    begin(handle, motion, |scope| {
        check_axes(scope, axes)?;
        // SAFETY: the caller promises it.
        let all = unsafe { border::array(waypoints, values(points, axes)?, "waypoints") }?;
        let waypoints: Vec<Vec<f64>> = all.chunks(axes).map(<[f64]>::to_vec).collect();
        Ok(scope.controller.move_through(&waypoints))
    })
}

/// Changes the speed along the path of a trajectory: 1 as it was written, 0.5 half as fast. The path stays the same, and all limits are
/// kept. Of a trajectory that is paused, it is the speed after takt_resume().
///
/// Any thread, not in a callback; blocks until the change begins: some 20 ms.
///
/// Errors: TAKT_ERROR_LIMIT for what the limits do not allow, TAKT_ERROR_NO_TRAJECTORY, TAKT_ERROR_ARGUMENT, TAKT_ERROR_REFUSED,
/// TAKT_ERROR_FULL, TAKT_ERROR_OVERTAKEN, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE. The trajectory goes on as before then.
#[unsafe(no_mangle)]
pub extern "C" fn takt_set_speed(handle: takt_handle, motion: takt_motion, rate: f64) -> takt_result {
    change(handle, |scope| Ok(scope.controller.set_speed(motion.id()?, rate)))
}

/// Brings the axes to rest on the path of a trajectory. As takt_set_speed().
#[unsafe(no_mangle)]
pub extern "C" fn takt_pause(handle: takt_handle, motion: takt_motion) -> takt_result {
    change(handle, |scope| Ok(scope.controller.pause(motion.id()?)))
}

/// Goes on with a trajectory that was paused. As takt_set_speed().
#[unsafe(no_mangle)]
pub extern "C" fn takt_resume(handle: takt_handle, motion: takt_motion) -> takt_result {
    change(handle, |scope| Ok(scope.controller.resume(motion.id()?)))
}

/// How far a trajectory under way is.
///
/// Any thread, not in a callback; waits for no more than another command of a trajectory of the same group.
///
/// Errors: TAKT_ERROR_NO_TRAJECTORY, TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
///
/// # Safety
/// `progress` is null, or points to a structure of the size that it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_trajectory_progress(
    handle: takt_handle,
    motion: takt_motion,
    progress: *mut takt_progress,
) -> takt_result {
    border::carry_out(|| {
        let scope = handle.scope()?;
        let shown = scope.controller.trajectory_progress(motion.id()?);
        let shown = shown.and_then(|shown| shown.ok_or(takt::CommandError::NoTrajectory));
        let shown = shown.map_err(|error| Failure::of_command(&error, &scope))?;
        let shown = takt_progress {
            size: size_of::<takt_progress>() as u32,
            reserved: 0,
            path_s: shown.path_s,
            of_s: shown.of_s,
            rate: shown.rate,
        };
        // SAFETY: the caller promises it.
        unsafe { border::put_growing(progress, &shown, "progress") }
    })
}

fn change(
    handle: takt_handle,
    act: impl FnOnce(&Scope) -> Result<Result<(), takt::CommandError>, Failure>,
) -> takt_result {
    border::carry_out(|| {
        let scope = handle.scope()?;
        act(&scope)?.map_err(|error| Failure::of_command(&error, &scope))
    })
}

pub(crate) fn check_axes(scope: &Scope, axes: usize) -> Result<(), Failure> {
    let own = scope.axes.len();
    if axes == own {
        return Ok(());
    }
    Err(Failure::argument(format!("axes is {axes}, and the handle has {own}")))
}

pub(crate) fn values(points: usize, axes: usize) -> Result<usize, Failure> {
    points.checked_mul(axes).ok_or_else(|| Failure::argument(format!("there cannot be {points} points")))
}

/// # Safety
/// As [`border::array`].
unsafe fn optional<'a>(pointer: *const f64, length: usize, name: &str) -> Result<&'a [f64], Failure> {
    if pointer.is_null() {
        return Ok(&[]);
    }
    // SAFETY: the caller promises it.
    unsafe { border::array(pointer, length, name) }
}
