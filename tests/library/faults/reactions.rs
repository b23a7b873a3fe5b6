//! The controller's reaction to each fault that has a rule, and the invariants for all faults.

use takt::Outcome;
use takt_rt::{BusState, Origin, Phase, Rule, StopCategory};

use crate::faults::arm::{Played, arm, play};

/// During the first move.
const IN_MOTION: &str = "when = \"moving\"\nat = \"300 ms\"";

fn in_motion(fault: &str) -> Played {
    play(&arm(), &format!("[[fault]]\n{fault}\n{IN_MOTION}"))
}

/// The invariants for all faults. The tolerance of the velocity limit is for rounding.
fn assert_safe(fault: &str, played: &Played) {
    assert!(played.outcome.is_some(), "{fault}: the run does not end");
    // A drive that no controlword reaches has not confirmed that it has no torque: that is reported in addition.
    let reasons = played.stops.iter().filter(|stop| stop.rule() != Rule::NotDisabled).count();
    assert!(reasons <= 1, "{fault}: {:?}", played.stops);
    assert!(played.largest_step <= 1.0 + 1e-6, "{fault}: {} velocity limits", played.largest_step);
    assert!(played.speed_at_end < 1e-3, "{fault}: {} rad/s at the end", played.speed_at_end);
    assert_eq!(played.missed_slots, 0, "{fault}");
}

/// A fault that leads to a stop: its keys, the rule, the origin, and the longest detection time in milliseconds.
struct Stops(&'static str, Rule, Origin, f64);

const STOPS: [Stops; 39] = {
    use Origin::{Axis, Bus};
    use Rule::*;
    [
        // Feedback may be missing for five cycles; the sixth is one too many.
        Stops("kind = \"drop\"\nbus = \"base\"\nfunction = \"tpdo\"", MissedFeedback, Axis(0), 6.0),
        Stops("kind = \"drop\"\naxis = \"joint5\"\nfunction = \"tpdo\"", MissedFeedback, Axis(4), 6.0),
        Stops("kind = \"drop\"\nbus = \"base\"\nfunction = \"sync\"", MissedFeedback, Axis(0), 7.0),
        // A regular delay is a missed feedback too.
        Stops(
            "kind = \"delay\"\nbus = \"base\"\nfunction = \"tpdo\"\nby = \"1 cycles\"",
            MissedFeedback,
            Axis(0),
            6.0,
        ),
        Stops(
            "kind = \"delay\"\nbus = \"base\"\nfunction = \"tpdo\"\nby = \"2 cycles\"",
            MissedFeedback,
            Axis(0),
            6.0,
        ),
        Stops(
            "kind = \"delay\"\naxis = \"joint5\"\nfunction = \"tpdo\"\nby = \"5 ms\"",
            MissedFeedback,
            Axis(4),
            6.0,
        ),
        Stops(
            "kind = \"delay\"\nbus = \"wrist\"\nfunction = \"tpdo\"\nby = \"600 us\"",
            MissedFeedback,
            Axis(3),
            6.0,
        ),
        Stops("kind = \"full-queue\"\nbus = \"base\"", NotTransmitted, Bus(0), 7.0),
        Stops("kind = \"full-queue\"\nbus = \"base\"\nfunction = \"rpdo\"", NotTransmitted, Bus(0), 7.0),
        Stops("kind = \"flood\"\nbus = \"base\"\nfor = \"20 ms\"", NotTransmitted, Bus(0), 7.0),
        Stops("kind = \"silent-node\"\naxis = \"joint2\"", MissedFeedback, Axis(1), 6.0),
        Stops("kind = \"reboot\"\naxis = \"joint6\"", MissedFeedback, Axis(5), 6.0),
        Stops(
            "kind = \"wrong-mapping\"\naxis = \"joint1\"\ncontents = \"short\"",
            MissedFeedback,
            Axis(0),
            6.0,
        ),
        Stops("kind = \"foreign-nmt\"\nbus = \"wrist\"\ncommand = \"stop\"", ForeignMaster, Bus(1), 2.0),
        Stops(
            "kind = \"foreign-nmt\"\naxis = \"joint3\"\ncommand = \"pre-operational\"",
            ForeignMaster,
            Bus(0),
            2.0,
        ),
        Stops(
            "kind = \"foreign-nmt\"\naxis = \"joint3\"\ncommand = \"reset-node\"",
            ForeignMaster,
            Bus(0),
            2.0,
        ),
        // The controlword "disable voltage", by SDO.
        Stops(
            "kind = \"foreign-frame\"\nbus = \"base\"\nid = 0x601\ndata = [0x2B, 0x40, 0x60, 0, 0, 0, 0, 0]",
            ForeignMaster,
            Bus(0),
            2.0,
        ),
        Stops("kind = \"foreign-sync\"\nbus = \"base\"\nperiod = \"1.3 ms\"", ForeignMaster, Bus(0), 4.0),
        Stops(
            "kind = \"foreign-set-points\"\naxis = \"joint1\"\nfor = \"0.2 s\"",
            ForeignMaster,
            Bus(0),
            4.0,
        ),
        Stops(
            "kind = \"foreign-nmt\"\naxis = \"joint1\"\ncommand = \"reset-communication\"",
            ForeignMaster,
            Bus(0),
            2.0,
        ),
        Stops("kind = \"duplicate\"\nbus = \"base\"", DuplicateNode, Axis(0), 9.0),
        // A node that takes a node ID in use boots first.
        Stops("kind = \"duplicate-node\"\naxis = \"joint1\"", UnexpectedBootUp, Axis(0), 2.0),
        Stops("kind = \"emergency\"\naxis = \"joint1\"\ncode = 0x4210", EmergencyMessage, Axis(0), 6.0),
        Stops(
            "kind = \"encoder-jump\"\naxis = \"joint1\"\nby = \"3 deg\"",
            ImplausibleFeedback,
            Axis(0),
            3.0,
        ),
        Stops("kind = \"echo-loss\"\nbus = \"wrist\"\nfor = \"100 ms\"", NotTransmitted, Bus(1), 7.0),
        Stops("kind = \"bus-off\"\nbus = \"wrist\"", BusLost, Bus(1), 1.0),
        Stops("kind = \"bus-off\"\nbus = \"wrist\"\nrestart = \"100 ms\"", BusLost, Bus(1), 1.0),
        Stops("kind = \"interface-down\"\nbus = \"base\"\nfor = \"100 ms\"", BusLost, Bus(0), 1.0),
        // The following error must first exceed 0.1 rad, and then last for 50 ms.
        Stops("kind = \"stall\"\naxis = \"joint1\"", FollowingError, Axis(0), 200.0),
        Stops("kind = \"stuck-brake\"\naxis = \"joint1\"", FollowingError, Axis(0), 200.0),
        Stops("kind = \"drop\"\naxis = \"joint1\"\nfunction = \"rpdo\"", FollowingError, Axis(0), 200.0),
        Stops("kind = \"wrong-mapping\"\naxis = \"joint1\"", ImplausibleFeedback, Axis(0), 3.0),
        Stops("kind = \"mode-display\"\naxis = \"joint4\"\nmode = 1", ModeChanged, Axis(3), 2.0),
        Stops("kind = \"torque-off\"\naxis = \"joint4\"", DriveDisabled, Axis(3), 2.0),
        Stops("kind = \"alarm\"\naxis = \"joint4\"\ncode = 0x7500", DriveFault, Axis(3), 2.0),
        Stops("kind = \"over-voltage\"\naxis = \"joint2\"", DriveFault, Axis(1), 2.0),
        Stops("kind = \"over-temperature\"\naxis = \"joint2\"", DriveFault, Axis(1), 2.0),
        Stops("kind = \"battery\"\naxis = \"joint2\"", DriveFault, Axis(1), 2.0),
        Stops("kind = \"statusword\"\naxis = \"joint2\"\nset = 0x0008", DriveFault, Axis(1), 2.0),
    ]
};

#[test]
fn every_fault_with_a_rule_stops_the_whole_arm_in_time_with_the_reason() {
    for Stops(fault, rule, origin, within_ms) in STOPS {
        let played = in_motion(fault);
        assert_safe(fault, &played);
        let Some(stop) = played.stops.first() else { panic!("{fault}: {:?}", played.outcome) };
        assert_eq!((stop.rule(), stop.origin), (rule, origin), "{fault}");
        assert_eq!((stop.category, stop.phase), (StopCategory::One, Phase::Moving), "{fault}");
        assert!(played.detection_ms.is_some_and(|ms| (0.0..=within_ms).contains(&ms)), "{fault}: {played:?}");
        assert_eq!(played.phases.last(), Some(&Phase::Disabled), "{fault}: {:?}", played.phases);
        assert!(matches!(played.outcome, Some(Outcome::Stopped(_))), "{fault}: {:?}", played.outcome);
    }
}

/// The feedback of every cycle shows that a drive works. If the drive also has a heartbeat, that is monitored too: it
/// is lost after three periods.
#[test]
fn a_drive_that_loses_its_heartbeat_stops_the_whole_arm_although_its_feedback_continues() {
    let mut config = arm();
    config.axes[3].heartbeat_ns = Some(20_000_000);
    let fault = "kind = \"drop\"\naxis = \"joint4\"\nfunction = \"heartbeat\"\ndirection = \"received\"";
    let played = play(&config, &format!("[[fault]]\n{fault}\n{IN_MOTION}"));
    assert_safe(fault, &played);
    let [stop] = played.stops.as_slice() else { panic!("{:?}", played.outcome) };
    assert_eq!((stop.rule(), stop.axis(), stop.category), (Rule::NodeLost, Some(3), StopCategory::One));
    assert_eq!(stop.cause.numbers(), (61.0, 60.0));
    let well = play(&config, "[[fault]]\nkind = \"drop\"\nbus = \"base\"\nat = \"1000 s\"");
    assert_eq!(well.outcome, Some(Outcome::Finished));
}

/// Faults of one axis or one bus in the fast part of a move, and the axes that still follow.
const COORDINATED: [(&str, std::ops::Range<usize>); 10] = [
    ("kind = \"alarm\"\naxis = \"joint1\"\ncode = 0x4310", 1..6),
    ("kind = \"over-current\"\naxis = \"joint1\"", 1..6),
    ("kind = \"reboot\"\naxis = \"joint1\"", 1..6),
    ("kind = \"silent-node\"\naxis = \"joint1\"", 1..6),
    ("kind = \"stall\"\naxis = \"joint1\"", 1..6),
    ("kind = \"mode-display\"\naxis = \"joint1\"\nmode = 1", 0..6),
    ("kind = \"foreign-nmt\"\naxis = \"joint1\"\ncommand = \"pre-operational\"", 1..6),
    ("kind = \"bus-off\"\nbus = \"base\"", 3..6),
    ("kind = \"torque-off\"\naxis = \"joint1\"", 1..6),
    ("kind = \"echo-loss\"\nbus = \"base\"\nfor = \"100 ms\"", 3..6),
];

#[test]
fn the_axes_that_still_follow_decelerate_within_their_limits() {
    for (fault, obeying) in COORDINATED {
        let text = format!("[[fault]]\n{fault}\nwhen = \"moving\"\nat = \"900 ms\"");
        let played = play(&arm(), &text);
        let Some(Outcome::Stopped(stop)) = &played.outcome else { panic!("{fault}: {:?}", played.outcome) };
        assert_eq!(stop.category, StopCategory::One, "{fault}: the stop became harder on its way");
        // The control loops of the drives overshoot a little when the acceleration changes.
        let largest = played.accelerations[obeying].iter().copied().fold(0.0, f64::max);
        assert!(largest < 1.6, "{fault}: {:?} acceleration limits", played.accelerations);
    }
}

#[test]
fn the_code_of_an_alarm_is_the_value_of_the_stop() {
    let played = in_motion("kind = \"alarm\"\naxis = \"joint4\"\ncode = 0x7500");
    assert_eq!(played.stops[0].cause.numbers().0, f64::from(0x7500));
    assert_eq!(played.emergencies, [(3, 0x7500)]);
}

/// Faults that the machine must tolerate.
const BORNE: [&str; 12] = [
    "kind = \"delay\"\nbus = \"base\"\nfunction = \"tpdo\"\nby = \"100 us\"",
    "kind = \"delay\"\nbus = \"base\"\nfunction = \"tpdo\"\nby = \"1 cycles\"\nfor = \"5 cycles\"",
    "kind = \"delay\"\nbus = \"wrist\"\nfunction = \"tpdo\"\nby = \"3 cycles\"\nprobability = \"2 %\"",
    "kind = \"drop\"\nbus = \"base\"\nfunction = \"tpdo\"\nfor = \"5 cycles\"",
    "kind = \"drop\"\nbus = \"base\"\nfunction = \"tpdo\"\nprobability = \"2 %\"",
    "kind = \"duplicate\"\nbus = \"base\"\nprobability = \"5 %\"",
    "kind = \"reorder\"\nbus = \"base\"",
    "kind = \"delay\"\nbus = \"base\"\nfunction = \"rpdo\"\nby = \"30 us\"",
    "kind = \"echo-loss\"\nbus = \"base\"\nfor = \"3 cycles\"",
    "kind = \"stall\"\naxis = \"joint1\"\nfor = \"20 ms\"",
    "kind = \"load\"\naxis = \"joint1\"\ntorque = \"20 Nm\"",
    "kind = \"stuck-sdo\"\naxis = \"joint1\"\nfor = \"0.5 s\"",
];

#[test]
fn tolerated_faults_do_not_stop_the_machine() {
    for fault in BORNE {
        let played = in_motion(fault);
        assert_safe(fault, &played);
        assert_eq!(played.outcome, Some(Outcome::Finished), "{fault}");
    }
}

#[test]
fn an_error_passive_interface_stops_the_arm_but_keeps_it_enabled() {
    let played = in_motion("kind = \"error-passive\"\nbus = \"wrist\"\nfor = \"0.5 s\"");
    let [stop] = played.stops.as_slice() else { panic!("{:?}", played.outcome) };
    assert_eq!((stop.rule(), stop.category), (Rule::BusErrorPassive, StopCategory::Two));
}

#[test]
fn an_interface_that_goes_bus_off_after_error_passive_disables_the_arm() {
    let played = play(
        &arm(),
        "[[fault]]\nkind = \"error-passive\"\nbus = \"wrist\"\nfor = \"20 ms\"\nwhen = \"moving\"\nat = \"300 ms\"\n\
         [[fault]]\nkind = \"bus-off\"\nbus = \"wrist\"\nwhen = \"stopping\"\nat = \"20 ms\"",
    );
    assert_safe("error-passive, then bus-off", &played);
    assert_eq!(played.stops.len(), 1);
    let Some(Outcome::Stopped(stop)) = played.outcome else { panic!("{:?}", played.outcome) };
    assert_eq!(stop.rule(), Rule::BusErrorPassive);
    assert!(!played.phases[2..].ends_with(&[Phase::Stopping, Phase::Holding]), "{:?}", played.phases);
    assert_eq!(played.phases.last(), Some(&Phase::Disabled));
}

#[test]
fn a_single_wrong_statusword_neither_stops_the_arm_nor_disturbs_its_motion() {
    let played = in_motion("kind = \"statusword\"\naxis = \"joint2\"\nclear = 0x0004\nfor = \"1 cycles\"");
    assert_eq!(played.outcome, Some(Outcome::Finished));
    let largest = played.accelerations.iter().copied().fold(0.0, f64::max);
    assert!(largest < 1.6, "{:?} acceleration limits", played.accelerations);
}

/// Faults without a rule that must detect them. Whatever the controller does, it is safe.
const WITHOUT_A_RULE: [&str; 6] = [
    "kind = \"drop\"\nbus = \"base\"\nfunction = \"heartbeat\"",
    "kind = \"delay\"\nbus = \"base\"\nby = \"300 us\"",
    "kind = \"corrupt\"\nbus = \"base\"\nfunction = \"rpdo\"\ncount = 20",
    "kind = \"corrupt\"\nbus = \"base\"\npart = \"identifier\"\nprobability = \"10 %\"",
    "kind = \"foreign-frame\"\nbus = \"base\"\nid = 0x123\nperiod = \"1 ms\"",
    "kind = \"statusword\"\naxis = \"joint1\"\nset = 0x0080",
];

#[test]
fn no_fault_makes_a_set_point_jump_and_the_arm_is_at_standstill_at_the_end() {
    for fault in WITHOUT_A_RULE {
        assert_safe(fault, &in_motion(fault));
    }
}

#[test]
fn a_node_that_reboots_in_motion_does_not_take_part_any_more() {
    let played = in_motion("kind = \"reboot\"\naxis = \"joint6\"");
    let stopping = played.phases.iter().position(|phase| *phase == Phase::Stopping).unwrap();
    assert!(!played.phases[stopping..].contains(&Phase::Enabling), "{:?}", played.phases);
}

#[test]
fn the_state_of_an_interface_is_reported_while_it_lasts_and_its_errors_stay_counted() {
    let shown = |fault: &str| in_motion(fault).health[1];
    let passive = shown("kind = \"error-passive\"\nbus = \"wrist\"");
    assert_eq!((passive.state, passive.errors), (BusState::ErrorPassive, 1));
    let recovered = shown("kind = \"error-passive\"\nbus = \"wrist\"\nfor = \"100 ms\"");
    assert_eq!((recovered.state, recovered.errors), (BusState::ErrorActive, 1));
    assert_eq!(shown("kind = \"bus-off\"\nbus = \"wrist\"").state, BusState::BusOff);
    assert_eq!(shown("kind = \"interface-down\"\nbus = \"wrist\"").state, BusState::Down);
}

#[test]
fn a_drive_without_sdo_replies_cannot_be_brought_up() {
    let played = play(&arm(), "[[fault]]\nkind = \"stuck-sdo\"\naxis = \"joint2\"\nwhen = \"start\"");
    assert!(matches!(played.outcome, Some(Outcome::BringUpFailed(_))), "{:?}", played.outcome);
}

#[test]
fn a_second_fault_while_stopping_does_not_become_the_reason() {
    let played = play(
        &arm(),
        "[[fault]]\nkind = \"torque-off\"\naxis = \"joint5\"\nwhen = \"moving\"\nat = \"300 ms\"\n\
         [[fault]]\nkind = \"over-voltage\"\naxis = \"joint1\"\nwhen = \"stopping\"\nat = \"20 cycles\"",
    );
    assert_safe("two at once", &played);
    assert_eq!((played.stops[0].rule(), played.stops[0].axis()), (Rule::DriveDisabled, Some(4)));
    assert_eq!(played.emergencies, [(0, 0x3210)]);
    assert!(!played.phases.contains(&Phase::Holding) || played.phases.last() == Some(&Phase::Disabled));
}
