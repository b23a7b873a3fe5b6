//! The controlword that a drive is to have by SDO.

use crate::cia402::controlword;
use crate::frame::{Frame, Id};
use crate::function_code;
use crate::pdo::CommandSlot;
use crate::watch::{NmtState, nmt_command};

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
pub(super) struct Address {
    pub(super) node: u8,
    pub(super) node_axis: u8,
}

/// The write of a controlword, and its confirmation.
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
    pub(super) fn pass(&mut self, wanted: Option<u16>) {
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
    pub(super) fn take_due_word(&mut self, repeat_slots: u32) -> Option<u16> {
        let Self::Writing { word, wait_slots: wait_slots @ 0, .. } = self else { return None };
        *wait_slots = repeat_slots;
        Some(*word)
    }

    /// The frame that is due, if one is. It is due again after so many slots, unless it is confirmed before.
    pub(super) fn frame(&mut self, to: Address, nmt_state: NmtState, repeat_slots: u32) -> Option<Frame> {
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
    pub(super) fn receive(&mut self, from: Address, frame: &Frame) -> Option<u16> {
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
    pub(super) fn note_torque(&mut self) {
        if let Self::Confirmed { word: word @ controlword::DISABLE_VOLTAGE, .. } = *self {
            *self = Self::Writing { word, wait_slots: SHOWING_SLOTS, is_woken: false };
        }
    }

    /// Returns `true` if the node may still be about to answer: so many slots are left until the controlword is written again.
    pub(super) fn is_asked(self, left_slots: u32) -> bool {
        matches!(self, Self::Writing { wait_slots, .. } if wait_slots > left_slots)
    }

    /// Returns `true` if the drive has confirmed that its power is to be off, and has shown no torque since.
    pub(super) fn is_switched_off(self) -> bool {
        self == Self::Confirmed { word: controlword::DISABLE_VOLTAGE, wait_slots: 0 }
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
