//! Questions of clients to devices that are none of the configuration's. They wait here until the service channel has room for them.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use takt_rt::Frame;

/// Questions that can wait.
pub const QUESTIONS_AT_MOST: usize = 32;

/// The questions that wait. Clones are ends of the same queue.
#[derive(Clone, Debug, Default)]
pub struct Questions(Arc<Mutex<VecDeque<(usize, Frame)>>>);

impl Questions {
    /// Puts a question for a bus behind the others. Returns whether there was room.
    pub fn put(&self, bus: usize, frame: Frame) -> bool {
        let mut waiting = self.waiting();
        let has_room = waiting.len() < QUESTIONS_AT_MOST;
        if has_room {
            waiting.push_back((bus, frame));
        }
        has_room
    }

    /// The oldest question, with its bus.
    pub fn take(&self) -> Option<(usize, Frame)> {
        self.waiting().pop_front()
    }

    fn waiting(&self) -> MutexGuard<'_, VecDeque<(usize, Frame)>> {
        // A panic of another holder of the lock leaves whole questions.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::Id;

    #[test]
    fn questions_come_out_in_their_order_and_no_more_of_them_than_there_is_room_for() {
        let questions = Questions::default();
        let question = |node| Frame::of(Id::canopen(0x600, node), [0x40, 0, 0x10, 0, 0, 0, 0, 0]);
        let taken = (0..40).filter(|node| questions.clone().put(1, question(1 + node))).count();
        assert_eq!(taken, QUESTIONS_AT_MOST);
        let out: Vec<_> = std::iter::from_fn(|| questions.take()).collect();
        let expected: Vec<_> = (0..32).map(|node| (1, question(1 + node))).collect();
        assert_eq!(out, expected);
    }
}
