//! Receives and sends frames.

use takt_rt::{Frame, FrameKind, Id, Nanoseconds};

use super::ErobJoint;
use super::access::{Objects, write_field};
use crate::sim::drive::{DriveFault, NodeState};
use crate::sim::erob::objects::at;
use crate::sim::errors::DeviceError;
use crate::sim::mailbox::Mailbox;
use crate::sim::network::NmtReset;
use crate::sim::pdo_engine::RpdoReception;
use crate::sim::sdo_server::SdoServer;

impl ErobJoint {
    pub(super) fn receive_frame(&mut self, now_ns: Nanoseconds, frame: &Frame, mailbox: &mut Mailbox) {
        if frame.id().is_extended() || frame.is_fd() {
            return;
        }
        if frame.kind() == FrameKind::Remote {
            return self.take_remote(now_ns, frame, mailbox);
        }
        let node = u32::from(self.parameters.node);
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
            _ if self.network.state() != NodeState::Operational => {}
            _ if id == self.network.sync_id(&self.dictionary) => self.take_sync(now_ns),
            _ => self.take_pdo(now_ns, frame),
        }
    }

    fn take_remote(&mut self, now_ns: Nanoseconds, frame: &Frame, mailbox: &mut Mailbox) {
        if frame.id() == Id::canopen(0x700, self.parameters.node) {
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
        if node != 0 && node != self.parameters.node || self.network.state() == NodeState::Initialising {
            return;
        }
        match self.network.command(now_ns, command) {
            Some(NmtReset::Node) => self.start(now_ns),
            Some(NmtReset::Communication) => {
                // The error register and history are not communication parameters, so they stay.
                self.dictionary.restore(0x1005..=0x1FFF);
                self.pdos.compile(&self.dictionary);
            }
            None => {}
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

    fn take_sync(&mut self, now_ns: Nanoseconds) {
        self.lock_loops(now_ns);
        let is_enabled = self.device.state().has_torque();
        self.pdos.apply_latched(&mut self.dictionary, &mut write_field(is_enabled));
        self.follow_mode();
        self.evaluate(now_ns);
        self.motion.latch(&self.dictionary);
        let delay_ns = self.parameters.feedback_delay_ns;
        self.report(|pdos, dictionary| pdos.sample(now_ns, delay_ns, None, dictionary));
    }

    fn take_pdo(&mut self, now_ns: Nanoseconds, frame: &Frame) {
        let target = self.dictionary.number(at::TARGET_POSITION);
        let is_enabled = self.device.state().has_torque();
        match self.pdos.receive(now_ns, frame, &mut self.dictionary, &mut write_field(is_enabled)) {
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
                self.follow_mode();
                self.evaluate(now_ns);
                if self.dictionary.number(at::TARGET_POSITION) != target {
                    self.motion.latch(&self.dictionary);
                }
            }
        }
    }

    fn clear_pdo_error(&mut self) {
        if self.has_pdo_error && !self.device.state().is_faulted() {
            self.has_pdo_error = false;
            self.errors.clear(&mut self.dictionary);
        }
    }

    fn take_request(&mut self, now_ns: Nanoseconds, request: [u8; 8]) {
        // The server is taken out for the call, because it accesses the rest of the drive.
        let mut server = std::mem::replace(&mut self.sdo, SdoServer::taken());
        server.request(now_ns, request, &mut Objects { module: self, now_ns });
        self.sdo = server;
    }

    /// Sends the frames that are due.
    pub(super) fn send_due(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        let node = self.parameters.node;
        if self.network.boot_if_due(now_ns, &self.dictionary) {
            self.device.started();
            if self.has_battery_fault {
                self.fail(DeviceError::Fault(DriveFault::MultiTurnBattery));
            }
            mailbox.push(Frame::of(Id::canopen(0x700, node), [0]));
        }
        if let Some(byte) = self.network.heartbeat(now_ns, &self.dictionary) {
            mailbox.push(Frame::of(Id::canopen(0x700, node), [byte]));
        }
        if self.network.produced_sync(now_ns, &self.dictionary).is_some() {
            if let Ok(id) = Id::base(self.network.sync_id(&self.dictionary)) {
                mailbox.push(Frame::of(id, []));
            }
            // The producer acts on its own SYNC.
            if self.network.state() == NodeState::Operational {
                self.take_sync(now_ns);
            }
        }
        if self.network.has_services() {
            while let Some(answer) = self.sdo.answer(now_ns) {
                mailbox.push(Frame::of(Id::canopen(0x580, node), answer));
            }
            while let Some(message) = self.errors.next() {
                mailbox.push(Frame::of(Id::canopen(0x080, node), message));
            }
        }
        if self.network.state() == NodeState::Operational {
            if self.pdos.has_events() {
                self.report(|pdos, dictionary| pdos.sample_events(now_ns, dictionary));
            }
            while let Some(frame) = self.pdos.next(now_ns) {
                mailbox.put(self.defects.sent(frame));
            }
        }
    }
}
