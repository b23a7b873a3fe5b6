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
use crate::config::data_file::{self, each, each_of_some, keyed, optional};
use crate::config::read::document;
use crate::config::read::entry::Entry;
use crate::config::read::section::Section;
use crate::config::spot::Problems;

pub use takt_wire::described_drive::Confirmation;
pub use takt_wire::quirks::{
    Delays, MotionUnit, ObjectPattern, PowerUpState, Quirks, QuirkyDrive, TurnCount,
};

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
    let some_modes = |entry: Entry<'_>| each_of_some(&entry, "mode", |entry| entry.choice(&known));
    let modes = optional(root.get("modes"), some_modes);
    let undeclared_modes = optional(root.get("undeclared_modes"), some_modes);
    let keeps_mode = optional(root.get("keeps_mode_with_torque"), |entry| entry.boolean());
    let interpolation_target = optional(root.get("interpolation_target"), |entry| address(&entry));
    let counts_per_turn = optional(root.get("counts_per_turn"), |entry| {
        let counts = entry.integer(1..1 << 32)?;
        Some(counts as f64)
    });
    let objects = objects(root.section("objects"), problems);
    let turn_count = turn_count(root.section("turn_count"));
    let statusword = statusword(root.section("statusword"));
    let units = units(root.section("units"));
    let power_ups =
        [("pre-operational", PowerUpState::PreOperational), ("operational", PowerUpState::Operational)];
    let power_up = optional(root.get("power_up"), |entry| entry.choice(&power_ups));
    let sdo_blocks = optional(root.get("sdo_blocks"), |entry| entry.boolean());
    let delays = delays(root.section("delays"));
    let errors = data_file::errors(root.get("errors"), problems, hexadecimal, ERROR_CODES);
    root.finish();
    let Objects { missing, constant, values } = objects?;
    let [statusword_set, statusword_clear, statusword_set_disabled, statusword_set_in_some] = statusword?;
    Some(Quirks {
        drive: drive?,
        modes: modes?,
        undeclared_modes: undeclared_modes?.unwrap_or_default(),
        keeps_mode_with_torque: keeps_mode?.unwrap_or(false),
        interpolation_target: interpolation_target?,
        counts_per_turn: counts_per_turn?,
        missing,
        constant,
        values,
        turn_count: turn_count?,
        statusword_set,
        statusword_clear,
        statusword_set_disabled,
        statusword_set_in_some,
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

/// What a file says of single objects.
struct Objects {
    missing: Vec<ObjectPattern>,
    constant: Vec<ObjectPattern>,
    values: Vec<(ObjectAddress, i64)>,
}

fn objects<'a>(mut section: Section<'a>, problems: &'a Problems) -> Option<Objects> {
    let missing = optional(section.get("missing"), |entry| each(&entry, pattern));
    let constant = optional(section.get("constant"), |entry| each(&entry, pattern));
    let keys = |text: &str| Some(pattern_of(text)?.first());
    let values = ("objects.values", section.get("values"));
    let values = keyed(values, problems, (keys, ADDRESSES), |entry| entry.integer(-(1 << 31)..1 << 32));
    section.finish();
    Some(Objects {
        missing: missing?.unwrap_or_default(),
        constant: constant?.unwrap_or_default(),
        values: values?,
    })
}

const ADDRESSES: &str = "an index of four hexadecimal digits, or index and sub-index: \"1006\", \"1029:1\"";

fn pattern(entry: &Entry<'_>) -> Option<ObjectPattern> {
    let text = entry.text()?;
    let pattern = pattern_of(text);
    if pattern.is_none() {
        entry.report_range(format!("{text:?}"), ADDRESSES.to_owned());
    }
    pattern
}

/// Reads an object; an index alone is sub-index 0.
fn address(entry: &Entry<'_>) -> Option<ObjectAddress> {
    pattern(entry).map(ObjectPattern::first)
}

/// Reads `"1006"` or `"1029:1"`, in hexadecimal.
fn pattern_of(text: &str) -> Option<ObjectPattern> {
    let (index, subindex) = match text.split_once(':') {
        Some((index, subindex)) => (index, Some(subindex)),
        None => (text, None),
    };
    let index = hexadecimal(index)?;
    Some(match subindex {
        None => ObjectPattern::Index(index),
        Some(subindex) => {
            ObjectPattern::Address(ObjectAddress::new(index, u8::from_str_radix(subindex, 16).ok()?))
        }
    })
}

fn turn_count(mut section: Section<'_>) -> Option<Option<TurnCount>> {
    let lost = optional(section.get("lost"), |entry| {
        let text = entry.text()?;
        let code = hexadecimal(text);
        if code.is_none() {
            entry.report_range(format!("{text:?}"), "an error code of four hexadecimal digits".to_owned());
        }
        code
    });
    if lost.flatten().is_some() {
        section.require("clear", "the object that clears the turn count when 1 is written to it");
    }
    let clear = optional(section.get("clear"), |entry| address(&entry));
    section.finish();
    let (clear, lost) = (clear?, lost?);
    Some(clear.map(|clear| TurnCount { clear, lost }))
}

fn statusword(mut section: Section<'_>) -> Option<[u16; 4]> {
    let bits = |entry: Entry<'_>| u16::try_from(entry.integer(0..1 << 16)?).ok();
    let read = ["set", "clear", "set_disabled", "set_in_some"].map(|key| optional(section.get(key), bits));
    section.finish();
    let [set, clear, set_disabled, set_in_some] = read;
    Some([set?, clear?, set_disabled?, set_in_some?].map(Option::unwrap_or_default))
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
    let fault_reset_ns = optional(section.get("fault_reset"), delay);
    section.finish();
    Some(Delays {
        boot_up_ns: boot_up_ns?,
        first_pdo_ns: first_pdo_ns?,
        sdo_reply_ns: sdo_reply_ns?,
        mode_change_ns: mode_change_ns?,
        save_ns: save_ns?,
        fault_reset_ns: fault_reset_ns?,
    })
}

const ERROR_CODES: &str =
    "an error code (object 603F) of four hexadecimal digits: 8611 = \"following error\"";

fn hexadecimal(text: &str) -> Option<u16> {
    (text.len() == 4).then(|| u16::from_str_radix(text, 16).ok()).flatten()
}
