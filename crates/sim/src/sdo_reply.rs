//! The replies of the SDO server of a simulated drive: the abort codes and the layout.

/// The SDO abort codes of the simulated drives (CiA 301, 7.2.4.3.17).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum AbortCode {
    /// Toggle bit not alternated.
    Toggle = 0x0503_0000,
    /// Command specifier not valid or unknown.
    Command = 0x0504_0001,
    /// Block size not valid.
    BlockSize = 0x0504_0002,
    /// CRC error of a block transfer.
    Checksum = 0x0504_0004,
    /// Out of memory.
    Memory = 0x0504_0005,
    /// Attempt to read a write-only object.
    WriteOnly = 0x0601_0001,
    /// Attempt to write a read-only object.
    ReadOnly = 0x0601_0002,
    /// Object does not exist in the object dictionary.
    NoObject = 0x0602_0000,
    /// Object cannot be mapped to the PDO.
    NotMappable = 0x0604_0041,
    /// The number and length of the objects to be mapped would exceed PDO length.
    PdoTooLong = 0x0604_0042,
    /// Data type does not match, length of service parameter does not match.
    Length = 0x0607_0010,
    /// Data type does not match, length of service parameter too high.
    LengthTooHigh = 0x0607_0012,
    /// Data type does not match, length of service parameter too low.
    LengthTooLow = 0x0607_0013,
    /// Sub-index does not exist.
    NoSubindex = 0x0609_0011,
    /// Invalid value for parameter.
    Value = 0x0609_0030,
    /// Value range of parameter exceeded: too high.
    ValueTooHigh = 0x0609_0031,
    /// Value range of parameter exceeded: too low.
    ValueTooLow = 0x0609_0032,
    /// Data cannot be transferred or stored to the application.
    CannotStore = 0x0800_0020,
    /// Data cannot be transferred or stored to the application because of the present device state.
    DeviceState = 0x0800_0022,
    /// No data available.
    NoData = 0x0800_0024,
}

/// A reply with the index and subindex of its object.
pub fn addressed(command: u8, index: u16, subindex: u8, [a, b, c, d]: [u8; 4]) -> [u8; 8] {
    let [low, high] = index.to_le_bytes();
    [command, low, high, subindex, a, b, c, d]
}

/// The reply to an upload whose value fits in it.
pub fn uploaded(index: u16, subindex: u8, value: [u8; 4], size: usize) -> [u8; 8] {
    addressed(0x43 | (4 - size.min(4) as u8) << 2, index, subindex, value)
}

/// The reply to a download that is accepted.
pub fn downloaded(index: u16, subindex: u8) -> [u8; 8] {
    addressed(0x60, index, subindex, [0; 4])
}

/// An abort.
pub fn aborted(index: u16, subindex: u8, code: AbortCode) -> [u8; 8] {
    addressed(0x80, index, subindex, (code as u32).to_le_bytes())
}
