//! Which configurations the buses can carry, and what is said of those that they cannot.

use std::fmt::Write;
use std::path::Path;

use takt::bus::schedule::{self, BusSchedule, MessageKind, Remedy, Shortfall};
use takt::config::Config;

/// So many eRobs on one bus, with additions to every axis.
fn erobs(axes: usize, cycle: &str, bus: &str, axis: &str) -> Config {
    let mut text = format!("name = \"erobs\"\n[cycle]\n{cycle}\n[[bus]]\nname = \"bus\"\n{bus}\n");
    for node in 1..=axes {
        let limits = "limits = { position = [-1, 1], velocity = 1, acceleration = 1, torque = 1 }";
        let head =
            format!("[[axis]]\nname = \"a{node}\"\nbus = \"bus\"\nnode = {node}\ndrive = \"erob-canopen\"");
        let _ = writeln!(text, "{head}\n{limits}\n{axis}");
    }
    Config::parse("erobs.toml", &text).unwrap_or_else(|error| panic!("{:?}", miette::Report::new(error)))
}

fn analyse(config: &Config) -> BusSchedule {
    schedule::analyse(config).remove(0)
}

#[test]
fn every_configuration_that_comes_with_takt_fits() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
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
    // Our heartbeat (65) may be on the wire when SYNC is due.
    assert_eq!(slot.wait_before_sync_ns, 65_000);
    assert_eq!(slot.feedback_done_ns, 65_000 + 55_000 + 20_000 + 3 * 115_000);
    assert_eq!(slot.set_points_done_ns, 550_000 + 3 * 115_000);
    assert_eq!(slot.command_phases_ns, Some((485_000, 1_000_000 - 3 * 115_000 - 65_000)));
    assert_eq!(slot.emergency_ns, 135_000);
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
    feedback      830 µs = 65 wait + 55 SYNC + 20 drives' delay + 0 wait + 690 frames; command phase at 550 µs: 280 \
         µs LATE
    set-points    1240 µs = 550 command phase + 0 wait + 690 frames; next SYNC at 1000 µs: 240 µs LATE
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
    let config = erobs(3, "", "sdo_while_enabled = false", "heartbeat = \"100 ms\"");
    let remedies = analyse(&config).remedies;
    assert_eq!(
        remedies,
        [
            Remedy::DriveHeartbeatsOff,
            Remedy::MoreBuses { axes_per_bus: 2, buses: 2 },
            Remedy::LongerPeriod { period_ns: 2_000_000 }
        ]
    );
    assert!(schedule::verify(&erobs(3, "", "", "")).is_ok());
    assert!(schedule::verify(&erobs(2, "", "", "heartbeat = \"100 ms\"")).is_ok());
    assert!(schedule::verify(&erobs(3, "period = \"2 ms\"", "", "heartbeat = \"100 ms\"")).is_ok());
}

#[test]
fn an_impossible_command_phase_is_answered_with_the_possible_ones() {
    let early = analyse(&erobs(3, "command_phase = 0.4", "", ""));
    assert_eq!(early.shortfalls.len(), 1);
    let phases = Remedy::CommandPhase { earliest_ns: 485_000, latest_ns: 590_000 };
    assert_eq!(early.remedies.first(), Some(&phases));
    assert!(schedule::verify(&erobs(3, "command_phase = \"485 us\"", "", "")).is_ok());
    assert!(schedule::verify(&erobs(3, "command_phase = \"590 us\"", "", "")).is_ok());
    assert!(schedule::verify(&erobs(3, "command_phase = \"484 us\"", "", "")).is_err());
}

#[test]
fn larger_feedback_is_named_as_the_cause_where_it_is() {
    let config = erobs(3, "", "", "feedback = [\"velocity\", \"torque\", \"current\"]");
    assert!(analyse(&config).remedies.contains(&Remedy::SmallerFeedback));
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
    assert!(matches!(sdo(&with)[..], [(true, Some(_))]));
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
fn one_emergency_adds_its_own_time_to_what_it_meets() {
    let schedule = analyse(&erobs(3, "", "", ""));
    for message in &schedule.messages {
        let (Some(regular), Some(with)) = (message.response_ns, message.response_with_emergency_ns) else {
            continue;
        };
        match message.kind {
            // A lower message that blocks; the emergency is longer than the feedback that blocks SYNC otherwise.
            MessageKind::Sync => assert_eq!((regular, with), (170_000, 190_000)),
            MessageKind::Emergency => assert_eq!(regular, with),
            MessageKind::Feedback | MessageKind::SetPoint => assert_eq!(with, regular + 135_000),
            _ => assert!(with >= regular + 135_000),
        }
    }
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
