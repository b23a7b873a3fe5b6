//! Storms: random programs, requests and faults on the whole controller against the simulated drives, in virtual time.
//!
//! `TAKT_STORM_CYCLES=100000000` for a long one, `TAKT_STORM_SEED=…` for one case again, `TAKT_STORM_TABLE=1` for the
//! table of reactions.

mod bounds;
mod case;
mod client;
mod dice;
mod invariants;
mod regressions;
mod run;
mod table;
mod tap;
mod weather;

use std::panic::{AssertUnwindSafe, catch_unwind};

use case::Case;
use run::{Done, play};

/// In all of the shards together.
const CYCLES: u64 = 1_040_000;
const SHARDS: u64 = 8;
/// So many failures are told of at once.
const FAILURES_AT_MOST: usize = 5;

fn number(variable: &str) -> Option<u64> {
    let text = std::env::var(variable).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{variable}={text} is no number")))
}

fn attempt(seed: u64) -> Result<Done, String> {
    let played = catch_unwind(AssertUnwindSafe(|| {
        let case = Case::of(seed);
        play(&case).map_err(|wrong| format!("{} {wrong}\n{}", case.name, case.text))
    }));
    played
        .unwrap_or_else(|_| Err("it panics".to_owned()))
        .map_err(|wrong| format!("TAKT_STORM_SEED={seed}: {wrong}"))
}

/// Every so many seeds from one on, until there have been enough cycles.
fn weather(shard: u64) {
    let only = number("TAKT_STORM_SEED");
    let budget = number("TAKT_STORM_CYCLES").unwrap_or(CYCLES) / SHARDS;
    let (mut cycles, mut failures) = (0, vec![]);
    for seed in (shard..).step_by(SHARDS as usize) {
        if cycles >= budget || failures.len() >= FAILURES_AT_MOST || only.is_some_and(|only| only < seed) {
            break;
        }
        if only.is_some_and(|only| only != seed) {
            continue;
        }
        match attempt(seed) {
            Ok(done) => cycles += done.cycles,
            Err(failure) => failures.push(failure),
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    eprintln!("{cycles} cycles");
}

macro_rules! shards {
    ($($name:ident: $shard:literal,)*) => {$(
        #[test]
        fn $name() {
            weather($shard);
        }
    )*};
}

shards! {
    the_invariants_hold_in_every_storm_0: 0,
    the_invariants_hold_in_every_storm_1: 1,
    the_invariants_hold_in_every_storm_2: 2,
    the_invariants_hold_in_every_storm_3: 3,
    the_invariants_hold_in_every_storm_4: 4,
    the_invariants_hold_in_every_storm_5: 5,
    the_invariants_hold_in_every_storm_6: 6,
    the_invariants_hold_in_every_storm_7: 7,
}

#[test]
fn the_same_seed_is_the_same_storm_bit_for_bit() {
    let fingerprints = |seed: u64| [(); 2].map(|()| attempt(seed).unwrap().fingerprint);
    let all: Vec<[u64; 2]> = (100..106).map(fingerprints).collect();
    assert!(all.iter().all(|[first, second]| first == second), "{all:?}");
    assert!(all.windows(2).all(|pair| pair[0] != pair[1]), "the fingerprint sees something: {all:?}");
}
