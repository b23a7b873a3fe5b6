//! What the real-time thread borrows: callbacks and trajectories.

#[path = "../../../src/channels/lending.rs"]
pub mod lending;

mod primitives {
    pub use loom::sync::atomic::{AtomicU64, Ordering};

    pub type AtomicCell<T> = crate::swap_cell::SwapCell<T, crate::swap_cell::AcquireRelease>;
}
