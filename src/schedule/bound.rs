//! The response time of every message of a bus, with its senders as they are.
//!
//! The analysis of `response_time` takes each node to offer its most important frame first. Drives do, since they have
//! a buffer for each message. The controller's frames stand in the queue of a network interface, first in, first out:
//! one that is important waits there behind others that are not (R. Davis, S. Kollmann, V. Pollex and F. Slomka,
//! "Controller Area Network (CAN) schedulability analysis with FIFO queues", ECRTS 2011). Which ones can stand before
//! it is known from the order within the cycle, so for a frame of ours those count as more important, and it competes
//! with the identifier of the least important of them.

use takt_wire::frame_time::{BitRates, worst_case_bits};

use super::messages::{BusMessage, MessageKind};
use super::response_time::{Message, response_time};

/// The messages that are analysed together, highest priority first.
#[derive(Clone, Copy)]
pub(super) struct Traffic<'a> {
    pub messages: &'a [&'a BusMessage],
    /// True if everything that the controller queues in a slot leaves before the next SYNC.
    pub is_queue_empty_at_sync: bool,
    pub rates: BitRates,
}

impl Traffic<'_> {
    /// The longest time from the event that queues the message at this place until it has been received; `None` where
    /// there is no bound.
    pub fn response_time(&self, at: usize) -> Option<u64> {
        let own = self.messages.get(at)?;
        if own.kind.is_ours() { self.of_ours(at, own) } else { self.of_a_drive(at, own) }
    }

    fn of_ours(&self, at: usize, own: &BusMessage) -> Option<u64> {
        let stands_before = |index: usize, other: &BusMessage| index != at && self.stands_before(other, own);
        let each = || self.messages.iter().enumerate();
        let place =
            each().filter(|(i, other)| *i == at || stands_before(*i, other)).map(|(index, _)| index).max()?;
        let goes_first = |index: usize, other: &BusMessage| {
            stands_before(index, other) || (!other.kind.is_ours() && index < place)
        };
        let select = |is_first: bool| {
            each()
                .filter(move |(index, other)| *index != at && goes_first(*index, other) == is_first)
                .map(|(_, other)| self.message(other, 0))
        };
        let mut set: Vec<Message> = select(true).collect();
        let own_place = set.len();
        set.push(self.message(own, 0));
        set.extend(select(false));
        response_time(&set, own_place, self.rates.bit_ns())
    }

    /// A frame of ours that has waited behind others follows the next of its kind more closely.
    fn of_a_drive(&self, at: usize, own: &BusMessage) -> Option<u64> {
        let mut set = Vec::with_capacity(self.messages.len());
        for (index, other) in self.messages.iter().enumerate().take(at) {
            let can_wait =
                other.kind.is_ours() && (other.kind.is_background() || !self.is_queue_empty_at_sync);
            let waited_ns = if can_wait {
                self.of_ours(index, other)?.saturating_sub(self.time(other) + other.jitter_ns)
            } else {
                0
            };
            set.push(self.message(other, waited_ns));
        }
        set.push(self.message(own, 0));
        set.extend(self.messages.iter().skip(at + 1).map(|other| self.message(other, 0)));
        response_time(&set, at, self.rates.bit_ns())
    }

    /// Returns `true` if another frame of ours can stand in the queue before this one: SYNC is queued at the start of the slot,
    /// the set-points in the order of the axes in the command phase, and the background after them.
    fn stands_before(&self, other: &BusMessage, own: &BusMessage) -> bool {
        if !other.kind.is_ours() {
            return false;
        }
        let is_before_in_slot = match own.kind {
            MessageKind::Sync => false,
            MessageKind::SetPoint => match other.kind {
                MessageKind::Sync => true,
                MessageKind::SetPoint => other.axis < own.axis,
                _ => false,
            },
            _ => true,
        };
        is_before_in_slot || !self.is_queue_empty_at_sync
    }

    fn message(&self, message: &BusMessage, waited_ns: u64) -> Message {
        Message {
            period_ns: message.period_ns,
            jitter_ns: message.jitter_ns + waited_ns,
            transmission_ns: self.time(message),
        }
    }

    fn time(&self, message: &BusMessage) -> u64 {
        self.rates.duration_ns(worst_case_bits(message.shape))
    }
}
