//! Simulated hollow-shaft motors and their encoder on serial lines: what the manual says of them, no more.

mod bridge;
mod console;
mod encoder;
mod motor;
mod pulse_module;
mod registers;

pub use bridge::Bridge;
pub use console::Console;
pub use encoder::Encoder;
pub use pulse_module::PulseModule;
pub use registers::RegisterBridge;

use takt_wire::hollow_lines;
use takt_wire::hollow_lines::transparent;

use super::serial_device::SerialDeviceKind;

/// The identifiers of the motors behind the RS-485 module.
const MOTORS: [u8; 4] = [1, 2, 3, 4];
/// Where the encoder stands in the example of the manual, in counts.
const ENCODER_COUNTS: u32 = 678_257;

/// Every device here, for `takt sim --serial`.
pub static DEVICES: [SerialDeviceKind; 5] = [
    SerialDeviceKind {
        name: "hollow-rs485",
        what: "the RS-485 module of the hollow-shaft motors in transparent mode, with motors 1 to 4",
        use_words: || {
            format!(
                "{} baud on a real line; frames of {} bytes: identifier, 16 bytes, CRC-32",
                transparent::BAUD_RATE,
                transparent::FRAME_BYTES
            )
        },
        make: || Box::new(Bridge::new(&MOTORS)),
    },
    SerialDeviceKind {
        name: "hollow-modbus",
        what: "the same in its Modbus mode",
        use_words: || {
            format!(
                "{} baud on a real line; Modbus-RTU, 16 registers from 0x0000",
                hollow_lines::registers::BAUD_RATE
            )
        },
        make: || Box::new(RegisterBridge::new(&MOTORS)),
    },
    SerialDeviceKind {
        name: "hollow-console",
        what: "the serial console of such a motor",
        use_words: || {
            format!("{} baud on a real line; each command ends with LF CR", hollow_lines::console::BAUD_RATE)
        },
        make: || Box::new(Console::default()),
    },
    SerialDeviceKind {
        name: "hollow-encoder",
        what: "the hollow encoder",
        use_words: || "a request and its reply have the form of the RS-485 module".to_owned(),
        make: || Box::new(Encoder::new(ENCODER_COUNTS)),
    },
    SerialDeviceKind {
        name: "hollow-pulse",
        what: "the pulse module",
        use_words: || "settings of six bytes; nothing is answered".to_owned(),
        make: || Box::new(PulseModule::default()),
    },
];
