//! The port: one system call to receive; one to send, which several ports can share.

use super::super::clock::{monotonic_ns, real_time_ns, timespec_of};
use super::super::errno;
use super::account::Account;
use super::batch::{self, Batch, Destination, SEND_BATCH};
use super::link::Link;
use super::together;
use crate::frame::Frame;
use crate::port::{BusHealth, BusPort, Outgoing, RECEIVE_BATCH, ReceiveBatch, Received};
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};

/// A raw CAN socket as a bus port.
///
/// The socket is opened and configured elsewhere. The port relies on: own frames received back
/// (`CAN_RAW_RECV_OWN_MSGS`) and not held back by the filters, or [`BusPort::unconfirmed`] would never return to
/// zero; and uses, where they are on: error frames, kernel time stamps (`SO_TIMESTAMPNS`), the overflow counter
/// (`SO_RXQ_OVFL`), CAN FD frames. Its calls never wait, whether the socket is a blocking one or not.
///
/// An interface that goes down is [`BusState::Down`](crate::port::BusState::Down), from the first frame on that it has
/// dropped, and comes back by itself; one that is removed (an adapter unplugged) unbinds the socket for good, and a new port must be made.
///
/// # Time of arrival
/// The kernel stamps frames on `CLOCK_REALTIME` when the driver hands them over. They are moved to the monotonic
/// clock by the difference of the two at the time of reading. A stamp more than a second away from the present,
/// which only a real-time clock that was set in between can cause, is replaced by the present.
pub struct SocketCanPort {
    pub(super) descriptor: libc::c_int,
    pub(super) link: Link,
    batch: Batch,
    pub(super) account: Account,
}

impl SocketCanPort {
    /// A port on the socket `descriptor`, which is duplicated: the caller keeps and closes its own. From the bit
    /// rates (bit/s; the second for the data phase of CAN FD frames) follows how long frames occupy the wire. The
    /// error is the system's number.
    pub fn new(descriptor: i32, bit_rate: u32, data_bit_rate: Option<u32>) -> Result<Self, i32> {
        // SAFETY: duplicates a number; one that is no descriptor is refused.
        let descriptor = unsafe { libc::fcntl(descriptor, libc::F_DUPFD_CLOEXEC, 0) };
        if descriptor < 0 {
            return Err(errno());
        }
        Ok(Self {
            descriptor,
            link: Link::of(descriptor),
            batch: Batch::new(),
            account: Account::new(bit_rate, data_bit_rate),
        })
    }

    /// Waits until something has arrived, but no longer than `timeout_ns`. For whoever lives by the frames that
    /// come, as a simulated drive does; the cycle lives by the clock.
    pub fn wait(&self, timeout_ns: Nanoseconds) {
        let mut entry = libc::pollfd { fd: self.descriptor, events: libc::POLLIN, revents: 0 };
        let timeout = timespec_of(timeout_ns);
        // SAFETY: one entry and the time are valid for the call; no signal mask is given. However the wait ends, the
        // caller looks for itself.
        unsafe { libc::ppoll(&mut entry, 1, &timeout, core::ptr::null()) };
    }
}

impl Drop for SocketCanPort {
    fn drop(&mut self) {
        // SAFETY: the descriptor was made in `new` and belongs to nobody else.
        unsafe { libc::close(self.descriptor) };
    }
}

impl core::fmt::Debug for SocketCanPort {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("SocketCanPort").field("account", &self.account).finish_non_exhaustive()
    }
}

impl BusPort for SocketCanPort {
    fn send(&mut self, _now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        let mut taken = 0;
        for chunk in frames.chunks(SEND_BATCH) {
            match batch::send(self.descriptor, chunk.iter().map(|frame| (Destination::Bound, frame))) {
                Ok(count) => {
                    self.account.taken(chunk.get(..count).unwrap_or(chunk));
                    taken += count;
                    if count < chunk.len() {
                        // The kernel keeps to itself why it stopped in the middle. It is the queue, or else the
                        // next call says what.
                        self.account.refused(frames.len().saturating_sub(taken), libc::ENOBUFS);
                        break;
                    }
                }
                Err(errno) => {
                    self.account.refused(frames.len().saturating_sub(taken), errno);
                    break;
                }
            }
        }
        taken
    }

    fn send_together(now_ns: Nanoseconds, outgoing: &mut [Outgoing<'_, Self>]) {
        together::send(now_ns, outgoing);
    }

    fn receive(&mut self, _now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        let clocks = ClockPair::read();
        loop {
            // Own and error frames take places in a call and none in the batch. A call that was filled is
            // repeated, so that fewer frames than there was room for mean that no more are waiting.
            let limit = batch.remaining_capacity().min(RECEIVE_BATCH);
            if limit == 0 {
                return;
            }
            let account = &mut self.account;
            let outcome = self.batch.receive(self.descriptor, limit, |arrival| {
                if let Some(frame) = account.arrived(&arrival) {
                    let at_ns = clocks.monotonic_at(arrival.real_time_ns);
                    // There is room: no more was asked for.
                    let _ = batch.try_push(Received { frame, at_ns });
                }
            });
            match outcome {
                Ok(count) if count == limit => {}
                Ok(_) => {
                    self.account.read_empty();
                    return;
                }
                Err(errno) => {
                    self.account.receive_failed(errno);
                    return;
                }
            }
        }
    }

    fn unconfirmed(&mut self, _now_ns: Nanoseconds) -> usize {
        // Frames that do not come back may have been dropped by an interface that is being taken down.
        if self.account.unconfirmed() > 0 && self.link.is_lost() {
            self.account.link_lost();
        }
        self.account.unconfirmed()
    }

    fn health(&mut self) -> BusHealth {
        self.account.health
    }
}

/// The same instant on both clocks.
#[derive(Clone, Copy)]
struct ClockPair {
    monotonic_ns: Nanoseconds,
    real_time_ns: Nanoseconds,
}

/// How far from the present a time stamp may be.
const STAMP_LIMIT_NS: Nanoseconds = NANOSECONDS_PER_SECOND;

impl ClockPair {
    fn read() -> Self {
        // The middle of two readings, so that being interrupted between them counts half.
        let before_ns = monotonic_ns();
        let real_time_ns = real_time_ns();
        Self { monotonic_ns: before_ns.midpoint(monotonic_ns()), real_time_ns }
    }

    fn monotonic_at(&self, stamp_ns: Option<Nanoseconds>) -> Nanoseconds {
        let Some(stamp_ns) = stamp_ns else { return self.monotonic_ns };
        if stamp_ns.abs_diff(self.real_time_ns) > STAMP_LIMIT_NS {
            return self.monotonic_ns;
        }
        if stamp_ns <= self.real_time_ns {
            self.monotonic_ns.saturating_sub(self.real_time_ns - stamp_ns)
        } else {
            self.monotonic_ns.saturating_add(stamp_ns - self.real_time_ns)
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::frame::Id;
    use crate::port::BusState;
    use std::vec::Vec;

    /// Two ports on either end of a pair of datagram sockets: everything but what only a CAN interface has
    /// (own frames coming back, error frames), which is tested on one.
    fn connected() -> (SocketCanPort, SocketCanPort) {
        let mut ends = [0; 2];
        // SAFETY: `ends` has room for both descriptors.
        let made = unsafe { libc::socketpair(libc::AF_UNIX, libc::SOCK_DGRAM, 0, ends.as_mut_ptr()) };
        assert_eq!(made, 0);
        let ports = ends.map(|end| {
            let on = 1i32;
            // SAFETY: the option's value is an `int`, and the descriptor is ours to close after the port has
            // made its own.
            unsafe {
                let length = size_of::<i32>() as libc::socklen_t;
                let set = libc::setsockopt(
                    end,
                    libc::SOL_SOCKET,
                    libc::SO_TIMESTAMPNS,
                    (&raw const on).cast(),
                    length,
                );
                assert_eq!(set, 0);
            }
            let port = SocketCanPort::new(end, 1_000_000, None).unwrap();
            // SAFETY: as above.
            unsafe { libc::close(end) };
            port
        });
        ports.into()
    }

    fn frame(number: u32) -> Frame {
        Frame::of(Id::base(number).unwrap(), [number as u8; 8])
    }

    fn received(port: &mut SocketCanPort) -> Vec<Frame> {
        let mut batch = ReceiveBatch::new();
        port.receive(0, &mut batch);
        batch.iter().map(|received| received.frame).collect()
    }

    #[test]
    fn frames_of_all_kinds_cross_in_their_order() {
        let (mut left, mut right) = connected();
        let id = Id::extended(0x1234_5678).unwrap();
        let sent = [
            frame(0x181),
            Frame::remote(id, 8).unwrap(),
            Frame::fd(id, &[7; 64], true).unwrap(),
            Frame::fd(id, &[], false).unwrap(),
        ];
        assert_eq!(left.send(0, &sent), 4);
        assert_eq!(received(&mut right), sent);
        assert_eq!(right.health().rx_frames, 4);
        assert_eq!(received(&mut right), []);
    }

    #[test]
    fn what_finds_no_room_is_counted_and_not_kept() {
        let (mut left, mut right) = connected();
        let burst: Vec<Frame> = (0..600).map(frame).collect();
        let taken = left.send(0, &burst);
        assert!(taken < burst.len());
        assert_eq!(left.health().tx_overruns as usize, burst.len() - taken);
        assert_eq!(left.send(0, &burst), 0);
        let mut arrived = received(&mut right);
        while arrived.len() < taken {
            arrived.extend(received(&mut right));
        }
        assert_eq!(arrived, burst[..taken]);
        assert_eq!(received(&mut right), []);
    }

    #[test]
    fn a_batch_without_room_takes_nothing_and_loses_nothing() {
        let (mut left, mut right) = connected();
        left.send(0, &[frame(1), frame(2), frame(3)]);
        let mut batch = ReceiveBatch::new();
        while batch.remaining_capacity() > 1 {
            batch.push(Received { frame: frame(0), at_ns: 0 });
        }
        right.receive(0, &mut batch);
        assert_eq!(batch.last().unwrap().frame, frame(1));
        right.receive(0, &mut batch);
        assert_eq!(received(&mut right), [frame(2), frame(3)]);
    }

    #[test]
    fn arrivals_carry_the_time_between_sending_and_reading() {
        let (mut left, mut right) = connected();
        let mut batch = ReceiveBatch::new();
        let before_ns = monotonic_ns();
        left.send(0, &[frame(1)]);
        right.receive(0, &mut batch);
        let after_ns = monotonic_ns();
        let at_ns = batch.last().unwrap().at_ns;
        assert!((before_ns..=after_ns).contains(&at_ns), "{before_ns} {at_ns} {after_ns}");
    }

    #[test]
    fn a_descriptor_that_is_none_is_refused() {
        assert_eq!(SocketCanPort::new(-1, 1_000_000, None).err(), Some(libc::EBADF));
    }

    #[test]
    fn a_socket_that_is_closed_on_the_other_side_is_an_error_and_no_panic() {
        let (mut left, right) = connected();
        drop(right);
        assert_eq!(left.send(0, &[frame(1)]), 0);
        assert_eq!(received(&mut left), []);
        assert!(left.health().errors > 0);
        assert_eq!(left.health().state, BusState::ErrorActive);
    }

    #[test]
    fn a_stamp_is_moved_to_the_monotonic_clock_unless_the_real_time_clock_was_set() {
        let clocks = ClockPair { monotonic_ns: 5_000_000_000, real_time_ns: 1_700_000_000_000_000_000 };
        assert_eq!(clocks.monotonic_at(Some(1_700_000_000_000_000_000 - 40_000)), 5_000_000_000 - 40_000);
        assert_eq!(clocks.monotonic_at(Some(1_700_000_000_000_000_000 + 300)), 5_000_000_300);
        assert_eq!(clocks.monotonic_at(Some(1_600_000_000_000_000_000)), 5_000_000_000);
        assert_eq!(clocks.monotonic_at(Some(0)), 5_000_000_000);
        assert_eq!(clocks.monotonic_at(None), 5_000_000_000);
    }
}
