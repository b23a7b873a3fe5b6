//! What the controller does about what goes wrong with YZ-AIM servos.

use takt::config::Config;
use takt::controller::Outcome;
use takt_rt::stop::{Phase, Rule, StopCategory};

use crate::arm::{folder, play};

/// The example with two of its moves and drives that are up at once.
fn gantry() -> Config {
    let mut config = Config::load(&folder().join("gantry-yz-aim.toml")).unwrap();
    config.program.moves.truncate(2);
    config.axes.iter_mut().for_each(|axis| axis.simulated.power_up_ns = 5_000_000);
    config
}

/// What goes wrong with an axis well into the first move, the rule that sees it, and in how many milliseconds at the latest.
const STOPS: [(&str, Rule, f64); 9] = [
    // The joint must fall behind first, and the window of the following error be over.
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
fn every_fault_with_a_rule_stops_the_whole_gantry_in_time_and_says_why() {
    for (fault, rule, within_ms) in STOPS {
        let text = format!("[[fault]]\n{fault}\naxis = \"y\"\nwhen = \"moving\"\nat = \"300 ms\"");
        let played = play(&gantry(), &text);
        let [stop] = played.stops.as_slice() else { panic!("{fault}: {:?}", played.outcome) };
        assert_eq!((stop.rule, stop.axis, stop.category), (rule, Some(1), StopCategory::One), "{fault}");
        assert!(played.detection_ms.is_some_and(|ms| (0.0..=within_ms).contains(&ms)), "{fault}: {played:?}");
        assert!(played.largest_step <= 1.0 + 1e-6, "{fault}: {} velocity limits", played.largest_step);
        assert!(played.speed_at_end < 1e-3, "{fault}: {} m/s at the end", played.speed_at_end);
        assert_eq!(played.phases.last(), Some(&Phase::Disabled), "{fault}: {:?}", played.phases);
        assert!(matches!(played.outcome, Some(Outcome::Stopped(_))), "{fault}: {:?}", played.outcome);
    }
}

#[test]
fn a_servo_without_sdo_replies_cannot_be_brought_up_and_in_motion_nobody_misses_them() {
    let stuck = "[[fault]]\nkind = \"stuck-sdo\"\naxis = \"y\"\nfor = \"0.5 s\"\n";
    let played = play(&gantry(), &format!("{}when = \"start\"", stuck.replace("0.5 s", "5 s")));
    assert!(matches!(played.outcome, Some(Outcome::BringUpFailed(_))), "{:?}", played.outcome);
    let played = play(&gantry(), &format!("{stuck}when = \"moving\""));
    assert_eq!(played.outcome, Some(Outcome::Finished));
}
