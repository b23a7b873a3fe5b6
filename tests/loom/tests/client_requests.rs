//! The requests of clients to the real-time thread. Two slots and two clients are enough for every way in which a slot changes
//! hands and in which a stop and a request can meet.

use loom::thread;
use takt_loom::all_relaxed;
use takt_loom::client_requests::{ClientRequests, MotionEnd, TakenRequests, client_requests};
use takt_loom::request_numbers::RequestNumbers;
use takt_rt::{Request, RequestTarget, StopCategory};

const STOP: MotionEnd = MotionEnd::Stop(StopCategory::Two);

fn channel(slots: usize) -> (ClientRequests, TakenRequests) {
    client_requests(RequestNumbers::default(), slots, 1)
}

fn request(counts: i32) -> Request {
    Request::Position { axis: 0, counts }
}

/// What is taken in so many attempts: the counts of requests, and 0 for a stop.
fn take(requests: &mut TakenRequests, attempts: usize) -> Vec<i32> {
    let taken = (0..attempts).filter_map(|_| requests.take());
    taken
        .map(|envelope| match envelope.request {
            Request::Position { counts, .. } => counts,
            Request::Stop(StopCategory::Two) => 0,
            other => panic!("{other:?} was never submitted"),
        })
        .collect()
}

#[test]
fn the_requests_of_two_clients_are_taken_whole_and_once() {
    loom::model(|| {
        let (first, mut rt) = channel(2);
        let second = first.clone();
        let submitting = [(first, 1), (second, 2)].map(|(client, counts)| {
            thread::spawn(move || assert!(client.submit_to(RequestTarget::All, request(counts)).is_some(), "there is room"))
        });
        let mut taken = take(&mut rt, 2);
        submitting.into_iter().for_each(|client| client.join().unwrap());
        taken.extend(take(&mut rt, 3));
        taken.sort_unstable();
        assert_eq!(taken, [1, 2]);
    });
}

#[test]
fn a_slot_is_used_again_only_after_its_request_was_taken() {
    loom::model(|| {
        let (client, mut rt) = channel(1);
        let submitting = thread::spawn(move || {
            assert!(client.submit_to(RequestTarget::All, request(1)).is_some());
            client.submit_to(RequestTarget::All, request(2)).is_some()
        });
        let mut taken = take(&mut rt, 2);
        let has_both = submitting.join().unwrap();
        taken.extend(take(&mut rt, 2));
        assert_eq!(taken, if has_both { vec![1, 2] } else { vec![1] });
    });
}

#[test]
fn a_request_after_a_stop_is_never_taken_before_it() {
    loom::model(|| {
        let (client, mut rt) = channel(1);
        let submitting = thread::spawn(move || {
            client.stop(STOP);
            client.submit_to(RequestTarget::All, request(1));
        });
        let mut taken = take(&mut rt, 2);
        submitting.join().unwrap();
        taken.extend(take(&mut rt, 2));
        assert_eq!(taken, [0, 1]);
    });
}

#[test]
fn a_request_before_a_stop_is_taken_before_it_or_discarded() {
    loom::model(|| {
        let (client, mut rt) = channel(1);
        let submitting = thread::spawn(move || {
            client.submit_to(RequestTarget::All, request(1));
            client.stop(STOP);
        });
        let mut taken = take(&mut rt, 2);
        submitting.join().unwrap();
        taken.extend(take(&mut rt, 2));
        assert!(taken == [1, 0] || taken == [0], "{taken:?}");
    });
}

#[test]
fn each_of_two_stops_at_once_is_taken_or_stands_for_the_other() {
    loom::model(|| {
        let (first, mut rt) = channel(1);
        let observer = first.clone();
        let second = first.clone();
        let stopping = [first, second].map(|client| thread::spawn(move || client.stop(STOP)));
        let mut taken = take(&mut rt, 1);
        let ids = stopping.map(|client| client.join().unwrap());
        taken.extend(take(&mut rt, 3));
        assert!(taken == [0] || taken == [0, 0], "{taken:?}");
        let newest = ids.into_iter().max().unwrap();
        assert!(ids.iter().all(|id| observer.taken_as(RequestTarget::All, STOP, *id) == Some(newest)));
        assert_eq!(observer.newest_stop(RequestTarget::All), newest);
    });
}

#[test]
#[should_panic(expected = "Causality violation")]
fn with_every_access_relaxed_the_slots_fail() {
    loom::model(|| {
        let requests = all_relaxed::client_requests::client_requests(RequestNumbers::default(), 1, 1);
        let (client, mut rt) = requests;
        let submitting = thread::spawn(move || client.submit_to(RequestTarget::All, request(1)));
        let _ = rt.take();
        submitting.join().unwrap();
    });
}
