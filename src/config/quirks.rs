//! Reads a quirk file with the configuration's reader. Every problem of the file is reported with its line and a remedy.
//! `drives/` has examples.

use std::path::Path;

use takt_rt::{Nanoseconds, OperationMode};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::objects::PROFILE_ACCELERATION;
use takt_wire::described_drive::DescribedDrive;
use toml::de::DeTable;

use crate::config::ConfigError;
use crate::config::MODES;
use crate::config::data_file::{self, each, each_of_some, optional};
use crate::config::read::document;
use crate::config::read::entry::Entry;
use crate::config::read::section::Section;
use crate::config::spot::Problems;

pub use takt_wire::described_drive::Confirmation;
pub use takt_wire::quirks::{Delays, MotionUnit, ObjectPattern, PowerUpState, Quirks, QuirkyDrive};

/// The longest delay; a longer one is a mistake in the unit.
const LONGEST_S: f64 = 600.0;

/// The velocity and acceleration objects whose unit a file may give.
const UNITS: [(&str, u16); 5] = [
    ("velocity", 0x606C),
    ("target_velocity", 0x60FF),
    ("profile_velocity", 0x6081),
    ("motor_speed", 0x6080),
    ("acceleration", 0x6083),
];

/// Reads a quirk file.
///
/// # Errors
/// The file cannot be read, or every problem of its text.
pub fn load(path: &Path) -> Result<Quirks, ConfigError> {
    data_file::load(path, parse)
}

/// Reads the text of a quirk file. Messages call it `source_name`.
///
/// # Errors
/// Every problem of the text.
pub fn parse(source_name: &str, text: &str) -> Result<Quirks, ConfigError> {
    document(source_name, text, read)
}

/// Reads every section, even after one has failed.
fn read<'a>(table: &'a DeTable<'a>, problems: &'a Problems) -> Option<Quirks> {
    let mut root = Section::new("", 0..0, table, problems);
    let drive = drive(root.section("drive"));
    let known: Vec<_> = MODES.into_iter().chain([("homing", OperationMode::Homing)]).collect();
    let modes =
        optional(root.get("modes"), |entry| each_of_some(&entry, "mode", |entry| entry.choice(&known)));
    let counts_per_turn = optional(root.get("counts_per_turn"), |entry| {
        let counts = entry.integer(1..1 << 32)?;
        Some(counts as f64)
    });
    let objects = objects(root.section("objects"));
    let statusword = statusword(root.section("statusword"));
    let units = units(root.section("units"));
    let power_ups =
        [("pre-operational", PowerUpState::PreOperational), ("operational", PowerUpState::Operational)];
    let power_up = optional(root.get("power_up"), |entry| entry.choice(&power_ups));
    let sdo_blocks = optional(root.get("sdo_blocks"), |entry| entry.boolean());
    let delays = delays(root.section("delays"));
    let errors = data_file::errors(root.get("errors"), problems, error_code, ERROR_CODES);
    root.finish();
    let (missing, constant) = objects?;
    let (statusword_set, statusword_clear) = statusword?;
    Some(Quirks {
        drive: drive?,
        modes: modes?,
        counts_per_turn: counts_per_turn?,
        missing,
        constant,
        statusword_set,
        statusword_clear,
        units: units?,
        power_up: power_up?.unwrap_or_default(),
        refuses_blocks: !sdo_blocks?.unwrap_or(true),
        delays: delays?,
        errors: errors?,
    })
}

fn drive(mut section: Section<'_>) -> Option<QuirkyDrive> {
    let described = data_file::drive(&mut section);
    let number = |entry: &Entry<'_>| u32::try_from(entry.integer(0..1 << 32)?).ok();
    let vendor_number = optional(section.get("vendor_number"), |entry| number(&entry));
    let product_numbers = optional(section.get("product_numbers"), |entry| each(&entry, number));
    section.finish();
    let DescribedDrive { vendor, product, confirmation, sources } = described?;
    let (vendor_number, product_numbers) = (vendor_number?, product_numbers?.unwrap_or_default());
    Some(QuirkyDrive { vendor, product, vendor_number, product_numbers, confirmation, sources })
}

fn objects(mut section: Section<'_>) -> Option<(Vec<ObjectPattern>, Vec<ObjectPattern>)> {
    let missing = optional(section.get("missing"), |entry| each(&entry, pattern));
    let constant = optional(section.get("constant"), |entry| each(&entry, pattern));
    section.finish();
    Some((missing?.unwrap_or_default(), constant?.unwrap_or_default()))
}

/// Reads `"1006"` or `"1029:1"`, in hexadecimal.
fn pattern(entry: &Entry<'_>) -> Option<ObjectPattern> {
    let text = entry.text()?;
    let (index, subindex) = match text.split_once(':') {
        Some((index, subindex)) => (index, Some(subindex)),
        None => (text, None),
    };
    let index = (index.len() == 4).then(|| u16::from_str_radix(index, 16).ok()).flatten();
    let subindex = subindex.map(|subindex| u8::from_str_radix(subindex, 16).ok());
    match (index, subindex) {
        (Some(index), None) => Some(ObjectPattern::Index(index)),
        (Some(index), Some(Some(subindex))) => {
            Some(ObjectPattern::Address(ObjectAddress::new(index, subindex)))
        }
        _ => {
            let allowed = "an index of four hexadecimal digits, or index and sub-index: \"1006\", \"1029:1\"";
            entry.report_range(format!("{text:?}"), allowed.to_owned());
            None
        }
    }
}

fn statusword(mut section: Section<'_>) -> Option<(u16, u16)> {
    let bits = |entry: Entry<'_>| u16::try_from(entry.integer(0..1 << 16)?).ok();
    let set = optional(section.get("set"), bits);
    let clear = optional(section.get("clear"), bits);
    section.finish();
    Some((set?.unwrap_or(0), clear?.unwrap_or(0)))
}

fn units(mut section: Section<'_>) -> Option<Vec<(u16, MotionUnit)>> {
    let read = UNITS.map(|(key, index)| (index, optional(section.get(key), |entry| unit(&entry, index))));
    section.finish();
    let mut units = vec![];
    for (index, unit) in read {
        units.extend(unit?.map(|unit| (index, unit)));
    }
    Some(units)
}

/// Reads `"counts/s"`, `"0.1 r/min"` and the like: a factor and one of the two units of a velocity, or of an acceleration.
fn unit(entry: &Entry<'_>, index: u16) -> Option<MotionUnit> {
    let text = entry.text()?;
    let is_acceleration = index == PROFILE_ACCELERATION.address.index;
    let (factor, name) = match text.split_once(' ') {
        Some((factor, name)) => (factor.parse().ok().filter(|factor| *factor > 0.0), name),
        None => (Some(1.0), text),
    };
    match (factor, name, is_acceleration) {
        (Some(factor), "counts/s", false) | (Some(factor), "counts/s²" | "counts/s^2", true) => {
            Some(MotionUnit::PositionUnits(factor))
        }
        (Some(factor), "r/min", false) | (Some(factor), "r/min/s", true) => {
            Some(MotionUnit::RevolutionsPerMinute(factor))
        }
        _ => {
            let allowed = match is_acceleration {
                false => {
                    "a unit of velocity, \"counts/s\" or \"r/min\", with a factor if needed: \"0.1 r/min\""
                }
                true => {
                    "a unit of acceleration, \"counts/s²\" or \"r/min/s\", with a factor if needed: \"10 counts/s²\""
                }
            };
            entry.report_range(format!("{text:?}"), allowed.to_owned());
            None
        }
    }
}

fn delays(mut section: Section<'_>) -> Option<Delays> {
    let delay = |entry: Entry<'_>| -> Option<Nanoseconds> { entry.nanoseconds(0.0..=LONGEST_S) };
    let boot_up_ns = optional(section.get("boot_up"), delay);
    let first_pdo_ns = optional(section.get("first_pdo"), delay);
    let sdo_reply_ns = optional(section.get("sdo_reply"), delay);
    let mode_change_ns = optional(section.get("mode_change"), delay);
    let save_ns = optional(section.get("save"), delay);
    section.finish();
    Some(Delays {
        boot_up_ns: boot_up_ns?,
        first_pdo_ns: first_pdo_ns?,
        sdo_reply_ns: sdo_reply_ns?,
        mode_change_ns: mode_change_ns?,
        save_ns: save_ns?,
    })
}

const ERROR_CODES: &str =
    "an error code (object 603F) of four hexadecimal digits: 8611 = \"following error\"";

fn error_code(key: &str) -> Option<u16> {
    (key.len() == 4).then(|| u16::from_str_radix(key, 16).ok()).flatten()
}
