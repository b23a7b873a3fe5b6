//! Whether requests and replies find room in the cycle.

use takt::Config;
use takt::controller::assemble;
use takt::schedule::{self, BusSchedule, MessageKind, Shortfall};

use crate::bit_fields::machine::{HOLLOW, HOLLOW_FD, text};
use crate::drive_modes::world::load;

fn motors(keys: &str, bus: &str, count: usize) -> Config {
    let axes: Vec<String> = (0..count).map(|axis| format!("{keys}master_id = {}\n", 0x64 + axis)).collect();
    Config::parse("motors.toml", &text("1 ms", bus, &axes)).unwrap()
}

#[test]
fn a_bus_of_motors_carries_a_request_and_a_reply_for_each_and_nothing_of_canopen() {
    let schedule = &schedule::verify(&motors(HOLLOW, "", 2)).unwrap()[0];
    let kinds: Vec<_> =
        schedule.messages.iter().map(|message| (message.kind, message.id, message.bits)).collect();
    use MessageKind::{Reply, SetPoint};
    assert_eq!(kinds, [(SetPoint, 1, 135), (SetPoint, 2, 135), (Reply, 0x64, 115), (Reply, 0x65, 115)]);
    // Command phase, the time until the send phase, two requests, the delay of the motor, its reply.
    assert_eq!(schedule.slot.held_ns, 95_000);
    assert_eq!(schedule.slot.replies_done_ns, 550_000 + 95_000 + 2 * 135_000 + 500_000 + 115_000);
    let in_slot: Vec<_> = schedule.messages.iter().map(|message| message.in_slot_ns).collect();
    let replies_ns = Some(schedule.slot.replies_done_ns);
    assert_eq!(in_slot, [Some(645_000 + 135_000), Some(645_000 + 270_000), replies_ns, replies_ns]);
}

#[test]
fn requests_are_held_for_a_tenth_of_a_millisecond_or_as_long_as_the_buses_have_room() {
    let send_phase_ns = |config: &Config| schedule::send_phase_ns(config);
    // 115 µs are left before the next command phase, 20 of which are for handing the requests over.
    assert_eq!(send_phase_ns(&motors(HOLLOW, "", 2)), Some(645_000));
    assert_eq!(send_phase_ns(&motors(HOLLOW, "", 1)), Some(650_000));
    // What does not fit has no room at all.
    assert_eq!(send_phase_ns(&motors(HOLLOW, "", 3)), None);
    for (name, expected_ns) in [
        ("hollow-leg-fd.toml", Some(650_000)),
        ("hollow-rs485.toml", Some(2_850_000)),
        ("damiao-arm.toml", Some(1_170_000)),
        // The bus of the arm, whose set-points must be there before SYNC, leaves 40 µs.
        ("erob-arm-damiao-gripper.toml", Some(570_000)),
        ("arm6-erob.toml", None),
        ("mixed-arm.toml", None),
        ("gantry-yz-aim.toml", None),
    ] {
        assert_eq!(send_phase_ns(&load(name)), expected_ns, "{name}");
    }
}

#[test]
fn what_fits_without_a_send_phase_fits_with_it_at_every_command_phase_and_period() {
    for name in ["hollow-arm.toml", "hollow-leg-fd.toml", "damiao-arm.toml", "erob-arm-damiao-gripper.toml"] {
        let config = load(name);
        for percent in 5..=95 {
            for factor in [1, 2, 5] {
                let mut config = config.clone();
                config.cycle.period_ns *= factor;
                config.cycle.command_phase_ns = config.cycle.period_ns / 100 * percent;
                let plan = assemble::slot_plan(&config);
                let buses = schedule::analyse(&config);
                if buses.iter().any(|bus| bus.slot.held_ns > 0) {
                    assert!(buses.iter().all(fits_in_slot), "{name} at {percent} % of {factor}");
                }
                if let Some(send_phase_ns) = plan.send_phase_ns {
                    assert!((plan.command_phase_ns..plan.latest_set_points_ns).contains(&send_phase_ns));
                }
            }
        }
    }
}

/// Returns `true` if set-points and replies are in time.
fn fits_in_slot(bus: &BusSchedule) -> bool {
    use Shortfall::{FeedbackLate, RepliesLate, SetPointsLate};
    let is_of_slot =
        |what: &Shortfall| matches!(what, FeedbackLate { .. } | RepliesLate { .. } | SetPointsLate { .. });
    !bus.shortfalls.iter().any(is_of_slot)
}

#[test]
fn three_classic_motors_do_not_fit_one_millisecond_and_three_with_a_fast_data_phase_do() {
    let error = schedule::verify(&motors(HOLLOW, "", 3)).unwrap_err();
    let shortfalls = &error.buses[0].shortfalls;
    assert!(
        matches!(
            shortfalls[..],
            [Shortfall::RepliesLate { done_ns: 1_570_000, next_command_phase_ns: 1_550_000 }]
        ),
        "{shortfalls:?}"
    );
    assert!(error.to_string().contains("replies of the drives can arrive"), "{error}");

    let bus = "data_bit_rate = \"5 Mbit/s\"";
    schedule::verify(&motors(&format!("{HOLLOW_FD}bit_rate_switch = true\n"), bus, 3)).unwrap();
    schedule::verify(&motors(HOLLOW_FD, bus, 3)).unwrap_err();
    schedule::verify(&motors(HOLLOW_FD, bus, 1)).unwrap();
}
