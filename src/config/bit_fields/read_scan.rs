//! Reads the section `[scan]` of a description.

use takt_rt::Id;
use takt_wire::bit_fields::{
    DescribedHeartbeat, DescribedScan, HeartbeatScan, RegisterByte, RegisterFrame, RegisterProtocol,
    RegisterScan, Setting,
};

use super::shipped::register_file;
use super::values::{expression, two};
use crate::config::data_file::each;
use crate::config::read::entry::Entry;
use crate::config::read::section::Section;

/// The numbers of registers.
const REGISTERS: std::ops::Range<i64> = 0..256;
/// The bytes of a frame.
const BYTES: std::ops::Range<i64> = 0..256;
/// What a register can have.
const VALUES: std::ops::Range<i64> = 0..1 << 32;
/// The keys of the two ways to be found.
const OF_REGISTERS: [&str; 7] = ["request", "reply", "master_id", "mode", "mode_is", "firmware", "settings"];
/// The keys of registers that takt does not know.
const OF_PROTOCOL: [&str; 6] = ["request", "reply", "master_id", "mode", "firmware", "settings"];
const OF_HEARTBEAT: [&str; 3] = ["bytes", "identifiers", "harmed_by"];

#[derive(Clone, Copy)]
enum FoundBy {
    Registers,
    Heartbeat,
}

/// Reads how the drives of a make are found. `heartbeat` is that of the description.
pub(super) fn scan(
    mut section: Section<'_>,
    heartbeat: Option<&DescribedHeartbeat>,
) -> Option<DescribedScan> {
    let by = section.require("by", "by what such a drive is found: by = \"registers\" or \"heartbeat\"");
    let words = [("registers", FoundBy::Registers), ("heartbeat", FoundBy::Heartbeat)];
    let by = by.and_then(|entry| entry.choice(&words));
    let name = section.require("name", "the name of the protocol: name = \"Acme registers\"");
    let name = name.and_then(|entry| entry.text()).map(str::to_owned);
    let scan = match by {
        Some(FoundBy::Registers) => registers(&mut section, name).map(DescribedScan::Registers),
        Some(FoundBy::Heartbeat) => heartbeats(&mut section, name, heartbeat).map(DescribedScan::Heartbeat),
        None => {
            // What else is there belongs to one of the two.
            OF_REGISTERS.into_iter().chain(OF_HEARTBEAT).for_each(|key| drop(section.get(key)));
            None
        }
    };
    section.finish();
    scan
}

fn byte(entry: &Entry<'_>) -> Option<u8> {
    entry.integer(BYTES).and_then(|byte| u8::try_from(byte).ok())
}

fn register(entry: &Entry<'_>) -> Option<u8> {
    entry.integer(REGISTERS).and_then(|register| u8::try_from(register).ok())
}

fn registers(section: &mut Section<'_>, name: Option<String>) -> Option<RegisterScan> {
    let mode_is =
        section.require("mode_is", "what that register has in the mode of this description: mode_is = 1");
    let mode_is = mode_is.and_then(|entry| entry.integer(VALUES)).and_then(|value| u32::try_from(value).ok());
    // The registers of a make that takt knows need not be said again.
    if let Some(file) = name.as_deref().and_then(register_file)
        && !OF_PROTOCOL.into_iter().any(|key| section.get(key).is_some())
    {
        return Some(RegisterScan { protocol: file.protocol, mode_is: mode_is? });
    }
    section.require("request", "the frame that reads a register: request = { id = \"0x7FF\", bytes = […] }");
    section.require("reply", "the answer: reply = { id = \"master\", bytes = […] }");
    let [request, reply] = exchange(section);
    let master_id = section.require("master_id", "the register with the master ID: master_id = 7");
    let mode = section.require("mode", "the register with the mode: mode = 10");
    let firmware = section.get("firmware").map(|entry| register(&entry));
    let [master_id, mode] = [master_id, mode].map(|entry| entry.and_then(|entry| register(&entry)));
    let settings = settings(section.section("settings"));
    let (request, reply) = (request??, reply??);
    check_reading(section, &request, &reply);
    let protocol = RegisterProtocol {
        name: name?,
        request,
        reply,
        master_id: master_id?,
        mode: mode?,
        firmware: match firmware {
            None => None,
            Some(firmware) => Some(firmware?),
        },
        settings: settings?,
    };
    Some(RegisterScan { protocol, mode_is: mode_is? })
}

/// The frames `request` and `reply`, as far as they are there.
pub(super) fn exchange(section: &mut Section<'_>) -> [Option<Option<RegisterFrame>>; 2] {
    let mut frame = |key| section.get(key).is_some().then(|| register_frame(section.section(key)));
    ["request", "reply"].map(&mut frame)
}

/// Reports frames by which no register is read.
pub(super) fn check_reading(section: &Section<'_>, request: &RegisterFrame, reply: &RegisterFrame) {
    if !tells(request, RegisterByte::Register, 1) || tells(request, RegisterByte::Value, 1) {
        section.spot("request").report_range(
            "bytes without \"register\", or with \"value\"".to_owned(),
            "a frame that reads: \"register\" once, and no \"value\"".to_owned(),
        );
    }
    let has_all = [RegisterByte::Motor, RegisterByte::Register].into_iter().all(|byte| tells(reply, byte, 1));
    if !has_all || !tells(reply, RegisterByte::Value, 4) {
        section.spot("reply").report_range(
            "bytes that do not tell which drive and register they are of, and what it has".to_owned(),
            "\"motor\", \"register\" and four times \"value\"".to_owned(),
        );
    }
}

/// Returns `true` if so many bytes of a frame tell this.
fn tells(frame: &RegisterFrame, what: RegisterByte, times: usize) -> bool {
    frame.payload.iter().filter(|byte| **byte == what).count() == times
}

pub(super) fn register_frame(mut section: Section<'_>) -> Option<RegisterFrame> {
    let id = section.require("id", "its identifier: id = \"0x7FF\"");
    let id = id.and_then(|entry| expression(&entry, false));
    let bytes = section
        .require("bytes", "its eight bytes: bytes = [\"motor\", 0, 0x33, \"register\", 0, 0, 0, 0]")
        .and_then(|entry| payload(&entry));
    section.finish();
    Some(RegisterFrame { id: id?, payload: bytes? })
}

fn payload(entry: &Entry<'_>) -> Option<[RegisterByte; 8]> {
    let words = [
        ("motor", RegisterByte::Motor),
        ("register", RegisterByte::Register),
        ("value", RegisterByte::Value),
        ("any", RegisterByte::Any),
    ];
    let read = |entry: &Entry<'_>| match entry.is_bare_number() {
        true => byte(entry).map(RegisterByte::Byte),
        false => entry.choice(&words),
    };
    let bytes = each(entry, read)?;
    let given = bytes.len();
    let payload = bytes.try_into().ok();
    if payload.is_none() {
        entry.report_range(format!("{given} bytes"), "eight bytes".to_owned());
    }
    payload
}

/// The registers with numbers that a configuration has to give.
fn settings(mut section: Section<'_>) -> Option<Vec<(Setting, u8)>> {
    let given = Setting::ALL.into_iter().filter_map(|(key, setting)| Some((setting, section.get(key)?)));
    let read: Vec<_> = given.map(|(setting, entry)| Some((setting, register(&entry)?))).collect();
    section.finish();
    read.into_iter().collect()
}

fn heartbeats(
    section: &mut Section<'_>,
    name: Option<String>,
    heartbeat: Option<&DescribedHeartbeat>,
) -> Option<HeartbeatScan> {
    let bytes = section
        .require("bytes", "the lowest and the highest value of each byte: bytes = [[0, 255], [1, 15]]");
    let range = |entry: &Entry<'_>| {
        let (lowest, highest) = two(entry, BYTES)?;
        Some(u8::try_from(lowest).ok()?..=u8::try_from(highest).ok()?)
    };
    let bytes = bytes.and_then(|entry| each(&entry, range));
    let says = "the lowest and the highest identifier of a drive: identifiers = [\"32 * motor\", \"32 * motor + 31\"]";
    let identifiers = section.require("identifiers", says);
    let identifiers = identifiers.and_then(|entry| each(&entry, |entry| expression(entry, false)));
    let identifiers = identifiers.map(|both| {
        let given = both.len();
        both.try_into().map_err(|_| {
            section.spot("identifiers").report_range(format!("{given} of them"), "two".to_owned())
        })
    });
    let base =
        |entry: &Entry<'_>| entry.integer(0..0x800).and_then(|id| Id::base(u32::try_from(id).ok()?).ok());
    let harmed_by = section.get("harmed_by").map(|entry| each(&entry, base));
    let bytes = bytes?;
    if heartbeat.is_none_or(|heartbeat| heartbeat.bytes != bytes.len()) {
        section.spot("bytes").report_range(
            format!("{} bytes", bytes.len()),
            "as many as the `heartbeat` of the description has".to_owned(),
        );
    }
    Some(HeartbeatScan {
        name: name?,
        bytes,
        identifiers: identifiers?.ok()?,
        harmed_by: harmed_by.unwrap_or(Some(vec![]))?,
    })
}
