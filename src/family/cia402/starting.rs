//! A configuration to start with, from a data sheet.

use std::fmt::Write as _;
use std::path::Path;

use takt_rt::CommandSlot;

use super::device::Device;
use crate::config::{DriveFacts, MODES, mode_word};

/// The text of a configuration with one axis, which has this drive. It is complete, and runs on a simulated bus; what nobody but
/// the owner of the machine can know is marked.
pub fn starting_configuration(device: &Device, eds: &Path, node: u8) -> String {
    let facts = device.facts(super::FACTS);
    let sheet = &device.dictionary.device;
    let named = |name: &Option<String>| name.clone().unwrap_or_else(|| "unnamed".to_owned());
    let mut text = String::new();
    // Writing to a String cannot fail.
    let mut line = |written: String| _ = writeln!(text, "{written}");
    line(format!("# {} ({}), by its data sheet.", named(&sheet.product_name), named(&sheet.vendor_name)));
    line("# Try it as it is: takt run FILE. Then set the limits of your machine, and the interface of your bus.".to_owned());
    line("name = \"my-machine\"\n".to_owned());
    line("[[bus]]\nname = \"can\"\ninterface = \"sim\"  # \"can0\"\n".to_owned());
    line("[[axis]]\nname = \"joint1\"\nbus = \"can\"".to_owned());
    line(format!("node = {node}"));
    line(format!("drive = \"{}\"", facts.word));
    line(format!("eds = {:?}", eds.display().to_string()));
    line(format!(
        "mode = \"{}\"  # the drive has {}",
        mode_word(facts.usual_mode.operation_mode()),
        modes(&facts)
    ));
    match facts.counts_per_turn {
        Some(counts) => line(format!("counts_per_turn = {counts}  # by the data sheet")),
        None => line("counts_per_turn = 65536  # YOURS: the data sheet does not say".to_owned()),
    }
    line("gear_ratio = 1  # YOURS: turns of the reported position for one turn of the joint".to_owned());
    line("limits = { position = [\"-90 deg\", \"90 deg\"], velocity = \"30 deg/s\", acceleration = \"60 deg/s2\", torque = 10 }  # YOURS".to_owned());
    if facts.usual_mode.target_slot() == CommandSlot::TargetPosition {
        line("\n[[program.move]]\nto = \"10 deg\"\n\n[[program.move]]\nto = \"0 deg\"".to_owned());
    }
    text
}

fn modes(facts: &DriveFacts) -> String {
    let own = MODES.iter().filter(|(_, mode)| facts.modes.contains(*mode));
    own.map(|(word, _)| *word).collect::<Vec<_>>().join(", ")
}
