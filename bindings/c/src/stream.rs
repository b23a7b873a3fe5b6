//! Streams: points stamped with the time that they are meant for.

use std::time::Duration;

use takt::AxisPoint;
use takt::rt::{MAX_AXES, PositionPoint};

use crate::border;
use crate::errors::{Failure, takt_result};
use crate::handles::takt_handle;
use crate::scope::Scope;
use crate::trajectory::{check_axes, values};

/// What is wanted of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum takt_target_kind {
    /// To come to rest and hold: for callbacks alone.
    TAKT_HOLD = 0,
    /// To be at `position`. `torque` is fed forward.
    TAKT_POSITION = 1,
    /// To move at `velocity`.
    TAKT_VELOCITY = 2,
    /// To be driven by `torque`: an axis in cyclic synchronous torque.
    TAKT_TORQUE = 3,
    /// To be held at `position` by a spring of `stiffness` and a damper of `damping`, with `torque` fed forward: an axis in cyclic
    /// synchronous torque.
    TAKT_IMPEDANCE = 4,
}

/// In `flags` of a target: `velocity` is that of the position. Without it, it is taken from the points beside.
pub const TAKT_HAS_VELOCITY: u32 = 1;
/// In `flags` of a target: `acceleration` is that of the position. Without it, it is taken from the points beside.
pub const TAKT_HAS_ACCELERATION: u32 = 2;

/// What is wanted of an axis, in a point of a stream or by a callback. What its kind does not name is ignored.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_target {
    /// A takt_target_kind.
    pub kind: i32,
    /// TAKT_HAS_VELOCITY, TAKT_HAS_ACCELERATION
    pub flags: u32,
    /// rad (m)
    pub position: f64,
    /// rad/s (m/s)
    pub velocity: f64,
    /// rad/s^2 (m/s^2)
    pub acceleration: f64,
    /// N·m (N)
    pub torque: f64,
    /// kp: N·m/rad (N/m), within stiffness_max of the axis.
    pub stiffness: f64,
    /// kd: N·m·s/rad (N·s/m), within damping_max of the axis.
    pub damping: f64,
}

impl takt_target {
    pub(crate) const HOLD: Self = Self {
        kind: 0,
        flags: 0,
        position: 0.0,
        velocity: 0.0,
        acceleration: 0.0,
        torque: 0.0,
        stiffness: 0.0,
        damping: 0.0,
    };

    /// As a point; `None` for one that holds, `Err` for what is none.
    pub(crate) fn point(&self) -> Result<Option<AxisPoint>, i32> {
        let given = |flag: u32, value: f64| (self.flags & flag != 0).then_some(value);
        let motion = PositionPoint {
            position: self.position,
            velocity: given(TAKT_HAS_VELOCITY, self.velocity),
            acceleration: given(TAKT_HAS_ACCELERATION, self.acceleration),
        };
        let position = AxisPoint::motion(motion).with_torque(self.torque);
        Ok(Some(match self.kind {
            0 => return Ok(None),
            1 => position,
            2 => AxisPoint::Velocity(self.velocity),
            3 => AxisPoint::Torque(self.torque),
            4 => position.with_impedance(self.stiffness, self.damping),
            other => return Err(other),
        }))
    }
}

/// The groups of the handle begin to follow the points that are pushed. The first one must come within the enable time-out of the
/// configuration. The axes are led to it within their limits. A stream begins empty: points are taken from now on, until a stop or a fault
/// ends it. Those that still wait then are discarded, and counted as lost.
///
/// Any thread, not in a callback; blocks for a cycle or two, until the real-time thread has granted it. takt_stop() ends it.
///
/// Errors: TAKT_ERROR_REFUSED unless the axes hold, TAKT_ERROR_FULL, TAKT_ERROR_OVERTAKEN, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE.
#[unsafe(no_mangle)]
pub extern "C" fn takt_begin_stream(handle: takt_handle) -> takt_result {
    border::carry_out(|| {
        let scope = handle.scope()?;
        let begun = scope.controller.begin_stream();
        begun.map_err(|error| Failure::of_command(&error, &scope))
    })
}

/// Pushes a point that is meant for now: a target for each axis of the handle. It is stamped with takt_now_ns(). Points may come at any
/// rate, evenly or not: takt follows them within all limits, a little behind (`stream_lag_ns`), and comes to rest when they run out.
///
/// Any thread, not in a callback; allocates nothing, and waits for no more than another thread that pushes points to the same group. To a
/// controller of another process it sends a packet, and waits for the answer.
///
/// Errors: TAKT_ERROR_LIMIT (a torque or a gain beyond that of its axis; positions and velocities are led to within the limits),
/// TAKT_ERROR_MODE, TAKT_ERROR_ARGUMENT, TAKT_ERROR_REFUSED before takt_begin_stream() and after a stop, TAKT_ERROR_FULL, TAKT_ERROR_ENDED,
/// TAKT_ERROR_HANDLE. The point is not taken then.
///
/// # Safety
/// `targets` is null, or points to `axes` targets.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_push_now(
    handle: takt_handle,
    targets: *const takt_target,
    axes: usize,
) -> takt_result {
    border::carry_out(|| {
        let scope = handle.scope()?;
        // SAFETY: the caller promises it.
        let targets = unsafe { border::array(targets, axes, "targets") }?;
        let mut room = [AxisPoint::default(); MAX_AXES];
        push(&scope, scope.controller.now_ns(), point(targets, &mut room)?)
    })
}

/// Pushes a point that is meant for `at_ns` on the clock of takt_now_ns(): sooner or later than now, and in any order. One with the stamp
/// of another one takes its place. As takt_push_now().
///
/// # Safety
/// `targets` is null, or points to `axes` targets.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_push_at(
    handle: takt_handle,
    at_ns: u64,
    targets: *const takt_target,
    axes: usize,
) -> takt_result {
    border::carry_out(|| {
        let scope = handle.scope()?;
        // SAFETY: the caller promises it.
        let targets = unsafe { border::array(targets, axes, "targets") }?;
        let mut room = [AxisPoint::default(); MAX_AXES];
        push(&scope, at_ns, point(targets, &mut room)?)
    })
}

/// Pushes a chunk, as a policy gives it: `points` points at equal intervals, the first of which is meant for `from_ns`. `targets` has
/// `axes` targets for the first point, then as many for the second, and so on. It takes the place of every earlier point from there on.
/// All of it is taken, or nothing. As takt_push_now().
///
/// # Safety
/// `targets` is null, or points to `points` times `axes` targets.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_push_chunk(
    handle: takt_handle,
    from_ns: u64,
    interval_ns: u64,
    targets: *const takt_target,
    points: usize,
    axes: usize,
) -> takt_result {
    border::carry_out(|| {
        let scope = handle.scope()?;
        check_axes(&scope, axes)?;
        // SAFETY: the caller promises it.
        let targets = unsafe { border::array(targets, values(points, axes)?, "targets") }?;
        let entry = |(index, target): (usize, &takt_target)| entry(target, index / axes, index % axes);
        let entries = targets.iter().enumerate().map(entry).collect::<Result<Vec<AxisPoint>, _>>()?;
        push_chunk(&scope, from_ns, interval_ns, &entries)
    })
}

/// As takt_push_now(), of positions alone: rad (m).
///
/// # Safety
/// `positions` is null, or points to `axes` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_push_positions(
    handle: takt_handle,
    positions: *const f64,
    axes: usize,
) -> takt_result {
    border::carry_out(|| {
        let scope = handle.scope()?;
        // SAFETY: the caller promises it.
        let positions = unsafe { border::array(positions, axes, "positions") }?;
        let mut room = [AxisPoint::default(); MAX_AXES];
        push(&scope, scope.controller.now_ns(), positions_point(positions, &mut room)?)
    })
}

/// As takt_push_at(), of positions alone: rad (m).
///
/// # Safety
/// `positions` is null, or points to `axes` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_push_positions_at(
    handle: takt_handle,
    at_ns: u64,
    positions: *const f64,
    axes: usize,
) -> takt_result {
    border::carry_out(|| {
        let scope = handle.scope()?;
        // SAFETY: the caller promises it.
        let positions = unsafe { border::array(positions, axes, "positions") }?;
        let mut room = [AxisPoint::default(); MAX_AXES];
        push(&scope, at_ns, positions_point(positions, &mut room)?)
    })
}

/// As takt_push_chunk(), of positions alone: rad (m).
///
/// # Safety
/// `positions` is null, or points to `points` times `axes` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_push_positions_chunk(
    handle: takt_handle,
    from_ns: u64,
    interval_ns: u64,
    positions: *const f64,
    points: usize,
    axes: usize,
) -> takt_result {
    border::carry_out(|| {
        let scope = handle.scope()?;
        check_axes(&scope, axes)?;
        // SAFETY: the caller promises it.
        let positions = unsafe { border::array(positions, values(points, axes)?, "positions") }?;
        let entries: Vec<AxisPoint> = positions.iter().map(|position| (*position).into()).collect();
        push_chunk(&scope, from_ns, interval_ns, &entries)
    })
}

fn push(scope: &Scope, at_ns: u64, entries: &[AxisPoint]) -> Result<(), Failure> {
    let pushed = scope.controller.stream().push(at_ns, entries);
    pushed.map_err(|error| Failure::of_stream(error, scope))
}

fn push_chunk(scope: &Scope, from_ns: u64, interval_ns: u64, entries: &[AxisPoint]) -> Result<(), Failure> {
    let rows: Vec<Vec<AxisPoint>> = entries.chunks(scope.axes.len().max(1)).map(<[_]>::to_vec).collect();
    let interval = Duration::from_nanos(interval_ns);
    let pushed = scope.controller.stream().push_chunk(from_ns, interval, &rows);
    pushed.map_err(|error| Failure::of_stream(error, scope))
}

/// One point. It allocates nothing, so that a real-time thread of the program may push it.
fn point<'a>(
    targets: &[takt_target],
    room: &'a mut [AxisPoint; MAX_AXES],
) -> Result<&'a [AxisPoint], Failure> {
    let room = room_for(targets.len(), room)?;
    for (axis, (to, target)) in room.iter_mut().zip(targets).enumerate() {
        *to = entry(target, 0, axis)?;
    }
    Ok(room)
}

/// The same of positions alone.
fn positions_point<'a>(
    positions: &[f64],
    room: &'a mut [AxisPoint; MAX_AXES],
) -> Result<&'a [AxisPoint], Failure> {
    let room = room_for(positions.len(), room)?;
    room.iter_mut().zip(positions).for_each(|(to, position)| *to = (*position).into());
    Ok(room)
}

fn room_for(count: usize, room: &mut [AxisPoint; MAX_AXES]) -> Result<&mut [AxisPoint], Failure> {
    room.get_mut(..count)
        .ok_or_else(|| Failure::argument(format!("a point has {MAX_AXES} targets at most, and not {count}")))
}

fn entry(target: &takt_target, point: usize, axis: usize) -> Result<AxisPoint, Failure> {
    let none = |why: &str| {
        let words = format!("the target of axis {axis} in point {point} is none: {why}");
        Failure::argument(words).at(point, axis)
    };
    match target.point() {
        Ok(Some(entry)) => Ok(entry),
        Ok(None) => Err(none("it has no kind")),
        Err(kind) => Err(none(&format!("its kind is {kind}"))),
    }
}
