//! The YZ-AIM integrated servo with CANopen, as its manual (edition v1.62) describes it and as real units behave: object
//! dictionary, SDO, NMT, PDO, heartbeat in both directions, its own controlword and statusword, profile position,
//! velocity, homing and interpolated position, alarms, and the joint behind a gear.
//!
//! ```text
//! objects ── dictionary ──┬── sdo            requests of the master
//!                         ├── process_data   RPDO, TPDO, SYNC
//!                         ├── network        NMT, heartbeat of the drive and of the master
//!                         ├── bit_rate       the procedure of four writes
//!                         ├── device         controlword → statusword
//!                         ├── alarms         260Eh
//!                         ├── defects        what is wrong and raises no alarm by itself
//!                         └── homing, motion → servo → plant
//! ```
//!
//! Choices where neither manual nor traces say anything:
//! - A cold drive holds its shaft (its statusword 0404h has bit 2 set); 0006h and 0007h leave it free. An alarm that
//!   stops the motor leaves it free too and clears 2601h; the lost heartbeat (20h) decelerates and holds.
//! - After an alarm was cleared the drive holds where it is. After 20h it goes on to its old target.
//! - An interpolated target is taken at SYNC and reached 2 ms later on a straight line, without the ramp of 6083h; only
//!   as fast as the motor can. Half a second of that is a stall (14h). A missing target holds the last one. It wants mode 7
//!   and 2619h = 7 stored before power-up; 261Ch has no effect.
//! - A relative target is added to the last one. Bit 10 has a window of 10 counts or 5 r/min.
//! - Values out of range, read-only objects and wrong lengths are aborted; RPDOs leave such values out.
//! - A heartbeat says 04h in pre-operational too while there is an alarm.
//! - "Reset node" makes the drive cold but neither renews node address, bit rate and special function nor clears a
//!   stopping alarm. "Stop" and "reset communication" leave the motor alone.
//! - 2618h limits the torque at standstill, 600 being the peak torque; its alarm and the one of 261Dh are 12h. Over-voltage
//!   lasts 0.1 s, and cannot be cleared before. There are no alarms for under-voltage, temperature and encoder, so
//!   these faults go unnoticed.
//! - 260Ch counts pulses before the electronic gear; 607Ah counts the encoder. Pulses themselves do not come: special
//!   functions 0, 2 and 3 do nothing. 60FDh has DIR in bit 0 and PU in bit 1.
//! - Gains, 2604h and 2609h can be written and read, and do nothing.

mod alarms;
mod bit_rate;
mod defects;
mod device;
mod dictionary;
mod homing;
mod joint;
mod motion;
mod network;
mod objects;
mod parameters;
mod process_data;
mod sdo;

pub use joint::YzAimJoint;
pub use objects::{OBJECTS, Object};
pub use parameters::{COUNTS_PER_TURN, Gearing, HomingBehaviour, Model, Quirks, Ratings, YzAimParameters};
