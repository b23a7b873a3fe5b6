//! A line with a master and simulated modules: the time that bytes take, noise, a cut wire.

use std::collections::VecDeque;

use takt_rt::Nanoseconds;
use takt_wire::modbus::line_timing::LineTiming;
use takt_wire::modbus::request_gathering::RequestGathering;

use super::drive::ErobModbusDrive;
use crate::drive::Drive;
use crate::random::Random;
use crate::serial_line::{DevicesOnLine, LineDisturbance};

/// A line of two wires with its modules.
#[derive(Clone, Debug)]
pub struct SimulatedLine {
    timing: LineTiming,
    gathering: RequestGathering,
    drives: Vec<ErobModbusDrive>,
    /// Bytes of the master on their way, with the time at which the last one arrives.
    from_master: VecDeque<(Nanoseconds, Vec<u8>)>,
    /// Bytes on their way to the master, with the time at which each arrives.
    to_master: VecDeque<(Nanoseconds, u8)>,
    disturbance: LineDisturbance,
    /// The addresses of the drives that are disconnected.
    disconnected: Vec<u8>,
    random: Random,
}

impl SimulatedLine {
    /// A line on which requests count that keep the silence of Modbus.
    pub fn new(timing: LineTiming, drives: Vec<ErobModbusDrive>) -> Self {
        Self::with(timing, RequestGathering::strict(timing), drives)
    }

    /// A line that bears pauses within a request, for a master behind a pseudo-terminal.
    pub fn lenient(timing: LineTiming, pause_ns: Nanoseconds, drives: Vec<ErobModbusDrive>) -> Self {
        Self::with(timing, RequestGathering::lenient(timing, pause_ns), drives)
    }

    fn with(timing: LineTiming, gathering: RequestGathering, drives: Vec<ErobModbusDrive>) -> Self {
        let (from_master, to_master) = (VecDeque::new(), VecDeque::new());
        let (disturbance, random) = (LineDisturbance::default(), Random::new(0, 0));
        Self { timing, gathering, drives, from_master, to_master, disturbance, disconnected: vec![], random }
    }

    fn advance(&mut self, now_ns: Nanoseconds) {
        while self.from_master.front().is_some_and(|(arrives_ns, _)| *arrives_ns <= now_ns) {
            let Some((arrives_ns, bytes)) = self.from_master.pop_front() else { return };
            self.reply_until(arrives_ns);
            if let Some(request) = self.gathering.receive(arrives_ns, &bytes) {
                let bit_rate = self.timing.bit_rate();
                let disconnected = &self.disconnected;
                let hearing = self
                    .drives
                    .iter_mut()
                    .filter(|drive| drive.bit_rate() == bit_rate && !disconnected.contains(&drive.node()));
                hearing.for_each(|drive| drive.receive(arrives_ns, &request));
            }
        }
        self.reply_until(now_ns);
    }

    /// Lets the drives send what is due by a time.
    fn reply_until(&mut self, now_ns: Nanoseconds) {
        for place in 0..self.drives.len() {
            let Some((begins_ns, reply)) = self.drives[place].reply_by(now_ns) else { continue };
            if self.disconnected.contains(&self.drives[place].node()) {
                continue;
            }
            let ends_ns = begins_ns.saturating_add(self.timing.duration_ns(reply.len()));
            self.gathering.hear(ends_ns);
            let bytes = self.disturbed(&reply);
            let timing = self.timing;
            let arrives_ns = begins_ns.saturating_add(self.disturbance.late_ns);
            let timed = bytes
                .into_iter()
                .enumerate()
                .map(|(at, byte)| (arrives_ns.saturating_add(timing.duration_ns(at + 1)), byte));
            self.to_master.extend(timed);
        }
    }

    /// What the wire makes of bytes.
    fn disturbed(&mut self, bytes: &[u8]) -> Vec<u8> {
        let LineDisturbance { wrong_per_million, lost_per_million, is_cut, .. } = self.disturbance;
        let mut happens = |per_million: u32| self.random.within(0..1_000_000) < per_million.into();
        let mut arrived = vec![];
        for byte in bytes.iter().filter(|_| !is_cut) {
            if happens(lost_per_million) {
                continue;
            }
            arrived.push(if happens(wrong_per_million) { byte ^ 0x10 } else { *byte });
        }
        arrived
    }
}

impl DevicesOnLine for SimulatedLine {
    fn send(&mut self, now_ns: Nanoseconds, bytes: &[u8]) {
        self.advance(now_ns);
        let bytes = self.disturbed(bytes);
        if !bytes.is_empty() {
            let arrives_ns = now_ns.saturating_add(self.timing.duration_ns(bytes.len()));
            self.from_master.push_back((arrives_ns, bytes));
        }
    }

    fn receive(&mut self, now_ns: Nanoseconds) -> Vec<u8> {
        self.advance(now_ns);
        let arrived = self.to_master.partition_point(|(arrives_ns, _)| *arrives_ns <= now_ns);
        self.to_master.drain(..arrived).map(|(_, byte)| byte).collect()
    }

    fn drive(&mut self, address: u8) -> Option<&mut dyn Drive> {
        let drive = self.drives.iter_mut().find(|drive| drive.node() == address)?;
        Some(drive)
    }

    fn disturb(&mut self, disturbance: LineDisturbance, seed: u64) -> bool {
        (self.disturbance, self.random) = (disturbance, Random::new(seed, 0));
        true
    }

    fn disconnect(&mut self, address: u8, is_disconnected: bool) -> bool {
        self.disconnected.retain(|other| *other != address);
        if is_disconnected {
            self.disconnected.push(address);
        }
        self.drives.iter().any(|drive| drive.node() == address)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commanded_module::ModuleParameters;
    use crate::erob_modbus::ErobModbusParameters;
    use crate::plant::{Encoder, JointParameters};
    use takt_wire::modbus::frame::{RegisterRange, Request, SlaveAddress};

    const LINE: LineTiming = LineTiming::new(115_200);
    const MS: Nanoseconds = 1_000_000;

    fn drive(address: u8, bit_rate_code: u16) -> ErobModbusDrive {
        let joint = JointParameters {
            inertia: 0.3,
            viscous_friction: 2.0,
            coulomb_friction: 4.0,
            friction_shape: crate::plant::FrictionShape::Constant,
            brake_torque: 60.0,
        };
        ErobModbusDrive::new(ErobModbusParameters {
            address,
            bit_rate_code,
            module: ModuleParameters {
                joint,
                encoder: Encoder { counts_per_unit: 83_443.0, zero_counts: 0.0 },
                counts_per_turn: 524_288.0,
                initial_position: 0.0,
                peak_torque: 60.0,
                torque_per_ampere: 5.0,
                highest_velocity: 3.0,
                ready_ns: 0,
                has_battery: true,
            },
            reply_ns: MS,
            has_torque_sensor: false,
        })
    }

    fn question(address: u8) -> Vec<u8> {
        let request = Request::Read(RegisterRange::new(0, 1).unwrap());
        request.frame(SlaveAddress::new(address).unwrap())
    }

    #[test]
    fn a_reply_comes_byte_by_byte_after_the_request_and_the_time_of_the_drive() {
        let mut line = SimulatedLine::new(LINE, vec![drive(1, 4), drive(2, 4)]);
        line.send(10 * MS, &question(2));
        let begins_ns = 10 * MS + LINE.duration_ns(8) + MS;
        assert!(line.receive(begins_ns).is_empty());
        assert_eq!(line.receive(begins_ns + LINE.duration_ns(3)), [2, 3, 2]);
        assert_eq!(line.receive(begins_ns + LINE.duration_ns(7)).len(), 4);
        assert!(line.receive(begins_ns + 100 * MS).is_empty());
    }

    #[test]
    fn a_drive_with_another_bit_rate_and_a_cut_wire_are_silent() {
        let mut line = SimulatedLine::new(LINE, vec![drive(1, 1)]);
        line.send(10 * MS, &question(1));
        assert!(line.receive(50 * MS).is_empty());
        let mut line = SimulatedLine::new(LINE, vec![drive(1, 4)]);
        line.disturb(LineDisturbance { is_cut: true, ..LineDisturbance::default() }, 0);
        line.send(10 * MS, &question(1));
        assert!(line.receive(50 * MS).is_empty());
        line.disturb(LineDisturbance::default(), 0);
        line.send(60 * MS, &question(1));
        assert_eq!(line.receive(100 * MS).len(), 7);
    }

    #[test]
    fn a_master_that_does_not_wait_for_the_silence_is_not_heard() {
        let mut line = SimulatedLine::new(LINE, vec![drive(1, 4)]);
        line.send(10 * MS, &question(1));
        assert_eq!(line.receive(12_400_000).len(), 7);
        line.send(12_500_000, &question(1));
        assert!(line.receive(50 * MS).is_empty());
        line.send(50 * MS, &question(1));
        assert_eq!(line.receive(60 * MS).len(), 7);
    }

    /// 1 to 127 registers (manual 1.5), of which those that it does not have are zero. 128 are too many.
    #[test]
    fn a_drive_reads_127_registers_at_once_in_a_reply_that_is_longer_than_the_standard_has() {
        let mut line = SimulatedLine::new(LINE, vec![drive(1, 4)]);
        line.send(10 * MS, &[1, 3, 0, 0, 0, 127, 0x04, 0x2A]);
        let reply = line.receive(100 * MS);
        assert_eq!((reply.len(), &reply[..5]), (259, &[1, 3, 254, 0, 1][..]));
        // Register 0x0040: position control.
        assert_eq!(reply[3 + 2 * 0x40..][..2], [0, 3]);
        line.send(200 * MS, &[1, 3, 0, 0, 0, 128, 0x44, 0x6A]);
        assert_eq!(line.receive(300 * MS)[..3], [1, 0x83, 3]);
    }
}
