//! Homing on the switches at the inputs DIR and PU.

use takt::sim::homing_switches::{HomingSwitches, Switch};
use takt::sim::plant::EndStops;
use takt::sim::yz_aim::HomingBehaviour;

use super::{Bench, NODE, YzAimParameters, bench, parameters};

const HOMING: HomingBehaviour =
    HomingBehaviour { speed_rpm: 300.0, gives_up_ns: Some(5_000_000_000), has_undescribed_methods: false };

/// Homes by this method from this position (rad) with these switches, until homing ends or 10 s have passed.
/// The drive homes after power-up without any controlword.
fn home(method: i64, from: f64, switches: HomingSwitches, homing: HomingBehaviour) -> Bench {
    let mut bench = bench(YzAimParameters {
        initial_position: from,
        switches,
        homing,
        end_stops: Some(EndStops { lowest: -1.0, highest: 1.0 }),
        ..parameters(NODE)
    });
    bench.write(0x6098, 0, 1, method).unwrap();
    bench.write(0x6060, 0, 1, 6).unwrap();
    for _ in 0..1_000 {
        let statusword = bench.statusword();
        if statusword & 0x3000 != 0 {
            return bench;
        }
        assert_eq!(statusword & !0x08, if statusword & 0x08 == 0 { 0x0014 } else { 0x0010 });
        bench.run_ms(10);
    }
    bench
}

/// Homes and expects the zero at this position (rad).
fn finds(method: i64, from: f64, switches: HomingSwitches, zero: f64) {
    let homing = HomingBehaviour { has_undescribed_methods: true, ..HOMING };
    let mut bench = home(method, from, switches, homing);
    assert_eq!(bench.statusword(), 0x1414, "method {method} from {from}");
    // The drive needs a few counts to stop from 30 r/min.
    assert!(bench.position().abs() < 200, "method {method}: {}", bench.position());
    let counts = bench.position();
    let position = bench.observe().position;
    let at_zero = position - f64::from(counts) / 32_768.0 / super::RATIO * super::TAU;
    assert!((at_zero - zero).abs() < 1e-3, "method {method} from {from}: zero at {at_zero}");
}

#[test]
fn method_17_finds_the_negative_limit_on_dir() {
    let switches = HomingSwitches { dir: Some(Switch::below(-0.6)), pu: None };
    finds(17, 0.3, switches, -0.6);
    finds(17, -0.8, switches, -0.6);
}

#[test]
fn method_18_finds_the_positive_limit_on_pu() {
    let switches = HomingSwitches { dir: None, pu: Some(Switch::above(0.7)) };
    finds(18, -0.3, switches, 0.7);
    finds(18, 0.8, switches, 0.7);
}

#[test]
fn methods_19_to_22_find_the_near_side_of_the_home_switch() {
    let above = HomingSwitches { dir: Some(Switch::above(0.2)), pu: None };
    let below = HomingSwitches { dir: Some(Switch::below(-0.2)), pu: None };
    for from in [-0.5, 0.5] {
        finds(19, from, above, 0.2);
        finds(20, from, above, 0.2);
        finds(21, from, below, -0.2);
        finds(22, from, below, -0.2);
    }
}

#[test]
fn an_overshot_home_switch_is_found_on_the_way_back() {
    let narrow = HomingSwitches { dir: Some(Switch { from: 0.2, to: 0.201 }), pu: None };
    finds(19, -0.5, narrow, 0.2);
    finds(21, 0.5, narrow, 0.201);
}

#[test]
fn methods_20_and_22_end_in_the_homing_error() {
    let switches = HomingSwitches { dir: Some(Switch::above(0.2)), pu: None };
    for method in [20, 22] {
        let mut bench = home(method, 0.0, switches, HOMING);
        assert_eq!(bench.statusword() & 0x3000, 0x2000);
        assert_eq!(bench.position(), 0);
    }
}

#[test]
fn a_missing_switch_causes_a_homing_error_or_an_endless_search() {
    let mut bench = home(17, 0.9, HomingSwitches::default(), HomingBehaviour { speed_rpm: 10.0, ..HOMING });
    assert_eq!(bench.statusword() & 0x3000, 0x2000);
    let endless = HomingBehaviour { gives_up_ns: None, speed_rpm: 10.0, ..HOMING };
    let mut bench = home(17, 0.9, HomingSwitches::default(), endless);
    assert_eq!(bench.statusword(), 0x0014);
    assert!(bench.observe().velocity < -0.09);
}

#[test]
fn running_into_the_end_stop_without_a_switch_blocks_the_rotor() {
    let mut bench =
        home(17, -0.5, HomingSwitches::default(), HomingBehaviour { gives_up_ns: None, ..HOMING });
    assert_eq!((bench.alarm(), bench.statusword() & 0x3008), (0x12, 0x2008));
    assert_eq!(bench.observe().position, -1.0);
}

#[test]
fn bit_4_starts_another_homing_in_mode_6() {
    let switches = HomingSwitches { dir: Some(Switch::below(-0.3)), pu: None };
    let mut bench = home(17, 0.3, switches, HOMING);
    assert_eq!(bench.statusword(), 0x1414);
    bench.enable_in_steps();
    bench.control(0x1F);
    assert_eq!(bench.statusword(), 0x0037);
    bench.run_ms(3_000);
    assert_eq!(bench.statusword(), 0x1437);
    assert!(bench.position().abs() < 200);
}

#[test]
fn the_inputs_show_the_switches() {
    let switches = HomingSwitches { dir: Some(Switch::below(-0.3)), pu: Some(Switch::above(0.3)) };
    for (position, inputs) in [(-0.5, 1), (0.0, 0), (0.5, 2)] {
        let mut bench = bench(YzAimParameters { initial_position: position, switches, ..parameters(NODE) });
        assert_eq!(bench.read(0x60FD, 0), Ok(inputs));
    }
}
