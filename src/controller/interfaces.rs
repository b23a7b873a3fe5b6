//! The interfaces of a run: who may command them, and how a port finds the interface that takes the place of a removed one.

use takt_rt::linux::Attachment;
use tracing::{info, warn};

use super::port::Port;
use crate::config::Config;
use crate::link::Process;
use crate::link::ownership::{BusClaim, ClaimError, Ownership};

/// The time between two looks for removed interfaces.
const LOOK_NS: u64 = 100_000_000;

/// The interfaces of a run.
#[derive(Debug)]
pub(super) struct Interfaces {
    ownership: Ownership,
    attached: Vec<Attached>,
    next_look_ns: u64,
}

/// An interface that can be removed while its port is in use.
#[derive(Debug)]
struct Attached {
    claim: BusClaim,
    attachment: Attachment,
    /// Why the port could not be attached anew, as it was last logged.
    problem: Option<String>,
}

impl Interfaces {
    /// Returns those that this process owns.
    pub(super) const fn of(ownership: Ownership) -> Self {
        Self { ownership, attached: vec![], next_look_ns: 0 }
    }

    /// Keeps the port of bus number `bus` attached.
    pub(super) fn keep_attached(&mut self, config: &Config, bus: usize, port: &Port) {
        let Port::Link(link) = port else { return };
        if let (Some(claim), Some(attachment)) = (BusClaim::of(config, bus), link.attachment()) {
            self.attached.push(Attached { claim, attachment, problem: None });
        }
    }

    /// Attaches the ports of removed interfaces that are there again.
    pub(super) fn attach_removed(&mut self, now_ns: u64) {
        if now_ns < self.next_look_ns {
            return;
        }
        self.next_look_ns = now_ns + LOOK_NS;
        for attached in self.attached.iter_mut().filter(|attached| attached.attachment.is_removed()) {
            let (bus, interface) = (attached.claim.bus.as_str(), attached.claim.interface.to_string());
            match attached.attach(&mut self.ownership) {
                Ok(()) => {
                    attached.problem = None;
                    info!(target: "takt::bus", bus, interface, "{bus}: {interface} is there again");
                }
                Err(error) => {
                    let problem = error.to_string();
                    if attached.problem.as_ref() != Some(&problem) {
                        warn!(target: "takt::bus", bus, interface, "{problem}");
                        attached.problem = Some(problem);
                    }
                }
            }
        }
    }

    /// See [`Ownership::poll_release_request`].
    pub(super) fn poll_release_request(&mut self) -> Option<Process> {
        self.ownership.poll_release_request()
    }
}

impl Attached {
    fn attach(&self, ownership: &mut Ownership) -> Result<(), ClaimError> {
        ownership.claim_successor(&self.claim)?;
        self.claim.interface.attach(&self.claim.bus, &self.attachment)?;
        Ok(())
    }
}
