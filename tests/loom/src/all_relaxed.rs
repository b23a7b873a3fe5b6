//! The mailbox, the ring and the requests of clients with every access relaxed. The fences are the real ones.

#[path = "../../../src/channels/client_requests.rs"]
pub mod client_requests;

#[path = "../../../src/channels/latest.rs"]
pub mod latest;
#[path = "../../../src/channels/ring.rs"]
pub mod ring;

mod request_numbers {
    pub use crate::request_numbers::RequestNumbers;
}

pub mod primitives {
    pub use crate::array_queue::ArrayQueue;
    pub use crate::atomic_cell::AtomicCell;
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

        pub fn swap(&self, value: u64, _: Ordering) -> u64 {
            self.0.swap(value, Ordering::Relaxed)
        }

        pub fn fetch_or(&self, bits: u64, _: Ordering) -> u64 {
            self.0.fetch_or(bits, Ordering::Relaxed)
        }

        pub fn fetch_and(&self, bits: u64, _: Ordering) -> u64 {
            self.0.fetch_and(bits, Ordering::Relaxed)
        }

        pub fn fetch_max(&self, value: u64, _: Ordering) -> u64 {
            self.0.fetch_max(value, Ordering::Relaxed)
        }

        pub fn fetch_add(&self, value: u64, _: Ordering) -> u64 {
            self.0.fetch_add(value, Ordering::Relaxed)
        }

        pub fn compare_exchange(&self, current: u64, new: u64, _: Ordering, _: Ordering) -> Result<u64, u64> {
            self.0.compare_exchange(current, new, Ordering::Relaxed, Ordering::Relaxed)
        }

        pub fn compare_exchange_weak(
            &self,
            current: u64,
            new: u64,
            _: Ordering,
            _: Ordering,
        ) -> Result<u64, u64> {
            self.0.compare_exchange_weak(current, new, Ordering::Relaxed, Ordering::Relaxed)
        }
    }
}
