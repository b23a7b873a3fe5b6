//! The CANopen services of a drive: what its node does with each frame and with time.

use takt_rt::{Frame, FrameKind, Id, Nanoseconds};

use super::access::Objects;
use super::node::{CanopenDevice, NEVER};
use crate::drive::NodeState;
use crate::errors::DeviceError;
use crate::mailbox::Mailbox;
use crate::network::NmtReset;
use crate::object_dictionary::SimulatedDictionary;
use crate::pdo_engine::{PdoEngine, RpdoReception};
use crate::sdo_server::SdoServer;

/// The code of a heartbeat during an alarm, of a drive that shows it there: CiA 301 has it for "stopped".
const ALARM: u8 = 0x04;

/// The CANopen services of a device.
pub trait NodeServices: CanopenDevice {
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
                if node.network.receive_heartbeat(now_ns, (id & 0x7F) as u8, &node.dictionary) {
                    self.hear_master();
                }
            }
            _ if id == 0x600 + u32::from(node.id) => {
                let least = if node.quirks.simulated.takes_short_requests { 4 } else { 8 };
                let is_heard = node.network.has_services() && !node.defects.is_sdo_silent;
                if is_heard && (least..=8).contains(&frame.payload().len()) {
                    self.take_request(now_ns, frame.first_word().to_le_bytes());
                }
            }
            _ if !node.has_pdos(now_ns) => {}
            _ if id == node.network.sync_id(&node.dictionary) => {
                let is_right = frame.payload().len() == node.network.sync_length(&node.dictionary);
                if is_right || node.quirks.simulated.takes_any_sync {
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
                node.is_boot_silent = false;
                self.reset_communication();
            }
            None => {}
        }
        let node = self.canopen();
        if !was_operational && node.network.state() == NodeState::Operational {
            node.pdos_ready_ns = now_ns + node.delays.first_pdo_ns;
            node.pdos.start(now_ns);
        }
        node.stop_services();
    }

    /// Takes SYNC, with its counter if it has one.
    fn take_sync(&mut self, now_ns: Nanoseconds, counter: Option<u8>) {
        self.lock_loops(now_ns);
        for number in 0..self.canopen().pdos.rpdos() {
            let node = self.canopen();
            if node.pdos.apply_latched(number, &mut node.dictionary, &mut write_field) {
                self.rpdo_applied(now_ns, number, true);
            }
        }
        self.synced(now_ns);
        let delay_ns = self.canopen().delays.feedback_ns;
        self.report(|pdos, dictionary| pdos.sample(now_ns, delay_ns, counter, dictionary));
    }

    /// Takes an RPDO.
    fn take_pdo(&mut self, now_ns: Nanoseconds, frame: &Frame) {
        let node = self.canopen();
        match node.pdos.receive(now_ns, frame, &mut node.dictionary, &mut write_field) {
            RpdoReception::NotMine => {}
            RpdoReception::TooShort => {
                // A series of short PDOs leads to one message.
                if !node.has_pdo_error {
                    node.has_pdo_error = true;
                    node.errors.raise(DeviceError::PdoLength, &mut node.dictionary);
                }
            }
            RpdoReception::Latched(number) => {
                self.clear_pdo_error();
                self.answer_rpdo(now_ns, number);
            }
            RpdoReception::Applied(number) => {
                self.clear_pdo_error();
                self.rpdo_applied(now_ns, number, false);
                self.answer_rpdo(now_ns, number);
            }
        }
    }

    /// Answers an RPDO, if the device does that.
    fn answer_rpdo(&mut self, now_ns: Nanoseconds, number: usize) {
        if self.canopen().quirks.simulated.answers_rpdos {
            let delay_ns = self.canopen().delays.feedback_ns;
            self.report(|pdos, dictionary| pdos.answer(number, now_ns, delay_ns, dictionary));
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
        let is_silent_if_absent = self.canopen().quirks.is_silent_if_absent;
        server.request(now_ns, request, &mut Objects { device: self, now_ns, is_silent_if_absent });
        self.canopen().sdo = server;
    }

    /// Does what is due, and sends the frames that are due.
    fn advance_node(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        let node = self.canopen();
        if node.network.has_lost_master(now_ns) {
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
            if node.network.state() == NodeState::Operational {
                node.pdos.start(now_ns);
            }
            let is_silent = node.is_boot_silent;
            self.started(now_ns);
            if !is_silent {
                mailbox.push(Frame::of(Id::canopen(0x700, id), [0]));
            }
        }
        let has_alarm = self.is_faulted();
        let node = self.canopen();
        let shows_alarm = node.quirks.shows_alarm_in_heartbeat;
        if let Some(byte) = node.network.heartbeat(now_ns, &node.dictionary)
            && (node.network.has_services() || !shows_alarm)
        {
            let byte = if has_alarm && shows_alarm { ALARM } else { byte };
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
                if let Some(emergency) = node.network.emergency_id(id, &node.dictionary)
                    && !node.quirks.simulated.lacks_emergencies
                {
                    mailbox.push(Frame::of(emergency, message));
                }
            }
        }
        if node.has_pdos(now_ns) {
            if node.pdos.has_events(now_ns) {
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
        self.measure_for_pdos();
        let shown = self.shown();
        let node = self.canopen();
        let truth = node.defects.falsify(shown, &mut node.dictionary);
        let taken = take(&mut node.pdos, &node.dictionary);
        truth.restore(&mut node.dictionary);
        taken
    }
}

impl<D: CanopenDevice> NodeServices for D {}

/// Writes an object from an RPDO; a value out of its range is ignored.
fn write_field(dictionary: &mut SimulatedDictionary, place: usize, bits: u64) {
    if dictionary.entry(place).is_writable
        && let Some(number) = dictionary.accepted(place, bits)
    {
        dictionary.set(place, number);
    }
}
