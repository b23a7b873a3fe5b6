//! pcapng (IETF draft-ietf-opsawg-pcapng), with the link type of SocketCAN (LINKTYPE_CAN_SOCKETCAN): identifier and flags with the most
//! significant byte first, length, flags of CAN FD, two bytes, data.

use std::io::{self, Read};

use takt_rt::{Frame, FrameKind, Id, NANOSECONDS_PER_SECOND, Nanoseconds};

use super::line::LineItem;
use super::{Direction, LogCondition, LogError, LoggedFrame};

const SECTION_HEADER: u32 = 0x0A0D_0D0A;
const INTERFACE_DESCRIPTION: u32 = 1;
const SIMPLE_PACKET: u32 = 3;
const ENHANCED_PACKET: u32 = 6;
/// The first four bytes of every file, in both byte orders.
pub const MAGIC: [u8; 4] = SECTION_HEADER.to_be_bytes();

const BYTE_ORDER: u32 = 0x1A2B_3C4D;
const LINKTYPE_CAN_SOCKETCAN: u16 = 227;

const OPTION_END: u16 = 0;
const INTERFACE_NAME: u16 = 2;
const INTERFACE_RESOLUTION: u16 = 9;
const PACKET_FLAGS: u16 = 2;
const INBOUND: u32 = 1;
const OUTBOUND: u32 = 2;
const DIRECTION_BITS: u32 = 3;

/// The flags of an identifier: 29 bits, remote frame, message of the controller.
const EXTENDED: u32 = 1 << 31;
const REMOTE: u32 = 1 << 30;
const ERROR: u32 = 1 << 29;
/// The flags of CAN FD.
const FD_BIT_RATE_SWITCH: u8 = 1;
const FD_FORMAT: u8 = 4;

/// Before the data: identifier, length, flags, two bytes.
const HEADER_BYTES: usize = 8;
/// A block of a capture of CAN is far shorter. A longer one means that the file is damaged.
const LONGEST_BLOCK: u32 = 1 << 20;
/// The most interfaces of a file that are told apart.
const MOST_INTERFACES: usize = 1 << 12;

/// Writes the beginning of a file.
pub fn begin(bytes: &mut Vec<u8>) {
    let mut body = BYTE_ORDER.to_le_bytes().to_vec();
    // Version 1.0, and a length that is not said.
    body.extend([1, 0, 0, 0]);
    body.extend(u64::MAX.to_le_bytes());
    block(SECTION_HEADER, &body, bytes);
}

/// Writes an interface; they are counted from 0.
pub fn interface(name: &str, bytes: &mut Vec<u8>) {
    let mut body = LINKTYPE_CAN_SOCKETCAN.to_le_bytes().to_vec();
    // Reserved, and no limit of the length.
    body.extend([0; 6]);
    option(INTERFACE_NAME, name.get(..255).unwrap_or(name).as_bytes(), &mut body);
    // Times are in units of 10^-9 s.
    option(INTERFACE_RESOLUTION, &[9], &mut body);
    option(OPTION_END, &[], &mut body);
    block(INTERFACE_DESCRIPTION, &body, bytes);
}

/// Writes a frame.
pub fn frame(interface: u32, logged: &LoggedFrame<'_>, bytes: &mut Vec<u8>) {
    let packet = packet(&logged.frame);
    let length = (packet.len() as u32).to_le_bytes();
    let mut body = interface.to_le_bytes().to_vec();
    body.extend(((logged.at_ns >> 32) as u32).to_le_bytes());
    body.extend((logged.at_ns as u32).to_le_bytes());
    body.extend(length);
    body.extend(length);
    body.extend(&packet);
    pad(&mut body);
    if let Some(direction) = logged.direction {
        let flags = if direction == Direction::Sent { OUTBOUND } else { INBOUND };
        option(PACKET_FLAGS, &flags.to_le_bytes(), &mut body);
        option(OPTION_END, &[], &mut body);
    }
    block(ENHANCED_PACKET, &body, bytes);
}

fn packet(frame: &Frame) -> Vec<u8> {
    let id = frame.id();
    let extended = if id.is_extended() { EXTENDED } else { 0 };
    let (remote, flags) = match frame.kind() {
        FrameKind::Data => (0, 0),
        FrameKind::Remote => (REMOTE, 0),
        FrameKind::Fd => (0, FD_FORMAT),
        FrameKind::FdBitRateSwitch => (0, FD_FORMAT | FD_BIT_RATE_SWITCH),
    };
    let mut packet = (id.value() | extended | remote).to_be_bytes().to_vec();
    packet.extend([frame.length() as u8, flags, 0, 0]);
    packet.extend(frame.payload());
    packet
}

fn option(code: u16, value: &[u8], body: &mut Vec<u8>) {
    body.extend(code.to_le_bytes());
    body.extend((value.len() as u16).to_le_bytes());
    body.extend(value);
    pad(body);
}

fn pad(body: &mut Vec<u8>) {
    body.resize(body.len().next_multiple_of(4), 0);
}

fn block(kind: u32, body: &[u8], bytes: &mut Vec<u8>) {
    let length = (body.len() as u32 + 12).to_le_bytes();
    bytes.extend(kind.to_le_bytes());
    bytes.extend(length);
    bytes.extend(body);
    bytes.extend(length);
}

/// An interface of a file.
struct Interface {
    /// True if its packets are CAN frames of SocketCAN.
    is_can: bool,
    name: String,
    /// Units of its times in a second.
    per_second: u128,
}

/// Reads a file; its first four bytes have been read.
pub(super) fn read(
    mut file: impl Read,
    visit: &mut dyn FnMut(LineItem<'_>) -> bool,
    condition: &mut LogCondition,
) -> Result<(), LogError> {
    let mut interfaces: Vec<Interface> = vec![];
    let mut order = Order::Little;
    let mut kind = MAGIC;
    let mut number = 0;
    loop {
        let Some(length) = word(&mut file)? else {
            condition.is_cut_off = true;
            return Ok(());
        };
        number += 1;
        let mut body = vec![];
        if kind == MAGIC {
            let Some(magic) = word(&mut file)? else {
                condition.is_cut_off = true;
                return Ok(());
            };
            order = match (u32::from_le_bytes(magic), u32::from_be_bytes(magic)) {
                (BYTE_ORDER, _) => Order::Little,
                (_, BYTE_ORDER) => Order::Big,
                _ => return Err(LogError::Damaged { block: number }),
            };
            body.extend(magic);
            // Each section has its own interfaces.
            interfaces.clear();
        }
        let length = order.u32(length);
        let body_bytes =
            length.checked_sub(12).filter(|_| length.is_multiple_of(4) && length <= LONGEST_BLOCK);
        let Some(rest) = body_bytes.and_then(|bytes| (bytes as usize).checked_sub(body.len())) else {
            return Err(LogError::Damaged { block: number });
        };
        let read = (&mut file).take(rest as u64 + 4).read_to_end(&mut body)?;
        if read < rest + 4 {
            condition.is_cut_off = true;
            return Ok(());
        }
        body.truncate(body.len() - 4);
        let item = match order.u32(kind) {
            INTERFACE_DESCRIPTION if interfaces.len() < MOST_INTERFACES => {
                interfaces.push(interface_of(order, &body));
                None
            }
            ENHANCED_PACKET => Some(enhanced_packet(order, &body, &interfaces)),
            SIMPLE_PACKET => Some(simple_packet(order, &body, &interfaces)),
            _ => None,
        };
        match item {
            None => {}
            Some(Packet::Item(item)) if !visit(item) => return Ok(()),
            Some(Packet::Item(_)) => {}
            Some(Packet::Foreign) => condition.foreign += 1,
            Some(Packet::Malformed) => condition.count_malformed(number, "no frame of SocketCAN".to_owned()),
        }
        let Some(next) = word(&mut file)? else { return Ok(()) };
        kind = next;
    }
}

/// What a packet is.
enum Packet<'a> {
    Item(LineItem<'a>),
    /// It is of another link type.
    Foreign,
    Malformed,
}

/// The next four bytes; `None` at the end of the file.
fn word(file: &mut impl Read) -> io::Result<Option<[u8; 4]>> {
    let mut bytes = Vec::with_capacity(4);
    file.take(4).read_to_end(&mut bytes)?;
    Ok(bytes.try_into().ok())
}

/// The order of the bytes of a section.
#[derive(Clone, Copy)]
enum Order {
    Little,
    Big,
}

impl Order {
    const fn u32(self, bytes: [u8; 4]) -> u32 {
        match self {
            Self::Little => u32::from_le_bytes(bytes),
            Self::Big => u32::from_be_bytes(bytes),
        }
    }

    const fn u16(self, bytes: [u8; 2]) -> u16 {
        match self {
            Self::Little => u16::from_le_bytes(bytes),
            Self::Big => u16::from_be_bytes(bytes),
        }
    }

    fn u32_at(self, body: &[u8], at: usize) -> Option<u32> {
        Some(self.u32(*body.get(at..)?.first_chunk()?))
    }

    /// The value of an option.
    fn option(self, mut options: &[u8], wanted: u16) -> Option<&[u8]> {
        loop {
            let (code, rest) = options.split_first_chunk()?;
            let (length, rest) = rest.split_first_chunk()?;
            let length = usize::from(self.u16(*length));
            match self.u16(*code) {
                OPTION_END => return None,
                code if code == wanted => return rest.get(..length),
                _ => options = rest.get(length.next_multiple_of(4)..)?,
            }
        }
    }
}

fn interface_of(order: Order, body: &[u8]) -> Interface {
    let link_type = body.first_chunk().map(|bytes| order.u16(*bytes));
    let options = body.get(8..).unwrap_or_default();
    let name = order.option(options, INTERFACE_NAME).map(|name| String::from_utf8_lossy(name).into_owned());
    let per_second = match order.option(options, INTERFACE_RESOLUTION) {
        Some([power @ 0..=18]) => 10_u128.pow((*power).into()),
        Some([power @ 128..=190]) => 1 << (power - 128),
        _ => 1_000_000,
    };
    Interface {
        is_can: link_type == Some(LINKTYPE_CAN_SOCKETCAN),
        name: name.unwrap_or_default().split_whitespace().collect::<Vec<_>>().join("_"),
        per_second,
    }
}

fn enhanced_packet<'a>(order: Order, body: &[u8], interfaces: &'a [Interface]) -> Packet<'a> {
    let number = |at| order.u32_at(body, at);
    let (Some(of), Some(high), Some(low), Some(length)) = (number(0), number(4), number(8), number(12))
    else {
        return Packet::Malformed;
    };
    let Some(interface) = interfaces.get(of as usize) else { return Packet::Malformed };
    let Some((data, options)) = body.get(20..).and_then(|rest| rest.split_at_checked(length as usize)) else {
        return Packet::Malformed;
    };
    let options = options.get(data.len().next_multiple_of(4) - data.len()..).unwrap_or_default();
    let flags = order.option(options, PACKET_FLAGS).and_then(|flags| Some(order.u32(*flags.first_chunk()?)));
    let direction = match flags.map(|flags| flags & DIRECTION_BITS) {
        Some(OUTBOUND) => Some(Direction::Sent),
        Some(INBOUND) => Some(Direction::Received),
        _ => None,
    };
    let units = u128::from(high) << 32 | u128::from(low);
    let at_ns = units * u128::from(NANOSECONDS_PER_SECOND) / interface.per_second;
    captured(interface, Nanoseconds::try_from(at_ns).unwrap_or(Nanoseconds::MAX), direction, data)
}

fn simple_packet<'a>(order: Order, body: &[u8], interfaces: &'a [Interface]) -> Packet<'a> {
    let (Some(interface), Some(length)) = (interfaces.first(), order.u32_at(body, 0)) else {
        return Packet::Malformed;
    };
    match body.get(4..).and_then(|rest| rest.get(..length as usize)) {
        Some(data) => captured(interface, 0, None, data),
        None => Packet::Malformed,
    }
}

fn captured<'a>(
    interface: &'a Interface,
    at_ns: Nanoseconds,
    direction: Option<Direction>,
    data: &[u8],
) -> Packet<'a> {
    if !interface.is_can {
        return Packet::Foreign;
    }
    match item(data) {
        Some(Some(frame)) => {
            Packet::Item(LineItem::Frame(LoggedFrame { at_ns, bus: &interface.name, direction, frame }))
        }
        Some(None) => Packet::Item(LineItem::ErrorFrame),
        None => Packet::Malformed,
    }
}

/// The frame of a packet, or `Some(None)` for a message of the controller.
fn item(packet: &[u8]) -> Option<Option<Frame>> {
    let (header, data) = packet.split_first_chunk::<HEADER_BYTES>()?;
    let [a, b, c, d, length, flags, ..] = *header;
    let word = u32::from_be_bytes([a, b, c, d]);
    if word & ERROR != 0 {
        return Some(None);
    }
    let number = word & !(EXTENDED | REMOTE);
    let id = if word & EXTENDED != 0 { Id::extended(number) } else { Id::base(number) }.ok()?;
    if word & REMOTE != 0 {
        return Frame::remote(id, length).ok().map(Some);
    }
    let data = data.get(..length.into())?;
    let is_fd = flags & FD_FORMAT != 0 || data.len() > 8;
    let frame =
        if is_fd { Frame::fd(id, data, flags & FD_BIT_RATE_SWITCH != 0) } else { Frame::data(id, data) };
    frame.ok().map(Some)
}
