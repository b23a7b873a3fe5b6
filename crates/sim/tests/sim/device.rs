//! The CiA 402 state machine: the statuswords of real units, faults and fault resets.

use takt::sim::DriveFault;
use takt::sim::cia402::{Cia402AxisParameters, Cia402Parameters};
use takt_rt::DriveState;

use super::bench::{Bench, NODE, axis, parameters};

const TARGET_POSITION: u32 = 0x607A_0020;
const TARGET_VELOCITY: u32 = 0x60FF_0020;
const WARNING: u16 = 0x80;

#[test]
fn statuswords_equal_those_of_real_units_with_and_without_the_warning_bit() {
    let mut warnings = std::collections::BTreeSet::new();
    for seed in 0..8 {
        let mut bench = Bench::with(vec![Cia402Parameters { seed, ..parameters(NODE) }]);
        bench.write(0x6060, 0, 1, 8).unwrap();
        bench.start_process_data(TARGET_POSITION);
        let mut seen = vec![bench.cycle(0, 0).0];
        for controlword in [0x06, 0x07, 0x0F] {
            bench.cycle(controlword, 0);
            bench.cycle(controlword, 0);
            seen.push(bench.cycle(controlword, 0).0);
        }
        bench.cycle(0x0F, 60_000);
        bench.cycle(0x0F, 60_000);
        seen.push(bench.cycle(0x0F, 60_000).0);
        bench.bus.inject_fault(NODE, DriveFault::OverCurrent).unwrap();
        bench.cycle(0x0F, 60_000);
        seen.push(bench.cycle(0x0F, 60_000).0);
        warnings.extend(seen.iter().map(|word| word & WARNING));
        let without_warning: Vec<_> = seen.iter().map(|word| word & !WARNING).collect();
        assert_eq!(without_warning, [0x1250, 0x1231, 0x1233, 0x1637, 0x1237, 0x1208]);
    }
    assert_eq!(warnings.into_iter().collect::<Vec<_>>(), [0, WARNING]);
}

#[test]
fn each_controlword_causes_the_transition_of_cia_402() {
    let mut bench = Bench::new();
    bench.write(0x6060, 0, 1, 8).unwrap();
    let steps = [
        (0x0F, DriveState::SwitchOnDisabled),
        (0x07, DriveState::SwitchOnDisabled),
        (0x06, DriveState::ReadyToSwitchOn),
        (0x00, DriveState::SwitchOnDisabled),
        (0x06, DriveState::ReadyToSwitchOn),
        (0x07, DriveState::SwitchedOn),
        (0x06, DriveState::ReadyToSwitchOn),
        (0x07, DriveState::SwitchedOn),
        (0x00, DriveState::SwitchOnDisabled),
        (0x06, DriveState::ReadyToSwitchOn),
        (0x0F, DriveState::OperationEnabled),
        (0x07, DriveState::SwitchedOn),
        (0x0F, DriveState::OperationEnabled),
        (0x06, DriveState::ReadyToSwitchOn),
        (0x0F, DriveState::OperationEnabled),
        (0x00, DriveState::SwitchOnDisabled),
    ];
    for (controlword, state) in steps {
        bench.write(0x6040, 0, 2, controlword).unwrap();
        bench.run_ms(1);
        assert_eq!(bench.observe().state, state, "after {controlword:#04x}");
    }
}

#[test]
fn the_brake_is_engaged_if_and_only_if_there_is_no_torque() {
    let mut bench = Bench::new();
    bench.bus.set_load_torque(NODE, 20.0).unwrap();
    bench.run_ms(100);
    assert_eq!((bench.observe().is_braked, bench.observe().position), (true, 0.0));
    bench.enable(8, TARGET_POSITION, 0);
    assert!(!bench.observe().is_braked);
    for _ in 0..1000 {
        bench.cycle(0x0F, 0);
    }
    // The integral part equals the torque that the brake held, so the position stays the same count.
    assert!(bench.observe().position_counts.abs() <= 1);
    for _ in 0..3 {
        bench.cycle(0x06, 0);
    }
    assert!(bench.observe().is_braked);
}

#[test]
fn a_fault_reset_needs_a_rising_edge_held_for_several_cycles() {
    let mut bench = Bench::new();
    bench.enable(8, TARGET_POSITION, 0);
    bench.bus.inject_fault(NODE, DriveFault::Encoder).unwrap();
    for _ in 0..3 {
        bench.cycle(0x0F, 0);
    }
    assert_eq!(bench.take(0x085), [[0x05, 0x73, 0x21, 0, 0, 0, 0, 0]]);
    assert_eq!((bench.observe().state, bench.observe().error_code), (DriveState::Fault, 0x7305));
    // One edge is too short, the next one is long enough.
    for (controlword, cycles, state) in [
        (0x80, 2, DriveState::Fault),
        (0x06, 3, DriveState::Fault),
        (0x80, 6, DriveState::SwitchOnDisabled),
        (0x06, 3, DriveState::ReadyToSwitchOn),
    ] {
        for _ in 0..cycles {
            bench.cycle(controlword, 0);
        }
        assert_eq!(bench.observe().state, state, "{cycles} cycles of {controlword:#04x}");
    }
    assert_eq!(bench.take(0x085), [[0; 8]]);
    assert_eq!((bench.read(0x603F, 0), bench.read(0x1001, 0)), (Ok(0), Ok(0)));
}

#[test]
fn a_battery_fault_needs_its_own_reset_which_clears_the_turn_count() {
    let far = Cia402AxisParameters { initial_position: 20.0, ..axis() };
    let mut bench = Bench::with(vec![Cia402Parameters { axes: vec![far], ..parameters(NODE) }]);
    let before = bench.observe().position_counts;
    assert!(before > 3 * 524_288);
    bench.bus.inject_fault(NODE, DriveFault::MultiTurnBattery).unwrap();
    bench.run_ms(2);
    for _ in 0..2 {
        bench.write(0x6040, 0, 2, 0x00).unwrap();
        bench.write(0x6040, 0, 2, 0x80).unwrap();
        bench.run_ms(10);
        assert_eq!((bench.observe().state, bench.observe().error_code), (DriveState::Fault, 0x730F));
        bench.bus.power_cycle(NODE).unwrap();
        bench.run_ms(10);
        bench.heard.clear();
    }
    bench.write(0x2242, 0, 2, 1).unwrap();
    bench.write(0x6040, 0, 2, 0x80).unwrap();
    bench.run_ms(10);
    assert_eq!(bench.observe().state, DriveState::SwitchOnDisabled);
    assert_eq!(bench.observe().position_counts, before % 524_288);
}

#[test]
fn an_enabled_drive_decelerates_and_disables_when_the_master_is_lost() {
    let mut bench = Bench::new();
    bench.write(0x6085, 0, 4, 800_000).unwrap();
    bench.write(0x1016, 1, 4, 0x0001_0014).unwrap();
    bench.write(0x1029, 1, 1, 1).unwrap();
    bench.enable(9, TARGET_VELOCITY, 0);
    for _ in 0..300 {
        bench.send_data(0x701, [5]);
        bench.cycle(0x0F, 160_000);
    }
    let (mut reacting, mut last) = (0, bench.observe().velocity);
    while bench.observe().state != DriveState::Fault {
        bench.cycle(0x0F, 160_000);
        let observed = bench.observe();
        if observed.state == DriveState::FaultReactionActive {
            reacting += 1;
            assert!(observed.velocity <= last + 1e-3);
            last = observed.velocity;
        }
    }
    // 160000 counts/s at 800000 counts/s²
    assert!((195..=210).contains(&reacting), "{reacting} ms");
    bench.run_ms(50);
    assert_eq!(bench.observe().velocity, 0.0);
}

#[test]
fn a_quick_stop_runs_its_ramp_and_ends_without_power() {
    let mut bench = Bench::new();
    bench.write(0x6085, 0, 4, 1_600_000).unwrap();
    bench.enable(9, TARGET_VELOCITY, 0);
    for _ in 0..300 {
        bench.cycle(0x0F, 160_000);
    }
    bench.cycle(0x02, 160_000);
    bench.cycle(0x02, 160_000);
    assert_eq!(bench.observe().state, DriveState::QuickStopActive);
    for _ in 0..120 {
        bench.cycle(0x02, 160_000);
    }
    assert_eq!((bench.observe().state, bench.observe().velocity), (DriveState::SwitchOnDisabled, 0.0));
}

#[test]
fn shutdown_follows_the_option_code_605b() {
    for (option, still_enabled) in [(0, false), (1, true)] {
        let mut bench = Bench::new();
        bench.write(0x605B, 0, 2, option).unwrap();
        bench.write(0x6084, 0, 4, 1_600_000).unwrap();
        bench.enable(9, TARGET_VELOCITY, 0);
        for _ in 0..300 {
            bench.cycle(0x0F, 160_000);
        }
        for _ in 0..10 {
            bench.cycle(0x06, 160_000);
        }
        assert_eq!(bench.observe().state == DriveState::OperationEnabled, still_enabled);
        for _ in 0..120 {
            bench.cycle(0x06, 160_000);
        }
        assert_eq!((bench.observe().state, bench.observe().velocity), (DriveState::ReadyToSwitchOn, 0.0));
    }
}

#[test]
fn exceeding_the_following_error_window_is_a_fault() {
    let mut bench = Bench::new();
    bench.write(0x6065, 0, 4, 500).unwrap();
    bench.write(0x6085, 0, 4, 1_600_000).unwrap();
    bench.enable(8, TARGET_POSITION, 0);
    bench.bus.set_load_torque(NODE, 100.0).unwrap();
    for _ in 0..300 {
        bench.cycle(0x0F, 0);
    }
    assert_eq!((bench.observe().state, bench.observe().error_code), (DriveState::Fault, 0x8611));
    assert_eq!(bench.take(0x085)[0], [0x11, 0x86, 0x21, 0, 0, 0, 0, 0]);
}

#[test]
fn the_mode_changes_only_in_a_disabled_drive_and_only_if_it_is_supported() {
    let mut bench = Bench::new();
    for (mode, display) in [(8, 8), (6, 8), (7, 8), (2, 8), (3, 3), (0, 3), (10, 10)] {
        bench.write(0x6060, 0, 1, mode).unwrap();
        assert_eq!((bench.read(0x6060, 0), bench.read(0x6061, 0)), (Ok(mode as u32), Ok(display)));
    }
    assert_eq!(bench.write(0x6060, 0, 1, 11), Err(0x0609_0030));
    bench.enable(8, TARGET_POSITION, 0);
    assert_eq!(bench.write(0x6060, 0, 1, 9), Err(0x0800_0022));
    assert_eq!((bench.read(0x6060, 0), bench.read(0x6061, 0)), (Ok(8), Ok(8)));
}

#[test]
fn a_power_cycle_disables_the_drive_engages_the_brake_and_restarts() {
    let mut bench = Bench::new();
    bench.enable(9, TARGET_VELOCITY, 0);
    for _ in 0..300 {
        bench.cycle(0x0F, 160_000);
    }
    let position = bench.observe().position;
    bench.bus.power_cycle(NODE).unwrap();
    bench.run_ms(60);
    assert_eq!(bench.take(0x705), [[0]]);
    let observed = bench.observe();
    assert_eq!((observed.state, observed.velocity), (DriveState::SwitchOnDisabled, 0.0));
    // The brake needed a few hundredths of a radian, and the joint stayed at rest there.
    assert!((0.0..0.05).contains(&(observed.position - position)));
}

#[test]
fn without_a_battery_the_position_after_a_power_cycle_is_single_turn() {
    let far = Cia402AxisParameters { initial_position: -20.0, ..axis() };
    let mut module = Cia402Parameters { axes: vec![far], ..parameters(NODE) };
    module.quirks.simulated.lacks_battery = true;
    let mut bench = Bench::with(vec![module]);
    assert!((0..524_288).contains(&bench.observe().position_counts));
    bench.bus.power_cycle(NODE).unwrap();
    bench.run_ms(10);
    assert!((0..524_288).contains(&bench.observe().position_counts));
    assert_eq!(bench.observe().position, -20.0);
}
