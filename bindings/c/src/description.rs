//! What a controller consists of: its axes and its groups.

use std::ffi::c_char;

use takt::rt::RequestTarget;
use takt::telemetry::Unit;

use crate::border::{self, Growing, put_text};
use crate::errors::{Failure, takt_result};
use crate::handles::{self, Entry, takt_handle};
use crate::scope::Scope;

/// Room for a name, with the zero at its end.
pub const TAKT_NAME_LENGTH: usize = 64;

/// What the configuration says of an axis. Set `size` to `sizeof(takt_axis)`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_axis {
    /// `sizeof(takt_axis)`
    pub size: u32,
    /// Its number among the axes of the controller, as events and stops count them.
    pub number: u32,
    /// 0 if it turns, rad and N·m; 1 if it moves along a line, m and N.
    pub is_linear: u32,
    /// The CANopen node ID of its drive.
    pub node: u32,
    /// Its group among those of the controller.
    pub group: u32,
    /// Its bus among those of the controller, as `buses` of a state has them.
    pub bus: u32,
    /// Lowest position: rad (m).
    pub position_min: f64,
    /// Highest position: rad (m).
    pub position_max: f64,
    /// Highest speed: rad/s (m/s).
    pub velocity: f64,
    /// Highest acceleration: rad/s^2 (m/s^2).
    pub acceleration: f64,
    /// Highest deceleration: rad/s^2 (m/s^2).
    pub deceleration: f64,
    /// Highest jerk: rad/s^3 (m/s^3); INFINITY where there is no limit.
    pub jerk: f64,
    /// Highest torque: N·m (N).
    pub torque: f64,
    /// Highest stiffness of an impedance: N·m/rad (N/m).
    pub stiffness_max: f64,
    /// Highest damping of an impedance: N·m·s/rad (N·s/m).
    pub damping_max: f64,
    /// Its name. UTF-8.
    pub name: [c_char; TAKT_NAME_LENGTH],
}

// SAFETY: it begins with its size, and has only numbers.
unsafe impl Growing for takt_axis {
    const FIRST_SIZE: usize = size_of::<Self>();
}

/// A group of axes that start, stop and fault together. Set `size` to `sizeof(takt_group)`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_group {
    /// `sizeof(takt_group)`
    pub size: u32,
    /// Its number among the groups of the controller, as events count them.
    pub number: u32,
    /// How many axes it has.
    pub axis_count: u32,
    /// 0; for later.
    pub reserved: u32,
    /// Its name, for takt_open_group(). UTF-8. Empty where the configuration names no groups, and all axes are one.
    pub name: [c_char; TAKT_NAME_LENGTH],
}

// SAFETY: it begins with its size, and has only numbers.
unsafe impl Growing for takt_group {
    const FIRST_SIZE: usize = size_of::<Self>();
}

/// How many axes a handle has; 0 for one that is null, closed or of another kind. Any thread; does not block.
#[unsafe(no_mangle)]
pub extern "C" fn takt_axis_count(handle: takt_handle) -> usize {
    let mut count = 0;
    border::enter_without_words(|| {
        count = handle.scope().map_or(0, |scope| scope.axes.len());
        takt_result::TAKT_OK
    });
    count
}

/// The period of the cycle: ns; 0 for a handle that is null, closed or of another kind. Any thread; does not block.
#[unsafe(no_mangle)]
pub extern "C" fn takt_period_ns(handle: takt_handle) -> u64 {
    let mut period_ns = 0;
    border::enter_without_words(|| {
        period_ns = handle.scope().map_or(0, |scope| scope.controller.period_ns());
        takt_result::TAKT_OK
    });
    period_ns
}

/// What the configuration says of an axis, counted as in the handle.
///
/// Any thread, not in a callback; does not block.
///
/// Errors: TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
///
/// # Safety
/// `described` is null, or points to a structure of the size that it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_describe_axis(
    handle: takt_handle,
    axis: u32,
    described: *mut takt_axis,
) -> takt_result {
    border::carry_out(|| {
        let scope = handle.scope()?;
        let refused = |error| Failure::of_command(&error, &scope);
        let number = scope.axis(axis).map_err(refused)?;
        let named = scope.controller.machine().axes.get(number).ok_or_else(Failure::defect)?;
        let of = scope.controller.axis_properties(number).ok_or_else(Failure::defect)?;
        let bus =
            scope.controller.machine().buses.iter().position(|bus| Some(&bus.name) == named.bus.as_ref());
        let shown = takt_axis {
            size: size_of::<takt_axis>() as u32,
            number: number as u32,
            is_linear: u32::from(named.unit == Unit::Metre),
            node: of.node.into(),
            group: named.group as u32,
            bus: bus.unwrap_or_default() as u32,
            position_min: of.limits.position_min,
            position_max: of.limits.position_max,
            velocity: of.limits.velocity,
            acceleration: of.limits.acceleration,
            deceleration: of.limits.deceleration,
            jerk: of.limits.jerk,
            torque: of.limits.torque,
            stiffness_max: of.stiffness_max,
            damping_max: of.damping_max,
            name: put_text(&named.name),
        };
        // SAFETY: the caller promises it.
        unsafe { border::put_growing(described, &shown, "described") }
    })
}

/// How many groups a handle has: those of the controller, or the one of its own; 0 for one that is null, closed or of another kind. Any
/// thread; does not block.
#[unsafe(no_mangle)]
pub extern "C" fn takt_group_count(handle: takt_handle) -> usize {
    let mut count = 0;
    border::enter_without_words(|| {
        count = handle.scope().map_or(0, |scope| groups_of(&scope).len());
        takt_result::TAKT_OK
    });
    count
}

/// The name and the size of a group, counted as `groups` of a state has them.
///
/// Any thread, not in a callback; does not block.
///
/// Errors: TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
///
/// # Safety
/// `described` is null, or points to a structure of the size that it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_describe_group(
    handle: takt_handle,
    group: u32,
    described: *mut takt_group,
) -> takt_result {
    border::carry_out(|| {
        let scope = handle.scope()?;
        let groups = groups_of(&scope);
        let known = groups.len();
        let number = groups.clone().nth(group as usize).ok_or_else(|| {
            Failure::argument(format!(
                "there is no group {group}; the groups are counted from 0, and there are {known}"
            ))
        })?;
        let machine = scope.controller.machine();
        let shown = takt_group {
            size: size_of::<takt_group>() as u32,
            number: number as u32,
            axis_count: machine.axes.iter().filter(|axis| axis.group == number).count() as u32,
            reserved: 0,
            name: put_text(machine.groups.get(number).map_or("", String::as_str)),
        };
        // SAFETY: the caller promises it.
        unsafe { border::put_growing(described, &shown, "described") }
    })
}

/// The numbers of the groups of a handle.
fn groups_of(scope: &Scope) -> std::ops::Range<usize> {
    match scope.target {
        RequestTarget::Group(group) => usize::from(group)..usize::from(group) + 1,
        RequestTarget::All => 0..scope.controller.machine().groups.len().max(1),
    }
}

/// Opens a handle for one group of a controller, by its name in the configuration. Every function takes it as it takes that of the
/// controller, and concerns the axes of the group alone, in the order of the group.
///
/// Any thread, not in a callback; does not block. takt_close() closes it, and ends nothing.
///
/// Errors: TAKT_ERROR_ARGUMENT when there is no such group, TAKT_ERROR_FULL, TAKT_ERROR_HANDLE.
///
/// # Safety
/// The pointers are null, or point to what they should.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_open_group(
    handle: takt_handle,
    name: *const c_char,
    group: *mut takt_handle,
) -> takt_result {
    border::carry_out(|| {
        border::check_pointer(group, "group")?;
        let scope = handle.scope()?;
        // SAFETY: the caller promises it.
        let name = unsafe { border::text(name, "name") }?;
        let refused = |error| Failure::of_command(&error, &scope);
        let found = scope.controller.group(name).map_err(refused)?.target();
        let number = handles::open(Entry::Scope(scope.group(found)))?;
        // SAFETY: the caller promises it.
        unsafe { border::put(group, takt_handle { number }, "group") }
    })
}
