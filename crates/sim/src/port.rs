//! A simulated bus behind [`BusPort`]: the drives, the wire between them, and the queues of the interface.
//!
//! The simulation has its own time, which starts at the first call and advances to the time of every call, virtual or
//! wall-clock. It runs in the caller's thread and allocates no memory after construction.

use std::collections::VecDeque;

use takt_rt::{BusHealth, BusPort, BusState, Frame, Nanoseconds, ReceiveBatch, Received};

use super::defect::{Defect, Unsupported};
use super::drive::{Drive, DriveFault, Observation};
use super::medium::{FrameOnWire, Medium, WireBitRates};

/// Capacity of the interface's transmit queue.
const TRANSMIT_QUEUE: usize = 256;
/// Capacity of the interface's receive queue.
const RECEIVE_QUEUE: usize = 1024;
/// Capacity of a drive's mailbox.
pub(super) const DRIVE_MAILBOX: usize = 16;
/// The master's station. The drives follow, and after them a foreign station.
const MASTER: usize = 0;

/// A bus with simulated drives.
///
/// The master's frames wait in a FIFO queue like the kernel's: a frame behind a set-point is sent after it, whatever
/// its priority. Every drive offers its highest-priority frame first.
pub struct SimulatedBus {
    medium: Medium,
    drives: Vec<Box<dyn Drive>>,
    /// When each drive acts next.
    wakes_ns: Vec<Nanoseconds>,
    received: VecDeque<Received>,
    health: BusHealth,
    longest_gap_ns: Nanoseconds,
    /// The time of the last call.
    called_ns: Option<Nanoseconds>,
    /// The difference between the caller's time and the simulation's: its start and all pauses.
    offset_ns: Nanoseconds,
    paused_ns: Nanoseconds,
    now_ns: Nanoseconds,
}

/// The bus has no drive with this node ID.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no simulated drive with node ID {node} on this bus")]
pub struct UnknownNode {
    /// The requested node ID.
    pub node: u8,
}

/// Why a defect could not be injected.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InjectDefectError {
    /// The drive does not exist.
    #[error(transparent)]
    UnknownNode(#[from] UnknownNode),
    /// The drive cannot have the defect.
    #[error(transparent)]
    Unsupported(#[from] Unsupported),
}

impl SimulatedBus {
    /// A bus with these drives, whose supply is switched on at the first call. When two calls are more than
    /// `longest_gap_ns` apart, the simulation pauses for the rest of the gap.
    pub fn with_drives(
        rates: WireBitRates,
        longest_gap_ns: Nanoseconds,
        drives: Vec<Box<dyn Drive>>,
    ) -> Self {
        Self {
            medium: Medium::with_master(rates, TRANSMIT_QUEUE, drives.len() + 1, DRIVE_MAILBOX),
            wakes_ns: drives.iter().map(|drive| drive.wake_ns()).collect(),
            drives,
            received: VecDeque::with_capacity(RECEIVE_QUEUE),
            health: BusHealth { state: BusState::ErrorActive, ..BusHealth::default() },
            longest_gap_ns,
            called_ns: None,
            offset_ns: 0,
            paused_ns: 0,
            now_ns: 0,
        }
    }

    /// The node IDs of the drives on this bus.
    pub fn nodes(&self) -> impl Iterator<Item = u8> + '_ {
        self.drives.iter().map(|drive| drive.node())
    }

    /// The true state of a drive at the last call.
    pub fn observe(&mut self, node: u8) -> Result<Observation, UnknownNode> {
        let station = self.station(node)?;
        Ok(self.drives[station - 1].observe(self.now_ns))
    }

    /// Injects a fault into a drive.
    pub fn inject_fault(&mut self, node: u8, fault: DriveFault) -> Result<(), UnknownNode> {
        let station = self.station(node)?;
        self.drives[station - 1].inject_fault(fault);
        self.schedule(station);
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
        let station = self.station(node)?;
        let injected = self.drives[station - 1].inject_defect(self.now_ns, defect, is_present);
        self.schedule(station);
        Ok(injected?)
    }

    /// Lets a foreign station send a frame: it takes part in the arbitration, and every station receives it. Returns
    /// whether that station had room for it.
    pub fn send_foreign(&mut self, now_ns: Nanoseconds, frame: &Frame) -> bool {
        self.advance_to(now_ns);
        self.medium.mailbox_mut(self.drives.len() + 1).push(*frame)
    }

    /// Disconnects a drive from the bus or connects it again. It keeps running meanwhile.
    pub fn silence(&mut self, node: u8, is_silent: bool) -> Result<(), UnknownNode> {
        let station = self.station(node)?;
        self.medium.disconnect(station, is_silent);
        Ok(())
    }

    /// The controller of the master's interface goes off the bus, or is on it again: meanwhile nothing is sent or received.
    pub fn take_off_bus(&mut self, is_off: bool) {
        self.medium.disconnect(MASTER, is_off);
        self.health.state = if is_off { BusState::BusOff } else { BusState::ErrorActive };
    }

    /// Cuts a drive's supply and restores it at once.
    pub fn power_cycle(&mut self, node: u8) -> Result<(), UnknownNode> {
        let station = self.station(node)?;
        self.drives[station - 1].power_cycle(self.now_ns, self.medium.mailbox_mut(station));
        self.schedule(station);
        Ok(())
    }

    /// Sets the external torque on a joint (N·m, N), which lasts until it is set again.
    pub fn set_load_torque(&mut self, node: u8, torque: f64) -> Result<(), UnknownNode> {
        let station = self.station(node)?;
        self.drives[station - 1].set_load_torque(torque);
        self.schedule(station);
        Ok(())
    }

    /// How long the simulation has paused in total, because the caller was late.
    pub fn paused_ns(&self) -> Nanoseconds {
        self.paused_ns
    }

    /// The station of a drive, one more than its index.
    fn station(&self, node: u8) -> Result<usize, UnknownNode> {
        let at = self.drives.iter().position(|drive| drive.node() == node);
        at.map(|at| at + 1).ok_or(UnknownNode { node })
    }

    /// Notes when a drive acts next, after something has happened to it.
    fn schedule(&mut self, station: usize) {
        self.wakes_ns[station - 1] = self.drives[station - 1].wake_ns();
    }

    /// Advances the simulation to the caller's time.
    fn advance_to(&mut self, called_ns: Nanoseconds) {
        let before_ns = *self.called_ns.get_or_insert_with(|| {
            self.offset_ns = called_ns;
            called_ns
        });
        let beyond_ns = called_ns.saturating_sub(before_ns).saturating_sub(self.longest_gap_ns);
        self.offset_ns += beyond_ns;
        self.paused_ns += beyond_ns;
        self.called_ns = Some(called_ns.max(before_ns));
        let until_ns = called_ns.saturating_sub(self.offset_ns);
        while let Some(now_ns) = self.next_ns().filter(|next_ns| *next_ns <= until_ns) {
            self.now_ns = now_ns;
            self.step(now_ns);
        }
        self.now_ns = self.now_ns.max(until_ns);
    }

    /// The time of the next event in the simulation.
    fn next_ns(&self) -> Option<Nanoseconds> {
        let drives = self.wakes_ns.iter().copied().reduce(Nanoseconds::min);
        let drives = drives.map(|wake_ns| wake_ns.max(self.now_ns));
        match self.medium.next_ns(self.now_ns) {
            Some(wire) => Some(drives.map_or(wire, |drives| drives.min(wire))),
            None => drives,
        }
    }

    /// Handles all events of one instant. The drives come first, so that their new frames take part in the arbitration.
    fn step(&mut self, now_ns: Nanoseconds) {
        for ((drive, wake_ns), station) in self.drives.iter_mut().zip(&mut self.wakes_ns).zip(1..) {
            if *wake_ns <= now_ns {
                drive.advance(now_ns, self.medium.mailbox_mut(station));
                *wake_ns = drive.wake_ns();
            }
        }
        if let Some(transmission) = self.medium.step(now_ns) {
            self.deliver(now_ns, &transmission);
        }
    }

    fn deliver(&mut self, now_ns: Nanoseconds, transmission: &FrameOnWire) {
        let FrameOnWire { frame, sender, .. } = transmission;
        for ((drive, wake_ns), station) in self.drives.iter_mut().zip(&mut self.wakes_ns).zip(1..) {
            if station != *sender && self.medium.is_connected(station) {
                drive.receive(now_ns, frame, self.medium.mailbox_mut(station));
                *wake_ns = drive.wake_ns();
            }
        }
        if *sender == MASTER {
            self.health.tx_frames += 1;
            return;
        }
        if !self.medium.is_connected(MASTER) {
            return;
        }
        self.health.rx_frames += 1;
        if self.received.len() < RECEIVE_QUEUE {
            self.received.push_back(Received { frame: *frame, at_ns: now_ns + self.offset_ns });
        } else {
            self.health.rx_overruns += 1;
        }
    }
}

impl BusPort for SimulatedBus {
    fn send(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        self.advance_to(now_ns);
        let mailbox = self.medium.mailbox_mut(MASTER);
        let taken = frames.iter().take_while(|frame| mailbox.push(**frame)).count();
        self.health.tx_overruns += (frames.len() - taken) as u64;
        taken
    }

    fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        self.advance_to(now_ns);
        while !batch.is_full()
            && let Some(received) = self.received.pop_front()
        {
            batch.push(received);
        }
    }

    fn unconfirmed(&mut self, now_ns: Nanoseconds) -> usize {
        self.advance_to(now_ns);
        let is_on_wire = self.medium.on_wire().is_some_and(|transmission| transmission.sender == MASTER);
        self.medium.mailbox(MASTER).len() + usize::from(is_on_wire)
    }

    fn health(&mut self) -> BusHealth {
        BusHealth { busy_ns: self.medium.busy_ns(), ..self.health }
    }
}
