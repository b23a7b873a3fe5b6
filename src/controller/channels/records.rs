//! The way of the cycle records to the logger. A record of 32 axes is almost 2 kB, and a ring that takes it by value
//! copies it two or three times. Here the slots themselves travel: the logger sends them out empty, the real-time
//! thread fills in the axes that count, and sends them back.

use takt_rt::record::CycleRecord;

use super::ring::{Consumer, Producer, ring};

/// A ring for `capacity` (at least 1) records.
pub fn record_ring(capacity: usize) -> (RecordProducer, RecordConsumer) {
    let (mut empty_in, empty_out) = ring(capacity);
    let (full_in, full_out) = ring(capacity);
    for _ in 0..capacity.max(1) {
        empty_in.push(Box::default());
    }
    (RecordProducer { empty: empty_out, full: full_in }, RecordConsumer { empty: empty_in, full: full_out })
}

/// The end of the real-time thread.
pub struct RecordProducer {
    empty: Consumer<Box<CycleRecord>>,
    full: Producer<Box<CycleRecord>>,
}

impl RecordProducer {
    /// Copies a record into the ring. Returns whether there was room.
    pub fn push(&mut self, record: &CycleRecord) -> bool {
        let Some(mut slot) = self.empty.pop() else {
            self.full.count_dropped();
            return false;
        };
        slot.timing = record.timing;
        slot.phase = record.phase;
        slot.is_commanded = record.is_commanded;
        slot.axis_count = record.axis_count;
        if let Some(axes) = slot.axes.get_mut(..record.axes().len()) {
            axes.copy_from_slice(record.axes());
        }
        self.full.push(slot)
    }
}

/// The end of the logger.
pub struct RecordConsumer {
    empty: Producer<Box<CycleRecord>>,
    full: Consumer<Box<CycleRecord>>,
}

impl RecordConsumer {
    /// Shows the oldest record that waits to `look`, and frees its slot. Axes that do not count may hold anything.
    pub fn next<T>(&mut self, look: impl FnOnce(&CycleRecord) -> T) -> Option<T> {
        let slot = self.full.pop()?;
        let seen = look(&slot);
        self.empty.push(slot);
        Some(seen)
    }

    /// Records that were put in since the start.
    pub fn pushed(&self) -> u64 {
        self.full.pushed()
    }

    /// Records that found no room since the start.
    pub fn dropped(&self) -> u64 {
        self.full.dropped()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::record::{AxisRecord, MAX_AXES, Timing};
    use takt_rt::stop::Phase;

    fn record(slot: u64, axis_count: u8) -> CycleRecord {
        let axis = AxisRecord { position: slot as f64, ..AxisRecord::default() };
        CycleRecord {
            timing: Timing { slot, ..Timing::default() },
            phase: Phase::Moving,
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
            assert_eq!((arrived.timing.slot, arrived.phase), (slot, Phase::Moving));
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
}
