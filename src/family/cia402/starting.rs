//! A configuration to start with, from a data sheet.

use std::fmt::Write as _;
use std::path::Path;

use takt_rt::CommandSlot;

use super::device::Device;
use crate::config::{Control, DriveFacts, MODES, mode_word};
use crate::family::scan::{FoundDevice, StartingKeys};

/// Returns the text of a configuration with this drive, and an axis for each of its own, in this mode or in the usual one. It is complete,
/// and runs on a simulated bus; what nobody but the owner of the machine can know is marked.
pub fn starting_configuration(
    device: &Device,
    eds: &Path,
    quirks: Option<&Path>,
    node: u8,
    mode: Option<Control>,
) -> String {
    let sheet = &device.dictionary.device;
    let named = |name: &Option<String>| name.clone().unwrap_or_else(|| "unnamed".to_owned());
    let mut text = String::new();
    // Writing to a String cannot fail.
    let mut line = |written: String| _ = writeln!(text, "{written}");
    line(format!("# {} ({}), by its data sheet.", named(&sheet.product_name), named(&sheet.vendor_name)));
    line("# Try it as it is: takt run FILE. Then set the limits of your machine, and the interface of your bus.".to_owned());
    line("name = \"my-machine\"\n".to_owned());
    line("[[bus]]\nname = \"can\"\ninterface = \"sim\"  # \"can0\"\n".to_owned());
    let axes: Vec<Device> =
        (1..=device.axes()).filter_map(|axis| device.clone().of_axis(axis).ok()).collect();
    let mode_of = |axis: &Device| {
        let usual = axis.facts(super::FACTS).usual_mode;
        mode.filter(|mode| axis.modes().contains(mode.operation_mode())).unwrap_or(usual)
    };
    for axis in &axes {
        axis_lines(axis, eds, quirks, node, mode_of(axis), &mut line);
    }
    let takes_positions = |axis: &Device| mode_of(axis).target_slot() == CommandSlot::TargetPosition;
    if axes.iter().all(takes_positions) {
        line("[[program.move]]\nto = \"10 deg\"\n\n[[program.move]]\nto = \"0 deg\"".to_owned());
    }
    text
}

/// Says of a device that a scan has found what its data sheet says, if it is the sheet of its vendor and product.
pub fn name_by_sheet(found: &mut FoundDevice, device: &Device, eds: &Path) {
    let of_sheet = device.facts(super::FACTS).identity;
    let is_its = found.identity.is_some_and(|own| {
        of_sheet.vendor.is_some() && own.vendor == of_sheet.vendor && own.product == of_sheet.product
    });
    if !is_its {
        return;
    }
    let sheet = &device.dictionary.device;
    found.vendor = sheet.vendor_name.clone().or_else(|| found.vendor.take());
    found.product = sheet.product_name.clone().or_else(|| found.product.take());
    found.sheet = Some(eds.to_owned());
}

/// The keys of an axis with a drive that a scan has found, and whose data sheet only its owner has.
pub fn keys(found: &FoundDevice) -> StartingKeys {
    let node = found.node.unwrap_or(1);
    let eds = match &found.sheet {
        Some(eds) => format!("eds = {:?}", eds.display().to_string()),
        None => format!("eds = \"node-{node}.eds\"  # YOURS: the data sheet of the drive, from its vendor"),
    };
    let axis = [
        eds,
        "counts_per_turn = 65536  # YOURS, unless the data sheet says it".to_owned(),
        "gear_ratio = 1  # YOURS: turns of the reported position for one turn of the joint".to_owned(),
    ];
    StartingKeys { axis: axis.to_vec(), ..StartingKeys::default() }
}

fn axis_lines(
    axis: &Device,
    eds: &Path,
    quirks: Option<&Path>,
    node: u8,
    mode: Control,
    line: &mut impl FnMut(String),
) {
    let facts = axis.facts(super::FACTS);
    line(format!("[[axis]]\nname = \"joint{}\"\nbus = \"can\"", axis.node_axis));
    line(format!("node = {node}"));
    if axis.node_axis > 1 {
        line(format!("node_axis = {}", axis.node_axis));
    }
    line(format!("drive = \"{}\"", facts.word));
    line(format!("eds = {:?}", eds.display().to_string()));
    if let Some(quirks) = quirks {
        line(format!("quirks = {:?}", quirks.display().to_string()));
    }
    line(format!("mode = \"{}\"  # the drive has {}", mode_word(mode.operation_mode()), modes(&facts)));
    match facts.counts_per_turn {
        Some(counts) => line(format!("counts_per_turn = {counts}  # by the data sheet")),
        None => line("counts_per_turn = 65536  # YOURS: the data sheet does not say".to_owned()),
    }
    line("gear_ratio = 1  # YOURS: turns of the reported position for one turn of the joint".to_owned());
    line("limits = { position = [\"-90 deg\", \"90 deg\"], velocity = \"30 deg/s\", acceleration = \"60 deg/s2\", torque = 10 }  # YOURS\n".to_owned());
}

fn modes(facts: &DriveFacts) -> String {
    let own = MODES.iter().filter(|(_, mode)| facts.modes.contains(*mode));
    own.map(|(word, _)| *word).collect::<Vec<_>>().join(", ")
}
