//! What is known of an eRob with its own protocol.

use std::f64::consts::TAU;

use takt_rt::OperationMode;
use takt_wire::erob_can::frame;

use crate::config::{
    DriveFacts, ErrorControl, ModeChangeRule, ModeSet, OwnIdentifiers, Plausible, Protocol, VelocityUnit,
};
use crate::family::erob::ENABLED_FROM_NS;

/// The facts.
pub static FACTS: DriveFacts = DriveFacts {
    // 19 bits on the output side.
    counts_per_turn: Some(524_288.0),
    velocity_unit: VelocityUnit::Counts(1.0),
    // The axis follows positions. How it is commanded for that is no matter of a configuration.
    modes: ModeSet::of(&[OperationMode::CyclicSynchronousPosition]),
    mode_changes: ModeChangeRule::Never { because: "the axis follows positions at its own rate" },
    bit_rates: &[1_000_000],
    has_fixed_process_data: true,
    reports_mode: false,
    protocol: Protocol::Own(OwnIdentifiers {
        request: frame::REQUEST,
        reply: frame::REPLY,
        last_node: *frame::NODES.end(),
    }),
    error_control: ErrorControl::None,
    consumes_heartbeat: false,
    sends_emergencies: false,
    enabled_from_ns: ENABLED_FROM_NS,
    plausible: Plausible {
        fastest_turns_per_s: 25.0,
        // The fastest module turns at 6.3 rad/s.
        usual_velocity: 2.0 * TAU,
        // The gears inside are 50:1 to 160:1.
        inner_gear_from: Some(30.0),
    },
    ..DriveFacts::standard("erob-can", "eRob with its own CAN protocol")
};
