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

use crossbeam_utils::CachePadded;
use takt_rt::{MAX_GROUPS, Request, RequestEnvelope, RequestId, RequestTarget, StopCategory};

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
    request: AtomicCell<Option<Box<Addressed>>>,
}

/// A request, and who it is for.
type Addressed = (RequestTarget, Request);

/// The stops of one kind for one target. 0 stands for none.
struct StopWord {
    /// The newest one that was asked for.
    newest: AtomicU64,
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
    /// Those for all groups, then those for each group, in the order of [`MotionEnd::ALL`].
    stops: CachePadded<Box<[StopWord]>>,
    slots: Box<[Slot]>,
}

/// The channel for so many waiting requests (at most [`WAITING_AT_MOST`]) to so many groups, as its two ends. A single group needs no
/// stops of its own.
pub fn client_requests(
    numbers: RequestNumbers,
    waiting: usize,
    groups: usize,
) -> (ClientRequests, TakenRequests) {
    let empty = || Box::new((RequestTarget::All, Request::Sync(false)));
    let slot = || Slot { number: AtomicU64::new(0), request: AtomicCell::new(Some(empty())) };
    let targets = if groups > 1 { 1 + groups.min(MAX_GROUPS) } else { 1 };
    let stop = || StopWord { newest: AtomicU64::new(0), asked: AtomicU64::new(0), taken: AtomicU64::new(0) };
    let slots: Box<[Slot]> = (0..waiting.min(WAITING_AT_MOST)).map(|_| slot()).collect();
    let all = (0..slots.len()).fold(0, |bits, slot| bits | 1 << slot);
    let shared = Arc::new(Shared {
        numbers,
        free: CachePadded::new(AtomicU64::new(all)),
        ready: CachePadded::new(AtomicU64::new(0)),
        stops: CachePadded::new((0..targets * MotionEnd::ALL.len()).map(|_| stop()).collect()),
        slots,
    });
    let stopped = [RequestId::default(); 1 + MAX_GROUPS];
    (ClientRequests { shared: Arc::clone(&shared) }, TakenRequests { shared, stopped })
}

/// The end of the clients. Clone it for every thread.
#[derive(Clone)]
pub struct ClientRequests {
    shared: Arc<Shared>,
}

impl ClientRequests {
    /// Submits a request. `None` if too many requests wait already.
    pub fn submit_to(&self, target: RequestTarget, request: Request) -> Option<RequestId> {
        let (bit, slot) = self.claim()?;
        let id = self.shared.numbers.next();
        slot.number.store(id.0, Ordering::Relaxed);
        if let Some(mut place) = slot.request.take() {
            *place = (target, request);
            slot.request.store(Some(place));
        }
        self.shared.ready.fetch_or(bit, Ordering::Release);
        Some(id)
    }

    /// Requests a stop of all groups: see [`ClientRequests::stop_of`].
    pub fn stop(&self, end: MotionEnd) -> RequestId {
        self.stop_of(RequestTarget::All, end)
    }

    /// Requests a stop. It always finds room, and is taken before all requests that are submitted after it. A later one of the
    /// same kind takes its place if the real-time thread has not taken it yet; see [`ClientRequests::taken_as`].
    pub fn stop_of(&self, target: RequestTarget, end: MotionEnd) -> RequestId {
        let id = self.shared.numbers.next();
        if let Some(stop) = self.shared.stop(target, end) {
            stop.newest.fetch_max(id.0, Ordering::Release);
            stop.asked.fetch_max(id.0, Ordering::Release);
        }
        id
    }

    /// The stop that the real-time thread has taken for this one: itself, or a later one of its kind.
    pub fn taken_as(&self, target: RequestTarget, end: MotionEnd, id: RequestId) -> Option<RequestId> {
        let stop = self.shared.stop(target, end)?;
        let taken = RequestId(stop.taken.load(Ordering::Acquire));
        (taken >= id).then_some(taken)
    }

    /// The newest stop that the real-time thread has taken, of any kind, and that concerns requests for this target. It has discarded
    /// all of these with a smaller number that had not been taken until then.
    pub fn newest_stop(&self, target: RequestTarget) -> RequestId {
        self.newest_of(target, |stop| &stop.taken)
    }

    /// The newest stop that was asked for, of any kind, and that concerns requests for this target.
    pub fn newest_asked_stop(&self, target: RequestTarget) -> RequestId {
        self.newest_of(target, |stop| &stop.newest)
    }

    fn newest_of(&self, target: RequestTarget, number: fn(&StopWord) -> &AtomicU64) -> RequestId {
        let of_targets = self.shared.stops.chunks(MotionEnd::ALL.len()).enumerate();
        let stops = of_targets.filter(|(place, _)| concerns(*place, target)).flat_map(|(_, stops)| stops);
        let numbers = stops.map(|stop| number(stop).load(Ordering::Acquire));
        RequestId(numbers.max().unwrap_or(0))
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
    /// The newest stop that was taken for all groups, and for each. Requests with smaller numbers that it concerns are discarded.
    stopped: [RequestId; 1 + MAX_GROUPS],
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
            let target = envelope.map_or(RequestTarget::All, |envelope| envelope.target);
            let stops = self.stopped.iter().enumerate();
            if stops.filter(|(place, _)| concerns(*place, target)).all(|(_, stop)| id > *stop) {
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
        let envelope = place.as_deref().map(|(target, request)| RequestEnvelope {
            id,
            target: *target,
            request: *request,
        });
        slot.request.store(place);
        self.shared.ready.fetch_and(!bit, Ordering::Relaxed);
        self.shared.free.fetch_or(bit, Ordering::Release);
        envelope
    }

    /// The oldest stop that was asked for.
    fn take_stop(&mut self) -> Option<RequestEnvelope> {
        let asked = self.shared.stops.iter().enumerate();
        let asked = asked.map(|(place, stop)| (stop.asked.load(Ordering::Relaxed), stop, place));
        let (_, stop, place) = asked.filter(|(id, ..)| *id > 0).min_by_key(|(id, ..)| *id)?;
        let end = *MotionEnd::ALL.get(place % MotionEnd::ALL.len())?;
        let target_place = place / MotionEnd::ALL.len();
        let id = RequestId(stop.asked.swap(0, Ordering::Acquire));
        if let Some(stopped) = self.stopped.get_mut(target_place) {
            *stopped = (*stopped).max(id);
        }
        // Only this thread writes it. A stop that was numbered before the last one may be asked for after it.
        let newest = stop.taken.load(Ordering::Relaxed).max(id.0);
        stop.taken.store(newest, Ordering::Release);
        let group = target_place.checked_sub(1).and_then(|group| u8::try_from(group).ok());
        let target = group.map_or(RequestTarget::All, RequestTarget::Group);
        Some(RequestEnvelope { id, target, request: end.request() })
    }
}

impl Shared {
    fn stop(&self, target: RequestTarget, end: MotionEnd) -> Option<&StopWord> {
        let is_only_group = self.stops.len() == MotionEnd::ALL.len();
        let place = if is_only_group { 0 } else { place_of(target) };
        self.stops.get(place * MotionEnd::ALL.len() + end.number())
    }
}

/// The place of a target among the stops.
const fn place_of(target: RequestTarget) -> usize {
    match target {
        RequestTarget::All => 0,
        RequestTarget::Group(group) => 1 + group as usize,
    }
}

/// Returns `true` if the stops at a place concern the requests for a target.
fn concerns(place: usize, target: RequestTarget) -> bool {
    place == 0 || target == RequestTarget::All || place == place_of(target)
}

// A cell with a lock inside could stop the real-time thread.
const _: () = assert!(AtomicCell::<Option<Box<Addressed>>>::is_lock_free());

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicBool;
    use std::thread;

    fn channel() -> (ClientRequests, TakenRequests) {
        client_requests(RequestNumbers::default(), WAITING_AT_MOST, 2)
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
            let ids: Vec<u64> =
                (0..5).map(|n| client.submit_to(RequestTarget::All, position(n)).unwrap().0).collect();
            let expected: Vec<_> = ids.into_iter().zip((0..5).map(position)).collect();
            assert_eq!(taken(&mut rt), expected, "round {round}");
        }
    }

    #[test]
    fn a_flood_is_bounded_and_a_stop_discards_it() {
        let (client, mut rt) = channel();
        let flood: Vec<RequestId> =
            (0..1_000).filter_map(|n| client.submit_to(RequestTarget::All, position(n))).collect();
        assert_eq!(flood.len(), WAITING_AT_MOST);
        let stop = client.stop(MotionEnd::Stop(StopCategory::Two));
        assert_eq!(client.newest_stop(RequestTarget::All), RequestId(0), "it has not been taken yet");
        assert_eq!(
            taken(&mut rt),
            [(stop.0, Request::Stop(StopCategory::Two))],
            "nothing that came before it is taken"
        );
        assert_eq!(client.newest_stop(RequestTarget::All), stop);
        let after = client.submit_to(RequestTarget::All, Request::Enable).unwrap();
        assert!(flood.iter().all(|id| *id < stop) && after > stop);
        assert_eq!(taken(&mut rt), [(after.0, Request::Enable)]);
        assert_eq!(
            (0..1_000).filter_map(|n| client.submit_to(RequestTarget::All, position(n))).count(),
            WAITING_AT_MOST
        );
    }

    #[test]
    fn requests_after_a_stop_come_after_it() {
        let (client, mut rt) = channel();
        let before = client.submit_to(RequestTarget::All, position(1)).unwrap();
        let stop = client.stop(MotionEnd::Disable);
        let after = client.submit_to(RequestTarget::All, position(2)).unwrap();
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
        assert_eq!(client.taken_as(RequestTarget::All, MotionEnd::ALL[0], first), Some(later));
        assert_eq!(client.taken_as(RequestTarget::All, MotionEnd::ALL[0], RequestId(newest[3].0 + 1)), None);
    }

    #[test]
    fn a_stop_of_one_group_discards_what_was_asked_of_it_and_nothing_that_was_asked_of_another() {
        let (client, mut rt) = channel();
        let (arm, gripper) = (RequestTarget::Group(0), RequestTarget::Group(1));
        let of_arm = client.submit_to(arm, position(1)).unwrap();
        let of_gripper = client.submit_to(gripper, position(2)).unwrap();
        let of_all = client.submit_to(RequestTarget::All, Request::Enable).unwrap();
        let end = MotionEnd::Stop(StopCategory::One);
        let stop = client.stop_of(gripper, end);
        let after = client.submit_to(gripper, position(3)).unwrap();
        let taken: Vec<_> = std::iter::from_fn(|| rt.take()).collect();
        let ids: Vec<_> = taken.iter().map(|envelope| envelope.id).collect();
        assert_eq!(ids, [stop, of_arm, after]);
        assert_eq!(taken.iter().map(|envelope| envelope.target).collect::<Vec<_>>(), [gripper, arm, gripper]);
        assert_eq!((client.newest_stop(gripper), client.newest_stop(arm)), (stop, RequestId(0)));
        assert!(of_gripper < client.newest_stop(gripper) && of_all < client.newest_stop(RequestTarget::All));
        assert_eq!(client.taken_as(gripper, end, stop), Some(stop));
    }

    #[test]
    fn a_client_that_is_paused_while_it_writes_delays_no_one_else() {
        let (client, mut rt) = channel();
        let claimed = client.claim().unwrap();
        let other = client.submit_to(RequestTarget::All, position(1)).unwrap();
        let stop = client.stop(MotionEnd::Stop(StopCategory::One));
        let last = client.submit_to(RequestTarget::All, position(2)).unwrap();
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
                            while client
                                .submit_to(RequestTarget::All, position(own * EACH + number))
                                .is_none()
                            {
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
