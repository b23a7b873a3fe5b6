//! The primitives of the channels. The channels import them only from here, so that `tests/loom` can build the same channels
//! with loom's atomics and try every schedule.

pub use std::sync::atomic::{AtomicU64, Ordering, fence};

pub use crossbeam_queue::ArrayQueue;
pub use crossbeam_utils::atomic::AtomicCell;
