//! The memory that the journal of a damaged file takes.

use std::path::Path;

use takt::VirtualRun;
use takt::channels::JournalEntry;
use takt::config::Config;
use takt::journal::Journal;

use crate::most_held_by;

/// The first cycles of a run of one joint.
fn block() -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/first.toml");
    let (mut run, _log) = VirtualRun::simulated(&Config::load(&path).unwrap()).unwrap();
    let (mut answers, mut journal) = (run.journal(), Journal::default());
    for _ in 0..50 {
        assert!(run.step());
    }
    answers.drain_clock(&mut journal);
    answers.drain_host(&mut journal);
    assert!(!journal.clock.is_empty() && !journal.host.is_empty());
    journal.take_block().unwrap()
}

#[test]
fn a_damaged_block_of_a_journal_takes_no_more_memory_than_entries_of_a_bit_each() {
    let block = block();
    let allowed = 8 * (size_of::<JournalEntry>() * block.len()) as i64;
    for at in 0..block.len() {
        for byte in [0, 0x7F, 0xFF, block[at] ^ 1] {
            let mut damaged = block.clone();
            damaged[at] = byte;
            let held = most_held_by(|| {
                let _ = Journal::default().add_block(&damaged);
            });
            assert!(held <= allowed, "byte {at} is {byte}: {held} bytes, allowed: {allowed}");
        }
    }
}
