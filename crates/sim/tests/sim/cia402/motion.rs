//! Motion that not every drive has: homing, halt, quick stop, units, several axes.

use takt::config::quirks::{MotionUnit, Quirks};
use takt::sim::cia402::{Cia402Drive, NotADrive};
use takt_rt::{DriveState, OperationMode};

use super::{Tried, joint, parameters, sheet};
use crate::bench::{Bench, NODE};

#[test]
fn homing_on_the_negative_limit_switch_gives_the_joint_its_home_offset() {
    let mut tried = Tried::new(sheet("faulhaber-mcbl300x"));
    tried.set_mode(OperationMode::Homing);
    tried.write(0x6098, 0, 17).unwrap();
    tried.write(0x607C, 0, 100).unwrap();
    tried.write(0x6099, 1, 1500).unwrap();
    tried.write(0x6099, 2, 100).unwrap();
    tried.write(0x609A, 0, 30_000).unwrap();
    tried.enable();
    tried.write(0x6040, 0, 0x1F).unwrap();
    tried.bench.run_ms(6000);
    let seen = tried.bench.observe();
    assert_eq!(seen.statusword & 0x3400, 0x1400, "{:04X}", seen.statusword);
    // The edge of the switch is at −3 rad; the search goes on in the positive direction until the axis stands.
    let home = seen.position - (f64::from(seen.position_counts) - 100.0) / tried.counts_per_unit;
    assert!((home + 3.0).abs() < 0.01, "{home}");
}

#[test]
fn homing_to_the_current_position_needs_no_motion_and_another_method_is_an_error() {
    let mut tried = Tried::new(sheet("faulhaber-mcbl300x"));
    tried.set_mode(OperationMode::Homing);
    tried.write(0x6098, 0, 35).unwrap();
    tried.write(0x607C, 0, -40).unwrap();
    tried.enable();
    tried.write(0x6040, 0, 0x1F).unwrap();
    tried.bench.run_ms(20);
    let seen = tried.bench.observe();
    assert_eq!((seen.position_counts, seen.statusword & 0x3000), (-40, 0x1000));
    tried.write(0x6040, 0, 0x0F).unwrap();
    tried.write(0x6098, 0, 15).unwrap();
    tried.write(0x6040, 0, 0x1F).unwrap();
    tried.bench.run_ms(20);
    assert_eq!(tried.bench.observe().statusword & 0x3000, 0x2000);
}

#[test]
fn halt_stops_a_profile_and_its_end_lets_it_go_on() {
    let mut tried = Tried::new(sheet("eyou-euservo"));
    tried.set_mode(OperationMode::ProfileVelocity);
    tried.write(0x6083, 0, 600_000).unwrap();
    tried.write(0x6084, 0, 600_000).unwrap();
    tried.enable();
    tried.write(0x60FF, 0, 10_000).unwrap();
    tried.bench.run_ms(200);
    assert!(tried.bench.observe().velocity > 0.5);
    tried.write(0x6040, 0, 0x10F).unwrap();
    tried.bench.run_ms(200);
    let seen = tried.bench.observe();
    assert!(seen.velocity.abs() < 0.01 && seen.state == DriveState::OperationEnabled, "{seen:?}");
    tried.write(0x6040, 0, 0x0F).unwrap();
    tried.bench.run_ms(200);
    assert!(tried.bench.observe().velocity > 0.5);
}

#[test]
fn the_quick_stop_option_says_whether_the_drive_holds_afterwards() {
    for (option, after) in [(2, DriveState::SwitchOnDisabled), (6, DriveState::QuickStopActive)] {
        let mut tried = Tried::new(sheet("eyou-euservo"));
        tried.set_mode(OperationMode::ProfileVelocity);
        tried.write(0x605A, 0, option).unwrap();
        tried.write(0x6083, 0, 600_000).unwrap();
        tried.write(0x6085, 0, 600_000).unwrap();
        tried.enable();
        tried.write(0x60FF, 0, 10_000).unwrap();
        tried.bench.run_ms(200);
        tried.write(0x6040, 0, 0x02).unwrap();
        tried.bench.run_ms(300);
        let seen = tried.bench.observe();
        assert_eq!(seen.state, after, "605A = {option}");
        assert!(seen.velocity.abs() < 0.01, "{seen:?}");
        if after == DriveState::QuickStopActive {
            tried.write(0x6040, 0, 0x0F).unwrap();
            tried.bench.run_ms(5);
            assert_eq!(tried.bench.observe().state, DriveState::OperationEnabled);
        }
    }
}

#[test]
fn a_unit_of_velocity_is_that_of_the_quirks() {
    let units = vec![(0x60FF, MotionUnit::RevolutionsPerMinute(1.0))];
    let mut tried = Tried::with(sheet("eyou-euservo"), Quirks { units, ..Quirks::default() });
    tried.set_mode(OperationMode::ProfileVelocity);
    tried.enable();
    tried.write(0x60FF, 0, 30).unwrap();
    tried.bench.run_ms(500);
    let velocity = tried.bench.observe().velocity;
    assert!((velocity - 30.0 / 60.0 * std::f64::consts::TAU).abs() < 0.05, "{velocity}");
    assert!((i64::from(tried.bench.read(0x606C, 0).unwrap()) - 30).abs() <= 1);
}

#[test]
fn the_software_limits_end_a_profile() {
    let mut tried = Tried::new(sheet("eyou-euservo"));
    tried.write(0x607D, 1, -1000).unwrap();
    tried.write(0x607D, 2, 1000).unwrap();
    tried.set_mode(OperationMode::ProfilePosition);
    tried.write(0x6081, 0, 20_000).unwrap();
    tried.write(0x6083, 0, 600_000).unwrap();
    tried.enable();
    tried.write(0x607A, 0, 5000).unwrap();
    tried.write(0x6040, 0, 0x1F).unwrap();
    tried.bench.run_ms(500);
    let seen = tried.bench.observe();
    assert!((seen.position_counts - 1000).abs() < 10, "{seen:?}");
    assert_eq!(seen.statusword & 0x0800, 0x0800);
}

/// The profile objects of a data sheet, a second time 0x800 higher.
fn with_a_second_axis(text: &str) -> String {
    let header = |line: &str| {
        let index = u16::from_str_radix(line.strip_prefix('[')?.get(..4)?, 16).ok()?;
        (0x6000..0x6800).contains(&index).then(|| format!("[{:04X}{}", index + 0x800, &line[5..]))
    };
    let mut second = String::new();
    let mut is_profile = false;
    for line in text.lines() {
        if line.starts_with('[') {
            let moved = header(line);
            is_profile = moved.is_some();
            second += &moved.unwrap_or_default();
        } else if is_profile {
            second += line;
        }
        second += "\n";
    }
    format!("{text}\n{second}")
}

#[test]
fn two_axes_in_one_node_move_by_themselves() {
    let text = std::fs::read_to_string("../../tests/eds/vendors/eyou-euservo.eds").unwrap();
    let sheet =
        takt_wire::canopen::eds::parse("two.eds", with_a_second_axis(&text).as_bytes()).unwrap().dictionary;
    let mut parameters = parameters(sheet, Quirks::default());
    parameters.axes.push(joint(65_536.0));
    let mut tried = Tried::of(parameters);
    for (offset, velocity) in [(0, 10_000), (0x800, -5000)] {
        tried.write(0x6060 + offset, 0, 3).unwrap();
        tried.write(0x60FF + offset, 0, velocity).unwrap();
        for controlword in [0x06, 0x07, 0x0F] {
            tried.write(0x6040 + offset, 0, controlword).unwrap();
            tried.bench.run_ms(5);
        }
    }
    tried.bench.run_ms(500);
    let velocity = |tried: &mut Tried, index| tried.bench.read(index, 0).unwrap() as i32;
    assert!((velocity(&mut tried, 0x606C) - 10_000).abs() < 300);
    assert!((velocity(&mut tried, 0x686C) + 5000).abs() < 300);
    tried.write(0x6840, 0, 0).unwrap();
    tried.bench.run_ms(100);
    assert_eq!(tried.bench.observe().state, DriveState::OperationEnabled);
    assert_eq!(tried.bench.read(0x6841, 0).unwrap() & 0x6F, 0x40);
}

#[test]
fn a_data_sheet_without_a_controlword_is_no_drive() {
    let mut sheet = sheet("eyou-euservo");
    sheet.objects.retain(|object| object.index != 0x6040);
    let error = Cia402Drive::new(parameters(sheet, Quirks::default())).unwrap_err();
    assert!(matches!(error, NotADrive::Lacks(address, 1) if address.index == 0x6040), "{error}");
}

#[test]
fn a_drive_keeps_saved_parameters_over_a_restart_and_loads_its_defaults() {
    let mut tried = Tried::new(sheet("eyou-euservo"));
    tried.write(0x6083, 0, 12_345).unwrap();
    tried.write(0x6084, 0, 1).unwrap();
    assert_eq!(tried.bench.write(0x1010, 1, 4, 1), Err(0x0800_0020));
    tried.bench.write(0x1010, 1, 4, u32::from_le_bytes(*b"save").into()).unwrap();
    tried.bench.run_ms(200);
    tried.write(0x6084, 0, 2).unwrap();
    tried.bench.send_data(0x000, [0x81, NODE]);
    tried.bench.run_ms(20);
    tried.bench.heard.clear();
    assert_eq!((tried.bench.read(0x6083, 0), tried.bench.read(0x6084, 0)), (Ok(12_345), Ok(1)));
    tried.bench.write(0x1011, 1, 4, u32::from_le_bytes(*b"load").into()).unwrap();
    tried.bench.send_data(0x000, [0x81, NODE]);
    tried.bench.run_ms(20);
    tried.bench.heard.clear();
    assert_eq!(tried.bench.read(0x6083, 0), Ok(0));
}

#[test]
fn the_same_time_gives_the_same_motion() {
    let moved = || {
        let drive = Cia402Drive::new(parameters(sheet("eyou-euservo"), Quirks::default())).unwrap();
        let mut bench = Bench::of(vec![Box::new(drive)]);
        bench.write(0x6060, 0, 1, 3).unwrap();
        bench.write(0x60FF, 0, 4, 5000).unwrap();
        for controlword in [0x06, 0x07, 0x0F] {
            bench.write(0x6040, 0, 2, controlword).unwrap();
        }
        bench.run_ms(100);
        bench.observe()
    };
    assert_eq!(moved(), moved());
}
