//! A bounded ring from one thread to one other, on crossbeam's `ArrayQueue`, that never waits.
//!
//! `ArrayQueue` alone is not enough for a real-time thread: its `push` and `pop` spin while another thread is in the middle
//! of an operation on the same slot. If the real-time thread has preempted that thread on the same CPU, the spin never
//! ends. Therefore both ends count their *completed* operations. An end accesses the queue only if the other end has
//! completed its operation on the slot. So every call is wait-free.

use std::sync::Arc;

use crossbeam_utils::CachePadded;

use super::primitives::{ArrayQueue, AtomicU64, Ordering};

struct Shared<T> {
    queue: ArrayQueue<T>,
    pushed: CachePadded<AtomicU64>,
    popped: CachePadded<AtomicU64>,
    dropped: CachePadded<AtomicU64>,
}

/// A ring for `capacity` (at least 1) items, as its two ends.
pub fn ring<T>(capacity: usize) -> (Producer<T>, Consumer<T>) {
    let shared = Arc::new(Shared {
        queue: ArrayQueue::new(capacity.max(1)),
        pushed: CachePadded::new(AtomicU64::new(0)),
        popped: CachePadded::new(AtomicU64::new(0)),
        dropped: CachePadded::new(AtomicU64::new(0)),
    });
    (
        Producer { shared: Arc::clone(&shared), pushed: 0, popped: 0, dropped: 0 },
        Consumer { shared, pushed: 0, popped: 0 },
    )
}

/// The only end that puts items in. So it knows their number without an atomic read.
pub struct Producer<T> {
    shared: Arc<Shared<T>>,
    pushed: u64,
    /// The consumer's completed operations when they were last read. They are read again only when the ring looks full.
    popped: u64,
    dropped: u64,
}

impl<T> Producer<T> {
    /// Puts an item in, or drops and counts it when the ring is full. Returns whether there was room.
    pub fn push(&mut self, item: T) -> bool {
        let capacity = self.shared.queue.capacity() as u64;
        if self.pushed - self.popped >= capacity {
            self.popped = self.shared.popped.load(Ordering::Acquire);
        }
        // Fewer than `capacity` items are in the ring or being taken out, so the slot at the tail is free.
        if self.pushed - self.popped >= capacity || self.shared.queue.push(item).is_err() {
            self.count_dropped();
            return false;
        }
        self.pushed += 1;
        self.shared.pushed.store(self.pushed, Ordering::Release);
        true
    }

    /// The number of items that there is room for now.
    pub fn room(&mut self) -> usize {
        self.popped = self.shared.popped.load(Ordering::Acquire);
        let waiting = (self.pushed - self.popped) as usize;
        self.shared.queue.capacity().saturating_sub(waiting)
    }

    /// Counts an item that was dropped before it came here.
    pub(crate) fn count_dropped(&mut self) {
        self.dropped += 1;
        self.shared.dropped.store(self.dropped, Ordering::Relaxed);
    }
}

/// The end that takes items out.
pub struct Consumer<T> {
    shared: Arc<Shared<T>>,
    /// The producer's completed operations when they were last read. They are read again only when the ring looks empty.
    pushed: u64,
    popped: u64,
}

impl<T> Consumer<T> {
    /// Takes the oldest item out.
    pub fn pop(&mut self) -> Option<T> {
        if self.popped == self.pushed {
            self.pushed = self.shared.pushed.load(Ordering::Acquire);
            if self.popped == self.pushed {
                return None;
            }
        }
        // The item at the head is complete, because the producer counts an item after it has written it.
        let item = self.shared.queue.pop()?;
        self.popped += 1;
        self.shared.popped.store(self.popped, Ordering::Release);
        Some(item)
    }

    /// The number of items that can be taken out now.
    pub fn waiting(&mut self) -> usize {
        self.pushed = self.shared.pushed.load(Ordering::Acquire);
        (self.pushed - self.popped) as usize
    }

    /// The number of items put in since the ring was made.
    pub fn pushed(&self) -> u64 {
        self.shared.pushed.load(Ordering::Acquire)
    }

    /// The number of items dropped since the ring was made.
    pub fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::ring;

    #[test]
    fn items_come_out_in_order_and_a_full_ring_drops_and_counts_the_newest() {
        let (mut producer, mut consumer) = ring(3);
        assert_eq!([1, 2, 3, 4, 5].map(|item| producer.push(item)), [true, true, true, false, false]);
        assert_eq!((consumer.waiting(), consumer.pushed(), consumer.dropped()), (3, 3, 2));
        assert_eq!(consumer.pop(), Some(1));
        assert!(producer.push(6));
        assert_eq!(std::iter::from_fn(|| consumer.pop()).collect::<Vec<_>>(), [2, 3, 6]);
    }

    #[test]
    fn a_ring_of_capacity_0_holds_one_item() {
        let (mut producer, mut consumer) = ring(0);
        assert!(producer.push('a'));
        assert!(!producer.push('b'));
        assert_eq!(consumer.pop(), Some('a'));
        assert_eq!(consumer.pop(), None);
    }

    #[test]
    fn between_two_threads_no_item_is_lost_reordered_or_repeated() {
        const ITEMS: u64 = 20_000;
        let (mut producer, mut consumer) = ring(61);
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for item in 0..ITEMS {
                    while !producer.push(item) {
                        std::thread::yield_now();
                    }
                }
            });
            for expected in 0..ITEMS {
                let item = loop {
                    match consumer.pop() {
                        Some(item) => break item,
                        None => std::thread::yield_now(),
                    }
                };
                assert_eq!(item, expected);
            }
        });
        assert_eq!((consumer.pop(), consumer.pushed()), (None, ITEMS));
    }
}
