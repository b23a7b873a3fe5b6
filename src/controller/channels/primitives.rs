//! What the channels are built on. They take it from here and from nowhere else, so that `tests/loom` can build the
//! very same channels on loom's atomics and try every schedule.

pub use std::sync::atomic::{AtomicU64, Ordering, fence};

pub use crossbeam::queue::ArrayQueue;
