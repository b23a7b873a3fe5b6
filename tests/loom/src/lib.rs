//! The lock-free channels of takt, from their own source files, built with loom's atomics. Loom repeats a test with every
//! order in which the threads can be scheduled, and with every value that a load may see.
//!
//! The proof holds for the bounds that each test names. Loom knows the relaxed, acquire and release accesses and fences of
//! the channels. It keeps the last seven values of an atomic, and no test here writes more. It does not model load
//! buffering: a load never sees a store that is executed later. The mailbox has no such executions, since only one end
//! stores. The ring has none either: an end stores for the other end with release, and no earlier access of its thread can
//! come after a release store. The same holds for the requests of clients: they change hands by a release of a bit; and for
//! what is lent: it changes hands by an exchange of a pointer.
//!
//! [`without_fences`], [`all_relaxed`] and [`lent_relaxed`] are the same sources without the ordering. They must fail: that shows that the
//! tests detect a missing ordering.

#![expect(clippy::duplicate_mod, reason = "the same source on other atomics is what the weakened ones are")]

pub mod all_relaxed;
mod array_queue;
mod atomic_cell;
pub mod lent;
pub mod lent_relaxed;
mod swap_cell;
pub mod without_fences;

#[path = "../../../src/channels/client_requests.rs"]
pub mod client_requests;
#[path = "../../../src/channels/latest.rs"]
pub mod latest;
#[path = "../../../src/channels/records.rs"]
pub mod records;
#[path = "../../../src/channels/request_numbers.rs"]
pub mod request_numbers;
#[path = "../../../src/channels/ring.rs"]
pub mod ring;

mod primitives {
    pub use crate::array_queue::ArrayQueue;
    pub use crate::atomic_cell::AtomicCell;
    pub use loom::sync::atomic::{AtomicU64, Ordering, fence};
}
