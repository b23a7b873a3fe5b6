//! What takes memory from the heap, and what must not. All of these tests share an allocator that counts for each thread.
#![allow(unsafe_code, reason = "a global allocator that counts cannot be written without")]

mod callback;
mod journal;
mod memory;
mod realtime_loop;
mod simulated_bus;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// What a thread has done with the heap.
#[derive(Clone, Copy, Default)]
struct Heap {
    /// Calls that allocate, reallocate or free.
    calls: u64,
    /// Bytes allocated less those freed.
    held_bytes: i64,
    /// The most of them at a time since [`most_held_by`] was called.
    highest_bytes: i64,
}

thread_local! {
    static HEAP: Cell<Heap> = const { Cell::new(Heap { calls: 0, held_bytes: 0, highest_bytes: 0 }) };
}

/// Returns what the calling thread has done with the heap so far.
fn heap() -> Heap {
    HEAP.with(Cell::get)
}

/// Returns the most bytes that the calling thread holds at a time while it does something, less those that it holds now.
fn most_held_by(something: impl FnOnce()) -> i64 {
    let before = heap().held_bytes;
    HEAP.with(|heap| heap.set(Heap { highest_bytes: before, ..heap.get() }));
    something();
    heap().highest_bytes - before
}

/// The system's allocator with a count for each thread.
struct Counting;

impl Counting {
    fn count(bytes: i64) {
        // A thread that ends frees after its counts are gone.
        let _ = HEAP.try_with(|heap| {
            let Heap { calls, held_bytes, highest_bytes } = heap.get();
            let held_bytes = held_bytes + bytes;
            heap.set(Heap { calls: calls + 1, held_bytes, highest_bytes: highest_bytes.max(held_bytes) });
        });
    }
}

// SAFETY: every call is passed on unchanged to the system's allocator, and counting touches no memory of the heap.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        Self::count(layout.size() as i64);
        // SAFETY: the caller keeps the contract of `alloc`, which is the same here.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        Self::count(-(layout.size() as i64));
        // SAFETY: `pointer` came from `System` with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        Self::count(size as i64 - layout.size() as i64);
        // SAFETY: `pointer` came from `System` with this layout, and the caller keeps the contract of `realloc`.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;
