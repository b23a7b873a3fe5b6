//! eRob's Modbus-RTU against what the manual prints: its frames, and its table of registers.

use crate::rows::columns;
use takt::family::erob_modbus::register::{Number, Register};
use takt::family::erob_modbus::registers;
use takt_wire::erob_can::parameter::{Access, Unit};
use takt_wire::modbus::frame::{
    Received, ReceivedRequest, RegisterRange, RegisterValues, Reply, Request, SlaveAddress, evaluate,
    reply_frame,
};

const VECTORS: &str = include_str!("../vectors/erob-modbus-vectors.csv");
const REGISTERS: &str = include_str!("../vectors/erob-modbus-registers.csv");

/// A frame as the manual prints it.
struct Printed {
    id: String,
    slave: SlaveAddress,
    is_request: bool,
    frame: Vec<u8>,
    function: u8,
    meaning: String,
    value: i64,
    is_misprint: bool,
}

fn hexadecimal(text: &str) -> u16 {
    u16::from_str_radix(text.trim_start_matches("0x"), 16).unwrap()
}

fn printed() -> Vec<Printed> {
    let rows = VECTORS.lines().skip(1).map(columns);
    rows.map(|row| Printed {
        slave: SlaveAddress::new(row[2].parse().unwrap()).unwrap(),
        is_request: row[3] == "request",
        frame: row[4].split_whitespace().map(|byte| hexadecimal(byte) as u8).collect(),
        function: hexadecimal(&row[5]) as u8,
        meaning: row[6].clone(),
        value: row[7].parse().unwrap(),
        is_misprint: row[8].starts_with("MISPRINT"),
        id: row[0].clone(),
    })
    .collect()
}

impl Printed {
    /// The register that a request is about: the first address in its words.
    fn register(&self) -> &'static Register {
        let at = self.meaning.find("0x").unwrap();
        let address = hexadecimal(&self.meaning[at..at + 6]);
        registers::find(address).unwrap_or_else(|| panic!("{}: {}", self.id, self.meaning))
    }

    /// The request that the words describe: `write 2 registers 0x0043..0x0044 target absolute position = 500000 count`.
    fn request(&self) -> Request {
        let register = self.register();
        match self.function {
            3 => Request::Read(RegisterRange::new(register.address, self.value as u16).unwrap()),
            6 => {
                let words = register.encode(self.value).unwrap();
                Request::WriteOne { register: register.address, value: words[0] }
            }
            _ => {
                let words = register.encode(self.value).unwrap();
                Request::WriteSeveral(RegisterValues::new(register.address, &words).unwrap())
            }
        }
    }
}

#[test]
fn every_request_of_the_manual_is_encoded_and_decoded() {
    let rows = printed();
    let requests: Vec<&Printed> = rows.iter().filter(|row| row.is_request && !row.is_misprint).collect();
    assert_eq!(requests.len(), 78);
    for row in requests {
        let request = row.request();
        assert_eq!(request.frame(row.slave), row.frame, "{}: {}", row.id, row.meaning);
        assert_eq!(
            row.register().number.words() == 2,
            request.frame(row.slave).len() == 13
                || matches!(&request, Request::Read(range) if range.count() == 2),
            "{}",
            row.id
        );
        let received = ReceivedRequest { address: row.slave.number(), request: Ok(request) };
        assert_eq!(ReceivedRequest::decode(&row.frame), Some(received), "{}", row.id);
    }
}

#[test]
fn every_reply_of_the_manual_is_decoded_and_encoded() {
    let rows = printed();
    let pairs: Vec<&[Printed]> = rows.chunks(2).filter(|pair| !pair[0].is_misprint).collect();
    assert_eq!(pairs.len(), 78);
    for pair in pairs {
        let [request, reply] = pair else { panic!("a request without a reply") };
        assert!(request.is_request && !reply.is_request, "{}", reply.id);
        let register = request.register();
        let words = match request.function {
            3 => register.encode(reply.value).unwrap(),
            _ => Default::default(),
        };
        let expected = match request.function {
            3 => Reply::Values(words.iter().copied().collect()),
            _ => Reply::Written,
        };
        let asked = request.request();
        assert_eq!(
            evaluate(&asked, reply.slave, &reply.frame),
            Received::Whole(Ok(expected)),
            "{}",
            reply.id
        );
        assert_eq!(reply_frame(&request.frame, Ok(&words)).as_ref(), Some(&reply.frame), "{}", reply.id);
        if let (3, Received::Whole(Ok(Reply::Values(values)))) =
            (request.function, evaluate(&asked, reply.slave, &reply.frame))
        {
            assert_eq!(register.decode(&values), Some(reply.value), "{}", reply.id);
        }
    }
}

#[test]
fn the_misprints_of_the_manual_are_refused() {
    let rows = printed();
    let misprints: Vec<&Printed> = rows.iter().filter(|row| row.is_misprint).collect();
    assert_eq!(misprints.len(), 6);
    for pair in misprints.chunks(2) {
        assert_eq!(ReceivedRequest::decode(&pair[0].frame), None, "{}", pair[0].id);
        let outcome = evaluate(&pair[0].request(), pair[1].slave, &pair[1].frame);
        assert!(matches!(outcome, Received::Whole(Err(_))), "{}", pair[1].id);
    }
}

#[test]
fn the_table_has_every_register_of_the_manual_with_its_access_its_width_and_its_unit() {
    let rows: Vec<Vec<String>> = REGISTERS.lines().skip(1).map(columns).collect();
    assert_eq!(rows.len(), registers::ALL.len());
    for row in &rows {
        let register =
            registers::find(hexadecimal(&row[0])).unwrap_or_else(|| panic!("{} is missing", row[0]));
        let access = match row[3].as_str() {
            "R" => Access::Read,
            "R/W" => Access::ReadWrite,
            "W" => Access::CommandWithArgument,
            other => panic!("{other}"),
        };
        let number = match (row[5].as_str(), row[6].as_str()) {
            ("1", "no") => Number::Word,
            ("1", "yes") => Number::SignedWord,
            ("2", "no") => Number::Double,
            ("2", "yes") => Number::SignedDouble,
            other => panic!("{other:?}"),
        };
        assert_eq!(
            (register.access, register.number, register.unit),
            (access, number, unit(&row[4], register)),
            "{register}"
        );
        assert_eq!(row[7] == "high-first", number.words() == 2, "{register}");
    }
}

fn unit(text: &str, register: &Register) -> Unit {
    match text {
        "" | "enum" | "code (printed unit: bps)" => Unit::None,
        // The table calls positions, distances and the counts of the encoders alike.
        "count" => match register.address {
            0x0045 | 0x0068 | 0x0079 | 0x00B9 => Unit::DistanceCounts,
            0x007D => Unit::EncoderCounts,
            _ => Unit::Counts,
        },
        "count/s" => Unit::CountsPerSecond,
        "count/s^2" => Unit::CountsPerSecondSquared,
        "mA" => Unit::Milliamperes,
        "mV" => Unit::Millivolts,
        "ms" => Unit::Milliseconds,
        "0.05 ms" => Unit::FiftyMicroseconds,
        "degC" => Unit::Celsius,
        "mNm" => Unit::MillinewtonMetres,
        other => panic!("{other}"),
    }
}
