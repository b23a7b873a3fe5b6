//! The scan of a serial line: Modbus slaves, one address after the other.

use std::ops::RangeInclusive;

use takt_rt::Nanoseconds;
use takt_wire::modbus::frame::{RegisterRange, SlaveAddress};
use takt_wire::modbus::line_timing::LineTiming;
use takt_wire::modbus::master::{MasterTiming, RequestError, RequestFailure};

use super::Scanned;
use super::device::{Answered, FoundDevice};
use crate::family;
use crate::family::commission::Failure;
use crate::procedure::{ModbusClient, ModbusSession, Procedure};

/// The address before the session turns to those that are asked.
const FIRST: SlaveAddress = match SlaveAddress::new(1) {
    Some(address) => address,
    None => unreachable!(),
};

/// What is asked on a serial line.
#[derive(Clone, Debug)]
pub struct LineScan {
    /// The slave addresses that are asked.
    pub nodes: RangeInclusive<u8>,
    /// bit/s
    pub bit_rate: u32,
    /// How long an answer is awaited.
    pub wait_ns: Nanoseconds,
}

/// The procedure of a scan. It never fails: interrupted, it ends with what it has found so far.
pub fn scan_line(scan: LineScan) -> Procedure<ModbusClient, Scanned, Failure> {
    let LineScan { nodes, bit_rate, wait_ns } = scan;
    let timing = MasterTiming {
        reply_timeout_ns: wait_ns,
        // A reply that comes later still would be taken for that of the next address, and is refused by its own.
        late_reply_ns: wait_ns / 4,
        retries: 0,
        ..MasterTiming::new(LineTiming::new(bit_rate))
    };
    let addresses: Vec<SlaveAddress> = nodes.filter_map(SlaveAddress::new).collect();
    let session = ModbusSession::new(ModbusClient::new(FIRST, timing));
    let work = session.clone();
    Procedure::new(session, async move { Ok(carry_out(&work, &addresses, bit_rate).await) })
}

async fn carry_out(session: &ModbusSession, addresses: &[SlaveAddress], bit_rate: u32) -> Scanned {
    let mut found = Scanned::default();
    let count = |number: usize| u32::try_from(number).unwrap_or(u32::MAX);
    session.step("Modbus-RTU");
    for (done, slave) in addresses.iter().enumerate() {
        if session.is_interrupted() {
            found.is_interrupted = true;
            break;
        }
        session.turn_to(*slave);
        match presence(session).await {
            Presence::Absent => {}
            Presence::Answers(answer) => found.devices.push(read(session, bit_rate, answer).await),
            Presence::Damaged(words) => found.remarks.push(format!(
                "something answered address {slave}, and it could not be read ({words}): two slaves may have this address, or the \
                 bit rate is another one"
            )),
            Presence::NoSilence(words) => {
                found.remarks.push(words);
                break;
            }
        }
        session.progress(count(done + 1), count(addresses.len()));
    }
    found
}

/// Whether a slave is there.
enum Presence {
    Absent,
    /// It is: with a value, or by refusing with these words.
    Answers(Option<String>),
    Damaged(String),
    NoSilence(String),
}

/// Reads one register, which changes nothing in any slave.
async fn presence(session: &ModbusSession) -> Presence {
    // Register 0 is one.
    let Some(range) = RegisterRange::new(0, 1) else { return Presence::Absent };
    let Err(RequestError { failure, .. }) = session.read_registers(range).await else {
        return Presence::Answers(None);
    };
    match failure {
        RequestFailure::NoReply => Presence::Absent,
        RequestFailure::Refused(code) => Presence::Answers(Some(code.to_string())),
        RequestFailure::IncompleteReply { .. } | RequestFailure::WrongReply(_) => {
            Presence::Damaged(failure.to_string())
        }
        RequestFailure::NoSilence => Presence::NoSilence(failure.to_string()),
    }
}

/// Asks the families whether a slave that has answered is one of their drives.
async fn read(session: &ModbusSession, bit_rate: u32, refusal: Option<String>) -> FoundDevice {
    session.step("read the registers");
    for family in family::all() {
        if let Some(looks) = family.recognises_on_line(session, bit_rate)
            && let Some(device) = looks.await
        {
            return device;
        }
    }
    let node = session.slave().number();
    let mut device = FoundDevice::new(Some(node), Answered::Modbus { bit_rate }, "Modbus slave");
    device.remark(match refusal {
        Some(words) => format!("it is no drive that takt knows; register 0 is refused: {words}"),
        None => "it is no drive that takt knows".to_owned(),
    });
    device
}
