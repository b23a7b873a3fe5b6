//! What storms have found, one case each.

use takt::Interrupt;
use takt::config::{ProgramMove, ProgramTarget};

use crate::case::{Case, Hardship, scenario};
use crate::dice::Dice;
use crate::machine::load;
use crate::overload::Overload;
use crate::run::play;

/// A move of all axes of a configuration from the middle of the first half of their travel, with these faults.
fn moving(name: &'static str, text: &str) -> Case {
    let mut config = load(name);
    let to = config.axes.iter().map(|axis| 0.75 * axis.limits.position_max);
    config.program.moves = vec![ProgramMove {
        group: 0,
        target: ProgramTarget::Position(to.collect()),
        velocity_scale: 1.0,
        acceleration_scale: 1.0,
        minimum_duration_s: 0.0,
        dwell_s: 0.0,
    }];
    let scenario = scenario(text, &config);
    Case {
        config,
        text: text.to_owned(),
        scenario,
        is_serving: false,
        clients: 0,
        length: 3000,
        interrupt: Interrupt::Controlled,
        broken_off: None,
        hardship: Hardship::default(),
        has_every_kind_of_point: false,
        has_callbacks: false,
        has_mode_changes: false,
        has_trajectories: false,
        overload: Overload::default(),
        dice: Dice::new(0),
    }
}

#[test]
fn a_drive_that_is_latched_off_while_it_still_follows_gets_no_step_to_where_it_is() {
    // Set-points lie too long on both buses; the drives are enabled and a following error behind.
    let delay = |place: &str, by_us: u32, at_ms: u32| {
        format!(
            "[[fault]]\nkind = \"delay\"\n{place}\nby = \"{by_us} us\"\nwhen = \"moving\"\nat = \"{at_ms} ms\"\n"
        )
    };
    let delayed = delay("axis = \"pitch\"", 2312, 312) + &delay("bus = \"arm\"", 2293, 439);
    play(&moving("mixed-arm", &delayed)).unwrap();
}

#[test]
fn a_stop_ends_whose_set_points_are_never_confirmed_whatever_its_reason() {
    let two = "[[fault]]\nkind = \"duplicate\"\nbus = \"can\"\ncopies = 2\nwhen = \"moving\"\nat = \"118 ms\"\n\
               [[fault]]\nkind = \"echo-loss\"\nbus = \"can\"\nwhen = \"moving\"\nat = \"132 ms\"\n";
    play(&moving("erob-modes/erob-ip", two)).unwrap();
}

#[test]
fn a_bus_that_is_lost_soon_after_the_axes_are_enabled_is_noticed_by_its_drives() {
    for at_ms in (5..100).step_by(20) {
        let lost = format!(
            "[[fault]]\nkind = \"bus-off\"\nbus = \"wrist\"\nwhen = \"moving\"\nat = \"{at_ms} ms\"\n"
        );
        let played = play(&moving("arm6-erob-cst", &lost));
        assert!(played.is_ok(), "at {at_ms} ms: {played:?}");
    }
}

#[test]
fn a_bus_that_is_lost_while_the_axes_are_enabled_is_noticed_by_its_drives() {
    for at_ms in 236..256 {
        let lost =
            format!("[[fault]]\nkind = \"bus-off\"\nbus = \"arm\"\nwhen = \"start\"\nat = \"{at_ms} ms\"\n");
        let played = play(&moving("mixed-arm", &lost));
        assert!(played.is_ok(), "at {at_ms} ms: {played:?}");
    }
}

#[test]
fn an_axis_whose_bus_is_behind_for_a_moment_while_another_one_is_lost_stops_at_its_limits() {
    let fault = |rest: &str| format!("[[fault]]\nwhen = \"moving\"\n{rest}\n");
    let lost = fault("kind = \"interface-down\"\nbus = \"base\"\nat = \"424 ms\"");
    for at_ms in 424..440 {
        let delay = "kind = \"delay\"\naxis = \"joint4\"\nfunction = \"rpdo\"\nby = \"2767 us\"\ncount = 1";
        let played =
            play(&moving("arm6-erob", &(lost.clone() + &fault(&format!("{delay}\nat = \"{at_ms} ms\"")))));
        assert!(played.is_ok(), "at {at_ms} ms: {played:?}");
    }
}

#[test]
fn a_stop_in_coordination_leads_no_joint_beyond_its_position_limit() {
    // The wrist is nearly there when the slower joints still have a long way to stop.
    for length in (300..1500).step_by(25) {
        let mut case = moving("arm6-erob", "");
        let to = case.config.axes.iter().map(|axis| axis.limits.position_max - 1e-4);
        case.config.program.moves[0].target = ProgramTarget::Position(to.collect());
        let played = play(&Case { length, ..case });
        assert!(played.is_ok(), "interrupted after {length} cycles: {played:?}");
    }
}

/// What each of them has found.
const FAILED_ONCE: [(u64, &str); 22] = [
    (1875, "An event timer that was set before operational woke a YZ-AIM in every nanosecond"),
    (3022, "A YZ-AIM whose communication has been reset watches the controller for 2 s"),
    (823, "A clamped stream expired too near to a position limit for a stop with limited jerk"),
    (898, "A group was enabled anew while the controlwords that disabled it were under way"),
    (206, "A joint was enabled while it was coasting"),
    (613, "A stream was stopped with a joint in profile torque, and its drive's quick stop taken back"),
    (8727, "A run that was cut off ended before the SYNC at which its last controlwords act"),
    (
        21647,
        "A move passed its target so fast, and so near to a position limit, that nothing could stop it before",
    ),
    (
        43967,
        "Another client enabled the group while the run shut down, which switched the drives' watchdogs off",
    ),
    (33837, "A stop from a stream leapt from an acceleration that only the other direction allows"),
    (
        45278,
        "A command that had been bridged was in the third difference over a slower bus' steps when a stop began",
    ),
    (
        10486,
        "A drive had said by SDO that it was off, and the set-points that it was believed to follow broke off",
    ),
    (4572, "A group was called disabled while the word that enabled a drive was on the wire"),
    (14435, "A reset waited for longer than a reset may take while a flood kept the bus busy"),
    (23840, "A load came up after the run, in the time in which the joints were watched for rest"),
    (24065, "A drive had torque for a part of the cycle, from frames that were corrupted"),
    (
        1_007_267,
        "A stop in profile position kept a target that was too near, and its turning point was taken for rest",
    ),
    (
        37621,
        "A stop in profile position right after missed slots was led far beyond where the joint could have stopped",
    ),
    (
        1_012_241,
        "A run that was cut off left while the queue was full, and a drive without a watchdog enabled",
    ),
    (
        5651,
        "A drive came back when it had been told only once to take no process data, and another master enabled it",
    ),
    (
        775,
        "A stream beyond a position limit, by less than the tolerance, was stopped with more jerk than the limit",
    ),
    (19907, "A servo was homing, by a mode that no controlword ends, and went on when the run was over"),
];

/// The same of those that are played with their hardships.
const FAILED_IN_HARDSHIP: [(u64, &str); 10] = [
    (
        31_122_035_928,
        "A joint beyond a position limit was streamed outward by the rounding of its way back, and its stop failed",
    ),
    (
        424_242_380,
        "Two buses that were behind in turn were taken for one that does not transmit, and the wrong one was named",
    ),
    (
        99_906_829,
        "A stream that leapt at its start was let pass, since the cycle before its first command had none",
    ),
    (88_124_920, "A joint in cyclic torque swung about its set-point, and its power was taken while it did"),
    (
        31_415_936_809,
        "A reset was asked for, and granted after the next fault: the storm took it for one that was not asked for",
    ),
    (
        7_002_676,
        "A joint in profile velocity was told to turn round, and its power was taken as it stood on its way",
    ),
    (7_002_556, "The power of a joint was taken that was still behind its set-point"),
    (9_005_759, "A stop so near to a position limit that it swings back takes longer than was stated"),
    (
        9_009_552,
        "A joint that coasted seemed to stand in the report after slots that were missed, and was enabled",
    ),
    (20_005_131, "A client that went on moving the group kept the run from ending"),
];

/// The same of those on a machine that has too little time.
const FAILED_IN_OVERLOAD: [(u64, &str); 13] = [
    (
        424_242_620,
        "A drive reported a fault for want of the heartbeat of a machine that was late in every cycle",
    ),
    (
        987_655_925,
        "A slow bus sent three steps in one of its cycles, after commands that were ready too late",
    ),
    (424_246_056, "Set-points that had still to leave were counted as steps of the trajectory"),
    (
        987_601_957,
        "A stream was caught up with so fast that its stop broke the velocity limit, and the set-point stood still at once",
    ),
    (
        20_261_139_288,
        "A slow bus was behind in each of its cycles and caught up between them: nothing stopped its drives, nor the stop",
    ),
    (
        20_261_130_161,
        "The simulated drives paused while the controller was away, and their own reaction took too long",
    ),
    (
        20_261_137_250,
        "A YZ-AIM that had missed the heartbeat took its power, and lost it when its alarm was over",
    ),
    (20_261_158_104, "A YZ-AIM missed the heartbeat after SYNC had been late, and took its power in a stop"),
    (
        20_261_144_365,
        "A YZ-AIM missed the heartbeat of a machine that computed too slowly, and took its power in a move",
    ),
    (
        20_261_139_125,
        "The heartbeat of an eRob that had missed ours said that it is stopped: it had no fault of its own",
    ),
    (
        20_261_159_993,
        "A drive said that it is stopped after the client had held the thread up, while it was to be enabled",
    ),
    (
        20_261_129_837,
        "A drive said that it is stopped while it was to be enabled on a machine that computed too slowly",
    ),
    (
        20_280_045_733,
        "A bus that had been behind for two cycles sent the way of three in one, faster than the velocity limit",
    ),
];

/// The same of those with everything: several groups, trajectories, callbacks, and points of every kind.
const FAILED_WITH_EVERYTHING: [(u64, &str); 38] = [
    (
        1_300_010_978,
        "A drive without a heartbeat consumer, on an interface that was down while its group was disabled, kept its torque",
    ),
    (1_300_010_262, "The same, on an interface that was down beyond the end of the run, and was not reached"),
    (1_300_021_478, "A joint whose loop is closed here swung after nine missed slots"),
    (34_714, "A stream that ran dry came to rest by the acceleration limit, too late for the position limit"),
    (27_432, "A bring-up took the heartbeat consumer from a drive that had kept its torque"),
    (11_882, "The same in profile velocity"),
    (
        40_011_225_717,
        "A gentle move that began while a joint was about to turn round broke the velocity limit",
    ),
    (
        40_011_223_249,
        "A group paused for a slot in which its slow bus still sent the frames of its last cycle",
    ),
    (40_011_226_356, "A drive caught up with more than 1.3 times the velocity limit after many missed slots"),
    (
        50_011_237_121,
        "A disabled group was asked for two stops in one cycle, and the group that stops with it got the weaker one",
    ),
    (
        50_011_257_648,
        "A joint in cyclic torque turned round to its set-point, and its power was taken on the way",
    ),
    (
        50_011_261_201,
        "A joint in cyclic velocity turned round to its set-point, and its power was taken on the way",
    ),
    (60_000_018_304, "Before the first cycle, the state of a controller of several groups had only one"),
    (
        61_000_002_145,
        "A YZ-AIM took its power when it missed the heartbeat, and coasted for longer than a stop may last",
    ),
    (
        61_000_000_883,
        "A stop was asked to be harder, and brought back its fault to a group that had reset it and moved again",
    ),
    (
        62_000_014_913,
        "A gentle move turned a joint outward that was coming back from beyond a position limit",
    ),
    (62_000_047_392, "A drive caught up with its own highest velocity after 66 missed slots in a row"),
    (
        66_000_012_085,
        "A stop for a joint that a torque drove did not count the cycles for which set-points wait for a slower bus",
    ),
    (
        66_000_032_281,
        "A drive that had heard no heartbeat yet was cut off with its bus, and nothing could stop it",
    ),
    (
        67_000_011_973,
        "A YZ-AIM whose alarm ended by itself was enabled again after its group was disabled, for want of another controlword",
    ),
    (
        11_072,
        "A drive without a fault was enabled after a bring-up that another one had failed, and its silence stopped the group",
    ),
    (30_375, "The same in one of three groups"),
    (32_006, "The same, with the boot-up message of the drive, which the bring-up had reset"),
    (65_000_032_737, "The correction of a velocity stayed as it was when the feedback did not come any more"),
    (9_123, "A fault was reset before the group that stops with this one had stopped for it"),
    (34_885, "A group was enabled after a stop of the same cycle, and stopped by it"),
    (38_616, "A group moved and was disabled after a stop of the same cycle, and stopped by it"),
    (12_763, "The same, with three groups"),
    (20_099, "The feedback of a bus that is too slow did not come in time, and the joint moved unseen"),
    (7_771, "A fault was reset in the cycle in which a drive that had been silent confirmed that it is off"),
    (200_041_973, "The reset of the bring-up hid a fault that had stopped the group"),
    (
        300_011_217,
        "A group was enabled while one that it stops with coasted after a heartbeat was missed, and the storm blamed the controller",
    ),
    (300_023_254, "The same, with a fault of another drive"),
    (
        500_029_916,
        "A drive whose power was taken while its set-points waited got the way of all of them in one cycle",
    ),
    (
        300_039_251,
        "A stream led a joint back from beyond a position limit, which turned outward and inward again within a cycle, and was stopped",
    ),
    (
        700_018_378,
        "A corrupted command enabled a drive for less than a cycle, and the storm blamed a joint without torque that moved",
    ),
    (700_032_029, "A joint caught up after a pause, and the storm took its following error for unfounded"),
    (
        900_007_815,
        "A drive followed again after it had missed the heartbeat for a moment, and the storm blamed the controller",
    ),
];

/// The same of those whose streams command every kind of point.
const FAILED_WITH_POINTS: [(u64, &str); 4] = [
    (15_037, "A stream of velocities turned a joint outward again beyond its position limit"),
    (14_174, "A group that began to enable its drives took the power from those of another one"),
    (6_095, "A stream that began with an impedance was stopped in its first cycle"),
    (
        300_000_045,
        "A group was enabled while one that it stops with coasted after a heartbeat was missed, and the storm blamed the controller",
    ),
];

/// The same of those on machines of bit fields.
const FAILED_WITH_BIT_FIELDS: [(u64, &str); 7] = [
    (20_268, "A drive that does not show its torque was left while its stops were corrupted"),
    (20_443, "The same, with a fault of the other drive in the stop"),
    (3_001_699, "The same, after both drives had failed"),
    (3_002_429, "One corrupted reply with an error counted as a drive that has stopped"),
    (3_019_548, "A drive whose start had no reply, because the bus was lost, was not told to stop"),
    (
        3_001_546,
        "A joint swung while the loop was away that gives it torque, and the storm blamed the controller",
    ),
    (4_000_594, "A joint without a brake coasted after its run, which the storm had not watched for so long"),
];

/// Seeds of storms over drives that are spoken to outside of the cycle that have failed.
const FAILED_OFF_CYCLE: [(u64, &str); 1] =
    [(2_000_080, "A bus that was behind for good kept the command to disable from the drive")];

#[test]
fn a_drive_on_a_serial_line_that_is_enabled_after_a_stop_is_not_taken_for_disabled() {
    play(&Case::on_a_line(930_000_066)).unwrap();
}

#[test]
fn a_drive_on_a_serial_line_is_stopped_by_who_speaks_to_it_when_the_loop_was_away() {
    play(&Case::on_a_line(1_100_000_092)).unwrap();
}

#[test]
fn storms_that_have_failed_with_off_cycle_drives_pass() {
    for (seed, what) in FAILED_OFF_CYCLE {
        let played = play(&Case::of_off_cycle(seed));
        assert!(played.is_ok(), "{seed}, {what}: {played:?}");
    }
}

#[test]
fn storms_that_have_failed_with_bit_fields_pass() {
    for (seed, what) in FAILED_WITH_BIT_FIELDS {
        let played = play(&Case::of_bit_fields(seed));
        assert!(played.is_ok(), "{seed}, {what}: {played:?}");
    }
}

#[test]
fn storms_that_have_failed_with_everything_pass() {
    for (seed, what) in FAILED_WITH_EVERYTHING {
        let played = play(&Case::of(seed));
        assert!(played.is_ok(), "{seed}, {what}: {played:?}");
    }
    for (seed, what) in FAILED_WITH_POINTS {
        let mut case = Case { has_every_kind_of_point: true, is_serving: true, ..Case::of(seed) };
        case.clients = case.clients.max(1);
        let played = play(&case);
        assert!(played.is_ok(), "{seed}, {what}: {played:?}");
    }
}

#[test]
fn storms_that_have_failed_in_overload_pass() {
    for (seed, what) in FAILED_IN_OVERLOAD {
        let played = play(&Case::in_overload(seed));
        assert!(played.is_ok(), "{seed}, {what}: {played:?}");
    }
}

#[test]
fn storms_that_have_failed_in_hardship_pass() {
    for (seed, what) in FAILED_IN_HARDSHIP {
        let played = play(&Case::in_hardship(seed));
        assert!(played.is_ok(), "{seed}, {what}: {played:?}");
    }
}

#[test]
fn storms_that_have_failed_once_pass() {
    for (seed, what) in FAILED_ONCE {
        let played = play(&Case::plain(seed));
        assert!(played.is_ok(), "{seed}, {what}: {played:?}");
    }
}
