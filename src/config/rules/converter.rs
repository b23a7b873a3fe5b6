//! Axes on a bus behind a transparent converter between RS-485 and CAN FD: what it carries, and how much of it.

use takt_rt::{FrameFormat, Id, transparent};
use takt_wire::bit_fields::{DescribedLifeCycle, FieldDevice};

use crate::config::model::{Axis, Config, Interface};
use crate::config::spot::Spot;

/// Why the converter does not carry the frames of an axis: the key, what it says, and what may stand there.
struct Unsuitable {
    key: &'static str,
    given: String,
    allowed: String,
}

/// Checks an axis whose bus is behind such a converter. `others` are the axes before it.
pub fn axis<'a, 'o>(
    axis: &Axis,
    mut others: impl Iterator<Item = &'o Axis>,
    interface: Option<&Interface>,
    at: impl Fn(&str) -> Spot<'a>,
) {
    if !matches!(interface, Some(Interface::Converter(_))) {
        return;
    }
    let other = others.find(|other| other.bus == axis.bus);
    if let Some(Unsuitable { key, given, allowed }) = unsuitable(axis, other) {
        at(key).report_range(given, allowed);
    }
}

/// Why bus number `bus` cannot be behind such a converter, in words.
pub fn reason(config: &Config, bus: usize) -> Option<String> {
    let mut before: Option<&Axis> = None;
    for axis in config.axes.iter().filter(|axis| axis.bus == bus) {
        if let Some(Unsuitable { key, given, allowed }) = unsuitable(axis, before) {
            return Some(format!("axis `{}`, `{key}`: {given}; there it is {allowed}", axis.name));
        }
        before = Some(axis);
    }
    None
}

fn unsuitable(axis: &Axis, other: Option<&Axis>) -> Option<Unsuitable> {
    let problem =
        |key, given: String, allowed: &str| Some(Unsuitable { key, given, allowed: allowed.to_owned() });
    let carried =
        "a drive whose frames a converter between RS-485 and CAN FD carries: 16 bytes of CAN FD each way";
    let Some(device) = axis.drive.description::<FieldDevice>() else {
        return problem("drive", format!("a {}", axis.drive.name), carried);
    };
    let description = &device.description;
    let is_long = |format, bytes| format != FrameFormat::Classic && bytes == transparent::DATA_BYTES;
    let (command, reply) = (&description.command, &description.reply);
    let is_carried = is_long(command.format, command.bytes)
        && is_long(reply.format, reply.bytes)
        && matches!(description.life_cycle, DescribedLifeCycle::ByFields(_));
    if !is_carried {
        return problem("drive", format!("a {}", description.drive.product), carried);
    }
    let is_short = |id: Id| !id.is_extended() && u8::try_from(id.value()).is_ok();
    if !is_short(device.reply_id(axis.node)) {
        let given = format!("replies by 0x{:03X}", device.reply_id(axis.node).value());
        return problem("master_id", given, "at most 0xFF behind a converter between RS-485 and CAN FD");
    }
    let number = description
        .setup
        .iter()
        .find_map(|setup| setup.number.filter(|number| device.settings.get(number.setting).is_some()));
    if let Some(number) = number {
        let key = number.setting.key();
        return problem(
            key,
            "a frame that sets it".to_owned(),
            "left out: the converter does not carry such a frame",
        );
    }
    if let Some(other) = other {
        return problem(
            "bus",
            format!("that of axis `{}`", other.name),
            "a line of its own for each axis: an RS-485 line has one direction at a time, and a request would meet the reply to the \
             one before",
        );
    }
    None
}
