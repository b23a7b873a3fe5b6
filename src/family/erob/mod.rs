//! What the modules have in common that commands move, and no cycle: eRobs with the vendor's own CAN protocol, and those with Modbus-RTU.
//! Both protocols have the same motions, states and quantities, each at its own addresses.
//!
//! - [`module`]: a module as a session with it sees it: what each protocol says in its own way.
//! - [`motion`]: the motions of the manuals.
//! - [`procedure`]: a motion from the first look to the disabled motor.
//! - `tasks`: the motions of `takt drive`, in the units and within the limits of the axis.
//! - `selection`: what the user reads and writes, by name or address, with units and words.
//! - `following`: the velocity that leads a joint beside the cycle, and the times of that.
//! - `simulated`: the module that stands in for an axis.

pub mod following;
pub mod module;
pub mod motion;
pub mod procedure;
pub mod selection;
pub mod simulated;
pub mod tasks;

use takt_rt::Nanoseconds;

/// The name of the error 730F in English and in Chinese.
pub const BATTERY_LOW: (&str, &str) =
    ("battery voltage of the multi-turn encoder low", "多圈编码器电池电压低");

/// From power-on until a module can be enabled (cure of the errors 001F and 0056 of its own CAN protocol).
pub const ENABLED_FROM_NS: Nanoseconds = 8_000_000_000;
/// From enabling to the start of a motion, and to a set-point (eRob Modbus-RTU manual; that of the own CAN protocol says nothing of it).
pub const ENABLING_NS: Nanoseconds = 500_000_000;
/// From one attempt to enable to the next, while the module starts.
pub const AGAIN_NS: Nanoseconds = 500_000_000;
/// The time that a module needs to save its parameters; its power must stay on.
pub const SAVING_NS: Nanoseconds = 3_000_000_000;
/// A joint slower than this stands: counts/s. The readings of a joint at rest are not quite 0.
pub const STANDING: i32 = 300;
