//! The messages of LSS in words.

use std::fmt;

use super::wire::{BitTiming, Inquiry, LssMode, LssRequest, LssResponse, LssResult};

/// The values of an identity in their order.
const PARTS: [&str; 4] = ["vendor ID", "product code", "revision number", "serial number"];
/// The values of a range of identities in their order.
const RANGE: [&str; 6] = [
    "vendor ID",
    "product code",
    "lowest revision number",
    "highest revision number",
    "lowest serial number",
    "highest serial number",
];

fn part<const N: usize>(names: [&'static str; N], at: u8) -> &'static str {
    names.get(usize::from(at)).copied().unwrap_or("value")
}

impl fmt::Display for LssRequest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SwitchGlobal(LssMode::Waiting) => write!(f, "end the configuration of all devices"),
            Self::SwitchGlobal(LssMode::Configuration) => write!(f, "configure all devices"),
            Self::SwitchSelective { part: at, value } => {
                write!(f, "configure the device with {} 0x{value:08X}", part(PARTS, *at))
            }
            Self::ConfigureNode(255) => write!(f, "take the node ID away"),
            Self::ConfigureNode(node) => write!(f, "set the node ID to {node}"),
            Self::ConfigureBitTiming(timing) => write!(f, "set the bit rate to {}", rate(*timing)),
            Self::ActivateBitTiming { delay_ms } => write!(f, "change the bit rate in {delay_ms} ms"),
            Self::Store => write!(f, "store node ID and bit rate"),
            Self::Inquire(inquiry) => write!(f, "read the {inquiry}"),
            Self::IdentifyRemote { part: at, value } => {
                write!(f, "which devices are in this range: {} 0x{value:08X}", part(RANGE, *at))
            }
            Self::IdentifyUnconfigured => write!(f, "which devices have no node ID"),
            Self::FastScan { lowest_bit: 128, .. } => write!(f, "fastscan: begin"),
            Self::FastScan { value, lowest_bit, part: at, .. } => {
                write!(f, "fastscan: {} 0x{value:08X} from bit {lowest_bit} on", part(PARTS, *at))
            }
        }
    }
}

fn rate(timing: BitTiming) -> String {
    match timing.bit_rate() {
        Some(rate) => format!("{} kbit/s", rate / 1000),
        None => "automatic".to_owned(),
    }
}

impl fmt::Display for Inquiry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Node => "node ID",
            identity => part(PARTS, *identity as u8),
        })
    }
}

impl fmt::Display for LssResponse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Switched => write!(f, "the device is being configured"),
            Self::NodeConfigured(result) => write!(f, "node ID {result}"),
            Self::BitTimingConfigured(result) => write!(f, "bit rate {result}"),
            Self::Stored(result) => write!(f, "storing {result}"),
            Self::Inquired(Inquiry::Node, 255) => write!(f, "the device has no node ID"),
            Self::Inquired(Inquiry::Node, node) => write!(f, "the node ID is {node}"),
            Self::Inquired(inquiry, value) => write!(f, "the {inquiry} is 0x{value:08X}"),
            Self::Identified => write!(f, "a device is in the range, or matches"),
            Self::IdentifiedUnconfigured => write!(f, "a device has no node ID"),
        }
    }
}

impl fmt::Display for LssResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.code, self.specific) {
            (0, _) => write!(f, "accepted"),
            (255, specific) => write!(f, "refused, the manufacturer's error {specific}"),
            (code, _) => write!(f, "refused, error {code}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_sentences() {
        let scan = LssRequest::FastScan { value: 0x10, lowest_bit: 3, part: 1, next: 1 };
        assert_eq!(scan.to_string(), "fastscan: product code 0x00000010 from bit 3 on");
        assert_eq!(LssRequest::ConfigureNode(5).to_string(), "set the node ID to 5");
        let refused = LssResponse::NodeConfigured(LssResult::REFUSED);
        assert_eq!(refused.to_string(), "node ID refused, error 1");
        assert_eq!(LssResponse::Inquired(Inquiry::Vendor, 7).to_string(), "the vendor ID is 0x00000007");
    }
}
