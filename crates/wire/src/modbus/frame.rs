//! Requests and replies on the wire. Frames are made and their CRC is checked by `rmodbus`; what it leaves to its users is checked
//! here: lengths, counts, and whether a reply belongs to the request.

use std::fmt;

use rmodbus::client::ModbusRequest;
use rmodbus::consts::{ModbusErrorCode, ModbusFunction};
use rmodbus::server::{ModbusFrame, Read, Write};
use rmodbus::{ErrorKind, ModbusProto, guess_request_frame_len};

use super::exception::ExceptionCode;

/// The most registers of one read. Longer replies do not fit into a frame.
pub const MOST_READ: usize = 125;
/// The most registers of one write.
pub const MOST_WRITTEN: usize = 123;
/// The shortest frame: address, function, exception code and CRC.
const SHORTEST: usize = 5;
/// The bit of the function in a reply that tells of an exception.
const EXCEPTION: u8 = 0x80;

/// The values of registers that follow each other.
pub type Values = Vec<u16>;

/// The address of a slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SlaveAddress(u8);

impl SlaveAddress {
    /// The address 1 to 247; the others are reserved, and 0 calls every slave at once.
    pub const fn new(address: u8) -> Option<Self> {
        if matches!(address, 1..=247) { Some(Self(address)) } else { None }
    }

    /// The number.
    pub const fn number(self) -> u8 {
        self.0
    }
}

impl fmt::Display for SlaveAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Registers that follow each other: 1 to 125, all of them with an address of 16 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RegisterRange {
    start: u16,
    count: u16,
}

impl RegisterRange {
    /// Registers from an address on; `None` if that are none, too many, or more than there are addresses.
    pub const fn new(start: u16, count: u16) -> Option<Self> {
        let is_possible = count > 0 && count as usize <= MOST_READ && start.checked_add(count - 1).is_some();
        if is_possible { Some(Self { start, count }) } else { None }
    }

    /// The first address.
    pub const fn start(self) -> u16 {
        self.start
    }

    /// How many there are.
    pub const fn count(self) -> u16 {
        self.count
    }
}

/// Values for registers that follow each other: 1 to 123.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RegisterValues {
    start: u16,
    values: Values,
}

impl RegisterValues {
    /// Values for the registers from an address on; `None` if that are none, too many, or more than there are addresses.
    pub fn new(start: u16, values: &[u16]) -> Option<Self> {
        let count = u16::try_from(values.len()).ok().filter(|_| values.len() <= MOST_WRITTEN)?;
        RegisterRange::new(start, count).map(|_| Self { start, values: values.to_vec() })
    }

    /// The first address.
    pub const fn start(&self) -> u16 {
        self.start
    }

    /// The values.
    pub fn values(&self) -> &[u16] {
        &self.values
    }
}

/// A request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Function 03: reads holding registers.
    Read(RegisterRange),
    /// Function 06: writes one register.
    WriteOne {
        /// Its address.
        register: u16,
        /// Its new value.
        value: u16,
    },
    /// Function 10 (hexadecimal): writes registers that follow each other.
    WriteSeveral(RegisterValues),
}

impl Request {
    const fn function(&self) -> ModbusFunction {
        match self {
            Self::Read(_) => ModbusFunction::GetHoldings,
            Self::WriteOne { .. } => ModbusFunction::SetHolding,
            Self::WriteSeveral(_) => ModbusFunction::SetHoldingsBulk,
        }
    }

    /// The frame of the request to a slave.
    pub fn frame(&self, slave: SlaveAddress) -> Vec<u8> {
        let mut maker = ModbusRequest::new(slave.number(), ModbusProto::Rtu);
        let mut frame = vec![];
        let made = match self {
            Self::Read(range) => maker.generate_get_holdings(range.start, range.count, &mut frame),
            Self::WriteOne { register, value } => maker.generate_set_holding(*register, *value, &mut frame),
            Self::WriteSeveral(write) => {
                maker.generate_set_holdings_bulk(write.start, &write.values, &mut frame)
            }
        };
        // Every request fits into a frame: its range says so.
        debug_assert_eq!(made, Ok(()));
        frame
    }

    /// The length of the reply when the slave does not refuse.
    pub fn reply_length(&self) -> usize {
        match self {
            Self::Read(range) => SHORTEST + 2 * usize::from(range.count),
            Self::WriteOne { .. } | Self::WriteSeveral(_) => 8,
        }
    }
}

impl fmt::Display for Request {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read(RegisterRange { start, count: 1 }) => write!(f, "reading register 0x{start:04X}"),
            Self::Read(RegisterRange { start, count }) => {
                write!(f, "reading {count} registers from 0x{start:04X}")
            }
            Self::WriteOne { register, value } => write!(f, "writing {value} to register 0x{register:04X}"),
            Self::WriteSeveral(RegisterValues { start, values }) => {
                write!(f, "writing {} registers from 0x{start:04X}", values.len())
            }
        }
    }
}

/// A reply that belongs to its request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// What was read.
    Values(Values),
    /// What was to be written is written.
    Written,
    /// The slave refuses.
    Refused(ExceptionCode),
}

/// A reply that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReplyError {
    /// Its CRC is wrong.
    #[error("the reply is damaged: its CRC is wrong")]
    Damaged,
    /// It is of another slave.
    #[error("the reply is of slave {0}")]
    OtherSlave(u8),
    /// It is to another function.
    #[error("the reply is to function {0:02X}")]
    OtherFunction(u8),
    /// It has another length than the request asks for.
    #[error("the reply has another length than was asked for")]
    OtherLength,
    /// It confirms other registers, or another value.
    #[error("the reply confirms something else than was written")]
    OtherContent,
}

/// The progress of a reply that comes byte by byte.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Received {
    /// More bytes must come.
    Partial,
    /// It is complete.
    Whole(Result<Reply, ReplyError>),
}

/// Evaluates the bytes that have come since a request was sent to a slave. What cannot become its reply is refused at once.
pub fn evaluate(request: &Request, slave: SlaveAddress, bytes: &[u8]) -> Received {
    let refused = |error| Received::Whole(Err(error));
    let function = request.function().byte();
    let is_exception = match bytes {
        [] => return Received::Partial,
        [address, ..] if *address != slave.number() => return refused(ReplyError::OtherSlave(*address)),
        [_] => return Received::Partial,
        [_, answered, ..] if *answered == function => false,
        [_, answered, ..] if *answered == function | EXCEPTION => true,
        [_, answered, ..] => return refused(ReplyError::OtherFunction(*answered)),
    };
    let length = if is_exception { SHORTEST } else { request.reply_length() };
    if let (Request::Read(range), Some(count), false) = (request, bytes.get(2), is_exception)
        && usize::from(*count) != 2 * usize::from(range.count)
    {
        return refused(ReplyError::OtherLength);
    }
    match bytes.len() {
        received if received < length => Received::Partial,
        received if received > length => refused(ReplyError::OtherLength),
        _ if !has_valid_crc(bytes) => refused(ReplyError::Damaged),
        _ if is_exception => Received::Whole(Ok(Reply::Refused(ExceptionCode(bytes[2])))),
        _ => Received::Whole(content(request, bytes)),
    }
}

/// The content of a whole reply of the right slave to the right function.
fn content(request: &Request, bytes: &[u8]) -> Result<Reply, ReplyError> {
    let expected = match request {
        Request::Read(_) => {
            let (words, _) = bytes[3..bytes.len() - 2].as_chunks::<2>();
            return Ok(Reply::Values(words.iter().map(|word| u16::from_be_bytes(*word)).collect()));
        }
        Request::WriteOne { register, value } => [*register, *value],
        Request::WriteSeveral(RegisterValues { start, values }) => [*start, values.len() as u16],
    };
    let confirmed = [[bytes[2], bytes[3]], [bytes[4], bytes[5]]].map(u16::from_be_bytes);
    if confirmed == expected { Ok(Reply::Written) } else { Err(ReplyError::OtherContent) }
}

/// Returns `true` if the last two bytes of a frame are the CRC of the others.
fn has_valid_crc(bytes: &[u8]) -> bool {
    let Some(address) = bytes.first() else { return false };
    // The function of this request is one whose reply has no length that would be checked.
    let mut probe = ModbusRequest::new(*address, ModbusProto::Rtu);
    probe.func = ModbusFunction::SetHolding;
    !matches!(probe.parse_ok(bytes), Err(ErrorKind::FrameBroken | ErrorKind::FrameCRCError))
}

/// A request as a slave receives it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReceivedRequest {
    /// The slave that it is for; 0 calls every slave.
    pub address: u8,
    /// What is asked for, or why it is refused at once.
    pub request: Result<Request, ExceptionCode>,
}

impl ReceivedRequest {
    /// The request of a frame; `None` if that is damaged or of another length.
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        if request_length(bytes) != RequestLength::Known(bytes.len()) || !has_valid_crc(bytes) {
            return None;
        }
        let address = bytes[0];
        let mut unused = vec![];
        let mut frame =
            ModbusFrame::new(address, bytes, ModbusProto::Rtu, &mut unused).with_broadcast_units(&[]);
        frame.parse().ok()?;
        let request = match (frame.error, frame.func) {
            (Some(error), _) => Err(ExceptionCode(error.byte())),
            (
                None,
                ModbusFunction::GetHoldings | ModbusFunction::SetHolding | ModbusFunction::SetHoldingsBulk,
            ) => request_of(&mut frame).ok_or(ExceptionCode::ILLEGAL_VALUE),
            (None, _) => Err(ExceptionCode::ILLEGAL_FUNCTION),
        };
        Some(Self { address, request })
    }
}

/// The request of a parsed frame; `None` if its number of registers is impossible.
fn request_of(frame: &mut ModbusFrame<'_, Vec<u8>>) -> Option<Request> {
    let (start, count) = (frame.reg, frame.count);
    match frame.func {
        ModbusFunction::GetHoldings => RegisterRange::new(start, count).map(Request::Read),
        ModbusFunction::SetHolding | ModbusFunction::SetHoldingsBulk => {
            let is_single = frame.func == ModbusFunction::SetHolding;
            let Ok(Write::Words(write)) = frame.get_external_write() else { return None };
            let (words, _) = write.data.as_chunks::<2>();
            let values: Values = words.iter().take(MOST_READ).map(|word| u16::from_be_bytes(*word)).collect();
            if is_single {
                return values.first().map(|value| Request::WriteOne { register: start, value: *value });
            }
            let is_consistent = write.data.len() == 2 * usize::from(count);
            RegisterValues::new(start, &values).filter(|_| is_consistent).map(Request::WriteSeveral)
        }
        _ => None,
    }
}

/// The frame of a slave's reply to the frame of a sound request. `outcome` has the values that were read; none for a write.
/// `None` if the slave has nothing to say: the request was for every slave, or is no request.
pub fn reply_frame(request: &[u8], outcome: Result<&[u16], ExceptionCode>) -> Option<Vec<u8>> {
    // The crate takes nothing but sound frames: others make it panic.
    let ReceivedRequest { address, .. } =
        ReceivedRequest::decode(request).filter(|known| known.address != 0)?;
    let mut reply = vec![];
    let mut frame =
        ModbusFrame::new(address, request, ModbusProto::Rtu, &mut reply).with_broadcast_units(&[]);
    frame.parse().ok()?;
    match outcome {
        Err(code) => frame.error = Some(error_code(code)),
        Ok(values) if frame.error.is_none() => answer(&mut frame, values)?,
        Ok(_) => {}
    }
    frame.finalize_response().ok()?;
    Some(reply)
}

/// A read of more registers than the standard has room for, as some slaves take it: a frame of 126 or 127 registers has up to 259 bytes,
/// not 256.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LongRead {
    /// The slave that it is for.
    pub slave: SlaveAddress,
    /// The first register.
    pub start: u16,
    /// How many registers.
    pub count: u16,
}

impl LongRead {
    /// The most registers: the length of a reply is one byte.
    const MOST: u16 = 127;

    /// The request of a frame; `None` if it is another one, or damaged.
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let [address, function, a, b, c, d, _, _] = *bytes else { return None };
        let (start, count) = (u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d]));
        let is_it = function == ModbusFunction::GetHoldings.byte()
            && (MOST_READ as u16 + 1..=Self::MOST).contains(&count)
            && start.checked_add(count - 1).is_some()
            && has_valid_crc(bytes);
        let slave = SlaveAddress::new(address)?;
        is_it.then_some(Self { slave, start, count })
    }

    /// The reply with these values.
    pub fn reply(&self, values: &[u16]) -> Vec<u8> {
        let mut reply = vec![self.slave.number(), ModbusFunction::GetHoldings.byte(), (2 * self.count) as u8];
        let words = values.iter().take(usize::from(self.count));
        reply.extend(words.flat_map(|value| value.to_be_bytes()));
        let crc = reply.iter().fold(u16::MAX, |crc, byte| {
            (0..8).fold(crc ^ u16::from(*byte), |crc, _| crc >> 1 ^ if crc & 1 == 1 { POLYNOMIAL } else { 0 })
        });
        reply.extend(crc.to_le_bytes());
        reply
    }
}

/// Of the CRC (Modbus over Serial Line 1.02, 6.2.2).
const POLYNOMIAL: u16 = 0xA001;

/// Fills in the reply of a slave that has carried out the request.
fn answer(frame: &mut ModbusFrame<'_, Vec<u8>>, values: &[u16]) -> Option<()> {
    if !frame.readonly {
        return frame.process_external_write(Ok(())).ok();
    }
    let Ok(Read::Words(read)) = frame.get_external_read() else { return None };
    let (words, _) = read.buf.as_chunks_mut::<2>();
    for (word, value) in words.iter_mut().zip(values) {
        *word = value.to_be_bytes();
    }
    Some(())
}

fn error_code(code: ExceptionCode) -> ModbusErrorCode {
    ModbusErrorCode::try_from(code.0).unwrap_or(ModbusErrorCode::SlaveDeviceFailure)
}

/// What is known of the length of a request whose first bytes have come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestLength {
    /// More bytes must come to tell.
    Unknown,
    /// It is so long. A function that is not known is taken for one with two words.
    Known(usize),
    /// No request is so long.
    Impossible,
}

/// The length of a request by its first bytes.
pub fn request_length(bytes: &[u8]) -> RequestLength {
    match guess_request_frame_len(bytes, ModbusProto::Rtu) {
        Ok(length) => RequestLength::Known(length.into()),
        Err(ErrorKind::OOB) => RequestLength::Unknown,
        Err(_) => RequestLength::Impossible,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SLAVE: SlaveAddress = SlaveAddress(7);

    fn read(start: u16, count: u16) -> Request {
        Request::Read(RegisterRange::new(start, count).unwrap())
    }

    fn requests() -> impl Strategy<Value = Request> {
        let values = proptest::collection::vec(any::<u16>(), 1..=MOST_WRITTEN);
        prop_oneof![
            (0u16..60_000, 1..=MOST_READ as u16).prop_map(|(start, count)| read(start, count)),
            (any::<u16>(), any::<u16>()).prop_map(|(register, value)| Request::WriteOne { register, value }),
            (0u16..60_000, values).prop_map(|(start, values)| {
                Request::WriteSeveral(RegisterValues::new(start, &values).unwrap())
            }),
        ]
    }

    /// A sound reply to a request, with these values if it is a read.
    fn reply(request: &Request, value: u16) -> Vec<u8> {
        let values: Values = match request {
            Request::Read(range) => (0..range.count()).map(|_| value).collect(),
            _ => Values::new(),
        };
        reply_frame(&request.frame(SLAVE), Ok(&values)).unwrap()
    }

    proptest! {
        #[test]
        fn every_request_is_received_as_it_was_sent_and_every_reply_too(request in requests(), value: u16) {
            let frame = request.frame(SLAVE);
            let received = ReceivedRequest { address: 7, request: Ok(request.clone()) };
            prop_assert_eq!(ReceivedRequest::decode(&frame), Some(received));
            let reply = reply(&request, value);
            prop_assert_eq!(reply.len(), request.reply_length());
            match evaluate(&request, SLAVE, &reply) {
                Received::Whole(Ok(Reply::Values(values))) => {
                    prop_assert!(values.iter().all(|read| *read == value));
                }
                received => prop_assert_eq!(received, Received::Whole(Ok(Reply::Written))),
            }
        }

        #[test]
        fn a_reply_with_a_flipped_bit_is_never_taken_for_a_sound_one(
            request in requests(), value: u16, at: prop::sample::Index, bit in 0u8..8,
        ) {
            let mut reply = reply(&request, value);
            let at = at.index(reply.len());
            reply[at] ^= 1 << bit;
            prop_assert!(!matches!(evaluate(&request, SLAVE, &reply), Received::Whole(Ok(_))));
        }

        #[test]
        fn any_bytes_are_borne_by_both_sides(
            request in requests(), bytes in proptest::collection::vec(any::<u8>(), 0..300),
        ) {
            if let Received::Whole(Ok(_)) = evaluate(&request, SLAVE, &bytes) {
                prop_assert!(has_valid_crc(&bytes));
            }
            if let Some(received) = ReceivedRequest::decode(&bytes) {
                reply_frame(&bytes, received.request.map(|_| [].as_slice()));
            }
            reply_frame(&bytes, Err(ExceptionCode::BUSY));
        }

        #[test]
        fn the_beginning_of_a_reply_is_waited_for(request in requests(), value: u16, at: prop::sample::Index) {
            let reply = reply(&request, value);
            let at = at.index(reply.len());
            prop_assert_eq!(evaluate(&request, SLAVE, &reply[..at]), Received::Partial);
        }
    }

    #[test]
    fn what_does_not_belong_to_the_request_is_refused_with_its_reason() {
        let request = read(0x66, 2);
        let good = reply(&request, 5);
        let other = |request: &Request, slave: u8| {
            reply_frame(&request.frame(SlaveAddress(slave)), Ok(&[1, 2])).unwrap()
        };
        for (bytes, error) in [
            (other(&request, 8), ReplyError::OtherSlave(8)),
            (other(&read(0x66, 1), 7), ReplyError::OtherLength),
            (other(&Request::WriteOne { register: 1, value: 2 }, 7), ReplyError::OtherFunction(6)),
            ([good.clone(), vec![0]].concat(), ReplyError::OtherLength),
            ([&good[..8], &[good[8] ^ 1]].concat(), ReplyError::Damaged),
        ] {
            assert_eq!(evaluate(&request, SLAVE, &bytes), Received::Whole(Err(error)), "{bytes:02X?}");
        }
        let write = Request::WriteOne { register: 0xF0, value: 1 };
        let another = Request::WriteOne { register: 0xF0, value: 0 }.frame(SLAVE);
        assert_eq!(evaluate(&write, SLAVE, &another), Received::Whole(Err(ReplyError::OtherContent)));
    }

    #[test]
    fn a_refusal_brings_its_code_and_unknown_functions_are_refused() {
        let request = read(0x62, 1);
        let refusal = reply_frame(&request.frame(SLAVE), Err(ExceptionCode::ILLEGAL_ADDRESS)).unwrap();
        assert_eq!(refusal[..3], [7, 0x83, 2]);
        let refused = Reply::Refused(ExceptionCode::ILLEGAL_ADDRESS);
        assert_eq!(evaluate(&request, SLAVE, &refusal), Received::Whole(Ok(refused)));
        // Function 05 with its CRC: the slave has no coils. Function 2B: nobody here knows it.
        for (frame, code) in [
            ([7, 5, 0, 1, 0xFF, 0, 0xDD, 0x9C], ExceptionCode::ILLEGAL_FUNCTION),
            ([7, 0x2B, 0, 0, 0, 0, 0x25, 0xAA], ExceptionCode::ILLEGAL_FUNCTION),
        ] {
            let Some(received) = ReceivedRequest::decode(&frame) else { panic!("the CRC of {frame:02X?}") };
            assert_eq!(received.request, Err(code));
            let reply = reply_frame(&frame, Err(ExceptionCode::ILLEGAL_FUNCTION)).unwrap();
            assert_eq!(reply[..3], [7, frame[1] | 0x80, 1]);
        }
    }

    #[test]
    fn impossible_ranges_are_no_requests() {
        assert_eq!(RegisterRange::new(0, 0), None);
        assert_eq!(RegisterRange::new(0, 126), None);
        assert_eq!(RegisterRange::new(0xFFFF, 2), None);
        assert!(RegisterRange::new(0xFFFF, 1).is_some());
        assert_eq!(RegisterValues::new(0, &[]), None);
        assert_eq!(RegisterValues::new(0, &[0; 124]), None);
        assert_eq!(RegisterValues::new(0xFFFF, &[1, 2]), None);
        assert_eq!((SlaveAddress::new(0), SlaveAddress::new(248)), (None, None));
        // 126 registers, and a write whose length contradicts its count.
        let frame = |body: &[u8]| {
            let mut frame = body.to_vec();
            let probe = |frame: &[u8]| has_valid_crc(frame);
            frame.extend([0, 0]);
            let end = frame.len();
            (0..=u16::MAX).any(|crc| {
                frame[end - 2..].copy_from_slice(&crc.to_le_bytes());
                probe(&frame)
            });
            frame
        };
        for body in [&[7, 3, 0, 0, 0, 126][..], &[7, 3, 0, 0, 0, 0], &[7, 16, 0, 0, 0, 2, 2, 0, 1]] {
            let received = ReceivedRequest::decode(&frame(body)).unwrap();
            assert_eq!(received.request, Err(ExceptionCode::ILLEGAL_VALUE), "{body:02X?}");
        }
    }

    #[test]
    fn a_read_of_more_registers_than_the_standard_has_is_seen_and_answered_with_a_right_crc() {
        let made = |count: u16| {
            let [high, low] = count.to_be_bytes();
            let body = LongRead { slave: SlaveAddress::new(2).unwrap(), start: 0, count: 2 };
            // The CRC of the body of a request is that of a reply with the same bytes.
            let mut bytes = vec![2, 3, 0, 0, high, low];
            let crc = bytes.iter().fold(u16::MAX, |crc, byte| {
                (0..8).fold(crc ^ u16::from(*byte), |crc, _| crc >> 1 ^ if crc & 1 == 1 { 0xA001 } else { 0 })
            });
            bytes.extend(crc.to_le_bytes());
            assert!(has_valid_crc(&body.reply(&[1, 2])));
            bytes
        };
        for (count, is_long) in [(125, false), (126, true), (127, true), (128, false)] {
            assert_eq!(LongRead::decode(&made(count)).is_some(), is_long, "{count}");
        }
        let reply = LongRead::decode(&made(127)).unwrap().reply(&[7; 127]);
        assert_eq!((reply.len(), reply[2]), (259, 254));
        let mut damaged = made(127);
        damaged[7] ^= 1;
        assert_eq!(LongRead::decode(&damaged), None);
    }
}
