//! Simulated drives on a real interface in wall-clock time, for any master.

use std::sync::atomic::{AtomicBool, Ordering};

use takt_rt::Frame;
use takt_rt::linux::{LineCodec, LinePort, MonotonicClock, SocketCanPort};
use takt_rt::{BusPort, Clock, Nanoseconds, ReceiveBatch};

use super::drive::Drive;
use super::lss::LssDevice;
use super::mailbox::{Mailbox, QueueOrder};
use super::port::DRIVE_MAILBOX;

/// Longest wait, so that a request to stop is noticed.
const LONGEST_WAIT_NS: Nanoseconds = 20_000_000;

/// The interface of drives that react to frames.
pub trait LivePort: BusPort + Send {
    /// Waits until something has arrived, but not longer than `timeout_ns`.
    fn wait(&self, timeout_ns: Nanoseconds);
}

impl LivePort for SocketCanPort {
    fn wait(&self, timeout_ns: Nanoseconds) {
        self.wait(timeout_ns);
    }
}

impl<C: LineCodec + Send> LivePort for LinePort<C> {
    fn wait(&self, timeout_ns: Nanoseconds) {
        self.wait(timeout_ns);
    }
}

/// Drives that share one interface. Their frames are sent in the order of bus arbitration. Frames that the interface
/// has no room for wait.
pub struct LiveDrives {
    port: Box<dyn LivePort>,
    stations: Vec<(Box<dyn Drive>, Mailbox)>,
    /// Devices that have LSS and nothing else. Their frames follow those of the drives.
    lss_devices: Vec<(LssDevice, Mailbox)>,
    /// Frames in arbitration order, each with the index of its sender; the port takes them next.
    leaving: Vec<(usize, Frame)>,
    /// Start of the drives' time.
    epoch_ns: Nanoseconds,
}

impl LiveDrives {
    /// These drives on an interface. The supply is switched on now.
    pub fn new(drives: Vec<Box<dyn Drive>>, port: Box<dyn LivePort>) -> Self {
        let stations =
            drives.into_iter().map(|drive| (drive, Mailbox::new(QueueOrder::Priority, DRIVE_MAILBOX)));
        Self {
            port,
            stations: stations.collect(),
            lss_devices: vec![],
            leaving: vec![],
            epoch_ns: MonotonicClock::default().now_ns(),
        }
    }

    /// Puts a device beside the drives that has LSS and nothing else. It boots if it has a node ID.
    pub fn add_lss_device(&mut self, mut device: LssDevice) {
        let mut mailbox = Mailbox::new(QueueOrder::FirstInFirstOut, DRIVE_MAILBOX);
        if let Some(boot_up) = device.power_cycle() {
            mailbox.push(boot_up);
        }
        self.lss_devices.push((device, mailbox));
    }

    /// Runs until `is_stopped`. Sleeps while there is nothing to do.
    pub fn run(&mut self, is_stopped: &AtomicBool) {
        while !is_stopped.load(Ordering::Relaxed) {
            let next_ns = self.poll();
            self.port.wait(next_ns.saturating_sub(self.now_ns()).min(LONGEST_WAIT_NS));
        }
    }

    /// Time since the drives were created.
    pub fn now_ns(&self) -> Nanoseconds {
        MonotonicClock::default().now_ns().saturating_sub(self.epoch_ns)
    }

    /// Does what is due now, and returns when the next action is due unless a frame arrives before.
    pub fn poll(&mut self) -> Nanoseconds {
        let now_ns = self.now_ns();
        // As on the simulated bus, due actions come before received frames.
        for (drive, mailbox) in &mut self.stations {
            if drive.wake_ns() <= now_ns {
                drive.advance(now_ns, mailbox);
            }
        }
        self.receive_frames(now_ns);
        self.send_frames(now_ns);
        let due_ns = self.stations.iter().map(|(drive, _)| drive.wake_ns()).min().unwrap_or(u64::MAX);
        // Frames that found no room are offered again soon.
        if self.leaving.is_empty() { due_ns } else { due_ns.min(now_ns + RETRY_NS) }
    }

    /// The node IDs, in the order of the configuration.
    pub fn nodes(&self) -> impl Iterator<Item = u8> + '_ {
        self.stations.iter().map(|(drive, _)| drive.node())
    }

    fn receive_frames(&mut self, now_ns: Nanoseconds) {
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

    /// Delivers a frame to every drive except its sender.
    fn deliver(&mut self, now_ns: Nanoseconds, frame: &Frame, sender: Option<usize>) {
        for (index, (drive, mailbox)) in self.stations.iter_mut().enumerate() {
            if Some(index) != sender {
                drive.receive(now_ns, frame, mailbox);
            }
        }
        for (device, mailbox) in &mut self.lss_devices {
            // The replies of LSS devices are no requests, so a device may hear its own.
            if let Some(reply) = device.receive(frame) {
                mailbox.push(reply);
            }
        }
    }

    fn send_frames(&mut self, now_ns: Nanoseconds) {
        if self.leaving.is_empty() {
            for (index, (_, mailbox)) in self.stations.iter_mut().enumerate() {
                while let Some(frame) = mailbox.pop() {
                    self.leaving.push((index, frame));
                }
            }
            for (index, (_, mailbox)) in (self.stations.len()..).zip(&mut self.lss_devices) {
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

    use super::*;
    use crate::cia402::{Cia402AxisParameters, Cia402Drive, Cia402Parameters};
    use crate::homing_switches::ReferenceSwitches;
    use crate::plant::{Encoder, FrictionShape, JointParameters};
    use takt_rt::Id;
    use takt_wire::canopen::lss::{LssAddress, LssRequest, LssResponse};
    use takt_wire::quirks::Quirks;

    fn drive(node: u8) -> Box<dyn Drive> {
        let axis = Cia402AxisParameters {
            joint: JointParameters {
                inertia: 1.0,
                viscous_friction: 10.0,
                coulomb_friction: 3.0,
                friction_shape: FrictionShape::Constant,
                brake_torque: 60.0,
            },
            encoder: Encoder { counts_per_unit: 524_288.0 / std::f64::consts::TAU, zero_counts: 0.0 },
            counts_per_turn: 524_288.0,
            initial_position: 0.0,
            rated_torque: 10.0,
            peak_torque: 30.0,
            highest_velocity: 3.0,
            switches: ReferenceSwitches::default(),
            end_stops: None,
        };
        let sheet = include_bytes!("../../../configs/eds/erob-canopen.eds");
        let parameters = Cia402Parameters {
            sheet: takt_wire::canopen::eds::parse("data sheet", sheet).unwrap().dictionary,
            node,
            quirks: Quirks::default(),
            axes: vec![axis],
            power_up_ns: 1_000_000,
            feedback_delay_ns: 50_000,
            seed: 1,
        };
        Box::new(Cia402Drive::new(parameters).unwrap())
    }

    /// Three drives on one end of a socket pair, and the other end. Only the interface differs from a real one.
    fn connected() -> (LiveDrives, SocketCanPort) {
        let (ours, theirs) = UnixDatagram::pair().unwrap();
        let port = |socket: &UnixDatagram| SocketCanPort::new(socket.as_raw_fd(), 1_000_000, None).unwrap();
        let drives = (1..=3).map(drive);
        (LiveDrives::new(drives.collect(), Box::new(port(&ours))), port(&theirs))
    }

    /// Runs until the master has received `count` frames.
    fn received(drives: &mut LiveDrives, master: &mut SocketCanPort, count: usize) -> Vec<Frame> {
        let mut frames = vec![];
        while frames.len() < count {
            let next_ns = drives.poll();
            let mut batch = ReceiveBatch::new();
            master.receive(0, &mut batch);
            frames.extend(batch.iter().map(|received| received.frame));
            let pause_ns = next_ns.saturating_sub(drives.now_ns()).min(1_000_000);
            std::thread::sleep(std::time::Duration::from_nanos(pause_ns));
        }
        frames
    }

    #[test]
    fn drives_boot_and_answer_sdo_requests() {
        let (mut drives, mut master) = connected();
        let nodes: Vec<u8> = drives.nodes().collect();
        let boot_up: Vec<Frame> =
            nodes.iter().map(|node| Frame::of(Id::canopen(0x700, *node), [0])).collect();
        assert_eq!(received(&mut drives, &mut master, nodes.len()), boot_up);
        let read_device_type = [0x40, 0x00, 0x10, 0, 0, 0, 0, 0];
        assert_eq!(master.send(0, &[Frame::of(Id::canopen(0x600, nodes[1]), read_device_type)]), 1);
        let answer = received(&mut drives, &mut master, 1);
        assert_eq!(answer[0].id(), Id::canopen(0x580, nodes[1]));
        assert_eq!(answer[0].payload()[..4], [0x43, 0x00, 0x10, 0]);
        assert_eq!(drives.port.health().rx_frames, 1);
    }

    #[test]
    fn lss_devices_beside_the_drives_answer_a_scan() {
        let (mut drives, mut master) = connected();
        let device = |serial| LssDevice::new(LssAddress { vendor: 1, product: 2, revision: 3, serial }, None);
        drives.add_lss_device(device(1));
        drives.add_lss_device(device(2));
        let boot_ups = drives.nodes().count();
        received(&mut drives, &mut master, boot_ups);
        let begin = LssRequest::FastScan { value: 0, lowest_bit: 0x80, part: 0, next: 0 };
        assert_eq!(master.send(0, &[begin.frame()]), 1);
        let answers = received(&mut drives, &mut master, 2);
        assert!(answers.iter().all(|frame| LssResponse::decode(frame) == Some(LssResponse::Identified)));
    }

    #[test]
    fn the_time_of_the_drives_begins_at_zero() {
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
