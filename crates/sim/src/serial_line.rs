//! A serial line with simulated devices: in the time of whoever asks it, or behind a pseudo-terminal in real time, for any tool to talk
//! to.

use takt_rt::Nanoseconds;

use super::defect::Defect;
use super::drive::{Drive, DriveFault, Observation};
use super::mailbox::{Mailbox, QueueOrder};
use super::port::{InjectDefectError, UnknownNode};

/// A serial line with its devices. Time never runs backwards between calls.
pub trait DevicesOnLine: Send {
    /// The master has begun to send bytes.
    fn send(&mut self, now_ns: Nanoseconds, bytes: &[u8]);

    /// Removes and returns the bytes that have arrived at the master by now.
    fn receive(&mut self, now_ns: Nanoseconds) -> Vec<u8>;

    /// The drive with this address; `None` if there is none, or the devices are no drives.
    fn drive(&mut self, _address: u8) -> Option<&mut dyn Drive> {
        None
    }

    /// Disturbs the wire from now on; returns whether this line can be disturbed. The same seed disturbs it in the same way.
    fn disturb(&mut self, _disturbance: LineDisturbance, _seed: u64) -> bool {
        false
    }

    /// Disconnects a drive from the line, or connects it again; returns whether there is one. It goes on meanwhile.
    fn disconnect(&mut self, _address: u8, _is_disconnected: bool) -> bool {
        false
    }
}

/// A line with its devices in the time of whoever asks it: it begins when that first does.
pub struct SimulatedLineDevices {
    line: Box<dyn DevicesOnLine>,
    began_ns: Option<Nanoseconds>,
    now_ns: Nanoseconds,
}

impl SimulatedLineDevices {
    /// Devices whose supply is switched on at the first call.
    pub fn new(line: Box<dyn DevicesOnLine>) -> Self {
        Self { line, began_ns: None, now_ns: 0 }
    }

    fn advance_to(&mut self, called_ns: Nanoseconds) -> Nanoseconds {
        let began_ns = *self.began_ns.get_or_insert(called_ns);
        self.now_ns = self.now_ns.max(called_ns.saturating_sub(began_ns));
        self.now_ns
    }

    /// The master has begun to send bytes.
    pub fn send(&mut self, called_ns: Nanoseconds, bytes: &[u8]) {
        let now_ns = self.advance_to(called_ns);
        self.line.send(now_ns, bytes);
    }

    /// Removes and returns the bytes that have arrived at the master by now.
    pub fn receive(&mut self, called_ns: Nanoseconds) -> Vec<u8> {
        let now_ns = self.advance_to(called_ns);
        self.line.receive(now_ns)
    }

    /// Disturbs the wire from now on; returns whether this line can be disturbed. The same seed disturbs it in the same way.
    pub fn disturb(&mut self, disturbance: LineDisturbance, seed: u64) -> bool {
        self.line.disturb(disturbance, seed)
    }

    fn drive(&mut self, node: u8) -> Result<&mut dyn Drive, UnknownNode> {
        self.line.drive(node).ok_or(UnknownNode { node })
    }

    /// The true state of a drive at the last call.
    pub fn observe(&mut self, node: u8) -> Result<Observation, UnknownNode> {
        let now_ns = self.now_ns;
        Ok(self.drive(node)?.observe(now_ns))
    }

    /// Injects a fault into a drive.
    pub fn inject_fault(&mut self, node: u8, fault: DriveFault) -> Result<(), UnknownNode> {
        self.drive(node)?.inject_fault(fault);
        Ok(())
    }

    /// Injects a defect into a drive, or removes it.
    ///
    /// # Errors
    /// See [`InjectDefectError`]; nothing has changed then.
    pub fn inject_defect(
        &mut self,
        node: u8,
        defect: Defect,
        is_present: bool,
    ) -> Result<(), InjectDefectError> {
        let now_ns = self.now_ns;
        Ok(self.drive(node)?.inject_defect(now_ns, defect, is_present)?)
    }

    /// Disconnects a drive from the line or connects it again. It keeps running meanwhile.
    pub fn silence(&mut self, node: u8, is_silent: bool) -> Result<(), UnknownNode> {
        if self.line.disconnect(node, is_silent) { Ok(()) } else { Err(UnknownNode { node }) }
    }

    /// Cuts the supply of a drive and restores it at once.
    pub fn power_cycle(&mut self, node: u8) -> Result<(), UnknownNode> {
        let now_ns = self.now_ns;
        // It sends no frames.
        let mut mailbox = Mailbox::new(QueueOrder::FirstInFirstOut, 0);
        self.drive(node)?.power_cycle(now_ns, &mut mailbox);
        Ok(())
    }

    /// Sets the external torque on a joint (N·m, N), which lasts until it is set again.
    pub fn set_load_torque(&mut self, node: u8, torque: f64) -> Result<(), UnknownNode> {
        self.drive(node)?.set_load_torque(torque);
        Ok(())
    }
}

/// What is wrong with the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineDisturbance {
    /// Of a million bytes, so many have a wrong bit.
    pub wrong_per_million: u32,
    /// Of a million bytes, so many do not arrive.
    pub lost_per_million: u32,
    /// Nothing arrives.
    pub is_cut: bool,
    /// What comes from the drives arrives later by this, as behind an adapter that holds bytes back.
    pub late_ns: Nanoseconds,
}
