//! Receives and sends frames.

use takt_rt::{Frame, FrameKind, Id, Nanoseconds};

use super::Cia402Drive;
use super::access::{Objects, write_field};
use crate::sim::drive::NodeState;
use crate::sim::errors::DeviceError;
use crate::sim::mailbox::Mailbox;
use crate::sim::network::NmtReset;
use crate::sim::pdo_engine::RpdoReception;
use crate::sim::sdo_server::SdoServer;

impl Cia402Drive {
    pub(super) fn receive_frame(&mut self, now_ns: Nanoseconds, frame: &Frame, mailbox: &mut Mailbox) {
        if frame.id().is_extended() || frame.is_fd() {
            return;
        }
        if frame.kind() == FrameKind::Remote {
            return self.take_remote(now_ns, frame, mailbox);
        }
        let node = u32::from(self.node);
        let id = frame.id().value();
        match id {
            0x000 => self.take_nmt(now_ns, frame.payload()),
            0x701..=0x77F => {
                self.network.receive_heartbeat(now_ns, (id & 0x7F) as u8, &self.dictionary);
            }
            _ if id == 0x600 + node => {
                if self.network.has_services()
                    && !self.defects.is_sdo_silent
                    && let Ok(request) = frame.payload().try_into()
                {
                    self.take_request(now_ns, request);
                }
            }
            _ if self.network.state() != NodeState::Operational || now_ns < self.pdos_ready_ns => {}
            _ if id == self.network.sync_id(&self.dictionary) => {
                if frame.payload().len() == self.network.sync_length(&self.dictionary) {
                    self.take_sync(now_ns, frame.payload().first().copied());
                } else {
                    self.errors.raise(DeviceError::SyncLength, &mut self.dictionary);
                }
            }
            _ => self.take_pdo(now_ns, frame),
        }
    }

    fn take_remote(&mut self, now_ns: Nanoseconds, frame: &Frame, mailbox: &mut Mailbox) {
        if frame.id() == Id::canopen(0x700, self.node) {
            if let Some(byte) = self.network.guarded(now_ns, &self.dictionary) {
                mailbox.push(Frame::of(frame.id(), [byte]));
            }
        } else if self.network.state() == NodeState::Operational {
            let answer = self.report(|pdos, dictionary| pdos.requested(frame.id(), dictionary));
            if let Some(answer) = answer {
                mailbox.put(self.defects.sent(answer));
            }
        }
    }

    fn take_nmt(&mut self, now_ns: Nanoseconds, payload: &[u8]) {
        let &[command, node] = payload else { return };
        if node != 0 && node != self.node || self.network.state() == NodeState::Initialising {
            return;
        }
        let was_operational = self.network.state() == NodeState::Operational;
        match self.network.command(now_ns, command) {
            Some(NmtReset::Node) => self.start(now_ns),
            Some(NmtReset::Communication) => {
                // The error register and history are not communication parameters, so they stay.
                self.dictionary.restore(0x1005..=0x1FFF);
                self.pdos.compile(&self.dictionary);
            }
            None => {}
        }
        if !was_operational && self.network.state() == NodeState::Operational {
            self.pdos_ready_ns = now_ns + self.quirks.delays.first_pdo_ns.unwrap_or(0);
        }
        self.stop_services();
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

    fn take_sync(&mut self, now_ns: Nanoseconds, counter: Option<u8>) {
        self.lock_loops(now_ns);
        self.pdos.apply_latched(&mut self.dictionary, &mut write_field);
        self.follow_modes(now_ns);
        self.evaluate();
        self.latch();
        let delay_ns = self.feedback_delay_ns;
        self.report(|pdos, dictionary| pdos.sample(now_ns, delay_ns, counter, dictionary));
    }

    fn take_pdo(&mut self, now_ns: Nanoseconds, frame: &Frame) {
        match self.pdos.receive(now_ns, frame, &mut self.dictionary, &mut write_field) {
            RpdoReception::NotMine => {}
            RpdoReception::TooShort => {
                // A series of short PDOs leads to one message.
                if !self.has_pdo_error {
                    self.has_pdo_error = true;
                    self.errors.raise(DeviceError::PdoLength, &mut self.dictionary);
                }
            }
            RpdoReception::Latched(_) => self.clear_pdo_error(),
            RpdoReception::Applied(_) => {
                self.clear_pdo_error();
                self.follow_modes(now_ns);
                self.evaluate();
                self.latch();
            }
        }
    }

    fn clear_pdo_error(&mut self) {
        if self.has_pdo_error && self.axes.iter().all(|axis| !axis.state().is_faulted()) {
            self.has_pdo_error = false;
            self.errors.clear(&mut self.dictionary);
        }
    }

    fn take_request(&mut self, now_ns: Nanoseconds, request: [u8; 8]) {
        // The server is taken out for the call, because it accesses the rest of the drive.
        let mut server = std::mem::replace(&mut self.sdo, SdoServer::taken());
        server.request(now_ns, request, &mut Objects { drive: self, now_ns });
        self.sdo = server;
    }

    /// Sends the frames that are due.
    pub(super) fn send_due(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        let node = self.node;
        if self.network.boot_if_due(now_ns, &self.dictionary) {
            self.axes.iter_mut().for_each(|axis| axis.started(&self.dictionary, now_ns));
            self.pdos_ready_ns = now_ns;
            mailbox.push(Frame::of(Id::canopen(0x700, node), [0]));
        }
        if let Some(byte) = self.network.heartbeat(now_ns, &self.dictionary) {
            mailbox.push(Frame::of(Id::canopen(0x700, node), [byte]));
        }
        if let Some(counter) = self.network.produced_sync(now_ns, &self.dictionary) {
            if let Ok(id) = Id::base(self.network.sync_id(&self.dictionary)) {
                mailbox.push(counter.map_or_else(|| Frame::of(id, []), |counter| Frame::of(id, [counter])));
            }
            // The producer acts on its own SYNC.
            if self.network.state() == NodeState::Operational {
                self.take_sync(now_ns, counter);
            }
        }
        if self.network.has_services() {
            while let Some(answer) = self.sdo.answer(now_ns) {
                mailbox.push(Frame::of(Id::canopen(0x580, node), answer));
            }
            while let Some(message) = self.errors.next() {
                if let Some(id) = self.network.emergency_id(node, &self.dictionary) {
                    mailbox.push(Frame::of(id, message));
                }
            }
        }
        if self.network.state() == NodeState::Operational && now_ns >= self.pdos_ready_ns {
            if self.pdos.has_events() {
                self.report(|pdos, dictionary| pdos.sample_events(now_ns, dictionary));
            }
            while let Some(frame) = self.pdos.next(now_ns) {
                mailbox.put(self.defects.sent(frame));
            }
        }
    }
}
