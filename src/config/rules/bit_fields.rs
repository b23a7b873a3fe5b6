//! Axes whose drives are spoken to by bit fields.

use takt_rt::{CommandValue, FrameFormat};
use takt_wire::bit_fields::{FieldDevice, Setting};

use crate::config::bit_fields;
use crate::config::model::{Axis, Bus, Control, Interface};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantities::Quantities;
use crate::config::quantity::Short;
use crate::config::spot::Spot;

/// Checks what the description of the drive of an axis asks of its configuration.
pub fn axis<'a>(axis: &Axis, bus: Option<&Bus>, at: impl Fn(&str) -> Spot<'a>) {
    let Some(device) = axis.drive.description::<FieldDevice>() else { return };
    let description = &device.description;
    if !description.motor_ids.contains(&axis.node) {
        let (lowest, highest) = (description.motor_ids.start(), description.motor_ids.end());
        let allowed = format!("a motor ID of a {}, {lowest} to {highest}", description.drive.product);
        at("node").report_range(axis.node.to_string(), allowed);
    }
    let is_classic = device.format(description.command.format) == FrameFormat::Classic;
    // A converter sets the bus behind it up by itself.
    let is_set_up =
        |bus: &Bus| bus.data_bit_rate.is_some() || matches!(bus.interface, Interface::Converter(_));
    if !is_classic && bus.is_some_and(|bus| !is_set_up(bus)) {
        at("drive").report_range(
            format!("a {} on a classic bus", description.drive.product),
            "a bus for CAN FD frames: give it a `data_bit_rate`, which may be that of the arbitration phase"
                .to_owned(),
        );
    }
    let counts = device.counts_per_turn();
    if !device.may_count(axis.counts_per_turn) {
        let counts = Short(counts);
        let allowed = match device.outruns_counts() {
            true => format!(
                "left out: the frames of the drive have {counts} counts in a turn; or less, so that more turns can be counted"
            ),
            false => format!("left out: the frames of the drive have {counts} counts in a turn"),
        };
        at("counts_per_turn").report_range(Short(axis.counts_per_turn).to_string(), allowed);
        return;
    }
    position_range(device, axis, &at);
    gains(device, axis, &at);
}

/// Every position of the joint has a code.
fn position_range<'a>(device: &FieldDevice, axis: &Axis, at: &impl Fn(&str) -> Spot<'a>) {
    let Some((lowest, highest)) = bit_fields::position_range(device, axis) else { return };
    let limits = &axis.limits;
    if limits.position_min < lowest || limits.position_max > highest {
        let q = Quantities::of(axis.travel);
        at("limits").report_range(
            format!("position = {}", q.show_range(limits)),
            format!(
                "positions that the frames of the drive can carry: {} to {}",
                q.position.show(lowest),
                q.position.show(highest)
            ),
        );
    }
}

/// The gains of the drive's own loops are given, and can be sent.
fn gains<'a>(device: &FieldDevice, axis: &Axis, at: &impl Fn(&str) -> Spot<'a>) {
    let has = |is_it: fn(&Control) -> bool| axis.controls().any(is_it);
    let follows_positions = has(|control| matches!(control, Control::Position));
    let follows_velocities = has(|control| matches!(control, Control::Velocity { .. }));
    let needed = [
        (Setting::PositionGain, CommandValue::Stiffness, follows_positions),
        (
            Setting::PositionDamping,
            CommandValue::Damping,
            follows_positions || follows_velocities && device.has_impedance(),
        ),
    ];
    for (setting, value, is_needed) in needed {
        let Some(most) = bit_fields::most(device, value, axis) else { continue };
        let spot = at(setting.key());
        match device.settings.get(setting) {
            None if is_needed => {
                spot.report(ProblemKind::MissingKey { key: spot.key.clone(), says: setting.says().into() });
            }
            Some(gain) if gain > most => {
                let allowed =
                    format!("0 to {}, the most that the frames of the drive can carry", Short(most));
                spot.report_range(Short(gain).to_string(), allowed);
            }
            _ => {}
        }
    }
}
