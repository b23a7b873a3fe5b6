//! The mailbox and the ring with every access relaxed. The fences are the real ones.

#[path = "../../../src/controller/channels/latest.rs"]
pub mod latest;
#[path = "../../../src/controller/channels/ring.rs"]
pub mod ring;

mod primitives {
    pub use crate::array_queue::ArrayQueue;
    pub use loom::sync::atomic::{Ordering, fence};

    pub struct AtomicU64(loom::sync::atomic::AtomicU64);

    impl AtomicU64 {
        pub fn new(value: u64) -> Self {
            Self(loom::sync::atomic::AtomicU64::new(value))
        }

        pub fn load(&self, _: Ordering) -> u64 {
            self.0.load(Ordering::Relaxed)
        }

        pub fn store(&self, value: u64, _: Ordering) {
            self.0.store(value, Ordering::Relaxed);
        }
    }
}
