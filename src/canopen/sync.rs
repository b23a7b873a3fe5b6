//! The SYNC message (CiA 301, 7.2.5): without data, or with a counter from 1 up to an agreed overflow value.

use takt_rt::frame::{Frame, Id};

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
    /// SYNC without a counter, as drives without object 1019 expect it.
    pub const fn new() -> Self {
        Self { counter: None }
    }

    /// SYNC with a counter that runs from 1 to `overflow` (object 1019) and starts again at 1. `None` outside
    /// 2 to 240 (CiA 301, 7.5.2.22).
    pub const fn with_counter(overflow: u8) -> Option<Self> {
        match overflow {
            2..=240 => Some(Self { counter: Some(Counter { last: 0, overflow }) }),
            _ => None,
        }
    }

    /// Starts the counter again at 1, as a change of the NMT state from stopped to another one does.
    pub fn restart(&mut self) {
        if let Some(counter) = &mut self.counter {
            counter.last = 0;
        }
    }

    /// The next SYNC message.
    pub fn next_frame(&mut self) -> Frame {
        let id = Id::canopen(super::function_code::EMERGENCY, 0);
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
    fn the_counter_runs_from_one_to_its_overflow_and_starts_again() {
        let mut sync = SyncProducer::with_counter(3).unwrap();
        let mut next = || sync.next_frame().payload().to_vec();
        assert_eq!([next(), next(), next(), next()], [[1], [2], [3], [1]]);
        sync.restart();
        assert_eq!(sync.next_frame().payload(), [1]);
    }

    #[test]
    fn counters_that_the_standard_does_not_allow_are_refused() {
        assert_eq!(SyncProducer::with_counter(1), None);
        assert_eq!(SyncProducer::with_counter(241), None);
    }
}
