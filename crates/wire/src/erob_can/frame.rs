//! Requests and replies on the wire (eRunner manual 7.1 to 7.3). Every number is sent with its most significant byte first.

use std::fmt;

use takt_rt::{Frame, FrameKind, Id};

use super::error_code::ErrorCode;

/// The identifier of requests, to which the node ID is added.
pub const REQUEST: u16 = 0x640;
/// The identifier of replies, to which the node ID is added.
pub const REPLY: u16 = 0x5C0;
/// The node IDs that the protocol has room for. Beside CANopen nodes, 64 is taken: its replies would be SDO requests.
pub const NODES: std::ops::RangeInclusive<u8> = 1..=64;

/// The last byte of a reply that tells of a success, with a value or without.
const SUCCESS: u8 = 0x3E;
/// The last byte of a reply that tells of a failure. With an error code, the manual prints [`SUCCESS`] in its place.
const FAILURE: u8 = 0x80;

/// The address of a parameter, a variable or a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct EntryAddress {
    /// Its index.
    pub index: u16,
    /// Its sub-index, if the index has some.
    pub sub_index: Option<u16>,
}

impl EntryAddress {
    /// An index without sub-indices.
    pub const fn new(index: u16) -> Self {
        Self { index, sub_index: None }
    }

    /// A sub-index of an index.
    pub const fn sub(index: u16, sub_index: u16) -> Self {
        Self { index, sub_index: Some(sub_index) }
    }

    /// Reads `index:sub-index` in hexadecimal: `86`, `0x0232`, `0232:5`.
    pub fn parse(text: &str) -> Option<Self> {
        let hexadecimal = |text: &str| {
            let digits = text.strip_prefix("0x").or(text.strip_prefix("0X")).unwrap_or(text);
            u16::from_str_radix(digits.strip_suffix(['h', 'H']).unwrap_or(digits), 16).ok()
        };
        let (index, sub_index) = text.split_once(':').map_or((text, None), |(index, sub)| (index, Some(sub)));
        // A name begins with a letter.
        let index = hexadecimal(index).filter(|_| text.starts_with(|first: char| first.is_ascii_digit()))?;
        match sub_index {
            None => Some(Self::new(index)),
            Some(sub_index) => Some(Self::sub(index, hexadecimal(sub_index)?)),
        }
    }
}

impl fmt::Display for EntryAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X}", self.index)?;
        self.sub_index.map_or(Ok(()), |sub_index| write!(f, ":{sub_index}"))
    }
}

/// A request of the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Reads a parameter or a variable.
    Read(EntryAddress),
    /// Writes a parameter, or gives a command its argument.
    Write(EntryAddress, i32),
    /// A command without an argument. On the wire it looks like a read: the index alone makes the difference.
    Command(EntryAddress),
}

impl Request {
    /// What it is for.
    pub const fn address(&self) -> EntryAddress {
        match self {
            Self::Read(address) | Self::Write(address, _) | Self::Command(address) => *address,
        }
    }

    /// The value that it carries.
    pub const fn value(&self) -> Option<i32> {
        match self {
            Self::Write(_, value) => Some(*value),
            Self::Read(_) | Self::Command(_) => None,
        }
    }

    /// The frame of the request to a node. It has no more bytes than it needs.
    pub fn frame(&self, node: u8) -> Frame {
        let EntryAddress { index, sub_index } = self.address();
        let [i1, i0] = index.to_be_bytes();
        let sub = sub_index.map(u16::to_be_bytes);
        let value = self.value().map(i32::to_be_bytes);
        let id = request_id(node);
        match (sub, value) {
            (None, None) => Frame::of(id, [i1, i0]),
            (Some([s1, s0]), None) => Frame::of(id, [i1, i0, s1, s0]),
            (None, Some([v3, v2, v1, v0])) => Frame::of(id, [i1, i0, v3, v2, v1, v0]),
            (Some([s1, s0]), Some([v3, v2, v1, v0])) => Frame::of(id, [i1, i0, s1, s0, v3, v2, v1, v0]),
        }
    }
}

/// A request as a node or a monitor sees it: without a table, a read and a command are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReceivedRequest {
    /// The node that it is for.
    pub node: u8,
    /// What it is for.
    pub address: EntryAddress,
    /// The value that it carries.
    pub value: Option<i32>,
}

impl ReceivedRequest {
    /// Decodes a request; `None` for other frames, and for those of another length.
    pub fn decode(frame: &Frame) -> Option<Self> {
        let node = node_of(frame, REQUEST)?;
        let number = |bytes: [u8; 4]| Some(i32::from_be_bytes(bytes));
        let (index, sub, value) = match *frame.payload() {
            [i1, i0] => ([i1, i0], None, None),
            [i1, i0, s1, s0] => ([i1, i0], Some([s1, s0]), None),
            [i1, i0, v3, v2, v1, v0] => ([i1, i0], None, number([v3, v2, v1, v0])),
            [i1, i0, s1, s0, v3, v2, v1, v0] => ([i1, i0], Some([s1, s0]), number([v3, v2, v1, v0])),
            _ => return None,
        };
        let sub_index = sub.map(u16::from_be_bytes);
        Some(Self { node, address: EntryAddress { index: u16::from_be_bytes(index), sub_index }, value })
    }
}

/// A reply of a node. It does not say what it replies to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reply {
    /// A write or a command has succeeded.
    Done,
    /// What was read.
    Value(i32),
    /// The request has failed: with a code if it was a write or a command.
    Failed(Option<ErrorCode>),
}

impl Reply {
    /// Decodes the payload of a reply; `None` if it is none. The length decides before the content, so that the code of an error is
    /// no success. Failures are accepted in both forms: the manual prints a code with 3E behind it, programs of the vendor expect 80.
    pub fn decode(payload: &[u8]) -> Option<Self> {
        match *payload {
            [SUCCESS] => Some(Self::Done),
            [FAILURE] | [_, _, _, _, FAILURE] => Some(Self::Failed(None)),
            [c1, c0, SUCCESS | FAILURE] => Some(Self::Failed(Some(ErrorCode(u16::from_be_bytes([c1, c0]))))),
            [v3, v2, v1, v0, SUCCESS] => Some(Self::Value(i32::from_be_bytes([v3, v2, v1, v0]))),
            _ => None,
        }
    }

    /// The frame of the reply of a node, as the manual prints it.
    pub fn frame(&self, node: u8) -> Frame {
        let id = reply_id(node);
        match *self {
            Self::Done => Frame::of(id, [SUCCESS]),
            Self::Failed(None) => Frame::of(id, [FAILURE]),
            Self::Failed(Some(ErrorCode(code))) => {
                let [c1, c0] = code.to_be_bytes();
                Frame::of(id, [c1, c0, SUCCESS])
            }
            Self::Value(value) => {
                let [v3, v2, v1, v0] = value.to_be_bytes();
                Frame::of(id, [v3, v2, v1, v0, SUCCESS])
            }
        }
    }
}

/// The node that a reply comes from; `None` for other frames.
pub fn replying_node(frame: &Frame) -> Option<u8> {
    node_of(frame, REPLY)
}

/// The identifier of the requests to a node.
pub fn request_id(node: u8) -> Id {
    id(REQUEST, node)
}

/// The identifier of the replies of a node.
pub fn reply_id(node: u8) -> Id {
    id(REPLY, node)
}

/// The identifier of a node's frames.
fn id(base: u16, node: u8) -> Id {
    match Id::base(u32::from(base) + u32::from(node)) {
        Ok(id) => id,
        Err(_) => unreachable!("0x5C0 or 0x640 and a byte have 11 bits"),
    }
}

/// The node of a data frame whose 11-bit identifier is `base` and a node ID.
fn node_of(frame: &Frame, base: u16) -> Option<u8> {
    let node = frame.id().value().checked_sub(base.into())?;
    let node = u8::try_from(node).ok().filter(|node| NODES.contains(node))?;
    (frame.id() == id(base, node) && frame.kind() == FrameKind::Data).then_some(node)
}
