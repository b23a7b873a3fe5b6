//! Reads a description with the configuration's reader. Every problem of the file is reported with its line and a remedy.

use std::path::Path;

use takt_rt::{
    BitRange, ByteOrder, CodeRange, CommandValue, FieldBits, FieldMode, FieldValue, FrameFormat, ModeCodes,
    Number, PositionReference, ReplyValue, StateCodes,
};
use takt_wire::bit_fields::{
    Amount, BesideTargetKind, DescribedFrames, DescribedHeartbeat, DescribedLifeCycle, DescribedScale,
    DescribedScan, Description, FieldDescription, FieldDevice, FieldUnit, FixedFrame, FrameDescription,
    PayloadByte, ReplyMoment, Setting, Settings, SetupFrame, SetupNumber, Zeroing,
};
use toml::de::DeTable;

use super::compile::{check_command, check_reply};
use super::read_scan;
use super::shipped;
use super::values::{expression, two};
use crate::config::ConfigError;
use crate::config::bounds::Bounds;
use crate::config::data_file::{self, each, each_of_some, optional};
use crate::config::read::document;
use crate::config::read::entry::Entry;
use crate::config::read::section::Section;
use crate::config::spot::{Problems, Spot};

/// The longest delay and period; a longer one is a mistake in the unit.
const LONGEST_S: f64 = 1.0;
/// The motor IDs that a configuration can give.
const MOTOR_IDS: std::ops::Range<i64> = 1..128;

const COMMAND_VALUES: [(&str, CommandValue); 9] = [
    ("position", CommandValue::Position),
    ("velocity", CommandValue::Velocity),
    ("torque", CommandValue::Torque),
    ("stiffness", CommandValue::Stiffness),
    ("damping", CommandValue::Damping),
    ("mode", CommandValue::Mode),
    ("run", CommandValue::Run),
    ("zero", CommandValue::Zero),
    ("nothing", CommandValue::Nothing),
];
const REPLY_VALUES: [(&str, ReplyValue); 10] = [
    ("position", ReplyValue::Position),
    ("velocity", ReplyValue::Velocity),
    ("torque", ReplyValue::Torque),
    ("temperature", ReplyValue::Temperature),
    ("mode", ReplyValue::Mode),
    ("run", ReplyValue::Run),
    ("error", ReplyValue::Error),
    ("sender", ReplyValue::Sender),
    ("ignored", ReplyValue::Ignored),
    ("state", ReplyValue::State),
];
const NUMBERS: [(&str, Number); 3] =
    [("unsigned", Number::Unsigned), ("signed", Number::Signed), ("float", Number::Float)];
const FORMATS: [(&str, FrameFormat); 3] = [
    ("classic", FrameFormat::Classic),
    ("fd", FrameFormat::Fd),
    ("fd with bit-rate switch", FrameFormat::FdBitRateSwitch),
];
const ORDERS: [(&str, ByteOrder); 2] =
    [("big-endian", ByteOrder::BigEndian), ("little-endian", ByteOrder::LittleEndian)];
const MODES: [(&str, FieldMode); 3] =
    [("position", FieldMode::Position), ("velocity", FieldMode::Velocity), ("torque", FieldMode::Torque)];
const REFERENCES: [(&str, PositionReference); 2] =
    [("zero", PositionReference::Zero), ("present", PositionReference::Present)];
const BESIDE_TARGET: [(&str, BesideTargetKind); 2] =
    [("feed-forward", BesideTargetKind::FeedForward), ("limits", BesideTargetKind::Limits)];
pub(super) const ZEROING: [(&str, Zeroing); 3] = [
    ("when stopped", Zeroing::WhenStopped),
    ("always", Zeroing::Always),
    ("with target", Zeroing::WithTarget),
];
const ERROR_CODES: &str = "an error code, in decimal: 3 = \"over-voltage\"";

/// Reads a description.
///
/// # Errors
/// The file cannot be read, or every problem of its text.
pub fn load(path: &Path) -> Result<Description, ConfigError> {
    data_file::load(path, parse)
}

/// Reads the text of a description. Messages call it `source_name`.
///
/// # Errors
/// Every problem of the text.
pub fn parse(source_name: &str, text: &str) -> Result<Description, ConfigError> {
    document(source_name, text, read)
}

/// Reads every section, even after one has failed.
fn read<'a>(table: &'a DeTable<'a>, problems: &'a Problems) -> Option<Description> {
    let name = Section::new("", 0..0, table, problems).get("like").and_then(|entry| shipped::name(&entry));
    let base = name.map(shipped::table);
    let mut root = Section::new("", 0..0, table, problems).with_defaults(base.as_ref());
    let _ = root.own("like");
    let mut drive_section = root.section("drive");
    let drive = data_file::drive(&mut drive_section);
    drive_section.finish();
    let motor_ids = root.require("motor_ids", "the motor IDs that it may have: motor_ids = [1, 99]");
    let motor_ids = motor_ids.and_then(|entry| two(&entry, MOTOR_IDS));
    let modes = root.require("modes", "the modes that it has: modes = [\"position\", \"torque\"]");
    let modes = modes.and_then(|entry| each_of_some(&entry, "mode", |entry| entry.choice(&MODES)));
    let position_reference = root.get("position_reference").map(|entry| entry.choice(&REFERENCES));
    let wraps = root.get("wraps").map(|entry| entry.boolean());
    let beside = root.require(
        "beside_target",
        "what velocity and torque are while it follows a position: \"feed-forward\" or \"limits\"",
    );
    let beside_target = beside.and_then(|entry| entry.choice(&BESIDE_TARGET));
    let watchdog = root.require(
        "watchdog",
        "whether the drive stops by itself when no more commands come: watchdog = false",
    );
    let has_watchdog = watchdog.and_then(|entry| entry.boolean());
    let reply_moment = reply_moment(&mut root);
    let deaf = optional(root.get("deaf_until_reply"), |entry| entry.boolean());
    let hears = optional(root.get("hears"), |entry| each(&entry, |entry| expression(entry, false)));
    let zeroing = optional(root.get("zeroing"), |entry| entry.choice(&ZEROING));
    let clear_stops = optional(root.get("clear_stops"), |entry| entry.boolean());
    let forgets = optional(root.get("forgets_command"), |entry| entry.boolean());
    let messages = optional(root.get("messages"), |entry| entry.choice(&[("CAN Simple", ())]));
    let has_heartbeat = root.get("heartbeat").is_some();
    let heartbeat = has_heartbeat.then(|| heartbeat(root.section("heartbeat")));
    let states = root.get("states").is_some().then(|| states(root.section("states")));
    let has_scan = root.get("scan").is_some();
    let scan = has_scan.then(|| {
        let heartbeat = heartbeat.as_ref().and_then(Option::as_ref);
        read_scan::scan(root.section("scan"), heartbeat)
    });
    let command_section = root.section("command");
    let (command_spot, reply_section) = (command_section.header_spot(), root.section("reply"));
    let reply_spot = reply_section.header_spot();
    let command = frame(command_section, &COMMAND_VALUES);
    let reply = frame(reply_section, &REPLY_VALUES);
    let life_cycle = life_cycle(root.section("life_cycle"));
    let setup: Vec<_> = root.sections("setup").into_iter().map(setup).collect();
    let bytes_before_setup =
        optional(root.get("reply_bytes_before_setup"), |entry| usize::try_from(entry.integer(1..9)?).ok());
    let error_code = |key: &str| key.parse().ok();
    let errors = data_file::errors(root.get("errors"), problems, error_code, ERROR_CODES);
    root.finish();
    let (lowest, highest) = motor_ids?;
    let scan = match scan {
        None => None,
        Some(scan) => Some(scan?),
    };
    let registers = match &scan {
        Some(DescribedScan::Registers(scan)) => shipped::register_file(&scan.protocol.name),
        _ => None,
    };
    let of_make = registers.as_ref();
    let description = Description {
        drive: drive?,
        motor_ids: u8::try_from(lowest).ok()?..=u8::try_from(highest).ok()?,
        command: command?,
        reply: reply?,
        states: match states {
            None => None,
            Some(states) => Some(states?),
        },
        reply_moment: reply_moment?,
        heartbeat: match heartbeat {
            None => None,
            Some(heartbeat) => Some(heartbeat?),
        },
        scan,
        hears: hears?.or_else(|| of_make.map(|file| file.hears.clone())).unwrap_or_default(),
        is_deaf_until_reply: deaf?.unwrap_or(false),
        zeroing: zeroing?.or_else(|| of_make.map(|file| file.zeroing)).unwrap_or(Zeroing::WhenStopped),
        clear_stops: clear_stops?.or_else(|| of_make.map(|file| file.clear_stops)).unwrap_or(false),
        forgets_command: forgets?.or_else(|| of_make.map(|file| file.forgets_command)).unwrap_or(false),
        speaks_can_simple: messages?.is_some(),
        registers,
        other_modes: vec![],
        life_cycle: life_cycle?,
        setup: setup.into_iter().collect::<Option<_>>()?,
        bytes_before_setup: bytes_before_setup?,
        modes: modes?,
        position_reference: position_reference.unwrap_or(Some(PositionReference::Zero))?,
        wraps: wraps.unwrap_or(Some(false))?,
        beside_target: beside_target?,
        has_watchdog: has_watchdog?,
        errors: errors?,
    };
    check_frames(&description, [&command_spot, &reply_spot]);
    Some(description)
}

/// Reports what no frame can be.
fn check_frames(description: &Description, [command, reply]: [&Spot<'_>; 2]) {
    if description.reply.field(ReplyValue::Position).is_none() {
        reply.report_range(
            "fields without a position".to_owned(),
            "a field with the value \"position\": by it takt sees where the joint is".to_owned(),
        );
    }
    if description.reply.field(ReplyValue::State).is_some() != description.states.is_some() {
        reply.report_range(
            "a field for the state without `states`, or `states` without such a field".to_owned(),
            "both or neither: states = { stopped = 0, running = 1 }".to_owned(),
        );
    }
    // With any full scales: they decide about no place of a field.
    let mut settings = Settings::default();
    Setting::ALL.into_iter().for_each(|(_, setting)| settings.set(setting, 1.0));
    let device = FieldDevice { description: description.clone(), settings };
    let heartbeat = description.heartbeat.as_ref().map(|heartbeat| (reply, &heartbeat.id));
    for highest in [*description.motor_ids.start(), *description.motor_ids.end()] {
        let frames = [(command, &description.command.id), (reply, &description.reply.id)];
        for (spot, id) in frames.into_iter().chain(heartbeat) {
            if id.id(highest, 0x7FF).is_none() && id.id(highest, 0).is_none() {
                spot.report_range(
                    format!("an `id` that has too many bits for motor ID {highest}"),
                    "11 bits, or 29 with `extended = true`".to_owned(),
                );
                return;
            }
        }
    }
    for (spot, result) in [(command, check_command(&device)), (reply, check_reply(&device))] {
        if let Err(error) = result {
            spot.report_range(format!("a frame in which {error}"), "fields that fit it".to_owned());
        }
    }
}

fn heartbeat(mut section: Section<'_>) -> Option<DescribedHeartbeat> {
    let id = section.require("id", "its identifier: id = \"32 * motor + 1\"");
    let id = id.and_then(|entry| expression(&entry, false));
    let bytes = section.require("bytes", "its length: bytes = 8").and_then(|entry| entry.integer(0..9));
    let period = section.require("period", "from one to the next: period = \"100 ms\"");
    let period_ns = period.and_then(|entry| entry.nanoseconds(1e-3..=10.0));
    section.finish();
    Some(DescribedHeartbeat { id: id?, bytes: usize::try_from(bytes?).ok()?, period_ns: period_ns? })
}

fn states(mut section: Section<'_>) -> Option<StateCodes> {
    let mut code = |key, says: &'static str| {
        section
            .require(key, says)
            .and_then(|entry| entry.integer(0..256))
            .and_then(|code| u8::try_from(code).ok())
    };
    let stopped = code("stopped", "the code of a drive without torque: stopped = 0");
    let running = code("running", "the code of a drive with torque: running = 1");
    section.finish();
    Some(StateCodes { stopped: stopped?, running: running? })
}

fn reply_moment(root: &mut Section<'_>) -> Option<ReplyMoment> {
    let mut time = |key| root.get(key).map(|entry: Entry<'_>| entry.nanoseconds(0.0..=LONGEST_S));
    match (time("reply_delay"), time("reply_period")) {
        (None, Some(period_ns)) => Some(ReplyMoment::Cyclic { period_ns: period_ns?.max(1) }),
        (Some(delay_ns), None) => Some(ReplyMoment::AfterCommand { delay_ns: delay_ns? }),
        (None, None) => {
            let says = "how long after a command the reply is ready: reply_delay = \"500 us\"; or, for a drive that reports \
                        by itself, reply_period = \"1 ms\"";
            root.require("reply_delay", says);
            None
        }
        (Some(_), Some(_)) => {
            root.spot("reply_period").report_range(
                "given beside `reply_delay`".to_owned(),
                "one of the two: a drive replies to commands, or reports by itself".to_owned(),
            );
            None
        }
    }
}

fn frame<V: FieldValue>(
    mut section: Section<'_>,
    values: &[(&'static str, V)],
) -> Option<FrameDescription<V>> {
    let extended = section.get("extended").map(|entry| entry.boolean());
    let is_extended = extended.unwrap_or(Some(false)).unwrap_or(false);
    let id = section
        .require("id", "its identifier: id = \"motor\"")
        .and_then(|entry| expression(&entry, is_extended));
    let format = section.get("kind").map(|entry| entry.choice(&FORMATS));
    let bytes = section.require("bytes", "its length: bytes = 8").and_then(|entry| entry.integer(1..17));
    let order = section.require("order", "the order of its bytes: order = \"big-endian\"");
    let order = order.and_then(|entry| entry.choice(&ORDERS));
    section.require("fields", "its fields: fields = [{ value = \"position\", bits = [0, 16] }]");
    let fields: Vec<_> =
        section.sections("fields").into_iter().map(|section| field(section, values)).collect();
    section.finish();
    Some(FrameDescription {
        id: id?,
        format: format.unwrap_or(Some(FrameFormat::Classic))?,
        bytes: usize::try_from(bytes?).ok()?,
        order: order?,
        fields: fields.into_iter().collect::<Option<_>>()?,
    })
}

fn field<V: Copy>(mut section: Section<'_>, values: &[(&'static str, V)]) -> Option<FieldDescription<V>> {
    let value = section.require("value", "what it carries: value = \"position\"");
    let value = value.and_then(|entry| entry.choice(values));
    let bits =
        section.require("bits", "its first bit and its width: bits = [0, 16]").and_then(|entry| bits(&entry));
    let number = section.get("number").map(|entry| entry.choice(&NUMBERS));
    let unit = section.get("unit").map(|entry| entry.choice(&FieldUnit::WORDS));
    let bounds = Bounds::Between(f64::MIN_POSITIVE, 1e15);
    let codes = section.get("codes").map(|entry| entry.number(bounds));
    let are = section.get("are").map(|entry| amount(&entry, bounds));
    let zero = section.get("zero").map(|entry| entry.number(Bounds::Between(-1e15, 1e15)));
    let send = section.get("sends_codes").map(|entry| two(&entry, -(1 << 53)..1 << 53));
    section.finish();
    Some(FieldDescription {
        value: value?,
        bits: bits?,
        number: number.unwrap_or(Some(Number::Unsigned))?,
        scale: DescribedScale {
            codes: codes.unwrap_or(Some(1.0))?,
            are: are.unwrap_or(Some(Amount::Number(1.0)))?,
            unit: unit.unwrap_or(Some(FieldUnit::Codes))?,
            zero: zero.unwrap_or(Some(0.0))?,
        },
        codes: match send {
            None => None,
            Some(codes) => {
                let (lowest, highest) = codes?;
                Some(CodeRange { lowest, highest })
            }
        },
    })
}

/// `[AT, WIDTH]`, or the higher and the lower part: `[[AT, WIDTH], [AT, WIDTH]]`.
fn bits(entry: &Entry<'_>) -> Option<FieldBits> {
    let list = entry.list()?;
    let range = |at: &Entry<'_>, width: &Entry<'_>| {
        let (at, width) = (at.integer(0..128), width.integer(1..65));
        Some(BitRange { at: u16::try_from(at?).ok()?, width: u8::try_from(width?).ok()? })
    };
    let allowed = "its first bit and its width: [0, 16]; or those of its higher and its lower part: [[48, 16], [8, 16]]";
    let refuse = |entry: &Entry<'_>| {
        entry.report_range("a list of something else".to_owned(), allowed.to_owned());
    };
    let pair = |entry: &Entry<'_>| match entry.list()?.as_slice() {
        [at, width] => range(at, width),
        _ => {
            refuse(entry);
            None
        }
    };
    match list.as_slice() {
        [high, low] if high.is_list() && low.is_list() => Some(FieldBits::split(pair(high)?, pair(low)?)),
        [at, width] => Some(FieldBits { high: range(at, width)?, low: None }),
        _ => {
            refuse(entry);
            None
        }
    }
}

/// A number, or the key by which the configuration gives it.
fn amount(entry: &Entry<'_>, bounds: Bounds) -> Option<Amount> {
    if entry.is_bare_number() {
        return entry.number(bounds).map(Amount::Number);
    }
    entry.choice(&Setting::ALL).map(Amount::Setting)
}

/// The keys of the frames that lead a drive through its life.
const OWN_FRAMES: [&str; 7] = ["start", "stop", "zero", "clear", "torque", "velocity", "position"];

fn life_cycle(mut section: Section<'_>) -> Option<DescribedLifeCycle> {
    let by = section.require("by", "by what it is started and stopped: by = \"fields\" or \"frames\"");
    let by = by.and_then(|entry| entry.choice(&[("fields", false), ("frames", true)]));
    let Some(is_by_frames) = by else {
        // What else is there belongs to one of the two.
        for key in OWN_FRAMES.into_iter().chain(["old_id"]) {
            let _ = section.get(key);
        }
        section.finish();
        return None;
    };
    if is_by_frames {
        let frames = frames(&mut section);
        section.finish();
        return frames.map(|frames| DescribedLifeCycle::ByFrames(Box::new(frames)));
    }
    let mut code = |key| section.get(key).map(|entry: Entry<'_>| entry.integer(0..256));
    let codes = ["torque", "velocity", "position"].map(&mut code);
    section.finish();
    let mut read = [0; 3];
    for (to, code) in read.iter_mut().zip(codes) {
        *to = u8::try_from(code.unwrap_or(Some(0))?).ok()?;
    }
    let [torque, velocity, position] = read;
    Some(DescribedLifeCycle::ByFields(ModeCodes { torque, velocity, position }))
}

fn frames(section: &mut Section<'_>) -> Option<DescribedFrames> {
    section.require("start", "the frame that gives torque: start = { id = \"motor\", bytes = […] }");
    section.require("stop", "the frame that takes the torque away: stop = { id = \"motor\", bytes = […] }");
    let mut frame = |key| section.get(key).is_some().then(|| fixed(section.section(key)));
    let [start, stop, zero, clear, torque, velocity, position] = OWN_FRAMES.map(&mut frame);
    let optional = |frame: Option<Option<FixedFrame>>| match frame {
        None => Some(None),
        Some(frame) => frame.map(Some),
    };
    let old_id = data_file::optional(section.get("old_id"), |entry| expression(&entry, false));
    Some(DescribedFrames {
        old_id: old_id?,
        start: start??,
        stop: stop??,
        zero: optional(zero)?,
        clear: optional(clear)?,
        torque: optional(torque)?,
        velocity: optional(velocity)?,
        position: optional(position)?,
    })
}

/// A frame that is always the same, in a table of its own.
fn fixed(mut section: Section<'_>) -> Option<FixedFrame> {
    let frame = fixed_frame(&mut section);
    section.finish();
    frame
}

fn fixed_frame(section: &mut Section<'_>) -> Option<FixedFrame> {
    let extended = section.get("extended").map(|entry| entry.boolean());
    let is_extended = extended.unwrap_or(Some(false)).unwrap_or(false);
    let id = section
        .require("id", "its identifier: id = \"motor\"")
        .and_then(|entry| expression(&entry, is_extended));
    let bytes = section.require("bytes", "its eight bytes: bytes = [255, 255, 255, 255, 255, 255, 255, 252]");
    let payload = bytes.and_then(|entry| payload(&entry));
    Some(FixedFrame { id: id?, payload: payload? })
}

fn payload(entry: &Entry<'_>) -> Option<[PayloadByte; 8]> {
    let words = [("motor", PayloadByte::Motor), ("master", PayloadByte::Master)];
    let list = entry.list()?;
    let bytes: Vec<_> = list
        .iter()
        .map(|entry| match entry.is_bare_number() {
            true => entry.integer(0..256).and_then(|byte| u8::try_from(byte).ok()).map(PayloadByte::Byte),
            false => entry.choice(&words),
        })
        .collect();
    let bytes: Vec<PayloadByte> = bytes.into_iter().collect::<Option<_>>()?;
    let given = bytes.len();
    let payload = bytes.try_into().ok();
    if payload.is_none() {
        entry.report_range(format!("{given} bytes"), "eight bytes".to_owned());
    }
    payload
}

fn setup(mut section: Section<'_>) -> Option<SetupFrame> {
    let frame = fixed_frame(&mut section);
    let at = section.get("number_at").map(|entry| entry.integer(0..5));
    let setting = section.get("setting").map(|entry| entry.choice(&Setting::ALL));
    let number = match (at, setting) {
        (None, None) => Some(None),
        (Some(at), Some(setting)) => at
            .and_then(|at| usize::try_from(at).ok())
            .zip(setting)
            .map(|(at, setting)| Some(SetupNumber { at, setting })),
        _ => {
            section.require("number_at", "the place of the number in the frame, from 0: number_at = 2");
            section.require("setting", "the key by which the configuration gives the number");
            None
        }
    };
    section.finish();
    Some(SetupFrame { frame: frame?, number: number? })
}
