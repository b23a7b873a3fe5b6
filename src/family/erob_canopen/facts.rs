//! What is known of an eRob.

use std::f64::consts::TAU;

use takt_rt::{ModeCondition, OperationMode};

use crate::config::{DriveFacts, Identity, ModeChangeRule, ModeSet, Plausible, VelocityUnit};

/// The facts.
pub static FACTS: DriveFacts = DriveFacts {
    // The revision changes with the firmware and is not compared.
    identity: Identity {
        device_type: Some(0x0042_0192),
        vendor: Some(0x5A65_726F),
        product: Some(0x2648_3052),
        revision: None,
    },
    // 19 bits on the output side.
    counts_per_turn: Some(524_288.0),
    velocity_unit: VelocityUnit::Counts(1.0),
    // No manual gives the unit of 6080. Any smaller one makes the same number a lower speed: what is too slow in r/min is too slow in
    // counts/s as well.
    motor_speed_unit: VelocityUnit::RevolutionsPerMinute(1.0),
    // The whole range of 32 bits is "no limit" (EDS); of 0 and 0 nothing is known.
    empty_software_limits_are_off: false,
    modes: ModeSet::of(&[
        OperationMode::CyclicSynchronousPosition,
        OperationMode::CyclicSynchronousVelocity,
        OperationMode::CyclicSynchronousTorque,
        OperationMode::InterpolatedPosition,
        OperationMode::ProfilePosition,
        OperationMode::ProfileVelocity,
        OperationMode::ProfileTorque,
    ]),
    // An eRob must be disabled before every change (eRunner manual, chapter 5).
    mode_changes: ModeChangeRule::When(ModeCondition::Disabled),
    // The one bit rate of its CANopen firmware (eRunner manual, section 1 of the specification).
    bit_rates: &[1_000_000],
    plausible: Plausible {
        fastest_turns_per_s: 25.0,
        // The fastest module turns at 6.3 rad/s.
        usual_velocity: 2.0 * TAU,
        // The gears inside are 50:1 to 160:1.
        inner_gear_from: Some(30.0),
    },
    ..DriveFacts::standard("erob-canopen", "eRob")
};
