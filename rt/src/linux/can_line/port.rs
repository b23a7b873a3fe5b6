//! The descriptor of an adapter or a converter.

use super::super::can::DescriptorError;
use super::super::clock::monotonic_ns;
use super::byte_line::Descriptor;
use super::channel::Channel;
use super::codec::{LineCodec, SlcanCodec, TransparentCodec};
use crate::frame::Frame;
use crate::port::{BusHealth, BusPort, ReceiveBatch};
use crate::time::Nanoseconds;

/// An SLCAN adapter as a bus port. The caller opens the channel of the adapter; dropping the port closes it.
pub type SlcanPort = LinePort<SlcanCodec>;

/// A transparent converter between RS-485 and CAN FD as a bus port. It carries frames of 16 bytes with an identifier below 256, and no
/// others. Its line has one direction at a time: a request and its reply must not meet the next request.
pub type TransparentPort = LinePort<TransparentCodec>;

/// A CAN bus behind a serial line as a bus port.
///
/// The caller opens and configures the serial line. The line must be raw, and a reading
/// of it must wait for at least one byte (`VMIN` 1): then an adapter that was unplugged differs from a silent one.
///
/// # What is weaker than with a CAN interface of Linux
/// - No frame is confirmed by the bus. A frame counts as sent when its line has left this machine.
/// - A frame has the time at which it was read, not the time of its arrival.
/// - An adapter does not report the state of its controller. The bus is [`Down`](crate::port::BusState::Down) when the adapter
///   is gone, and otherwise counts as error active.
pub struct LinePort<C: LineCodec> {
    channel: Channel<Descriptor, C>,
}

impl SlcanPort {
    /// Makes a port on the serial line `descriptor`. The descriptor is duplicated: the caller keeps and closes its own. The
    /// line becomes non-blocking.
    ///
    /// The bit rates in bit/s say how long a frame occupies the wire, for the bus load. Without `data_bit_rate` the port
    /// refuses CAN FD frames.
    ///
    /// # Errors
    /// [`DescriptorError`] where the descriptor is not an open one, or the process has no more descriptors.
    pub fn new(descriptor: i32, bit_rate: u32, data_bit_rate: Option<u32>) -> Result<Self, DescriptorError> {
        let line = Descriptor::duplicate(descriptor)?;
        let codec = SlcanCodec::new(data_bit_rate.is_some());
        Ok(Self { channel: Channel::new(line, codec, bit_rate, data_bit_rate) })
    }
}

impl TransparentPort {
    /// Makes a port on the serial line `descriptor`, as [`SlcanPort::new`] does. The bit rate is that of the bus behind the converter.
    ///
    /// # Errors
    /// As [`SlcanPort::new`].
    pub fn transparent(descriptor: i32, bit_rate: u32) -> Result<Self, DescriptorError> {
        let line = Descriptor::duplicate(descriptor)?;
        Ok(Self { channel: Channel::new(line, TransparentCodec::default(), bit_rate, None) })
    }
}

impl<C: LineCodec> LinePort<C> {
    /// Waits until something has arrived, but not longer than `timeout_ns`.
    ///
    /// This is for programs that react to frames, such as a simulated drive. The cycle waits for the clock instead.
    pub fn wait(&self, timeout_ns: Nanoseconds) {
        if !self.channel.has_input() {
            self.channel.line().wait(timeout_ns);
        }
    }
}

impl<C: LineCodec> BusPort for LinePort<C> {
    fn send(&mut self, _now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        self.channel.send(frames)
    }

    fn receive(&mut self, _now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        self.channel.receive(monotonic_ns(), batch);
    }

    fn unconfirmed(&mut self, _now_ns: Nanoseconds) -> usize {
        self.channel.unconfirmed()
    }

    fn health(&mut self) -> BusHealth {
        self.channel.health()
    }
}

impl<C: LineCodec> Drop for LinePort<C> {
    fn drop(&mut self) {
        self.channel.close();
    }
}

impl<C: LineCodec> core::fmt::Debug for LinePort<C> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("LinePort").field("health", &self.channel.health()).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::frame::Id;
    use crate::port::BusState;
    use std::io::{Read, Write};
    use std::os::fd::AsRawFd;
    use std::os::unix::net::UnixStream;
    use std::vec::Vec;

    /// A port at one end of a pair of stream sockets, and the other end as the adapter.
    fn connected() -> (SlcanPort, UnixStream) {
        let (ours, theirs) = UnixStream::pair().unwrap();
        theirs.set_nonblocking(true).unwrap();
        (SlcanPort::new(ours.as_raw_fd(), 1_000_000, None).unwrap(), theirs)
    }

    fn frame(number: u32) -> Frame {
        Frame::of(Id::base(number).unwrap(), [number as u8; 8])
    }

    fn received(port: &mut SlcanPort) -> Vec<Frame> {
        let mut batch = ReceiveBatch::new();
        port.receive(0, &mut batch);
        batch.iter().map(|received| received.frame).collect()
    }

    #[test]
    fn frames_cross_in_both_directions_and_the_channel_closes_with_the_port() {
        let (mut port, mut adapter) = connected();
        assert_eq!(port.send(0, &[frame(0x181)]), 1);
        let mut bytes = [0; 64];
        let count = adapter.read(&mut bytes).unwrap();
        assert_eq!(&bytes[..count], b"t18188181818181818181\r");
        assert_eq!(port.unconfirmed(0), 0);
        assert_eq!(received(&mut port), []);
        adapter.write_all(b"t2018010101010101").unwrap();
        assert_eq!(received(&mut port), []);
        adapter.write_all(b"0101\r").unwrap();
        port.wait(1_000_000_000);
        assert_eq!(received(&mut port), [Frame::of(Id::base(0x201).unwrap(), [1; 8])]);
        drop(port);
        let count = adapter.read(&mut bytes).unwrap();
        assert_eq!(&bytes[..count], b"C\r");
    }

    #[test]
    fn a_serial_line_that_takes_no_more_never_blocks_and_everything_that_was_taken_arrives() {
        let (mut port, mut adapter) = connected();
        let burst: Vec<Frame> = (0..64).map(frame).collect();
        let mut taken = 0;
        while port.send(0, &burst) == burst.len() {
            taken += burst.len();
        }
        assert!(port.health().tx_overruns > 0);
        assert!(port.unconfirmed(0) > 0);
        let mut all = Vec::new();
        let mut bytes = [0; 4_096];
        while let Ok(count) = adapter.read(&mut bytes) {
            all.extend_from_slice(&bytes[..count]);
            port.unconfirmed(0);
        }
        assert_eq!(all.last(), Some(&b'\r'));
        assert!(all.iter().filter(|byte| **byte == b'\r').count() >= taken);
        assert_eq!(port.unconfirmed(0), 0);
    }

    #[test]
    fn an_adapter_that_goes_away_is_down_and_no_panic() {
        let (mut port, adapter) = connected();
        drop(adapter);
        assert_eq!(received(&mut port), []);
        assert_eq!(port.health().state, BusState::Down);
    }

    #[test]
    fn a_number_that_is_no_descriptor_is_refused_by_name() {
        let error = SlcanPort::new(-1, 1_000_000, None).unwrap_err();
        assert_eq!(error, DescriptorError { descriptor: -1, errno: libc::EBADF });
    }
}
