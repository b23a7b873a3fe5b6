//! A device that a scan has found.

use std::path::PathBuf;

use super::canopen::NodeIdentity;
use crate::words;
use crate::words::Words;

/// How a device has shown itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answered {
    /// It answered an SDO request (CiA 301), be it with an abort.
    Sdo,
    /// It did not answer, but was heard: a boot-up message, a heartbeat, process data, or replies to another master.
    Heard(&'static str),
    /// It answered in the protocol of its vendor.
    Own(&'static str),
    /// It answered on a Modbus line of this bit rate in bit/s, be it with an exception.
    Modbus {
        /// bit/s
        bit_rate: u32,
    },
    /// It answered a fastscan (CiA 305): it has no node ID.
    Lss,
    /// It was not asked: it is a drive of the running controller that sends the questions.
    OfController,
}

impl Answered {
    /// The protocol in words.
    pub fn words(self) -> Words {
        match self {
            Self::Sdo => "CANopen SDO".into(),
            Self::Heard(protocol) => words!("{protocol}, heard", protocol = Words::from(protocol)),
            Self::Own(protocol) => protocol.into(),
            Self::Modbus { bit_rate } => words!("Modbus-RTU at {bit_rate} bit/s", bit_rate),
            Self::Lss => "LSS fastscan".into(),
            Self::OfController => "not asked".into(),
        }
    }
}

/// A device that a scan has found. What is `None` it does not tell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundDevice {
    /// Its node ID, motor ID or slave address; `None` for a device without one.
    pub node: Option<u8>,
    /// How it has shown itself.
    pub answered: Answered,
    /// What it is.
    pub kind: String,
    /// Who made it: a name, or the vendor ID as a hexadecimal number.
    pub vendor: Option<String>,
    /// Its name or model, or the product code as a hexadecimal number.
    pub product: Option<String>,
    /// The version of its firmware.
    pub firmware: Option<String>,
    /// Its serial number.
    pub serial: Option<String>,
    /// The identity of a CANopen node (object 1018), as far as it was read.
    pub identity: Option<NodeIdentity>,
    /// The identifier of its replies, where that is a setting of its own.
    pub reply_id: Option<u32>,
    /// Lines of its axis, where it has told them or its description has them.
    pub axis_keys: Vec<String>,
    /// Its data sheet, where one was given that has its vendor and product.
    pub sheet: Option<PathBuf>,
    /// The family that drives it, as `drive` names it in a configuration.
    pub drive: Option<&'static str>,
    /// What is odd with it: sentences for people.
    pub remarks: Vec<String>,
}

impl FoundDevice {
    /// A device of which nothing more is known.
    pub fn new(node: Option<u8>, answered: Answered, kind: impl Into<String>) -> Self {
        Self {
            node,
            answered,
            kind: kind.into(),
            vendor: None,
            product: None,
            firmware: None,
            serial: None,
            identity: None,
            reply_id: None,
            axis_keys: vec![],
            sheet: None,
            drive: None,
            remarks: vec![],
        }
    }

    /// Adds a remark.
    pub fn remark(&mut self, remark: impl Into<String>) {
        self.remarks.push(remark.into());
    }
}
