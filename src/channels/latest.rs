//! The newest value, or the last few, from one writer to any number of readers. The writer never waits, and no reader can
//! disturb it. A reader gets a whole value, or knows that it did not.
//!
//! A value is an array of 64-bit atomic words, so that no reader sees half a word and no `unsafe` is needed. It is a
//! sequence lock (Boehm, "Can seqlocks get along with programming language memory models?", MSPC 2012) over several slots in
//! turn. A reader uses the last complete slot, so it need not wait for a writer that was preempted during a write. A read
//! is torn only if the writer has reached the same slot again meanwhile.

use std::slice;
use std::sync::Arc;

use super::primitives::{AtomicU64, Ordering, fence};

/// The slots of a mailbox for the newest value.
const SLOTS: u64 = 4;

/// Where the words of a mailbox are. Any bits in them are harmless.
pub trait Cells {
    /// How many values have been completed; value `n` is in slot `n` modulo the number of slots.
    fn completed(&self) -> &AtomicU64;

    /// The slot of a value.
    fn slot(&self, number: u64) -> &[AtomicU64];

    /// How many slots there are, at least 2.
    fn slot_count(&self) -> u64;

    /// How many values the writer can complete after a value before it begins to overwrite that value.
    fn kept_after(&self) -> u64 {
        self.slot_count().saturating_sub(2)
    }
}

/// Words that were allocated for one mailbox.
pub struct Allocated {
    completed: AtomicU64,
    slots: Box<[Box<[AtomicU64]>]>,
}

impl Cells for Allocated {
    fn completed(&self) -> &AtomicU64 {
        &self.completed
    }

    fn slot(&self, number: u64) -> &[AtomicU64] {
        self.slots.get((number % self.slot_count()) as usize).map_or(&[], |slot| slot)
    }

    fn slot_count(&self) -> u64 {
        self.slots.len() as u64
    }
}

/// A mailbox for the newest value, of up to `words` words, as its two ends.
pub fn latest(words: usize) -> (Writer, Reader) {
    last(words, SLOTS)
}

/// The same with room for so many values (at least 2). All of them but one can be read at any time.
pub fn last(words: usize, slots: u64) -> (Writer, Reader) {
    let slot = || (0..words).map(|_| AtomicU64::new(0)).collect();
    let slots = (0..slots.max(2)).map(|_| slot()).collect();
    let cells = Arc::new(Allocated { completed: AtomicU64::new(0), slots });
    (Writer::over(Arc::clone(&cells)), Reader::over(cells))
}

/// The only end that writes.
pub struct Writer<C = Allocated> {
    cells: Arc<C>,
    completed: u64,
}

impl<C: Cells> Writer<C> {
    /// The writing end of a mailbox that nothing has been written to.
    pub const fn over(cells: Arc<C>) -> Self {
        Self { cells, completed: 0 }
    }

    /// Writes a value, word by word, and publishes it.
    pub fn write(&mut self, encode: impl FnOnce(&mut Words<'_>)) {
        let number = self.completed + 1;
        // A reader that sees one of the words stored below also sees the `completed` stored before.
        fence(Ordering::Release);
        encode(&mut Words(self.cells.slot(number).iter()));
        self.completed = number;
        self.cells.completed().store(number, Ordering::Release);
    }
}

/// The reading end. Clone it for every reader.
pub struct Reader<C = Allocated> {
    cells: Arc<C>,
}

impl<C> Clone for Reader<C> {
    fn clone(&self) -> Self {
        Self { cells: Arc::clone(&self.cells) }
    }
}

/// The result of one attempt to read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Attempt<T> {
    /// There is no newer value.
    Nothing,
    /// A whole value, and its number.
    Whole(T, u64),
    /// The writer has overwritten the value during the read.
    Torn,
}

impl<C: Cells> Reader<C> {
    /// A reading end of a mailbox.
    pub const fn over(cells: Arc<C>) -> Self {
        Self { cells }
    }

    /// One attempt to read a value newer than number `seen` (0 = any). Never waits.
    pub fn attempt<T>(&self, seen: u64, decode: impl FnOnce(&mut Words<'_>) -> T) -> Attempt<T> {
        let number = self.completed();
        if number <= seen {
            return Attempt::Nothing;
        }
        self.read(number, decode).map_or(Attempt::Torn, |value| Attempt::Whole(value, number))
    }

    /// The number of the newest value; 0 before the first one.
    pub fn completed(&self) -> u64 {
        self.cells.completed().load(Ordering::Acquire)
    }

    /// The number of the oldest value that can be read after the newest one of [`Reader::completed`].
    pub fn oldest(&self, completed: u64) -> u64 {
        completed.saturating_sub(self.cells.kept_after()).max(1)
    }

    /// Reads a value that [`Reader::completed`] has counted. `None` if the writer has begun to overwrite it.
    pub fn read<T>(&self, number: u64, decode: impl FnOnce(&mut Words<'_>) -> T) -> Option<T> {
        let value = decode(&mut Words(self.cells.slot(number).iter()));
        fence(Ordering::Acquire);
        let completed = self.cells.completed().load(Ordering::Relaxed);
        (completed.wrapping_sub(number) <= self.cells.kept_after()).then_some(value)
    }
}

/// The words of one value, in order.
pub struct Words<'a>(slice::Iter<'a, AtomicU64>);

impl Words<'_> {
    /// Stores the next word. Words beyond the last one are ignored.
    pub fn put(&mut self, word: u64) {
        if let Some(cell) = self.0.next() {
            cell.store(word, Ordering::Relaxed);
        }
    }

    /// Loads the next word; 0 beyond the last one.
    pub fn take(&mut self) -> u64 {
        self.0.next().map_or(0, |cell| cell.load(Ordering::Relaxed))
    }

    /// Stores a number by its bits.
    pub fn put_f64(&mut self, number: f64) {
        self.put(number.to_bits());
    }

    /// Loads a number by its bits.
    pub fn take_f64(&mut self) -> f64 {
        f64::from_bits(self.take())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn a_value_is_new_only_once() {
        let (mut writer, reader) = latest(1);
        assert_eq!(reader.attempt(0, |words| words.take()), Attempt::Nothing);
        writer.write(|words| words.put(7));
        writer.write(|words| words.put(8));
        assert_eq!(reader.attempt(0, |words| words.take()), Attempt::Whole(8, 2));
        assert_eq!(reader.attempt(2, |words| words.take()), Attempt::Nothing);
    }

    #[test]
    fn a_half_written_value_leaves_the_last_whole_one_readable() {
        let (mut writer, reader) = latest(2);
        writer.write(|words| [1, 1].into_iter().for_each(|word| words.put(word)));
        writer.write(|words| {
            words.put(2);
            assert_eq!(reader.attempt(0, |words| [words.take(), words.take()]), Attempt::Whole([1, 1], 1));
            words.put(2);
        });
        assert_eq!(reader.attempt(0, |words| [words.take(), words.take()]), Attempt::Whole([2, 2], 2));
    }

    #[test]
    fn a_reader_detects_that_its_slot_was_overwritten() {
        for (overtaken_by, is_whole) in [(0, true), (2, true), (3, false), (9, false)] {
            let (mut writer, reader) = latest(1);
            writer.write(|words| words.put(5));
            let attempt = reader.attempt(0, |words| {
                for later in 0..overtaken_by {
                    writer.write(|words| words.put(later));
                }
                words.take()
            });
            assert_eq!(attempt != Attempt::Torn, is_whole, "overtaken by {overtaken_by}");
        }
    }

    #[test]
    fn all_values_but_one_can_be_read_at_any_time() {
        const SLOTS: u64 = 5;
        let (mut writer, reader) = last(1, SLOTS);
        for number in 1..=12 {
            writer.write(|words| {
                words.put(number);
                let completed = number - 1;
                let kept = reader.oldest(completed)..=completed;
                assert!(kept.clone().all(|kept| reader.read(kept, |words| words.take()) == Some(kept)));
                assert_eq!(kept.count() as u64, completed.min(SLOTS - 1));
            });
        }
        assert_eq!(reader.read(8, |words| words.take()), None);
    }

    #[test]
    fn no_reader_gets_a_mixture_of_two_values() {
        const WORDS: usize = 64;
        const READERS: usize = 3;
        let (mut writer, reader) = latest(WORDS);
        let done = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..READERS {
                let (reader, done) = (reader.clone(), &done);
                scope.spawn(move || {
                    let (mut seen, mut whole) = (0, 0);
                    while whole < 20_000 {
                        let read = reader.attempt(0, |words| [(); WORDS].map(|()| words.take()));
                        if let Attempt::Whole(value, number) = read {
                            assert_eq!(value, [number; WORDS]);
                            assert!(number >= seen);
                            (seen, whole) = (number, whole + 1);
                        }
                    }
                    done.fetch_add(1, Ordering::Relaxed);
                });
            }
            let mut number = 0;
            while done.load(Ordering::Relaxed) < READERS {
                number += 1;
                writer.write(|words| (0..WORDS).for_each(|_| words.put(number)));
            }
        });
    }
}
