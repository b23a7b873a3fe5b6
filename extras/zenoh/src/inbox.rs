//! The messages that wait to be carried out.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Messages that wait, at most.
const WAITING_AT_MOST: usize = 8;

/// Messages from zenoh to the thread that carries them out. A full inbox loses its oldest message, and a stop discards all of them: so
/// neither waits for what was sent before it.
pub struct Inbox<M> {
    waiting: Mutex<Waiting<M>>,
    arrived: Condvar,
}

struct Waiting<M> {
    messages: VecDeque<M>,
    stops: u64,
}

/// A message that was taken out, and how many stops had come by then.
#[derive(Debug, PartialEq, Eq)]
pub struct Taken<M> {
    /// The message.
    pub message: M,
    /// The stops.
    pub stops: u64,
}

impl<M> Default for Inbox<M> {
    fn default() -> Self {
        Self { waiting: Mutex::new(Waiting { messages: VecDeque::new(), stops: 0 }), arrived: Condvar::new() }
    }
}

impl<M> Inbox<M> {
    /// Puts a message behind those that wait. Returns `false` if the oldest one was lost for it.
    #[must_use]
    pub fn put(&self, message: M) -> bool {
        let mut waiting = self.lock();
        let is_full = waiting.messages.len() >= WAITING_AT_MOST;
        if is_full {
            waiting.messages.pop_front();
        }
        waiting.messages.push_back(message);
        self.arrived.notify_one();
        !is_full
    }

    /// Counts a stop, and discards all messages that wait. Returns how many these were.
    pub fn stop(&self) -> usize {
        let mut waiting = self.lock();
        waiting.stops += 1;
        let discarded = waiting.messages.len();
        waiting.messages.clear();
        discarded
    }

    /// The oldest message; `None` if none has come within a time.
    pub fn take(&self, at_most: Duration) -> Option<Taken<M>> {
        let is_empty = |waiting: &mut Waiting<M>| waiting.messages.is_empty();
        let waited = self.arrived.wait_timeout_while(self.lock(), at_most, is_empty);
        let (mut waiting, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let stops = waiting.stops;
        waiting.messages.pop_front().map(|message| Taken { message, stops })
    }

    /// Number of stops received.
    pub fn stops(&self) -> u64 {
        self.lock().stops
    }

    /// A panic of another holder of the lock leaves the messages as they are.
    fn lock(&self) -> MutexGuard<'_, Waiting<M>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(inbox: &Inbox<u8>) -> Vec<u8> {
        std::iter::from_fn(|| inbox.take(Duration::ZERO)).map(|taken| taken.message).collect()
    }

    #[test]
    fn a_full_inbox_loses_its_oldest_message() {
        let inbox = Inbox::default();
        let put: Vec<bool> = (0..10).map(|number| inbox.put(number)).collect();
        assert_eq!(put.iter().filter(|has_room| !**has_room).count(), 2);
        assert_eq!(all(&inbox), [2, 3, 4, 5, 6, 7, 8, 9]);
    }

    #[test]
    fn a_stop_overtakes_every_message_that_waits_and_those_that_come_after_it_stay() {
        let inbox = Inbox::default();
        for number in 0..20 {
            let _ = inbox.put(number);
        }
        assert_eq!(inbox.stop(), 8);
        assert!(inbox.put(100));
        assert!(inbox.put(101));
        assert_eq!(inbox.take(Duration::ZERO), Some(Taken { message: 100, stops: 1 }));
        assert_eq!((all(&inbox), inbox.stops()), (vec![101], 1));
        assert_eq!(inbox.stop(), 0);
        assert_eq!(inbox.stops(), 2);
    }

    #[test]
    fn a_message_wakes_the_thread_that_waits_for_it() {
        let inbox = Inbox::default();
        assert_eq!(inbox.take(Duration::from_millis(1)), None);
        std::thread::scope(|scope| {
            let taking = scope.spawn(|| inbox.take(Duration::from_secs(30)));
            assert!(inbox.put(7));
            assert_eq!(taking.join().unwrap().map(|taken| taken.message), Some(7));
        });
    }
}
