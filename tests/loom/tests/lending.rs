//! What the real-time thread borrows and gives back. One slot, used twice, and two clients are enough for every way in which a slot
//! changes hands.

use loom::thread;
use takt_loom::lent::lending::{Borrower, Lender, lending};
use takt_loom::lent_relaxed as relaxed;

/// Gives back all that is held.
fn give_back(borrower: &mut Borrower<u64>) {
    borrower.keep(|_, _| false);
}

fn collected(lender: &Lender<u64>) -> Vec<u64> {
    let mut all = vec![];
    lender.collect(|thing| all.push(*thing));
    all
}

#[test]
fn a_thing_is_borrowed_whole_and_comes_back_once() {
    loom::model(|| {
        let (lender, mut borrower) = lending(1);
        let id = lender.lend(Box::new(7)).unwrap();
        let collecting = lender.clone();
        let collecting = thread::spawn(move || collected(&collecting));
        assert_eq!(borrower.borrow(id).copied(), Some(7));
        *borrower.borrow(id).unwrap() = 8;
        give_back(&mut borrower);
        let mut back = collecting.join().unwrap();
        back.extend(collected(&lender));
        assert_eq!(back, [8], "as the real-time thread has left it, and once");
        assert_eq!(borrower.borrow(id), None);
    });
}

#[test]
fn a_thing_that_is_lent_meanwhile_is_found_whole_or_not_yet() {
    loom::model(|| {
        let (lender, mut borrower) = lending(1);
        let lending = thread::spawn(move || (lender.lend(Box::new(7)).unwrap(), lender));
        // Numbers are counted from 1.
        let early = borrower.borrow(1).copied();
        assert!(early.is_none_or(|thing| thing == 7));
        let (id, _lender) = lending.join().unwrap();
        assert_eq!((id, borrower.borrow(id).copied()), (1, Some(7)));
    });
}

#[test]
fn two_clients_never_use_the_same_slot() {
    loom::model(|| {
        let (first, mut borrower) = lending(1);
        let second = first.clone();
        let lent = [(first.clone(), 1), (second, 2)]
            .map(|(lender, thing)| thread::spawn(move || (lender.lend(Box::new(thing)), thing)))
            .map(|lending| lending.join().unwrap());
        let granted: Vec<(u64, u64)> =
            lent.iter().filter_map(|(lent, thing)| Some((*lent.as_ref().ok()?, *thing))).collect();
        let [(id, thing)] = granted[..] else { panic!("one has found the slot: {granted:?}") };
        assert!(lent.iter().all(|(lent, thing)| lent.as_ref().err().is_none_or(|back| **back == *thing)));
        assert_eq!(borrower.borrow(id).copied(), Some(thing));
    });
}

#[test]
fn a_slot_is_used_again_only_when_its_thing_has_come_back_and_an_old_number_finds_nothing() {
    loom::model(|| {
        let (lender, mut borrower) = lending(1);
        let first = lender.lend(Box::new(1)).unwrap();
        assert_eq!(borrower.borrow(first).copied(), Some(1));
        let client = thread::spawn(move || {
            let back = collected(&lender);
            (back, lender.lend(Box::new(2)).ok(), lender)
        });
        give_back(&mut borrower);
        assert_eq!(borrower.borrow(first), None);
        let (back, second, lender) = client.join().unwrap();
        match second {
            Some(second) => {
                assert_eq!((back, borrower.borrow(second).copied()), (vec![1], Some(2)));
            }
            None => assert_eq!((back, collected(&lender)), (vec![], vec![1])),
        }
    });
}

#[test]
fn a_thing_that_is_taken_back_while_it_is_asked_for_is_with_one_side() {
    loom::model(|| {
        let (lender, mut borrower) = lending(1);
        let id = lender.lend(Box::new(7)).unwrap();
        let taking_back = thread::spawn(move || (lender.take_back(id), lender));
        let borrowed = borrower.borrow(id).copied();
        give_back(&mut borrower);
        let (taken_back, lender) = taking_back.join().unwrap();
        assert_eq!(borrowed.or(taken_back.as_deref().copied()), Some(7));
        assert!(borrowed.is_none() || taken_back.is_none(), "both have it");
        assert_eq!(collected(&lender), borrowed.into_iter().collect::<Vec<_>>());
        assert!(lender.lend(Box::new(8)).is_ok(), "the slot is free again");
    });
}

#[test]
fn two_clients_that_collect_get_a_thing_once() {
    loom::model(|| {
        let (lender, mut borrower) = lending(1);
        let id = lender.lend(Box::new(7)).unwrap();
        assert!(borrower.borrow(id).is_some());
        let other = lender.clone();
        let collecting = thread::spawn(move || collected(&other));
        give_back(&mut borrower);
        let mut all = collected(&lender);
        all.extend(collecting.join().unwrap());
        all.extend(collected(&lender));
        assert_eq!(all, [7]);
    });
}

#[test]
#[should_panic(expected = "Causality violation")]
fn with_every_access_relaxed_lending_fails() {
    loom::model(|| {
        let (lender, mut borrower) = relaxed::lending::lending(1);
        let lending = thread::spawn(move || lender.lend(Box::new(7)).unwrap());
        assert!(borrower.borrow(1).copied().is_none_or(|thing: u64| thing == 7));
        lending.join().unwrap();
    });
}
