//! Things that the real-time thread borrows, and never frees: there and back.
//!
//! No call waits for another thread. A slot is used by one side at a time: by whoever has claimed it, by the real-time thread from
//! when it has taken the thing, and by whoever collects what has come back.
//!
//! ```text
//! lend:       claim a slot (id 0 → CLAIMED) → put the thing in → show its id
//! real time:  find the id → take the thing (id BORROWED) → … → put it into `back`
//! collect:    take it from `back` → free it → give the slot back (id 0)
//! ```

use std::sync::Arc;

use arrayvec::ArrayVec;

use super::primitives::{AtomicCell, AtomicU64, Ordering};

/// The most things that are with the real-time thread, or on their way there or back.
pub const LENT_AT_MOST: usize = 16;

/// A slot that nobody uses, one that has been claimed, and one whose thing is with the real-time thread, or has come back.
const FREE: u64 = 0;
const CLAIMED: u64 = u64::MAX;
const BORROWED: u64 = u64::MAX - 1;

struct Slot<T> {
    id: AtomicU64,
    there: AtomicCell<Option<Box<T>>>,
    back: AtomicCell<Option<Box<T>>>,
}

struct Table<T> {
    newest: AtomicU64,
    slots: Box<[Slot<T>]>,
}

/// The two ends of the way there and back, for so many things (at most [`LENT_AT_MOST`]).
pub fn lending<T>(slots: usize) -> (Lender<T>, Borrower<T>) {
    // A cell with a lock inside could stop the real-time thread.
    const { assert!(AtomicCell::<Option<Box<T>>>::is_lock_free()) };
    let slot =
        || Slot { id: AtomicU64::new(FREE), there: AtomicCell::new(None), back: AtomicCell::new(None) };
    let slots = (0..slots.min(LENT_AT_MOST)).map(|_| slot()).collect();
    let table = Arc::new(Table { newest: AtomicU64::new(0), slots });
    (Lender { table: Arc::clone(&table) }, Borrower { table, held: ArrayVec::new() })
}

/// The end that lends, and collects what has come back. Clone it for every thread.
pub struct Lender<T> {
    table: Arc<Table<T>>,
}

impl<T> Clone for Lender<T> {
    fn clone(&self) -> Self {
        Self { table: Arc::clone(&self.table) }
    }
}

impl<T> Lender<T> {
    /// Lends a thing, and returns its number. If too many are lent already, the thing comes back.
    pub fn lend(&self, thing: Box<T>) -> Result<u64, Box<T>> {
        let claimed = |slot: &&Slot<T>| {
            slot.id.compare_exchange(FREE, CLAIMED, Ordering::Acquire, Ordering::Relaxed).is_ok()
        };
        let Some(slot) = self.table.slots.iter().find(claimed) else { return Err(thing) };
        let id = self.table.newest.fetch_add(1, Ordering::Relaxed) + 1;
        slot.there.store(Some(thing));
        slot.id.store(id, Ordering::Release);
        Ok(id)
    }

    /// Takes a thing back that the real-time thread will not ask for. `None` if it has asked already.
    pub fn take_back(&self, id: u64) -> Option<Box<T>> {
        let slot = self.table.slots.iter().find(|slot| slot.id.load(Ordering::Acquire) == id)?;
        let thing = slot.there.take()?;
        slot.id.store(FREE, Ordering::Release);
        Some(thing)
    }

    /// Hands over what has come back.
    pub fn collect(&self, mut take: impl FnMut(Box<T>)) {
        for slot in &self.table.slots {
            if let Some(thing) = slot.back.take() {
                slot.id.store(FREE, Ordering::Release);
                take(thing);
            }
        }
    }
}

/// The end of the real-time thread.
pub struct Borrower<T> {
    table: Arc<Table<T>>,
    held: ArrayVec<Held<T>, LENT_AT_MOST>,
}

struct Held<T> {
    id: u64,
    slot: usize,
    thing: Box<T>,
}

impl<T> Borrower<T> {
    /// The thing with this number. `None` if nothing of this number is lent.
    pub fn borrow(&mut self, id: u64) -> Option<&mut T> {
        if !self.held.iter().any(|held| held.id == id) {
            self.take(id)?;
        }
        self.held.iter_mut().find(|held| held.id == id).map(|held| &mut *held.thing)
    }

    fn take(&mut self, id: u64) -> Option<()> {
        let mut slots = self.table.slots.iter();
        let slot = slots.position(|slot| slot.id.load(Ordering::Acquire) == id)?;
        let place = self.table.slots.get(slot)?;
        let thing = place.there.take()?;
        // Whoever asks for this number when the thing has been given back must not find what is lent in the slot by then.
        place.id.store(BORROWED, Ordering::Relaxed);
        // Each slot has one, so there is room.
        self.held.try_push(Held { id, slot, thing }).ok()
    }

    /// Gives back what is not needed any more.
    pub fn keep(&mut self, mut is_needed: impl FnMut(u64, &mut T) -> bool) {
        let mut index = 0;
        while let Some(held) = self.held.get_mut(index) {
            if is_needed(held.id, &mut held.thing) {
                index += 1;
            } else if let Some(Held { slot, thing, .. }) = self.held.swap_pop(index)
                && let Some(slot) = self.table.slots.get(slot)
            {
                slot.back.store(Some(thing));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn collected<T>(lender: &Lender<T>) -> Vec<T> {
        let mut all = vec![];
        lender.collect(|thing| all.push(*thing));
        all
    }

    #[test]
    fn a_thing_is_borrowed_under_its_number_and_comes_back_when_it_is_not_needed() {
        let (lender, mut borrower) = lending(LENT_AT_MOST);
        let [first, second] = ['a', 'b'].map(|thing| lender.lend(Box::new(thing)).unwrap());
        assert_eq!([second, first].map(|id| borrower.borrow(id).copied()), [Some('b'), Some('a')]);
        borrower.keep(|id, _| id == second);
        assert_eq!(collected(&lender), ['a']);
        assert_eq!([first, second].map(|id| borrower.borrow(id).copied()), [None, Some('b')]);
        borrower.keep(|_, _| false);
        assert_eq!(collected(&lender), ['b']);
    }

    #[test]
    fn slots_are_used_again_and_never_more_than_there_are() {
        let (lender, mut borrower) = lending(LENT_AT_MOST);
        for _ in 0..3 {
            let ids: Vec<u64> = std::iter::from_fn(|| lender.lend(Box::new(())).ok()).collect();
            assert_eq!(ids.len(), LENT_AT_MOST);
            for (number, id) in ids.into_iter().enumerate() {
                // Of some the requests are discarded.
                if number % 3 == 0 {
                    assert!(lender.take_back(id).is_some());
                    assert!(borrower.borrow(id).is_none());
                } else {
                    assert!(borrower.borrow(id).is_some());
                    assert!(lender.take_back(id).is_none(), "it has been taken");
                }
            }
            borrower.keep(|_, ()| false);
            assert_eq!(collected(&lender).len(), 10);
        }
    }
}
