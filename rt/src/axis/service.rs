//! The drive's controlword by SDO: the way that is left to a drive that takes no process data any more.

use super::Axis;
use crate::cia402::controlword;
use crate::dialect::Dialect;
use crate::frame::{Frame, Id};
use crate::watch::{NmtState, nmt_command, node_state};

/// Cycles of its bus without feedback after which a node is believed that does not take process data. Its number, or its
/// heartbeat, may as well be somebody else's.
const DEAF_CYCLES: u16 = 2;
/// Function codes of an SDO request and of its answer (CiA 301, 7.3.3).
const SDO_REQUEST: u16 = 0x600;
const SDO_ANSWER: u16 = 0x580;
/// Download of two bytes to 6040:00 in one frame, and its confirmation (CiA 301, 7.2.4.3.3).
const DOWNLOAD_CONTROLWORD: [u8; 4] = [0x2B, 0x40, 0x60, 0x00];
const CONTROLWORD_DOWNLOADED: [u8; 4] = [0x60, 0x40, 0x60, 0x00];

/// A controlword that is to be written by SDO.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ServiceCommand {
    /// Which; `None` while process data serve.
    word: Option<u16>,
    /// Slots until it is written again.
    wait: u32,
    /// Whether the node has been led to a state in which it has an SDO server.
    is_woken: bool,
    /// Whether the drive has confirmed it.
    is_confirmed: bool,
}

impl Axis {
    /// Takes an NMT command that another master has given to the node.
    pub fn receive_foreign_nmt(&mut self, command: u8) {
        self.node_watch.commanded(command);
    }

    /// Looks whether the node takes process data. One that has said, or has been told, that it does not is believed when its
    /// feedback stays away as well; that remains so until it is watched anew.
    pub fn note_pdo_reachability(&mut self) {
        self.is_pdo_unreachable |=
            self.node_watch.nmt_state() != NmtState::Operational && self.age >= DEAF_CYCLES;
    }

    /// Whether the node takes no process data any more.
    pub fn is_pdo_unreachable(&self) -> bool {
        self.is_pdo_unreachable
    }

    /// What a drive that is deaf and moves is to be told: to come to rest by its own means.
    pub fn sdo_stop_word(&self) -> u16 {
        match self.parameters.dialect {
            _ if !self.drive_state().has_torque() => controlword::DISABLE_VOLTAGE,
            Dialect::Cia402 => controlword::QUICK_STOP,
            // It has no quick stop; its halt keeps the shaft locked.
            Dialect::YzAim => controlword::ENABLE_OPERATION | controlword::HALT,
        }
    }

    /// Lets a slot pass in which the drive is to have this controlword by SDO, or needs none.
    pub fn command_by_service(&mut self, word: Option<u16>) {
        let service = &mut self.service;
        service.wait = service.wait.saturating_sub(1);
        if service.word != word {
            *service = ServiceCommand { word, ..ServiceCommand::default() };
        }
    }

    /// The frame that is due for that, if one is. It is due again, should it not be confirmed, after so many slots.
    pub fn service_frame(&mut self, repeat_slots: u32) -> Option<Frame> {
        let node = self.parameters.node;
        let service = &mut self.service;
        let word = service.word.filter(|_| !service.is_confirmed && service.wait == 0)?;
        // A stopped node has no SDO server.
        if self.node_watch.nmt_state() == NmtState::Stopped && !service.is_woken {
            service.is_woken = true;
            return Some(Frame::of(Id::canopen(0, 0), [nmt_command::ENTER_PRE_OPERATIONAL, node]));
        }
        service.is_woken = false;
        service.wait = repeat_slots;
        let ([command, index_low, index_high, subindex], [low, high]) =
            (DOWNLOAD_CONTROLWORD, word.to_le_bytes());
        let request = [command, index_low, index_high, subindex, low, high, 0, 0];
        Some(Frame::of(Id::canopen(SDO_REQUEST, node), request))
    }

    /// Takes a frame that may confirm a controlword that was written by SDO.
    pub fn receive_service(&mut self, frame: &Frame) {
        let is_awaited = self.service.word.is_some() && !self.service.is_confirmed;
        if is_awaited
            && frame.id() == Id::canopen(SDO_ANSWER, self.parameters.node)
            && frame.payload().starts_with(&CONTROLWORD_DOWNLOADED)
        {
            self.service.is_confirmed = true;
        }
    }

    /// Whether the drive has torque, as far as it can be known: what it has confirmed by SDO is newer than its last
    /// statusword.
    pub fn has_torque(&self) -> bool {
        let is_switched_off =
            self.service.is_confirmed && self.service.word == Some(controlword::DISABLE_VOLTAGE);
        self.drive_state().has_torque() && !is_switched_off
    }

    /// Takes the state in a boot-up message or heartbeat.
    pub fn receive_error_control(&mut self, state: u8) {
        self.node_watch.receive(state);
        // A stopped YZ-AIM says nothing, and one with an alarm says "stopped" (manual, 5.11.1).
        if state == node_state::STOPPED && self.parameters.dialect == Dialect::Cia402 {
            self.node_watch.commanded(nmt_command::STOP);
        }
    }
}
