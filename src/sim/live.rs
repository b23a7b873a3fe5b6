//! Simulated drives on a real interface, in wall-clock time: for any master to talk to.

use std::sync::atomic::{AtomicBool, Ordering};

use takt_rt::Frame;
use takt_rt::linux::{MonotonicClock, SocketCanPort};
use takt_rt::{BusHealth, BusPort, Clock, Nanoseconds, ReceiveBatch};

use super::drive::Drive;
use super::mailbox::{Mailbox, Order};
use super::port::{DRIVE_MAILBOX, drives_of};
use crate::config::Config;

/// How long a wait is at most, so that a request to stop is seen.
const LONGEST_WAIT_NS: Nanoseconds = 20_000_000;

/// Drives that share one interface. Their frames leave in the order of their identifiers, as they would win the
/// arbitration of a bus; what the interface has no room for waits.
pub struct LiveDrives {
    port: SocketCanPort,
    stations: Vec<(Box<dyn Drive>, Mailbox)>,
    /// Frames that have won, with the index of their sender; the port takes them next.
    leaving: Vec<(usize, Frame)>,
    /// The time of the drives begins with them.
    epoch_ns: Nanoseconds,
}

impl LiveDrives {
    /// A drive for every axis of the bus with this index in the configuration. Their supply comes on now.
    pub fn new(config: &Config, bus: usize, port: SocketCanPort) -> Self {
        let stations = drives_of(config, bus)
            .into_iter()
            .map(|drive| (drive, Mailbox::new(Order::Priority, DRIVE_MAILBOX)));
        Self {
            port,
            stations: stations.collect(),
            leaving: vec![],
            epoch_ns: MonotonicClock::default().now_ns(),
        }
    }

    /// Lives until `is_stopped`. Sleeps whenever there is nothing to do.
    pub fn run(&mut self, is_stopped: &AtomicBool) {
        while !is_stopped.load(Ordering::Relaxed) {
            let next_ns = self.turn();
            self.port.wait(next_ns.saturating_sub(self.now_ns()).min(LONGEST_WAIT_NS));
        }
    }

    /// For how long they have lived.
    pub fn now_ns(&self) -> Nanoseconds {
        MonotonicClock::default().now_ns().saturating_sub(self.epoch_ns)
    }

    /// Does what is due now, and returns when something will be due again if no frame comes before.
    pub fn turn(&mut self) -> Nanoseconds {
        let now_ns = self.now_ns();
        // As on the simulated bus: what was due comes before what has arrived.
        for (drive, mailbox) in &mut self.stations {
            if drive.wake_ns() <= now_ns {
                drive.advance(now_ns, mailbox);
            }
        }
        self.hear(now_ns);
        self.speak(now_ns);
        let due_ns = self.stations.iter().map(|(drive, _)| drive.wake_ns()).min().unwrap_or(u64::MAX);
        // What found no room is offered again soon.
        if self.leaving.is_empty() { due_ns } else { due_ns.min(now_ns + RETRY_NS) }
    }

    /// Their node numbers, in the order of the configuration.
    pub fn nodes(&self) -> impl Iterator<Item = u8> + '_ {
        self.stations.iter().map(|(drive, _)| drive.node())
    }

    /// The state of the interface.
    pub fn health(&mut self) -> BusHealth {
        self.port.health()
    }

    fn hear(&mut self, now_ns: Nanoseconds) {
        let mut batch = ReceiveBatch::new();
        loop {
            batch.clear();
            self.port.receive(now_ns, &mut batch);
            for received in &batch {
                self.deliver(now_ns, &received.frame, None);
            }
            if !batch.is_full() {
                return;
            }
        }
    }

    /// Hands a frame to every drive but its sender.
    fn deliver(&mut self, now_ns: Nanoseconds, frame: &Frame, sender: Option<usize>) {
        for (index, (drive, mailbox)) in self.stations.iter_mut().enumerate() {
            if Some(index) != sender {
                drive.receive(now_ns, frame, mailbox);
            }
        }
    }

    fn speak(&mut self, now_ns: Nanoseconds) {
        if self.leaving.is_empty() {
            for (index, (_, mailbox)) in self.stations.iter_mut().enumerate() {
                while let Some(frame) = mailbox.pop() {
                    self.leaving.push((index, frame));
                }
            }
            self.leaving.sort_by_key(|(_, frame)| frame.id().arbitration_key());
        }
        if self.leaving.is_empty() {
            return;
        }
        let frames: Vec<Frame> = self.leaving.iter().map(|(_, frame)| *frame).collect();
        let taken = self.port.send(now_ns, &frames);
        let sent: Vec<(usize, Frame)> = self.leaving.drain(..taken).collect();
        for (sender, frame) in sent {
            self.deliver(now_ns, &frame, Some(sender));
        }
    }
}

const RETRY_NS: Nanoseconds = 100_000;

#[cfg(test)]
mod tests {
    use std::os::fd::AsRawFd;
    use std::os::unix::net::UnixDatagram;
    use std::path::Path;

    use takt_rt::Id;

    use super::*;

    /// The drives of the first bus of a configuration on one end of a pair of sockets, and the other end. Everything
    /// but the interface is as it is on a real one.
    fn connected() -> (LiveDrives, SocketCanPort) {
        let mut config = Config::load(Path::new("configs/arm6-erob.toml")).unwrap();
        config.axes.iter_mut().for_each(|axis| axis.simulated.power_up_ns = 1_000_000);
        let (ours, theirs) = UnixDatagram::pair().unwrap();
        let port = |socket: &UnixDatagram| SocketCanPort::new(socket.as_raw_fd(), 1_000_000, None).unwrap();
        (LiveDrives::new(&config, 0, port(&ours)), port(&theirs))
    }

    /// Lives until the master has heard `count` frames; they come in the drives' own time.
    fn heard(drives: &mut LiveDrives, master: &mut SocketCanPort, count: usize) -> Vec<Frame> {
        let mut frames = vec![];
        while frames.len() < count {
            let next_ns = drives.turn();
            let mut batch = ReceiveBatch::new();
            master.receive(0, &mut batch);
            frames.extend(batch.iter().map(|received| received.frame));
            let pause_ns = next_ns.saturating_sub(drives.now_ns()).min(1_000_000);
            std::thread::sleep(std::time::Duration::from_nanos(pause_ns));
        }
        frames
    }

    #[test]
    fn drives_boot_and_answer_whoever_asks() {
        let (mut drives, mut master) = connected();
        let nodes: Vec<u8> = drives.nodes().collect();
        let boot_up: Vec<Frame> =
            nodes.iter().map(|node| Frame::of(Id::canopen(0x700, *node), [0])).collect();
        assert_eq!(heard(&mut drives, &mut master, nodes.len()), boot_up);
        let read_device_type = [0x40, 0x00, 0x10, 0, 0, 0, 0, 0];
        assert_eq!(master.send(0, &[Frame::of(Id::canopen(0x600, nodes[1]), read_device_type)]), 1);
        let answer = heard(&mut drives, &mut master, 1);
        assert_eq!(answer[0].id(), Id::canopen(0x580, nodes[1]));
        assert_eq!(answer[0].payload()[..4], [0x43, 0x00, 0x10, 0]);
        assert_eq!(drives.health().rx_frames, 1);
    }

    #[test]
    fn their_time_begins_with_them_and_not_with_the_machine() {
        let (drives, _master) = connected();
        let uptime_ns = MonotonicClock::default().now_ns();
        assert!(drives.now_ns() < uptime_ns / 2);
    }

    #[test]
    fn a_request_to_stop_ends_them() {
        let (mut drives, _master) = connected();
        drives.run(&AtomicBool::new(true));
        let is_stopped = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let thread = scope.spawn(|| drives.run(&is_stopped));
            is_stopped.store(true, Ordering::Relaxed);
            thread.join().unwrap();
        });
    }
}
