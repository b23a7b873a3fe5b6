//! How soon each kind of fault is noticed in motion, and how soon the arm stands.
//!
//! A drive for which every frame is turned into another, with a right CRC, does what it hears for as long as that lasts:
//! for it there is no time that could be stated, nor for one without a watchdog that no frame reaches. What is stated is the rest of the
//! joints that hear what is sent to them.

use std::collections::BTreeMap;
use std::fmt::Write;

use takt::config::{Axis, Config, Protocol};
use takt::family::{self, Watchdog};
use takt::faults::Scenario;
use takt_rt::{EventKind, Rule, StopReason};

use crate::bounds;
use crate::case::scenario;
use crate::concern::Concerns;
use crate::dice::Dice;
use crate::machine::load;
use crate::run::World;
use crate::weather::{KINDS, fault};

/// The machines on which reactions are measured, one of each family and kind, and how many kinds of fault stop each at least.
const MACHINES: [(&str, usize); 5] = [
    ("arm6-erob", 20),
    ("gantry-yz-aim", 10),
    ("damiao-arm", 8),
    ("turntable-erob-can", 8),
    ("turntable-modbus", 8),
];
/// Slower than this fraction of its velocity limit is rest.
const REST: f64 = 0.004;
/// Six seconds of motion, and the end.
const LONGEST_S: f64 = 8.0;
/// Faults of each kind, when the table is to be printed.
const TIMES: u64 = 48;

/// What came of one fault in motion.
struct Reaction {
    reason: StopReason,
    /// From the cycle in which the fault began to the one in which the stop did.
    noticed_cycles: f64,
    /// From then on until every joint stood that hears what its drive is sent.
    rest_ms: f64,
    /// The same of the joints whose drives receive something else.
    misled_rest_ms: f64,
}

fn reaction(config: &Config, scenario: &Scenario) -> Option<Reaction> {
    let mut world = World::new(config, scenario);
    let mut stop: Option<(StopReason, u64)> = None;
    let mut concerns = Concerns::new(config, &world.fault_injector);
    let (mut last_motion_ns, mut last_misled_ns) = (0, 0);
    for _ in 0..bounds::cycles(config, LONGEST_S) {
        let goes_on = world.step(config);
        concerns.observe(&world.fault_injector, |_| ());
        while world.log.next_record(|_| ()).is_some() {}
        for event in &world.events {
            match event.kind {
                EventKind::Stop(reason) if reason.rule() != Rule::Requested => {
                    stop = stop.or(Some((reason, event.at_ns)));
                }
                _ => {}
            }
        }
        let joints = config.axes.iter().zip(&world.truth).zip(&concerns.by_axis);
        for ((axis, truth), concern) in joints.filter(|_| stop.is_some()) {
            if truth.velocity.abs() > REST * axis.limits.velocity {
                let is_beyond_reach = concern.is_unwatched && concern.is_beyond_reach;
                let is_misled = concern.is_misled || is_beyond_reach;
                let last_ns = if is_misled { &mut last_misled_ns } else { &mut last_motion_ns };
                *last_ns = world.snapshot.at_ns;
            }
        }
        if !goes_on {
            break;
        }
    }
    let (reason, stopped_ns) = stop?;
    let began_ns = world.fault_injector.progress().next().and_then(|(_, progress)| progress.began_ns())?;
    let noticed_ns = stopped_ns.saturating_sub(began_ns) as f64;
    let rest_ms = |last_ns: u64| last_ns.saturating_sub(stopped_ns) as f64 * 1e-6;
    Some(Reaction {
        reason,
        noticed_cycles: (noticed_ns / config.cycle.period_ns as f64).ceil(),
        rest_ms: rest_ms(last_motion_ns),
        misled_rest_ms: rest_ms(last_misled_ns),
    })
}

/// The reactions to so many faults of a kind, at different places and times in motion; fewer where it was tolerated.
fn reactions(number: u64, config: &Config, kind: &str, times: u64) -> Option<Vec<Reaction>> {
    let mut reactions = vec![];
    for time in 0..times {
        let mut dice = Dice::new(1000 * number + time);
        let when = format!("when = \"moving\"\nat = \"{} ms\"", 100 + dice.below(1200));
        let text = fault(&mut dice, config, kind, &when);
        // A simulated drive cannot be broken in every way.
        Scenario::parse("table", &text, config).ok()?;
        reactions.extend(reaction(config, &scenario(&text, config)));
    }
    Some(reactions)
}

/// The middle one of some numbers, and the largest.
fn middle_and_largest(mut numbers: Vec<f64>) -> (f64, f64) {
    numbers.sort_by(f64::total_cmp);
    (numbers[numbers.len() / 2], numbers[numbers.len() - 1])
}

/// The table of a machine, and the rest of every stop in it in ms.
fn table(config: &Config, times: u64) -> (String, Vec<f64>) {
    let mut text = format!(
        "{}, {times} faults of each kind in motion; median / maximum\n\n\
         | Fault | Stopped | Rule (stop category, times) | Noticed within (cycles) | At rest after (ms) |\n\
         |---|---|---|---|---|\n",
        config.name
    );
    let mut all_rest_ms = vec![];
    for (number, kind) in (0..).zip(KINDS) {
        let Some(reactions) = reactions(number, config, kind, times) else { continue };
        if reactions.is_empty() {
            let _ = writeln!(text, "| {kind} | 0 of {times} | tolerated | – | – |");
            continue;
        }
        let mut rules: BTreeMap<String, u64> = BTreeMap::new();
        for Reaction { reason, .. } in &reactions {
            *rules.entry(format!("{} ({}", reason.rule().key(), reason.category as u8)).or_default() += 1;
        }
        let mut rules: Vec<(String, u64)> = rules.into_iter().collect();
        rules.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        let rules: Vec<String> = rules.iter().map(|(rule, count)| format!("{rule}, {count}×)")).collect();
        let (noticed, noticed_at_most) =
            middle_and_largest(reactions.iter().map(|reaction| reaction.noticed_cycles).collect());
        let (rest_ms, rest_at_most_ms) =
            middle_and_largest(reactions.iter().map(|reaction| reaction.rest_ms).collect());
        let misled_ms = reactions.iter().map(|reaction| reaction.misled_rest_ms).fold(0.0, f64::max);
        let misled = if misled_ms > 0.0 { format!("; misled {misled_ms:.0}") } else { String::new() };
        let _ = writeln!(
            text,
            "| {kind} | {} of {times} | {} | {noticed:.0} / {noticed_at_most:.0} | {rest_ms:.0} / {rest_at_most_ms:.0}{misled} |",
            reactions.len(),
            rules.join(", "),
        );
        all_rest_ms.extend(reactions.iter().map(|reaction| reaction.rest_ms));
    }
    (text, all_rest_ms)
}

#[test]
fn most_kinds_of_fault_stop_a_machine_in_motion_and_every_stop_ends_in_the_time_that_is_stated() {
    let is_printed = crate::number("TAKT_STORM_TABLE").is_some();
    for (name, stops_at_least) in MACHINES {
        let config = load(name);
        let (text, rest_ms) = table(&config, if is_printed { TIMES } else { 1 });
        if is_printed {
            println!("{text}");
        }
        // What has no brake coasts when its power is taken.
        let coasting_s = |axis: &Axis| {
            if axis.drive.protocol == Protocol::BitFields { bounds::coasting_s(axis) } else { 0.0 }
        };
        let coasting_s = config.axes.iter().map(coasting_s).fold(0.0, f64::max);
        // Nothing but its own time-out stops a drive whose line is gone.
        let unreached_s = |axis: &Axis| match family::stops_by_itself_after(axis, &config) {
            Ok(Watchdog { timeout_ns: Some(after_ns), .. }) if axis.drive.protocol.is_of_serial_line() => {
                after_ns as f64 * 1e-9
            }
            _ => 0.0,
        };
        let unreached_s = config.axes.iter().map(unreached_s).fold(0.0, f64::max);
        let bound_ms = (bounds::to_rest_s(&config.axes) + coasting_s + unreached_s) * 1e3;
        assert!(rest_ms.len() >= stops_at_least, "{text}");
        assert!(rest_ms.iter().all(|ms| *ms <= bound_ms), "beyond {bound_ms} ms:\n{text}");
    }
}
