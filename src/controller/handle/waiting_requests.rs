//! What has been asked of a controller and waits to be handed to its real-time thread. There is room for so much and no
//! more, and whoever wants the group to stop does not wait behind what others, or he himself, have asked for before.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use takt_rt::{Request, RequestEnvelope, RequestId};

/// Sixteen cycles' worth: whoever asks for more than this at once does not look at what becomes of it.
pub const REQUESTS_AT_MOST: usize = 64;

/// So many of those that a stop has overtaken are remembered.
const FORGOTTEN_AT_MOST: usize = 4 * REQUESTS_AT_MOST;

/// The requests that wait, oldest first.
#[derive(Debug, Default)]
pub struct WaitingRequests {
    waiting: Mutex<Waiting>,
}

#[derive(Debug, Default)]
struct Waiting {
    requests: VecDeque<RequestEnvelope>,
    /// Those that a stop has overtaken, the newest last.
    forgotten: VecDeque<RequestId>,
}

impl WaitingRequests {
    /// Takes a request. A stop, and a request to disable, is always taken, and what waits is forgotten for it: nothing that
    /// was asked for before is begun after it. Returns whether there was room.
    #[must_use]
    pub fn ask(&self, asked: RequestEnvelope) -> bool {
        let mut waiting = self.lock();
        if ends_motion(&asked.request) {
            waiting.forget_all_but_stops();
            if !waiting.requests.iter().any(|other| other.request == asked.request) {
                waiting.requests.push_back(asked);
            }
            return true;
        }
        let has_room = waiting.requests.len() < REQUESTS_AT_MOST;
        if has_room {
            waiting.requests.push_back(asked);
        }
        has_room
    }

    /// Hands the requests over in their order, for as long as they are taken.
    pub fn hand_over(&self, mut take: impl FnMut(RequestEnvelope) -> bool) {
        let mut waiting = self.lock();
        while waiting.requests.front().is_some_and(|asked| take(*asked)) {
            waiting.requests.pop_front();
        }
    }

    /// Whether a request has been forgotten for a stop, as far as that is remembered.
    pub fn has_forgotten(&self, request: RequestId) -> bool {
        self.lock().forgotten.contains(&request)
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        // Whatever panics meanwhile has left a queue that is whole.
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Waiting {
    fn forget_all_but_stops(&mut self) {
        let forgotten = &mut self.forgotten;
        self.requests.retain(|asked| {
            let is_kept = ends_motion(&asked.request);
            if !is_kept {
                forgotten.push_back(asked.id);
            }
            is_kept
        });
        forgotten.drain(..forgotten.len().saturating_sub(FORGOTTEN_AT_MOST));
    }
}

const fn ends_motion(request: &Request) -> bool {
    matches!(request, Request::Stop(_) | Request::Disable)
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::StopCategory;

    fn asked(id: u64, request: Request) -> RequestEnvelope {
        RequestEnvelope { id: RequestId(id), request }
    }

    /// What is handed over, the first so many.
    fn taken(waiting: &WaitingRequests, at_most: usize) -> Vec<u64> {
        let mut taken = vec![];
        waiting.hand_over(|asked| {
            let is_taken = taken.len() < at_most;
            if is_taken {
                taken.push(asked.id.0);
            }
            is_taken
        });
        taken
    }

    #[test]
    fn requests_are_handed_over_in_order_as_far_as_they_are_taken() {
        let waiting = WaitingRequests::default();
        for id in 1..=5 {
            assert!(waiting.ask(asked(id, Request::Enable)));
        }
        assert_eq!(taken(&waiting, 2), [1, 2]);
        assert_eq!(taken(&waiting, 9), [3, 4, 5]);
        assert!(taken(&waiting, 9).is_empty());
    }

    #[test]
    fn a_flood_finds_no_room_and_a_stop_overtakes_it() {
        let waiting = WaitingRequests::default();
        let flood = (1..=1_000).filter(|id| waiting.ask(asked(*id, Request::Stream))).count();
        assert_eq!(flood, REQUESTS_AT_MOST);
        assert!(waiting.ask(asked(1_001, Request::Stop(StopCategory::Two))));
        assert!(waiting.ask(asked(1_002, Request::Enable)));
        assert!(waiting.has_forgotten(RequestId(1)) && waiting.has_forgotten(RequestId(64)));
        assert!(!waiting.has_forgotten(RequestId(1_001)) && !waiting.has_forgotten(RequestId(1_002)));
        assert_eq!(taken(&waiting, 9), [1_001, 1_002]);
    }

    #[test]
    fn no_stop_takes_the_place_of_another_one_and_a_flood_of_them_is_a_few() {
        let waiting = WaitingRequests::default();
        let stops = [
            Request::Stop(StopCategory::Zero),
            Request::Disable,
            Request::Stop(StopCategory::Two),
            Request::Stop(StopCategory::One),
        ];
        for id in 0..1_000 {
            assert!(waiting.ask(asked(id, stops[id as usize % stops.len()])));
        }
        assert_eq!(taken(&waiting, 9), [0, 1, 2, 3]);
    }
}
