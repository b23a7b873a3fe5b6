//! The communication of a simulated CiA 402 drive: its objects, its services, and when they are due.

use takt_rt::{Frame, FrameKind, Nanoseconds};
use takt_wire::quirks::PowerUpState;

use crate::drive::NodeState;
use crate::errors::Errors;
use crate::feedback_defects::FeedbackDefects;
use crate::network::Network;
use crate::object_dictionary::SimulatedDictionary;
use crate::pdo_engine::{PdoEngine, PdoFeatures};
use crate::sdo_server::SdoServer;

/// Longest time between two advances.
const IDLE_NS: Nanoseconds = 1_000_000;
pub(super) const NEVER: Nanoseconds = Nanoseconds::MAX;
/// The identifiers of nothing but PDOs and SYNC: those of NMT, emergency messages, SDO and error control are others (CiA 301, 7.3.5).
const PDO_IDS: std::ops::RangeInclusive<u32> = 0x180..=0x57F;

/// How long a device takes for what.
#[derive(Clone, Copy, Debug)]
pub struct NodeDelays {
    /// From power-up or "reset node" to the boot-up message.
    pub power_up_ns: Nanoseconds,
    /// From SYNC until the feedback is ready to send.
    pub feedback_ns: Nanoseconds,
    /// From "save" until it takes effect.
    pub save_ns: Nanoseconds,
    /// From NMT start until PDOs work.
    pub first_pdo_ns: Nanoseconds,
}

/// The communication of one device.
#[derive(Clone, Debug)]
pub struct CanopenNode {
    /// Node ID.
    pub id: u8,
    /// Its objects.
    pub dictionary: SimulatedDictionary,
    /// NMT and error control.
    pub network: Network,
    /// Emergency messages and the error history.
    pub errors: Errors,
    /// The defects of its feedback.
    pub defects: FeedbackDefects,
    pub(super) sdo: SdoServer,
    pub(super) pdos: PdoEngine,
    pub(super) delays: NodeDelays,
    pub(super) has_pdo_error: bool,
    pub(super) save_ns: Nanoseconds,
    pub(super) pdos_ready_ns: Nanoseconds,
    /// When something is due, and when the node is to look for it.
    due_ns: Nanoseconds,
    wake_ns: Nanoseconds,
}

impl CanopenNode {
    /// A node whose supply is switched on at time 0.
    pub fn new(
        id: u8,
        dictionary: SimulatedDictionary,
        power_up: PowerUpState,
        sdo: SdoServer,
        pdo_features: PdoFeatures,
        delays: NodeDelays,
    ) -> Self {
        Self {
            id,
            network: Network::starting(&dictionary, delays.power_up_ns, power_up),
            errors: Errors::new(&dictionary),
            defects: FeedbackDefects::default(),
            sdo,
            pdos: PdoEngine::new(&dictionary, pdo_features),
            delays,
            dictionary,
            has_pdo_error: false,
            save_ns: NEVER,
            pdos_ready_ns: 0,
            due_ns: 0,
            wake_ns: 0,
        }
    }

    /// Restarts with the saved parameters.
    pub fn restart(&mut self, now_ns: Nanoseconds) {
        self.dictionary.restore(0..=u16::MAX);
        self.network.restart(now_ns + self.delays.power_up_ns);
        self.sdo.reset();
        self.errors.reset();
        self.pdos.compile(&self.dictionary);
        self.has_pdo_error = false;
        self.save_ns = NEVER;
    }

    /// Finds out anew when it acts next, after everything that it does at `now_ns`.
    pub fn schedule(&mut self, now_ns: Nanoseconds) {
        let has_message = self.errors.is_pending() && self.network.has_services();
        let due_ns = [
            self.network.due_ns(),
            self.sdo.due_ns().unwrap_or(NEVER),
            self.pdos.due_ns(),
            self.save_ns,
            if has_message { now_ns } else { NEVER },
        ];
        self.due_ns = due_ns.into_iter().min().unwrap_or(NEVER);
        self.await_next(now_ns);
    }

    /// The next look at what is due is after `now_ns`.
    fn await_next(&mut self, now_ns: Nanoseconds) {
        self.wake_ns = self.due_ns.min(now_ns + IDLE_NS).max(now_ns + 1);
    }

    /// The time of the next action.
    pub fn wake_ns(&self) -> Nanoseconds {
        self.wake_ns
    }

    /// It is to act right after `now_ns`.
    pub fn wake_after(&mut self, now_ns: Nanoseconds) {
        (self.due_ns, self.wake_ns) = (now_ns, now_ns + 1);
    }

    /// Returns `true` if a frame is a PDO of other nodes, as most frames on a bus are. Then nothing has to be done about it, and this is
    /// all that it costs.
    pub fn passes_by(&mut self, now_ns: Nanoseconds, frame: &Frame) -> bool {
        let id = frame.id();
        let passes_by = PDO_IDS.contains(&id.value())
            && !id.is_extended()
            && frame.kind() == FrameKind::Data
            && !self.pdos.takes(id)
            && id.value() != self.network.sync_id(&self.dictionary);
        if passes_by {
            self.await_next(now_ns);
        }
        passes_by
    }

    /// Stops the services that the NMT state does not allow.
    pub(super) fn stop_services(&mut self) {
        if self.network.state() != NodeState::Operational {
            self.pdos.stop();
        }
        if !self.network.has_services() {
            self.sdo.reset();
        }
    }

    pub(super) fn has_pdos(&self, now_ns: Nanoseconds) -> bool {
        self.network.state() == NodeState::Operational && now_ns >= self.pdos_ready_ns
    }
}
