//! Commissioning of the drives that are simulated from data sheets.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use serde_json::Value;
use takt::Config;
use takt::config::quirks::Quirks;
use takt::family::cia402::Device;
use takt::family::commission::dictionary::{self, SelectedObject};
use takt::family::commission::{CommandValue, Failure, MoveKind, TargetDrive, Task};
use takt::sim::cia402::{Cia402AxisParameters, Cia402Drive, Cia402Parameters};
use takt::sim::homing_switches::{ReferenceSwitches, Switch};
use takt::sim::plant::{Encoder, JointParameters};
use takt::sim::{DriveFault, SimulatedBus, WireBitRates};
use takt_rt::{DriveState, OperationMode};
use takt_wire::canopen::eds::AccessType;
use takt_wire::canopen::object::ObjectAddress;

use super::bench::*;

/// One axis without a gear, whose drive has this data sheet; with lines of the axis' table, and a quirk file.
fn sheet_bench(sheet: &Path, lines: &str) -> Bench {
    let text = format!(
        "name = \"one\"\n[[bus]]\nname = \"can\"\n[[axis]]\nname = \"joint\"\n\
         bus = \"can\"\nnode = {NODE}\ndrive = \"cia402\"\neds = {:?}\ncounts_per_turn = 16384\n{lines}\n\
         limits = {{ position = [\"-170 deg\", \"170 deg\"], velocity = \"90 deg/s\", acceleration = \"360 deg/s2\", torque = 10 }}\n",
        sheet.display().to_string()
    );
    let mut config = Config::parse("one.toml", &text).unwrap_or_else(|error| panic!("{error:?}\n{text}"));
    config.simulation.longest_gap_ns = u64::MAX;
    Bench::of(TargetDrive::of(&config.axes[0]).unwrap(), takt::simulated_bus(&config, 0))
}

fn sheets() -> Vec<PathBuf> {
    let entries = std::fs::read_dir("../../tests/eds/vendors").unwrap();
    let mut sheets: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    sheets.retain(|path| path.extension().is_some_and(|extension| extension == "eds"));
    sheets.push("../../configs/eds/erob-canopen.eds".into());
    sheets.sort();
    sheets
}

fn vendor(name: &str) -> PathBuf {
    Path::new("../../tests/eds/vendors").join(name)
}

fn named(sheet: &Path) -> String {
    sheet.file_name().unwrap().to_string_lossy().into_owned()
}

/// A configuration may need another mode than CSP.
fn of_sheet(sheet: &Path) -> (Device, Bench) {
    let device = Device::load(sheet, None).unwrap();
    let bench = sheet_bench(sheet, "");
    (device, bench)
}

/// The modes that the drive has by its data sheet, homing among them.
fn has_mode(device: &Device, mode: OperationMode) -> bool {
    let stated = device.number(ObjectAddress::new(0x6502, 0)).filter(|bits| *bits != 0);
    match (stated, mode) {
        (Some(bits), mode) => bits as u32 & mode.supported_bit() != 0,
        (None, OperationMode::Homing) => device.dictionary.object(0x6098).is_some(),
        (None, mode) => device.modes().contains(mode),
    }
}

fn assert_at_rest(bench: &mut Bench, of: &str) {
    let seen = bench.observe();
    assert!(!seen.state.has_torque(), "{of}: {seen:?}");
    assert!(seen.velocity.abs() < 1e-3, "{of}: {seen:?}");
}

#[test]
fn every_data_sheet_gives_a_drive_that_tells_its_identity_modes_state_and_errors() {
    for sheet in sheets() {
        let (device, mut bench) = of_sheet(&sheet);
        let of = named(&sheet);
        let report = bench.run(Task::Info).unwrap_or_else(|error| panic!("{of}: {error}"));
        let vendor = device.dictionary.device.vendor_number.unwrap_or(0);
        assert_eq!(report.get("vendor_id").and_then(Value::as_u64), Some(vendor.into()), "{of}: {report:?}");
        assert_eq!(report.get("state"), Some(&"switch on disabled".into()), "{of}");
        assert!(number(&report, "position").is_finite(), "{of}");
        let modes = device.number(ObjectAddress::new(0x6502, 0));
        assert_eq!(
            report.get("supported_modes").is_some(),
            device.dictionary.object(0x6502).is_some(),
            "{of}"
        );
        if modes.is_some_and(|modes| modes & 1 != 0) {
            let words = report.items().iter().find(|item| item.key == "supported_modes").unwrap();
            assert!(words.text.to_string().starts_with("profile position"), "{of}: {}", words.text);
        }
        // Only SDO uploads were sent.
        assert!(bench.sent.iter().all(|frame| frame.payload()[0] & 0xE0 != 0x20), "{of}: {:?}", bench.sent);
    }
}

#[test]
fn every_drive_with_profile_position_moves_to_its_target_and_ends_without_torque() {
    let mut moved = 0;
    for sheet in sheets() {
        let (device, mut bench) = of_sheet(&sheet);
        let of = named(&sheet);
        let outcome = bench.run(move_to(absolute(20.0)));
        if !has_mode(&device, OperationMode::ProfilePosition) {
            assert!(matches!(outcome.unwrap_err().failure, Failure::Unsupported { .. }), "{of}");
            continue;
        }
        let report = outcome.unwrap_or_else(|error| panic!("{of}: {error}"));
        let position = bench.observe().position.to_degrees();
        assert!((position - 20.0).abs() < 0.5, "{of}: {position} {report:?}");
        assert!(bench.fastest.to_degrees() < 70.0, "{of}: {}", bench.fastest.to_degrees());
        assert_at_rest(&mut bench, &of);
        bench.run(move_to(MoveKind::Relative(degrees(-5.0)))).unwrap();
        assert!((bench.observe().position.to_degrees() - 15.0).abs() < 0.5, "{of}");
        moved += 1;
    }
    assert!(moved >= 7, "{moved}");
}

#[test]
fn every_drive_with_profile_velocity_runs_for_a_time_and_ramps_to_standstill() {
    let mut moved = 0;
    for sheet in sheets() {
        let (device, mut bench) = of_sheet(&sheet);
        let of = named(&sheet);
        let request = Task::Velocity {
            velocity: degrees(-30.0),
            profile: brisk(),
            duration_ns: Some(SECOND),
            keeps_enabled: false,
        };
        let outcome = bench.run(request);
        if !has_mode(&device, OperationMode::ProfileVelocity) {
            assert!(matches!(outcome.unwrap_err().failure, Failure::Unsupported { .. }), "{of}");
            continue;
        }
        let report = outcome.unwrap_or_else(|error| panic!("{of}: {error}"));
        let travelled = number(&report, "travelled").to_degrees();
        assert!((-36.0..-20.0).contains(&travelled), "{of}: {travelled}");
        assert_at_rest(&mut bench, &of);
        moved += 1;
    }
    assert!(moved >= 5, "{moved}");
}

#[test]
fn a_drive_with_profile_torque_is_stopped_when_it_gets_too_fast() {
    let sheet = vendor("eyou-euservo.eds");
    // The data sheet has no rated torque (6076), so the configuration says it.
    let mut bench = sheet_bench(&sheet, "joint = { rated_torque = 10, inertia = 0.1 }");
    let limit = degrees(10.0);
    let request =
        |torque| Task::Torque { torque, velocity_limit: Some(limit), duration_ns: Some(20 * SECOND) };
    let failed = bench.run(request(CommandValue::Joint(5.0))).unwrap_err();
    assert!(matches!(failed.failure, Failure::AtLimit { .. }), "{failed:?}");
    assert_at_rest(&mut bench, "eyou");
    let mut unrated = sheet_bench(&sheet, "");
    let failed = unrated.run(request(CommandValue::Joint(1.0))).unwrap_err();
    assert!(failed.failure.to_string().contains("[axis.joint] rated_torque"), "{failed:?}");
}

#[test]
fn every_motion_stops_on_ctrl_c_and_ends_without_torque() {
    for sheet in sheets() {
        let (device, mut bench) = of_sheet(&sheet);
        let of = named(&sheet);
        if !has_mode(&device, OperationMode::ProfilePosition) {
            continue;
        }
        let failed =
            bench.run_interrupted(move_to(absolute(90.0)), |step| usize::from(step == "move")).unwrap_err();
        assert_eq!(failed.failure, Failure::Interrupted, "{of}");
        assert_at_rest(&mut bench, &of);
        assert!(bench.observe().position.to_degrees() < 80.0, "{of}");
        assert!(bench.steps.contains(&"stop in control"), "{of}: {:?}", bench.steps);
    }
}

#[test]
fn a_drive_is_enabled_watched_and_disabled() {
    for sheet in sheets() {
        let (device, mut bench) = of_sheet(&sheet);
        let of = named(&sheet);
        if !has_mode(&device, OperationMode::ProfilePosition) {
            continue;
        }
        bench.run(Task::Enable { hold_ns: Some(SECOND / 5), keeps_enabled: false }).unwrap();
        assert_at_rest(&mut bench, &of);
        bench.run(Task::Enable { hold_ns: None, keeps_enabled: true }).unwrap();
        assert_eq!(bench.observe().state, DriveState::OperationEnabled, "{of}");
        // Nobody's heartbeat is missed meanwhile: the drive stays enabled.
        let watch = Task::Watch { every_ns: 100 * MS, duration_ns: Some(2 * SECOND) };
        assert!(number(&bench.run(watch).unwrap(), "readings") >= 20.0, "{of}");
        assert_eq!(bench.observe().state, DriveState::OperationEnabled, "{of}");
        let report = bench.run(Task::Disable).unwrap();
        assert_eq!(report.get("was_enabled"), Some(&true.into()), "{of}");
        assert_at_rest(&mut bench, &of);
    }
}

#[test]
fn a_drive_that_can_watch_its_master_stops_when_the_master_dies_and_the_others_are_noted() {
    for sheet in sheets() {
        let (device, mut bench) = of_sheet(&sheet);
        let of = named(&sheet);
        if !has_mode(&device, OperationMode::ProfilePosition) {
            continue;
        }
        if device.dictionary.object(0x1016).is_none() {
            bench.run(Task::Enable { hold_ns: Some(MS), keeps_enabled: false }).unwrap();
            let noted = bench.notes.iter().any(|note| note.contains("no heartbeat watchdog (1016)"));
            assert!(noted, "{of}: {:?}", bench.notes);
            continue;
        }
        // The program runs for two seconds and then stops.
        let slow = Task::Move {
            kind: absolute(160.0),
            profile: takt::family::commission::MotionProfile { velocity: Some(degrees(20.0)), ..brisk() },
            keeps_enabled: false,
        };
        assert!(bench.run_for(slow, 2 * SECOND, |_, _| {}).is_none(), "{of}");
        takt_rt::BusPort::send(&mut bench.bus, 30 * SECOND, &[]);
        assert_at_rest(&mut bench, &of);
        assert!(bench.observe().position.to_degrees() < 100.0, "{of}");
    }
}

#[test]
fn the_present_position_becomes_zero_by_homing_method_35_or_37() {
    let mut homed = 0;
    for sheet in sheets() {
        let (device, mut bench) = of_sheet(&sheet);
        let of = named(&sheet);
        let home = |method| Task::Home { method: Some(method), within_ns: SECOND, is_forced: false };
        if !has_mode(&device, OperationMode::Homing) || device.dictionary.object(0x6098).is_none() {
            let failed = bench.run(home(35)).unwrap_err();
            assert!(matches!(failed.failure, Failure::Unsupported { .. }), "{of}: {failed:?}");
            continue;
        }
        bench.run(move_to(absolute(12.0))).unwrap();
        let offset = read(&mut bench, "position actual value");
        assert!(offset.abs() > 300, "{of}: {offset}");
        let lists_methods = device.dictionary.object(0x60E3).is_some();
        if lists_methods {
            let failed = bench.run(home(35)).unwrap_err();
            assert!(failed.failure.to_string().contains("60E3 names 37, 34"), "{of}: {failed:?}");
        }
        let method = if lists_methods { 37 } else { 35 };
        let report = bench.run(home(method)).unwrap_or_else(|error| panic!("{of}: {error}"));
        assert!(number(&report, "home_counts").abs() < 5.0, "{of}: {report:?}");
        assert_at_rest(&mut bench, &of);
        homed += 1;
    }
    assert!(homed >= 5, "{homed}");
}

/// A drive whose joint has limit switches at ±2 rad, a home switch from 0.5 to 1 rad, and an index pulse at 0.
fn switched_bench(sheet: &Path) -> Bench {
    let bench = sheet_bench(sheet, "");
    let counts_per_turn = 16384.0;
    let joint = Cia402AxisParameters {
        joint: JointParameters {
            inertia: 0.05,
            viscous_friction: 0.05,
            coulomb_friction: 0.2,
            friction_shape: takt::config::FrictionShape::Constant,
            brake_torque: 40.0,
        },
        encoder: Encoder { counts_per_unit: counts_per_turn / TAU, zero_counts: 0.0 },
        counts_per_turn,
        initial_position: 0.2,
        rated_torque: 10.0,
        peak_torque: 20.0,
        highest_velocity: 12.0,
        switches: ReferenceSwitches {
            negative_limit: Some(Switch::below(-2.0)),
            positive_limit: Some(Switch::above(2.0)),
            home: Some(Switch { from: 0.5, to: 1.0 }),
            index_distance: Some(TAU),
        },
        end_stops: None,
    };
    let drive = Cia402Drive::new(Cia402Parameters {
        sheet: Device::load(sheet, None).unwrap().dictionary,
        node: NODE,
        quirks: Quirks::default(),
        axes: vec![joint],
        power_up_ns: 5 * MS,
        feedback_delay_ns: 20_000,
        seed: 7,
    });
    let rates = WireBitRates { nominal: 1_000_000, data: None };
    Bench::of(bench.target, SimulatedBus::with_drives(rates, u64::MAX, vec![Box::new(drive.unwrap())]))
}

#[test]
fn homing_finds_limit_switches_the_home_switch_and_the_index_pulse_and_counts_from_there() {
    for name in ["faulhaber-mcbl300x.eds", "maxon-epos4.eds"] {
        // Methods that both drives have, each with the place that it finds: rad.
        for (method, place) in [(17, -2.0), (18, 2.0), (23, 0.5), (27, 1.0), (33, 0.0)] {
            let mut bench = switched_bench(&vendor(name));
            let of = format!("{name}, method {method}");
            // 6099:1, 6099:2 and 609A, of the EPOS4 in r/min and r/min/s, of the other in counts.
            let values = if name.starts_with("maxon") { [7, 1, 100] } else { [1800, 180, 16000] };
            for (object, value) in ["6099:1", "6099:2", "609A"].into_iter().zip(values) {
                bench.run(write(object, value)).unwrap_or_else(|error| panic!("{of}: {error}"));
            }
            let home = Task::Home { method: Some(method), within_ns: 60 * SECOND, is_forced: false };
            let report = bench.run(home).unwrap_or_else(|error| panic!("{of}: {error}"));
            let seen = bench.observe();
            assert!((seen.position - place).abs() < 0.05, "{of}: {seen:?} {report:?}");
            let counted = number(&report, "home_counts") / (16384.0 / TAU);
            assert!((seen.position - place - counted).abs() < 0.01, "{of}: {seen:?} {report:?}");
            assert_at_rest(&mut bench, &of);
        }
    }
}

#[test]
fn a_homing_that_does_not_end_in_its_time_is_stopped() {
    let mut bench = switched_bench(&vendor("faulhaber-mcbl300x.eds"));
    bench.run(write("6099:1", 100)).unwrap();
    let home = Task::Home { method: Some(17), within_ns: SECOND, is_forced: false };
    let failed = bench.run(home).unwrap_err();
    assert!(matches!(failed.failure, Failure::NotInTime { what: "the end of homing", .. }), "{failed:?}");
    assert_at_rest(&mut bench, "faulhaber");
}

#[test]
fn a_homing_that_is_faster_than_the_limit_of_the_axis_is_refused() {
    // It holds 100 r/min for the way to the switch, and lists method 17.
    let mut bench = sheet_bench(&vendor("maxon-epos4.eds"), "");
    let home = Task::Home { method: Some(17), within_ns: SECOND, is_forced: false };
    let failed = bench.run(home).unwrap_err();
    assert!(matches!(failed.failure, Failure::OutsideLimits { .. }), "{failed:?}");
    assert_eq!(failed.step, "homing speeds");
    assert_at_rest(&mut bench, "epos4");
}

#[test]
fn a_homing_method_without_its_switch_is_an_error_and_an_unknown_one_is_refused() {
    let mut bench = sheet_bench(&vendor("faulhaber-mcbl300x.eds"), "");
    let home = |method, is_forced| Task::Home { method, within_ns: SECOND, is_forced };
    let failed = bench.run(home(Some(17), false)).unwrap_err();
    assert!(matches!(failed.failure, Failure::Homing(_)), "{failed:?}");
    assert_at_rest(&mut bench, "faulhaber");
    for method in [-3, 0, 15, 36, 38] {
        let failed = bench.run(home(Some(method), false)).unwrap_err();
        assert!(failed.failure.is_refusal() && failed.failure.to_string().contains("--force"), "{failed:?}");
        assert!(bench.sent.is_empty());
    }
}

#[test]
fn a_fault_is_named_in_the_words_of_the_quirk_file_and_cleared() {
    let quirks = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    std::fs::write(
        quirks.path(),
        "[drive]\nvendor = \"V\"\nproduct = \"P\"\nstatus = \"from its data sheet, not tried on hardware\"\nsources = []\n\
         [errors]\n3210 = \"the bus bar is too hot to touch\"\n",
    )
    .unwrap();
    let line = format!("quirks = {:?}", quirks.path().display().to_string());
    let mut bench = sheet_bench(&vendor("eyou-euservo.eds"), &line);
    bench.run(Task::Info).unwrap();
    bench.bus.inject_fault(NODE, DriveFault::OverVoltage).unwrap();
    let words = bench.run(move_to(absolute(10.0))).unwrap_err().failure.to_string();
    assert!(words.contains("0x3210 (the bus bar is too hot to touch); check the supply"), "{words}");
    let report = bench.run(Task::Info).unwrap();
    let error = report.items().iter().find(|item| item.key == "error_code").unwrap();
    assert_eq!(error.text.to_string(), "0x3210 (the bus bar is too hot to touch)");
    let report = bench.run(Task::ClearFault { is_confirmed: false }).unwrap();
    assert_eq!(report.get("cleared"), Some(&true.into()));
    bench.run(move_to(absolute(10.0))).unwrap();
}

#[test]
fn every_drive_faults_by_name_and_is_reset() {
    for sheet in sheets() {
        let (_, mut bench) = of_sheet(&sheet);
        let of = named(&sheet);
        bench.run(Task::Info).unwrap();
        bench.bus.inject_fault(NODE, DriveFault::OverVoltage).unwrap();
        let report = bench.run(Task::Info).unwrap();
        assert_eq!(report.get("state"), Some(&"fault".into()), "{of}");
        let report = bench.run(Task::ClearFault { is_confirmed: false }).unwrap();
        assert_eq!(report.get("fault"), Some(&"0x3210".into()), "{of}: {report:?}");
        assert_eq!(report.get("cleared"), Some(&true.into()), "{of}");
        assert_eq!(bench.observe().state, DriveState::SwitchOnDisabled, "{of}");
    }
}

#[test]
fn saved_parameters_survive_a_power_cycle_until_those_of_the_factory_are_restored() {
    let mut done = 0;
    for sheet in sheets() {
        let (device, mut bench) = of_sheet(&sheet);
        let of = named(&sheet);
        let writable = |index| {
            let entry = device.entry(ObjectAddress::new(index, 1));
            entry.is_some_and(|entry| matches!(entry.access, AccessType::ReadWrite | AccessType::WriteOnly))
        };
        if !writable(0x1010) || !writable(0x1011) {
            let task = if writable(0x1010) { Task::Restore { is_confirmed: true } } else { Task::Save };
            let failed = bench.run(task).unwrap_err();
            assert!(matches!(failed.failure, Failure::Unsupported { .. }), "{of}: {failed:?}");
            continue;
        }
        let before = read(&mut bench, "profile velocity");
        let value = before + 7;
        bench.run(write("profile velocity", value)).unwrap();
        bench.run(Task::Save).unwrap();
        bench.bus.power_cycle(NODE).unwrap();
        assert_eq!(read(&mut bench, "profile velocity"), value, "{of}");
        let failed = bench.run(Task::Restore { is_confirmed: false }).unwrap_err();
        assert!(matches!(failed.failure, Failure::NeedsConsent { option: "--yes", .. }), "{of}: {failed:?}");
        bench.run(Task::Restore { is_confirmed: true }).unwrap();
        bench.bus.power_cycle(NODE).unwrap();
        assert_eq!(read(&mut bench, "profile velocity"), before, "{of}");
        done += 1;
    }
    assert!(done >= 5, "{done}");
}

#[test]
fn objects_are_found_by_name_with_the_type_and_the_access_of_the_data_sheet() {
    let bench = sheet_bench(&vendor("schunk-lwa4p.eds"), "");
    // Its data sheet has no object 6085.
    let failed = dictionary::find(&bench.target.drive, "quick stop deceleration").unwrap_err();
    assert!(failed.to_string().contains("is no object"), "{failed}");
    let Ok(SelectedObject::Known(entry)) = dictionary::find(&bench.target.drive, "1400:1") else { panic!() };
    assert_eq!(entry.object.data_type.length(), 4);
    let found = dictionary::find(&bench.target.drive, "5FFF").unwrap();
    assert_eq!(found, SelectedObject::Unknown(ObjectAddress::new(0x5FFF, 0)));
}

#[test]
fn what_only_a_vendors_own_objects_can_do_is_refused_with_an_alternative() {
    let mut bench = sheet_bench(&vendor("maxon-epos2.eds"), "");
    for (request, way) in [
        (Task::Zero { is_confirmed: true }, "home --method 37"),
        (Task::SetId { node: 5 }, "takt lss"),
        (Task::SetBitRate { bit_rate: 500_000 }, "takt lss"),
        (Task::Gear { ratio: None }, "index:subindex"),
        (Task::Interpolation, "index:subindex"),
    ] {
        let failed = bench.run(request.clone()).unwrap_err();
        assert!(failed.failure.is_refusal() && failed.failure.to_string().contains(way), "{failed:?}");
        assert!(bench.sent.is_empty());
    }
}

#[test]
fn accelerations_are_written_in_the_unit_of_the_quirk_file() {
    // Velocities of 1/65536 counts in a millisecond, and accelerations of so much in a millisecond.
    let line =
        format!("quirks = {:?}", Path::new("../../drives/technosoft-ipos.toml").canonicalize().unwrap());
    let mut bench = sheet_bench(&vendor("eyou-euservo.eds"), &line);
    bench.run(move_to(absolute(20.0))).unwrap();
    // 200 deg/s² are 9102 counts/s², which are 597 of 15.26 counts/s².
    assert!((read(&mut bench, "profile acceleration") - 597).abs() <= 1);
    // 60 deg/s are 2731 counts/s, which are 178979 of 0.01526 counts/s.
    assert!((read(&mut bench, "profile velocity") - 178_979).abs() <= 40);
    assert!((bench.observe().position.to_degrees() - 20.0).abs() < 0.5);
    assert!(
        bench.fastest.to_degrees() > 50.0 && bench.fastest.to_degrees() < 61.0,
        "{}",
        bench.fastest.to_degrees()
    );
}

#[test]
fn the_turn_count_is_cleared_by_the_object_of_the_quirk_file_with_consent() {
    let quirks = Path::new("../../drives/erob-canopen.toml").canonicalize().unwrap();
    let sheet = Path::new("../../configs/eds/erob-canopen.eds");
    let mut bench = sheet_bench(sheet, &format!("quirks = {quirks:?}"));
    assert!(bench.run(Task::Zero { is_confirmed: false }).unwrap_err().failure.is_refusal());
    bench.run(move_to(absolute(-90.0))).unwrap();
    let report = bench.run(Task::Zero { is_confirmed: true }).unwrap();
    assert!((number(&report, "before_counts") + 4_096.0).abs() < 20.0, "{report:?}");
    assert!((number(&report, "after_counts") - 12_288.0).abs() < 20.0, "{report:?}");
    bench.bus.inject_fault(NODE, DriveFault::MultiTurnBattery).unwrap();
    let failed = bench.run(Task::ClearFault { is_confirmed: false }).unwrap_err();
    assert!(matches!(failed.failure, Failure::NeedsConsent { option: "--yes", .. }), "{failed:?}");
    assert_eq!(bench.observe().state, DriveState::Fault);
    bench.run(Task::ClearFault { is_confirmed: true }).unwrap();
    assert_eq!(bench.observe().state, DriveState::SwitchOnDisabled);
}
