//! Storms again: the engine on the journal of a storm does what it did, bit for bit.

use takt::journal::Journal;
use takt_tools::replay::Replay;

use crate::case::Case;
use crate::client_mode;
use crate::run::record;

/// Storms of each kind, and more in a long run (`TAKT_STORM_CYCLES`): a thousand of all kinds.
const CASES: u64 = 20;
const CASES_OF_A_LONG_RUN: u64 = 100;

/// Plays storms, replays each of them, and compares every record. A second replay begins in some cycle with the state of the first.
fn replay_all(kind: &str, case: impl Fn(u64) -> Case) {
    let first = crate::number("TAKT_STORM_FIRST").unwrap_or(2_000_000);
    let usual = if crate::number("TAKT_STORM_CYCLES").is_some() { CASES_OF_A_LONG_RUN } else { CASES };
    for seed in first..first + crate::number("TAKT_STORM_CASES").unwrap_or(usual) {
        let case = case(seed);
        let (journal, records) = record(&case).unwrap_or_else(|wrong| panic!("seed {seed}, {kind}: {wrong}"));
        let mut replay = Replay::new(&case.config, journal).unwrap();
        let mut resumed = None;
        let resumes_in = (seed.wrapping_mul(7919) % records.len().max(1) as u64) as usize;
        for (cycle, recorded) in records.iter().enumerate() {
            if cycle == resumes_in {
                resumed = Some(resume(&case, &replay));
            }
            for replay in [Some(&mut replay), resumed.as_mut()].into_iter().flatten() {
                let replayed =
                    replay.step().unwrap_or_else(|| panic!("seed {seed}, {kind}: it ends in cycle {cycle}"));
                assert!(
                    is_same(recorded, replayed),
                    "seed {seed}, {kind}, cycle {cycle}, resumed in {resumes_in}:\n{recorded:?}\n{replayed:?}"
                );
            }
        }
        assert!(
            records.len() > 10
                && replay.step().is_none()
                && resumed.is_some_and(|mut replay| replay.step().is_none()),
            "seed {seed}, {kind}: {} cycles",
            records.len()
        );
    }
}

/// A replay that begins with the state of another one, as that of a black box does.
fn resume(case: &Case, replay: &Replay) -> Replay {
    let mut journal = Journal::default();
    journal.add_block(&replay.checkpoint().unwrap()).unwrap();
    Replay::new(&case.config, journal).unwrap()
}

/// Returns `true` if they are the same in every bit: their texts say everything, and NaN is NaN. Texts are slow.
fn is_same(recorded: &takt_rt::CycleRecord, replayed: &takt_rt::CycleRecord) -> bool {
    recorded == replayed && is_same_zero(recorded, replayed)
        || format!("{recorded:?}") == format!("{replayed:?}")
}

/// Returns `true` if zeros have the same signs, which equality does not see.
fn is_same_zero(recorded: &takt_rt::CycleRecord, replayed: &takt_rt::CycleRecord) -> bool {
    recorded.axes().iter().zip(replayed.axes()).all(|(was, is)| {
        was.position_set.to_bits() == is.position_set.to_bits()
            && was.velocity_set.to_bits() == is.velocity_set.to_bits()
            && was.acceleration_set.to_bits() == is.acceleration_set.to_bits()
            && was.jerk_set.to_bits() == is.jerk_set.to_bits()
            && was.torque_set.to_bits() == is.torque_set.to_bits()
    })
}

#[test]
fn the_replay_of_any_storm_is_identical() {
    replay_all("any", Case::of);
}

#[test]
fn the_replay_of_a_storm_on_a_machine_with_too_little_time_is_identical() {
    replay_all("in overload", Case::in_overload);
}

#[test]
fn the_replay_of_a_storm_with_a_life_cycle_that_is_neglected_is_identical() {
    replay_all("in hardship", Case::in_hardship);
}

#[test]
fn the_replay_of_a_storm_with_callbacks_is_identical() {
    replay_all("callbacks", |seed| Case { has_callbacks: true, ..Case::of(seed) });
}

#[test]
fn the_replay_of_a_storm_with_every_kind_of_point_is_identical() {
    replay_all("points", |seed| {
        let case = Case { has_every_kind_of_point: true, is_serving: true, ..Case::of(seed) };
        Case { clients: case.clients.max(1), ..case }
    });
}

#[test]
fn the_replay_of_a_storm_in_which_modes_are_changed_is_identical() {
    replay_all("modes", |seed| {
        let mut case = Case { has_mode_changes: true, is_serving: true, ..Case::of(seed) };
        case.clients = case.clients.max(1);
        client_mode::let_modes_change(&mut case.config);
        case
    });
}

#[test]
fn the_replay_of_a_storm_over_drives_of_bit_fields_is_identical() {
    replay_all("bit fields", Case::of_bit_fields);
}

#[test]
fn the_replay_of_a_storm_over_off_cycle_drives_is_identical() {
    replay_all("off cycle", Case::of_off_cycle);
}
