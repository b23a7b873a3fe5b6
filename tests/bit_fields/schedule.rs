//! Whether requests and replies find room in the cycle.

use takt::Config;
use takt::schedule::{self, MessageKind, Shortfall};

use crate::machine::{HOLLOW, HOLLOW_FD, text};

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
    // Command phase, two requests, the delay of the motor, its reply.
    assert_eq!(schedule.slot.replies_done_ns, 550_000 + 2 * 135_000 + 500_000 + 115_000);
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
