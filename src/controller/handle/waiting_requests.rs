//! The requests that wait to be handed to the real-time thread. Their number is bounded. A stop does not wait behind earlier
//! requests: it discards them.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use takt_rt::{Request, RequestEnvelope, RequestId};

/// The most requests that wait. The engine handles four in each cycle, so these take sixteen cycles.
pub const REQUESTS_AT_MOST: usize = 64;

/// The most discarded requests that are remembered.
const DISCARDED_AT_MOST: usize = 4 * REQUESTS_AT_MOST;

/// The requests that wait, oldest first.
#[derive(Debug, Default)]
pub struct WaitingRequests {
    waiting: Mutex<Waiting>,
}

#[derive(Debug, Default)]
struct Waiting {
    requests: VecDeque<RequestEnvelope>,
    /// The requests that a stop has discarded, the newest last.
    discarded: VecDeque<RequestId>,
}

impl WaitingRequests {
    /// Adds a request. A stop, or a request to disable, is always added. It discards the waiting requests, so that none of them
    /// begins after the stop. Returns whether there was room.
    #[must_use]
    pub fn submit(&self, envelope: RequestEnvelope) -> bool {
        let mut waiting = self.lock();
        if ends_motion(&envelope.request) {
            waiting.discard_all_but_stops();
            if !waiting.requests.iter().any(|other| other.request == envelope.request) {
                waiting.requests.push_back(envelope);
            }
            return true;
        }
        let has_room = waiting.requests.len() < REQUESTS_AT_MOST;
        if has_room {
            waiting.requests.push_back(envelope);
        }
        has_room
    }

    /// Passes the requests to `accept` in their order, until it returns `false`.
    pub fn hand_over(&self, mut accept: impl FnMut(RequestEnvelope) -> bool) {
        let mut waiting = self.lock();
        while waiting.requests.front().is_some_and(|envelope| accept(*envelope)) {
            waiting.requests.pop_front();
        }
    }

    /// Whether a stop has discarded a request. Only the last discarded requests are remembered.
    pub fn is_discarded(&self, request: RequestId) -> bool {
        self.lock().discarded.contains(&request)
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        // A panic of another holder of the lock leaves the queue consistent.
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Waiting {
    fn discard_all_but_stops(&mut self) {
        let discarded = &mut self.discarded;
        self.requests.retain(|envelope| {
            let is_kept = ends_motion(&envelope.request);
            if !is_kept {
                discarded.push_back(envelope.id);
            }
            is_kept
        });
        discarded.drain(..discarded.len().saturating_sub(DISCARDED_AT_MOST));
    }
}

const fn ends_motion(request: &Request) -> bool {
    matches!(request, Request::Stop(_) | Request::Disable)
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::StopCategory;

    fn envelope(id: u64, request: Request) -> RequestEnvelope {
        RequestEnvelope { id: RequestId(id), request }
    }

    /// The requests that are handed over, at most so many.
    fn taken(waiting: &WaitingRequests, at_most: usize) -> Vec<u64> {
        let mut taken = vec![];
        waiting.hand_over(|envelope| {
            let is_taken = taken.len() < at_most;
            if is_taken {
                taken.push(envelope.id.0);
            }
            is_taken
        });
        taken
    }

    #[test]
    fn requests_are_handed_over_in_order_until_one_is_not_accepted() {
        let waiting = WaitingRequests::default();
        for id in 1..=5 {
            assert!(waiting.submit(envelope(id, Request::Enable)));
        }
        assert_eq!(taken(&waiting, 2), [1, 2]);
        assert_eq!(taken(&waiting, 9), [3, 4, 5]);
        assert!(taken(&waiting, 9).is_empty());
    }

    #[test]
    fn a_flood_is_bounded_and_a_stop_discards_it() {
        let waiting = WaitingRequests::default();
        let flood = (1..=1_000).filter(|id| waiting.submit(envelope(*id, Request::Stream))).count();
        assert_eq!(flood, REQUESTS_AT_MOST);
        assert!(waiting.submit(envelope(1_001, Request::Stop(StopCategory::Two))));
        assert!(waiting.submit(envelope(1_002, Request::Enable)));
        assert!(waiting.is_discarded(RequestId(1)) && waiting.is_discarded(RequestId(64)));
        assert!(!waiting.is_discarded(RequestId(1_001)) && !waiting.is_discarded(RequestId(1_002)));
        assert_eq!(taken(&waiting, 9), [1_001, 1_002]);
    }

    #[test]
    fn stops_do_not_replace_one_another_and_a_flood_of_stops_is_one_of_each_kind() {
        let waiting = WaitingRequests::default();
        let stops = [
            Request::Stop(StopCategory::Zero),
            Request::Disable,
            Request::Stop(StopCategory::Two),
            Request::Stop(StopCategory::One),
        ];
        for id in 0..1_000 {
            assert!(waiting.submit(envelope(id, stops[id as usize % stops.len()])));
        }
        assert_eq!(taken(&waiting, 9), [0, 1, 2, 3]);
    }
}
