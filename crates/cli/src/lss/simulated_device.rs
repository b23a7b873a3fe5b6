//! Simulated LSS devices, as they are written on the command line.

use std::str::FromStr;

use takt_wire::canopen::lss::LssAddress;

use takt_sim::lss::{LssDevice, LssStack};
use takt_tools::commission::layer_settings::NO_NODE;

/// A device as it is written on the command line: IDENTITY[@NODE][,BEHAVIOUR…].
#[derive(Clone, Copy, Debug)]
pub struct SimulatedDevice {
    address: LssAddress,
    node: Option<u8>,
    stack: LssStack,
    boots: bool,
}

impl SimulatedDevice {
    /// Returns the device in its state after power-up.
    pub fn device(self) -> LssDevice {
        let mut device = LssDevice::new(self.address, self.node);
        (device.stack, device.boots) = (self.stack, self.boots);
        device
    }
}

impl FromStr for SimulatedDevice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut words = text.split(',');
        let text = words.next().unwrap_or_default();
        let (identity, number) = match text.split_once('@') {
            Some((identity, number)) => (identity, Some(node(number)?)),
            None => (text, None),
        };
        let (mut stack, mut boots) = (LssStack::Standard, true);
        for word in words {
            match word {
                "canopennode" => stack = LssStack::CanOpenNode,
                "no-boot-up" => boots = false,
                _ => return Err(format!("`{word}` is no behaviour: canopennode, no-boot-up")),
            }
        }
        let node = number.filter(|node| *node != NO_NODE);
        Ok(Self { address: address(identity)?, node, stack, boots })
    }
}

/// A node ID, or none.
pub fn node(text: &str) -> Result<u8, String> {
    let wrong = || "a node ID is 1 to 127, or none".to_owned();
    if text == "none" {
        return Ok(NO_NODE);
    }
    text.parse().ok().filter(|node| (1..=127).contains(node)).ok_or_else(wrong)
}

/// An identity.
pub fn address(text: &str) -> Result<LssAddress, String> {
    let number = |text: &str| match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u32::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    };
    let values: Option<Vec<u32>> = text.split(':').map(number).collect();
    let values = values.and_then(|values| <[u32; 4]>::try_from(values).ok());
    values.map(LssAddress::from_values).ok_or_else(|| {
        "write it as VENDOR:PRODUCT:REVISION:SERIAL, for example 0x331:1:0x100:12345".to_owned()
    })
}
