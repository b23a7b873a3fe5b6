//! Reads a register file: what all drives of a make have in common, and their registers.

use takt_wire::bit_fields::{
    Interval, Register, RegisterExchange, RegisterFile, RegisterFrame, RegisterProtocol, RegisterRole,
    Setting, StoreExchange, Zeroing,
};
use toml::de::DeTable;

use super::read::ZEROING;
use super::read_scan::{check_reading, exchange, register_frame};
use super::values::expression;
use crate::config::ConfigError;
use crate::config::bounds::Bounds;
use crate::config::data_file::{each, optional};
use crate::config::read::document;
use crate::config::read::entry::Entry;
use crate::config::read::section::Section;
use crate::config::spot::Problems;

const NUMBERS: std::ops::Range<i64> = 0..256;
const WORDS: std::ops::Range<i64> = 0..1 << 32;
const KINDS: [(&str, bool); 2] = [("unsigned", false), ("float", true)];
const ROLES: [(&str, RegisterRole); 10] = [
    ("master_id", RegisterRole::MasterId),
    ("motor_id", RegisterRole::MotorId),
    ("mode", RegisterRole::Mode),
    ("timeout", RegisterRole::TimeOut { unit_ns: 0, error: 0 }),
    ("firmware", RegisterRole::Firmware),
    ("bit_rate", RegisterRole::BitRate),
    ("position", RegisterRole::Position),
    ("motor_position", RegisterRole::MotorPosition),
    ("gear_ratio", RegisterRole::GearRatio),
    ("temperature", RegisterRole::Temperature),
];

/// Reads the text of a register file. Messages call it `source_name`.
///
/// # Errors
/// Every problem of the text.
pub fn parse(source_name: &str, text: &str) -> Result<RegisterFile, ConfigError> {
    document(source_name, text, read)
}

fn read<'a>(table: &'a DeTable<'a>, problems: &'a Problems) -> Option<RegisterFile> {
    let mut root = Section::new("", 0..0, table, problems);
    let name = root.require("name", "the name of the protocol: name = \"Acme registers\"");
    let name = name.and_then(|entry| entry.text()).map(str::to_owned);
    let sources = root.require("sources", "the documents that it was taken from: sources = [\"…\"]");
    let sources = sources.and_then(|entry| each(&entry, |entry| entry.text().map(str::to_owned)));
    let hears = optional(root.get("hears"), |entry| each(&entry, |entry| expression(entry, false)));
    let zeroing = optional(root.get("zeroing"), |entry| entry.choice(&ZEROING));
    let clear_stops = optional(root.get("clear_stops"), |entry| entry.boolean());
    let forgets = optional(root.get("forgets_command"), |entry| entry.boolean());
    let bit_rates = optional(root.get("bit_rates"), |entry| each(&entry, bit_rate));
    root.require(
        "registers",
        "the registers: registers = [{ number = 0, name = \"Limit\", is = \"float\" }]",
    );
    let registers: Vec<_> = root.sections("registers").into_iter().map(register).collect();
    let mut of = |key| {
        let is_there = root.get(key).is_some();
        is_there.then(|| both(root.section(key), key == "read"))
    };
    let [reading, writing] = ["read", "write"].map(&mut of);
    let store = root.get("store").is_some().then(|| store(root.section("store")));
    let status = root.get("status").is_some().then(|| {
        let mut section = root.section("status");
        section.require("request", "the frame: request = { id = \"0x7FF\", bytes = […] }");
        let frame = section.get("request").is_some().then(|| register_frame(section.section("request")));
        section.finish();
        frame?
    });
    root.finish();
    sources?;
    let registers: Vec<Register> = registers.into_iter().collect::<Option<_>>()?;
    let RegisterExchange { request, reply } = reading??;
    Some(RegisterFile {
        protocol: protocol(name?, request, reply, &registers)?,
        write: known(writing)?,
        store: known(store)?,
        status: known(status)?,
        hears: hears?.unwrap_or_default(),
        zeroing: zeroing?.unwrap_or(Zeroing::WhenStopped),
        clear_stops: clear_stops?.unwrap_or(false),
        forgets_command: forgets?.unwrap_or(false),
        bit_rates: bit_rates?.unwrap_or_default(),
        registers,
    })
}

/// What is absent is right, what is wrong is not.
fn known<T>(read: Option<Option<T>>) -> Option<Option<T>> {
    match read {
        None => Some(None),
        Some(read) => read.map(Some),
    }
}

/// What a scan reads.
fn protocol(
    name: String,
    request: RegisterFrame,
    reply: RegisterFrame,
    registers: &[Register],
) -> Option<RegisterProtocol> {
    let with = |role| registers.iter().find(|register| register.role == Some(role)).map(|own| own.number);
    let settings = Setting::ALL.into_iter().filter(|(_, setting)| {
        matches!(setting, Setting::PositionFullScale | Setting::VelocityFullScale | Setting::TorqueFullScale)
    });
    Some(RegisterProtocol {
        name,
        request,
        reply,
        master_id: with(RegisterRole::MasterId)?,
        mode: with(RegisterRole::Mode)?,
        firmware: with(RegisterRole::Firmware),
        settings: settings
            .filter_map(|(_, setting)| Some((setting, with(RegisterRole::Setting(setting))?)))
            .collect(),
    })
}

fn both(mut section: Section<'_>, reads: bool) -> Option<RegisterExchange> {
    section.require("request", "the frame: request = { id = \"0x7FF\", bytes = […] }");
    section.require("reply", "the answer: reply = { id = \"master\", bytes = […] }");
    let [request, reply] = exchange(&mut section);
    let exchange = request.flatten().zip(reply.flatten());
    if let Some((request, reply)) = exchange.as_ref().filter(|_| reads) {
        check_reading(&section, request, reply);
    }
    section.finish();
    exchange.map(|(request, reply)| RegisterExchange { request, reply })
}

fn store(mut section: Section<'_>) -> Option<StoreExchange> {
    let bytes = section.require("reply_bytes", "the length of its reply: reply_bytes = 8");
    let bytes = bytes.and_then(|entry| entry.integer(1..9));
    let takes = section.require("takes", "how long it takes: takes = \"30 ms\"");
    let takes = takes.and_then(|entry| entry.nanoseconds(0.0..=10.0));
    Some(StoreExchange {
        exchange: both(section, false)?,
        reply_bytes: usize::try_from(bytes?).ok()?,
        takes_ns: takes?,
    })
}

/// `[CODE, BIT_RATE, DATA_BIT_RATE]`.
fn bit_rate(entry: &Entry<'_>) -> Option<(u32, [u32; 2])> {
    let numbers = each(entry, |entry| entry.integer(WORDS).and_then(|number| u32::try_from(number).ok()))?;
    match numbers.as_slice() {
        [code, nominal, data] => Some((*code, [*nominal, *data])),
        _ => {
            entry.report_range("a list of something else".to_owned(), "a code and two bit rates".to_owned());
            None
        }
    }
}

fn register(mut section: Section<'_>) -> Option<Register> {
    let number = section.require("number", "its number: number = 7").and_then(|entry| entry.integer(NUMBERS));
    let name = section.require("name", "its name: name = \"MST_ID\"").and_then(|entry| entry.text());
    let is_float = section.require("is", "what it is: is = \"float\" or \"unsigned\"");
    let is_float = is_float.and_then(|entry| entry.choice(&KINDS));
    let range = optional(section.get("range"), |entry| interval(&entry));
    let mask = optional(section.get("mask"), |entry| u32::try_from(entry.integer(WORDS)?).ok());
    let value = section.require("value", "what a new drive has: value = 0");
    let value = value.and_then(|entry| entry.number(Bounds::Between(-1e38, 1e38)));
    let role = optional(section.get("role"), |entry| role(&entry));
    let unit = optional(section.get("unit"), |entry| entry.nanoseconds(1e-9..=1.0));
    let error = optional(section.get("error"), |entry| u16::try_from(entry.integer(0..1 << 16)?).ok());
    section.finish();
    let role = match role? {
        Some(RegisterRole::TimeOut { .. }) => Some(RegisterRole::TimeOut { unit_ns: unit??, error: error?? }),
        other => other,
    };
    Some(Register {
        number: u8::try_from(number?).ok()?,
        name: name?.to_owned(),
        is_float: is_float?,
        range: range?,
        mask: mask?.unwrap_or(u32::MAX),
        value: value?,
        role,
    })
}

fn interval(entry: &Entry<'_>) -> Option<Interval> {
    let text = entry.text()?;
    let interval = Interval::parse(text);
    if interval.is_none() {
        entry.report_range(format!("{text:?}"), "an interval: \"(0, 1]\"".to_owned());
    }
    interval
}

/// A word of its own, or the key of a setting.
fn role(entry: &Entry<'_>) -> Option<RegisterRole> {
    let settings = Setting::ALL.map(|(key, setting)| (key, RegisterRole::Setting(setting)));
    let most_current = [("most_current", RegisterRole::MostCurrent)];
    let roles: Vec<_> = ROLES.into_iter().chain(most_current).chain(settings).collect();
    entry.choice(&roles)
}
