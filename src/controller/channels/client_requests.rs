//! The requests of clients to the real-time thread, from any number of threads.
//!
//! No call waits for another thread, not even for one that is paused in the middle of a call. A client that is paused while it
//! writes a request keeps its own slot only. [`ClientRequests::stop`] does not need a slot, allocates nothing and takes no lock,
//! so it may be called in a signal handler.
//!
//! A stop discards all requests with a smaller number that the real-time thread has not taken yet, so that none of them begins
//! after the stop. The real-time thread takes a stop before all requests that were submitted after it.
//!
//! ```text
//! client:      claim a slot (free) → number → write → offer the slot (ready)
//! real time:   look for ready slots → look for stops → take the request with the smallest number → give the slot back
//! ```

use std::sync::Arc;

use crossbeam::utils::CachePadded;
use takt_rt::{Request, RequestEnvelope, RequestId, StopCategory};

use super::primitives::{AtomicCell, AtomicU64, Ordering};
use super::request_numbers::RequestNumbers;

/// The most requests that wait. The engine handles four in each cycle, so these take sixteen cycles.
pub const WAITING_AT_MOST: usize = 64;

/// What ends motions: the requests that are never refused room, and that discard those before them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionEnd {
    /// A stop.
    Stop(StopCategory),
    /// To rest, and disabled.
    Disable,
}

impl MotionEnd {
    /// Every one, in the order of their numbers.
    const ALL: [Self; 4] = [
        Self::Stop(StopCategory::Zero),
        Self::Stop(StopCategory::One),
        Self::Stop(StopCategory::Two),
        Self::Disable,
    ];

    const fn number(self) -> usize {
        match self {
            Self::Stop(StopCategory::Zero) => 0,
            Self::Stop(StopCategory::One) => 1,
            Self::Stop(StopCategory::Two) => 2,
            Self::Disable => 3,
        }
    }

    const fn request(self) -> Request {
        match self {
            Self::Stop(category) => Request::Stop(category),
            Self::Disable => Request::Disable,
        }
    }
}

/// A request and the slot that holds it. The request stays in its box, so that nothing is allocated after the start. A slot is
/// used by one thread at a time: by the client that has claimed it, or by the real-time thread once it is ready.
struct Slot {
    number: AtomicU64,
    request: AtomicCell<Option<Box<Request>>>,
}

/// The stops of one kind. 0 stands for none.
struct StopWord {
    /// The newest one that was asked for and not taken yet.
    asked: AtomicU64,
    /// The newest one that the real-time thread has taken.
    taken: AtomicU64,
}

struct Shared {
    numbers: RequestNumbers,
    /// A bit for each slot: no one uses it.
    free: CachePadded<AtomicU64>,
    /// A bit for each slot: it holds a request for the real-time thread.
    ready: CachePadded<AtomicU64>,
    stops: CachePadded<[StopWord; MotionEnd::ALL.len()]>,
    slots: Box<[Slot]>,
}

/// The channel for so many waiting requests (at most [`WAITING_AT_MOST`]), as its two ends.
pub fn client_requests(numbers: RequestNumbers, waiting: usize) -> (ClientRequests, TakenRequests) {
    let slot =
        || Slot { number: AtomicU64::new(0), request: AtomicCell::new(Some(Box::new(Request::Sync(false)))) };
    let slots: Box<[Slot]> = (0..waiting.min(WAITING_AT_MOST)).map(|_| slot()).collect();
    let all = (0..slots.len()).fold(0, |bits, slot| bits | 1 << slot);
    let shared = Arc::new(Shared {
        numbers,
        free: CachePadded::new(AtomicU64::new(all)),
        ready: CachePadded::new(AtomicU64::new(0)),
        stops: CachePadded::new(
            [(); MotionEnd::ALL.len()]
                .map(|()| StopWord { asked: AtomicU64::new(0), taken: AtomicU64::new(0) }),
        ),
        slots,
    });
    let stopped = RequestId::default();
    (ClientRequests { shared: Arc::clone(&shared) }, TakenRequests { shared, stopped })
}

/// The end of the clients. Clone it for every thread.
#[derive(Clone)]
pub struct ClientRequests {
    shared: Arc<Shared>,
}

impl ClientRequests {
    /// Submits a request. `None` if too many requests wait already.
    pub fn submit(&self, request: Request) -> Option<RequestId> {
        let (bit, slot) = self.claim()?;
        let id = self.shared.numbers.next();
        slot.number.store(id.0, Ordering::Relaxed);
        if let Some(mut place) = slot.request.take() {
            *place = request;
            slot.request.store(Some(place));
        }
        self.shared.ready.fetch_or(bit, Ordering::Release);
        Some(id)
    }

    /// Requests a stop. It always finds room, and is taken before all requests that are submitted after it. A later one of the
    /// same kind takes its place if the real-time thread has not taken it yet; see [`ClientRequests::taken_as`].
    pub fn stop(&self, end: MotionEnd) -> RequestId {
        let id = self.shared.numbers.next();
        if let Some(stop) = self.shared.stops.get(end.number()) {
            stop.asked.fetch_max(id.0, Ordering::Release);
        }
        id
    }

    /// The stop that the real-time thread has taken for this one: itself, or a later one of its kind.
    pub fn taken_as(&self, end: MotionEnd, id: RequestId) -> Option<RequestId> {
        let stop = self.shared.stops.get(end.number())?;
        let taken = RequestId(stop.taken.load(Ordering::Acquire));
        (taken >= id).then_some(taken)
    }

    /// The newest stop that the real-time thread has taken, of any kind. It has discarded all requests with a smaller number
    /// that had not been taken until then.
    pub fn newest_stop(&self) -> RequestId {
        let taken = self.shared.stops.iter().map(|stop| stop.taken.load(Ordering::Acquire));
        RequestId(taken.max().unwrap_or(0))
    }

    fn claim(&self) -> Option<(u64, &Slot)> {
        let mut free = self.shared.free.load(Ordering::Relaxed);
        loop {
            let bit = free & free.wrapping_neg();
            // With no bit left the position is 64, where there is no slot.
            let slot = self.shared.slots.get(bit.trailing_zeros() as usize)?;
            // Acquire: the real-time thread has read the request that was in the slot before.
            match self.shared.free.compare_exchange_weak(
                free,
                free & !bit,
                Ordering::Acquire,
                Ordering::Relaxed,
            ) {
                Ok(_) => return Some((bit, slot)),
                Err(now) => free = now,
            }
        }
    }
}

/// The end of the real-time thread.
pub struct TakenRequests {
    shared: Arc<Shared>,
    /// The newest stop that was taken. Requests with smaller numbers are discarded.
    stopped: RequestId,
}

impl TakenRequests {
    /// The next request. A stop comes before the requests that were submitted after it.
    pub fn take(&mut self) -> Option<RequestEnvelope> {
        loop {
            // The slots come first: whoever submits after a stop makes the stop visible together with the request.
            let mut ready = self.shared.ready.load(Ordering::Acquire);
            if let Some(stop) = self.take_stop() {
                return Some(stop);
            }
            let (id, slot) = self.oldest(&mut ready)?;
            let envelope = self.empty(id, slot, ready);
            if id > self.stopped {
                return envelope;
            }
        }
    }

    /// The oldest request of the slots in `ready`, and its slot. Leaves its bit alone in `ready`.
    fn oldest(&self, ready: &mut u64) -> Option<(RequestId, &Slot)> {
        let mut oldest: Option<(RequestId, &Slot)> = None;
        let mut left = std::mem::take(ready);
        while left != 0 {
            let bit = left & left.wrapping_neg();
            left &= !bit;
            let slot = self.shared.slots.get(bit.trailing_zeros() as usize)?;
            let id = RequestId(slot.number.load(Ordering::Relaxed));
            if oldest.is_none_or(|(other, _)| id < other) {
                oldest = Some((id, slot));
                *ready = bit;
            }
        }
        oldest
    }

    /// Copies the request of a slot, and gives the slot back to the clients.
    fn empty(&self, id: RequestId, slot: &Slot, bit: u64) -> Option<RequestEnvelope> {
        let place = slot.request.take();
        let envelope = place.as_ref().map(|request| RequestEnvelope { id, request: **request });
        slot.request.store(place);
        self.shared.ready.fetch_and(!bit, Ordering::Relaxed);
        self.shared.free.fetch_or(bit, Ordering::Release);
        envelope
    }

    /// The oldest stop that was asked for.
    fn take_stop(&mut self) -> Option<RequestEnvelope> {
        let asked = self.shared.stops.iter().zip(MotionEnd::ALL);
        let asked = asked.map(|(stop, end)| (stop.asked.load(Ordering::Relaxed), stop, end));
        let (_, stop, end) = asked.filter(|(id, ..)| *id > 0).min_by_key(|(id, ..)| *id)?;
        let id = RequestId(stop.asked.swap(0, Ordering::Acquire));
        self.stopped = self.stopped.max(id);
        // Only this thread writes it. A stop that was numbered before the last one may be asked for after it.
        let newest = stop.taken.load(Ordering::Relaxed).max(id.0);
        stop.taken.store(newest, Ordering::Release);
        Some(RequestEnvelope { id, request: end.request() })
    }
}

// A cell with a lock inside could stop the real-time thread.
const _: () = assert!(AtomicCell::<Option<Box<Request>>>::is_lock_free());

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicBool;
    use std::thread;

    fn channel() -> (ClientRequests, TakenRequests) {
        client_requests(RequestNumbers::default(), WAITING_AT_MOST)
    }

    fn position(counts: i32) -> Request {
        Request::Position { axis: 0, counts }
    }

    fn taken(requests: &mut TakenRequests) -> Vec<(u64, Request)> {
        std::iter::from_fn(|| requests.take()).map(|envelope| (envelope.id.0, envelope.request)).collect()
    }

    #[test]
    fn requests_are_taken_in_the_order_of_their_numbers() {
        let (client, mut rt) = channel();
        for round in 0..3 {
            let ids: Vec<u64> = (0..5).map(|n| client.submit(position(n)).unwrap().0).collect();
            let expected: Vec<_> = ids.into_iter().zip((0..5).map(position)).collect();
            assert_eq!(taken(&mut rt), expected, "round {round}");
        }
    }

    #[test]
    fn a_flood_is_bounded_and_a_stop_discards_it() {
        let (client, mut rt) = channel();
        let flood: Vec<RequestId> = (0..1_000).filter_map(|n| client.submit(position(n))).collect();
        assert_eq!(flood.len(), WAITING_AT_MOST);
        let stop = client.stop(MotionEnd::Stop(StopCategory::Two));
        assert_eq!(client.newest_stop(), RequestId(0), "it has not been taken yet");
        assert_eq!(
            taken(&mut rt),
            [(stop.0, Request::Stop(StopCategory::Two))],
            "nothing that came before it is taken"
        );
        assert_eq!(client.newest_stop(), stop);
        let after = client.submit(Request::Enable).unwrap();
        assert!(flood.iter().all(|id| *id < stop) && after > stop);
        assert_eq!(taken(&mut rt), [(after.0, Request::Enable)]);
        assert_eq!((0..1_000).filter_map(|n| client.submit(position(n))).count(), WAITING_AT_MOST);
    }

    #[test]
    fn requests_after_a_stop_come_after_it() {
        let (client, mut rt) = channel();
        let before = client.submit(position(1)).unwrap();
        let stop = client.stop(MotionEnd::Disable);
        let after = client.submit(position(2)).unwrap();
        assert!(before < stop && stop < after);
        assert_eq!(taken(&mut rt), [(stop.0, Request::Disable), (after.0, position(2))]);
    }

    #[test]
    fn stops_of_different_kinds_do_not_replace_one_another_and_a_flood_of_stops_is_one_of_each_kind() {
        let (client, mut rt) = channel();
        let mut newest = [RequestId(0); 4];
        for number in 0..1_000 {
            let end = MotionEnd::ALL[number % 4];
            newest[end.number()] = client.stop(end);
        }
        let expected: Vec<_> =
            MotionEnd::ALL.iter().map(|end| (newest[end.number()].0, end.request())).collect();
        assert_eq!(taken(&mut rt), expected);
        let (first, later) = (RequestId(1), newest[0]);
        assert_eq!(client.taken_as(MotionEnd::ALL[0], first), Some(later));
        assert_eq!(client.taken_as(MotionEnd::ALL[0], RequestId(newest[3].0 + 1)), None);
    }

    #[test]
    fn a_client_that_is_paused_while_it_writes_delays_no_one_else() {
        let (client, mut rt) = channel();
        let claimed = client.claim().unwrap();
        let other = client.submit(position(1)).unwrap();
        let stop = client.stop(MotionEnd::Stop(StopCategory::One));
        let last = client.submit(position(2)).unwrap();
        assert!(other < stop);
        assert_eq!(taken(&mut rt), [(stop.0, Request::Stop(StopCategory::One)), (last.0, position(2))]);
        client.shared.free.fetch_or(claimed.0, Ordering::Release);
    }

    #[test]
    fn many_clients_lose_no_request_and_each_is_taken_in_its_own_order() {
        const CLIENTS: i32 = 4;
        const EACH: i32 = 5_000;
        let (client, mut rt) = channel();
        let is_over = AtomicBool::new(false);
        thread::scope(|scope| {
            let sending: Vec<_> = (0..CLIENTS)
                .map(|own| {
                    let client = client.clone();
                    scope.spawn(move || {
                        for number in 0..EACH {
                            while client.submit(position(own * EACH + number)).is_none() {
                                thread::yield_now();
                            }
                        }
                    })
                })
                .collect();
            let taking = scope.spawn(|| {
                let mut next = [0; CLIENTS as usize];
                loop {
                    let was_over = is_over.load(Ordering::Acquire);
                    let Some(envelope) = rt.take() else {
                        if was_over {
                            return next;
                        }
                        thread::yield_now();
                        continue;
                    };
                    let Request::Position { counts, .. } = envelope.request else { unreachable!() };
                    let own = &mut next[(counts / EACH) as usize];
                    assert_eq!(counts % EACH, *own);
                    *own += 1;
                }
            });
            sending.into_iter().for_each(|sending| sending.join().unwrap());
            is_over.store(true, Ordering::Release);
            assert_eq!(taking.join().unwrap(), [EACH; CLIENTS as usize]);
        });
    }
}
