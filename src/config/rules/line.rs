//! Serial lines with drives on them, beside CAN buses.

use crate::config::drive_family::DriveFacts;
use crate::config::model::{Bus, CommandFrames, Config, Interface};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantity::Quantity;
use crate::config::spot::Spot;

use super::Fields;

/// The keys of a CAN bus that a serial line does not have.
pub const CAN_KEYS: [&str; 5] =
    ["data_bit_rate", "restart_ms", "service_frames_per_cycle", "sdo_while_enabled", "command_frames"];

/// What is wrong with such a key on a serial line.
pub fn can_key(key: &str) -> ProblemKind {
    ProblemKind::NotOnALine { key: key.to_owned() }
}

/// Checks the fields of a serial line that was set in code.
pub fn validate(bus: &Bus, fields: &Fields<'_>) {
    let usual = Bus::new("", Interface::Simulated);
    let set = [
        ("data_bit_rate", bus.data_bit_rate.is_some()),
        ("restart_ms", bus.restart_ms != usual.restart_ms),
        ("service_frames_per_cycle", bus.service_frames_per_cycle != usual.service_frames_per_cycle),
        ("sdo_while_enabled", bus.sdo_while_enabled),
        ("command_frames", bus.command_frames != CommandFrames::default()),
    ];
    for (key, _) in set.into_iter().filter(|(_, is_set)| *is_set) {
        let spot = fields.at(key);
        spot.report(can_key(&spot.key));
    }
    if let Interface::Serial(device) = &bus.interface
        && device.bit_rate.is_some_and(|rate| rate != bus.bit_rate)
    {
        two_bit_rates(&fields.at("bit_rate"), bus.bit_rate, device.bit_rate.unwrap_or_default());
    }
}

/// The bit rate behind the path of the device is another one than that of the bus.
pub fn two_bit_rates(spot: &Spot<'_>, of_bus: u32, of_device: u32) {
    let show = |rate: u32| Quantity::BIT_RATE.show(rate.into());
    spot.report_range(
        show(of_bus),
        format!("{}, as `interface` says; one of the two is enough", show(of_device)),
    );
}

/// A drive on a serial line and a bus that is one belong together.
pub fn place(drive_spot: &Spot<'_>, bus_spot: &Spot<'_>, drive: &DriveFacts, bus_name: &str, is_line: bool) {
    match (drive.protocol.is_of_serial_line(), is_line) {
        (true, false) => drive_spot.report_range(
            format!("{:?} on the CAN bus `{bus_name}`", drive.word),
            "a drive of a CAN bus; this one needs a serial line: a [[bus]] of its own with interface = \
             \"serial:/dev/ttyUSB0\" or \"sim\""
                .to_owned(),
        ),
        (false, true) => bus_spot.report_range(
            format!("{bus_name:?}, which is a serial line,"),
            format!("a CAN bus: an {} is not on a serial line", drive.name),
        ),
        (true, true) | (false, false) => {}
    }
}

/// The drives of a line speak one protocol.
pub fn one_protocol(spot: &Spot<'_>, drive: &DriveFacts, first: &DriveFacts) {
    if drive.protocol.is_of_serial_line() && first.protocol.is_of_serial_line() && drive.word != first.word {
        spot.report_range(
            format!("{:?} beside {:?}", drive.word, first.word),
            "the same family for every axis of a serial line: they speak one protocol".to_owned(),
        );
    }
}

/// Checks the place of an axis that was set in code.
pub fn validate_place(config: &Config, index: usize, fields: &Fields<'_>) {
    let Some((axis, bus)) = config.axes.get(index).and_then(|axis| Some((axis, config.buses.get(axis.bus)?)))
    else {
        return;
    };
    let is_line = config.is_serial_line(axis.bus);
    place(&fields.at("drive"), &fields.at("bus"), &axis.drive, &bus.name, is_line);
    let mut earlier = config.axes.iter().take(index).filter(|other| other.bus == axis.bus);
    if let Some(first) = earlier.find(|other| other.drive.protocol.is_of_serial_line()) {
        one_protocol(&fields.at("drive"), &axis.drive, &first.drive);
    }
}
