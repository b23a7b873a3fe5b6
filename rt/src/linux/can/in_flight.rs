//! The own frames of an interface that have not come back from the wire, in the order in which it took them.
//!
//! An interface sends its frames in the order in which it took them. So a frame that comes back shows that those before it have
//! left, or never will: the queue was emptied, the controller gave a frame up, or the adapter lost a confirmation.
//!
//! Frames may be equal, as every SYNC is. When one of them comes back, the oldest is taken for it. If that one was lost, the
//! newer one is waited for in vain, and so is every frame between them: the rest comes soon after, or never.

use arrayvec::ArrayVec;

use super::arrival::Sender;
use crate::frame::Frame;

/// The most frames that are remembered: more than a socket may have in the queues of the interfaces.
const REMEMBERED: usize = 128;

/// The readings after which a frame that was overtaken is lost: the one that brought the later frame, whose end may bring it, too.
const LOST_AFTER: u8 = 1;

/// The readings without a further frame after which the frames up to one that is equal to the last that came back are lost: two cycles.
/// Those that only wait for the wire follow it closely.
const LOST_IN_DOUBT_AFTER: u8 = 4;

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
    /// Whole readings since a frame came back that may have been a later one; `None` before that.
    in_doubt: Option<u8>,
}

impl Sent {
    const fn is_lost(&self) -> bool {
        matches!(self.overtaken, Some(LOST_AFTER..))
    }

    /// Lets a reading end. Returns `true` if the frame is lost from now on.
    fn end_reading(&mut self) -> bool {
        if let Some(readings) = &mut self.overtaken {
            *readings += 1;
            return *readings == LOST_AFTER;
        }
        if let Some(readings) = &mut self.in_doubt {
            *readings += 1;
            self.overtaken = (*readings == LOST_IN_DOUBT_AFTER).then_some(LOST_AFTER);
        }
        self.is_lost()
    }
}

impl InFlight {
    /// Adds a frame that the interface took last. If there are too many, the oldest one is forgotten.
    pub(super) fn add(&mut self, frame: Frame, sender: Sender) {
        if self.frames.is_full() {
            self.frames.remove(0);
        }
        self.frames.push(Sent { frame, sender, overtaken: None, in_doubt: None });
    }

    /// How many frames are waited for.
    pub(super) fn count(&self) -> usize {
        self.frames.iter().filter(|sent| !sent.is_lost()).count()
    }

    /// Takes a frame that has come back. Returns false if it is none of these.
    pub(super) fn take(&mut self, frame: &Frame, sender: Sender) -> bool {
        let is_same = |sent: &Sent| sent.sender == sender && sent.frame == *frame;
        let is_awaited = |sent: &Sent| !sent.is_lost() && is_same(sent);
        let awaited = self.frames.iter().position(is_awaited);
        let Some(place) = awaited.or_else(|| self.frames.iter().position(is_same)) else { return false };
        let newest = self.frames.iter().rposition(is_awaited).filter(|newest| *newest > place);
        let (earlier, rest) = self.frames.split_at_mut(place);
        if earlier.iter().all(Sent::is_lost) {
            // The queue moves on in its order.
            rest.iter_mut().for_each(|sent| sent.in_doubt = None);
        }
        earlier.iter_mut().for_each(|sent| _ = sent.overtaken.get_or_insert(0));
        let in_doubt = newest.map_or(0, |newest| newest + 1 - place);
        rest.iter_mut().take(in_doubt).for_each(|sent| _ = sent.in_doubt.get_or_insert(0));
        self.frames.remove(place);
        true
    }

    /// Lets a reading end that has read everything. Returns how many frames are lost since the one before.
    pub(super) fn end_reading(&mut self) -> usize {
        let mut lost = 0;
        self.frames.retain(|sent| {
            lost += usize::from(sent.end_reading());
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

    #[test]
    fn equal_frames_are_not_waited_for_when_one_of_them_has_come_back_and_the_rest_does_not_follow() {
        // Of three cycles on a bus whose queue was emptied, only the frame of the last one comes back.
        let mut in_flight = of(&[0, 1, 2, 0, 0]);
        assert!(in_flight.take(&frame(0), Sender::ThisSocket));
        let lost: usize = (1..LOST_IN_DOUBT_AFTER).map(|_| in_flight.end_reading()).sum();
        assert_eq!((lost, in_flight.count()), (0, 4), "they may only wait");
        assert_eq!((in_flight.end_reading(), in_flight.count()), (4, 0));
        // And so again and again where each cycle sends the same.
        for _ in 0..3 {
            for node in [0, 1, 2] {
                in_flight.add(frame(node), Sender::ThisSocket);
                assert!(in_flight.take(&frame(node), Sender::ThisSocket));
                assert_eq!((in_flight.end_reading(), in_flight.count()), (0, 0));
            }
        }
    }

    #[test]
    fn equal_frames_that_only_wait_are_not_lost_as_long_as_the_frames_before_them_come_back() {
        let mut in_flight = of(&[0, 1, 2, 0, 0, 1, 2]);
        for node in [0, 1, 2, 0, 0, 1, 2] {
            assert!(in_flight.take(&frame(node), Sender::ThisSocket));
            (1..LOST_IN_DOUBT_AFTER).for_each(|_| assert_eq!(in_flight.end_reading(), 0));
        }
        assert_eq!(in_flight.count(), 0);
    }

    proptest! {
        /// A queue of equal frames that is emptied now and then: what leaves after that ends all waiting.
        #[test]
        fn whatever_equal_frames_are_lost_nothing_is_waited_for_when_frames_come_back_again(
            steps in prop::collection::vec((0_u8..3, any::<bool>(), 0_usize..3), 1..100),
            last in 0_u8..3,
        ) {
            let (mut in_flight, mut queue) = (InFlight::default(), VecDeque::new());
            for (node, is_lost, delivered) in steps {
                in_flight.add(frame(node), Sender::ThisSocket);
                if is_lost { queue.clear() } else { queue.push_back(node) }
                for node in queue.drain(..delivered.min(queue.len())) {
                    prop_assert!(in_flight.take(&frame(node), Sender::ThisSocket));
                }
                in_flight.end_reading();
            }
            in_flight.add(frame(last), Sender::ThisSocket);
            queue.push_back(last);
            for node in queue {
                prop_assert!(in_flight.take(&frame(node), Sender::ThisSocket));
            }
            (0..LOST_IN_DOUBT_AFTER).for_each(|_| _ = in_flight.end_reading());
            prop_assert_eq!(in_flight.count(), 0);
        }

        /// A queue that loses frames, of which none are equal, and delivers each within the reading in which it is due, in any order there.
        #[test]
        fn whatever_is_lost_nothing_is_waited_for_after_a_later_frame_and_what_is_not_lost_is_own(
            steps in prop::collection::vec((0_u8..6, 0_u8..6, 0_usize..6, any::<bool>()), 1..200),
        ) {
            let (mut in_flight, mut queue, mut lost) = (InFlight::default(), VecDeque::new(), 0);
            let different = |node: u8, step: usize| Frame::of(Id::canopen(0x200, node), [step as u8]);
            for (step, (node, losing, delivered, is_reversed)) in steps.into_iter().enumerate() {
                let sender = if node % 2 == 0 { Sender::ThisSocket } else { Sender::ThisMachine };
                let sent = different(node, step);
                in_flight.add(sent, sender);
                if losing > 0 {
                    queue.push_back((sent, sender));
                } else {
                    lost += 1;
                }
                let mut back: Vec<_> = queue.drain(..delivered.min(queue.len())).collect();
                if is_reversed {
                    back.reverse();
                }
                for (sent, sender) in back {
                    prop_assert!(in_flight.take(&sent, sender));
                }
                lost -= in_flight.end_reading();
                prop_assert!((queue.len()..=queue.len() + lost).contains(&in_flight.count()));
            }
            in_flight.add(frame(9), Sender::ThisSocket);
            queue.push_back((frame(9), Sender::ThisSocket));
            for (sent, sender) in queue {
                prop_assert!(in_flight.take(&sent, sender));
            }
            lost -= in_flight.end_reading();
            prop_assert_eq!((in_flight.count(), lost), (0, 0));
        }
    }
}
