//! SLCAN: CAN frames as text on a serial line, as adapters between USB and CAN speak it.
//!
//! The commands and the classic frames are those of the LAWICEL CANUSB. `Y` and the CAN FD frames `d D b B` are those of the
//! CANable 2.0 firmware. This module has no input or output: bytes go in, lines come out, and the other way round.
//!
//! A line ends with CR. A reader ignores LF: some adapters and manuals send `CR LF`. A writer sends CR alone, because the
//! firmware of the CANable takes an LF for the first character of the next command.
//!
//! | line | meaning |
//! |---|---|
//! | `t` `T` | classic data frame, 11-bit or 29-bit identifier |
//! | `r` `R` | remote frame |
//! | `d` `D` | CAN FD frame without bit-rate switching |
//! | `b` `B` | CAN FD frame with bit-rate switching |
//! | `S0` … `S8` | bit rate |
//! | `Y1` … `Y8` | bit rate of the data phase, in Mbit/s |
//! | `O` `L` `C` | open, open for listening alone, close |
//!
//! A frame is its letter, three or eight hexadecimal digits of identifier, one digit of length code, and two digits for each
//! byte. An adapter of LAWICEL answers a command with CR, or with BEL when it refuses it; it answers a frame with `z` or `Z`. A
//! CANable answers neither.

mod command;
mod frame_line;
mod reader;

pub use command::{BitRate, Command, DataBitRate};
pub use frame_line::{LINE_BYTES, LineError, LineText, decode_frame, encode_frame};
pub use reader::{AdapterLine, HostLine, LineReader, RawLine};
