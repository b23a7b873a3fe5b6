//! SDO abort codes (CiA 301, 7.2.4.3.17).

use std::fmt;

macro_rules! abort_codes {
    ($($name:ident = $code:literal, $words:literal, $chinese:literal;)*) => {
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
                self.bilingual().0
            }

            /// Its meaning in English and in Chinese.
            pub const fn bilingual(self) -> (&'static str, &'static str) {
                match self {
                    $(Self::$name => ($words, $chinese),)*
                    Self::Other(_) => ("manufacturer-specific code", "厂商自定义代码"),
                }
            }
        }
    };
}

abort_codes! {
    ToggleBitNotAlternated = 0x0503_0000, "toggle bit not alternated", "翻转位未交替";
    ProtocolTimedOut = 0x0504_0000, "SDO protocol timed out", "SDO 协议超时";
    CommandSpecifierUnknown = 0x0504_0001, "client/server command specifier not valid or unknown", "命令字无效或未知";
    InvalidBlockSize = 0x0504_0002, "invalid block size", "块大小无效";
    InvalidSequenceNumber = 0x0504_0003, "invalid sequence number", "序号无效";
    CrcError = 0x0504_0004, "CRC error", "CRC 错误";
    OutOfMemory = 0x0504_0005, "out of memory", "内存不足";
    UnsupportedAccess = 0x0601_0000, "unsupported access to the object", "不支持对该对象的访问";
    WriteOnly = 0x0601_0001, "attempt to read a write-only object", "试图读取只写对象";
    ReadOnly = 0x0601_0002, "attempt to write a read-only object", "试图写入只读对象";
    ObjectDoesNotExist = 0x0602_0000, "object does not exist in the object dictionary", "对象字典中没有该对象";
    ObjectCannotBeMapped = 0x0604_0041, "object cannot be mapped to the PDO", "对象不能映射到 PDO";
    MappingTooLong = 0x0604_0042, "number and length of the mapped objects would exceed the PDO", "映射对象的数量和长度超出 PDO";
    ParameterIncompatible = 0x0604_0043, "general parameter incompatibility", "参数不兼容";
    InternalIncompatibility = 0x0604_0047, "general internal incompatibility in the device", "设备内部不兼容";
    HardwareError = 0x0606_0000, "access failed due to a hardware error", "硬件错误导致访问失败";
    LengthMismatch = 0x0607_0010, "data type does not match, length of the parameter does not match", "数据类型不符，参数长度不符";
    LengthTooHigh = 0x0607_0012, "data type does not match, parameter too long", "数据类型不符，参数过长";
    LengthTooLow = 0x0607_0013, "data type does not match, parameter too short", "数据类型不符，参数过短";
    SubindexDoesNotExist = 0x0609_0011, "sub-index does not exist", "子索引不存在";
    InvalidValue = 0x0609_0030, "invalid value for the parameter", "参数值无效";
    ValueTooHigh = 0x0609_0031, "value of the parameter too high", "参数值过大";
    ValueTooLow = 0x0609_0032, "value of the parameter too low", "参数值过小";
    MaximumBelowMinimum = 0x0609_0036, "maximum value is less than the minimum value", "最大值小于最小值";
    ResourceNotAvailable = 0x060A_0023, "resource not available: SDO connection", "资源不可用：SDO 连接";
    General = 0x0800_0000, "general error", "一般错误";
    CannotTransfer = 0x0800_0020, "data cannot be transferred or stored to the application", "数据无法传送或存入应用程序";
    LocalControl = 0x0800_0021, "data cannot be transferred or stored because of local control", "由于本地控制，数据无法传送或存储";
    PresentDeviceState = 0x0800_0022, "data cannot be transferred or stored because of the present device state", "由于设备当前状态，数据无法传送或存储";
    NoObjectDictionary = 0x0800_0023, "no object dictionary is present or its generation failed", "没有对象字典或其生成失败";
    NoData = 0x0800_0024, "no data available", "没有可用数据";
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
