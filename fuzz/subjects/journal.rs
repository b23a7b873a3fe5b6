//! Fuzzes the journal of a recording, and the engine on it.

use std::sync::OnceLock;

use takt::config::Config;
use takt::journal::Journal;
use takt_tools::replay::Replay;

/// More cycles than that show nothing new.
const CYCLES: usize = 300;

/// A journal is read or refused. What is read can be replayed. Returns whether it was read.
pub fn run(bytes: &[u8]) -> bool {
    static CONFIG: OnceLock<Config> = OnceLock::new();
    let config = CONFIG.get_or_init(|| {
        Config::parse("first", include_str!("../../configs/first.toml")).expect("a shipped file")
    });
    let mut journal = Journal::default();
    if journal.add_block(bytes).is_err() {
        return false;
    }
    if let Ok(mut replay) = Replay::new(config, journal) {
        for _ in 0..CYCLES {
            if replay.step().is_none() {
                break;
            }
        }
    }
    true
}
