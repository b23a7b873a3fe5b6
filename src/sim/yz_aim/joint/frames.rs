//! Receives and sends frames.

use takt_rt::{Frame, FrameKind, Id, Nanoseconds};

use super::YzAimJoint;
use crate::sim::drive::NodeState;
use crate::sim::mailbox::Mailbox;
use crate::sim::yz_aim::network::YzAimReset;
use crate::sim::yz_aim::objects::OBJECTS;
use crate::sim::yz_aim::process_data::{PDOS, RPDO_MAPPING, YzAimProcessData};

const SYNC: u32 = 0x080;

impl YzAimJoint {
    pub(super) fn receive_frame(&mut self, now_ns: Nanoseconds, frame: &Frame) {
        let is_data = frame.kind() == FrameKind::Data && !frame.id().is_extended();
        if !is_data || self.network.state() == NodeState::Initialising {
            return;
        }
        match frame.id().value() {
            0x000 => self.take_nmt(now_ns, frame.payload()),
            id @ 0x701..=0x77F => self.network.receive_heartbeat(now_ns, (id & 0x7F) as u8, &self.dictionary),
            _ if frame.id() == Id::canopen(0x600, self.node) => {
                if self.network.has_services() && !self.defects.is_sdo_silent {
                    self.take_request(now_ns, frame.payload());
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
            Some(YzAimReset::Node) => self.start(now_ns, NodeState::PreOperational, true),
            Some(YzAimReset::Communication) => self.dictionary.restore(0x1005..=0x1FFF),
            None => {}
        }
        let state = self.network.state();
        if state == NodeState::Operational && before != state {
            self.process_data.start(now_ns, &self.dictionary);
        } else if state != NodeState::Operational {
            self.process_data = YzAimProcessData::at_rest();
        }
        if !self.network.has_services() {
            self.sdo.reset();
        }
    }

    fn take_sync(&mut self, now_ns: Nanoseconds) {
        if self.interpolates() {
            self.lock_loops(now_ns);
        }
        for number in 0..PDOS {
            if let Some(data) = self.process_data.release(number) {
                self.apply(now_ns, number, data);
            }
        }
        let (feedback, latency_ns) = (self.feedback(), self.parameters.feedback_delay_ns);
        self.process_data.sync(now_ns, latency_ns, feedback, &self.dictionary);
    }

    fn take_pdo(&mut self, now_ns: Nanoseconds, frame: &Frame) {
        let Some(number) = YzAimProcessData::number(frame.id(), self.node) else { return };
        let mapped: usize = RPDO_MAPPING[number].iter().map(|at| OBJECTS[*at].bytes()).sum();
        if frame.payload().len() < mapped {
            return;
        }
        let data = frame.first_word().to_le_bytes();
        if YzAimProcessData::waits_for_sync(number, &self.dictionary) {
            self.process_data.hold(number, data);
        } else {
            self.apply(now_ns, number, data);
        }
        let feedback = self.feedback();
        self.process_data.answer(number, now_ns, self.parameters.feedback_delay_ns, feedback);
    }

    /// Sends the frames that are due. At a wrong bit rate nothing is sent.
    pub(super) fn send_due(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        let is_on_bus = self.is_on_bus();
        let mut send = |frame| is_on_bus && mailbox.push(frame);
        let has_alarm = self.shows_alarm();
        if let Some(boot_up) = self.network.boot_if_due(now_ns, &self.dictionary) {
            if boot_up.is_announced {
                send(Frame::of(Id::canopen(0x700, self.node), [0]));
            }
            self.boot(now_ns);
        }
        if let Some(byte) = self.network.heartbeat(now_ns, &self.dictionary, has_alarm) {
            send(Frame::of(Id::canopen(0x700, self.node), [byte]));
        }
        if let Some(answer) = self.sdo.take(now_ns) {
            send(Frame::of(Id::canopen(0x580, self.node), answer));
        }
        if self.network.state() == NodeState::Operational {
            let feedback = self.feedback();
            self.process_data.run_events(now_ns, feedback, &self.dictionary);
            while let Some(frame) = self.process_data.next(now_ns, self.node, &self.dictionary) {
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
            self.process_data.start(now_ns, &self.dictionary);
        }
    }
}
