//! The own frames of an interface that have not come back from the wire, in the order in which it took them.
//!
//! An interface sends its frames in the order in which it took them. So a frame that comes back shows that those before it have
//! left, or never will: the queue was emptied, the controller gave a frame up, or the adapter lost a confirmation.

use arrayvec::ArrayVec;

use super::arrival::Sender;
use crate::frame::Frame;

/// The most frames that are remembered: more than a socket may have in the queues of the interfaces.
const REMEMBERED: usize = 128;

/// The readings after which a frame that was overtaken is lost: the one that brought the later frame, whose end may bring it, too.
const LOST_AFTER: u8 = 1;

/// The readings after which a frame that was overtaken is forgotten. Until then it is recognised if it comes after all: some
/// controllers have several transmit buffers, and send from them by priority.
const FORGOTTEN_AFTER: u8 = 100;

/// The own frames that have not come back, oldest first.
#[derive(Clone, Debug, Default)]
pub(super) struct InFlight {
    frames: ArrayVec<Sent, REMEMBERED>,
}

/// A frame that the interface took.
#[derive(Clone, Copy, Debug)]
struct Sent {
    frame: Frame,
    sender: Sender,
    /// Whole readings since a later frame came back; `None` before that.
    overtaken: Option<u8>,
}

impl Sent {
    const fn is_lost(&self) -> bool {
        matches!(self.overtaken, Some(LOST_AFTER..))
    }
}

impl InFlight {
    /// Adds a frame that the interface took last. If there are too many, the oldest one is forgotten.
    pub(super) fn add(&mut self, frame: Frame, sender: Sender) {
        if self.frames.is_full() {
            self.frames.remove(0);
        }
        self.frames.push(Sent { frame, sender, overtaken: None });
    }

    /// How many frames are waited for.
    pub(super) fn count(&self) -> usize {
        self.frames.iter().filter(|sent| !sent.is_lost()).count()
    }

    /// Takes a frame that has come back. Returns false if it is none of these.
    pub(super) fn take(&mut self, frame: &Frame, sender: Sender) -> bool {
        let is_same = |sent: &Sent| sent.sender == sender && sent.frame == *frame;
        let awaited = self.frames.iter().position(|sent| !sent.is_lost() && is_same(sent));
        let Some(place) = awaited.or_else(|| self.frames.iter().position(is_same)) else { return false };
        for earlier in self.frames.iter_mut().take(place) {
            earlier.overtaken.get_or_insert(0);
        }
        self.frames.remove(place);
        true
    }

    /// Lets a reading end that has read everything. Returns how many frames are lost since the one before.
    pub(super) fn end_reading(&mut self) -> usize {
        let mut lost = 0;
        self.frames.retain(|sent| {
            if let Some(readings) = &mut sent.overtaken {
                *readings += 1;
                lost += usize::from(*readings == LOST_AFTER);
            }
            sent.overtaken.is_none_or(|readings| readings < FORGOTTEN_AFTER)
        });
        lost
    }

    /// Waits no longer for as many frames, the oldest ones first.
    pub(super) fn give_up(&mut self, frames: usize) {
        for sent in self.frames.iter_mut().filter(|sent| !sent.is_lost()).take(frames) {
            sent.overtaken = Some(LOST_AFTER);
        }
    }

    /// Forgets all frames.
    pub(super) fn clear(&mut self) {
        self.frames.clear();
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::collections::VecDeque;
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;
    use crate::frame::Id;

    fn frame(node: u8) -> Frame {
        Frame::of(Id::canopen(0x200, node), [1, 2, 3])
    }

    fn of(nodes: &[u8]) -> InFlight {
        let mut in_flight = InFlight::default();
        nodes.iter().for_each(|node| in_flight.add(frame(*node), Sender::ThisSocket));
        in_flight
    }

    #[test]
    fn a_frame_is_lost_when_a_reading_has_brought_a_later_one_and_not_this_one() {
        let mut in_flight = of(&[1, 2, 3]);
        assert!(in_flight.take(&frame(2), Sender::ThisSocket));
        assert_eq!(in_flight.count(), 2, "the reading may still bring it");
        assert_eq!((in_flight.end_reading(), in_flight.count()), (1, 1), "frame 3 is still waited for");
        (0..1_000).for_each(|_| assert_eq!(in_flight.end_reading(), 0));
        assert_eq!(in_flight.count(), 1);
    }

    #[test]
    fn a_frame_that_comes_a_little_later_than_one_behind_it_is_not_lost() {
        let mut in_flight = of(&[1, 2]);
        assert!(in_flight.take(&frame(2), Sender::ThisSocket));
        assert!(in_flight.take(&frame(1), Sender::ThisSocket));
        assert_eq!((in_flight.end_reading(), in_flight.count()), (0, 0));
    }

    #[test]
    fn a_frame_that_was_given_up_is_known_again_and_one_that_is_waited_for_is_meant_before_it() {
        let mut in_flight = of(&[1, 2]);
        in_flight.give_up(1);
        in_flight.add(frame(1), Sender::ThisSocket);
        assert_eq!(in_flight.count(), 2);
        assert!(in_flight.take(&frame(1), Sender::ThisSocket));
        assert_eq!(in_flight.count(), 1, "the second one");
        assert!(in_flight.take(&frame(1), Sender::ThisSocket));
        assert!(!in_flight.take(&frame(1), Sender::ThisSocket));
        assert!(!in_flight.take(&frame(2), Sender::ThisMachine), "it was another socket's");
    }

    proptest! {
        /// A queue that loses frames and delivers each within the reading in which it is due, in any order there.
        #[test]
        fn whatever_is_lost_nothing_is_waited_for_after_a_later_frame_and_what_is_not_lost_is_own(
            steps in prop::collection::vec((0_u8..6, 0_u8..6, 0_usize..6, any::<bool>()), 1..200),
        ) {
            let (mut in_flight, mut queue, mut lost) = (InFlight::default(), VecDeque::new(), 0);
            for (node, losing, delivered, is_reversed) in steps {
                let sender = if node % 2 == 0 { Sender::ThisSocket } else { Sender::ThisMachine };
                in_flight.add(frame(node), sender);
                if losing > 0 {
                    queue.push_back((node, sender));
                } else {
                    lost += 1;
                }
                let mut back: Vec<_> = queue.drain(..delivered.min(queue.len())).collect();
                if is_reversed {
                    back.reverse();
                }
                for (node, sender) in back {
                    prop_assert!(in_flight.take(&frame(node), sender));
                }
                lost -= in_flight.end_reading();
                prop_assert!((queue.len()..=queue.len() + lost).contains(&in_flight.count()));
            }
            in_flight.add(frame(9), Sender::ThisSocket);
            queue.push_back((9, Sender::ThisSocket));
            for (node, sender) in queue {
                prop_assert!(in_flight.take(&frame(node), sender));
            }
            lost -= in_flight.end_reading();
            prop_assert_eq!((in_flight.count(), lost), (0, 0));
        }
    }
}
