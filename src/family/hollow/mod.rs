//! Hollow-shaft motors HO4307 to HO10025 (their manual, and field experience), in the loop over CAN and over CAN FD, and what is on their
//! serial lines.
//!
//! They are drives of bit fields: the three protocols are descriptions beside this file. A motor is a slave that answers each frame with one
//! reply, 500 µs later. It has no watchdog: without commands it goes on with the last one.
//!
//! - `registers_task`: a motor behind the converter in its Modbus mode.
//! - `lines`: the console of a motor, the hollow encoder, the pulse module.
//! - [`pwm`], [`encoder_output`]: what the pins of a motor mean.
//!
//! The wire formats of the serial lines, which the simulated devices need as well, are in `hollow_lines`.

pub mod encoder_output;
mod lines;
pub mod pwm;
mod pwm_task;
mod registers_task;
mod scan;

use takt_wire::bit_fields::Description;

use crate::config::FamilyKeys;
use crate::family::bit_fields::{BitFieldFamily, FoundBy, shipped};

pub use lines::{CONSOLE, ENCODER, PULSE};

/// Motors over CAN, in normal mode, or in extended mode (`extended = true`).
pub static CAN: BitFieldFamily = BitFieldFamily {
    word: "hollow-can",
    name: "hollow-shaft motor",
    bit_rates: &[1_000_000],
    describe: can,
    on_line: None,
    pulse_width: Some(pwm_task::report),
    found_by: Some(FoundBy {
        protocols: || &[&scan::CanScan],
        on_line: None,
        starting_keys: scan::starting_keys,
    }),
};

/// Motors over CAN FD, also behind a converter from RS-485.
pub static CAN_FD: BitFieldFamily = BitFieldFamily {
    word: "hollow-can-fd",
    name: "hollow-shaft motor with CAN FD",
    bit_rates: &[1_000_000],
    describe: |_| Some(shipped("hollow-can-fd", include_str!("can_fd.toml"))),
    on_line: Some(registers_task::begin),
    pulse_width: Some(pwm_task::report),
    found_by: Some(FoundBy {
        protocols: || &[&scan::FdScan],
        on_line: Some(|session, bit_rate| Box::pin(scan::look(session, bit_rate))),
        starting_keys: scan::starting_keys,
    }),
};

fn can(keys: &mut FamilyKeys<'_, '_>) -> Option<Description> {
    Some(match keys.boolean("extended")? {
        false => shipped("hollow-can", include_str!("can.toml")),
        true => shipped("hollow-can in extended mode", include_str!("can_extended.toml")),
    })
}
