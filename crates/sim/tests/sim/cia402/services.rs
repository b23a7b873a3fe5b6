//! Services: SDO transfers, PDO mapping, transmission types, NMT, guarding, quirks.

use takt::config::quirks::{self, MotionUnit, Quirks};
use takt::sim::{DriveFault, NodeState};
use takt_rt::{DriveState, Frame, Id, OperationMode};

use super::{Tried, sheet};
use crate::bench::{MILLISECOND_NS, NODE};

const VALUE_TOO_HIGH: u32 = 0x0609_0031;
const VALUE_TOO_LOW: u32 = 0x0609_0030 + 2;
const LENGTH_TOO_HIGH: u32 = 0x0607_0012;
const READ_ONLY: u32 = 0x0601_0002;
const NO_OBJECT: u32 = 0x0602_0000;
const NOT_MAPPABLE: u32 = 0x0604_0041;
const PDO_TOO_LONG: u32 = 0x0604_0042;
const DEVICE_STATE: u32 = 0x0800_0022;

/// The quirk files that are shipped.
fn shipped() -> Vec<(String, Quirks)> {
    let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("drives");
    let mut all = vec![];
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            all.push((name, quirks::load(&path).unwrap_or_else(|error| panic!("{error:?}"))));
        }
    }
    all
}

#[test]
fn a_quirk_file_keeps_the_mode_of_an_enabled_drive_and_has_a_fault_reset_held() {
    let quirks = shipped().into_iter().find(|(name, _)| name == "erob-canopen").unwrap().1;
    let mut bench = Tried::with(sheet("erob-canopen"), quirks).bench;
    assert_eq!(bench.read(0x6087, 0), Ok(1_000), "a value that the data sheet leaves open");
    bench.enable(8, 0x607A_0020, 0);
    assert_eq!(bench.write(0x6060, 0, 1, 9), Err(DEVICE_STATE));
    bench.bus.inject_fault(NODE, DriveFault::Encoder).unwrap();
    for (controlword, cycles, state) in [
        (0x0F, 3, DriveState::Fault),
        (0x80, 2, DriveState::Fault),
        (0x00, 3, DriveState::Fault),
        (0x80, 6, DriveState::SwitchOnDisabled),
    ] {
        for _ in 0..cycles {
            bench.cycle(controlword, 0);
        }
        assert_eq!(bench.observe().state, state, "{cycles} cycles of {controlword:#04x}");
    }
    // Some units set bit 7.
    assert_eq!(bench.cycle(0, 0).0 & !0x80, 0x1250);
    bench.write(0x6060, 0, 1, 7).unwrap();
    bench.run_ms(2);
    assert_eq!(bench.read(0x6061, 0), Ok(7), "a mode that object 6502 does not declare");
}

#[test]
fn values_out_of_the_ranges_of_the_data_sheet_abort_and_change_nothing() {
    let mut tried = Tried::new(sheet("eyou-euservo"));
    let before = tried.bench.read(0x6072, 0).unwrap();
    assert_eq!(tried.write(0x6072, 0, 1001), Err(VALUE_TOO_HIGH));
    assert_eq!(tried.write(0x6072, 0, 99), Err(VALUE_TOO_LOW));
    assert_eq!(tried.bench.write(0x6072, 0, 4, 500), Err(LENGTH_TOO_HIGH));
    assert_eq!(tried.bench.read(0x6072, 0), Ok(before));
    tried.write(0x6072, 0, 500).unwrap();
    assert_eq!(tried.bench.read(0x6072, 0), Ok(500));
}

#[test]
fn a_mapping_is_written_where_the_file_allows_it_and_nowhere_else() {
    let mut tried = Tried::new(sheet("eyou-euservo"));
    let id = 0x200 + i64::from(NODE);
    assert_eq!(tried.write(0x1600, 0, 0), Err(DEVICE_STATE));
    tried.write(0x1400, 1, 0x8000_0000 | id).unwrap();
    assert_eq!(tried.write(0x1600, 1, 0x6040_0010), Err(DEVICE_STATE));
    tried.write(0x1600, 0, 0).unwrap();
    assert_eq!(tried.write(0x1600, 1, 0x6041_0010), Err(NOT_MAPPABLE));
    assert_eq!(tried.write(0x1600, 1, 0x6099_0120), Err(NO_OBJECT));
    tried.write(0x1600, 1, 0x607A_0020).unwrap();
    tried.write(0x1600, 2, 0x60FF_0020).unwrap();
    tried.write(0x1600, 3, 0x6040_0010).unwrap();
    assert_eq!(tried.write(0x1600, 0, 3), Err(PDO_TOO_LONG));
    tried.write(0x1600, 0, 2).unwrap();
    tried.write(0x1400, 1, id).unwrap();
    let mut fixed = Tried::new(sheet("faulhaber-mcbl-cf"));
    assert_eq!(fixed.write(0x1600, 0, 0), Err(READ_ONLY));
    assert_eq!(fixed.write(0x1600, 1, 0x6040_0010), Err(READ_ONLY));
}

#[test]
fn synchronous_pdos_move_a_drive_in_cyclic_synchronous_position() {
    let mut tried = Tried::new(sheet("eyou-euservo"));
    tried.set_mode(OperationMode::CyclicSynchronousPosition);
    for (communication, mapping, id, objects) in [
        (0x1400, 0x1600, 0x200, [0x6040_0010, 0x607A_0020]),
        (0x1800, 0x1A00, 0x180, [0x6041_0010, 0x6064_0020]),
    ] {
        let id = id + i64::from(NODE);
        tried.write(communication, 1, 0x8000_0000 | id).unwrap();
        tried.write(mapping, 0, 0).unwrap();
        for (object, subindex) in objects.into_iter().zip(1..) {
            tried.write(mapping, subindex, object).unwrap();
        }
        tried.write(mapping, 0, 2).unwrap();
        tried.write(communication, 2, 1).unwrap();
        tried.write(communication, 1, id).unwrap();
    }
    tried.bench.nmt(0x01);
    tried.bench.heard.clear();
    for controlword in [0x06, 0x07, 0x0F] {
        for _ in 0..3 {
            tried.bench.cycle(controlword, 0);
        }
    }
    let mut last = (0, 0);
    for cycle in 1..=200 {
        last = tried.bench.cycle(0x0F, 20 * cycle);
    }
    assert_eq!(last.0 & 0x6F, 0x27);
    assert!((last.1 - 20 * 199).abs() < 80, "{last:?}");
}

#[test]
fn long_values_go_in_segments_and_in_blocks_and_without_blocks_abort() {
    let sheet = eyou_with_a_name();
    let mut tried = Tried::new(sheet.clone());
    // Segmented: 11 bytes in two segments.
    assert_eq!(tried.bench.sdo([0x40, 0x08, 0x10, 0, 0, 0, 0, 0]), [0x41, 0x08, 0x10, 0, 11, 0, 0, 0]);
    assert_eq!(&tried.bench.sdo([0x60, 0, 0, 0, 0, 0, 0, 0]), b"\x00takt te");
    assert_eq!(&tried.bench.sdo([0x70, 0, 0, 0, 0, 0, 0, 0]), b"\x17ster\0\0\0");
    // In one block: two segments, the end with its CRC, the confirmation.
    let begin = tried.bench.sdo([0xA4, 0x08, 0x10, 0, 127, 0, 0, 0]);
    assert_eq!(begin, [0xC6, 0x08, 0x10, 0, 11, 0, 0, 0]);
    tried.bench.send_data(0x600 + u32::from(NODE), [0xA3, 0, 0, 0, 0, 0, 0, 0]);
    tried.bench.run_ms(3);
    let segments = tried.bench.take(0x580 + u32::from(NODE));
    assert_eq!(segments, [b"\x01takt te".to_vec(), b"\x82ster\0\0\0".to_vec()]);
    let end = tried.bench.sdo([0xA2, 2, 127, 0, 0, 0, 0, 0]);
    assert_eq!(end[0], 0xC1 | 3 << 2);
    let mut refusing = Tried::with(sheet, Quirks { refuses_blocks: true, ..Quirks::default() });
    let answer = refusing.bench.sdo([0xA4, 0x08, 0x10, 0, 127, 0, 0, 0]);
    assert_eq!(answer, [0x80, 0x08, 0x10, 0, 0x01, 0, 0x04, 0x05]);
}

/// The EYOU's data sheet with a device name, a text.
fn eyou_with_a_name() -> takt_wire::canopen::eds::ObjectDictionary {
    let path = "../../tests/eds/vendors/eyou-euservo.eds";
    let text = std::fs::read_to_string(path).unwrap();
    let name = "\n[1008]\nParameterName=Manufacturer device name\nObjectType=7\nDataType=0x0009\nAccessType=const\n\
        DefaultValue=takt tester\nPDOMapping=0\n";
    takt_wire::canopen::eds::parse(path, (text + name).as_bytes()).unwrap().dictionary
}

#[test]
fn a_drive_with_guarding_answers_it_and_one_without_does_not() {
    let guarded = |name: &str| {
        let mut tried = Tried::new(sheet(name));
        tried.bench.heard.clear();
        tried.bench.send(Frame::remote(Id::canopen(0x700, NODE), 1).unwrap());
        tried.bench.run_ms(1);
        tried.bench.take(0x700 + u32::from(NODE))
    };
    assert_eq!(guarded("eyou-euservo"), [vec![0x7F]]);
    let has_guarding = sheet("maxon-epos2").object(0x100C).is_some();
    assert_eq!(guarded("maxon-epos2").len(), usize::from(has_guarding));
}

#[test]
fn the_loss_of_the_masters_heartbeat_faults_an_enabled_drive_without_object_6007() {
    let mut tried = Tried::new(sheet("eyou-euservo"));
    tried.write(0x1016, 1, 127 << 16 | 100).unwrap();
    tried.set_mode(OperationMode::ProfilePosition);
    tried.enable();
    tried.bench.send_data(0x77F, [5]);
    tried.bench.run_ms(90);
    assert!(tried.bench.take(0x080 + u32::from(NODE)).is_empty());
    tried.bench.run_ms(200);
    assert_eq!(tried.bench.take(0x080 + u32::from(NODE))[0][..2], [0x30, 0x81]);
    assert_eq!(tried.bench.observe().state, DriveState::Fault);
}

#[test]
fn quirks_take_objects_away_and_make_others_constant() {
    let text = "[drive]\nvendor = \"EYOU\"\nproduct = \"EuServo\"\n\
        status = \"from its data sheet, not tried on hardware\"\nsources = [\"this test\"]\n\
        [objects]\nmissing = [\"1006\", \"1010:2\"]\nconstant = [\"1005\"]\n";
    let quirks = quirks::parse("quirks.toml", text).unwrap();
    let mut tried = Tried::with(sheet("eyou-euservo"), quirks);
    assert_eq!(tried.bench.read(0x1006, 0), Err(NO_OBJECT));
    assert_eq!(tried.bench.read(0x1010, 2), Err(0x0609_0011));
    assert_eq!(tried.write(0x1005, 0, 0x80), Err(READ_ONLY));
}

#[test]
fn a_delay_before_the_first_pdo_and_a_start_by_itself_are_quirks() {
    let delays = quirks::Delays { first_pdo_ns: Some(50 * MILLISECOND_NS), ..quirks::Delays::default() };
    let mut tried = Tried::with(sheet("schunk-lwa4p"), Quirks { delays, ..Quirks::default() });
    tried.bench.nmt(0x01);
    tried.bench.heard.clear();
    let synced = |tried: &mut Tried| {
        tried.bench.send_data(0x080, []);
        tried.bench.run_ms(2);
        tried.bench.take(0x180 + u32::from(NODE)).len()
    };
    assert_eq!(synced(&mut tried), 0);
    tried.bench.run_ms(60);
    assert_eq!(synced(&mut tried), 1);
    let power_up = takt::config::PowerUpState::Operational;
    let mut tried = Tried::with(sheet("schunk-lwa4p"), Quirks { power_up, ..Quirks::default() });
    assert_eq!(tried.bench.observe().nmt, NodeState::Operational);
}

#[test]
fn every_shipped_quirk_file_is_read_and_names_its_sources() {
    let shipped = shipped();
    assert!(shipped.len() >= 12);
    for (name, quirks) in shipped {
        assert!(!quirks.drive.sources.is_empty(), "{name}");
        assert_eq!(quirks.drive.confirmation, quirks::Confirmation::DataSheetOnly, "{name}");
    }
}

#[test]
fn the_shipped_files_tell_modes_units_counts_and_errors_that_data_sheets_leave_out() {
    let shipped = shipped();
    let find = |name: &str| &shipped.iter().find(|(known, _)| known == name).unwrap().1;
    let modes = find("maxon-epos4").modes.as_ref().unwrap();
    assert!(modes.contains(&OperationMode::CyclicSynchronousPosition));
    assert_eq!(find("copley").unit(0x6083), Some(MotionUnit::PositionUnits(10.0)));
    assert_eq!(find("schunk-lwa4p").counts_per_turn, Some(360_000.0));
    assert_eq!(find("eyou-euservo-ph11").error_words(0x8500), Some("velocity following error"));
    assert_eq!(find("kinco-fd5").unit(0x606C), Some(MotionUnit::PositionUnits(0.06103515625)));
}

#[test]
fn the_unit_of_an_acceleration_is_no_unit_of_a_velocity() {
    let text = |key: &str, unit: &str| {
        format!(
            "[drive]\nvendor = \"A\"\nproduct = \"B\"\nstatus = \"tried on hardware\"\nsources = []\n[units]\n{key} = \"{unit}\"\n"
        )
    };
    for (key, right, wrong) in [
        ("velocity", "0.1 counts/s", "0.1 counts/s²"),
        ("target_velocity", "r/min", "r/min/s"),
        ("profile_velocity", "10 r/min", "counts/s^2"),
        ("acceleration", "10 counts/s²", "10 counts/s"),
        ("acceleration", "0.1 r/min/s", "0.1 r/min"),
    ] {
        assert!(quirks::parse("right.toml", &text(key, right)).is_ok(), "{key} = {right}");
        let error = format!("{:?}", quirks::parse("wrong.toml", &text(key, wrong)).unwrap_err());
        assert!(error.contains(key) && error.contains("a unit of"), "{error}");
    }
}

#[test]
fn a_wrong_quirk_file_names_every_problem_and_its_line() {
    let text = "modes = [\"cps\"]\n[drive]\nvendor = \"A\"\nproduct = \"B\"\nstatus = \"tried on hardware\"\nsources = []\n\
        [objects]\nmissing = [\"10\"]\n[units]\nvelocity = \"3 apples\"\n[errors]\nE1 = \"x\"\n[delay]\nboot_up = \"1 s\"\n";
    let error = quirks::parse("wrong.toml", text).unwrap_err();
    let shown = format!("{error:?}");
    for wanted in ["cps", "csp", "\"10\"", "1029:1", "3 apples", "r/min", "E1", "delay"] {
        assert!(shown.contains(wanted), "{wanted} is not in:\n{shown}");
    }
}
