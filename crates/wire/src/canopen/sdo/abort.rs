//! SDO abort codes (CiA 301, 7.2.4.3.17).

use std::fmt;

macro_rules! abort_codes {
    ($($name:ident = $code:literal, $words:literal;)*) => {
        /// An abort code.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum AbortCode {
            $(#[doc = $words] $name,)*
            /// A code that is not in the standard.
            Other(u32),
        }

        impl AbortCode {
            /// Every code in the standard.
            pub const LISTED: &[Self] = &[$(Self::$name),*];

            /// The code with this number. A standard number never becomes [`AbortCode::Other`].
            pub const fn from_number(number: u32) -> Self {
                match number {
                    $($code => Self::$name,)*
                    other => Self::Other(other),
                }
            }

            /// Its number.
            pub const fn number(self) -> u32 {
                match self {
                    $(Self::$name => $code,)*
                    Self::Other(number) => number,
                }
            }

            /// Its meaning.
            pub const fn words(self) -> &'static str {
                match self {
                    $(Self::$name => $words,)*
                    Self::Other(_) => "manufacturer-specific code",
                }
            }
        }
    };
}

abort_codes! {
    ToggleBitNotAlternated = 0x0503_0000, "toggle bit not alternated";
    ProtocolTimedOut = 0x0504_0000, "SDO protocol timed out";
    CommandSpecifierUnknown = 0x0504_0001, "client/server command specifier not valid or unknown";
    InvalidBlockSize = 0x0504_0002, "invalid block size";
    InvalidSequenceNumber = 0x0504_0003, "invalid sequence number";
    CrcError = 0x0504_0004, "CRC error";
    OutOfMemory = 0x0504_0005, "out of memory";
    UnsupportedAccess = 0x0601_0000, "unsupported access to the object";
    WriteOnly = 0x0601_0001, "attempt to read a write-only object";
    ReadOnly = 0x0601_0002, "attempt to write a read-only object";
    ObjectDoesNotExist = 0x0602_0000, "object does not exist in the object dictionary";
    ObjectCannotBeMapped = 0x0604_0041, "object cannot be mapped to the PDO";
    MappingTooLong = 0x0604_0042, "number and length of the mapped objects would exceed the PDO";
    ParameterIncompatible = 0x0604_0043, "general parameter incompatibility";
    InternalIncompatibility = 0x0604_0047, "general internal incompatibility in the device";
    HardwareError = 0x0606_0000, "access failed due to a hardware error";
    LengthMismatch = 0x0607_0010, "data type does not match, length of the parameter does not match";
    LengthTooHigh = 0x0607_0012, "data type does not match, parameter too long";
    LengthTooLow = 0x0607_0013, "data type does not match, parameter too short";
    SubindexDoesNotExist = 0x0609_0011, "sub-index does not exist";
    InvalidValue = 0x0609_0030, "invalid value for the parameter";
    ValueTooHigh = 0x0609_0031, "value of the parameter too high";
    ValueTooLow = 0x0609_0032, "value of the parameter too low";
    MaximumBelowMinimum = 0x0609_0036, "maximum value is less than the minimum value";
    ResourceNotAvailable = 0x060A_0023, "resource not available: SDO connection";
    General = 0x0800_0000, "general error";
    CannotTransfer = 0x0800_0020, "data cannot be transferred or stored to the application";
    LocalControl = 0x0800_0021, "data cannot be transferred or stored because of local control";
    PresentDeviceState = 0x0800_0022, "data cannot be transferred or stored because of the present device state";
    NoObjectDictionary = 0x0800_0023, "no object dictionary is present or its generation failed";
    NoData = 0x0800_0024, "no data available";
}

impl AbortCode {
    /// Returns `true` if the object does not exist, or not for this kind of access.
    pub const fn means_absent(self) -> bool {
        matches!(
            self,
            Self::ObjectDoesNotExist
                | Self::SubindexDoesNotExist
                | Self::UnsupportedAccess
                | Self::ReadOnly
                | Self::WriteOnly
                | Self::NoData
        )
    }
}

impl fmt::Display for AbortCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:08X} ({})", self.number(), self.words())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_listed_code_is_found_by_its_number() {
        for &code in AbortCode::LISTED {
            assert_eq!(AbortCode::from_number(code.number()), code);
        }
        assert_eq!(AbortCode::from_number(0x0602_0001), AbortCode::Other(0x0602_0001));
        assert_eq!(AbortCode::Other(7).number(), 7);
    }

    #[test]
    fn codes_are_shown_as_a_number_and_words() {
        let shown = AbortCode::from_number(0x0609_0030).to_string();
        assert_eq!(shown, "0x06090030 (invalid value for the parameter)");
    }
}
