//! Storms: the whole controller against simulated drives, in virtual time, with random machines, programs, requests and
//! faults.
//!
//! `TAKT_STORM_CYCLES=100000000` for a long one (with `--release`), `TAKT_STORM_FIRST=…` for the cases from this seed on in
//! place of those from 0 on, `TAKT_STORM_CASES=…` for so many on machines of bit fields and with drives outside of the cycle, `TAKT_STORM_SEED=…` for one case again, `TAKT_STORM_TABLE=1` for the tables of what has been gone
//! through and of the reactions.

mod bounds;
mod case;
mod client;
mod client_callback;
mod client_mode;
mod client_stream;
mod client_trajectory;
mod concern;
mod coverage;
mod dice;
mod fingerprint;
mod heartbeat;
mod invariants;
mod machine;
mod off_cycle;
mod overload;
mod recorder;
mod regressions;
mod replay;
mod run;
mod table;
mod tap;
mod weather;
mod wire;

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Instant;

use takt_rt::Rule;

use case::Case;
use coverage::Coverage;
use run::{Done, play};

/// In all of the shards together.
const CYCLES: u64 = 1_000_000;
/// Enough for every fault to occur in every phase (`tests/run --all`).
const CYCLES_OF_ALL_FAULTS: u64 = 4_000_000;
/// Which seeds are played depends on the first one and the number of cycles alone, not on the number of processors.
const SHARDS: u64 = 16;
/// Of storms in which callbacks lead the groups.
const CALLBACK_CASES: u64 = 60;
/// Cases of the test whose streams command every kind of point.
const POINT_CASES: u64 = 120;
/// Of storms in which modes of operation are changed.
const MODE_CASES: u64 = 60;
/// Of storms over drives of bit fields.
const BIT_FIELD_CASES: u64 = 150;
/// Of storms over such drives whose modes are changed.
const BIT_FIELD_MODE_CASES: u64 = 75;
/// The same on a machine with too little time.
const OVERLOADED_BIT_FIELD_CASES: u64 = 100;
/// Of storms over drives that are spoken to outside of the cycle.
const OFF_CYCLE_CASES: u64 = 75;
/// Of storms over drives that do not obey.
const DISOBEDIENCE_CASES: u64 = 60;
/// Of storms over a drive on a serial line.
const LINE_CASES: u64 = 100;
/// A shard ends after so many failures.
const FAILURES_AT_MOST: usize = 5;

fn number(variable: &str) -> Option<u64> {
    let text = std::env::var(variable).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{variable}={text} is no number")))
}

/// Returns `true` if the cases are those of a normal run: what is rare may be missing in so few other ones.
fn is_usual() -> bool {
    ["TAKT_STORM_FIRST", "TAKT_STORM_CASES"].iter().all(|variable| number(variable).is_none())
}

fn attempt(seed: u64) -> Result<(Case, Done), String> {
    let played = catch_unwind(AssertUnwindSafe(|| {
        let case = Case::of(seed);
        match play(&case) {
            Ok(done) => Ok((case, done)),
            Err(wrong) => {
                let overload =
                    if case.overload.is_present() { format!("{:?}\n", case.overload) } else { String::new() };
                Err(format!("{} {wrong}\n{overload}{}", case.config.name, case.text))
            }
        }
    }));
    played
        .unwrap_or_else(|_| Err("it panics".to_owned()))
        .map_err(|wrong| format!("TAKT_STORM_SEED={seed}: {wrong}"))
}

/// Every so many seeds from this one on, until there have been enough cycles. Says at once what fails: the end of a long run
/// is far.
fn shard(first: u64, budget: u64) -> (Coverage, Vec<u64>) {
    let (mut coverage, mut failures) = (Coverage::default(), vec![]);
    for seed in (first..).step_by(SHARDS as usize) {
        if coverage.cycles >= budget || failures.len() >= FAILURES_AT_MOST {
            break;
        }
        match attempt(seed) {
            Ok((case, done)) => coverage.take(&case, &done),
            Err(failure) => {
                println!("{failure}");
                failures.push(seed);
            }
        }
    }
    (coverage, failures)
}

/// All of the shards, on as many threads as there are processors.
fn weather(first: u64, cycles: u64) -> (Coverage, Vec<u64>) {
    let next = AtomicU64::new(0);
    let all = Mutex::new((Coverage::default(), vec![]));
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= SHARDS {
                        return;
                    }
                    let (coverage, failures) = shard(first + number, cycles / SHARDS);
                    let mut all = all.lock().unwrap();
                    all.0.add(&coverage);
                    all.1.extend(failures);
                }
            });
        }
    });
    all.into_inner().unwrap()
}

#[test]
fn the_invariants_hold_in_every_storm_and_every_fault_has_its_turn() {
    if let Some(seed) = number("TAKT_STORM_SEED") {
        if let Err(failure) = attempt(seed) {
            panic!("{failure}");
        }
        return;
    }
    let began = Instant::now();
    let cycles = number("TAKT_STORM_CYCLES").unwrap_or(CYCLES);
    let (coverage, failures) = weather(number("TAKT_STORM_FIRST").unwrap_or(0), cycles);
    if number("TAKT_STORM_TABLE").is_some() {
        let seconds = began.elapsed().as_secs_f64();
        println!("{}\n{:.0} cycles a second", coverage.table(), coverage.cycles as f64 / seconds);
    }
    assert!(failures.is_empty(), "storms have failed: {failures:?}");
    let gaps = if cycles < CYCLES_OF_ALL_FAULTS { vec![] } else { coverage.gaps() };
    assert!(gaps.is_empty(), "never: {gaps:?}");
}

/// Plays so many cases of a kind, and says at once what fails. Returns the rules of all stops.
fn play_all(kind: &str, cases: u64, case: impl Fn(u64) -> Case) -> BTreeSet<&'static str> {
    let first = number("TAKT_STORM_FIRST").unwrap_or(0);
    let (mut failures, mut stops) = (vec![], BTreeSet::new());
    for seed in first..first + number("TAKT_STORM_CASES").unwrap_or(cases) {
        let case = case(seed);
        match play(&case) {
            Ok(done) => stops.extend(done.stops),
            Err(wrong) => {
                let Case { config, hardship, text, .. } = &case;
                println!(
                    "seed {seed}, {kind}: {} {wrong}\n{hardship:?} {:?}\n{text}",
                    config.name, case.overload
                );
                failures.push(seed);
            }
        }
    }
    assert!(failures.is_empty(), "storms have failed: {failures:?}");
    stops
}

#[test]
fn the_invariants_hold_for_drives_of_bit_fields() {
    play_all("bit fields", BIT_FIELD_CASES, Case::of_bit_fields);
}

#[test]
fn the_invariants_hold_for_drives_of_bit_fields_on_a_machine_with_too_little_time() {
    let stops =
        play_all("bit fields in overload", OVERLOADED_BIT_FIELD_CASES, Case::of_bit_fields_in_overload);
    assert!(!is_usual() || stops.contains(Rule::TimingUnfit.key()));
}

#[test]
fn the_invariants_hold_where_modes_of_drives_of_bit_fields_are_changed() {
    let first = number("TAKT_STORM_FIRST").unwrap_or(0);
    let mut changed_cycles = 0;
    for seed in first..first + number("TAKT_STORM_CASES").unwrap_or(BIT_FIELD_MODE_CASES) {
        let mut case = Case { has_mode_changes: true, is_serving: true, ..Case::of_bit_fields(seed) };
        case.clients = case.clients.max(1);
        client_mode::let_modes_change(&mut case.config);
        match play(&case) {
            Ok(done) => changed_cycles += done.changed_cycles,
            Err(wrong) => panic!("seed {seed}, with modes: {} {wrong}\n{}", case.config.name, case.text),
        }
    }
    assert!(changed_cycles > 1000, "in another mode than at first, only {changed_cycles} cycles in motion");
}

#[test]
fn the_invariants_hold_for_drives_that_do_not_obey() {
    let stops = play_all("disobedience", DISOBEDIENCE_CASES, Case::of_disobedience);
    for rule in [Rule::NotDisabled, Rule::DriveEnabled, Rule::DriveLocal] {
        assert!(!is_usual() || stops.contains(rule.key()), "never: {rule:?}");
    }
}

#[test]
fn the_invariants_hold_for_off_cycle_drives() {
    play_all("off cycle", OFF_CYCLE_CASES, Case::of_off_cycle);
}

#[test]
fn the_invariants_hold_for_a_drive_on_a_serial_line() {
    play_all("on a line", LINE_CASES, Case::on_a_line);
}

#[test]
fn the_same_seed_is_the_same_storm_bit_for_bit() {
    let fingerprints = |seed: u64| [(); 2].map(|()| attempt(seed).unwrap().1.fingerprint);
    let all: Vec<[u64; 2]> = (1_000_000..1_000_024).map(fingerprints).collect();
    assert!(all.iter().all(|[first, second]| first == second), "{all:?}");
    assert!(all.windows(2).all(|pair| pair[0] != pair[1]), "the fingerprint sees something: {all:?}");
}

#[test]
fn the_invariants_hold_where_callbacks_lead_the_groups_overrun_and_panic() {
    let mut stops = BTreeSet::new();
    let first = number("TAKT_STORM_FIRST").unwrap_or(0);
    for seed in first..first + CALLBACK_CASES {
        let case = Case { has_callbacks: true, ..Case::of(seed) };
        match play(&case) {
            Ok(done) => stops.extend(done.stops),
            Err(wrong) => panic!("seed {seed}, with callbacks: {} {wrong}\n{}", case.config.name, case.text),
        }
    }
    for rule in [Rule::CallbackOverrun, Rule::CallbackPanicked] {
        assert!(stops.contains(rule.key()), "never: {rule:?}");
    }
}

#[test]
fn the_invariants_hold_where_streams_command_velocities_torques_and_impedances() {
    let first = number("TAKT_STORM_FIRST").unwrap_or(0);
    let mut stale = 0;
    for seed in first..first + POINT_CASES {
        let mut case = Case { has_every_kind_of_point: true, is_serving: true, ..Case::of(seed) };
        case.clients = case.clients.max(1);
        match play(&case) {
            Ok(done) => stale += u64::from(done.stops.contains(Rule::StaleCommand.key())),
            Err(wrong) => {
                panic!("seed {seed}, every kind of point: {} {wrong}\n{}", case.config.name, case.text)
            }
        }
    }
    assert!(!is_usual() || stale > 0, "never: a torque that is too old");
}

#[test]
fn the_invariants_hold_where_modes_of_operation_are_changed() {
    let (mut changed_cycles, mut stops) = (0, BTreeSet::new());
    let first = number("TAKT_STORM_FIRST").unwrap_or(0);
    for seed in first..first + MODE_CASES {
        let mut case = Case { has_mode_changes: true, is_serving: true, ..Case::of(seed) };
        case.clients = case.clients.max(1);
        client_mode::let_modes_change(&mut case.config);
        match play(&case) {
            Ok(done) => {
                changed_cycles += done.changed_cycles;
                stops.extend(done.stops);
            }
            Err(wrong) => panic!("seed {seed}, with modes: {} {wrong}\n{}", case.config.name, case.text),
        }
    }
    assert!(changed_cycles > 1000, "in another mode than at first, only {changed_cycles} cycles in motion");
    assert!(!is_usual() || stops.contains(Rule::ModeNotShown.key()), "never: a mode that is not shown");
}
