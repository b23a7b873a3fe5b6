//! Layer setting services (CiA 305) on a bus: runs one LSS task after the other, paced by a clock. The devices have no
//! node ID yet, so nothing here depends on a drive family.

use std::collections::VecDeque;

use takt_rt::{BusPort, Clock, Frame, Nanoseconds, ReceiveBatch};

use super::bus_session::SessionEvent;
use crate::canopen::lss::{LssAddress, LssError, LssMaster, LssMode, LssOutcome, LssTask, LssTiming};
use crate::canopen::nmt::{ErrorControl, NmtState};

/// Interval between two polls of the bus.
const POLL_NS: Nanoseconds = 500_000;
/// Longest boot time of a device that has just been given a node ID.
const BOOT_UP_NS: Nanoseconds = 2_000_000_000;
/// Longest time that the last frame may take to leave.
const DRAIN_NS: Nanoseconds = 10_000_000;

/// Why an LSS operation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayerSettingFailure {
    /// A task failed.
    #[error(transparent)]
    Task(#[from] LssError),
    /// No device without a node ID answers.
    #[error("no device without a node ID answers")]
    NoDevice,
    /// It was interrupted.
    #[error("interrupted")]
    Interrupted,
}

/// The device to select.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceSelection {
    /// The device with this identity.
    Identity(LssAddress),
    /// The only device on the bus: the switch is global.
    Only,
    /// A device without a node ID, found by LSS fastscan.
    Unconfigured,
}

/// An LSS session on a bus.
pub struct LayerSettings<'a, P, C> {
    port: &'a mut P,
    clock: &'a mut C,
    is_interrupted: &'a mut dyn FnMut() -> bool,
    see: &'a mut dyn FnMut(Nanoseconds, SessionEvent),
    master: LssMaster,
    began_ns: Nanoseconds,
    outgoing: VecDeque<Frame>,
    booted: Option<u8>,
}

impl<'a, P: BusPort, C: Clock> LayerSettings<'a, P, C> {
    /// Begins a session. `is_interrupted` is called at each poll; `see` gets every frame with the time since now.
    pub fn new(
        port: &'a mut P,
        clock: &'a mut C,
        is_interrupted: &'a mut dyn FnMut() -> bool,
        see: &'a mut dyn FnMut(Nanoseconds, SessionEvent),
    ) -> Self {
        let began_ns = clock.now_ns();
        let master = LssMaster::new(LssTiming::default());
        Self { port, clock, is_interrupted, see, master, began_ns, outgoing: VecDeque::new(), booted: None }
    }

    /// Runs one LSS task.
    ///
    /// # Errors
    /// The task failed or was interrupted.
    pub fn perform(&mut self, task: LssTask) -> Result<LssOutcome, LayerSettingFailure> {
        // An interrupted task leaves its master in mid-task, so each task gets a new one.
        self.master = LssMaster::new(LssTiming::default());
        let _ = self.master.start(task);
        loop {
            self.poll_bus();
            if let Some(outcome) = self.master.take_outcome() {
                return Ok(outcome?);
            }
            if (self.is_interrupted)() {
                return Err(LayerSettingFailure::Interrupted);
            }
        }
    }

    /// Switches the selected device to LSS configuration state and all others to waiting. Returns its identity, if
    /// known.
    ///
    /// # Errors
    /// The device does not answer, or a task failed.
    pub fn select(&mut self, selection: DeviceSelection) -> Result<Option<LssAddress>, LayerSettingFailure> {
        self.perform(LssTask::SwitchGlobal(LssMode::Waiting))?;
        match selection {
            DeviceSelection::Identity(address) => {
                self.perform(LssTask::SwitchSelective(address))?;
                Ok(Some(address))
            }
            DeviceSelection::Only => {
                self.perform(LssTask::SwitchGlobal(LssMode::Configuration))?;
                Ok(None)
            }
            DeviceSelection::Unconfigured => match self.scan()? {
                Some(address) => Ok(Some(address)),
                None => Err(LayerSettingFailure::NoDevice),
            },
        }
    }

    /// Finds one device without a node ID that is not yet in configuration state, and switches it there. `None`: there
    /// is no such device.
    ///
    /// # Errors
    /// Answers were lost, or the scan was interrupted.
    pub fn scan(&mut self) -> Result<Option<LssAddress>, LayerSettingFailure> {
        match self.perform(LssTask::FastScan([None; 4]))? {
            LssOutcome::Device(address) => Ok(Some(address)),
            _ => Ok(None),
        }
    }

    /// Switches all devices to LSS waiting state. With `is_boot_up_awaited`, waits for the boot-up message of a device
    /// that has just got a node ID, and returns that node ID.
    ///
    /// # Errors
    /// It was interrupted.
    pub fn release(&mut self, is_boot_up_awaited: bool) -> Result<Option<u8>, LayerSettingFailure> {
        self.booted = None;
        self.perform(LssTask::SwitchGlobal(LssMode::Waiting))?;
        let waiting_ns = if is_boot_up_awaited { BOOT_UP_NS } else { DRAIN_NS };
        let until_ns = self.clock.now_ns().saturating_add(waiting_ns);
        while self.booted.is_none() && self.clock.now_ns() < until_ns {
            self.poll_bus();
            if (self.is_interrupted)() {
                return Err(LayerSettingFailure::Interrupted);
            }
        }
        Ok(self.booted)
    }

    fn poll_bus(&mut self) {
        let now_ns = self.clock.now_ns();
        let at_ns = now_ns.saturating_sub(self.began_ns);
        let mut batch = ReceiveBatch::new();
        self.port.receive(now_ns, &mut batch);
        for received in &batch {
            (self.see)(at_ns, SessionEvent::Received(received.frame));
            self.master.receive(&received.frame);
            if let Some(ErrorControl { node, state: NmtState::BootUp }) =
                ErrorControl::decode(&received.frame)
            {
                self.booted = Some(node);
            }
        }
        while let Some(frame) = self.master.poll(now_ns) {
            (self.see)(at_ns, SessionEvent::Sent(frame));
            self.outgoing.push_back(frame);
        }
        let taken = self.port.send(now_ns, self.outgoing.make_contiguous());
        self.outgoing.drain(..taken.min(self.outgoing.len()));
        self.clock.wait_until(now_ns.saturating_add(POLL_NS));
    }
}
