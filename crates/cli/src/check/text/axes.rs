//! The tables of the axes: limits, units, supervision.

use takt_wire::printable::printable_path;

use takt::config::LimitOrigin;

use super::spans::{counted_span, short, span, time};
use crate::check::result::{AxisCheck, ComplianceCheck};
use crate::table::{Table, UNBROKEN};

pub(super) fn is_shown_alike(first: &AxisCheck, second: &AxisCheck) -> bool {
    let anonymous = |axis: &AxisCheck| AxisCheck {
        name: String::new(),
        bus: String::new(),
        node: 0,
        urdf: None,
        ..axis.clone()
    };
    anonymous(first) == anonymous(second)
}

pub(super) fn axes_table(axes: &[&[AxisCheck]]) -> Table {
    let mut table = Table::new(["axis", "bus", ">node", "mode", "following error"]);
    for (group, axis) in axes.iter().filter_map(|group| Some((group, group.first()?))) {
        table.row([
            counted_span(group.iter().map(|axis| axis.name.as_str())),
            span(group.iter().map(|axis| axis.bus.as_str())),
            match axis.node_axis {
                1 => nodes(group),
                number => format!("{}, axis {number}", axis.node),
            },
            axis.mode.to_owned(),
            format!(
                "up to {} {} for {}",
                short(axis.shown(axis.following_error)),
                axis.unit(),
                time(axis.following_error_time_ns)
            ),
        ]);
    }
    table
}

/// `1`, `1 to 6` where none is left out, or `2, 5, 9`.
fn nodes(axes: &[AxisCheck]) -> String {
    let mut nodes: Vec<u8> = axes.iter().map(|axis| axis.node).collect();
    nodes.sort_unstable();
    nodes.dedup();
    match nodes[..] {
        [first, _, .., last] if usize::from(last - first) + 1 == nodes.len() => format!("{first} to {last}"),
        _ => nodes.iter().map(u8::to_string).collect::<Vec<_>>().join(", "),
    }
}

/// In the unit that the file has for the position limits of the axis.
pub(super) fn limits_table(axes: &[&[AxisCheck]]) -> Table {
    let mut table =
        Table::new(["axis", "unit", ">lowest", ">highest", ">velocity", ">acceleration", ">jerk", ">torque"]);
    for (group, axis) in axes.iter().filter_map(|group| Some((group, group.first()?))) {
        let position = |position: f64| format!("{:.*}", axis.decimals(), axis.shown(position));
        let derivative = |value: f64| format!("{:.*}", axis.decimals().saturating_sub(2), axis.shown(value));
        table.row([
            counted_span(group.iter().map(|axis| axis.name.as_str())),
            axis.unit().to_owned(),
            position(axis.position_min),
            position(axis.position_max),
            position(axis.velocity),
            if axis.deceleration == axis.acceleration {
                derivative(axis.acceleration)
            } else {
                format!("{}, braking {}", derivative(axis.acceleration), derivative(axis.deceleration))
            },
            axis.jerk.map_or("none".to_owned(), derivative),
            format!("{:.1}{UNBROKEN}{}", axis.torque, if axis.is_linear { "N" } else { "Nm" }),
        ]);
    }
    table
}

/// Where the limits of each axis come from that has a joint in a robot description; `None` without one.
pub(super) fn urdf_table(axes: &[AxisCheck]) -> Option<Table> {
    let mut table = Table::new(["axis", "joint", "position", "velocity", "torque", "file"]);
    let described: Vec<_> = axes.iter().filter_map(|axis| Some((axis, axis.urdf.as_ref()?))).collect();
    for (axis, urdf) in &described {
        let from = |origin| {
            match origin {
                LimitOrigin::Configuration => "here",
                LimitOrigin::Limit => "limit",
                LimitOrigin::SafetyController => "soft limit",
            }
            .to_owned()
        };
        table.row([
            axis.name.clone(),
            urdf.joint.clone(),
            from(urdf.position),
            from(urdf.velocity),
            from(urdf.torque),
            printable_path(&urdf.file),
        ]);
    }
    (!described.is_empty()).then_some(table)
}

/// The axes of which a stream may want a torque, an impedance, or a torque that is fed forward; `None` without one.
pub(super) fn torque_table(axes: &[&[AxisCheck]]) -> Option<Table> {
    let mut table =
        Table::new(["axis", "as", "sent beside the target", ">stiffness", ">damping", ">torque per second"]);
    let mut has_rows = false;
    for (group, axis) in axes.iter().filter_map(|group| Some((group, group.first()?))) {
        let number = |of: fn(&ComplianceCheck) -> f64| {
            axis.compliance
                .as_ref()
                .map_or(String::new(), |compliance| format!("up to {:.1}", of(compliance)))
        };
        if axis.compliance.is_none() && axis.feed_forward == "none" {
            continue;
        }
        has_rows = true;
        table.row([
            counted_span(group.iter().map(|axis| axis.name.as_str())),
            if axis.compliance.is_some() { "target" } else { "offset" }.to_owned(),
            axis.feed_forward.to_owned(),
            number(|compliance| compliance.stiffness_max),
            number(|compliance| compliance.damping_max),
            number(|compliance| compliance.torque_rate),
        ]);
    }
    has_rows.then_some(table)
}

/// The axes whose mode may be changed at run time; `None` without one.
pub(super) fn modes_table(axes: &[&[AxisCheck]]) -> Option<Table> {
    let mut table = Table::new(["axis", "starts in", "may be changed to", "when"]);
    let changing = axes.iter().filter_map(|group| Some((group, group.first()?)));
    let changing: Vec<_> = changing.filter(|(_, axis)| !axis.other_modes.is_empty()).collect();
    for (group, axis) in &changing {
        table.row([
            counted_span(group.iter().map(|axis| axis.name.as_str())),
            axis.mode.to_owned(),
            axis.other_modes.join(", "),
            axis.mode_change.unwrap_or_default().to_owned(),
        ]);
    }
    (!changing.is_empty()).then_some(table)
}

pub(super) fn units_table(axes: &[&[AxisCheck]]) -> Table {
    let mut table =
        Table::new(["axis", "counts per unit", "one count", "counts per cycle at full speed", "counts"]);
    for (group, axis) in axes.iter().filter_map(|group| Some((group, group.first()?))) {
        let [lowest, highest] = axis.counts_range;
        table.row([
            counted_span(group.iter().map(|axis| axis.name.as_str())),
            format!("{} per {}", short(1.0 / axis.shown(axis.resolution)), axis.unit()),
            format!("{}{UNBROKEN}µ{}", short(axis.shown(axis.resolution) * 1e6), axis.unit()),
            format!("{:.1}", axis.counts_per_cycle),
            format!("{lowest} to {highest}"),
        ]);
    }
    table
}

pub(super) fn supervision_table(axes: &[&[AxisCheck]]) -> Table {
    let mut table = Table::new([
        "axis",
        "the controller sees the drive by",
        ">stops after",
        "the drive sees the controller by",
        ">stops after",
    ]);
    for (group, axis) in axes.iter().filter_map(|group| Some((group, group.first()?))) {
        let supervision = &axis.supervision;
        table.row([
            counted_span(group.iter().map(|axis| axis.name.as_str())),
            supervision.drive.words(time),
            time(supervision.drive_lost_after_ns),
            supervision.controller.map_or("NOTHING".to_owned(), |sign| sign.words(time)),
            supervision.controller_lost_after_ns.map_or("never".to_owned(), time),
        ]);
    }
    table
}

pub(super) fn unattended_table(axes: &[&[AxisCheck]]) -> Table {
    let mut table = Table::new(["axis", "mode", "what the drive does"]);
    for (group, axis) in axes.iter().filter_map(|group| Some((group, group.first()?))) {
        table.row([
            counted_span(group.iter().map(|axis| axis.name.as_str())),
            axis.mode.to_owned(),
            axis.without_controller.words(axis.shown_in),
        ]);
    }
    table
}
