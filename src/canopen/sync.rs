//! The SYNC message (CiA 301, 7.2.5), with or without a counter.

use takt_rt::{Frame, FrameKind, Id};

use super::function_code;

/// A received SYNC message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sync {
    /// Its counter, 1 to 240; `None` without data.
    pub counter: Option<u8>,
}

impl Sync {
    /// Decodes a message with the pre-defined identifier 0x80; `None` for other frames and impossible counters.
    pub fn decode(frame: &Frame) -> Option<Self> {
        if frame.id() != Id::canopen(function_code::SYNC, 0) || frame.kind() != FrameKind::Data {
            return None;
        }
        match frame.payload() {
            [] => Some(Self { counter: None }),
            &[counter @ 1..=240] => Some(Self { counter: Some(counter) }),
            _ => None,
        }
    }

    /// Number of missing messages between `before` and this one, by their counters and the overflow value (object 1019,
    /// 2 to 240); 0 when one of them has no counter.
    pub fn missing_since(self, before: Self, overflow: u8) -> u8 {
        let (Some(now), Some(before)) = (self.counter, before.counter) else { return 0 };
        let due = if before >= overflow { 1 } else { before + 1 };
        if now >= due { now - due } else { (overflow.saturating_sub(due) + now).min(overflow) }
    }
}

/// Produces SYNC messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SyncProducer {
    counter: Option<Counter>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Counter {
    last: u8,
    overflow: u8,
}

impl SyncProducer {
    /// SYNC without a counter, for drives without object 1019.
    pub const fn new() -> Self {
        Self { counter: None }
    }

    /// SYNC with a counter from 1 to `overflow` (object 1019), then from 1 again. `None` outside 2 to 240 (CiA 301,
    /// 7.5.2.22).
    pub const fn with_counter(overflow: u8) -> Option<Self> {
        match overflow {
            2..=240 => Some(Self { counter: Some(Counter { last: 0, overflow }) }),
            _ => None,
        }
    }

    /// Restarts the counter at 1, as when the NMT state stopped is left.
    pub fn restart(&mut self) {
        if let Some(counter) = &mut self.counter {
            counter.last = 0;
        }
    }

    /// The next SYNC message.
    pub fn next_frame(&mut self) -> Frame {
        let id = Id::canopen(function_code::SYNC, 0);
        match &mut self.counter {
            None => Frame::of(id, []),
            Some(counter) => {
                counter.last = if counter.last >= counter.overflow { 1 } else { counter.last + 1 };
                Frame::of(id, [counter.last])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sync_without_a_counter_has_no_data() {
        let frame = SyncProducer::new().next_frame();
        assert_eq!((frame.id().value(), frame.payload()), (0x80, &[][..]));
    }

    #[test]
    fn the_counter_runs_from_one_to_its_overflow_and_restarts() {
        let mut sync = SyncProducer::with_counter(3).unwrap();
        let mut next = || sync.next_frame().payload().to_vec();
        assert_eq!([next(), next(), next(), next()], [[1], [2], [3], [1]]);
        sync.restart();
        assert_eq!(sync.next_frame().payload(), [1]);
    }

    #[test]
    fn produced_messages_are_decoded_and_gaps_are_counted() {
        let mut producer = SyncProducer::with_counter(5).unwrap();
        let syncs: Vec<Sync> = (0..8).map(|_| Sync::decode(&producer.next_frame()).unwrap()).collect();
        for pair in syncs.windows(2) {
            assert_eq!(pair[1].missing_since(pair[0], 5), 0);
        }
        assert_eq!(syncs[4].missing_since(syncs[2], 5), 1);
        assert_eq!(syncs[6].missing_since(syncs[3], 5), 2, "4, then 2 after the overflow");
        assert_eq!(Sync::decode(&SyncProducer::new().next_frame()), Some(Sync { counter: None }));
        for payload in [&[0][..], &[241], &[1, 2]] {
            assert_eq!(Sync::decode(&Frame::data(Id::canopen(0x80, 0), payload).unwrap()), None);
        }
        assert_eq!(Sync::decode(&Frame::of(Id::canopen(0x80, 1), [])), None, "an emergency identifier");
    }

    #[test]
    fn counters_that_the_standard_does_not_allow_are_refused() {
        assert_eq!(SyncProducer::with_counter(1), None);
        assert_eq!(SyncProducer::with_counter(241), None);
    }
}
