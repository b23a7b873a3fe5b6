//! Frames to the bytes of a line and back.

use arrayvec::ArrayVec;

use super::accounting::LineAccounting;
use super::byte_line::ByteLine;
use super::codec::{Arrival, FrameBytes, LineCodec};
use crate::frame::Frame;
use crate::port::{BusHealth, ReceiveBatch, Received};
use crate::time::Nanoseconds;

/// Bytes that are handed to the serial line in one call.
const BLOCK_BYTES: usize = 2_048;
/// The most lines in them.
const BLOCK_LINES: usize = 64;
/// Bytes that are read in one call.
const READ_BYTES: usize = 1_024;
/// The most calls of one reading. A bus of 1 Mbit/s brings at most 600 bytes in a millisecond, so a backlog still becomes
/// shorter from cycle to cycle. Without a bound, an adapter that sends without end would hold the real-time thread.
const READS_MAX: usize = 8;

/// The open channel of an adapter.
pub(super) struct Channel<L: ByteLine, C: LineCodec> {
    line: L,
    codec: C,
    /// Bytes that were read and not yet looked at, because the caller's batch was full.
    input: ArrayVec<u8, READ_BYTES>,
    /// How many bytes of `input` are done.
    done: usize,
    /// The end of a line that the serial line took only in part. It must go before anything else.
    rest: FrameBytes,
    accounting: LineAccounting,
}

impl<L: ByteLine, C: LineCodec> Channel<L, C> {
    pub(super) fn new(line: L, codec: C, bit_rate: u32, data_bit_rate: Option<u32>) -> Self {
        Self {
            line,
            codec,
            input: ArrayVec::new(),
            done: 0,
            rest: ArrayVec::new(),
            accounting: LineAccounting::new(bit_rate, data_bit_rate),
        }
    }

    pub(super) const fn line(&self) -> &L {
        &self.line
    }

    /// Returns `true` if bytes that were read still wait.
    pub(super) const fn has_input(&self) -> bool {
        self.done < self.input.len()
    }

    /// Hands frames to the serial line, the first one first, and returns how many it took.
    pub(super) fn send(&mut self, frames: &[Frame]) -> usize {
        let permitted = frames.iter().take_while(|frame| self.codec.carries(frame)).count();
        let permitted = frames.get(..permitted).unwrap_or_default();
        let mut taken = 0;
        while let Some(rest) = permitted.get(taken..).filter(|rest| !rest.is_empty()) {
            let (count, is_all) = self.send_block(rest);
            taken += count;
            if !is_all {
                self.accounting.no_room(frames.len() - taken);
                return taken;
            }
        }
        self.accounting.forbidden(frames.len() - taken);
        taken
    }

    /// Hands over as many frames as one call takes. Returns how many were taken, and whether the line may take more.
    fn send_block(&mut self, frames: &[Frame]) -> (usize, bool) {
        if !self.send_rest() {
            return (0, false);
        }
        let mut block = ArrayVec::<u8, BLOCK_BYTES>::new();
        let mut lines = ArrayVec::<(&Frame, usize), BLOCK_LINES>::new();
        for frame in frames.iter().take(BLOCK_LINES) {
            let text = self.codec.encode(frame);
            if block.try_extend_from_slice(&text).is_err() {
                break;
            }
            lines.push((frame, text.len()));
        }
        let mut written = match self.line.write(&block) {
            Ok(written) => written,
            Err(errno) => {
                self.accounting.failed(errno);
                return (0, false);
            }
        };
        let is_all = written >= block.len();
        let mut start = 0;
        let mut taken = 0;
        for (frame, length) in lines {
            // A line that was begun is completed by the next call, so its frame is taken.
            if written == 0 {
                break;
            }
            let here = written.min(length);
            written -= here;
            self.accounting.taken(frame, length);
            taken += 1;
            if here < length {
                let missing = block.get(start + here..start + length).unwrap_or_default();
                self.rest = missing.iter().copied().collect();
            }
            start += length;
        }
        (taken, is_all)
    }

    /// Completes the line that was begun. Returns whether nothing of it is left.
    fn send_rest(&mut self) -> bool {
        if self.rest.is_empty() {
            return true;
        }
        match self.line.write(&self.rest) {
            Ok(written) => drop(self.rest.drain(..written.min(self.rest.len()))),
            Err(errno) => self.failed(errno),
        }
        self.rest.is_empty()
    }

    fn failed(&mut self, errno: i32) {
        self.accounting.failed(errno);
        if errno != libc::EAGAIN && errno != libc::EINTR {
            self.rest.clear();
        }
    }

    /// Appends the frames that have arrived to `batch`, oldest first, and accounts for everything else.
    ///
    /// An adapter does not say when a frame was on the bus: the time of a frame is that of its reading.
    pub(super) fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        self.send_rest();
        self.read_lines(now_ns, batch);
        for _ in 0..READS_MAX {
            if batch.is_full() || self.has_input() {
                return;
            }
            let mut bytes = [0; READ_BYTES];
            let count = match self.line.read(&mut bytes) {
                Ok(0) => return self.accounting.hung_up(),
                Ok(count) => count.min(READ_BYTES),
                Err(errno) => return self.failed(errno),
            };
            self.input = bytes.iter().copied().take(count).collect();
            self.done = 0;
            self.read_lines(now_ns, batch);
            if count < READ_BYTES {
                return;
            }
        }
    }

    /// Reads lines from the bytes that have come, until they end or the batch is full.
    fn read_lines(&mut self, at_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        while !batch.is_full() {
            let Some(byte) = self.input.get(self.done) else { return };
            self.done += 1;
            match self.codec.push(*byte) {
                Some(Arrival::Frame(frame)) => {
                    self.accounting.received(&frame);
                    // There is room: it was asked for above.
                    let _ = batch.try_push(Received { frame, at_ns });
                }
                Some(Arrival::Disturbed) => self.accounting.disturbed(),
                None => {}
            }
        }
    }

    /// How many frames may not have left this machine.
    pub(super) fn unconfirmed(&mut self) -> usize {
        self.send_rest();
        if self.accounting.unconfirmed() > 0 {
            self.accounting.queued(self.line.queued() + self.rest.len());
        }
        self.accounting.unconfirmed()
    }

    pub(super) fn health(&self) -> BusHealth {
        self.accounting.health()
    }

    /// Asks the adapter to leave the bus. One attempt: a line that is full or gone is left as it is.
    pub(super) fn close(&mut self) {
        let closing = self.codec.closing_line();
        if self.send_rest() && !closing.is_empty() {
            let _ = self.line.write(&closing);
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::super::codec::{SlcanCodec, TransparentCodec};
    use super::*;
    use crate::frame::Id;
    use crate::port::BusState;
    use crate::slcan::encode_frame;
    use crate::transparent::TransparentFrame;
    use std::vec::Vec;

    /// A serial line that takes `room` bytes, and brings `input` in pieces of at most `piece` bytes.
    #[derive(Default)]
    struct Fake {
        room: usize,
        written: Vec<u8>,
        input: Vec<u8>,
        piece: usize,
        reads: usize,
        is_hung_up: bool,
        repeats: bool,
    }

    impl ByteLine for Fake {
        fn read(&mut self, bytes: &mut [u8]) -> Result<usize, i32> {
            self.reads += 1;
            assert!(self.reads <= 10_000, "the reading does not end");
            if self.is_hung_up {
                return Ok(0);
            }
            let count = self.piece.min(bytes.len()).min(self.input.len());
            if count == 0 {
                return Err(libc::EAGAIN);
            }
            bytes[..count].copy_from_slice(&self.input[..count]);
            if self.repeats {
                self.input.rotate_left(count);
            } else {
                self.input.drain(..count);
            }
            Ok(count)
        }

        fn write(&mut self, bytes: &[u8]) -> Result<usize, i32> {
            if self.is_hung_up {
                return Err(libc::EIO);
            }
            let count = bytes.len().min(self.room);
            if count == 0 {
                return Err(libc::EAGAIN);
            }
            self.room -= count;
            self.written.extend(&bytes[..count]);
            Ok(count)
        }

        fn queued(&self) -> usize {
            0
        }
    }

    fn channel(line: Fake) -> Channel<Fake, SlcanCodec> {
        Channel::new(line, SlcanCodec::new(false), 1_000_000, None)
    }

    fn converter(line: Fake) -> Channel<Fake, TransparentCodec> {
        Channel::new(line, TransparentCodec::default(), 1_000_000, None)
    }

    fn frame(number: u32) -> Frame {
        Frame::of(Id::base(number).unwrap(), [number as u8; 8])
    }

    fn text(frames: &[Frame]) -> Vec<u8> {
        frames.iter().flat_map(encode_frame).collect()
    }

    fn received<C: LineCodec>(channel: &mut Channel<Fake, C>) -> Vec<Frame> {
        let mut batch = ReceiveBatch::new();
        channel.receive(5, &mut batch);
        batch.iter().map(|received| received.frame).collect()
    }

    #[test]
    fn a_line_that_the_serial_line_takes_in_part_is_completed_before_the_next_one() {
        let frames: Vec<Frame> = (1..=10).map(frame).collect();
        let line_bytes = text(&frames[..1]).len();
        for room in 0..3 * line_bytes {
            let mut channel = channel(Fake { room, ..Fake::default() });
            let taken = channel.send(&frames);
            assert_eq!(taken, room.div_ceil(line_bytes), "{room} bytes of room");
            assert_eq!(channel.health().tx_overruns as usize, frames.len() - taken);
            channel.line.room = 10_000;
            assert_eq!(channel.send(&frames[9..]), 1);
            assert_eq!(channel.line.written, text(&[&frames[..taken], &frames[9..]].concat()));
        }
    }

    #[test]
    fn the_rest_of_a_line_leaves_when_the_bus_is_read_or_asked_too() {
        let acts: [fn(&mut Channel<Fake, SlcanCodec>); 2] =
            [|channel| assert_eq!(received(channel), []), |channel| assert_eq!(channel.unconfirmed(), 0)];
        for act in acts {
            let mut channel = channel(Fake { room: 3, ..Fake::default() });
            assert_eq!((channel.send(&[frame(1)]), channel.unconfirmed()), (1, 1));
            channel.line.room = 100;
            act(&mut channel);
            assert_eq!((channel.line.written.clone(), channel.unconfirmed()), (text(&[frame(1)]), 0));
        }
    }

    #[test]
    fn more_frames_than_a_block_holds_leave_in_their_order() {
        let frames: Vec<Frame> = (0..500).map(frame).collect();
        let mut channel = channel(Fake { room: usize::MAX, ..Fake::default() });
        assert_eq!(channel.send(&frames), 500);
        assert_eq!(channel.line.written, text(&frames));
        assert_eq!((channel.unconfirmed(), channel.health().tx_frames), (0, 500));
    }

    #[test]
    fn can_fd_frames_leave_only_on_a_bus_that_is_set_up_for_them() {
        let long = Frame::fd(Id::base(0x201).unwrap(), &[7; 64], false).unwrap();
        let mut classic = channel(Fake { room: 10_000, ..Fake::default() });
        assert_eq!(classic.send(&[frame(1), long, frame(2)]), 1);
        assert_eq!((classic.line.written.clone(), classic.health().errors), (text(&[frame(1)]), 2));
        let line = Fake { room: 100_000, ..Fake::default() };
        let mut fd = Channel::new(line, SlcanCodec::new(true), 1_000_000, Some(5_000_000));
        assert_eq!(fd.send(&[long; 64]), 64);
        assert_eq!(fd.line.written, text(&[long; 64]));
    }

    #[test]
    fn frames_arrive_in_their_order_however_their_bytes_are_cut() {
        let frames: Vec<Frame> = (1..=40).map(frame).collect();
        for piece in [1, 7, 22, 1_000] {
            let mut channel = channel(Fake { input: text(&frames), piece, ..Fake::default() });
            let mut all = received(&mut channel);
            while all.len() < frames.len() {
                all.extend(received(&mut channel));
            }
            assert_eq!(all, frames, "{piece} bytes at a time");
        }
    }

    #[test]
    fn a_full_batch_leaves_the_rest_for_the_next_reading() {
        let frames: Vec<Frame> = (1..=3).map(frame).collect();
        let mut channel = channel(Fake { input: text(&frames), piece: 1_000, ..Fake::default() });
        let mut batch = ReceiveBatch::new();
        while batch.remaining_capacity() > 1 {
            batch.push(Received { frame: frame(0), at_ns: 0 });
        }
        channel.receive(9, &mut batch);
        assert_eq!(batch.last().copied(), Some(Received { frame: frames[0], at_ns: 9 }));
        assert!(channel.has_input());
        assert_eq!(received(&mut channel), frames[1..]);
    }

    #[test]
    fn an_adapter_that_sends_without_end_holds_a_reading_for_no_more_than_its_calls() {
        let mut channel =
            channel(Fake { input: b"x\r".repeat(2_048), piece: 4_096, repeats: true, ..Fake::default() });
        assert_eq!(received(&mut channel), []);
        assert_eq!(channel.line.reads, READS_MAX);
        assert_eq!(channel.health().errors as usize, READS_MAX * READ_BYTES / 2);
    }

    #[test]
    fn noise_and_refusals_are_errors_and_the_frames_among_them_arrive() {
        let input = [b"\xFFgarbage\rz\r\x07\r\n".as_slice(), &text(&[frame(1)])].concat();
        let mut channel = channel(Fake { input, piece: 1_000, ..Fake::default() });
        assert_eq!(received(&mut channel), [frame(1)]);
        let health = channel.health();
        assert_eq!((health.errors, health.rx_frames, health.state), (2, 1, BusState::ErrorActive));
    }

    #[test]
    fn an_adapter_that_is_unplugged_is_down_for_sending_and_for_reading() {
        let mut reading = channel(Fake { is_hung_up: true, ..Fake::default() });
        assert_eq!((received(&mut reading), reading.health().state), (Vec::new(), BusState::Down));
        let mut sending = channel(Fake { is_hung_up: true, ..Fake::default() });
        assert_eq!((sending.send(&[frame(1)]), sending.health().state), (0, BusState::Down));
    }

    #[test]
    fn a_transparent_converter_takes_blocks_and_a_disturbed_one_is_an_error_and_costs_no_other() {
        let long = |number| Frame::fd(Id::base(number).unwrap(), &[number as u8; 16], false).unwrap();
        let blocks = |frames: &[Frame]| -> Vec<u8> {
            frames.iter().flat_map(|frame| TransparentFrame::of(frame).unwrap().encode()).collect()
        };
        let mut sending = converter(Fake { room: 1_000, ..Fake::default() });
        assert_eq!(sending.send(&[long(1), long(2), frame(3)]), 2);
        assert_eq!(sending.line.written, blocks(&[long(1), long(2)]));
        assert_eq!(sending.health().errors, 1);
        sending.close();
        assert_eq!(sending.line.written.len(), 42);
        let mut disturbed = blocks(&[long(4)]);
        disturbed[7] ^= 0x10;
        let input = [blocks(&[long(3)]), disturbed, blocks(&[long(5)])].concat();
        let mut receiving = converter(Fake { input, piece: 5, ..Fake::default() });
        let mut all = Vec::new();
        for _ in 0..40 {
            all.extend(received(&mut receiving));
        }
        assert_eq!((all, receiving.health().errors), (Vec::from([long(3), long(5)]), 1));
    }

    #[test]
    fn the_channel_is_closed_behind_the_line_that_was_begun() {
        let mut channel = channel(Fake { room: 4, ..Fake::default() });
        channel.send(&[frame(1)]);
        channel.line.room = 100;
        channel.close();
        assert_eq!(channel.line.written, [text(&[frame(1)]).as_slice(), b"C\r"].concat());
    }
}
