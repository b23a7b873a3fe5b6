//! An SLCAN adapter on a pseudo-terminal, between simulated drives and whoever opens it.
//!
//! It answers as one of LAWICEL does: CR to a command, `z` or `Z` to a frame, BEL to what it refuses. It knows the CAN FD frames
//! of the CANable as well. An adapter at another bit rate than its bus hears nobody and is heard by nobody; so is this one.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};

use takt_rt::slcan::{BitRate, Command, DataBitRate, HostLine, LineReader, encode_frame};
use takt_rt::{BusHealth, BusPort, Frame, Nanoseconds, ReceiveBatch, Received};

use super::live::LivePort;
use super::pseudo_terminal::PseudoTerminal;

/// The answers to the questions for the version and the serial number: those of a LAWICEL CANUSB.
const VERSION: &[u8] = b"V1013\r";
const SERIAL_NUMBER: &[u8] = b"NT4KT\r";
/// No error: none of the flags is set.
const STATUS: &[u8] = b"F00\r";
const ACCEPTED: &[u8] = b"\r";
const REFUSED: &[u8] = b"\x07";

/// The bit rates of a bus in bit/s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AdapterBitRates {
    /// Classic frames and the arbitration phase.
    pub nominal: u32,
    /// The data phase of CAN FD frames; `None` on a classic bus.
    pub data: Option<u32>,
}

/// The channel of an adapter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Channel {
    #[default]
    Closed,
    Open,
    /// It hears the bus and sends nothing.
    Listening,
}

/// A simulated adapter. Its side of the bus is a port for simulated drives: what the host sends is received there.
#[derive(Debug)]
pub struct SlcanAdapter {
    line: PseudoTerminal,
    reader: LineReader,
    /// Bytes from the host that were not looked at, because the caller's batch was full.
    input: VecDeque<u8>,
    /// The end of a line to the host that the serial line took only in part.
    rest: Vec<u8>,
    channel: Channel,
    bus: AdapterBitRates,
    nominal: Option<BitRate>,
    data: Option<DataBitRate>,
    health: BusHealth,
}

impl SlcanAdapter {
    /// An adapter between this line and a bus with these bit rates. Its channel is closed.
    pub fn new(line: PseudoTerminal, bus: AdapterBitRates) -> Self {
        Self {
            line,
            reader: LineReader::default(),
            input: VecDeque::new(),
            rest: vec![],
            channel: Channel::Closed,
            bus,
            nominal: None,
            data: None,
            health: BusHealth::default(),
        }
    }

    /// Returns `true` if a frame can pass between the adapter and its bus.
    fn passes(&self, frame: &Frame) -> bool {
        let is_nominal = self.nominal.is_some_and(|rate| rate.bits_per_s() == self.bus.nominal);
        let is_data = self.bus.data.is_some() && self.data.map(DataBitRate::bits_per_s) == self.bus.data;
        is_nominal && (!frame.is_fd() || is_data)
    }

    /// Reads what the host has sent. `false` when nothing more waits.
    fn read_more(&mut self) -> bool {
        let mut bytes = [0; 1_024];
        // An error that stays shows in the next call, and the pseudo-terminal itself is never gone.
        let count = self.line.read(&mut bytes).unwrap_or(0);
        self.input.extend(bytes.iter().take(count));
        count > 0
    }

    /// The frame for the bus in a line of the host, if it is one. Every line is answered.
    fn obey(&mut self, line: HostLine) -> Option<Frame> {
        let (answer, frame): (&[u8], _) = match line {
            HostLine::Empty => (ACCEPTED, None),
            HostLine::Frame(frame) if self.channel == Channel::Open => {
                let answer: &[u8] = if frame.id().is_extended() { b"Z\r" } else { b"z\r" };
                (answer, Some(frame).filter(|frame| self.passes(frame)))
            }
            HostLine::Frame(_) => (REFUSED, None),
            HostLine::Command(command) => (self.obey_command(command), None),
        };
        self.write_line(answer);
        frame
    }

    fn obey_command(&mut self, command: Command) -> &'static [u8] {
        let is_closed = self.channel == Channel::Closed;
        match command {
            Command::SetBitRate(rate) if is_closed => self.nominal = Some(rate),
            Command::SetDataBitRate(rate) if is_closed => self.data = Some(rate),
            Command::Open if is_closed && self.nominal.is_some() => self.channel = Channel::Open,
            Command::Listen if is_closed && self.nominal.is_some() => self.channel = Channel::Listening,
            Command::Close if !is_closed => self.channel = Channel::Closed,
            Command::TimeStamps(false) if is_closed => {}
            Command::Version => return VERSION,
            Command::SerialNumber => return SERIAL_NUMBER,
            Command::Status if !is_closed => return STATUS,
            _ => return REFUSED,
        }
        ACCEPTED
    }

    /// Writes a whole line, or nothing of it when the host does not read. Returns whether the line took it.
    fn write_line(&mut self, line: &[u8]) -> bool {
        if !self.rest.is_empty() {
            let written = self.write_some(&self.rest.clone());
            self.rest.drain(..written);
        }
        if !self.rest.is_empty() {
            return false;
        }
        let written = self.write_some(line);
        if written > 0 {
            self.rest.extend(line.iter().skip(written));
        }
        written > 0
    }

    fn write_some(&mut self, bytes: &[u8]) -> usize {
        match self.line.write(bytes) {
            Ok(written) => written,
            Err(error) => {
                self.health.errors += u64::from(error.kind() != ErrorKind::WouldBlock);
                0
            }
        }
    }
}

impl BusPort for SlcanAdapter {
    /// Takes every frame. One that the host does not hear, or has no room for, is lost, as with a real adapter.
    fn send(&mut self, _now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        for frame in frames {
            if self.channel == Channel::Closed || !self.passes(frame) {
                continue;
            }
            if self.write_line(&encode_frame(frame)) {
                self.health.tx_frames += 1;
            } else {
                self.health.tx_overruns += 1;
            }
        }
        frames.len()
    }

    fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        loop {
            while !batch.is_full() {
                let Some(byte) = self.input.pop_front() else { break };
                let Some(line) = self.reader.push(byte).map(HostLine::decode) else { continue };
                match line {
                    Ok(line) => {
                        if let Some(frame) = self.obey(line) {
                            self.health.rx_frames += 1;
                            batch.push(Received { frame, at_ns: now_ns });
                        }
                    }
                    Err(_) => {
                        self.health.errors += 1;
                        self.write_line(REFUSED);
                    }
                }
            }
            if batch.is_full() || !self.read_more() {
                return;
            }
        }
    }

    fn unconfirmed(&mut self, _now_ns: Nanoseconds) -> usize {
        0
    }

    fn health(&mut self) -> BusHealth {
        self.health
    }
}

impl LivePort for SlcanAdapter {
    fn wait(&self, timeout_ns: Nanoseconds) {
        if self.input.is_empty() {
            self.line.wait(timeout_ns);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{File, OpenOptions};
    use takt_rt::Id;

    const CLASSIC: AdapterBitRates = AdapterBitRates { nominal: 1_000_000, data: None };
    const FD: AdapterBitRates = AdapterBitRates { nominal: 1_000_000, data: Some(5_000_000) };

    /// An adapter and the host's end of its line.
    fn adapter(bus: AdapterBitRates) -> (SlcanAdapter, File) {
        let line = PseudoTerminal::open().unwrap();
        let host = OpenOptions::new().read(true).write(true).open(line.path()).unwrap();
        (SlcanAdapter::new(line, bus), host)
    }

    /// What the adapter answers to this text, and the frames that reach its bus.
    fn told(adapter: &mut SlcanAdapter, host: &mut File, text: &str) -> (String, Vec<Frame>) {
        host.write_all(text.as_bytes()).unwrap();
        let mut batch = ReceiveBatch::new();
        adapter.wait(1_000_000_000);
        adapter.receive(7, &mut batch);
        (heard(host), batch.iter().map(|received| received.frame).collect())
    }

    /// What the host hears: everything that waits.
    fn heard(host: &mut File) -> String {
        use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
        use std::os::fd::AsFd;
        let mut text = String::new();
        let waits = |host: &File| {
            poll(&mut [PollFd::new(host.as_fd(), PollFlags::POLLIN)], PollTimeout::ZERO).unwrap() > 0
        };
        while waits(host) {
            let mut bytes = [0; 4_096];
            let count = host.read(&mut bytes).unwrap();
            text.push_str(std::str::from_utf8(&bytes[..count]).unwrap());
        }
        text
    }

    fn frame() -> Frame {
        Frame::of(Id::base(0x181).unwrap(), [0x37, 0x12])
    }

    #[test]
    fn frames_pass_in_both_directions_while_the_channel_is_open() {
        let (mut adapter, mut host) = adapter(CLASSIC);
        assert_eq!(told(&mut adapter, &mut host, "t18123712\r"), ("\x07".to_owned(), vec![]));
        assert_eq!(adapter.send(0, &[frame()]), 1);
        assert_eq!(told(&mut adapter, &mut host, "S8\rO\r"), ("\r\r".to_owned(), vec![]));
        let answer = ("z\rZ\r".to_owned(), vec![frame(), Frame::of(Id::extended(1).unwrap(), [])]);
        assert_eq!(told(&mut adapter, &mut host, "t18123712\rT000000010\r"), answer);
        assert_eq!(adapter.send(0, &[frame(); 2]), 2);
        assert_eq!(heard(&mut host), "t18123712\rt18123712\r");
        assert_eq!(told(&mut adapter, &mut host, "C\r").0, "\r");
        adapter.send(0, &[frame()]);
        assert_eq!(heard(&mut host), "");
    }

    #[test]
    fn at_another_bit_rate_nobody_hears_the_other() {
        let (mut adapter, mut host) = adapter(CLASSIC);
        assert_eq!(told(&mut adapter, &mut host, "S6\rO\rt18123712\r"), ("\r\rz\r".to_owned(), vec![]));
        adapter.send(0, &[frame()]);
        assert_eq!(heard(&mut host), "");
    }

    #[test]
    fn can_fd_frames_pass_on_a_bus_for_them_with_both_bit_rates() {
        let long = Frame::fd(Id::base(1).unwrap(), &[2; 12], true).unwrap();
        let text = String::from_utf8(encode_frame(&long).to_vec()).unwrap();
        for (bus, commands, passes) in [
            (FD, "S8\rY5\rO\r", true),
            (FD, "S8\rY2\rO\r", false),
            (FD, "S8\rO\r", false),
            (CLASSIC, "S8\rY5\rO\r", false),
        ] {
            let (mut adapter, mut host) = adapter(bus);
            told(&mut adapter, &mut host, commands);
            let (_, frames) = told(&mut adapter, &mut host, &text);
            assert_eq!(frames == [long], passes, "{bus:?} {commands:?}");
            adapter.send(0, &[long]);
            assert_eq!(heard(&mut host) == text, passes, "{bus:?} {commands:?}");
        }
    }

    #[test]
    fn what_makes_no_sense_now_is_refused() {
        let (mut adapter, mut host) = adapter(CLASSIC);
        for (text, answer) in [
            ("O\r", "\x07"),
            ("C\r", "\x07"),
            ("F\r", "\x07"),
            ("q\r", "\x07"),
            ("Z1\r", "\x07"),
            ("S8\r", "\r"),
            ("L\r", "\r"),
            ("S6\r", "\x07"),
            ("t18123712\r", "\x07"),
            ("V\r", "V1013\r"),
            ("N\r", "NT4KT\r"),
            ("F\r", "F00\r"),
        ] {
            assert_eq!(told(&mut adapter, &mut host, text).0, answer, "{text:?}");
        }
        adapter.send(0, &[frame()]);
        assert_eq!(heard(&mut host), "t18123712\r");
    }

    #[test]
    fn a_host_that_does_not_read_loses_frames_and_never_half_of_one() {
        let (mut adapter, mut host) = adapter(CLASSIC);
        told(&mut adapter, &mut host, "S8\rO\r");
        while adapter.health().tx_overruns == 0 {
            adapter.send(0, &[frame(); 64]);
        }
        let mut all = heard(&mut host);
        adapter.send(0, &[frame()]);
        all.push_str(&heard(&mut host));
        assert!(all.split_terminator('\r').all(|line| line == "t18123712"), "{:?}", &all[all.len() - 40..]);
        assert!(all.ends_with('\r'));
    }
}
