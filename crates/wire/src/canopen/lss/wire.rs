//! The messages of LSS (CiA 305, section 6).

use takt_rt::{Frame, Id};

/// COB-ID of the LSS master.
const MASTER: u16 = 0x7E5;
/// COB-ID of the LSS slaves.
const SLAVE: u16 = 0x7E4;

const SWITCH_GLOBAL: u8 = 4;
const CONFIGURE_NODE: u8 = 17;
const CONFIGURE_BIT_TIMING: u8 = 19;
const ACTIVATE_BIT_TIMING: u8 = 21;
const STORE: u8 = 23;
const SWITCH_SELECTIVE: u8 = 64;
const SWITCHED: u8 = 68;
const IDENTIFY_REMOTE: u8 = 70;
const IDENTIFY_UNCONFIGURED: u8 = 76;
const IDENTIFIED: u8 = 79;
const IDENTIFIED_UNCONFIGURED: u8 = 80;
const FAST_SCAN: u8 = 81;
const INQUIRE: u8 = 90;

/// The LSS state of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LssMode {
    /// Waiting state: the device waits to be switched.
    Waiting,
    /// Configuration state: the device accepts configuration requests.
    Configuration,
}

/// A bit rate of the standard table (CiA 305, table 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum BitTiming {
    /// 1 Mbit/s
    Kilobits1000 = 0,
    /// 800 kbit/s
    Kilobits800 = 1,
    /// 500 kbit/s
    Kilobits500 = 2,
    /// 250 kbit/s
    Kilobits250 = 3,
    /// 125 kbit/s
    Kilobits125 = 4,
    /// 50 kbit/s
    Kilobits50 = 6,
    /// 20 kbit/s
    Kilobits20 = 7,
    /// 10 kbit/s
    Kilobits10 = 8,
    /// Automatic bit rate detection.
    Automatic = 9,
}

impl BitTiming {
    const RATES: [(Self, u32); 9] = [
        (Self::Kilobits1000, 1_000_000),
        (Self::Kilobits800, 800_000),
        (Self::Kilobits500, 500_000),
        (Self::Kilobits250, 250_000),
        (Self::Kilobits125, 125_000),
        (Self::Kilobits50, 50_000),
        (Self::Kilobits20, 20_000),
        (Self::Kilobits10, 10_000),
        (Self::Automatic, 0),
    ];

    /// The entry for a bit rate in bit/s; `None` if the table does not have it.
    pub fn of(bit_rate: u32) -> Option<Self> {
        Self::RATES.iter().find(|(_, rate)| *rate == bit_rate && bit_rate > 0).map(|(timing, _)| *timing)
    }

    /// The bit rate in bit/s; `None` for automatic detection.
    pub fn bit_rate(self) -> Option<u32> {
        Self::RATES.iter().find(|(timing, _)| *timing == self).map(|(_, rate)| *rate).filter(|rate| *rate > 0)
    }

    fn from_index(index: u8) -> Option<Self> {
        Self::RATES.iter().map(|(timing, _)| *timing).find(|timing| *timing as u8 == index)
    }
}

/// The values that can be read from the device in configuration state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Inquiry {
    /// 1018:1
    Vendor = 0,
    /// 1018:2
    Product = 1,
    /// 1018:3
    Revision = 2,
    /// 1018:4
    Serial = 3,
    /// The node ID; 255 when it has none.
    Node = 4,
}

impl Inquiry {
    /// Every value.
    pub const ALL: [Self; 5] = [Self::Vendor, Self::Product, Self::Revision, Self::Serial, Self::Node];
}

/// A request of the LSS master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LssRequest {
    /// Switch every device to this state. No response.
    SwitchGlobal(LssMode),
    /// One of the four identity values (0 to 3) of the device to switch to configuration state. It responds to the last
    /// one.
    SwitchSelective {
        /// The part, an index into [`LssAddress::values`](super::LssAddress::values).
        part: u8,
        /// The value.
        value: u32,
    },
    /// Configure the node ID: 1 to 127, or 255 for none.
    ConfigureNode(u8),
    /// Configure the bit rate; it takes effect when it is activated.
    ConfigureBitTiming(BitTiming),
    /// Activate the bit rate: devices stop sending, change it after the delay, and send again after another delay. No
    /// response.
    ActivateBitTiming {
        /// The delay in ms.
        delay_ms: u16,
    },
    /// Store the node ID and bit rate.
    Store,
    /// Read this value.
    Inquire(Inquiry),
    /// One of the six values of an identity range: vendor, product, lowest and highest revision, lowest and highest
    /// serial number. Devices in the range respond to the last one.
    IdentifyRemote {
        /// The part, 0 to 5.
        part: u8,
        /// The value.
        value: u32,
    },
    /// Devices without a node ID respond.
    IdentifyUnconfigured,
    /// A fastscan request to devices without a node ID.
    FastScan {
        /// The value to compare.
        value: u32,
        /// The lowest compared bit; 128 begins a new fastscan.
        lowest_bit: u8,
        /// The part of the identity.
        part: u8,
        /// The part of the next request, if this one matches.
        next: u8,
    },
}

impl LssRequest {
    /// The request as a frame.
    pub fn frame(self) -> Frame {
        let mut bytes = [0; 8];
        let with_value = |specifier: u8, value: u32| {
            let [a, b, c, d] = value.to_le_bytes();
            [specifier, a, b, c, d, 0, 0, 0]
        };
        match self {
            Self::SwitchGlobal(mode) => {
                bytes[0] = SWITCH_GLOBAL;
                bytes[1] = u8::from(mode == LssMode::Configuration);
            }
            Self::SwitchSelective { part, value } => {
                bytes = with_value(SWITCH_SELECTIVE + part.min(3), value)
            }
            Self::ConfigureNode(node) => [bytes[0], bytes[1]] = [CONFIGURE_NODE, node],
            Self::ConfigureBitTiming(timing) => {
                // Table selector 0 is the standard table.
                [bytes[0], bytes[1], bytes[2]] = [CONFIGURE_BIT_TIMING, 0, timing as u8];
            }
            Self::ActivateBitTiming { delay_ms } => {
                let [low, high] = delay_ms.to_le_bytes();
                [bytes[0], bytes[1], bytes[2]] = [ACTIVATE_BIT_TIMING, low, high];
            }
            Self::Store => bytes[0] = STORE,
            Self::Inquire(inquiry) => bytes[0] = INQUIRE + inquiry as u8,
            Self::IdentifyRemote { part, value } => bytes = with_value(IDENTIFY_REMOTE + part.min(5), value),
            Self::IdentifyUnconfigured => bytes[0] = IDENTIFY_UNCONFIGURED,
            Self::FastScan { value, lowest_bit, part, next } => {
                bytes = with_value(FAST_SCAN, value);
                [bytes[5], bytes[6], bytes[7]] = [lowest_bit, part, next];
            }
        }
        Frame::of(id(MASTER), bytes)
    }

    /// Decodes a request; `None` for other frames.
    pub fn decode(frame: &Frame) -> Option<Self> {
        let bytes = payload(frame, MASTER)?;
        let value = u32::from_le_bytes([bytes[1], bytes[2], bytes[3], bytes[4]]);
        Some(match bytes[0] {
            SWITCH_GLOBAL if bytes[1] == 0 => Self::SwitchGlobal(LssMode::Waiting),
            SWITCH_GLOBAL if bytes[1] == 1 => Self::SwitchGlobal(LssMode::Configuration),
            part @ SWITCH_SELECTIVE..=67 => Self::SwitchSelective { part: part - SWITCH_SELECTIVE, value },
            CONFIGURE_NODE => Self::ConfigureNode(bytes[1]),
            CONFIGURE_BIT_TIMING if bytes[1] == 0 => {
                Self::ConfigureBitTiming(BitTiming::from_index(bytes[2])?)
            }
            ACTIVATE_BIT_TIMING => {
                Self::ActivateBitTiming { delay_ms: u16::from_le_bytes([bytes[1], bytes[2]]) }
            }
            STORE => Self::Store,
            question @ INQUIRE..=94 => {
                Self::Inquire(Inquiry::ALL.into_iter().find(|inquiry| INQUIRE + *inquiry as u8 == question)?)
            }
            part @ IDENTIFY_REMOTE..=75 => Self::IdentifyRemote { part: part - IDENTIFY_REMOTE, value },
            IDENTIFY_UNCONFIGURED => Self::IdentifyUnconfigured,
            FAST_SCAN => Self::FastScan { value, lowest_bit: bytes[5], part: bytes[6], next: bytes[7] },
            _ => return None,
        })
    }
}

/// The result of a configuration request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LssResult {
    /// 0: success; 1: out of range or not supported; 255: see `specific`.
    pub code: u8,
    /// The manufacturer's error code.
    pub specific: u8,
}

impl LssResult {
    /// Success.
    pub const OK: Self = Self { code: 0, specific: 0 };
    /// Out of range, or not supported.
    pub const REFUSED: Self = Self { code: 1, specific: 0 };
}

/// A response of an LSS slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LssResponse {
    /// The selected device is in configuration state.
    Switched,
    /// Response to [`LssRequest::ConfigureNode`].
    NodeConfigured(LssResult),
    /// Response to [`LssRequest::ConfigureBitTiming`].
    BitTimingConfigured(LssResult),
    /// Response to [`LssRequest::Store`].
    Stored(LssResult),
    /// Response to [`LssRequest::Inquire`].
    Inquired(Inquiry, u32),
    /// The identity is in the range, or matches the fastscan request. All matching devices send the same frame.
    Identified,
    /// The device has no node ID.
    IdentifiedUnconfigured,
}

impl LssResponse {
    /// The response as a frame.
    pub fn frame(self) -> Frame {
        let of_result =
            |specifier, result: LssResult| [specifier, result.code, result.specific, 0, 0, 0, 0, 0];
        let plain = |specifier| [specifier, 0, 0, 0, 0, 0, 0, 0];
        let bytes = match self {
            Self::Switched => plain(SWITCHED),
            Self::NodeConfigured(result) => of_result(CONFIGURE_NODE, result),
            Self::BitTimingConfigured(result) => of_result(CONFIGURE_BIT_TIMING, result),
            Self::Stored(result) => of_result(STORE, result),
            Self::Inquired(inquiry, value) => {
                let [a, b, c, d] = value.to_le_bytes();
                [INQUIRE + inquiry as u8, a, b, c, d, 0, 0, 0]
            }
            Self::Identified => plain(IDENTIFIED),
            Self::IdentifiedUnconfigured => plain(IDENTIFIED_UNCONFIGURED),
        };
        Frame::of(id(SLAVE), bytes)
    }

    /// Decodes a response; `None` for other frames.
    pub fn decode(frame: &Frame) -> Option<Self> {
        let bytes = payload(frame, SLAVE)?;
        let result = LssResult { code: bytes[1], specific: bytes[2] };
        Some(match bytes[0] {
            SWITCHED => Self::Switched,
            CONFIGURE_NODE => Self::NodeConfigured(result),
            CONFIGURE_BIT_TIMING => Self::BitTimingConfigured(result),
            STORE => Self::Stored(result),
            IDENTIFIED => Self::Identified,
            IDENTIFIED_UNCONFIGURED => Self::IdentifiedUnconfigured,
            question => {
                let inquiry =
                    Inquiry::ALL.into_iter().find(|inquiry| INQUIRE + *inquiry as u8 == question)?;
                let value = match inquiry {
                    Inquiry::Node => bytes[1].into(),
                    _ => u32::from_le_bytes([bytes[1], bytes[2], bytes[3], bytes[4]]),
                };
                Self::Inquired(inquiry, value)
            }
        })
    }
}

fn id(value: u16) -> Id {
    Id::canopen(value & 0x780, (value & 0x7F) as u8)
}

fn payload(frame: &Frame, identifier: u16) -> Option<[u8; 8]> {
    if frame.id() != id(identifier) {
        return None;
    }
    frame.payload().try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_decoded_message_is_encoded_and_decoded_to_the_same(bytes: [u8; 8], specifier in 0..100_u8) {
            let bytes = [specifier, bytes[1], bytes[2], bytes[3], bytes[4], bytes[5], bytes[6], bytes[7]];
            if let Some(request) = LssRequest::decode(&Frame::of(id(MASTER), bytes)) {
                prop_assert_eq!(LssRequest::decode(&request.frame()), Some(request));
            }
            if let Some(response) = LssResponse::decode(&Frame::of(id(SLAVE), bytes)) {
                prop_assert_eq!(LssResponse::decode(&response.frame()), Some(response));
            }
        }
    }

    #[test]
    fn requests_are_encoded_as_in_the_standard() {
        let shown = |request: LssRequest| format!("{:?}", request.frame());
        assert_eq!(shown(LssRequest::SwitchGlobal(LssMode::Configuration)), "7E5#0401000000000000");
        assert_eq!(shown(LssRequest::SwitchSelective { part: 3, value: 0x1234 }), "7E5#4334120000000000");
        assert_eq!(shown(LssRequest::ConfigureNode(5)), "7E5#1105000000000000");
        assert_eq!(shown(LssRequest::ConfigureBitTiming(BitTiming::Kilobits250)), "7E5#1300030000000000");
        assert_eq!(shown(LssRequest::ActivateBitTiming { delay_ms: 1000 }), "7E5#15E8030000000000");
        assert_eq!(shown(LssRequest::Store), "7E5#1700000000000000");
        assert_eq!(shown(LssRequest::Inquire(Inquiry::Node)), "7E5#5E00000000000000");
        assert_eq!(shown(LssRequest::IdentifyUnconfigured), "7E5#4C00000000000000");
        let scan = LssRequest::FastScan { value: 0x8000_0000, lowest_bit: 31, part: 1, next: 2 };
        assert_eq!(shown(scan), "7E5#51000000801F0102");
        assert_eq!(BitTiming::of(500_000).and_then(BitTiming::bit_rate), Some(500_000));
        assert_eq!(BitTiming::of(0), None);
    }
}
