//! The drive's controlword by SDO: what is left for a drive that takes no process data any more.

use super::{Axis, CommandPdo, Exchange};
use crate::bit_fields::{FieldTargets, LifeWish};
use crate::cia402::{DriveState, controlword};
use crate::frame::{Frame, Id};
use crate::function_code;
use crate::pdo::CommandSlot;
use crate::watch::{NmtState, nmt_command, node_state};

/// Download of two bytes in one frame, and its confirmation (CiA 301, 7.2.4.3.3).
const DOWNLOAD: u8 = 0x2B;
const DOWNLOADED: u8 = 0x60;
/// Slots in which the reports of a drive that has confirmed its controlword may show that it does not obey it.
const SHOWING_SLOTS: u32 = 20;

/// A request to the controlword of one axis of a node, or the confirmation: command, index and sub-index.
fn controlword_of(node_axis: u8, command: u8) -> [u8; 4] {
    let object = CommandSlot::Controlword.object().of_node_axis(node_axis);
    let [low, high] = object.index.to_le_bytes();
    [command, low, high, object.subindex]
}

/// Where the controlword of an axis is.
#[derive(Clone, Copy)]
struct Address {
    node: u8,
    node_axis: u8,
}

/// The controlword that a drive is to have by SDO.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) enum SdoFallback {
    /// Process data serve.
    #[default]
    Unused,
    /// The controlword is being written.
    Writing {
        /// Which.
        word: u16,
        /// Slots until it is written, or written again.
        wait_slots: u32,
        /// True if the node has just been sent to pre-operational, where it has an SDO server.
        is_woken: bool,
    },
    /// The drive has confirmed the controlword.
    Confirmed {
        /// Which.
        word: u16,
        /// Slots until a drive that goes on to report would have shown that it does not obey.
        wait_slots: u32,
    },
}

impl SdoFallback {
    fn word(self) -> Option<u16> {
        match self {
            Self::Unused => None,
            Self::Writing { word, .. } | Self::Confirmed { word, .. } => Some(word),
        }
    }

    /// Lets a slot pass in which the drive is to have this controlword, or needs none.
    fn pass(&mut self, wanted: Option<u16>) {
        let Some(word) = wanted else {
            *self = Self::Unused;
            return;
        };
        if self.word() != wanted {
            *self = Self::Writing { word, wait_slots: 0, is_woken: false };
        } else if let Self::Writing { wait_slots, .. } | Self::Confirmed { wait_slots, .. } = self {
            *wait_slots = wait_slots.saturating_sub(1);
        }
    }

    /// The controlword that is due, on a bus without SDO. It is due again after so many slots.
    fn take_due_word(&mut self, repeat_slots: u32) -> Option<u16> {
        let Self::Writing { word, wait_slots: wait_slots @ 0, .. } = self else { return None };
        *wait_slots = repeat_slots;
        Some(*word)
    }

    /// The frame that is due, if one is. It is due again after so many slots, unless it is confirmed before.
    fn frame(&mut self, to: Address, nmt_state: NmtState, repeat_slots: u32) -> Option<Frame> {
        let Address { node, node_axis } = to;
        let Self::Writing { word, wait_slots: wait_slots @ 0, is_woken } = self else { return None };
        // A stopped node has no SDO server.
        if nmt_state == NmtState::Stopped && !*is_woken {
            *is_woken = true;
            return Some(Frame::of(Id::canopen(0, 0), [nmt_command::ENTER_PRE_OPERATIONAL, node]));
        }
        *is_woken = false;
        *wait_slots = repeat_slots;
        let [command, index_low, index_high, subindex] = controlword_of(node_axis, DOWNLOAD);
        let [low, high] = word.to_le_bytes();
        let request = [command, index_low, index_high, subindex, low, high, 0, 0];
        Some(Frame::of(Id::canopen(function_code::SDO_REQUEST, node), request))
    }

    /// Takes a frame that may be the confirmation. Returns the controlword that it confirms.
    fn receive(&mut self, from: Address, frame: &Frame) -> Option<u16> {
        let Self::Writing { word, .. } = *self else { return None };
        let is_confirmed = frame.id() == Id::canopen(function_code::SDO_RESPONSE, from.node)
            && frame.payload().starts_with(&controlword_of(from.node_axis, DOWNLOADED));
        if !is_confirmed {
            return None;
        }
        *self = Self::Confirmed { word, wait_slots: SHOWING_SLOTS };
        Some(word)
    }

    /// Takes a report that shows torque. A drive that has confirmed that its power is to be off is told again: the confirmation
    /// of a controlword is no statusword.
    fn note_torque(&mut self) {
        if let Self::Confirmed { word: word @ controlword::DISABLE_VOLTAGE, .. } = *self {
            *self = Self::Writing { word, wait_slots: SHOWING_SLOTS, is_woken: false };
        }
    }

    /// Returns `true` if the node may still be about to answer: so many slots are left until the controlword is written again.
    fn is_asked(self, left_slots: u32) -> bool {
        matches!(self, Self::Writing { wait_slots, .. } if wait_slots > left_slots)
    }

    /// Returns `true` if the drive has confirmed that its power is to be off, and has shown no torque since.
    fn is_switched_off(self) -> bool {
        self == Self::Confirmed { word: controlword::DISABLE_VOLTAGE, wait_slots: 0 }
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    const NODE: Address = Address { node: 5, node_axis: 1 };

    fn confirmation() -> Frame {
        Frame::of(Id::canopen(function_code::SDO_RESPONSE, NODE.node), [0x60, 0x40, 0x60, 0, 0, 0, 0, 0])
    }

    /// Lets the time pass in which reports would show torque.
    fn show(fallback: &mut SdoFallback) {
        let word = fallback.word();
        (0..SHOWING_SLOTS).for_each(|_| fallback.pass(word));
    }

    #[test]
    fn a_controlword_is_written_again_until_it_is_confirmed() {
        let mut fallback = SdoFallback::default();
        let written = |fallback: &mut SdoFallback| {
            fallback.pass(Some(controlword::QUICK_STOP));
            fallback.frame(NODE, NmtState::PreOperational, 3).is_some()
        };
        let slots = [0; 7].map(|_| written(&mut fallback));
        assert_eq!(slots, [true, false, false, true, false, false, true]);
        fallback.receive(NODE, &confirmation());
        assert_eq!([0; 7].map(|_| written(&mut fallback)), [false; 7]);
        assert!(!fallback.is_switched_off());
        // Another controlword is written at once, and needs its own confirmation.
        fallback.pass(Some(controlword::DISABLE_VOLTAGE));
        assert!(fallback.frame(NODE, NmtState::PreOperational, 3).is_some());
        fallback.receive(NODE, &confirmation());
        show(&mut fallback);
        assert!(fallback.is_switched_off());
        fallback.pass(None);
        assert_eq!(fallback, SdoFallback::Unused);
    }

    #[test]
    fn a_controlword_that_is_confirmed_and_not_obeyed_is_written_again_after_some_slots() {
        let mut fallback = SdoFallback::default();
        let written = |fallback: &mut SdoFallback| {
            fallback.pass(Some(controlword::DISABLE_VOLTAGE));
            fallback.frame(NODE, NmtState::Operational, 3).is_some()
        };
        for _ in 0..3 {
            assert!(written(&mut fallback));
            fallback.receive(NODE, &confirmation());
            assert!(!written(&mut fallback) && !fallback.is_switched_off());
            fallback.note_torque();
            assert!((1..SHOWING_SLOTS).all(|_| !written(&mut fallback)));
        }
    }

    #[test]
    fn the_controlword_of_a_further_axis_of_a_node_is_another_object() {
        let second = Address { node_axis: 2, ..NODE };
        let mut fallback = SdoFallback::default();
        fallback.pass(Some(0));
        let frame = fallback.frame(second, NmtState::PreOperational, 2).unwrap();
        assert_eq!(frame.payload()[..4], [0x2B, 0x40, 0x68, 0]);
        fallback.receive(second, &confirmation());
        show(&mut fallback);
        assert!(!fallback.is_switched_off(), "that was the first axis");
        let confirmation =
            Frame::of(Id::canopen(function_code::SDO_RESPONSE, NODE.node), [0x60, 0x40, 0x68, 0, 0, 0, 0, 0]);
        fallback.receive(second, &confirmation);
        show(&mut fallback);
        assert!(fallback.is_switched_off());
    }

    #[test]
    fn a_stopped_node_is_sent_to_pre_operational_before_each_write() {
        let mut fallback = SdoFallback::default();
        fallback.pass(Some(0));
        let ids = [0; 3].map(|_| fallback.frame(NODE, NmtState::Stopped, 2).map(|frame| frame.id().value()));
        assert_eq!(ids, [Some(0), Some(0x605), None]);
    }
}
