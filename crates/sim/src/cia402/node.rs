//! The communication of a simulated CANopen drive: its objects, its services, and when they are due. The drive says what its objects
//! mean, as [`CanopenDevice`], and has the services as [`NodeServices`](super::services::NodeServices).

use takt_rt::{Frame, FrameKind, Nanoseconds};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::quirks::Quirks;

use crate::drive::NodeState;
use crate::errors::Errors;
use crate::feedback_defects::{FeedbackDefects, ShownObjects};
use crate::loops::ControlLoops;
use crate::network::Network;
use crate::object_dictionary::SimulatedDictionary;
use crate::pdo_engine::{PdoEngine, PdoFeatures};
use crate::random::Random;
use crate::sdo_reply::AbortCode;
use crate::sdo_server::{SdoFeatures, SdoServer};

use super::places::is_measured;

/// Longest time between two advances.
const IDLE_NS: Nanoseconds = 1_000_000;
/// From an SDO request to its reply.
const SHORTEST_REPLY_NS: Nanoseconds = 300_000;
const LONGEST_REPLY_NS: Nanoseconds = 1_000_000;
/// From "save" until it takes effect.
const SAVE_NS: Nanoseconds = 100_000_000;
pub(super) const NEVER: Nanoseconds = Nanoseconds::MAX;
/// The identifiers of nothing but PDOs and SYNC: those of NMT, emergency messages, SDO and error control are others (CiA 301, 7.3.5).
const PDO_IDS: std::ops::RangeInclusive<u32> = 0x180..=0x57F;

/// How long a device takes for what.
#[derive(Clone, Copy, Debug)]
pub(super) struct NodeDelays {
    /// From power-up or "reset node" to the boot-up message.
    pub power_up_ns: Nanoseconds,
    /// From SYNC until the feedback is ready to send.
    pub feedback_ns: Nanoseconds,
    /// From "save" until it takes effect.
    pub save_ns: Nanoseconds,
    /// From NMT start until PDOs work.
    pub first_pdo_ns: Nanoseconds,
}

/// What the objects of a device mean.
pub trait CanopenDevice: ControlLoops + Sized {
    /// Its communication.
    fn canopen(&mut self) -> &mut CanopenNode;

    /// Writes the measured values to the dictionary.
    fn measure(&mut self);

    /// As [`measure`](Self::measure), for the TPDOs.
    fn measure_for_pdos(&mut self) {
        self.measure();
    }

    /// The objects that a defect can change in the feedback.
    fn shown(&self) -> ShownObjects;

    /// Returns `true` if it has a fault or an alarm.
    fn is_faulted(&self) -> bool;

    /// The node has booted.
    fn started(&mut self, now_ns: Nanoseconds);

    /// Restarts everything except the joints and the saved parameters.
    fn restart(&mut self, now_ns: Nanoseconds);

    /// The communication restarts.
    fn reset_communication(&mut self) {}

    /// The heartbeat or the node guarding of the master is missing.
    fn lose_master(&mut self);

    /// A heartbeat of the master has come.
    fn hear_master(&mut self) {}

    /// Checks that SDO can write an object of the dictionary now.
    fn check_write(&self, _place: usize) -> Result<(), AbortCode> {
        Ok(())
    }

    /// Checks what the range of an object does not say of a value.
    fn check_value(&self, _address: ObjectAddress, _value: i64) -> Result<(), AbortCode> {
        Ok(())
    }

    /// Applies the effects of a value that SDO has written.
    fn written(&mut self, address: ObjectAddress, now_ns: Nanoseconds);

    /// The data of an RPDO is in the dictionary, at its arrival or at SYNC.
    fn rpdo_applied(&mut self, now_ns: Nanoseconds, number: usize, is_by_sync: bool);

    /// SYNC has come, and every RPDO that waited for it is in the dictionary.
    fn synced(&mut self, _now_ns: Nanoseconds) {}
}

/// The communication of one device.
#[derive(Clone, Debug)]
pub struct CanopenNode {
    /// Node ID.
    pub id: u8,
    /// In what it deviates from its data sheet and from the standards.
    pub quirks: Quirks,
    /// Its objects.
    pub dictionary: SimulatedDictionary,
    /// NMT and error control.
    pub network: Network,
    /// Emergency messages and the error history.
    pub errors: Errors,
    /// The defects of its feedback.
    pub defects: FeedbackDefects,
    pub(super) sdo: SdoServer,
    /// Its PDOs.
    pub pdos: PdoEngine,
    pub(super) delays: NodeDelays,
    pub(super) has_pdo_error: bool,
    pub(super) save_ns: Nanoseconds,
    pub(super) pdos_ready_ns: Nanoseconds,
    /// True if the next boot sends no boot-up message.
    pub is_boot_silent: bool,
    /// When something is due, and when the node is to look for it.
    due_ns: Nanoseconds,
    wake_ns: Nanoseconds,
}

impl CanopenNode {
    /// A node whose supply is switched on at time 0. It boots in `power_up_ns`, unless the quirks say otherwise, and its feedback is
    /// ready to send `feedback_ns` after SYNC.
    pub fn new(
        id: u8,
        dictionary: SimulatedDictionary,
        quirks: Quirks,
        random: Random,
        power_up_ns: Nanoseconds,
        feedback_ns: Nanoseconds,
    ) -> Self {
        let delays = NodeDelays {
            power_up_ns: quirks.delays.boot_up_ns.unwrap_or(power_up_ns),
            feedback_ns,
            save_ns: quirks.delays.save_ns.unwrap_or(SAVE_NS),
            first_pdo_ns: quirks.delays.first_pdo_ns.unwrap_or(0),
        };
        let longest_ns = quirks.delays.sdo_reply_ns.unwrap_or(LONGEST_REPLY_NS);
        let latency_ns = SHORTEST_REPLY_NS.min(longest_ns)..longest_ns + 1;
        let features = match quirks.refuses_blocks {
            _ if quirks.simulated.has_expedited_only => SdoFeatures::Expedited,
            true => SdoFeatures::Segmented { is_upload_segmented: quirks.simulated.segments_uploads },
            false => SdoFeatures::Blocks,
        };
        let answers_rpdos = quirks.simulated.answers_rpdos;
        let watches_rpdos = !quirks.simulated.ignores_rpdo_timers;
        Self {
            id,
            network: Network::starting(&dictionary, delays.power_up_ns, quirks.power_up),
            errors: Errors::new(&dictionary),
            defects: FeedbackDefects::default(),
            sdo: SdoServer::new(random, latency_ns, features),
            pdos: PdoEngine::new(&dictionary, PdoFeatures { is_measured, watches_rpdos, answers_rpdos }),
            delays,
            dictionary,
            has_pdo_error: false,
            save_ns: NEVER,
            pdos_ready_ns: 0,
            is_boot_silent: quirks.simulated.is_power_up_silent,
            due_ns: 0,
            wake_ns: 0,
            quirks,
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
        self.is_boot_silent = false;
    }

    /// Begins to save the parameters.
    pub fn begin_save(&mut self, now_ns: Nanoseconds) {
        self.save_ns = now_ns + self.delays.save_ns;
    }

    /// Returns `true` while it saves the parameters.
    pub fn is_saving(&self) -> bool {
        self.save_ns != NEVER
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
