//! Layer setting services on a bus: one task after the other, in the time of a clock. The devices have no node number
//! yet, so nothing here is about a drive of a family.

use std::collections::VecDeque;

use takt_rt::{BusPort, Clock, Frame, Nanoseconds, ReceiveBatch};

use super::bus_session::Seen;
use crate::canopen::lss::{LssAddress, LssError, LssMaster, LssMode, LssOutcome, LssTask, LssTiming};
use crate::canopen::nmt::{ErrorControl, NmtState};

/// Between two looks at the bus.
const TURN_NS: Nanoseconds = 500_000;
/// How long a device that has just been given a node number may take to boot.
const BOOT_UP_NS: Nanoseconds = 2_000_000_000;
/// The last frame may leave for so long.
const FAREWELL_NS: Nanoseconds = 10_000_000;

/// Why it did not come to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayerSettingFailure {
    /// A task has failed.
    #[error(transparent)]
    Task(#[from] LssError),
    /// No device without a node number is there.
    #[error("no device without a node number answers")]
    Nobody,
    /// It was asked to end.
    #[error("interrupted")]
    Interrupted,
}

/// Which device is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The one with this identity.
    Identity(LssAddress),
    /// The only one on the bus: every device obeys.
    Only,
    /// One without a node number, which is found bit by bit.
    Unconfigured,
}

/// A bus on which devices are given what they lack.
pub struct LayerSettings<'a, P, C> {
    port: &'a mut P,
    clock: &'a mut C,
    is_interrupted: &'a mut dyn FnMut() -> bool,
    see: &'a mut dyn FnMut(Nanoseconds, Seen),
    master: LssMaster,
    began_ns: Nanoseconds,
    outgoing: VecDeque<Frame>,
    booted: Option<u8>,
}

impl<'a, P: BusPort, C: Clock> LayerSettings<'a, P, C> {
    /// On this bus. `is_interrupted` is asked in every turn; `see` is shown every frame with the time since now.
    pub fn new(
        port: &'a mut P,
        clock: &'a mut C,
        is_interrupted: &'a mut dyn FnMut() -> bool,
        see: &'a mut dyn FnMut(Nanoseconds, Seen),
    ) -> Self {
        let began_ns = clock.now_ns();
        let master = LssMaster::new(LssTiming::default());
        Self { port, clock, is_interrupted, see, master, began_ns, outgoing: VecDeque::new(), booted: None }
    }

    /// Carries a task out.
    ///
    /// # Errors
    /// The task has failed, or was interrupted.
    pub fn perform(&mut self, task: LssTask) -> Result<LssOutcome, LayerSettingFailure> {
        // The outcome of the one before was taken, so that the master is free; one that was interrupted is forgotten.
        self.master = LssMaster::new(LssTiming::default());
        let _ = self.master.start(task);
        loop {
            self.turn();
            if let Some(outcome) = self.master.take_outcome() {
                return Ok(outcome?);
            }
            if (self.is_interrupted)() {
                return Err(LayerSettingFailure::Interrupted);
            }
        }
    }

    /// Puts the chosen device into configuration, all others out of it. Returns its identity where that is known.
    ///
    /// # Errors
    /// The device does not answer, or a task has failed.
    pub fn select(&mut self, choice: Choice) -> Result<Option<LssAddress>, LayerSettingFailure> {
        self.perform(LssTask::SwitchGlobal(LssMode::Waiting))?;
        match choice {
            Choice::Identity(address) => {
                self.perform(LssTask::SwitchSelective(address))?;
                Ok(Some(address))
            }
            Choice::Only => {
                self.perform(LssTask::SwitchGlobal(LssMode::Configuration))?;
                Ok(None)
            }
            Choice::Unconfigured => match self.scan()? {
                Some(address) => Ok(Some(address)),
                None => Err(LayerSettingFailure::Nobody),
            },
        }
    }

    /// Finds a device without a node number that is not yet in configuration, where it is then; `None` where there is
    /// none.
    ///
    /// # Errors
    /// Answers were lost, or it was interrupted.
    pub fn scan(&mut self) -> Result<Option<LssAddress>, LayerSettingFailure> {
        match self.perform(LssTask::FastScan([None; 4]))? {
            LssOutcome::Device(address) => Ok(Some(address)),
            _ => Ok(None),
        }
    }

    /// Ends configuration everywhere, and waits for the boot-up message of a device that has just got a node number.
    /// Returns that number.
    ///
    /// # Errors
    /// It was interrupted.
    pub fn release(&mut self, is_boot_up_awaited: bool) -> Result<Option<u8>, LayerSettingFailure> {
        self.booted = None;
        self.perform(LssTask::SwitchGlobal(LssMode::Waiting))?;
        let waiting_ns = if is_boot_up_awaited { BOOT_UP_NS } else { FAREWELL_NS };
        let until_ns = self.clock.now_ns().saturating_add(waiting_ns);
        while self.booted.is_none() && self.clock.now_ns() < until_ns {
            self.turn();
            if (self.is_interrupted)() {
                return Err(LayerSettingFailure::Interrupted);
            }
        }
        Ok(self.booted)
    }

    fn turn(&mut self) {
        let now_ns = self.clock.now_ns();
        let at_ns = now_ns.saturating_sub(self.began_ns);
        let mut batch = ReceiveBatch::new();
        self.port.receive(now_ns, &mut batch);
        for received in &batch {
            (self.see)(at_ns, Seen::Received(received.frame));
            self.master.receive(&received.frame);
            if let Some(ErrorControl { node, state: NmtState::BootUp }) =
                ErrorControl::decode(&received.frame)
            {
                self.booted = Some(node);
            }
        }
        while let Some(frame) = self.master.poll(now_ns) {
            (self.see)(at_ns, Seen::Sent(frame));
            self.outgoing.push_back(frame);
        }
        let taken = self.port.send(now_ns, self.outgoing.make_contiguous());
        self.outgoing.drain(..taken.min(self.outgoing.len()));
        self.clock.wait_until(now_ns.saturating_add(TURN_NS));
    }
}
