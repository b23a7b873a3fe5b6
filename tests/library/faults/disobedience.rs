//! Drives that do not obey: no run ends as if all was well while one of them has torque.

use takt::Outcome;
use takt_rt::{Phase, Rule};

use super::arm::{arm, play};

/// What the statusword of a drive shows that stays in operation enabled for ever.
const SHOWS_TORQUE: &str = "kind = \"statusword\"\naxis = \"joint3\"\nset = 0x0006\nclear = 0x0040";

#[test]
fn a_run_whose_drive_does_not_obey_shutdown_ends_in_a_fault_that_names_it() {
    let played = play(&arm(), &format!("[[fault]]\n{SHOWS_TORQUE}\nwhen = \"enabled\"\nat = \"1 s\"\n"));
    let [stop] = played.stops[..] else { panic!("{:?}", played.stops) };
    assert_eq!((stop.rule(), stop.axis(), stop.phase), (Rule::NotDisabled, Some(2), Phase::Disabling));
    assert_eq!(played.outcome, Some(Outcome::Stopped(stop)));
}

#[test]
fn a_drive_that_does_not_obey_is_the_outcome_of_a_run_that_another_fault_has_ended() {
    let played = play(
        &arm(),
        &format!(
            "[[fault]]\n{SHOWS_TORQUE}\nwhen = \"enabled\"\nat = \"100 ms\"\n\
             [[fault]]\nkind = \"torque-off\"\naxis = \"joint5\"\nwhen = \"moving\"\nat = \"300 ms\"\n"
        ),
    );
    let rules: Vec<_> = played.stops.iter().map(|stop| (stop.rule(), stop.axis())).collect();
    assert_eq!(rules, [(Rule::DriveDisabled, Some(4)), (Rule::NotDisabled, Some(2))]);
    assert_eq!(played.outcome, Some(Outcome::Stopped(played.stops[1])));
}

#[test]
fn a_drive_that_keeps_its_torque_or_goes_local_is_named_at_the_end_of_the_run() {
    for (how, first) in [("keeps-state", Rule::NotDisabled), ("local", Rule::DriveLocal)] {
        let text = format!(
            "[[fault]]\nkind = \"disobedience\"\nhow = \"{how}\"\naxis = \"joint2\"\nwhen = \"enabled\"\nat = \"500 ms\"\n"
        );
        let played = play(&arm(), &text);
        assert_eq!((played.stops[0].rule(), played.stops[0].axis()), (first, Some(1)), "{how}");
        let last = *played.stops.last().unwrap();
        assert_eq!((last.rule(), last.axis()), (Rule::NotDisabled, Some(1)), "{how}");
        assert_eq!(played.outcome, Some(Outcome::Stopped(last)), "{how}");
    }
}
