//! Reactions of the controller to faults of YZ-AIM servos.

use takt::Outcome;
use takt::config::Config;
use takt::faults::Scenario;
use takt_rt::{Phase, Rule, StopCategory};

use crate::faults::arm::{folder, play};

/// The example with two of its moves and fast-booting drives.
fn gantry() -> Config {
    let mut config = Config::load(&folder().join("gantry-yz-aim.toml")).unwrap();
    config.program.moves.truncate(2);
    config.axes.iter_mut().for_each(|axis| axis.power_up_ns = 5_000_000);
    config
}

/// A fault of an axis during the first move, the rule that detects it, and the longest detection time in milliseconds.
const STOPS: [(&str, Rule, f64); 9] = [
    // The joint must first fall behind, and then the time of the following error must pass.
    ("kind = \"stall\"", Rule::FollowingError, 300.0),
    ("kind = \"encoder-jump\"\nby = \"20 mm\"", Rule::ImplausibleFeedback, 5.0),
    // Feedback may be missing for five cycles of 2 ms.
    ("kind = \"wrong-mapping\"\ncontents = \"short\"", Rule::MissedFeedback, 13.0),
    ("kind = \"statusword\"\nset = 0x0008", Rule::DriveFault, 4.0),
    ("kind = \"statusword\"\nclear = 0x0004", Rule::DriveDisabled, 6.0),
    ("kind = \"alarm\"\ncode = 0x12", Rule::DriveFault, 4.0),
    ("kind = \"alarm\"\ncode = 0x14", Rule::DriveFault, 4.0),
    ("kind = \"alarm\"\ncode = 0x15", Rule::DriveFault, 4.0),
    ("kind = \"alarm\"\ncode = 0x10", Rule::DriveFault, 4.0),
];

#[test]
fn every_fault_with_a_rule_stops_the_whole_gantry_in_time_with_the_reason() {
    for (fault, rule, within_ms) in STOPS {
        let text = format!("[[fault]]\n{fault}\naxis = \"y\"\nwhen = \"moving\"\nat = \"300 ms\"");
        let played = play(&gantry(), &text);
        let [stop] = played.stops.as_slice() else { panic!("{fault}: {:?}", played.outcome) };
        assert_eq!((stop.rule(), stop.axis(), stop.category), (rule, Some(1), StopCategory::One), "{fault}");
        assert!(played.detection_ms.is_some_and(|ms| (0.0..=within_ms).contains(&ms)), "{fault}: {played:?}");
        assert!(played.largest_step <= 1.0 + 1e-6, "{fault}: {} velocity limits", played.largest_step);
        assert!(played.speed_at_end < 1e-3, "{fault}: {} m/s at the end", played.speed_at_end);
        assert_eq!(played.phases.last(), Some(&Phase::Disabled), "{fault}: {:?}", played.phases);
        assert!(matches!(played.outcome, Some(Outcome::Stopped(_))), "{fault}: {:?}", played.outcome);
    }
}

#[test]
fn a_servo_without_sdo_replies_fails_bring_up_but_does_not_stop_a_motion() {
    let stuck = "[[fault]]\nkind = \"stuck-sdo\"\naxis = \"y\"\nfor = \"0.5 s\"\n";
    let played = play(&gantry(), &format!("{}when = \"start\"", stuck.replace("0.5 s", "5 s")));
    assert!(matches!(played.outcome, Some(Outcome::BringUpFailed(_))), "{:?}", played.outcome);
    let played = play(&gantry(), &format!("{stuck}when = \"moving\""));
    assert_eq!(played.outcome, Some(Outcome::Finished));
}

/// A fault that a YZ-AIM cannot have: the keys, the line, the message, and the reason.
const REFUSED: [(&str, &str, usize, &str, &str); 8] = [
    ("stuck-brake", "", 3, "`fault.axis` cannot be \"y\"", "a YZ-AIM has no brake"),
    ("mode-display", "mode = 1", 3, "`fault.axis` cannot be \"y\"", "the PDOs of a YZ-AIM show no mode"),
    ("torque-off", "", 3, "`fault.axis` cannot be \"y\"", "a YZ-AIM has no safe torque off"),
    ("emergency", "code = 0x4210", 3, "`fault.axis` cannot be \"y\"", "a YZ-AIM sends no emergency messages"),
    ("wrong-mapping", "", 3, "`fault.axis` cannot be \"y\"", "the PDOs of a YZ-AIM are fixed"),
    ("wrong-mapping", "contents = \"other\"", 4, "`fault.contents` cannot be \"other\"", "\"short\""),
    ("alarm", "code = 0x7500", 4, "`fault.code` cannot be 0x7500", "0x10, 0x12, 0x14, 0x15 and 0x20"),
    ("alarm", "code = 0", 4, "`fault.code` cannot be 0x0000", "the alarms of a YZ-AIM are"),
];

#[test]
fn a_fault_that_a_servo_cannot_have_is_refused_at_its_line_with_the_reason() {
    for (kind, keys, line, said, why) in REFUSED {
        let text = format!("[[fault]]\nkind = \"{kind}\"\naxis = \"y\"\n{keys}");
        let error = Scenario::parse("scenario", &text, &gantry()).unwrap_err();
        let [problem] = error.problems() else { panic!("{text}: {:?}", error.problems()) };
        let help = problem.kind.help();
        assert_eq!((error.line(problem), problem.to_string().as_str()), (Some(line), said), "{text}");
        assert!(help.contains(&format!("{kind:?}; ")) && help.contains(why), "{text}: {help}");
    }
}
