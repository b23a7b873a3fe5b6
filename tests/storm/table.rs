//! How soon each kind of fault is seen, and how soon the arm stands.

use std::fmt::Write;

use takt_rt::record::EventKind;
use takt_rt::stop::{Rule, StopReason};

use crate::case::{load, scenario};
use crate::dice::Dice;
use crate::run::World;
use crate::weather::{KINDS, fault};

/// Slower than this is rest: rad/s.
const REST: f64 = 0.01;
/// Six seconds of motion, and the end.
const CYCLES: usize = 8_000;

/// One fault on the six-axis arm in motion: its stop, how long it took to be seen, and from then to rest; ms.
fn reaction(text: &str) -> Option<(StopReason, f64, f64)> {
    let config = load("arm6-erob");
    let mut world = World::new(&config, &scenario(text, &config));
    let mut stop: Option<(StopReason, u64)> = None;
    let mut last_motion_ns = 0;
    for _ in 0..CYCLES {
        let goes_on = world.step(&config);
        while world.log.next_record(|_| ()).is_some() {}
        for event in &world.events {
            match event.kind {
                EventKind::Stop(reason) if reason.rule != Rule::Requested => {
                    stop = stop.or(Some((reason, event.at_ns)));
                }
                _ => {}
            }
        }
        if stop.is_some() && world.truth.iter().any(|truth| truth.velocity.abs() > REST) {
            last_motion_ns = world.run.snapshot().at_ns;
        }
        if !goes_on {
            break;
        }
    }
    let (reason, stopped_ns) = stop?;
    let began_ns = world.rehearsal.courses().next().and_then(|(_, course)| course.began_ns())?;
    let ms = |from: u64, to: u64| to.saturating_sub(from) as f64 * 1e-6;
    Some((reason, ms(began_ns, stopped_ns), ms(stopped_ns, last_motion_ns)))
}

/// The table, from so many faults of each kind at different places and times in motion.
fn table(times: u64) -> String {
    let mut text = String::from(
        "| Fault | Stopped / tried | Detected within (ms) | Rules (category) | At rest within (ms) |\n|---|---|---|---|---|\n",
    );
    for (number, kind) in (0..).zip(KINDS) {
        let (mut rules, mut count, mut detection_ms, mut stop_ms) = (vec![], 0, 0.0_f64, 0.0_f64);
        for time in 0..times {
            let mut dice = Dice::new(1000 * number + time);
            let when = format!("when = \"moving\"\nat = \"{} ms\"", 100 + dice.below(1200));
            let config = load("arm6-erob");
            let fault = fault(&mut dice, &config, kind, Some(&when));
            let Some((reason, detected_ms, rest_ms)) = reaction(&fault) else { continue };
            count += 1;
            (detection_ms, stop_ms) = (detection_ms.max(detected_ms), stop_ms.max(rest_ms));
            let rule = format!("{} ({})", reason.rule.key(), reason.category as u8);
            if !rules.contains(&rule) {
                rules.push(rule);
            }
        }
        rules.sort();
        let reactions = rules.join(", ");
        let _ = match count {
            0 => writeln!(text, "| {kind} | 0 / {times} | – | borne | – |"),
            _ => writeln!(
                text,
                "| {kind} | {count} / {times} | {detection_ms:.1} | {reactions} | {stop_ms:.0} |"
            ),
        };
    }
    text
}

#[test]
fn every_kind_of_fault_that_stops_the_arm_is_in_the_table_and_brings_it_to_rest() {
    let is_printed = crate::number("TAKT_STORM_TABLE").is_some();
    let text = table(if is_printed { 12 } else { 1 });
    let rest_ms = |line: &str| {
        line.split(" | ").last().and_then(|cell| cell.trim_end_matches(" |").parse::<f64>().ok())
    };
    let stopped: Vec<f64> = text.lines().filter_map(rest_ms).collect();
    let bound_ms = crate::bounds::to_rest_s(&load("arm6-erob")) * 1e3;
    assert!(stopped.len() >= 15, "{text}");
    assert!(stopped.iter().all(|ms| *ms <= bound_ms), "beyond {bound_ms} ms:\n{text}");
    if is_printed {
        println!("{text}");
    }
}
