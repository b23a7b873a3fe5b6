//! What the real-time thread borrows, with every access relaxed.

#[path = "../../../src/channels/lending.rs"]
pub mod lending;

mod primitives {
    pub use crate::all_relaxed::primitives::{AtomicU64, Ordering};

    pub type AtomicCell<T> = crate::swap_cell::SwapCell<T, crate::swap_cell::Relaxed>;
}
