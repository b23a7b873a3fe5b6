//! The CANopen services of a simulated CiA 402 drive: what its node does with each frame and with time. The drive says what
//! its objects mean, as [`CanopenDevice`].

mod access;

use takt_rt::{Frame, FrameKind, Id, Nanoseconds};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::quirks::PowerUpState;

use super::drive::NodeState;
use super::errors::{DeviceError, Errors};
use super::feedback_defects::{FeedbackDefects, ShownObjects};
use super::loops::ControlLoops;
use super::mailbox::Mailbox;
use super::network::{Network, NmtReset};
use super::object_dictionary::SimulatedDictionary;
use super::pdo_engine::{PdoEngine, PdoFeatures, RpdoReception};
use super::sdo_reply::AbortCode;
use super::sdo_server::SdoServer;
use access::Objects;

/// Longest time between two advances.
const IDLE_NS: Nanoseconds = 1_000_000;
const NEVER: Nanoseconds = Nanoseconds::MAX;
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
    sdo: SdoServer,
    pdos: PdoEngine,
    delays: NodeDelays,
    has_pdo_error: bool,
    save_ns: Nanoseconds,
    pdos_ready_ns: Nanoseconds,
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
    fn stop_services(&mut self) {
        if self.network.state() != NodeState::Operational {
            self.pdos.stop();
        }
        if !self.network.has_services() {
            self.sdo.reset();
        }
    }

    fn has_pdos(&self, now_ns: Nanoseconds) -> bool {
        self.network.state() == NodeState::Operational && now_ns >= self.pdos_ready_ns
    }
}

/// Whether a device takes a number in its range from an RPDO, by the place of the object.
pub type TakesField = fn(usize, i64) -> bool;

/// What brought new values to the dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueSource {
    /// SYNC has applied the synchronous RPDOs.
    Sync,
    /// An RPDO that acts at once.
    Rpdo,
}

/// A device behind a [`CanopenNode`].
pub trait CanopenDevice: ControlLoops + Sized {
    /// Whether SYNC must have the length that object 1019 says.
    const CHECKS_SYNC_LENGTH: bool;

    /// Its node.
    fn canopen(&mut self) -> &mut CanopenNode;

    /// RPDOs are about to be written: what the device takes from them.
    fn begin_rpdo(&mut self) -> TakesField;

    /// Acts on the modes, controlwords and set-points in the dictionary.
    fn take_values(&mut self, now_ns: Nanoseconds, source: ValueSource);

    /// Returns `true` if it is in a fault.
    fn is_faulted(&self) -> bool;

    /// Writes the measured values to the dictionary.
    fn measure(&mut self);

    /// The objects that a defect can change in the feedback.
    fn shown(&self) -> ShownObjects;

    /// The node has booted.
    fn started(&mut self, now_ns: Nanoseconds);

    /// Restarts everything except the joints and the saved parameters.
    fn restart(&mut self, now_ns: Nanoseconds);

    /// The master is lost.
    fn lose_master(&mut self);

    /// Checks that SDO can write an object of the dictionary now.
    ///
    /// # Errors
    /// The abort code.
    fn check_write(&self, place: usize) -> Result<(), AbortCode>;

    /// Checks what the range of an object does not say of a value.
    ///
    /// # Errors
    /// The abort code.
    fn check_value(&self, address: ObjectAddress, place: usize, value: i64) -> Result<(), AbortCode>;

    /// Applies the effects of a value that SDO has written.
    fn written(&mut self, address: ObjectAddress, now_ns: Nanoseconds);

    /// Receives a frame.
    fn receive_frame(&mut self, now_ns: Nanoseconds, frame: &Frame, mailbox: &mut Mailbox) {
        if frame.id().is_extended() || frame.is_fd() {
            return;
        }
        if frame.kind() == FrameKind::Remote {
            return self.take_remote(now_ns, frame, mailbox);
        }
        let node = self.canopen();
        let id = frame.id().value();
        match id {
            0x000 => self.take_nmt(now_ns, frame.payload()),
            0x701..=0x77F => {
                node.network.receive_heartbeat(now_ns, (id & 0x7F) as u8, &node.dictionary);
            }
            _ if id == 0x600 + u32::from(node.id) => {
                if node.network.has_services()
                    && !node.defects.is_sdo_silent
                    && let Ok(request) = frame.payload().try_into()
                {
                    self.take_request(now_ns, request);
                }
            }
            _ if !node.has_pdos(now_ns) => {}
            _ if id == node.network.sync_id(&node.dictionary) => {
                let is_right = frame.payload().len() == node.network.sync_length(&node.dictionary);
                if is_right || !Self::CHECKS_SYNC_LENGTH {
                    self.take_sync(now_ns, frame.payload().first().copied());
                } else {
                    node.errors.raise(DeviceError::SyncLength, &mut node.dictionary);
                }
            }
            _ => self.take_pdo(now_ns, frame),
        }
    }

    /// Answers a remote request: node guarding, or a TPDO.
    fn take_remote(&mut self, now_ns: Nanoseconds, frame: &Frame, mailbox: &mut Mailbox) {
        let node = self.canopen();
        if frame.id() == Id::canopen(0x700, node.id) {
            if let Some(byte) = node.network.guarded(now_ns, &node.dictionary) {
                mailbox.push(Frame::of(frame.id(), [byte]));
            }
        } else if node.network.state() == NodeState::Operational {
            let answer = self.report(|pdos, dictionary| pdos.requested(frame.id(), dictionary));
            if let Some(answer) = answer {
                mailbox.put(self.canopen().defects.sent(answer));
            }
        }
    }

    /// Takes an NMT command.
    fn take_nmt(&mut self, now_ns: Nanoseconds, payload: &[u8]) {
        let node = self.canopen();
        let &[command, id] = payload else { return };
        if id != 0 && id != node.id || node.network.state() == NodeState::Initialising {
            return;
        }
        let was_operational = node.network.state() == NodeState::Operational;
        match node.network.command(now_ns, command) {
            Some(NmtReset::Node) => self.restart(now_ns),
            Some(NmtReset::Communication) => {
                // The error register and history are not communication parameters, so they stay.
                node.dictionary.restore(0x1005..=0x1FFF);
                node.pdos.compile(&node.dictionary);
            }
            None => {}
        }
        let node = self.canopen();
        if !was_operational && node.network.state() == NodeState::Operational {
            node.pdos_ready_ns = now_ns + node.delays.first_pdo_ns;
        }
        node.stop_services();
    }

    /// Takes SYNC, with its counter if it has one.
    fn take_sync(&mut self, now_ns: Nanoseconds, counter: Option<u8>) {
        self.lock_loops(now_ns);
        let takes = self.begin_rpdo();
        let node = self.canopen();
        node.pdos.apply_latched(&mut node.dictionary, &mut write_field(takes));
        self.take_values(now_ns, ValueSource::Sync);
        let delay_ns = self.canopen().delays.feedback_ns;
        self.report(|pdos, dictionary| pdos.sample(now_ns, delay_ns, counter, dictionary));
    }

    /// Takes an RPDO.
    fn take_pdo(&mut self, now_ns: Nanoseconds, frame: &Frame) {
        let takes = self.begin_rpdo();
        let node = self.canopen();
        match node.pdos.receive(now_ns, frame, &mut node.dictionary, &mut write_field(takes)) {
            RpdoReception::NotMine => {}
            RpdoReception::TooShort => {
                // A series of short PDOs leads to one message.
                if !node.has_pdo_error {
                    node.has_pdo_error = true;
                    node.errors.raise(DeviceError::PdoLength, &mut node.dictionary);
                }
            }
            RpdoReception::Latched(_) => self.clear_pdo_error(),
            RpdoReception::Applied(_) => {
                self.clear_pdo_error();
                self.take_values(now_ns, ValueSource::Rpdo);
            }
        }
    }

    /// Ends the error of a short PDO.
    fn clear_pdo_error(&mut self) {
        let is_faulted = self.is_faulted();
        let node = self.canopen();
        if node.has_pdo_error && !is_faulted {
            node.has_pdo_error = false;
            node.errors.clear(&mut node.dictionary);
        }
    }

    /// Takes an SDO request.
    fn take_request(&mut self, now_ns: Nanoseconds, request: [u8; 8]) {
        // The server is taken out for the call, because it accesses the rest of the device.
        let mut server = std::mem::replace(&mut self.canopen().sdo, SdoServer::taken());
        server.request(now_ns, request, &mut Objects { device: self, now_ns });
        self.canopen().sdo = server;
    }

    /// Does what is due, and sends the frames that are due.
    fn advance_node(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        let node = self.canopen();
        if node.network.has_lost_master(now_ns) {
            node.network.follow_error_behaviour(&node.dictionary);
            self.lose_master();
            self.canopen().stop_services();
        }
        let node = self.canopen();
        if node.pdos.has_lost_rpdo(now_ns) {
            node.errors.raise(DeviceError::RpdoTimeout, &mut node.dictionary);
        }
        if now_ns >= node.save_ns {
            node.save_ns = NEVER;
            node.dictionary.save();
        }
        self.send_due(now_ns, mailbox);
    }

    /// Sends the frames that are due.
    fn send_due(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        let node = self.canopen();
        let id = node.id;
        if node.network.boot_if_due(now_ns, &node.dictionary) {
            node.pdos_ready_ns = now_ns;
            self.started(now_ns);
            mailbox.push(Frame::of(Id::canopen(0x700, id), [0]));
        }
        let node = self.canopen();
        if let Some(byte) = node.network.heartbeat(now_ns, &node.dictionary) {
            mailbox.push(Frame::of(Id::canopen(0x700, id), [byte]));
        }
        if let Some(counter) = node.network.produced_sync(now_ns, &node.dictionary) {
            if let Ok(sync) = Id::base(node.network.sync_id(&node.dictionary)) {
                mailbox
                    .push(counter.map_or_else(|| Frame::of(sync, []), |counter| Frame::of(sync, [counter])));
            }
            // The producer acts on its own SYNC.
            if node.network.state() == NodeState::Operational {
                self.take_sync(now_ns, counter);
            }
        }
        let node = self.canopen();
        if node.network.has_services() {
            while let Some(answer) = node.sdo.answer(now_ns) {
                mailbox.push(Frame::of(Id::canopen(0x580, id), answer));
            }
            while let Some(message) = node.errors.next() {
                if let Some(emergency) = node.network.emergency_id(id, &node.dictionary) {
                    mailbox.push(Frame::of(emergency, message));
                }
            }
        }
        if node.has_pdos(now_ns) {
            if node.pdos.has_events() {
                self.report(|pdos, dictionary| pdos.sample_events(now_ns, dictionary));
            }
            let node = self.canopen();
            while let Some(frame) = node.pdos.next(now_ns) {
                mailbox.put(node.defects.sent(frame));
            }
        }
    }

    /// Writes the measured values to the dictionary with the effect of the defects, and lets the PDOs take their
    /// objects.
    fn report<T>(&mut self, take: impl FnOnce(&mut PdoEngine, &SimulatedDictionary) -> T) -> T {
        self.measure();
        let shown = self.shown();
        let node = self.canopen();
        let truth = node.defects.falsify(shown, &mut node.dictionary);
        let taken = take(&mut node.pdos, &node.dictionary);
        truth.restore(&mut node.dictionary);
        taken
    }
}

/// Writes an object from an RPDO; a value that the device does not take is ignored.
fn write_field(takes: TakesField) -> impl FnMut(&mut SimulatedDictionary, usize, u64) {
    move |dictionary, place, bits| {
        if dictionary.entry(place).is_writable
            && let Some(number) = dictionary.accepted(place, bits)
            && takes(place, number)
        {
            dictionary.set(place, number);
        }
    }
}
