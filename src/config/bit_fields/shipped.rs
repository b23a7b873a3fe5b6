//! The descriptions and the register files that come with takt.

use takt_wire::bit_fields::{DescribedScan, Description, ModeDescription, RegisterFile};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::read::parse;
use super::read_registers;
use crate::config::read::entry::Entry;

/// The descriptions, by their names.
pub const DESCRIPTIONS: [(&str, &str); 12] = [
    ("damiao-dm-mit", include_str!("../../../drives/bit-fields/damiao-dm-mit.toml")),
    (
        "damiao-dm-position-velocity",
        include_str!("../../../drives/bit-fields/damiao-dm-position-velocity.toml"),
    ),
    ("damiao-dm-velocity", include_str!("../../../drives/bit-fields/damiao-dm-velocity.toml")),
    ("damiao-dm-force-position", include_str!("../../../drives/bit-fields/damiao-dm-force-position.toml")),
    ("damiao-dm-mit-fd", include_str!("../../../drives/bit-fields/damiao-dm-mit-fd.toml")),
    (
        "damiao-dm-position-velocity-fd",
        include_str!("../../../drives/bit-fields/damiao-dm-position-velocity-fd.toml"),
    ),
    ("damiao-dm-velocity-fd", include_str!("../../../drives/bit-fields/damiao-dm-velocity-fd.toml")),
    (
        "damiao-dm-force-position-fd",
        include_str!("../../../drives/bit-fields/damiao-dm-force-position-fd.toml"),
    ),
    ("mini-cheetah", include_str!("../../../drives/bit-fields/mini-cheetah.toml")),
    ("t-motor-ak-mit", include_str!("../../../drives/bit-fields/t-motor-ak-mit.toml")),
    ("odrive-can-simple", include_str!("../../../drives/bit-fields/odrive-can-simple.toml")),
    (
        "odrive-can-simple-velocity",
        include_str!("../../../drives/bit-fields/odrive-can-simple-velocity.toml"),
    ),
];
const REGISTER_FILES: [&str; 1] = [include_str!("../../../drives/registers/damiao-dm.toml")];

/// A description that comes with takt.
///
/// # Panics
/// It is wrong; a test reads each of them.
pub fn shipped(name: &str, text: &str) -> Description {
    parse(name, text).expect("the descriptions that come with takt are right")
}

/// The name of a description that comes with takt.
pub(super) fn name(entry: &Entry<'_>) -> Option<&'static str> {
    let names = DESCRIPTIONS.map(|(name, _)| (name, name));
    entry.choice(&names)
}

/// The table of a description that comes with takt, with the defaults of the one that it is like.
pub(super) fn table(name: &str) -> DeTable<'static> {
    let text = DESCRIPTIONS.iter().find(|(own, _)| *own == name).map_or("", |(_, text)| *text);
    let table = DeTable::parse_recoverable(text).0.into_inner();
    let like = table.iter().find(|(key, _)| key.get_ref() == "like");
    let Some(like) = like.and_then(|(_, value)| value.get_ref().as_str().map(str::to_owned)) else {
        return table;
    };
    let mut merged = self::table(&like);
    overlay(&mut merged, table);
    // It is said by this table alone.
    merged.into_iter().filter(|(key, _)| key.get_ref() != "like").collect()
}

/// Puts the entries of a table over those of another one.
fn overlay(under: &mut DeTable<'static>, over: DeTable<'static>) {
    for (key, value) in over {
        match (under.get_mut(&key).map(Spanned::get_mut), value.get_ref()) {
            (Some(DeValue::Table(below)), DeValue::Table(_)) => {
                if let DeValue::Table(table) = value.into_inner() {
                    overlay(below, table);
                }
            }
            _ => {
                under.insert(key, value);
            }
        }
    }
}

/// The register file with this name.
///
/// # Panics
/// It is wrong; a test reads each of them.
pub(super) fn register_file(name: &str) -> Option<RegisterFile> {
    let read = |text| {
        read_registers::parse("registers", text).expect("the register files that come with takt are right")
    };
    REGISTER_FILES.into_iter().map(read).find(|file| file.protocol.name == name)
}

/// The modes that a drive may be set to by a register beside the one of its description: those of the descriptions that come with takt and
/// have the same registers. They take the same kind of frame.
pub fn other_modes(description: &Description) -> Vec<ModeDescription> {
    let mode_of = |description: &Description| match &description.scan {
        Some(DescribedScan::Registers(scan)) => Some((scan.protocol.name.clone(), scan.mode_is)),
        _ => None,
    };
    let Some((make, own_mode)) = mode_of(description) else { return vec![] };
    let mut modes: Vec<ModeDescription> = vec![];
    for (name, text) in DESCRIPTIONS {
        let other = shipped(name, text);
        let Some((_, mode_is)) = mode_of(&other).filter(|(name, _)| *name == make) else { continue };
        if mode_is != own_mode && modes.iter().all(|mode| mode.mode_is != mode_is) {
            let mut command = other.command;
            command.format = description.command.format;
            let Description { modes: follows, beside_target, .. } = other;
            modes.push(ModeDescription { mode_is, command, modes: follows, beside_target });
        }
    }
    modes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_description_that_comes_with_takt_is_right_and_says_where_it_is_from() {
        for (name, text) in DESCRIPTIONS {
            let description = shipped(name, text);
            assert!(!description.drive.sources.is_empty() && !description.modes.is_empty(), "{name}");
        }
    }

    #[test]
    fn a_damiao_motor_has_53_registers_and_four_modes() {
        let (name, text) = DESCRIPTIONS[0];
        let description = shipped(name, text);
        assert_eq!(description.registers.as_ref().unwrap().registers.len(), 53);
        let modes: Vec<_> = other_modes(&description).iter().map(|mode| mode.mode_is).collect();
        assert_eq!(modes, [2, 3, 4]);
    }
}
