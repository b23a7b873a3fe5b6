//! What a description says of how drives of a make are found on a bus, without a command to them.

use std::ops::RangeInclusive;

use takt_rt::Id;

use super::{IdExpression, Setting};

/// How the drives of a make are found.
#[derive(Clone, Debug, PartialEq)]
pub enum DescribedScan {
    /// They have registers that can be read.
    Registers(RegisterScan),
    /// They send heartbeats by themselves, and are not asked.
    Heartbeat(HeartbeatScan),
}

/// Drives with registers. A drive is in one of several modes, each of which has a description of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct RegisterScan {
    /// How the registers are read: the same in every description of such drives.
    pub protocol: RegisterProtocol,
    /// What the register of the mode has, where the description is that of the drive.
    pub mode_is: u32,
}

/// How registers are read, and which there are.
#[derive(Clone, Debug, PartialEq)]
pub struct RegisterProtocol {
    /// Its name for people.
    pub name: String,
    /// The frame that reads a register. It changes nothing in the drive.
    pub request: RegisterFrame,
    /// The answer.
    pub reply: RegisterFrame,
    /// The register with the master ID, by which a drive is found.
    pub master_id: u8,
    /// The register with the mode.
    pub mode: u8,
    /// The register with the version of the firmware.
    pub firmware: Option<u8>,
    /// The registers with numbers that a configuration has to give: floating-point numbers of 32 bits.
    pub settings: Vec<(Setting, u8)>,
}

impl RegisterProtocol {
    /// The registers that a scan reads.
    pub fn registers(&self) -> impl Iterator<Item = u8> {
        let settings = self.settings.iter().map(|(_, register)| *register);
        [self.master_id, self.mode].into_iter().chain(self.firmware).chain(settings)
    }
}

/// A frame of eight bytes that has to do with a register.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegisterFrame {
    /// Its identifier.
    pub id: IdExpression,
    /// Its bytes.
    pub payload: [RegisterByte; 8],
}

/// A byte of such a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RegisterByte {
    /// Always this one.
    Byte(u8),
    /// The motor ID.
    Motor,
    /// The number of the register.
    Register,
    /// One of four bytes with what the register has, the lowest one first.
    Value,
    /// Whatever the master sends: zero.
    Any,
}

/// Drives that are known by their heartbeats. The identifier and the period of a heartbeat are those of the description.
#[derive(Clone, Debug, PartialEq)]
pub struct HeartbeatScan {
    /// The name of the protocol for people.
    pub name: String,
    /// The values that each byte of a heartbeat can have.
    pub bytes: Vec<RangeInclusive<u8>>,
    /// The lowest and the highest identifier that belong to a drive.
    pub identifiers: [IdExpression; 2],
    /// The identifiers by which every such drive takes a command, whatever its motor ID is.
    pub harmed_by: Vec<Id>,
}
