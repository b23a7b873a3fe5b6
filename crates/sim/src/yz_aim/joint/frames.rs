//! Receives and sends frames.

use takt_rt::{Frame, FrameKind, Id, Nanoseconds};
use takt_wire::quirks::PowerUpState;

use super::YzAimJoint;
use super::access::{Objects, write_field};
use crate::drive::NodeState;
use crate::loops::ControlLoops;
use crate::mailbox::Mailbox;
use crate::network::NmtReset;
use crate::pdo_engine::RpdoReception;
use crate::sdo_server::SdoServer;
use crate::yz_aim::process_data::{PDOS, Transmission};

const SYNC: u32 = 0x080;
/// The code of a heartbeat during an alarm.
const ALARM: u8 = 0x04;

impl YzAimJoint {
    pub(super) fn receive_frame(&mut self, now_ns: Nanoseconds, frame: &Frame) {
        let is_data = frame.kind() == FrameKind::Data && !frame.id().is_extended();
        if !is_data || self.network.state() == NodeState::Initialising {
            return;
        }
        match frame.id().value() {
            0x000 => self.take_nmt(now_ns, frame.payload()),
            id @ 0x701..=0x77F => {
                // A heartbeat after a loss ends the alarm.
                if self.network.receive_heartbeat(now_ns, (id & 0x7F) as u8, &self.dictionary) {
                    self.is_master_lost = false;
                }
            }
            _ if frame.id() == Id::canopen(0x600, self.node) => {
                if self.network.has_services() && !self.defects.is_sdo_silent {
                    self.take_request(now_ns, frame);
                }
            }
            _ if self.network.state() != NodeState::Operational => {}
            SYNC => self.take_sync(now_ns),
            _ => self.take_pdo(now_ns, frame),
        }
    }

    fn take_nmt(&mut self, now_ns: Nanoseconds, payload: &[u8]) {
        let &[command, node] = payload else { return };
        if node != 0 && node != self.node {
            return;
        }
        let before = self.network.state();
        match self.network.command(now_ns, command) {
            Some(NmtReset::Node) => self.start(now_ns, PowerUpState::PreOperational, true),
            Some(NmtReset::Communication) => {
                self.network.set_power_up(PowerUpState::PreOperational);
                self.is_boot_announced = true;
                self.is_master_lost = false;
                self.dictionary.restore(0x1005..=0x1FFF);
                self.pdos.compile(&self.dictionary);
            }
            None => {}
        }
        let state = self.network.state();
        if state == NodeState::Operational && before != state {
            self.start_pdos(now_ns);
        } else if state != NodeState::Operational {
            self.pdos.stop();
            self.transmission = Transmission::at_rest();
        }
        if !self.network.has_services() {
            self.sdo.reset();
        }
    }

    fn start_pdos(&mut self, now_ns: Nanoseconds) {
        self.pdos.stop();
        self.transmission.start(now_ns, &self.pdos);
    }

    /// Processes an SDO request. Frames of four bytes and more are accepted without padding, because published masters send
    /// them so.
    fn take_request(&mut self, now_ns: Nanoseconds, frame: &Frame) {
        if frame.payload().len() < 4 {
            return;
        }
        // The server is taken out for the call, because it accesses the rest of the drive.
        let mut server = std::mem::replace(&mut self.sdo, SdoServer::taken());
        server.request(now_ns, frame.first_word().to_le_bytes(), &mut Objects { unit: self, now_ns });
        self.sdo = server;
    }

    fn take_sync(&mut self, now_ns: Nanoseconds) {
        if self.interpolates() {
            self.lock_loops(now_ns);
        }
        for number in 0..PDOS {
            let mode = self.mode();
            if self.pdos.apply_latched_of(number, &mut self.dictionary, &mut write_field) {
                self.apply(now_ns, number, mode, true);
            }
        }
        let latency_ns = self.parameters.feedback_delay_ns;
        self.report(|transmission, pdos, dictionary| transmission.sync(now_ns, latency_ns, pdos, dictionary));
    }

    fn take_pdo(&mut self, now_ns: Nanoseconds, frame: &Frame) {
        let mode = self.mode();
        let number = match self.pdos.receive(now_ns, frame, &mut self.dictionary, &mut write_field) {
            RpdoReception::NotMine | RpdoReception::TooShort => return,
            RpdoReception::Latched(number) => number,
            RpdoReception::Applied(number) => {
                self.apply(now_ns, number, mode, false);
                number
            }
        };
        let latency_ns = self.parameters.feedback_delay_ns;
        self.report(|_, pdos, dictionary| pdos.trigger(number, now_ns, latency_ns, dictionary));
    }

    /// Sends the frames that are due. At a wrong bit rate nothing is sent.
    pub(super) fn send_due(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        let is_on_bus = self.is_on_bus();
        let mut send = |frame| is_on_bus && mailbox.push(frame);
        let has_alarm = self.shows_alarm();
        if self.network.boot_if_due(now_ns, &self.dictionary) {
            if self.is_boot_announced {
                send(Frame::of(Id::canopen(0x700, self.node), [0]));
            }
            self.boot(now_ns);
        }
        // A stopped node sends no heartbeat.
        if let Some(byte) = self.network.heartbeat(now_ns, &self.dictionary)
            && self.network.has_services()
        {
            send(Frame::of(Id::canopen(0x700, self.node), [if has_alarm { ALARM } else { byte }]));
        }
        while let Some(answer) = self.sdo.answer(now_ns) {
            send(Frame::of(Id::canopen(0x580, self.node), answer));
        }
        if self.network.state() == NodeState::Operational {
            if self.transmission.has_event(now_ns) {
                self.report(|transmission, pdos, dictionary| {
                    transmission.run_events(now_ns, pdos, dictionary)
                });
            }
            while let Some(frame) = self.pdos.next(now_ns) {
                if is_on_bus {
                    mailbox.put(self.defects.sent(frame));
                }
            }
        }
    }

    /// Completes the boot: after power-up and "reset node" the motor is energised.
    fn boot(&mut self, now_ns: Nanoseconds) {
        self.has_started = true;
        if std::mem::take(&mut self.is_starting_cold) {
            self.move_after_power_up();
        }
        if self.network.state() == NodeState::Operational {
            self.start_pdos(now_ns);
        }
    }
}
