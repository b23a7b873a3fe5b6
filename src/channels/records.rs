//! The channel of the cycle records to the logger. A record of 32 axes has almost 2 kB, and a ring of values would copy it
//! two or three times. So the rings carry boxed slots. The real-time thread fills in the axes that count, and the logger
//! returns the slot. The slot that was returned last is used first. So, as long as the logger keeps up, only a few slots
//! are in use, and they stay in the cache.

use takt_rt::CycleRecord;

use super::ring::{Consumer, Producer, ring};

/// A ring for `capacity` (at least 1) records.
pub fn record_ring(capacity: usize) -> (RecordProducer, RecordConsumer) {
    let (empty_in, empty_out) = ring(capacity);
    let (full_in, full_out) = ring(capacity);
    let free = (0..capacity.max(1)).map(|_| Box::default()).collect();
    (
        RecordProducer { free, empty: empty_out, full: full_in },
        RecordConsumer { empty: empty_in, full: full_out },
    )
}

/// The real-time thread's end.
pub struct RecordProducer {
    /// The empty slots; the one that was returned last is at the end. There is room for every slot, so it never grows.
    #[expect(clippy::vec_box, reason = "the boxes are what goes through the rings")]
    free: Vec<Box<CycleRecord>>,
    empty: Consumer<Box<CycleRecord>>,
    full: Producer<Box<CycleRecord>>,
}

impl RecordProducer {
    /// Copies a record into the ring. Returns whether there was room.
    pub fn push(&mut self, record: &CycleRecord) -> bool {
        // Each push uses one slot and takes back up to two, so that no returned slot stays in the ring for long.
        for _ in 0..2 {
            self.free.extend(self.empty.pop());
        }
        let Some(mut slot) = self.free.pop() else {
            self.full.count_dropped();
            return false;
        };
        slot.timing = record.timing;
        slot.group_count = record.group_count;
        if let Some(groups) = slot.groups.get_mut(..record.groups().len()) {
            groups.copy_from_slice(record.groups());
        }
        slot.is_commanded = record.is_commanded;
        slot.axis_count = record.axis_count;
        if let Some(axes) = slot.axes.get_mut(..record.axes().len()) {
            axes.copy_from_slice(record.axes());
        }
        self.full.push(slot)
    }
}

/// The logger's end.
pub struct RecordConsumer {
    empty: Producer<Box<CycleRecord>>,
    full: Consumer<Box<CycleRecord>>,
}

impl RecordConsumer {
    /// Passes the oldest waiting record to `read`, and frees its slot. Axes beyond `axis_count` hold arbitrary values.
    pub fn next<T>(&mut self, read: impl FnOnce(&CycleRecord) -> T) -> Option<T> {
        let slot = self.full.pop()?;
        let result = read(&slot);
        self.empty.push(slot);
        Some(result)
    }

    /// The number of records written since the start.
    pub fn pushed(&self) -> u64 {
        self.full.pushed()
    }

    /// The number of records dropped since the start.
    pub fn dropped(&self) -> u64 {
        self.full.dropped()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::{AxisRecord, CycleTiming, GroupRecord, MAX_AXES, MAX_GROUPS, Phase};

    fn record(slot: u64, axis_count: u8) -> CycleRecord {
        let axis = AxisRecord { position: slot as f64, ..AxisRecord::default() };
        CycleRecord {
            timing: CycleTiming { slot, ..CycleTiming::default() },
            group_count: 2,
            groups: [GroupRecord { phase: Phase::Moving, ..GroupRecord::default() }; MAX_GROUPS],
            is_commanded: true,
            axis_count,
            axes: [axis; MAX_AXES],
        }
    }

    #[test]
    fn records_arrive_in_order_with_every_axis_that_counts() {
        let (mut producer, mut consumer) = record_ring(2);
        for slot in 0..10 {
            assert!(producer.push(&record(slot, 6)));
            let arrived = consumer.next(|arrived| *arrived).unwrap();
            assert_eq!(arrived.timing.slot, slot);
            assert_eq!(arrived.groups(), record(slot, 6).groups());
            assert_eq!(arrived.groups().len(), 2);
            assert_eq!(arrived.axes(), record(slot, 6).axes());
            assert_eq!(arrived.axes().len(), 6);
        }
        assert_eq!(consumer.next(|_| ()), None);
    }

    #[test]
    fn a_full_ring_drops_and_counts_the_newest_record_and_goes_on_when_there_is_room() {
        let (mut producer, mut consumer) = record_ring(2);
        let taken = [0, 1, 2, 3].map(|slot| producer.push(&record(slot, 1)));
        assert_eq!(taken, [true, true, false, false]);
        assert_eq!((consumer.pushed(), consumer.dropped()), (2, 2));
        assert_eq!(consumer.next(|arrived| arrived.timing.slot), Some(0));
        assert!(producer.push(&record(4, 1)));
        assert_eq!(consumer.next(|arrived| arrived.timing.slot), Some(1));
        assert_eq!(consumer.next(|arrived| arrived.timing.slot), Some(4));
    }

    #[test]
    fn no_slot_is_lost_and_no_memory_is_allocated_while_the_ring_fills_and_empties() {
        let (mut producer, mut consumer) = record_ring(16);
        let room = producer.free.capacity();
        for fill in (0..=16).chain([3, 16, 1, 16]) {
            assert_eq!((0..20).filter(|slot| producer.push(&record(*slot, 1))).count(), 16);
            let emptied = (0..fill).map_while(|_| consumer.next(|_| ())).count();
            assert_eq!((0..20).filter(|slot| producer.push(&record(*slot, 1))).count(), emptied);
            while consumer.next(|_| ()).is_some() {}
        }
        assert_eq!(producer.free.capacity(), room);
    }
}
