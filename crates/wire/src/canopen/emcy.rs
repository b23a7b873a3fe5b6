//! Emergency messages (CiA 301, 7.2.7), and the names of error codes (CiA 301, table 26; CiA 402, object 603F).

use std::fmt;

use takt_rt::{Frame, Id};

use super::{function_code, node_of};

/// An emergency message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// The sender's node ID, 1 to 127.
    pub node: u8,
    /// The error code; a code 00xx means that the error has been reset.
    pub code: ErrorCode,
    /// Object 1001 of the sender.
    pub register: ErrorRegister,
    /// Five manufacturer-specific bytes.
    pub manufacturer: [u8; 5],
}

impl Emergency {
    /// Decodes a message with the pre-defined identifier 0x80 + node ID; `None` for other frames.
    pub fn decode(frame: &Frame) -> Option<Self> {
        let node = node_of(frame, function_code::EMERGENCY)?;
        let &[low, high, register, a, b, c, d, e] = frame.payload() else { return None };
        Some(Self {
            node,
            code: ErrorCode(u16::from_le_bytes([low, high])),
            register: ErrorRegister(register),
            manufacturer: [a, b, c, d, e],
        })
    }

    /// The message as a frame.
    pub fn frame(self) -> Frame {
        let [low, high] = self.code.0.to_le_bytes();
        let [a, b, c, d, e] = self.manufacturer;
        let id = Id::canopen(function_code::EMERGENCY, self.node);
        Frame::of(id, [low, high, self.register.0, a, b, c, d, e])
    }
}

impl fmt::Display for Emergency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, error register: {}", self.code, self.register)?;
        if self.manufacturer != [0; 5] {
            write!(f, ", manufacturer's bytes {:02X?}", self.manufacturer)?;
        }
        Ok(())
    }
}

/// The error register, object 1001 (CiA 301, 7.5.2.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ErrorRegister(pub u8);

impl ErrorRegister {
    /// Generic error.
    pub const GENERIC: u8 = 0x01;
    /// Current.
    pub const CURRENT: u8 = 0x02;
    /// Voltage.
    pub const VOLTAGE: u8 = 0x04;
    /// Temperature.
    pub const TEMPERATURE: u8 = 0x08;
    /// Communication.
    pub const COMMUNICATION: u8 = 0x10;
    /// Specific to the device profile.
    pub const DEVICE_PROFILE: u8 = 0x20;
    /// Specific to the manufacturer.
    pub const MANUFACTURER: u8 = 0x80;

    const NAMES: [(u8, &'static str); 7] = [
        (Self::GENERIC, "generic"),
        (Self::CURRENT, "current"),
        (Self::VOLTAGE, "voltage"),
        (Self::TEMPERATURE, "temperature"),
        (Self::COMMUNICATION, "communication"),
        (Self::DEVICE_PROFILE, "device profile"),
        (Self::MANUFACTURER, "manufacturer"),
    ];
}

impl fmt::Display for ErrorRegister {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> =
            Self::NAMES.iter().filter(|(bit, _)| self.0 & bit != 0).map(|(_, name)| *name).collect();
        if names.is_empty() { f.write_str("no error") } else { f.write_str(&names.join(" + ")) }
    }
}

/// An error code of emergency messages and object 603F.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ErrorCode(pub u16);

impl ErrorCode {
    /// No error, or the error has been reset.
    pub const NONE: Self = Self(0);

    /// The name of the code; for codes that the standards do not list, the name of its class.
    pub fn words(self) -> &'static str {
        let exact = SPECIFIC.iter().find(|(code, _)| *code == self.0);
        let class =
            || CLASSES.iter().find(|(mask, code, _)| self.0 & mask == *code).map(|(_, _, words)| words);
        exact.map(|(_, words)| words).or_else(class).copied().unwrap_or("unknown error")
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X} ({})", self.0, self.words())
    }
}

/// Codes with their own name.
const SPECIFIC: [(u16, &str); 92] = [
    (0x0000, "no error"),
    (0x2110, "short circuit or earth leakage at the input"),
    (0x2120, "earth leakage at the input"),
    (0x2121, "earth leakage, phase L1"),
    (0x2122, "earth leakage, phase L2"),
    (0x2123, "earth leakage, phase L3"),
    (0x2130, "short circuit at the input"),
    (0x2211, "internal current no. 1"),
    (0x2212, "internal current no. 2"),
    (0x2213, "over-current in the ramp function"),
    (0x2214, "over-current in the sequence"),
    (0x2220, "continuous over-current inside the device"),
    (0x2230, "short circuit or earth leakage inside the device"),
    (0x2240, "earth leakage inside the device"),
    (0x2250, "short circuit inside the device"),
    (0x2310, "continuous over-current at the motor"),
    (0x2311, "current at the motor no. 1"),
    (0x2312, "current at the motor no. 2"),
    (0x2320, "short circuit or earth leakage at the motor"),
    (0x2330, "earth leakage at the motor"),
    (0x2331, "earth leakage at the motor, phase U"),
    (0x2332, "earth leakage at the motor, phase V"),
    (0x2333, "earth leakage at the motor, phase W"),
    (0x2340, "short circuit at the motor"),
    (0x2350, "overload (I²t, thermal state) at the motor"),
    (0x3110, "mains over-voltage"),
    (0x3120, "mains under-voltage"),
    (0x3130, "phase failure"),
    (0x3140, "mains frequency"),
    (0x3210, "DC link over-voltage"),
    (0x3220, "DC link under-voltage"),
    (0x3230, "load error"),
    (0x3310, "output over-voltage"),
    (0x3320, "armature circuit"),
    (0x3330, "field circuit"),
    (0x4110, "excess ambient temperature"),
    (0x4120, "too low ambient temperature"),
    (0x4210, "excess temperature of the device"),
    (0x4220, "too low temperature of the device"),
    (0x4310, "excess temperature of the drive"),
    (0x4320, "too low temperature of the drive"),
    (0x4410, "excess temperature of the supply"),
    (0x5111, "±15 V supply"),
    (0x5112, "+24 V supply"),
    (0x5113, "+5 V supply"),
    (0x5210, "measurement circuit"),
    (0x5220, "computing circuit"),
    (0x5300, "operating unit"),
    (0x5410, "output stages"),
    (0x5430, "input stages"),
    (0x5441, "contact no. 1"),
    (0x5530, "non-volatile memory (EEPROM)"),
    (0x6010, "software reset (watchdog)"),
    (0x6310, "loss of parameters"),
    (0x6320, "parameter error"),
    (0x6330, "parameter initialisation error"),
    (0x7110, "brake chopper"),
    (0x7111, "failure of the brake chopper"),
    (0x7112, "over-current of the brake chopper"),
    (0x7113, "protective circuit of the brake chopper"),
    (0x7121, "motor blocked"),
    (0x7122, "motor error or wrong commutation"),
    (0x7123, "motor tilted"),
    (0x7301, "tachometer fault"),
    (0x7302, "tachometer with wrong polarity"),
    (0x7303, "resolver 1 fault"),
    (0x7304, "resolver 2 fault"),
    (0x7305, "incremental sensor 1 fault"),
    (0x7306, "incremental sensor 2 fault"),
    (0x7307, "incremental sensor 3 fault"),
    (0x7310, "speed sensor"),
    (0x7320, "position sensor"),
    (0x7380, "sensor position difference"),
    (0x7400, "computation circuit"),
    (0x7500, "communication module"),
    (0x7510, "serial interface no. 1"),
    (0x7520, "serial interface no. 2"),
    (0x7600, "data storage"),
    (0x8110, "CAN overrun, messages lost"),
    (0x8120, "CAN in error passive mode"),
    (0x8130, "heartbeat or life guard of the master lost"),
    (0x8140, "recovered from bus off"),
    (0x8150, "CAN identifier collision"),
    (0x8210, "PDO not processed, wrong length"),
    (0x8220, "PDO length exceeded"),
    (0x8230, "DAM MPDO not processed, no such object"),
    (0x8240, "unexpected SYNC data length"),
    (0x8250, "RPDO not received in time"),
    (0x8311, "excess torque"),
    (0x8480, "excess difference between target and actual speed"),
    (0x8611, "following error"),
    (0x8612, "reference limit reached"),
];

/// Mask, value and name of the classes, narrower ones first.
const CLASSES: [(u16, u16, &str); 41] = [
    (0xFF00, 0x0000, "error reset"),
    (0xFF00, 0x1000, "generic error"),
    (0xFF00, 0x2100, "current at the input"),
    (0xFF00, 0x2200, "current inside the device"),
    (0xFF00, 0x2300, "current at the output"),
    (0xF000, 0x2000, "current"),
    (0xFF00, 0x3100, "mains voltage"),
    (0xFF00, 0x3200, "voltage inside the device"),
    (0xFF00, 0x3300, "output voltage"),
    (0xF000, 0x3000, "voltage"),
    (0xFF00, 0x4100, "ambient temperature"),
    (0xFF00, 0x4200, "temperature of the device"),
    (0xFF00, 0x4300, "temperature of the drive"),
    (0xFF00, 0x4400, "temperature of the supply"),
    (0xF000, 0x4000, "temperature"),
    (0xFF00, 0x5100, "supply of the electronics"),
    (0xFF00, 0x5200, "control electronics"),
    (0xFF00, 0x5400, "power section"),
    (0xFF00, 0x5500, "data storage"),
    (0xF000, 0x5000, "device hardware"),
    (0xFF00, 0x6100, "internal software"),
    (0xFF00, 0x6200, "user software"),
    (0xFF00, 0x6300, "data set"),
    (0xF000, 0x6000, "device software"),
    (0xFF00, 0x7100, "power module"),
    (0xFF00, 0x7200, "measurement circuit module"),
    (0xFF00, 0x7300, "sensor"),
    (0xFF00, 0x7400, "computation module"),
    (0xFF00, 0x7500, "communication module"),
    (0xFF00, 0x7600, "data storage module"),
    (0xF000, 0x7000, "additional module"),
    (0xFF00, 0x8100, "communication"),
    (0xFF00, 0x8200, "protocol"),
    (0xFF00, 0x8300, "torque control"),
    (0xFF00, 0x8400, "speed control"),
    (0xFF00, 0x8500, "position control"),
    (0xFF00, 0x8600, "positioning controller"),
    (0xF000, 0x8000, "monitoring"),
    (0xFF00, 0x9000, "external error"),
    (0xFF00, 0xF000, "additional function"),
    (0xFF00, 0xFF00, "specific to the manufacturer"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_emergency_message_is_decoded_field_by_field() {
        let bytes = [0x0F, 0x73, 0x81, 1, 2, 3, 4, 5];
        let emergency = Emergency::decode(&Frame::of(Id::canopen(0x80, 2), bytes)).unwrap();
        let expected = Emergency {
            node: 2,
            code: ErrorCode(0x730F),
            register: ErrorRegister(0x81),
            manufacturer: [1, 2, 3, 4, 5],
        };
        assert_eq!(emergency, expected);
        assert_eq!(Emergency::decode(&emergency.frame()), Some(expected));
        assert_eq!(
            emergency.to_string(),
            "0x730F (sensor), error register: generic + manufacturer, \
             manufacturer's bytes [01, 02, 03, 04, 05]"
        );
    }

    #[test]
    fn sync_and_short_frames_are_not_emergency_messages() {
        assert_eq!(Emergency::decode(&Frame::of(Id::canopen(0x80, 0), [0; 8])), None);
        assert_eq!(Emergency::decode(&Frame::of(Id::canopen(0x80, 1), [0; 7])), None);
        assert_eq!(Emergency::decode(&Frame::of(Id::canopen(0x100, 0), [0; 8])), None);
    }

    #[test]
    fn codes_are_named_by_the_narrowest_entry() {
        assert_eq!(ErrorCode(0x8130).words(), "heartbeat or life guard of the master lost");
        assert_eq!(ErrorCode(0x3210).words(), "DC link over-voltage");
        assert_eq!(ErrorCode(0x3299).words(), "voltage inside the device");
        assert_eq!(ErrorCode(0x3999).words(), "voltage");
        assert_eq!(ErrorCode(0xFF12).words(), "specific to the manufacturer");
        assert_eq!(ErrorCode(0xA000).words(), "unknown error");
    }

    #[test]
    fn every_class_of_table_26_has_a_name() {
        let table = [
            (0x0000, "no error"),
            (0x1000, "generic error"),
            (0x2000, "current"),
            (0x2100, "current at the input"),
            (0x2200, "current inside the device"),
            (0x2300, "current at the output"),
            (0x3000, "voltage"),
            (0x3100, "mains voltage"),
            (0x3200, "voltage inside the device"),
            (0x3300, "output voltage"),
            (0x4000, "temperature"),
            (0x4100, "ambient temperature"),
            (0x4200, "temperature of the device"),
            (0x5000, "device hardware"),
            (0x6000, "device software"),
            (0x6100, "internal software"),
            (0x6200, "user software"),
            (0x6300, "data set"),
            (0x7000, "additional module"),
            (0x8000, "monitoring"),
            (0x8100, "communication"),
            (0x8110, "CAN overrun, messages lost"),
            (0x8120, "CAN in error passive mode"),
            (0x8130, "heartbeat or life guard of the master lost"),
            (0x8140, "recovered from bus off"),
            (0x8150, "CAN identifier collision"),
            (0x8200, "protocol"),
            (0x8210, "PDO not processed, wrong length"),
            (0x8220, "PDO length exceeded"),
            (0x8230, "DAM MPDO not processed, no such object"),
            (0x8240, "unexpected SYNC data length"),
            (0x8250, "RPDO not received in time"),
            (0x9000, "external error"),
            (0xF000, "additional function"),
            (0xFF00, "specific to the manufacturer"),
        ];
        for (code, words) in table {
            assert_eq!(ErrorCode(code).words(), words, "{code:04X}");
        }
    }

    #[test]
    fn every_bit_of_the_register_in_the_standard_has_a_name() {
        let named: Vec<String> =
            (0..8).map(|bit| ErrorRegister(1 << bit).to_string()).filter(|name| name != "no error").collect();
        let expected = [
            "generic",
            "current",
            "voltage",
            "temperature",
            "communication",
            "device profile",
            "manufacturer",
        ];
        assert_eq!(named, expected, "bit 6 is reserved");
    }

    #[test]
    fn the_tables_have_no_code_twice_and_no_class_hides_a_narrower_one() {
        for (place, (code, _)) in SPECIFIC.iter().enumerate() {
            assert!(!SPECIFIC[..place].iter().any(|(other, _)| other == code), "{code:#06x} twice");
        }
        for (place, (mask, code, _)) in CLASSES.iter().enumerate() {
            let hidden = CLASSES[..place].iter().any(|(wider, other, _)| code & wider == *other);
            assert!(!hidden, "{mask:#06x} {code:#06x} is never reached");
        }
    }

    #[test]
    fn a_register_without_bits_means_no_error() {
        assert_eq!(ErrorRegister(0).to_string(), "no error");
        assert_eq!(ErrorRegister(0x15).to_string(), "generic + voltage + communication");
    }
}
