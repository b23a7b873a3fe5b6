//! What the cycle calls on the socket of a bus.

use super::arrival_time::ClockPair;
use super::port::SocketCanPort;
use super::{reading, together};
use crate::frame::Frame;
use crate::port::{BusHealth, BusPort, Outgoing, ReceiveBatch};
use crate::time::Nanoseconds;

impl BusPort for SocketCanPort {
    fn send(&mut self, _now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        self.send_alone(frames)
    }

    fn send_together(_now_ns: Nanoseconds, outgoing: &mut [Outgoing<'_, Self>]) {
        together::send(outgoing);
    }

    fn receive(&mut self, _now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        reading::read(&mut self.source, &mut self.accounting, ClockPair::read(), batch);
    }

    fn unconfirmed(&mut self, _now_ns: Nanoseconds) -> usize {
        // An interface that is being taken down drops frames. Those never come back. One that is down may be another one by now.
        let is_doubtful = self.accounting.unconfirmed() > 0 || self.accounting.is_down();
        if is_doubtful && self.link.is_lost() {
            self.accounting.link_lost();
        }
        self.accounting.unconfirmed()
    }

    fn health(&mut self) -> BusHealth {
        self.accounting.health()
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::frame::Id;
    use crate::linux::clock::monotonic_ns;
    use crate::port::{BusState, Received};
    use std::vec::Vec;

    /// Two ports at the ends of a pair of datagram sockets. Own frames that come back and error frames need a CAN
    /// interface: the laboratory tests those.
    fn connected() -> (SocketCanPort, SocketCanPort) {
        connected_with(Some(5_000_000))
    }

    fn connected_with(data_bit_rate: Option<u32>) -> (SocketCanPort, SocketCanPort) {
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
            let port = SocketCanPort::new(end, 1_000_000, data_bit_rate).unwrap();
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
    fn can_fd_frames_leave_only_on_a_bus_that_is_set_up_for_them() {
        let (mut left, mut right) = connected_with(None);
        let long = Frame::fd(Id::base(0x201).unwrap(), &[7; 16], false).unwrap();
        assert_eq!(left.send(0, &[frame(1), long, frame(2)]), 1);
        let mut taken = 0;
        SocketCanPort::send_together(
            0,
            &mut [Outgoing { port: &mut left, frames: &[frame(3), long], taken: &mut taken }],
        );
        assert_eq!(taken, 1);
        assert_eq!(received(&mut right), [frame(1), frame(3)]);
        assert!(left.health().errors > 0);
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
    fn a_socket_that_is_closed_on_the_other_side_is_an_error_and_no_panic() {
        let (mut left, right) = connected();
        drop(right);
        assert_eq!(left.send(0, &[frame(1)]), 0);
        assert_eq!(received(&mut left), []);
        assert!(left.health().errors > 0);
        assert_eq!(left.health().state, BusState::ErrorActive);
    }
}
