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
use crate::config::bounds::Bounds;
use crate::config::data_file::{self, each, each_of_some, interned, keyed, optional};
use crate::config::read::document;
use crate::config::read::entry::Entry;
use crate::config::read::section::Section;
use crate::config::spot::Problems;

pub use takt_wire::described_drive::Confirmation;
pub use takt_wire::quirks::{
    Delays, MeasuredObject, MeasuredQuantity, MotionUnit, NamedObject, ObjectPattern, PlausibleTurns,
    PowerUpState, Quirks, QuirkyDrive, Refusal, SimulatedQuirks, TurnCount, VendorProtocol,
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
    let is_silent_if_absent = optional(root.get("silent_if_absent"), |entry| entry.boolean());
    let shows_alarm = optional(root.get("alarm_in_heartbeat"), |entry| entry.boolean());
    let delays = delays(root.section("delays"));
    let errors = data_file::errors(root.get("errors"), problems, hexadecimal, ERROR_CODES);
    let cures = keyed(("cures", root.get("cures")), problems, (hexadecimal, ERROR_CODES), sentence);
    let bit_rate = optional(root.get("bit_rate"), |entry| bit_rate(&entry));
    let plausible = plausible(root.section("plausible"));
    let temperature = optional(root.get("temperature"), |entry| address(&entry));
    let vendor_protocol = vendor_protocol(root.section("vendor_protocol"));
    let if_silent = optional(root.get("if_silent"), |entry| sentence(&entry));
    let instead_of_lss = optional(root.get("instead_of_lss"), |entry| sentence(&entry));
    let refusals = refusals(root.get("refused"), problems);
    let simulated = simulated(root.section("simulation"), problems);
    let has_switches = optional(root.get("reference_switches"), |entry| entry.boolean());
    root.finish();
    let Objects { missing, constant, values, named, keeps_empty_limits } = objects?;
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
        is_silent_if_absent: is_silent_if_absent?.unwrap_or(false),
        shows_alarm_in_heartbeat: shows_alarm?.unwrap_or(false),
        delays: delays?,
        errors: errors?,
        cures: cures?,
        bit_rates: bit_rate?.map_or(&[], std::slice::from_ref),
        keeps_empty_limits,
        plausible: plausible?,
        named,
        temperature: temperature?,
        vendor_protocol: vendor_protocol?,
        if_silent: if_silent?,
        instead_of_lss: instead_of_lss?,
        refusals: refusals?,
        lacks_switches: !has_switches?.unwrap_or(true),
        simulated: simulated?,
    })
}

fn sentence(entry: &Entry<'_>) -> Option<&'static str> {
    entry.text().map(interned)
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
    named: Vec<NamedObject>,
    keeps_empty_limits: bool,
}

fn objects<'a>(mut section: Section<'a>, problems: &'a Problems) -> Option<Objects> {
    let missing = optional(section.get("missing"), |entry| each(&entry, pattern));
    let constant = optional(section.get("constant"), |entry| each(&entry, pattern));
    let keys = |text: &str| Some(pattern_of(text)?.first());
    let values = ("objects.values", section.get("values"));
    let values = keyed(values, problems, (keys, ADDRESSES), |entry| entry.integer(-(1 << 31)..1 << 32));
    let named = ("objects.names", section.get("names"));
    let named = keyed(named, problems, (keys, ADDRESSES), |entry| {
        let (name, unit) = entry.text()?.split_once(": ").unwrap_or((entry.text()?, ""));
        Some((interned(name), interned(unit)))
    });
    let keeps_empty_limits = optional(section.get("keeps_empty_limits"), |entry| entry.boolean());
    section.finish();
    let named = named?.into_iter().map(|(address, (name, unit))| NamedObject { address, name, unit });
    Some(Objects {
        missing: missing?.unwrap_or_default(),
        constant: constant?.unwrap_or_default(),
        values: values?,
        named: named.collect(),
        keeps_empty_limits: keeps_empty_limits?.unwrap_or(false),
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

/// The bit rates of CiA 301.
const BIT_RATES: [u32; 8] = [10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

fn bit_rate(entry: &Entry<'_>) -> Option<&'static u32> {
    let given = entry.integer(0..1 << 32)?;
    let known = BIT_RATES.iter().find(|rate| i64::from(**rate) == given);
    if known.is_none() {
        entry.report_range(given.to_string(), format!("a bit rate of CiA 301: {BIT_RATES:?}"));
    }
    known
}

fn plausible(mut section: Section<'_>) -> Option<PlausibleTurns> {
    let keys = ["fastest_turns_per_s", "usual_turns_per_s", "inner_gear_from"];
    let [fastest_per_s, usual_per_s, inner_gear_from] =
        keys.map(|key| optional(section.get(key), |entry| entry.number(Bounds::Between(1e-3, 1e6))));
    section.finish();
    Some(PlausibleTurns {
        fastest_per_s: fastest_per_s?,
        usual_per_s: usual_per_s?,
        inner_gear_from: inner_gear_from?,
    })
}

fn vendor_protocol(mut section: Section<'_>) -> Option<Option<VendorProtocol>> {
    let name = optional(section.get("name"), |entry| sentence(&entry));
    if name.flatten().is_none() {
        section.finish();
        return name.map(|_| None);
    }
    let id = |entry: Entry<'_>| u16::try_from(entry.integer(1..0x800)?).ok();
    let request = section.require("request", "the identifier of a request that changes nothing").and_then(id);
    let bytes = section.require("bytes", "the first two bytes of that request: bytes = 0x0002");
    let bytes = bytes.and_then(|entry| u16::try_from(entry.integer(0..1 << 16)?).ok());
    let reply = section.require("reply", "the identifier of the reply").and_then(id);
    let last_node = section.require("last_node", "the highest node ID of the protocol");
    let last_node = last_node.and_then(|entry| u8::try_from(entry.integer(1..128)?).ok());
    let cure = section.require("cure", "what to do with a drive that answers it");
    let cure = cure.and_then(|entry| sentence(&entry));
    section.finish();
    Some(Some(VendorProtocol {
        name: name??,
        request: request?,
        bytes: bytes?.to_be_bytes(),
        reply: reply?,
        last_node: last_node?,
        cure: cure?,
    }))
}

/// The commands of `takt drive` that a file can refuse.
const TASKS: [&str; 9] = [
    "zero",
    "restore",
    "set-id",
    "set-bit-rate",
    "release-brake",
    "gains",
    "gear",
    "auto-home",
    "interpolation",
];

/// Reads the tasks that the drive cannot do: `set-id = ["why not", "what to do instead"]`.
fn refusals<'a>(entry: Option<Entry<'a>>, problems: &'a Problems) -> Option<Vec<Refusal>> {
    let words = |entry: &Entry<'a>| {
        let words = each(entry, sentence)?;
        let pair: Option<[&'static str; 2]> = words.try_into().ok();
        if pair.is_none() {
            entry.report_range("another list".to_owned(), "why not, and what to do instead".to_owned());
        }
        pair
    };
    let task = |key: &str| TASKS.into_iter().find(|task| *task == key);
    let allowed = format!("one of {TASKS:?}, which are commands of `takt drive`");
    let refused = keyed(("refused", entry), problems, (task, &allowed), words)?;
    Some(refused.into_iter().map(|(task, [reason, instead])| Refusal { task, reason, instead }).collect())
}

fn simulated<'a>(mut section: Section<'a>, problems: &'a Problems) -> Option<SimulatedQuirks> {
    let switches = [
        "sync_of_any_length",
        "rpdo_timers",
        "remote_pdos",
        "one_abort_code",
        "segmented_uploads",
        "sync_period_first",
        "interpolated_moves",
        "battery",
        "expedited_only",
        "short_sdo_requests",
        "answers_rpdos",
        "silent_power_up",
        "emergencies",
    ];
    let switches = switches.map(|key| optional(section.get(key), |entry| entry.boolean()));
    let torque_per_ampere =
        optional(section.get("torque_per_ampere"), |entry| entry.number(Bounds::Between(1e-6, 1e6)));
    let keys = |text: &str| Some(pattern_of(text)?.first());
    let ranges = ("simulation.ranges", section.get("ranges"));
    let ranges = keyed(ranges, problems, (keys, ADDRESSES), |entry| {
        let bounds: Option<[i64; 2]> =
            each(entry, |entry| entry.integer(-(1 << 31)..1 << 32))?.try_into().ok();
        if bounds.is_none() {
            entry.report_range("another list".to_owned(), "the lowest and the highest value".to_owned());
        }
        bounds
    });
    let choices = ("simulation.choices", section.get("choices"));
    let choices = keyed(choices, problems, (keys, ADDRESSES), |entry| {
        each_of_some(entry, "value", |entry| entry.integer(-(1 << 31)..1 << 32))
    });
    let unsaved = optional(section.get("unsaved"), |entry| each(&entry, pattern));
    let measured = ("simulation.measured", section.get("measured"));
    let measured = keyed(measured, problems, (keys, ADDRESSES), measured_quantity);
    section.finish();
    let [sync, timers, remote, code, uploads, period, moves, battery, ..] = switches;
    let [.., expedited, short, answers, silent, emergencies] = switches;
    let measured = measured?.into_iter();
    Some(SimulatedQuirks {
        takes_any_sync: sync?.unwrap_or(false),
        ignores_rpdo_timers: !timers?.unwrap_or(true),
        refuses_remote_pdos: !remote?.unwrap_or(true),
        has_one_abort_code: code?.unwrap_or(false),
        segments_uploads: uploads?.unwrap_or(false),
        interpolates_over_sync: period?.unwrap_or(false),
        moves_in_interpolation: moves?.unwrap_or(false),
        lacks_battery: !battery?.unwrap_or(true),
        has_expedited_only: expedited?.unwrap_or(false),
        takes_short_requests: short?.unwrap_or(false),
        answers_rpdos: answers?.unwrap_or(false),
        is_power_up_silent: silent?.unwrap_or(false),
        lacks_emergencies: !emergencies?.unwrap_or(true),
        torque_per_ampere: torque_per_ampere?,
        ranges: ranges?,
        choices: choices?,
        unsaved: unsaved?.unwrap_or_default(),
        measured: measured
            .map(|(address, (factor, quantity))| MeasuredObject { address, factor, quantity })
            .collect(),
    })
}

/// Reads `"100 position"` or `"1000 torque"`: the number in the object for one count, or for one N·m.
fn measured_quantity(entry: &Entry<'_>) -> Option<(f64, MeasuredQuantity)> {
    let text = entry.text()?;
    let read = || {
        let (factor, quantity) = text.split_once(' ')?;
        let quantity = match quantity {
            "position" => MeasuredQuantity::Position,
            "torque" => MeasuredQuantity::Torque,
            _ => return None,
        };
        Some((factor.parse().ok()?, quantity))
    };
    let read = read();
    if read.is_none() {
        let allowed = "a factor and \"position\" or \"torque\": \"1000 torque\"".to_owned();
        entry.report_range(format!("{text:?}"), allowed);
    }
    read
}

const ERROR_CODES: &str =
    "an error code (object 603F) of four hexadecimal digits: 8611 = \"following error\"";

fn hexadecimal(text: &str) -> Option<u16> {
    (text.len() == 4).then(|| u16::from_str_radix(text, 16).ok()).flatten()
}
