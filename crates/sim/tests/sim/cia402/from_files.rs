//! What holds for the drive of every data sheet.

use takt::sim::{Defect, NodeState};
use takt_rt::{DriveState, OperationMode};
use takt_wire::canopen::object::ObjectAddress;

use super::{Tried, parameters, sheets};
use crate::bench::{Bench, MILLISECOND_NS, NODE};

const NO_OBJECT: u32 = 0x0602_0000;
const NO_SUBINDEX: u32 = 0x0609_0011;
const READ_ONLY: u32 = 0x0601_0002;
const WRITE_ONLY: u32 = 0x0601_0001;

#[test]
fn there_are_at_least_eight_data_sheets_of_five_vendors() {
    let sheets = sheets();
    let vendors: std::collections::BTreeSet<_> =
        sheets.iter().map(|(_, sheet)| sheet.device.vendor_name.clone().unwrap()).collect();
    assert!(sheets.len() >= 8, "{}", sheets.len());
    assert!(vendors.len() >= 5, "{vendors:?}");
}

#[test]
fn every_drive_boots_and_sends_its_boot_up_message() {
    for (name, sheet) in sheets() {
        let drive = takt::sim::cia402::Cia402Drive::new(parameters(sheet, Default::default())).unwrap();
        let mut bench = Bench::of(vec![Box::new(drive)]);
        bench.send_data(0x000, [0x82, NODE]);
        bench.run_ms(5);
        assert_eq!(bench.take(0x700 + u32::from(NODE)), [vec![0]], "{name}");
        assert_eq!(bench.observe().nmt, NodeState::PreOperational, "{name}");
        assert_eq!(bench.observe().state, DriveState::SwitchOnDisabled, "{name}");
    }
}

#[test]
fn every_object_is_read_as_its_data_sheet_says_and_an_absent_one_aborts() {
    for (name, sheet) in sheets() {
        let mut tried = Tried::new(sheet.clone());
        for entry in sheet.entries().filter(|entry| entry.address.index >= 0x1000) {
            let ObjectAddress { index, subindex } = entry.address;
            let is_history = index == 0x1003 && subindex > 0;
            let fits = entry.data_type.and_then(|data_type| data_type.bits()).is_some_and(|bits| bits <= 32);
            if is_history || !fits {
                continue;
            }
            let read = tried.bench.read(index, subindex);
            let is_write_only = entry.access == takt_wire::canopen::eds::AccessType::WriteOnly;
            assert_eq!(read.err(), is_write_only.then_some(WRITE_ONLY), "{name} {}", entry.address);
        }
        for index in (0x1000..0x1030).chain(0x6000..0x6100) {
            if sheet.object(index).is_none() {
                assert_eq!(tried.bench.read(index, 0), Err(NO_OBJECT), "{name} {index:04X}");
                assert_eq!(tried.bench.write(index, 0, 1, 0), Err(NO_OBJECT), "{name} {index:04X}");
            }
        }
        assert_eq!(tried.bench.read(0x1018, 77), Err(NO_SUBINDEX), "{name}");
        assert_eq!(tried.write(0x6041, 0, 0), Err(READ_ONLY), "{name}");
    }
}

#[test]
fn every_drive_is_enabled_and_moves_in_each_of_its_modes() {
    for (name, sheet) in sheets() {
        let mut tried = Tried::new(sheet);
        tried.write_if(0x6083, 0, 30_000);
        let modes = tried.modes();
        assert!(!modes.is_empty(), "{name}");
        for mode in modes {
            if mode == OperationMode::Homing {
                continue; // in `motion`
            }
            tried.set_mode(mode);
            tried.enable();
            let start = tried.bench.observe().position;
            move_in(&mut tried, mode);
            let moved = tried.bench.observe().position - start;
            assert!(moved > 0.02, "{name} {mode:?}: {moved}");
            tried.disable();
        }
    }
}

/// Commands a motion in the positive direction and lets it run.
fn move_in(tried: &mut Tried, mode: OperationMode) {
    let unit = tried.counts_per_unit;
    let target = i64::from(tried.bench.observe().position_counts) + (0.2 * unit) as i64;
    match mode {
        OperationMode::ProfilePosition => {
            tried.write_if(0x6081, 0, (0.5 * unit) as i64);
            tried.write(0x607A, 0, target).unwrap();
            tried.write(0x6040, 0, 0x1F).unwrap();
            tried.write(0x6040, 0, 0x0F).unwrap();
            tried.bench.run_ms(1500);
        }
        OperationMode::CyclicSynchronousPosition => {
            for step in 1..=100 {
                let begin = target - (0.2 * unit) as i64;
                tried.write(0x607A, 0, begin + (target - begin) * step / 100).unwrap();
            }
            tried.bench.run_ms(50);
        }
        OperationMode::InterpolatedPosition => {
            let has_record = tried.has(0x60C1);
            let begin = target - (0.2 * unit) as i64;
            if has_record {
                tried.write(0x60C1, 1, begin).unwrap();
            }
            tried.write(0x6040, 0, 0x1F).unwrap();
            for step in 1..=100 {
                let wanted = begin + (target - begin) * step / 100;
                tried.write(if has_record { 0x60C1 } else { 0x607A }, u8::from(has_record), wanted).unwrap();
            }
            tried.bench.run_ms(50);
        }
        OperationMode::ProfileVelocity | OperationMode::CyclicSynchronousVelocity => {
            tried.write(0x60FF, 0, (0.5 * unit) as i64).unwrap();
            tried.bench.run_ms(300);
        }
        OperationMode::ProfileTorque | OperationMode::CyclicSynchronousTorque => {
            tried.write_if(0x6087, 0, 10_000);
            tried.write(0x6071, 0, 60).unwrap();
            tried.bench.run_ms(400);
        }
        _ => unreachable!("{mode:?}"),
    }
}

#[test]
fn every_drive_with_a_window_faults_on_a_following_error_and_is_reset() {
    let mut tried_names = vec![];
    for (name, sheet) in sheets() {
        let has_window = sheet.object(0x6065).is_some() && sheet.object(0x6502).is_some();
        let mut tried = Tried::new(sheet);
        if !has_window || !tried.modes().contains(&OperationMode::ProfilePosition) {
            continue;
        }
        tried.set_mode(OperationMode::ProfilePosition);
        tried.enable();
        tried.write(0x6065, 0, 20).unwrap();
        tried.write_if(0x6066, 0, 0);
        tried.write_if(0x6083, 0, 30_000);
        tried.write_if(0x6081, 0, (0.5 * tried.counts_per_unit) as i64);
        tried.bench.heard.clear();
        tried.bench.bus.inject_defect(NODE, Defect::BlockedJoint, true).unwrap();
        tried.write(0x607A, 0, tried.counts_per_unit as i64).unwrap();
        tried.write(0x6040, 0, 0x1F).unwrap();
        tried.bench.run_ms(2000);
        assert_eq!(tried.bench.observe().state, DriveState::Fault, "{name}");
        let emergency = tried.bench.take(0x080 + u32::from(NODE));
        assert_eq!(emergency[0][..2], [0x11, 0x86], "{name}");
        if tried.has(0x603F) {
            assert_eq!(tried.bench.read(0x603F, 0), Ok(0x8611), "{name}");
        }
        tried.bench.bus.inject_defect(NODE, Defect::BlockedJoint, false).unwrap();
        tried.write(0x6040, 0, 0).unwrap();
        tried.write(0x6040, 0, 0x80).unwrap();
        tried.bench.run_ns(2 * MILLISECOND_NS);
        assert_eq!(tried.bench.observe().state, DriveState::SwitchOnDisabled, "{name}");
        assert_eq!(tried.bench.take(0x080 + u32::from(NODE))[0][..2], [0, 0], "{name}");
        tried_names.push(name);
    }
    assert!(tried_names.len() >= 3, "{tried_names:?}");
}

#[test]
fn every_drive_faults_on_an_injected_error_and_is_reset() {
    for (name, sheet) in sheets() {
        let mut tried = Tried::new(sheet);
        let mode = tried.modes()[0];
        tried.set_mode(mode);
        tried.enable();
        tried.bench.heard.clear();
        tried.bench.bus.inject_fault(NODE, takt::sim::DriveFault::OverCurrent).unwrap();
        tried.bench.run_ms(5);
        assert_eq!(tried.bench.observe().state, DriveState::Fault, "{name}");
        assert_eq!(tried.bench.take(0x080 + u32::from(NODE))[0][..2], [0x10, 0x23], "{name}");
        tried.write(0x6040, 0, 0).unwrap();
        tried.write(0x6040, 0, 0x80).unwrap();
        tried.bench.run_ms(2);
        assert_eq!(tried.bench.observe().state, DriveState::SwitchOnDisabled, "{name}");
    }
}
