//! The transmit queue of one node.

use std::collections::VecDeque;

use takt_rt::{Frame, FrameKind};

/// The order in which a node's frames go to the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QueueOrder {
    /// First in, first out, like a network interface: a high-priority frame waits behind older ones.
    FirstInFirstOut,
    /// The highest-priority identifier first, like a controller with one buffer for each message. Frames with the same
    /// identifier stay in order.
    Priority,
}

/// A bounded queue of frames that wait for the bus. It allocates its memory once.
#[derive(Debug)]
pub struct Mailbox {
    order: QueueOrder,
    frames: VecDeque<Frame>,
    capacity: usize,
    /// True if it takes CAN FD frames.
    takes_fd: bool,
}

impl Mailbox {
    /// An empty mailbox with this capacity.
    pub fn new(order: QueueOrder, capacity: usize) -> Self {
        Self { order, frames: VecDeque::with_capacity(capacity), capacity, takes_fd: true }
    }

    /// The mailbox of a node on a classic bus: it refuses CAN FD frames.
    pub fn classic(mut self) -> Self {
        self.takes_fd = false;
        self
    }

    /// Adds a frame, if there is room and the bus may carry it.
    pub fn push(&mut self, frame: Frame) -> bool {
        if self.frames.len() >= self.capacity || frame.is_fd() && !self.takes_fd {
            return false;
        }
        match self.order {
            QueueOrder::FirstInFirstOut => self.frames.push_back(frame),
            QueueOrder::Priority => {
                let own = priority(&frame);
                self.frames.insert(self.frames.partition_point(|other| priority(other) <= own), frame);
            }
        }
        true
    }

    /// Adds a frame, or replaces a waiting one with the same identifier, like a message buffer that is written again:
    /// the newest data is sent.
    pub fn put(&mut self, frame: Frame) -> bool {
        let waiting = self.frames.iter_mut().find(|waiting| waiting.id() == frame.id());
        match waiting {
            Some(waiting) if self.takes_fd || !frame.is_fd() => {
                *waiting = frame;
                true
            }
            _ => self.push(frame),
        }
    }

    /// The frame that this node offers to the arbitration.
    pub fn head(&self) -> Option<&Frame> {
        self.frames.front()
    }

    /// Removes the offered frame.
    pub fn pop(&mut self) -> Option<Frame> {
        self.frames.pop_front()
    }

    /// Number of waiting frames.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Returns `true` if no frame waits.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Discards every frame, like a controller that loses its supply.
    pub fn clear(&mut self) {
        self.frames.clear();
    }
}

/// The arbitration key: the smaller one wins. Identifier first, then data before remote (the RTR bit of data is
/// dominant).
pub(super) fn priority(frame: &Frame) -> u64 {
    frame.id().arbitration_key() << 1 | u64::from(frame.kind() == FrameKind::Remote)
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::Id;

    fn frame(id: u32, byte: u8) -> Frame {
        Frame::of(Id::base(id).unwrap(), [byte])
    }

    fn drained(mailbox: &mut Mailbox) -> Vec<(u32, u8)> {
        std::iter::from_fn(|| mailbox.pop()).map(|frame| (frame.id().value(), frame.payload()[0])).collect()
    }

    #[test]
    fn an_interface_queue_keeps_the_order_of_the_calls() {
        let mut mailbox = Mailbox::new(QueueOrder::FirstInFirstOut, 4);
        for (id, byte) in [(0x700, 1), (0x080, 2), (0x201, 3)] {
            assert!(mailbox.push(frame(id, byte)));
        }
        assert_eq!(drained(&mut mailbox), [(0x700, 1), (0x080, 2), (0x201, 3)]);
    }

    #[test]
    fn message_buffers_offer_the_highest_priority_identifier_and_keep_equal_ones_in_order() {
        let mut mailbox = Mailbox::new(QueueOrder::Priority, 4);
        for (id, byte) in [(0x700, 1), (0x081, 2), (0x181, 3), (0x081, 4)] {
            assert!(mailbox.push(frame(id, byte)));
        }
        assert_eq!(drained(&mut mailbox), [(0x081, 2), (0x081, 4), (0x181, 3), (0x700, 1)]);
    }

    #[test]
    fn a_full_mailbox_refuses_new_frames_but_accepts_a_replacement() {
        let mut mailbox = Mailbox::new(QueueOrder::Priority, 1);
        assert!(mailbox.push(frame(0x181, 1)));
        assert!(!mailbox.push(frame(0x182, 1)));
        assert!(mailbox.put(frame(0x181, 2)));
        assert_eq!(drained(&mut mailbox), [(0x181, 2)]);
    }
}
