//! The frames of one node that wait for the bus.

use std::collections::VecDeque;

use takt_rt::{Frame, FrameKind};

/// In which order a node's frames go to the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// The oldest first, like the queue of a network interface: an urgent frame waits behind the others.
    FirstInFirstOut,
    /// The identifier that wins arbitration first, like a controller with a buffer for each message; frames of
    /// one identifier stay in order.
    Priority,
}

/// A bounded queue of frames that wait for the bus. It takes its memory once.
#[derive(Debug)]
pub struct Mailbox {
    order: Order,
    frames: VecDeque<Frame>,
    capacity: usize,
}

impl Mailbox {
    /// An empty mailbox for so many frames.
    pub fn new(order: Order, capacity: usize) -> Self {
        Self { order, frames: VecDeque::with_capacity(capacity), capacity }
    }

    /// Takes a frame, if there is room.
    pub fn push(&mut self, frame: Frame) -> bool {
        if self.frames.len() >= self.capacity {
            return false;
        }
        let at = match self.order {
            Order::FirstInFirstOut => self.frames.len(),
            Order::Priority => self.frames.partition_point(|other| priority(other) <= priority(&frame)),
        };
        self.frames.insert(at, frame);
        true
    }

    /// Takes a frame in place of an older one of the same identifier that still waits, as a message buffer that is
    /// written again does: what is sent is always the newest.
    pub fn put(&mut self, frame: Frame) -> bool {
        if let Some(waiting) = self.frames.iter_mut().find(|waiting| waiting.id() == frame.id()) {
            *waiting = frame;
            return true;
        }
        self.push(frame)
    }

    /// The frame that this node offers to the bus.
    pub fn head(&self) -> Option<&Frame> {
        self.frames.front()
    }

    /// Takes the offered frame away.
    pub fn pop(&mut self) -> Option<Frame> {
        self.frames.pop_front()
    }

    /// How many frames wait.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Forgets every frame, as a controller that loses its supply does.
    pub fn clear(&mut self) {
        self.frames.clear();
    }
}

/// The smaller wins arbitration: the identifier, then a data frame against a remote one (its RTR bit is dominant).
pub(super) fn priority(frame: &Frame) -> (u64, bool) {
    (frame.id().arbitration_key(), frame.kind() == FrameKind::Remote)
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
        let mut mailbox = Mailbox::new(Order::FirstInFirstOut, 4);
        for (id, byte) in [(0x700, 1), (0x080, 2), (0x201, 3)] {
            assert!(mailbox.push(frame(id, byte)));
        }
        assert_eq!(drained(&mut mailbox), [(0x700, 1), (0x080, 2), (0x201, 3)]);
    }

    #[test]
    fn message_buffers_offer_the_strongest_identifier_and_keep_equal_ones_in_order() {
        let mut mailbox = Mailbox::new(Order::Priority, 4);
        for (id, byte) in [(0x700, 1), (0x081, 2), (0x181, 3), (0x081, 4)] {
            assert!(mailbox.push(frame(id, byte)));
        }
        assert_eq!(drained(&mut mailbox), [(0x081, 2), (0x081, 4), (0x181, 3), (0x700, 1)]);
    }

    #[test]
    fn a_full_mailbox_refuses_and_a_rewritten_buffer_needs_no_room() {
        let mut mailbox = Mailbox::new(Order::Priority, 1);
        assert!(mailbox.push(frame(0x181, 1)));
        assert!(!mailbox.push(frame(0x182, 1)));
        assert!(mailbox.put(frame(0x181, 2)));
        assert_eq!(drained(&mut mailbox), [(0x181, 2)]);
    }
}
