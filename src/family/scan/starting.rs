//! A configuration to start with, from what a scan has found.

use std::fmt::Write as _;

use takt_rt::Nanoseconds;

use super::device::{Answered, FoundDevice};
use crate::family;

/// The keys of an axis that only its family knows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StartingKeys {
    /// Lines of the axis, behind its node ID and its family. What only the owner knows is marked with `# YOURS`.
    pub axis: Vec<String>,
    /// Lines of its bus.
    pub bus: Vec<String>,
    /// The period of the cycle, where the drive has only one.
    pub cycle_period: Option<&'static str>,
}

/// Where devices were found.
#[derive(Clone, Debug)]
pub struct PlaceOfScan {
    /// The interface, as a configuration names it.
    pub interface: String,
    /// bit/s
    pub bit_rate: u32,
    /// bit/s of the data phase of CAN FD frames.
    pub data_bit_rate: Option<u32>,
}

/// The limits of a joint, which nobody can find by a scan.
const LIMITS: &str = "limits = { position = [\"-90 deg\", \"90 deg\"], velocity = \"30 deg/s\", acceleration = \"60 deg/s^2\", torque = \
                      \"1 Nm\" }  # YOURS: what the joint may do";

/// The text of a configuration with an axis for each drive that was found. What nobody but the owner of the machine can know is marked.
///
/// With `longer_period_ns` the cycle has this period.
pub fn starting_configuration(
    found: &[(PlaceOfScan, Vec<FoundDevice>)],
    longer_period_ns: Option<Nanoseconds>,
) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let mut line = |written: &str| _ = writeln!(text, "{written}");
    line(
        "# Written by `takt scan`. Lines that end with YOURS have values that stand in for those of your machine: put yours in, then",
    );
    line("# `takt check FILE`, and `takt run FILE --bus NAME=sim` before anything moves.");
    let axes: Vec<Vec<(&FoundDevice, StartingKeys)>> =
        found.iter().map(|(_, devices)| driven(devices)).collect();
    let of_drive = axes.iter().flatten().find_map(|(_, keys)| keys.cycle_period).map(str::to_owned);
    let period = longer_period_ns.map(|ns| format!("{} us", ns / 1000)).or(of_drive);
    line("name = \"my-machine\"");
    if let Some(period) = period {
        line(&format!("\n[cycle]\nperiod = {period:?}"));
    }
    let mut number = 0;
    for (at, ((place, devices), axes)) in found.iter().zip(&axes).enumerate() {
        let bus = bus_name(at, found.len());
        line(&format!("\n[[bus]]\nname = {bus:?}\ninterface = {:?}", place.interface));
        line(&format!("bit_rate = \"{} bit/s\"", place.bit_rate));
        if let Some(rate) = place.data_bit_rate {
            line(&format!("data_bit_rate = \"{rate} bit/s\""));
        }
        // What one drive needs of its bus may be nothing for the others on it.
        if let Some((_, first)) = axes.first()
            && axes.iter().all(|(_, keys)| keys.bus == first.bus)
        {
            first.bus.iter().for_each(|written| line(written));
        }
        for device in devices.iter().filter(|device| axes.iter().all(|(driven, _)| driven != device)) {
            line(&format!("# Without an axis: {}", in_words(device)));
        }
        for (device, keys) in axes {
            number += 1;
            line(&format!("\n# {}\n[[axis]]\nname = \"joint{number}\"\nbus = {bus:?}", in_words(device)));
            line(&format!("node = {}", device.node.unwrap_or(1)));
            line(&format!("drive = {:?}", device.drive.unwrap_or_default()));
            keys.axis.iter().for_each(|written| line(written));
            line(LIMITS);
        }
    }
    text
}

/// Returns `true` if there can be an axis for one of the devices.
pub fn can_drive(devices: &[FoundDevice]) -> bool {
    !driven(devices).is_empty()
}

/// The devices for which there can be an axis, with its keys. Those of a running controller have one there. Two with the same node ID cannot be told apart: the first of them.
fn driven(devices: &[FoundDevice]) -> Vec<(&FoundDevice, StartingKeys)> {
    let keys = |device: &FoundDevice| family::named(device.drive?)?.starting_keys(device);
    devices
        .iter()
        .filter(|device| device.node.is_some() && device.answered != Answered::OfController)
        .filter_map(|device| Some((device, keys(device)?)))
        .collect()
}

fn bus_name(at: usize, count: usize) -> String {
    if count == 1 { "bus".to_owned() } else { format!("bus{}", at + 1) }
}

fn in_words(device: &FoundDevice) -> String {
    let FoundDevice { node, kind, vendor, product, firmware, serial, answered, .. } = device;
    let mut words = vec![match node {
        Some(node) => format!("node {node}"),
        None => "no node ID".to_owned(),
    }];
    words.push(kind.clone());
    words.extend(vendor.iter().chain(product).cloned());
    words.extend(firmware.as_ref().map(|firmware| format!("firmware {firmware}")));
    words.extend(serial.as_ref().map(|serial| format!("serial number {serial}")));
    if *answered == Answered::Lss {
        words.push("give it a node ID with `takt lss`".to_owned());
    }
    words.join(", ").replace('\n', " ")
}
