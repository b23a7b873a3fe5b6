//! Takes what has arrived on a socket, with bounded work.

use super::accounting::TxRxAccounting;
use super::arrival::MessageSource;
use super::arrival_time::ClockPair;
use crate::port::{RECEIVE_BATCH, ReceiveBatch, Received};

/// The most system calls of one reading.
///
/// Own frames and error frames take places in a call and none in the caller's batch. Without a bound, somebody who sends
/// them as fast as they are read would hold the real-time thread for ever. Eight calls take up to 512 messages. A bus of
/// 1 Mbit/s carries at most 21 frames in a millisecond, so a backlog still becomes shorter from cycle to cycle.
pub(super) const CALLS_MAX: usize = 8;

/// Appends the frames that have arrived from others to `batch`, oldest first, and accounts for everything else.
///
/// The reading ends when no more messages wait, when `batch` is full, when the source fails, or after [`CALLS_MAX`] calls.
pub(super) fn read(
    source: &mut impl MessageSource,
    accounting: &mut TxRxAccounting,
    clocks: ClockPair,
    batch: &mut ReceiveBatch,
) {
    for _ in 0..CALLS_MAX {
        let limit = batch.remaining_capacity().min(RECEIVE_BATCH);
        if limit == 0 {
            return;
        }
        let outcome = source.receive(limit, |arrival| {
            if let Some(frame) = accounting.arrived(&arrival) {
                let at_ns = clocks.arrival_ns(arrival.real_time_ns);
                // There is room: the source was asked for no more than fit.
                let _ = batch.try_push(Received { frame, at_ns });
            }
        });
        match outcome {
            // The call was filled: more messages may be waiting.
            Ok(count) if count == limit => {}
            Ok(_) => return accounting.read_empty(),
            Err(errno) => return accounting.receive_failed(errno),
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::frame::{Frame, Id};
    use crate::linux::can::arrival::{Arrival, Sender};
    use crate::linux::can::wire_format::Message;
    use std::vec::Vec;

    const CLOCKS: ClockPair = ClockPair { monotonic_ns: 1_000, real_time_ns: 2_000 };

    /// A socket into which somebody writes faster than it is read, and what was asked of it.
    struct Endless {
        message: fn(usize) -> (Message, Sender),
        calls: usize,
        messages: usize,
    }

    impl Endless {
        fn of(message: fn(usize) -> (Message, Sender)) -> Self {
            Self { message, calls: 0, messages: 0 }
        }
    }

    impl MessageSource for Endless {
        fn receive(&mut self, limit: usize, mut take: impl FnMut(Arrival)) -> Result<usize, i32> {
            self.calls += 1;
            assert!(self.calls <= 10_000, "the reading does not end");
            for _ in 0..limit {
                let (message, sender) = (self.message)(self.messages);
                take(Arrival { message, sender, real_time_ns: None, lost: None });
                self.messages += 1;
            }
            Ok(limit)
        }
    }

    fn frame(number: usize) -> Frame {
        Frame::of(Id::base(number as u32 % 0x800).unwrap(), [1])
    }

    fn error_frame(_: usize) -> (Message, Sender) {
        (Message::Error { class: libc::CAN_ERR_ACK, details: [0; 8] }, Sender::Wire)
    }

    fn own_frame(number: usize) -> (Message, Sender) {
        (Message::Frame(frame(number)), Sender::ThisSocket)
    }

    #[test]
    fn error_frames_without_end_are_counted_and_hold_a_reading_for_no_more_than_its_calls() {
        let (mut source, mut batch) = (Endless::of(error_frame), ReceiveBatch::new());
        let mut accounting = TxRxAccounting::default();
        read(&mut source, &mut accounting, CLOCKS, &mut batch);
        assert_eq!((source.calls, source.messages), (CALLS_MAX, CALLS_MAX * RECEIVE_BATCH));
        assert_eq!((accounting.health().errors as usize, batch.len()), (source.messages, 0));
    }

    #[test]
    fn own_frames_without_end_are_counted_and_hold_a_reading_for_no_more_than_its_calls() {
        let (mut source, mut batch) = (Endless::of(own_frame), ReceiveBatch::new());
        let mut accounting = TxRxAccounting::default();
        read(&mut source, &mut accounting, CLOCKS, &mut batch);
        assert_eq!((source.calls, source.messages), (CALLS_MAX, CALLS_MAX * RECEIVE_BATCH));
        assert_eq!((accounting.health().tx_frames as usize, batch.len()), (source.messages, 0));
    }

    #[test]
    fn frames_of_others_among_error_frames_are_taken_in_their_order_until_the_bound() {
        let mixed = |number| match number % 4 {
            0 => (Message::Frame(frame(number)), Sender::Wire),
            _ => error_frame(number),
        };
        let (mut source, mut batch) = (Endless::of(mixed), ReceiveBatch::new());
        let mut accounting = TxRxAccounting::default();
        read(&mut source, &mut accounting, CLOCKS, &mut batch);
        assert!(source.calls <= CALLS_MAX);
        let expected: Vec<Frame> = (0..source.messages).step_by(4).map(frame).collect();
        let taken: Vec<Frame> = batch.iter().map(|received| received.frame).collect();
        assert_eq!(taken, expected);
        assert_eq!(accounting.health().rx_frames as usize, taken.len());
    }

    #[test]
    fn a_reading_that_ends_at_its_bound_does_not_count_as_having_read_everything() {
        let (mut source, mut batch) = (Endless::of(error_frame), ReceiveBatch::new());
        let mut accounting = TxRxAccounting::default();
        accounting.taken(&[frame(1)]);
        read(&mut source, &mut accounting, CLOCKS, &mut batch);
        assert!(!accounting.is_behind());
    }
}
