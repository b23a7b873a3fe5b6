//! Protocols of drives and buses without I/O: the caller passes time, frames and bytes in, and sends the frames and bytes that come out.
//!
//! - [`canopen`]: the services of CiA 301, the layer settings of CiA 305, and the device descriptions of CiA 306 (EDS, DCF).
//! - [`erob_can`]: the CAN protocol of ZeroErr eRob drives.
//! - [`modbus`]: the frames of Modbus-RTU, its master and its slave.
//! - [`hollow_lines`]: the serial lines of the hollow-shaft motors.
//! - [`quirks`] and [`bit_fields`]: the data that describes a drive, as its files say it.
//! - [`bus_log`]: logs of frames, in the formats of other programs.
//! - [`frame_time`] and [`wire_length`]: the longest and the exact time of a frame on the wire.
//!
//! The rest is for messages about the files that people write: [`source_text`] shows a problem at its line, [`printable`] makes text safe
//! for a terminal, and [`text_file`] reads a file. It is the only module that uses the operating system.
//!
//! The types of frames are those of [`takt_rt`]. To command an arm, depend on `takt` instead.
//!
//! # The order of modules
//! Each module uses only what stands below it (`tests/repository/arrows.rs` proves it):
//!
//! ```text
//! quirks bit_fields                   deviations from CiA 402; drives of fixed frames
//! canopen                             CiA 301, 305 and 306
//! erob_can modbus hollow_lines        the protocol of one maker; Modbus-RTU; serial lines
//! bus_log                             logs of frames
//! wire_length frame_time              times of frames
//! described_drive                     the drive that a file is about
//! source_text printable text_file     text of files and of messages
//! ```
#![deny(unsafe_code)]

pub mod bit_fields;
pub mod bus_log;
pub mod canopen;
pub mod described_drive;
pub mod erob_can;
pub mod frame_time;
pub mod hollow_lines;
pub mod modbus;
pub mod printable;
pub mod quirks;
pub mod source_text;
pub mod text_file;
pub mod wire_length;
