//! Which configurations the buses can carry, and what is said of those that they cannot.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use takt::config::{Config, Feedback};
use takt::schedule::{self, BusSchedule, MessageKind, Remedy, Shortfall};

/// So many eRobs on one bus, with additions to every axis. They report statusword and position and no more, unless that says
/// what else: it is what the field notes reckon with.
fn erobs(axes: usize, cycle: &str, bus: &str, axis: &str) -> Config {
    let mut text = format!("name = \"erobs\"\n[cycle]\n{cycle}\n[[bus]]\nname = \"bus\"\n{bus}\n");
    for node in 1..=axes {
        let limits = "limits = { position = [-1, 1], velocity = 1, acceleration = 1, torque = 1 }";
        let head =
            format!("[[axis]]\nname = \"a{node}\"\nbus = \"bus\"\nnode = {node}\ndrive = \"erob-canopen\"");
        let feedback = if axis.contains("feedback =") { "" } else { "feedback = []" };
        let _ = writeln!(text, "{head}\n{limits}\n{feedback}\n{axis}");
    }
    Config::parse("erobs.toml", &text).unwrap_or_else(|error| panic!("{:?}", miette::Report::new(error)))
}

fn analyse(config: &Config) -> BusSchedule {
    schedule::analyse(config).remove(0)
}

#[test]
fn every_configuration_that_comes_with_takt_fits() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let files = |folder| std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let is_configuration = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "toml");
    for path in files(folder.clone()).chain(files(folder.join("erob-modes"))).filter(is_configuration) {
        let config = Config::load(&path).unwrap_or_else(|error| panic!("{:?}", miette::Report::new(error)));
        let buses = schedule::verify(&config).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        assert_eq!(buses.len(), config.buses.len());
    }
}

/// Section 4 of the field notes: SYNC plus one 6-byte RPDO and one 6-byte TPDO per axis.
#[test]
fn the_sums_of_the_field_notes_are_reproduced() {
    for (axes, microseconds) in [(3, 745), (4, 975), (6, 1435)] {
        let schedule = analyse(&erobs(axes, "", "", ""));
        assert_eq!(schedule.slot.process_data_ns, microseconds * 1000, "{axes} axes");
    }
}

#[test]
fn three_erobs_fit_one_bus_at_a_millisecond_and_four_do_not() {
    assert!(schedule::verify(&erobs(3, "", "", "")).is_ok());
    let refused = schedule::verify(&erobs(4, "", "", "")).unwrap_err();
    let shortfalls = &refused.buses[0].shortfalls;
    assert!(matches!(shortfalls[..], [Shortfall::FeedbackLate { .. }, Shortfall::SetPointsLate { .. }, ..]));
}

#[test]
fn the_worst_slot_of_three_erobs_is_the_sum_of_its_parts() {
    let slot = analyse(&erobs(3, "", "", "")).slot;
    // Our heartbeat (65) follows the set-points and has left when SYNC is due.
    assert!(slot.is_queue_empty_at_sync);
    assert_eq!(slot.wait_before_sync_ns, 0);
    assert_eq!(slot.feedback_done_ns, 55_000 + 20_000 + 3 * 115_000);
    assert_eq!(slot.set_points_done_ns, 550_000 + 3 * 115_000);
    assert_eq!(slot.command_phases_ns, Some((420_000, 1_000_000 - 3 * 115_000 - 65_000)));
    assert_eq!((slot.sync_reserve_ns, slot.set_points_reserve_ns), (130_000, 40_000));
}

#[test]
fn where_our_heartbeat_has_no_room_before_sync_it_delays_sync() {
    let slot = analyse(&erobs(3, "command_phase = \"600 us\"", "", "")).slot;
    assert!(!slot.is_queue_empty_at_sync);
    assert_eq!(slot.wait_before_sync_ns, 65_000);
    assert_eq!(slot.feedback_done_ns, 65_000 + 55_000 + 20_000 + 3 * 115_000);
    assert_eq!((slot.sync_reserve_ns, slot.set_points_reserve_ns), (115_000, 55_000));
}

#[test]
fn one_emergency_is_shown_with_what_it_does_to_the_slot_and_refuses_nothing() {
    let three = analyse(&erobs(3, "", "", ""));
    let effect = three.emergency.unwrap();
    assert!(three.fits() && !effect.fits());
    assert_eq!((effect.transmission_ns, effect.feedback_late_ns), (135_000, 5_000));
    assert_eq!(effect.next_sync_late_ns, 95_000);
    assert!(analyse(&erobs(2, "", "", "")).emergency.unwrap().fits());
}

#[test]
fn a_fit_with_less_reserve_than_a_controller_needs_is_called_narrow() {
    let is_narrow =
        |phase: &str| analyse(&erobs(3, &format!("command_phase = {phase:?}"), "", "")).is_narrow();
    assert_eq!(["430 us", "440 us", "550 us", "560 us"].map(is_narrow), [true, false, false, true]);
    assert!(!analyse(&erobs(6, "", "", "")).is_narrow(), "what does not fit is not narrow");
}

#[test]
fn six_erobs_on_one_bus_are_refused_with_the_sums_and_with_what_would_fit() {
    let refused = schedule::verify(&erobs(6, "", "", "")).unwrap_err();
    assert_eq!(
        refused.buses[0].remedies,
        [Remedy::MoreBuses { axes_per_bus: 3, buses: 2 }, Remedy::LongerPeriod { period_ns: 2_000_000 }]
    );
    assert_eq!(
        refused.to_string(),
        "the bus \"bus\" cannot carry its traffic in the worst case:
    process data  1435 µs = 55 SYNC + 690 feedback + 690 set-points, in 1000 µs
    feedback      830 µs = 65 wait + 55 SYNC + 20 drives' delay + 690 feedback; command phase at 550 µs: 280 µs LATE
    set-points    1240 µs = 550 command phase + 690 set-points; next SYNC at 1000 µs: 240 µs LATE
  feedback can arrive until 830 µs, but is needed at the command phase, 550 µs
  set-points can take until 1240 µs, but the next SYNC is due at 1000 µs
  the master heartbeat has no bound, but is due within 100000 µs
  what would fit:
    - 2 buses: 3 of these axes fit one
    - a cycle of 2 ms: [cycle] period"
    );
}

#[test]
fn every_remedy_that_is_named_makes_the_bus_fit() {
    let axis = "heartbeat = \"100 ms\"";
    assert_eq!(
        analyse(&erobs(3, "", "", axis)).remedies,
        [
            Remedy::DriveHeartbeatsOff,
            Remedy::MasterHeartbeatOff,
            Remedy::MoreBuses { axes_per_bus: 2, buses: 2 },
            Remedy::LongerPeriod { period_ns: 2_000_000 }
        ]
    );
    assert!(schedule::verify(&erobs(3, "", "", "")).is_ok());
    let mut without = erobs(3, "", "", axis);
    without.master.heartbeat_ns = None;
    assert!(schedule::verify(&without).is_ok());
    assert!(schedule::verify(&erobs(2, "", "", axis)).is_ok());
    assert!(schedule::verify(&erobs(3, "period = \"2 ms\"", "", axis)).is_ok());
}

#[test]
fn where_time_does_not_fit_leaving_it_out_is_the_first_remedy() {
    let mut told = erobs(3, "", "", "heartbeat = \"100 ms\"");
    told.master.heartbeat_ns = None;
    assert!(schedule::verify(&told).is_ok());
    told.master.time_ns = Some(1_000_000_000);
    assert_eq!(analyse(&told).remedies.first(), Some(&Remedy::TimeOff));
}

#[test]
fn an_impossible_command_phase_is_answered_with_the_possible_ones() {
    let early = analyse(&erobs(3, "command_phase = 0.4", "", ""));
    assert_eq!(early.shortfalls.len(), 1);
    let phases = Remedy::CommandPhase { earliest_ns: 420_000, latest_ns: 590_000 };
    assert_eq!(early.remedies.first(), Some(&phases));
    assert!(schedule::verify(&erobs(3, "command_phase = \"420 us\"", "", "")).is_ok());
    assert!(schedule::verify(&erobs(3, "command_phase = \"590 us\"", "", "")).is_ok());
    assert!(schedule::verify(&erobs(3, "command_phase = \"419 us\"", "", "")).is_err());
}

#[test]
fn the_fewest_and_smallest_objects_whose_feedback_can_be_left_out_are_named() {
    let smaller = |cycle: &str, feedback: &str| {
        let schedule = analyse(&erobs(3, cycle, "", &format!("feedback = {feedback}")));
        schedule.remedies.into_iter().find_map(|remedy| match remedy {
            Remedy::SmallerFeedback { without } => Some(without),
            _ => None,
        })
    };
    let all = r#"["velocity", "torque", "current"]"#;
    assert_eq!(smaller("command_phase = \"420 us\"", all).map(|without| without.len()), Some(3));
    assert_eq!(smaller("command_phase = \"500 us\"", all), Some(vec![Feedback::Velocity, Feedback::Torque]));
    assert!(
        schedule::verify(&erobs(3, "command_phase = \"500 us\"", "", "feedback = [\"current\"]")).is_ok()
    );
    assert_eq!(smaller("", "[]"), None);
}

#[test]
fn fewer_service_frames_and_no_heartbeat_of_the_controller_are_named_where_they_make_the_bus_fit() {
    let sdo = "sdo_while_enabled = true\nservice_frames_per_cycle";
    let config = |frames: usize| erobs(3, "period = \"2 ms\"", &format!("{sdo} = {frames}"), "");
    let most = (1..4).rev().find(|frames| schedule::verify(&config(*frames)).is_ok()).unwrap();
    assert!(most < 3, "three service frames do not fit");
    assert!(analyse(&config(3)).remedies.contains(&Remedy::ServiceFrames { frames: most }));

    // The heartbeat would have to wait for the next slot, in the way of SYNC, and the feedback leaves no room for that.
    let mut late = erobs(3, "command_phase = \"460 us\"", "", "feedback = [\"torque\"]");
    assert!(!schedule::verify(&late).unwrap_err().buses[0].remedies.contains(&Remedy::MasterHeartbeatOff));
    late.cycle.command_phase_ns = 600_000;
    assert!(schedule::verify(&late).is_ok());
    late.axes.iter_mut().for_each(|axis| axis.feedback_delay_ns = 140_000);
    let remedies = schedule::verify(&late).unwrap_err().buses[0].remedies.clone();
    assert!(remedies.contains(&Remedy::MasterHeartbeatOff), "{remedies:?}");
    late.master.heartbeat_ns = None;
    assert!(schedule::verify(&late).is_ok());
}

#[test]
fn axes_are_spread_over_as_many_buses_as_they_need() {
    let remedy = |axes| analyse(&erobs(axes, "", "", "")).remedies[0].clone();
    assert_eq!(remedy(7), Remedy::MoreBuses { axes_per_bus: 3, buses: 3 });
    assert_eq!(remedy(4), Remedy::MoreBuses { axes_per_bus: 3, buses: 2 });
}

#[test]
fn feedback_in_every_second_sync_is_less_load_but_no_better_slot() {
    let every = analyse(&erobs(3, "", "", ""));
    let second = analyse(&erobs(3, "", "", "transmission_type = 2"));
    assert_eq!(second.slot, every.slot);
    assert!((every.load_percent - second.load_percent - 34.5 / 2.0).abs() < 1e-9);
    // Five axes overload the bus in every cycle, and leave room for the heartbeat in the long run otherwise.
    let heartbeat = |axis: &str| analyse(&erobs(5, "", "", axis)).messages.last().unwrap().response_ns;
    assert_eq!(heartbeat(""), None);
    assert!(heartbeat("transmission_type = 2").is_some());
}

#[test]
fn sdo_transfers_count_only_where_they_go_on_while_the_axes_are_enabled() {
    let sdo = |schedule: &BusSchedule| {
        let answers = schedule.messages.iter().filter(|message| message.kind == MessageKind::SdoResponse);
        answers.map(|message| (message.is_sent_while_enabled, message.response_ns)).collect::<Vec<_>>()
    };
    let without = analyse(&erobs(1, "", "", ""));
    assert_eq!(sdo(&without), [(false, None)]);
    let with = analyse(&erobs(1, "", "sdo_while_enabled = true", ""));
    assert!(matches!(sdo(&with)[..], [(true, _)]));
    assert!(!with.fits() && with.remedies.contains(&Remedy::SdoWhileDisabled));
    assert!(schedule::verify(&erobs(1, "period = \"2 ms\"", "sdo_while_enabled = true", "")).is_ok());
}

#[test]
fn messages_come_in_the_order_of_arbitration() {
    let schedule = analyse(&erobs(2, "", "", "heartbeat = \"100 ms\""));
    let ids: Vec<_> = schedule.messages.iter().map(|message| message.id).collect();
    assert_eq!(ids, [0x080, 0x081, 0x082, 0x181, 0x182, 0x201, 0x202, 0x581, 0x601, 0x701, 0x702, 0x77F]);
    let bits: Vec<_> = schedule.messages.iter().map(|message| message.bits).collect();
    assert_eq!(bits, [55, 135, 135, 115, 115, 115, 115, 135, 135, 65, 65, 65]);
}

#[test]
fn frames_of_the_controller_wait_behind_those_that_it_has_queued_before() {
    let mut config = erobs(3, "", "", "");
    let in_slot = |config: &Config| -> Vec<(String, u64, u64)> {
        let schedule = analyse(config);
        let set_points = schedule.messages.iter().filter(|message| message.kind == MessageKind::SetPoint);
        let mut bounds: Vec<_> = set_points
            .map(|m| (m.axis.clone().unwrap(), m.in_slot_ns.unwrap(), m.response_ns.unwrap()))
            .collect();
        bounds.sort();
        bounds
    };
    let regular = in_slot(&config);
    assert_eq!(regular.iter().map(|(_, ns, _)| *ns).collect::<Vec<_>>(), [665_000, 780_000, 895_000]);
    // The order of the axes decides, not the identifiers.
    config.axes[0].node = 7;
    let other = in_slot(&config);
    assert_eq!(other.iter().map(|(_, ns, _)| *ns).collect::<Vec<_>>(), [665_000, 780_000, 895_000]);
    assert_eq!(other[2].2, regular[2].2);
}

#[test]
fn the_modes_differ_in_the_length_of_the_set_points() {
    for (mode, microseconds) in [("csp", 345), ("csv", 345), ("cst", 285)] {
        let schedule = analyse(&erobs(3, "", "", &format!("mode = \"{mode}\"")));
        assert_eq!(schedule.slot.set_points_ns, microseconds * 1000, "{mode}");
    }
}

#[test]
fn feedback_on_events_stands_in_the_way_of_the_set_points_too() {
    let regular = analyse(&erobs(2, "", "", "")).slot;
    let events = analyse(&erobs(2, "", "", "transmission_type = 255")).slot;
    assert_eq!(events.set_points_done_ns, regular.set_points_done_ns + 2 * 115_000);
}

#[test]
fn the_analysis_is_plain_data() {
    let json = serde_json::to_value(analyse(&erobs(6, "", "", ""))).unwrap();
    assert_eq!(json["name"], "bus");
    assert_eq!(json["shortfalls"][0]["what"], "feedback_late");
    assert_eq!(json["shortfalls"][0]["done_ns"], 830_000);
    assert_eq!(json["remedies"][0]["change"], "more_buses");
    assert_eq!(json["messages"][0]["kind"], "sync");
    assert_eq!(json["slot"]["process_data_ns"], 1_435_000);
}
