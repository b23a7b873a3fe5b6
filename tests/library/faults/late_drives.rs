//! Drives whose replies are always whole cycles late, so that each reply looks like one to the next SYNC or set-point.

use takt::Outcome;
use takt_rt::{Phase, Rule, StopCategory};

use takt::config::Config;

use crate::faults::arm::{arm, folder, play};

#[test]
fn a_drive_whose_feedback_is_always_whole_cycles_late_is_not_enabled_and_named_with_its_lateness() {
    for cycles in [1, 2, 5, 20] {
        // The feedback arrives shortly after the SYNC that it seems to answer.
        let by_us = 1000 * cycles + 100;
        let late = format!(
            "[[fault]]\nkind = \"delay\"\naxis = \"joint5\"\nfunction = \"tpdo\"\nby = \"{by_us} us\"\nwhere = \"bus\"\n\
             when = \"start\""
        );
        let played = play(&arm(), &late);
        let Some(Outcome::Stopped(stop)) = played.outcome else { panic!("{cycles}: {:?}", played.outcome) };
        assert_eq!(
            (stop.rule(), stop.axis(), stop.category),
            (Rule::MissedFeedback, Some(4), StopCategory::One)
        );
        assert_eq!((stop.cause.numbers(), stop.phase), ((f64::from(cycles), 0.0), Phase::Enabling));
        assert!(!played.phases.contains(&Phase::Holding), "{:?}", played.phases);
        assert_eq!(played.largest_step, 0.0, "no drive was enabled");
    }
}

#[test]
fn occasional_lost_or_late_feedback_before_enabling_is_tolerated() {
    for fault in [
        "kind = \"drop\"\naxis = \"joint5\"\nfunction = \"tpdo\"\ncount = 3",
        "kind = \"delay\"\naxis = \"joint5\"\nfunction = \"tpdo\"\nby = \"2100 us\"\nwhere = \"bus\"\ncount = 1",
        "kind = \"delay\"\nbus = \"wrist\"\nfunction = \"tpdo\"\nby = \"100 us\"\nwhere = \"bus\"",
        "kind = \"drop\"\nbus = \"base\"\nfunction = \"tpdo\"\nprobability = \"2 %\"",
    ] {
        let played = play(&arm(), &format!("[[fault]]\n{fault}\nwhen = \"start\""));
        assert_eq!(played.outcome, Some(Outcome::Finished), "{fault}");
    }
}

/// The gantry with drives that reply to set-points only.
fn answering_set_points() -> Config {
    let mut config = Config::load(&folder().join("gantry-yz-aim.toml")).unwrap();
    config.program.moves.truncate(1);
    for axis in &mut config.axes {
        axis.power_up_ns = 5_000_000;
        axis.answers_sync = false;
    }
    config
}

#[test]
fn a_drive_that_always_answers_set_points_whole_cycles_late_is_not_enabled_and_named_with_its_lateness() {
    for cycles in [1, 2, 5, 20] {
        let by_us = 2000 * cycles + 100;
        let late = format!(
            "[[fault]]\nkind = \"delay\"\naxis = \"y\"\nfunction = \"tpdo\"\nby = \"{by_us} us\"\nwhere = \"bus\"\n\
             when = \"start\""
        );
        let played = play(&answering_set_points(), &late);
        let Some(Outcome::Stopped(stop)) = played.outcome else { panic!("{cycles}: {:?}", played.outcome) };
        assert_eq!(
            (stop.rule(), stop.axis(), stop.category),
            (Rule::MissedFeedback, Some(1), StopCategory::One)
        );
        assert_eq!((stop.cause.numbers(), stop.phase), ((f64::from(cycles), 0.0), Phase::Enabling));
        assert!(!played.phases.contains(&Phase::Holding), "{:?}", played.phases);
    }
}

#[test]
fn occasional_lost_or_late_replies_to_set_points_before_enabling_are_tolerated() {
    for fault in [
        "kind = \"drop\"\naxis = \"y\"\nfunction = \"tpdo\"\ncount = 3",
        "kind = \"drop\"\naxis = \"y\"\nfunction = \"rpdo\"\ncount = 4",
        "kind = \"delay\"\naxis = \"y\"\nfunction = \"tpdo\"\nby = \"4100 us\"\nwhere = \"bus\"\ncount = 1",
        "kind = \"delay\"\nbus = \"gantry\"\nfunction = \"tpdo\"\nby = \"300 us\"\nwhere = \"bus\"",
        "kind = \"drop\"\nbus = \"gantry\"\nfunction = \"tpdo\"\nprobability = \"2 %\"",
    ] {
        let played = play(&answering_set_points(), &format!("[[fault]]\n{fault}\nwhen = \"start\""));
        assert_eq!(played.outcome, Some(Outcome::Finished), "{fault}");
    }
}
