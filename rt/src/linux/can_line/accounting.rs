//! The counters of an adapter and the state of its bus, without any input or output.

use arrayvec::ArrayVec;

use super::super::wire_time::WireTime;
use crate::frame::Frame;
use crate::port::{BusHealth, BusState};

/// The most lines that can be waiting. A cycle sends fewer, and no more set-points leave while any line waits.
const WAITING_LINES: usize = 128;

/// The counters of one adapter and the state of its bus.
///
/// An adapter does not say when a frame was on the bus. So a frame counts as sent when its line has left the serial line of
/// this machine.
#[derive(Clone, Debug)]
pub(super) struct LineAccounting {
    /// All but the frames that have left and the time that the wire was occupied.
    health: BusHealth,
    /// Frames that the line took.
    taken: u64,
    /// The lengths in bytes of the lines that may not have left, oldest first.
    waiting: ArrayVec<u8, WAITING_LINES>,
    wire_time: WireTime,
}

impl LineAccounting {
    /// Accounting for a bus with these bit rates (bit/s).
    pub(super) fn new(bit_rate: u32, data_bit_rate: Option<u32>) -> Self {
        Self {
            health: BusHealth::default(),
            taken: 0,
            waiting: ArrayVec::new(),
            wire_time: WireTime::new(bit_rate, data_bit_rate),
        }
    }

    pub(super) fn health(&self) -> BusHealth {
        let tx_frames = self.taken.saturating_sub(self.unconfirmed() as u64);
        BusHealth { tx_frames, busy_ns: self.wire_time.busy_ns(), ..self.health }
    }

    /// How many frames may not have left.
    pub(super) const fn unconfirmed(&self) -> usize {
        self.waiting.len()
    }

    /// Counts a frame whose line of this length the serial line took, or has begun to take.
    pub(super) fn taken(&mut self, frame: &Frame, length: usize) {
        self.taken += 1;
        self.wire_time.add(frame);
        if self.health.state == BusState::Down {
            self.health.state = BusState::ErrorActive;
        }
        if self.waiting.is_full() {
            self.waiting.remove(0);
        }
        self.waiting.push(u8::try_from(length).unwrap_or(u8::MAX));
    }

    /// Counts frames that found no room.
    pub(super) const fn no_room(&mut self, frames: usize) {
        self.health.tx_overruns += frames as u64;
    }

    /// Counts frames that this bus may not carry.
    pub(super) const fn forbidden(&mut self, frames: usize) {
        self.health.errors += frames as u64;
    }

    /// Counts a frame from the bus.
    pub(super) fn received(&mut self, frame: &Frame) {
        self.health.rx_frames += 1;
        self.wire_time.add(frame);
    }

    /// Counts a line that is none, or that says that the adapter refuses something.
    pub(super) const fn disturbed(&mut self) {
        self.health.errors += 1;
    }

    /// Notes how many bytes have not left.
    pub(super) fn queued(&mut self, bytes: usize) {
        let mut all: usize = self.waiting.iter().map(|length| usize::from(*length)).sum();
        let mut gone = 0;
        for length in &self.waiting {
            if all <= bytes || all == 0 {
                break;
            }
            // The line that is leaving has not left.
            let Some(behind) = all.checked_sub(usize::from(*length)).filter(|behind| *behind >= bytes) else {
                break;
            };
            all = behind;
            gone += 1;
        }
        self.waiting.drain(..gone);
    }

    /// Counts a call that failed with this error number. Only `EAGAIN` leaves the line as it is.
    pub(super) fn failed(&mut self, errno: i32) {
        match errno {
            libc::EAGAIN | libc::EINTR => {}
            // The adapter was unplugged: the kernel hangs the line up, and says EIO from then on.
            libc::EIO | libc::ENODEV | libc::ENXIO | libc::EPIPE | libc::EBADF => self.hung_up(),
            _ => self.health.errors += 1,
        }
    }

    /// The other end is gone. What still waited is lost.
    pub(super) fn hung_up(&mut self) {
        self.health.state = BusState::Down;
        self.taken = self.taken.saturating_sub(self.waiting.len() as u64);
        self.waiting.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Id;

    fn frame() -> Frame {
        Frame::of(Id::canopen(0x200, 1), [0; 8])
    }

    fn with_lines(lengths: &[usize]) -> LineAccounting {
        let mut accounting = LineAccounting::new(1_000_000, None);
        lengths.iter().for_each(|length| accounting.taken(&frame(), *length));
        accounting
    }

    #[test]
    fn a_line_has_left_when_no_byte_of_it_is_queued() {
        for (queued, unconfirmed) in [(0, 0), (1, 1), (22, 1), (23, 2), (28, 2), (29, 3), (50, 3), (9_999, 3)]
        {
            let mut accounting = with_lines(&[22, 6, 22]);
            accounting.queued(queued);
            assert_eq!(accounting.unconfirmed(), unconfirmed, "{queued} bytes");
            assert_eq!(accounting.health().tx_frames, 3 - unconfirmed as u64);
        }
    }

    #[test]
    fn what_has_left_does_not_come_back_when_a_driver_counts_in_whole_buffers() {
        let mut accounting = with_lines(&[22, 22]);
        accounting.queued(0);
        accounting.taken(&frame(), 22);
        accounting.queued(1_280);
        assert_eq!((accounting.unconfirmed(), accounting.health().tx_frames), (1, 2));
    }

    #[test]
    fn more_lines_than_can_be_remembered_count_as_sent_one_after_the_other() {
        let mut accounting = with_lines(&[6; 3 * WAITING_LINES]);
        assert_eq!(accounting.unconfirmed(), WAITING_LINES);
        accounting.queued(0);
        assert_eq!((accounting.unconfirmed(), accounting.health().tx_frames), (0, 3 * WAITING_LINES as u64));
    }

    #[test]
    fn an_adapter_that_is_unplugged_is_down_and_what_waited_was_not_sent() {
        for errno in [libc::EIO, libc::ENODEV, libc::ENXIO, libc::EPIPE, libc::EBADF] {
            let mut accounting = with_lines(&[22, 22]);
            accounting.queued(22);
            accounting.failed(errno);
            let health = accounting.health();
            assert_eq!((health.state, accounting.unconfirmed(), health.tx_frames), (BusState::Down, 0, 1));
            assert_eq!(health.errors, 0);
            accounting.taken(&frame(), 22);
            assert_eq!(accounting.health().state, BusState::ErrorActive);
        }
    }

    #[test]
    fn no_room_is_an_overrun_and_another_failure_an_error() {
        let mut accounting = with_lines(&[]);
        accounting.failed(libc::EAGAIN);
        accounting.failed(libc::EINTR);
        accounting.no_room(3);
        accounting.failed(libc::EINVAL);
        accounting.forbidden(2);
        accounting.disturbed();
        let health = accounting.health();
        assert_eq!((health.state, health.tx_overruns, health.errors), (BusState::ErrorActive, 3, 4));
    }

    #[test]
    fn frames_in_both_directions_occupy_the_wire() {
        let mut accounting = with_lines(&[22]);
        accounting.received(&frame());
        let health = accounting.health();
        assert_eq!((health.rx_frames, health.busy_ns), (1, 2 * (47 + 64) * 1_000));
    }
}
