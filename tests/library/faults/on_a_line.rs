//! Faults of a serial line and of the drives on it: what they lead to, and which have no meaning there.

use takt::Outcome;
use takt::config::Config;
use takt::faults::Scenario;
use takt_rt::{BusState, Origin, Rule};

use crate::faults::arm::{Played, folder, play};

/// The axis on the line, and the bus that is the line.
const TABLE: u8 = 2;
const LINE: u8 = 1;

/// An arm on a CAN bus and a turntable on a Modbus line, with drives that boot quickly, and the first move.
fn turntable() -> Config {
    let mut config = Config::load(&folder().join("turntable-modbus.toml")).unwrap();
    config.program.moves.truncate(1);
    config.axes.iter_mut().for_each(|axis| axis.power_up_ns = 5_000_000);
    config
}

fn in_motion(fault: &str) -> Played {
    play(&turntable(), &format!("[[fault]]\n{fault}\nwhen = \"moving\"\nat = \"300 ms\""))
}

/// A round of requests takes three cycles of the line, and five rounds may be without a report.
const MISSED_MS: f64 = 190.0;

/// A fault of the table during the first move, the rule that detects it, and the longest detection time in ms.
const OF_THE_TABLE: [(&str, Rule, f64); 17] = [
    ("kind = \"drop\"", Rule::MissedFeedback, MISSED_MS),
    ("kind = \"drop\"\ndirection = \"sent\"", Rule::MissedFeedback, MISSED_MS),
    ("kind = \"drop\"\ndirection = \"received\"", Rule::MissedFeedback, MISSED_MS),
    // Longer than a reply is waited for.
    ("kind = \"delay\"\ndirection = \"received\"\nby = \"60 ms\"", Rule::MissedFeedback, MISSED_MS),
    ("kind = \"delay\"\ndirection = \"sent\"\nby = \"60 ms\"", Rule::MissedFeedback, MISSED_MS),
    ("kind = \"corrupt\"", Rule::MissedFeedback, MISSED_MS),
    ("kind = \"corrupt\"\ndirection = \"sent\"\nbits = 3", Rule::MissedFeedback, MISSED_MS),
    ("kind = \"corrupt\"\ndirection = \"received\"\npart = \"identifier\"", Rule::MissedFeedback, MISSED_MS),
    ("kind = \"silent-node\"", Rule::MissedFeedback, MISSED_MS),
    ("kind = \"stuck-sdo\"", Rule::MissedFeedback, MISSED_MS),
    // It answers again before a round is over, without torque. A request that is lost costs a reply timeout.
    ("kind = \"reboot\"", Rule::DriveDisabled, 110.0),
    ("kind = \"torque-off\"", Rule::DriveDisabled, 100.0),
    ("kind = \"stall\"", Rule::FollowingError, 500.0),
    ("kind = \"encoder-jump\"\nby = \"40 deg\"", Rule::ImplausibleFeedback, 60.0),
    ("kind = \"over-current\"", Rule::DriveFault, 60.0),
    ("kind = \"encoder-failure\"", Rule::DriveFault, 60.0),
    ("kind = \"alarm\"\ncode = 0x7121", Rule::DriveFault, 60.0),
];

#[test]
fn faults_of_the_drive_on_a_line_and_of_what_it_is_told_stop_the_group_in_time_with_the_reason() {
    let wrong: Vec<String> = OF_THE_TABLE
        .iter()
        .filter_map(|(fault, rule, within_ms)| {
            let played = in_motion(&format!("{fault}\naxis = \"table\""));
            let stop = played.stops.first().map(|stop| (stop.rule(), stop.origin));
            let is_right = stop == Some((*rule, Origin::Axis(TABLE)))
                && played.stops.len() == 1
                && played.detection_ms.is_some_and(|ms| ms <= *within_ms)
                && played.largest_step <= 1.0 + 1e-6
                && played.speed_at_end < 1e-3
                && matches!(played.outcome, Some(Outcome::Stopped(_)));
            (!is_right).then(|| {
                let Played { outcome, detection_ms, largest_step, speed_at_end, .. } = played;
                format!(
                    "{fault}: {outcome:?} after {detection_ms:?} ms, {largest_step} velocity limits, {speed_at_end} rad/s"
                )
            })
        })
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_line_that_is_gone_is_the_reason_itself() {
    let played = in_motion("kind = \"interface-down\"\nbus = \"table\"");
    let stop = played.stops.first().unwrap();
    assert_eq!((stop.rule(), stop.origin), (Rule::BusLost, Origin::Bus(LINE)), "{stop:?}");
    assert_eq!(played.health[usize::from(LINE)].state, BusState::Down);
    assert!(played.detection_ms.unwrap() <= 5.0 && played.speed_at_end < 1e-3, "{played:?}");
}

#[test]
fn some_lost_late_and_corrupted_requests_and_replies_cost_turns_and_no_motion() {
    for fault in [
        "kind = \"drop\"\nprobability = \"5 %\"",
        "kind = \"corrupt\"\nprobability = \"5 %\"\nbits = 2",
        "kind = \"corrupt\"\nprobability = \"5 %\"\npart = \"identifier\"",
        "kind = \"delay\"\nprobability = \"20 %\"\ndirection = \"received\"\nby = \"2 ms\"",
        "kind = \"delay\"\nprobability = \"5 %\"\nby = \"30 ms\"",
        "kind = \"drop\"\ncount = 1",
        "kind = \"load\"\ntorque = \"3 Nm\"\nfor = \"200 ms\"",
    ] {
        let played = in_motion(&format!("{fault}\naxis = \"table\""));
        assert_eq!(played.outcome, Some(Outcome::Finished), "{fault}: {:?}", played.events);
        assert!(played.frames[0] > 0 || fault.contains("load"), "{fault}: {:?}", played.events);
        assert!(played.largest_step <= 1.0 + 1e-6, "{fault}");
    }
}

#[test]
fn a_fault_on_a_line_counts_requests_and_replies_and_ends_with_the_last() {
    let played = in_motion("kind = \"drop\"\naxis = \"table\"\ncount = 2");
    assert_eq!(played.frames, [2]);
    let ends: Vec<&String> = played.events.iter().filter(|event| event.contains("has ended")).collect();
    assert!(matches!(ends[..], [end] if end.ends_with("it affected 2 requests and replies")), "{ends:?}");
}

#[test]
fn the_same_seed_is_the_same_run_on_a_line_too() {
    let fault = |seed| {
        let keys = "kind = \"corrupt\"\nprobability = \"10 %\"\naxis = \"table\"";
        in_motion(&format!("{keys}\nseed = {seed}")).fingerprint
    };
    assert_eq!(fault(1), fault(1));
    assert_ne!(fault(1), fault(2));
}

#[test]
fn a_line_that_is_gone_before_the_start_is_waited_for() {
    let text = "[[fault]]\nkind = \"interface-down\"\nbus = \"table\"\nwhen = \"start\"\nfor = \"300 ms\"";
    let played = play(&turntable(), text);
    assert_eq!(played.outcome, Some(Outcome::Finished), "{:?}", played.events);
}

/// The problems of a scenario: line, message, help.
fn problems(config: &Config, text: &str) -> Vec<(usize, String, String)> {
    let Err(error) = Scenario::parse("line.toml", text, config) else { return vec![] };
    let place = |problem: &takt::config::Problem| error.line(problem).unwrap_or(0);
    error
        .problems()
        .iter()
        .map(|problem| (place(problem), problem.to_string(), problem.kind.help().to_string()))
        .collect()
}

#[test]
fn what_has_no_meaning_on_a_line_is_refused_at_its_line_with_the_reason() {
    let refused = [
        ("duplicate", "nothing is sent twice"),
        ("reorder", "one request at a time"),
        ("echo-loss", "nobody confirms"),
        ("full-queue", "no frames wait"),
        ("bus-off", "interface-down"),
        ("error-passive", "no CAN controller"),
        ("foreign-sync", "one master"),
        ("foreign-set-points", "one master"),
        ("foreign-nmt", "one master"),
        ("duplicate-node", "one master"),
        ("foreign-frame", "no CAN frames"),
        ("flood", "no CAN frames"),
    ];
    for (kind, why) in refused {
        let keys = match kind {
            "foreign-set-points" | "duplicate-node" => "axis = \"table\"",
            "foreign-nmt" => "bus = \"table\"\ncommand = \"stop\"",
            "foreign-frame" => "bus = \"table\"\nid = 1",
            _ => "bus = \"table\"",
        };
        let found = problems(&turntable(), &format!("[[fault]]\n{keys}\nkind = \"{kind}\"\n"));
        let line = 2 + keys.lines().count();
        let [(at, message, help)] = &found[..] else { panic!("{kind}: {found:?}") };
        assert_eq!(*at, line, "{kind}: {found:?}");
        assert!(message.contains(kind) && message.contains("serial line") && help.contains(why), "{found:?}");
    }
}

#[test]
fn keys_of_can_frames_are_refused_on_a_line() {
    for key in ["id = 1", "function = \"sdo\"", "where = \"bus\""] {
        let text = format!("[[fault]]\nkind = \"delay\"\nby = \"1 ms\"\naxis = \"table\"\n{key}\n");
        let found = problems(&turntable(), &text);
        let [(at, message, _)] = &found[..] else { panic!("{key}: {found:?}") };
        assert!(*at == 5 && message.contains("serial line"), "{found:?}");
    }
}

#[test]
fn a_defect_that_a_drive_on_a_line_cannot_have_is_refused_by_the_simulated_drive() {
    for kind in ["wrong-mapping", "statusword", "mode-display", "emergency"] {
        let keys = match kind {
            "mode-display" => "mode = 1",
            "emergency" => "code = 0x4210",
            _ => "",
        };
        let text = format!("[[fault]]\nkind = \"{kind}\"\naxis = \"table\"\n{keys}\n");
        let found = problems(&turntable(), &text);
        assert!(matches!(&found[..], [(3, message, _)] if message.contains("table")), "{kind}: {found:?}");
    }
}

#[test]
fn drives_of_a_line_of_this_machine_cannot_be_broken_and_its_bytes_can() {
    let text = std::fs::read_to_string(folder().join("turntable-modbus.toml")).unwrap();
    let text =
        text.replacen("name = \"table\"\n", "name = \"table\"\ninterface = \"serial:/dev/ttyUSB9\"\n", 1);
    let config = Config::parse("real.toml", &text).unwrap();
    assert!(config.is_serial_line(usize::from(LINE)));
    let found = problems(&config, "[[fault]]\nkind = \"stall\"\naxis = \"table\"\n");
    assert!(matches!(&found[..], [(3, message, _)] if message.contains("serial:/dev/ttyUSB9")), "{found:?}");
    assert_eq!(problems(&config, "[[fault]]\nkind = \"corrupt\"\naxis = \"table\"\n"), []);
}

#[test]
fn a_drive_that_is_rebooted_while_it_stands_without_torque_is_found_again() {
    let text = "[[fault]]\nkind = \"reboot\"\naxis = \"table\"\nwhen = \"start\"\nat = \"20 ms\"";
    let played = play(&turntable(), text);
    assert_eq!(played.outcome, Some(Outcome::Finished), "{:?}", played.events);
}
