//! What interpolation at 2 ms costs on the bus, against the sums that were worked out by hand (yz-aim.md, 9.4).

use std::fmt::Write;

use takt::config::Config;
use takt::schedule::{self, BusSchedule, Remedy, automatic_command_phase};

use crate::drive_modes::world::parse;

/// So many interpolating YZ-AIMs on one bus, and no heartbeat, which the sums leave out.
fn yz_aims(axes: usize, bit_rate: u32, answers_sync: bool) -> Config {
    let mut text = format!(
        "name = \"yz\"\n[cycle]\nperiod = \"2 ms\"\n[master]\nheartbeat = \"off\"\n[[bus]]\nname = \"bus\"\nbit_rate = {bit_rate}\n"
    );
    for node in 1..=axes {
        let _ = writeln!(
            text,
            "[[axis]]\nname = \"a{node}\"\nbus = \"bus\"\nnode = {node}\ndrive = \"yz-aim\"\nmode = \"ip\"\n\
             answers_sync = {answers_sync}\nfeedback_delay = 0\n\
             limits = {{ position = [-1, 1], velocity = 1, acceleration = 1, torque = 1 }}"
        );
    }
    parse(&text)
}

fn analyse(config: &Config) -> BusSchedule {
    schedule::analyse(config).remove(0)
}

const MEGABIT: u32 = 1_000_000;
const HALF: u32 = 500_000;

/// Axes, bit rate, whether TPDO2 answers SYNC, the sum in µs.
const SUMS: [(usize, u32, bool, u64); 19] = [
    (1, MEGABIT, true, 380),
    (2, MEGABIT, true, 705),
    (3, MEGABIT, true, 1030),
    (4, MEGABIT, true, 1355),
    (5, MEGABIT, true, 1680),
    (6, MEGABIT, true, 2005),
    (1, MEGABIT, false, 265),
    (2, MEGABIT, false, 475),
    (3, MEGABIT, false, 685),
    (4, MEGABIT, false, 895),
    (5, MEGABIT, false, 1105),
    (6, MEGABIT, false, 1315),
    (8, MEGABIT, false, 1735),
    (1, HALF, true, 760),
    (2, HALF, true, 1410),
    (3, HALF, true, 2060),
    (1, HALF, false, 530),
    (4, HALF, false, 1790),
    (5, HALF, false, 2210),
];

#[test]
fn the_sums_of_the_2_ms_mode_are_reproduced() {
    for (axes, bit_rate, answers_sync, microseconds) in SUMS {
        let slot = analyse(&yz_aims(axes, bit_rate, answers_sync)).slot;
        assert_eq!(slot.process_data_ns, microseconds * 1000, "{axes} at {bit_rate}, {answers_sync}");
    }
}

/// As the table says, where nothing is in the way but the process data: there is a command phase at which everything is in
/// time if, and only if, the sum is not more than 2 ms.
#[test]
fn what_does_not_fit_2_ms_by_hand_has_no_command_phase_and_what_fits_has_one() {
    for (axes, bit_rate, answers_sync, microseconds) in SUMS {
        let slot = analyse(&yz_aims(axes, bit_rate, answers_sync)).slot;
        let is_possible = slot.command_phases_ns.is_some();
        assert_eq!(is_possible, microseconds <= 2_000, "{axes} at {bit_rate}, {answers_sync}: {slot:?}");
    }
}

/// With `command_phase = "auto"`, so that the place of the command phase is not what is wrong.
#[test]
fn drives_that_do_not_answer_sync_are_the_remedy_where_that_is_enough() {
    for (axes, bit_rate, is_enough) in [(6, MEGABIT, true), (3, HALF, true), (5, HALF, false)] {
        let refused = automatic_command_phase(&yz_aims(axes, bit_rate, true)).unwrap_err();
        let remedies = &refused.0[0].remedies;
        assert_eq!(
            remedies.contains(&Remedy::NoAnswersToSync),
            is_enough,
            "{axes} at {bit_rate}: {remedies:?}"
        );
        assert_eq!(refused.to_string().contains("answers_sync = false"), is_enough, "{refused}");
        let mut remedied = yz_aims(axes, bit_rate, false);
        let phase_ns = automatic_command_phase(&remedied);
        assert_eq!(phase_ns.is_ok(), is_enough);
        if let Ok(phase_ns) = phase_ns {
            remedied.cycle.command_phase_ns = phase_ns;
            assert!(schedule::verify(&remedied).is_ok());
        }
    }
}
