//! The exception codes of Modbus (Application Protocol 1.1b3, chapter 7).

use std::fmt;

/// Why a slave refuses a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ExceptionCode(pub u8);

impl ExceptionCode {
    /// The slave does not know the function.
    pub const ILLEGAL_FUNCTION: Self = Self(1);
    /// The slave does not have one of the registers, or not with this access.
    pub const ILLEGAL_ADDRESS: Self = Self(2);
    /// The slave does not take the value, or the number of registers.
    pub const ILLEGAL_VALUE: Self = Self(3);
    /// The slave could not carry out the request.
    pub const DEVICE_FAILURE: Self = Self(4);
    /// The slave has accepted the request and needs a long time for it.
    pub const ACKNOWLEDGE: Self = Self(5);
    /// The slave is occupied with something that takes long.
    pub const BUSY: Self = Self(6);

    /// What the code means; `None` if the standard does not have it.
    pub const fn words(self) -> Option<&'static str> {
        Some(match self.0 {
            1 => "the slave does not have this function",
            2 => "the slave does not have such a register, or not for this access",
            3 => "the slave does not take this value, or this number of registers",
            4 => "the slave could not carry it out",
            5 => "the slave has accepted it, and needs a long time for it",
            6 => "the slave is busy",
            8 => "the memory of the slave has a parity error",
            0x0A => "the gateway has no path to the slave",
            0x0B => "the slave behind the gateway does not reply",
            _ => return None,
        })
    }
}

impl fmt::Display for ExceptionCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Modbus exception {:02X}", self.0)?;
        self.words().map_or(Ok(()), |words| write!(f, ", {words}"))
    }
}
