//! The mailbox of the newest value. Two words are enough for a mixture of two values. The fifth value is the second use of
//! a slot, which can tear a read.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use loom::thread;
use takt_loom::latest::{Attempt, Reader, Words, Writer, last, latest};
use takt_loom::{all_relaxed, without_fences};

const WORDS: usize = 2;

fn write(writer: &mut Writer, number: u64) {
    writer.write(|words| [number; WORDS].into_iter().for_each(|word| words.put(word)));
}

fn take(words: &mut Words<'_>) -> [u64; WORDS] {
    [(); WORDS].map(|()| words.take())
}

/// A mailbox after `written` values. All words of a value are its number.
fn mailbox(written: u64) -> (Writer, Reader) {
    let (mut writer, reader) = latest(WORDS);
    (1..=written).for_each(|number| write(&mut writer, number));
    (writer, reader)
}

/// Makes so many attempts to read. Each must give a whole and newer value, nothing, or a torn read. Returns the number of
/// the newest value and the number of torn reads.
fn follow(reader: &Reader, attempts: usize) -> (u64, u64) {
    let (mut seen, mut torn, mut is_after_torn) = (0, 0, false);
    for _ in 0..attempts {
        let attempt = reader.attempt(seen, take);
        assert!(!is_after_torn || attempt != Attempt::Nothing, "nothing new after a torn read");
        is_after_torn = attempt == Attempt::Torn;
        match attempt {
            Attempt::Whole(value, number) => {
                assert_eq!(value, [number; WORDS], "words of two values");
                assert!(number > seen, "an older value after a newer one");
                seen = number;
            }
            Attempt::Nothing => {}
            Attempt::Torn => torn += 1,
        }
    }
    (seen, torn)
}

/// One reader makes `attempts` while the mailbox goes from value `before` to value `last`. Returns the largest number of torn
/// reads of all schedules.
fn reader_beside_writer(before: u64, last: u64, attempts: usize) -> u64 {
    let worst = Arc::new(AtomicU64::new(0));
    let worst_so_far = Arc::clone(&worst);
    loom::model(move || {
        let (mut writer, reader) = mailbox(before);
        let observer = reader.clone();
        let following = thread::spawn(move || follow(&observer, attempts));
        (before + 1..=last).for_each(|number| write(&mut writer, number));
        let (_, torn) = following.join().unwrap();
        // Only three values that are completed during a read can tear it.
        assert!(torn <= (last - before) / 3, "{torn} torn reads");
        assert_eq!(reader.attempt(0, take), Attempt::Whole([last; WORDS], last));
        worst_so_far.fetch_max(torn, Ordering::Relaxed);
    });
    worst.load(Ordering::Relaxed)
}

#[test]
fn a_reader_sees_whole_values_and_each_is_newer_than_the_one_before() {
    assert_eq!(reader_beside_writer(0, 3, 3), 0);
}

#[test]
fn a_reader_whose_slot_is_used_again_sees_a_whole_value_or_a_torn_read_and_then_a_whole_value() {
    assert_eq!(reader_beside_writer(1, 5, 3), 1);
}

#[test]
fn two_readers_do_not_disturb_each_other() {
    loom::model(|| {
        let (mut writer, reader) = mailbox(1);
        let readers = [reader.clone(), reader.clone()];
        let following = readers.map(|reader| thread::spawn(move || follow(&reader, 1)));
        (2..=3).for_each(|number| write(&mut writer, number));
        for reader in following {
            let (seen, torn) = reader.join().unwrap();
            assert!(seen >= 1 && torn == 0);
        }
        assert_eq!(reader.attempt(0, take), Attempt::Whole([3; WORDS], 3));
    });
}

#[test]
fn a_reader_does_not_wait_for_a_writer_that_was_preempted_in_the_middle_of_a_value() {
    for before in 1..=5 {
        loom::model(move || {
            let (mut writer, reader) = mailbox(before);
            let reading = thread::spawn(move || follow(&reader, 2));
            writer.write(|words| {
                words.put(before + 1);
                // The rest of the value comes only when the reader has finished.
                assert_eq!(reading.join().unwrap(), (before, 0));
                words.put(before + 1);
            });
        });
    }
}

#[test]
fn a_writer_does_not_wait_for_a_reader_that_was_preempted_in_the_middle_of_a_value() {
    for (values, is_whole) in [(2, true), (3, false), (4, false)] {
        loom::model(move || {
            let (mut writer, reader) = mailbox(1);
            let attempt = reader.attempt(0, |words| {
                let first = words.take();
                let writing =
                    thread::spawn(move || (2..2 + values).for_each(|number| write(&mut writer, number)));
                // The rest of the value is read only when the writer has finished.
                writing.join().unwrap();
                [first, words.take()]
            });
            assert_eq!(attempt, if is_whole { Attempt::Whole([1; WORDS], 1) } else { Attempt::Torn });
            assert_eq!(follow(&reader, 1), (1 + values, 0));
        });
    }
}

#[test]
fn of_the_last_few_values_each_is_read_whole_or_known_to_be_lost() {
    loom::model(|| {
        let (mut writer, reader) = last(WORDS, 3);
        let reading = thread::spawn(move || {
            let (mut next, mut seen) = (1, 0);
            for _ in 0..2 {
                let completed = reader.completed();
                next = next.max(reader.oldest(completed));
                if next <= completed
                    && let Some(value) = reader.read(next, take)
                {
                    assert_eq!(value, [next; WORDS], "words of two values");
                    (next, seen) = (next + 1, seen + 1);
                }
            }
            (next, seen, reader)
        });
        (1..=4).for_each(|number| write(&mut writer, number));
        let (next, seen, reader) = reading.join().unwrap();
        assert!(seen < next);
        let rest: Vec<_> = (reader.oldest(4)..=4).map(|number| reader.read(number, take)).collect();
        assert_eq!(rest, [3, 4].map(|number| Some([number; WORDS])));
    });
}

/// The same as above, in short, for a mailbox without its ordering.
macro_rules! reader_beside_writer_of {
    ($latest:ident, $values:literal) => {
        loom::model(|| {
            let (mut writer, reader) = $latest::latest::latest(WORDS);
            let write = move |number| {
                writer.write(|words| [number; WORDS].map(|word| words.put(word)).into_iter().collect())
            };
            let reading = thread::spawn(move || {
                let attempt = reader.attempt(0, |words| [(); WORDS].map(|()| words.take()));
                if let $latest::latest::Attempt::Whole(value, number) = attempt {
                    assert_eq!(value, [number; WORDS], "words of two values");
                }
            });
            (1..=$values).for_each(write);
            reading.join().unwrap();
        })
    };
}

#[test]
#[should_panic(expected = "words of two values")]
fn without_its_fences_the_mailbox_fails() {
    reader_beside_writer_of!(without_fences, 5);
}

#[test]
#[should_panic(expected = "words of two values")]
fn with_every_access_relaxed_the_mailbox_fails() {
    reader_beside_writer_of!(all_relaxed, 1);
}
