//! Layer setting services (CiA 305) on a bus: runs one LSS task after the other, paced by a clock. The devices have no
//! node ID yet, so nothing here depends on a drive family.

use std::collections::VecDeque;

use takt_rt::{BusPort, Clock, Frame, Nanoseconds, ReceiveBatch};
use takt_wire::canopen::lss::{
    Inquiry, LssAddress, LssError, LssMaster, LssMode, LssOutcome, LssResponse, LssTask, LssTiming,
};
use takt_wire::canopen::nmt::{ErrorControl, NmtState};

use super::bus_session::SessionEvent;

/// Interval between two polls of the bus.
const POLL_NS: Nanoseconds = 500_000;
/// Longest boot time of a device that has just been given a node ID.
const BOOT_UP_NS: Nanoseconds = 2_000_000_000;
/// Longest time that the last frame may take to leave.
const DRAIN_NS: Nanoseconds = 10_000_000;
/// Time within which every device replies to the same request.
const FURTHER_REPLIES_NS: Nanoseconds = 100_000_000;

/// A bus cannot have more devices than there are node IDs.
const MOST_DEVICES: usize = 127;

/// The node ID of a device that is not configured (CiA 305).
pub const NO_NODE: u8 = 255;

/// Why an LSS operation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayerSettingFailure {
    /// A task failed.
    #[error(transparent)]
    Task(#[from] LssError),
    /// No device without a node ID answers.
    #[error("no device without a node ID answers")]
    NoDevice,
    /// A fastscan found an identity that no device can have.
    #[error(transparent)]
    Implausible(#[from] ImplausibleIdentity),
    /// More than one device replied to a request that was meant for the only device on the bus.
    #[error(
        "{replies} devices answered, though --only means one: {}",
        if *is_undone { "the node ID was taken back" } else { "nothing was changed" }
    )]
    SeveralDevices {
        /// The number of replies.
        replies: usize,
        /// True if a node ID had been configured and was taken back.
        is_undone: bool,
    },
    /// It was interrupted.
    #[error("interrupted")]
    Interrupted,
}

/// An identity that a fastscan found and that no device can have: devices replied to what they should have ignored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImplausibleIdentity {
    /// All four values are 0.
    #[error("a device answers every request of the scan, so that an identity of zeros was found")]
    Zero,
    /// The device in configuration state was found before.
    #[error("the scan found a device again")]
    Repeated,
    /// The device in configuration state reports another identity.
    #[error("the scan found an identity that its device does not confirm")]
    Unconfirmed,
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
    timing: LssTiming,
    master: LssMaster,
    /// The number of LSS replies since the last task began.
    replies: usize,
    began_ns: Nanoseconds,
    outgoing: VecDeque<Frame>,
    /// The nodes that have sent a boot-up message since the devices were released.
    booted: Vec<u8>,
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
        let timing = LssTiming::default();
        let master = LssMaster::new(timing);
        let outgoing = VecDeque::new();
        Self {
            port,
            clock,
            is_interrupted,
            see,
            timing,
            master,
            replies: 0,
            began_ns,
            outgoing,
            booted: vec![],
        }
    }

    /// Waits this long for the reply to each request of a fastscan.
    pub fn with_scan_timeout(mut self, scan_timeout_ns: Nanoseconds) -> Self {
        self.timing.scan_timeout_ns = scan_timeout_ns;
        self
    }

    /// Runs one LSS task.
    ///
    /// # Errors
    /// The task failed or was interrupted.
    pub fn perform(&mut self, task: LssTask) -> Result<LssOutcome, LayerSettingFailure> {
        // An interrupted task leaves its master in mid-task, so each task gets a new one.
        self.master = LssMaster::new(self.timing);
        self.replies = 0;
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

    /// Runs one LSS task with a single reply, and waits for the replies of further devices. Returns their number too.
    fn perform_counting(&mut self, task: LssTask) -> Result<(LssOutcome, usize), LayerSettingFailure> {
        let outcome = self.perform(task)?;
        self.poll_for(FURTHER_REPLIES_NS, |_| false)?;
        Ok((outcome, self.replies))
    }

    /// Makes sure that only one device is in configuration state: it reads the identity, and counts the replies. A device
    /// without this service is taken for one device.
    fn confirm_only(&mut self) -> Result<(), LayerSettingFailure> {
        let mut has_reply = false;
        for inquiry in [Inquiry::Vendor, Inquiry::Product, Inquiry::Revision, Inquiry::Serial] {
            match self.perform_counting(LssTask::Inquire(inquiry)) {
                Ok((_, 1)) => has_reply = true,
                Ok((_, replies)) => {
                    return Err(LayerSettingFailure::SeveralDevices { replies, is_undone: false });
                }
                // Replies that differ destroy each other on the wire.
                Err(LayerSettingFailure::Task(LssError::NoReply { .. })) if !has_reply => return Ok(()),
                Err(failure) => return Err(failure),
            }
        }
        Ok(())
    }

    /// Configures the node ID of the device in configuration state, which has the node ID `before` now. When more than
    /// one device replies, their node IDs are taken back.
    ///
    /// # Errors
    /// More than one device replied, or the task failed.
    pub fn configure_node(&mut self, node: u8, before: Option<u8>) -> Result<(), LayerSettingFailure> {
        let (_, replies) = self.perform_counting(LssTask::ConfigureNode(node))?;
        if replies > 1 {
            self.perform(LssTask::ConfigureNode(before.unwrap_or(NO_NODE)))?;
            return Err(LayerSettingFailure::SeveralDevices { replies, is_undone: true });
        }
        Ok(())
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
                self.confirm_only()?;
                Ok(None)
            }
            DeviceSelection::Unconfigured => match self.scan(None)? {
                Some(address) => Ok(Some(address)),
                None => Err(LayerSettingFailure::NoDevice),
            },
        }
    }

    /// Switches all devices to waiting state, finds the device without a node ID that has the lowest identity above
    /// `after`, and switches it to configuration state. `None`: there is no such device.
    ///
    /// # Errors
    /// The identity is implausible, replies were lost, or the scan was interrupted.
    pub fn scan(&mut self, after: Option<LssAddress>) -> Result<Option<LssAddress>, LayerSettingFailure> {
        self.perform(LssTask::SwitchGlobal(LssMode::Waiting))?;
        let task = after.map_or(LssTask::FastScan([None; 4]), LssTask::FastScanAfter);
        let LssOutcome::Device(found) = self.perform(task)? else { return Ok(None) };
        if found == LssAddress::default() {
            return Err(ImplausibleIdentity::Zero.into());
        }
        match self.perform(LssTask::InquireAddress) {
            Ok(LssOutcome::Device(address)) if Some(address) == after => {
                Err(ImplausibleIdentity::Repeated.into())
            }
            Ok(LssOutcome::Device(address)) if address != found => {
                Err(ImplausibleIdentity::Unconfirmed.into())
            }
            // A device may lack this service.
            Ok(_) | Err(LayerSettingFailure::Task(LssError::NoReply { .. })) => Ok(Some(found)),
            Err(failure) => Err(failure),
        }
    }

    /// Finds every device without a node ID, one after the other. Returns what was implausible, which ends the search.
    ///
    /// # Errors
    /// Replies were lost, or the scan was interrupted. `found` has those that were found before.
    pub fn scan_all(
        &mut self,
        found: &mut Vec<LssAddress>,
    ) -> Result<Option<ImplausibleIdentity>, LayerSettingFailure> {
        while found.len() < MOST_DEVICES {
            match self.scan(found.last().copied()) {
                Ok(Some(address)) => found.push(address),
                Ok(None) => break,
                Err(LayerSettingFailure::Implausible(identity)) => return Ok(Some(identity)),
                Err(failure) => return Err(failure),
            }
        }
        Ok(None)
    }

    /// Switches all devices to LSS waiting state. With `awaited`, waits for the boot-up message of the device that has
    /// just got this node ID, and returns whether it has come.
    ///
    /// # Errors
    /// It was interrupted.
    pub fn release(&mut self, awaited: Option<u8>) -> Result<bool, LayerSettingFailure> {
        self.booted.clear();
        self.perform(LssTask::SwitchGlobal(LssMode::Waiting))?;
        let Some(node) = awaited else {
            self.poll_for(DRAIN_NS, |_| false)?;
            return Ok(false);
        };
        self.poll_for(BOOT_UP_NS, |settings| settings.booted.contains(&node))?;
        Ok(self.booted.contains(&node))
    }

    /// Polls the bus for this time, or until `is_done`.
    fn poll_for(
        &mut self,
        duration_ns: Nanoseconds,
        is_done: impl Fn(&Self) -> bool,
    ) -> Result<(), LayerSettingFailure> {
        let until_ns = self.clock.now_ns().saturating_add(duration_ns);
        while !is_done(self) && self.clock.now_ns() < until_ns {
            self.poll_bus();
            if (self.is_interrupted)() {
                return Err(LayerSettingFailure::Interrupted);
            }
        }
        Ok(())
    }

    fn poll_bus(&mut self) {
        let now_ns = self.clock.now_ns();
        let at_ns = now_ns.saturating_sub(self.began_ns);
        let mut batch = ReceiveBatch::new();
        self.port.receive(now_ns, &mut batch);
        for received in &batch {
            (self.see)(at_ns, SessionEvent::Received(received.frame));
            self.master.receive(&received.frame);
            self.replies += usize::from(LssResponse::decode(&received.frame).is_some());
            if let Some(ErrorControl { node, state: NmtState::BootUp }) =
                ErrorControl::decode(&received.frame)
            {
                self.booted.push(node);
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
