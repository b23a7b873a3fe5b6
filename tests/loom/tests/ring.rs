//! The ring between two threads, for every capacity that fills up and wraps around within a few items.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};

use loom::thread;
use takt_loom::all_relaxed;
use takt_loom::ring::ring;

/// The number of pushed items, and of attempts to pop at the same time.
const ITEMS: u64 = 4;

#[test]
fn every_accepted_item_comes_out_once_and_in_order_and_the_others_are_counted() {
    for capacity in 1..=3 {
        let fates = Arc::new(Mutex::new(BTreeSet::new()));
        let fates_so_far = Arc::clone(&fates);
        loom::model(move || {
            let (mut producer, mut consumer) = ring(capacity);
            let pushing = thread::spawn(move || {
                (0..ITEMS).map(Box::new).filter(|item| producer.push(item.clone())).collect::<Vec<_>>()
            });
            let mut popped = (0..ITEMS).filter_map(|_| consumer.pop()).collect::<Vec<_>>();
            let pushed = pushing.join().unwrap();
            popped.extend(std::iter::from_fn(|| consumer.pop()));
            assert_eq!(popped, pushed);
            let counted = pushed.len() as u64;
            assert_eq!((consumer.pushed(), consumer.dropped()), (counted, ITEMS - counted));
            fates_so_far.lock().unwrap().insert(pushed.len());
        });
        // In some schedules the consumer is too late for every item, in others for none.
        assert_eq!(*fates.lock().unwrap(), (capacity..=ITEMS as usize).collect());
    }
}

#[test]
fn the_count_of_pushed_items_is_never_larger_than_what_can_be_popped() {
    loom::model(|| {
        let (mut producer, mut consumer) = ring(2);
        let pushing = thread::spawn(move || (0..3).filter(|item| producer.push(*item)).count());
        let promised = consumer.pushed();
        assert!((0..promised).all(|_| consumer.pop().is_some()));
        pushing.join().unwrap();
    });
}

#[test]
#[should_panic(expected = "Causality violation")]
fn with_every_access_relaxed_the_ring_fails() {
    loom::model(|| {
        let (mut producer, mut consumer) = all_relaxed::ring::ring(1);
        let pushing = thread::spawn(move || producer.push(1));
        consumer.pop();
        pushing.join().unwrap();
    });
}
