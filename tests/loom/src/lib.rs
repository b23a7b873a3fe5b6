//! The lock-free channels of the host interface, the very source files of takt, built on loom's atomics: loom runs a test again
//! and again, through every order in which the threads can be scheduled and every value that a load may see.
//!
//! What is proven here holds for the bounds that each test names. Loom knows the relaxed, acquire and release accesses
//! and fences that the channels use, and keeps the last seven values of an atomic; no test here writes more. It does
//! not let a load see a store that is executed later (load buffering). The mailbox has no such executions, for
//! only one end stores, nor has the ring, for what an end stores for the other is a release store, which no earlier
//! access of its thread can come after.
//!
//! [`without_fences`] and [`all_relaxed`] are the same sources once more with the ordering taken away. They must
//! fail: that shows that the tests would notice.

#![expect(clippy::duplicate_mod, reason = "the same source on other atomics is what the weakened ones are")]

pub mod all_relaxed;
mod array_queue;
pub mod without_fences;

#[path = "../../../src/controller/channels/latest.rs"]
pub mod latest;
#[path = "../../../src/controller/channels/records.rs"]
pub mod records;
#[path = "../../../src/controller/channels/ring.rs"]
pub mod ring;

mod primitives {
    pub use crate::array_queue::ArrayQueue;
    pub use loom::sync::atomic::{AtomicU64, Ordering, fence};
}
