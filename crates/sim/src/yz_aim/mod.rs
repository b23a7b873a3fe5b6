//! A simulated YZ-AIM integrated servo with CANopen, by its manual (edition v1.62) and field experience: object
//! dictionary, SDO, NMT, PDO, heartbeat producer and consumer, its own controlword and statusword, profile position,
//! velocity, homing and interpolated position, alarms, and the joint behind a gear.
//!
//! ```text
//! data sheet, quirks ── cia402::node, cia402::services   SDO, PDO, NMT, heartbeat producer and consumer
//!                            ├── bit_rate    the procedure that changes the bit rate
//!                            ├── device      controlword → statusword
//!                            ├── alarms      260Eh
//!                            ├── defects     defects that such a unit can have
//!                            └── cia402::homing, motion → servo → plant
//! ```
//!
//! Choices where neither the manual nor traces give an answer:
//! - After power-up the drive holds its shaft (statusword 0404h has bit 2 set); 0006h and 0007h release it. An alarm
//!   that stops the motor also releases it and clears 2601h. A lost heartbeat (20h) decelerates and holds.
//! - After an alarm was cleared the drive holds its position. After 20h it continues to its old target.
//! - An interpolated target takes effect at SYNC and is reached 2 ms later on a straight line, without the ramp of
//!   6083h and within the motor's speed. Half a second beyond that speed is a stall (14h). Without a new target the
//!   last one is held. Interpolation needs mode 7, and 2619h = 7 stored before power-up; 261Ch has no effect.
//! - A relative target is added to the last one. Statusword bit 10 has a window of 10 counts or 5 r/min.
//! - SDO writes of values out of range, to read-only objects and of wrong lengths are aborted; RPDOs ignore such
//!   values.
//! - A heartbeat has the code 04h during an alarm, also in NMT pre-operational.
//! - "Reset node" disables the drive. It does not activate a new node address, bit rate or special function, and does
//!   not clear an alarm that stops the motor. "Stop" and "reset communication" do not affect the motor.
//! - 2618h limits the torque at standstill, with 600 as the peak torque; its alarm and that of 261Dh are 12h.
//!   Over-voltage lasts 0.1 s and cannot be cleared earlier. Under-voltage, temperature and encoder faults have no
//!   alarm and no effect.
//! - 260Ch counts pulses before the electronic gear, 607Ah encoder counts. There are no pulses: special functions 0, 2
//!   and 3 do nothing. 60FDh has DIR in bit 0 and PU in bit 1.
//! - Gains, 2604h and 2609h can be read and written, without effect.

mod alarms;
mod bit_rate;
mod defects;
mod device;
mod joint;
mod motion;
mod parameters;
mod places;

pub use joint::YzAimJoint;
pub use parameters::{COUNTS_PER_TURN, Gearing, HomingBehaviour, Model, Quirks, Ratings, YzAimParameters};
