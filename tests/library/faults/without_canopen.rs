//! Reactions of the controller to faults of drives that are no CANopen nodes: drives of bit fields, and an eRob with its own protocol.

use takt::Outcome;
use takt::config::Config;
use takt_rt::{Origin, Rule};

use crate::faults::arm::{Played, folder, play};

/// A fault of an axis during the first move, the rule that detects it, and the longest detection time in cycles of the axis's bus.
type Stops = (&'static str, Rule, f64);

/// Of every drive that answers each command in the cycle. Feedback may be missing for five cycles; the sixth is one too many, and the reply
/// to a command comes in the cycle after it.
const IN_THE_CYCLE: [Stops; 6] = [
    ("kind = \"drop\"", Rule::MissedFeedback, 6.0),
    ("kind = \"drop\"\ndirection = \"sent\"", Rule::MissedFeedback, 7.0),
    ("kind = \"silent-node\"", Rule::MissedFeedback, 6.0),
    ("kind = \"wrong-mapping\"\ncontents = \"short\"", Rule::MissedFeedback, 6.0),
    ("kind = \"encoder-jump\"\nby = \"0.3 rad\"", Rule::ImplausibleFeedback, 2.0),
    // The joint must first fall behind, and then the time of the following error must pass.
    ("kind = \"stall\"", Rule::FollowingError, 400.0),
];

/// Of drives whose replies show errors.
const SHOWN: [Stops; 2] = [
    ("kind = \"over-current\"", Rule::DriveFault, 2.0),
    ("kind = \"over-temperature\"", Rule::DriveFault, 2.0),
];

/// Of motors whose replies show neither errors nor whether they have torque: the joint falls behind.
const NOT_SHOWN: [Stops; 3] = [
    ("kind = \"over-current\"", Rule::FollowingError, 500.0),
    ("kind = \"over-temperature\"", Rule::FollowingError, 500.0),
    ("kind = \"torque-off\"", Rule::FollowingError, 500.0),
];

/// Of a drive that is spoken to beside the cycle, in each of whose bus's cycles a report is expected.
const BESIDE_THE_CYCLE: [Stops; 8] = [
    ("kind = \"drop\"", Rule::MissedFeedback, 8.0),
    ("kind = \"drop\"\ndirection = \"sent\"", Rule::MissedFeedback, 8.0),
    ("kind = \"silent-node\"", Rule::MissedFeedback, 8.0),
    ("kind = \"stuck-sdo\"", Rule::MissedFeedback, 8.0),
    ("kind = \"encoder-jump\"\nby = \"0.3 rad\"", Rule::ImplausibleFeedback, 4.0),
    ("kind = \"over-current\"", Rule::DriveFault, 40.0),
    // Its position is read in each report, and not whether it has torque.
    ("kind = \"torque-off\"", Rule::FollowingError, 40.0),
    ("kind = \"stall\"", Rule::FollowingError, 100.0),
];

/// An example with one of its moves and fast-booting drives.
fn example(name: &str) -> Config {
    let mut config = Config::load(&folder().join(name)).unwrap();
    config.program.moves.truncate(1);
    config.axes.iter_mut().for_each(|axis| axis.power_up_ns = 5_000_000);
    config
}

fn in_motion(config: &Config, axis: u8, fault: &str) -> Played {
    let name = &config.axes[usize::from(axis)].name;
    play(config, &format!("[[fault]]\n{fault}\naxis = {name:?}\nwhen = \"moving\"\nat = \"300 ms\""))
}

/// Every one of the faults stops the group, and nothing but the axis that has it is named.
fn assert_stops(name: &str, axis: u8, faults: &[Stops]) {
    let config = example(name);
    let bus = config.axes[usize::from(axis)].bus;
    let cycle_ms = config.bus_cycle(bus).period_ns as f64 * 1e-6;
    let wrong: Vec<String> = faults
        .iter()
        .filter_map(|(fault, rule, within_cycles)| {
            let played = in_motion(&config, axis, fault);
            let stop = played.stops.first().map(|stop| (stop.rule(), stop.origin));
            let is_in_time = played.detection_ms.is_some_and(|ms| ms <= within_cycles * cycle_ms);
            let is_right = stop == Some((*rule, Origin::Axis(axis)))
                && played.stops.len() == 1
                && is_in_time
                && played.largest_step <= 1.0 + 1e-6
                && matches!(played.outcome, Some(Outcome::Stopped(_)));
            (!is_right).then(|| {
                let Played { outcome, detection_ms, largest_step, .. } = played;
                format!("{fault}: {outcome:?} after {detection_ms:?} ms, {largest_step} velocity limits")
            })
        })
        .collect();
    assert!(wrong.is_empty(), "{name}: {wrong:#?}");
}

#[test]
fn faults_of_a_motor_over_can_fd_stop_the_leg_in_time_with_the_reason() {
    assert_stops("hollow-leg-fd.toml", 1, &IN_THE_CYCLE);
    assert_stops("hollow-leg-fd.toml", 1, &SHOWN);
    let other_mode = "kind = \"mode-display\"\nmode = 9";
    assert_stops("hollow-leg-fd.toml", 1, &[(other_mode, Rule::ModeChanged, 2.0)]);
}

#[test]
fn a_motor_over_can_fd_that_loses_its_torque_has_it_again_with_the_next_command() {
    let played = in_motion(&example("hollow-leg-fd.toml"), 1, "kind = \"torque-off\"");
    assert!(matches!(played.outcome, Some(Outcome::Finished)), "{:?}", played.outcome);
    assert!(played.events.iter().any(|event| event.contains("begun")), "{:?}", played.events);
}

#[test]
fn faults_of_motors_over_can_stop_the_pair_in_time_in_normal_and_in_extended_mode() {
    for axis in [0, 1] {
        assert_stops("hollow-arm.toml", axis, &IN_THE_CYCLE);
        assert_stops("hollow-arm.toml", axis, &NOT_SHOWN);
    }
}

#[test]
fn faults_of_a_drive_of_another_make_stop_the_arm_in_time_with_the_reason() {
    assert_stops("damiao-arm.toml", 1, &IN_THE_CYCLE);
    assert_stops("damiao-arm.toml", 1, &SHOWN);
    assert_stops("damiao-arm.toml", 1, &[("kind = \"torque-off\"", Rule::DriveDisabled, 2.0)]);
}

#[test]
fn faults_of_a_drive_beside_the_cycle_stop_it_in_time_with_the_reason() {
    assert_stops("turntable-erob-can.toml", 0, &BESIDE_THE_CYCLE);
}
