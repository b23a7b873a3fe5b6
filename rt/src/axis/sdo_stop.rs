//! The drive's controlword by SDO: what is left for a drive that takes no process data any more.

use super::sdo_fallback::{Address, SdoFallback};
use super::{Axis, CommandPdo, Exchange};
use crate::bit_fields::{FieldTargets, LifeWish};
use crate::cia402::{DriveState, controlword};
use crate::frame::Frame;
use crate::pdo::CommandSlot;
use crate::watch::{nmt_command, node_state};

impl Axis {
    /// Takes an NMT command that another master has given to the node.
    pub fn receive_foreign_nmt(&mut self, command: u8) {
        self.node_monitor.receive_foreign_nmt(command);
    }

    /// Updates whether process data reach the node, see [`Axis::is_pdo_unreachable`]. Called in each slot in which drives may
    /// have power.
    pub fn note_pdo_reachability(&mut self) {
        self.node_monitor.note_pdo_reachability(self.reception.age_cycles());
    }

    /// Returns `true` if the node takes no process data any more: its NMT state is another one than operational, and its feedback stays
    /// away. That remains so until the node is watched anew.
    pub fn is_pdo_unreachable(&self) -> bool {
        self.node_monitor.is_pdo_unreachable()
    }

    /// The controlword that stops a drive which process data do not reach.
    pub fn sdo_stop_word(&self) -> u16 {
        if self.drive_state().has_torque() {
            self.parameters.codec.stop_word()
        } else {
            controlword::DISABLE_VOLTAGE
        }
    }

    /// Lets a slot pass in which the drive is to have this controlword by SDO, or needs none.
    #[inline]
    pub fn command_by_service(&mut self, word: Option<u16>) {
        if word.is_some() || self.sdo_fallback != SdoFallback::Unused {
            self.sdo_fallback.pass(word);
        }
    }

    /// The frame that is due to write that controlword, if one is. It is due again after so many slots, unless the drive
    /// confirms it before.
    pub fn service_frame(&mut self, repeat_slots: u32) -> Option<Frame> {
        self.sdo_fallback.frame(self.sdo_address(), self.node_monitor.nmt_state(), repeat_slots)
    }

    /// The frame with that controlword, if it is due, for a drive that has no SDO.
    pub fn stop_frame(&mut self, repeat_slots: u32) -> Option<Frame> {
        let word = self.sdo_fallback.take_due_word(repeat_slots)?;
        self.command.set(CommandSlot::Controlword, word.into());
        self.controlwords.note_by_service(word);
        match &self.parameters.exchange {
            Exchange::Pdos(pdos) => {
                let carries_it = |command: &&CommandPdo| command.pdo.mapping.sends(CommandSlot::Controlword);
                let command = pdos.commands.iter().find(carries_it)?;
                Some(command.pdo.frame(&self.command))
            }
            Exchange::BitFields(by) => {
                Some(self.field_drive.step(by, LifeWish::Stop, &FieldTargets::default()))
            }
            Exchange::OffCycle { stop_frame, .. } => *stop_frame,
        }
    }

    /// Takes a frame that may confirm a controlword that was written by SDO.
    pub fn receive_service(&mut self, frame: &Frame) {
        if let Some(word) = self.sdo_fallback.receive(self.sdo_address(), frame) {
            self.controlwords.note_by_service(word);
        }
    }

    /// Returns `true` if the node may still be about to answer such a frame, of which so many slots are left until it is sent again.
    pub fn is_asked_by_service(&self, left_slots: u32) -> bool {
        self.sdo_fallback.is_asked(left_slots)
    }

    fn sdo_address(&self) -> Address {
        Address { node: self.parameters.node, node_axis: self.parameters.node_axis }
    }

    /// Takes a report of a drive that may have confirmed by SDO that its power is to be off.
    #[inline]
    pub(super) fn note_service_report(&mut self) {
        if matches!(self.sdo_fallback, SdoFallback::Confirmed { .. }) && self.drive_state().has_torque() {
            self.sdo_fallback.note_torque();
        }
    }

    /// Returns `true` if the drive has torque, as far as it can be known: an SDO confirmation is newer than the last statusword.
    pub fn has_torque(&self) -> bool {
        self.may_have_torque() && !self.has_confirmed_by_service()
    }

    /// Returns `true` if the drive has confirmed by SDO that its power is to be off, and has reported no torque since.
    pub(super) fn has_confirmed_by_service(&self) -> bool {
        self.sdo_fallback.is_switched_off()
    }

    /// Returns `true` if the drive has torque by its last report, or may have got it since: what a drive of bit fields was told is newer than its
    /// last reply, and one that is spoken to outside of the cycle is being enabled or disabled for a long time.
    pub fn may_have_torque(&self) -> bool {
        let state = self.drive_state();
        state.has_torque()
            || match self.parameters.exchange {
                Exchange::Pdos(_) => false,
                Exchange::BitFields(_) => self.field_drive.may_have_torque(),
                Exchange::OffCycle { .. } => state == DriveState::SwitchedOn,
            }
    }

    /// Takes the state in a boot-up message or heartbeat.
    pub fn receive_error_control(&mut self, state: u8) {
        self.node_monitor.receive(state);
        if state == node_state::STOPPED && self.parameters.codec.is_stopped_by_heartbeat() {
            self.node_monitor.receive_foreign_nmt(nmt_command::STOP);
        }
    }
}
