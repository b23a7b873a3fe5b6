//! eRob's own CAN protocol against what the manual prints: its frames, and its table of addresses.

use crate::rows::columns;
use takt_rt::{Frame, Id};
use takt_wire::erob_can::entries::{self, Entry};
use takt_wire::erob_can::frame::{EntryAddress, ReceivedRequest, Reply, Request, replying_node};
use takt_wire::erob_can::parameter::{Access, Parameter, Unit};

const VECTORS: &str = include_str!("../../../../tests/vectors/erob-can.csv");
const OBJECTS: &str = include_str!("../../../../tests/vectors/erob-objects.csv");

fn hexadecimal(text: &str) -> u16 {
    u16::from_str_radix(text, 16).unwrap()
}

/// A frame of the protocol as the manual prints it, without misprints.
struct Printed {
    id: String,
    is_from_host: bool,
    frame: Frame,
    node: u8,
    meaning: String,
    value: Option<i32>,
}

fn printed() -> Vec<Printed> {
    let rows = VECTORS.lines().skip(1).map(columns);
    let own = rows.filter(|row| row[3].starts_with("64") || row[3].starts_with("5C"));
    own.filter(|row| !row[8].starts_with("MISPRINT"))
        .map(|row| {
            let bytes: Vec<u8> = row[4].split_whitespace().map(|byte| hexadecimal(byte) as u8).collect();
            let id = Id::base(hexadecimal(&row[3]).into()).unwrap();
            Printed {
                is_from_host: row[2] == "host->drive",
                frame: Frame::data(id, &bytes).unwrap(),
                node: row[5].parse().unwrap(),
                value: row[7].parse().ok(),
                meaning: row[6].clone(),
                id: row[0].clone(),
            }
        })
        .collect()
}

/// The request that a row describes: `write 0x008A profile velocity = 5566 count/s`.
fn described(row: &Printed) -> Request {
    let words: Vec<&str> = row.meaning.split(' ').collect();
    let number = |word: &str| hexadecimal(word.trim_start_matches("0x"));
    let address = match words[2] {
        "sub" => EntryAddress::sub(number(words[1]), number(words[3])),
        _ => EntryAddress::new(number(words[1])),
    };
    match (words[0], row.value) {
        ("read", _) => Request::Read(address),
        ("write" | "command", Some(value)) => Request::Write(address, value),
        ("command", None) => Request::Command(address),
        _ => panic!("{}: {}", row.id, row.meaning),
    }
}

#[test]
fn every_request_of_the_manual_is_encoded_and_decoded() {
    let rows: Vec<Printed> = printed().into_iter().filter(|row| row.is_from_host).collect();
    assert_eq!(rows.len(), 107);
    for row in rows {
        let request = described(&row);
        assert_eq!(request.frame(row.node), row.frame, "{}: {}", row.id, row.meaning);
        let received = ReceivedRequest { node: row.node, address: request.address(), value: request.value() };
        assert_eq!(ReceivedRequest::decode(&row.frame), Some(received), "{}", row.id);
        let entry = entries::find(request.address()).unwrap_or_else(|| panic!("{}", row.meaning));
        assert_eq!(request.value().map_or(Ok(()), |value| entry.check(value.into())), Ok(()), "{}", row.id);
    }
}

#[test]
fn every_reply_of_the_manual_is_decoded_and_encoded() {
    let rows: Vec<Printed> = printed().into_iter().filter(|row| !row.is_from_host).collect();
    assert_eq!(rows.len(), 106);
    for row in rows {
        let reply = match (row.meaning.split(' ').next(), row.value) {
            (Some("success"), None) => Reply::Done,
            (Some("read"), Some(value)) => Reply::Value(value),
            _ => panic!("{}: {}", row.id, row.meaning),
        };
        assert_eq!(Reply::decode(row.frame.payload()), Some(reply), "{}: {}", row.id, row.meaning);
        assert_eq!(replying_node(&row.frame), Some(row.node));
        assert_eq!(reply.frame(row.node), row.frame);
    }
}

#[test]
fn the_table_has_every_address_of_the_manual_with_its_access_and_unit() {
    let rows: Vec<Vec<String>> = OBJECTS.lines().skip(1).map(columns).collect();
    // Beside them, what a program of the vendor reads and the manual does not list: the difference of the two encoders.
    assert_eq!(rows.len() + 1, entries::ALL.len());
    assert!(entries::ALL.contains(&entries::ENCODER_DIFFERENCE));
    for row in &rows {
        let address = match row[1].as_str() {
            "" => EntryAddress::new(hexadecimal(&row[0])),
            sub => EntryAddress::sub(hexadecimal(&row[0]), hexadecimal(sub)),
        };
        let entry = entries::find(address).unwrap_or_else(|| panic!("{address} is missing"));
        assert_eq!(entry.access, access(row), "{entry}");
        assert_eq!(entry.unit, unit(row, entry), "{entry}");
    }
}

fn access(row: &[String]) -> Access {
    match (row[3].as_str(), row[6].as_str()) {
        ("RO", _) => Access::Read,
        ("RW", _) => Access::ReadWrite,
        ("W" | "", "yes") => Access::CommandWithArgument,
        ("W", "no") => Access::Command,
        // The set-point and its type: written in the procedures, and in no table.
        ("", "") => Access::Write,
        other => panic!("{other:?}"),
    }
}

fn unit(row: &[String], entry: &Entry) -> Unit {
    match row[4].as_str() {
        // An enumeration, whose meanings are times.
        "us" if entry.address == entries::JERK_SETTING.address => Unit::None,
        "" => Unit::None,
        // The table calls positions, distances and the counts of the encoders alike.
        "count" => match entry.address.index {
            0x0054 | 0x0087 | 0x0109 => Unit::DistanceCounts,
            0x009C | 0x009F => Unit::EncoderCounts,
            _ => Unit::Counts,
        },
        "count/s" => Unit::CountsPerSecond,
        "count/s^2" => Unit::CountsPerSecondSquared,
        "mA" => Unit::Milliamperes,
        "mV" => Unit::Millivolts,
        "ms" => Unit::Milliseconds,
        "degC" => Unit::Celsius,
        "bps" => Unit::BitsPerSecond,
        "0.1 %" => Unit::PerMille,
        "mNm" => Unit::MillinewtonMetres,
        other => panic!("{other}"),
    }
}

#[test]
fn every_length_of_a_reply_is_read_as_the_manual_means_it_or_is_none() {
    use takt_wire::erob_can::error_code::ErrorCode;
    let failed = |code| Some(Reply::Failed(Some(code)));
    for (payload, reply) in [
        (&[0x80][..], Some(Reply::Failed(None))),
        (&[0x00, 0x16, 0x3E], failed(ErrorCode::ENABLED)),
        (&[0x00, 0x16, 0x80], failed(ErrorCode::ENABLED)),
        (&[0xFF, 0xFF, 0xD8, 0xF0, 0x3E], Some(Reply::Value(-10_000))),
        (&[0x00, 0x00, 0x00, 0x00, 0x80], Some(Reply::Failed(None))),
        (&[0x00, 0x6F, 0x36, 0x47], None),
        (&[0x36], None),
        (&[0x00, 0x16, 0x00], None),
        (&[0x00, 0x00, 0x00, 0x00, 0x00], None),
        (&[], None),
        (&[0x3E, 0x3E], None),
    ] {
        assert_eq!(Reply::decode(payload), reply, "{payload:02X?}");
    }
}

#[test]
fn frames_of_other_identifiers_and_kinds_belong_to_nobody() {
    let request = Request::Read(entries::ACTUAL_POSITION.address);
    assert_eq!(ReceivedRequest::decode(&request.frame(64)).map(|received| received.node), Some(64));
    for id in [Id::base(0x640), Id::base(0x681), Id::base(0x601)] {
        assert_eq!(ReceivedRequest::decode(&Frame::of(id.unwrap(), [0, 2])), None);
    }
    let extended = Id::extended(0x641).unwrap();
    assert_eq!(ReceivedRequest::decode(&Frame::of(extended, [0, 2])), None);
    assert_eq!(replying_node(&Frame::of(Id::base(0x601).unwrap(), [0x3E])), None);
}
