//! Any CiA 402 drive from its data sheet: `drive = "cia402"`, brought up, moved and simulated by the file alone.

use std::path::{Path, PathBuf};

use takt::Config;
use takt::config::Control;
use takt::family::bring_up::{PdoPlan, ProcessData};
use takt::family::cia402::{self, Device};
use takt::{Outcome, VirtualRun};
use takt_rt::PositionCounter;
use takt_wire::canopen::objects::PdoDirection;
use takt_wire::canopen::pdo_configuration::PdoConfiguration;

const CYCLES_AT_MOST: u64 = 60_000;

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn sheets() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(repository().join("tests/eds/vendors")).unwrap();
    let mut sheets: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    sheets.retain(|path| path.extension().is_some_and(|extension| extension == "eds"));
    sheets.push(repository().join("configs/eds/erob-canopen.eds"));
    sheets.sort();
    sheets
}

/// Runs the program, and returns how far each axis is from 0 at its end.
fn run(config: &Config) -> Vec<f64> {
    let mut run = VirtualRun::simulated(config).unwrap().0;
    let mut farthest = vec![0.0_f64; config.axes.len()];
    let outcome = run.run(CYCLES_AT_MOST, |run| {
        for (farthest, axis) in farthest.iter_mut().zip(&run.snapshot().axes) {
            *farthest = farthest.max(axis.position.abs());
        }
    });
    assert_eq!(outcome, Some(Outcome::Finished), "{}: {:?}", config.name, run.snapshot().groups[0].stop);
    assert!(farthest.iter().all(|position| *position > 0.1), "{}: {farthest:?}", config.name);
    run.snapshot().axes.iter().map(|axis| axis.position).collect()
}

#[test]
fn an_arm_of_three_makers_drives_moves_in_csp_at_1_ms() {
    let config = Config::load(&repository().join("configs/three-drives.toml")).unwrap();
    assert_eq!(config.cycle.period_ns, 1_000_000);
    let makers: std::collections::BTreeSet<_> =
        config.axes.iter().map(|axis| cia402::device(axis).dictionary.device.vendor_name.clone()).collect();
    assert_eq!(makers.len(), 3);
    assert!(config.axes.iter().all(|axis| axis.control == Control::Position));
    for (axis, position) in config.axes.iter().zip(run(&config)) {
        assert!(position.abs() < 0.01, "{}: {position}", axis.name);
    }
}

#[test]
fn a_data_sheet_may_bound_the_counts_of_the_position() {
    let counter = |name: &str| {
        let sheet = repository().join("tests/eds/vendors").join(name);
        cia402::drive(Device::load(&sheet, None).unwrap()).counter
    };
    let bounded = PositionCounter::new(-1_800_000_000, 1_800_000_000).unwrap();
    assert_eq!(counter("faulhaber-mcbl300x.eds"), bounded);
    assert_eq!(counter("maxon-epos4.eds"), PositionCounter::BITS_32, "0 and 0 are no bounds");
}

#[test]
fn every_data_sheet_gives_a_configuration_that_runs_as_it_is() {
    let mut moved = 0;
    for sheet in sheets() {
        let device = Device::load(&sheet, None).unwrap();
        let text = cia402::starting_configuration(&device, &sheet, None, 5, None);
        let config =
            Config::parse("starting.toml", &text).unwrap_or_else(|error| panic!("{error:?}\n{text}"));
        let axis = &config.axes[0];
        let mode = axis.control.operation_mode();
        assert!(axis.drive.modes.contains(mode), "{}", sheet.display());
        let has_program = !config.program.moves.is_empty();
        // Some drives have fixed PDOs without the target: they take it by SDO only.
        if has_program && !axis.drive.has_fixed_process_data {
            run(&config);
            moved += 1;
        }
    }
    assert!(moved >= 4, "{moved}");
}

fn configuration(axis: &str) -> String {
    format!(
        "name = \"one\"\n[[bus]]\nname = \"can\"\n[[axis]]\nname = \"joint\"\nbus = \"can\"\nnode = 1\ndrive = \"cia402\"\n{axis}\n\
         limits = {{ position = [-1, 1], velocity = 1, acceleration = 5, torque = 10 }}\n"
    )
}

#[test]
fn a_drive_without_its_data_sheet_is_refused_with_the_key_that_is_missing() {
    let error = format!("{:?}", Config::parse("one.toml", &configuration("")).unwrap_err());
    assert!(error.contains("`axis.eds` is missing"), "{error}");
}

#[test]
fn a_file_that_is_of_no_drive_is_refused_with_what_it_lacks() {
    let file = tempfile::Builder::new().suffix(".eds").tempfile().unwrap();
    std::fs::write(
        file.path(),
        "[1000]\nParameterName=Device type\nDataType=7\nAccessType=ro\n[MandatoryObjects]\nSupportedObjects=1\n1=0x1000\n",
    )
    .unwrap();
    let text = configuration(&format!("eds = {:?}", file.path().display().to_string()));
    let error = format!("{:?}", Config::parse("one.toml", &text).unwrap_err());
    assert!(error.contains("6040"), "{error}");
}

#[test]
fn a_mode_whose_target_no_pdo_can_carry_is_refused() {
    // Its interpolation data record (60C1:1) cannot be mapped.
    let sheet = repository().join("tests/eds/vendors/eyou-euservo.eds");
    let text = configuration(&format!(
        "eds = {:?}\ncounts_per_turn = 65536\nmode = \"ip\"",
        sheet.display().to_string()
    ));
    let error = format!("{:?}", Config::parse("one.toml", &text).unwrap_err());
    assert!(error.contains("`axis.mode` cannot be \"ip\""), "{error}");
}

#[test]
fn interpolated_position_has_the_same_target_in_a_written_and_in_a_stored_mapping() {
    // This drive has an interpolation data record (60C1:1), and no cyclic synchronous modes.
    let sheet = repository().join("tests/eds/vendors/schunk-lwa4p.eds");
    let eds = format!("eds = {:?}\ncounts_per_turn = 65536\nmode = \"ip\"", sheet.display().to_string());
    let config = Config::parse("one.toml", &configuration(&eds)).unwrap();
    let written = ProcessData::of(&config.axes[0], &config);
    let carried = |data: &ProcessData| {
        data.commands
            .iter()
            .flat_map(|pdo| &pdo.objects)
            .any(|object| (object.index, object.subindex) == (0x60C1, 1))
    };
    assert!(carried(&written));
    let reported = |direction, plans: &[PdoPlan]| -> Vec<PdoConfiguration> {
        let report = |plan: &PdoPlan| PdoConfiguration {
            id: Some(plan.id),
            transmission_type: Some(plan.transmission_type),
            objects: plan.objects.clone(),
            direction,
            number: plan.number,
            is_valid: true,
            inhibit_time_100us: None,
            event_timer_ms: None,
        };
        plans.iter().map(report).collect()
    };
    let all = [
        reported(PdoDirection::Receive, &written.commands),
        reported(PdoDirection::Transmit, &written.feedback),
    ];
    let stored = ProcessData::as_reported(&config.axes[0], &config, &all.concat()).unwrap();
    assert!(carried(&stored));
}

#[test]
fn a_drive_that_has_them_runs_its_program_in_every_mode_of_positions() {
    let sheet = repository().join("tests/eds/vendors/eyou-euservo.eds");
    let text = cia402::starting_configuration(&Device::load(&sheet, None).unwrap(), &sheet, None, 5, None);
    for mode in ["csp", "csv", "cst", "pp"] {
        let config = Config::parse("starting.toml", &text.replace("\"csp\"", &format!("{mode:?}"))).unwrap();
        run(&config);
    }
}

#[test]
fn an_erob_by_its_data_sheet_and_quirk_file_moves_as_one_of_its_own_family_in_every_mode() {
    let file = |name: &str| repository().join(name).display().to_string();
    let drive = format!(
        "drive = \"cia402\"\neds = {:?}\nquirks = {:?}",
        file("configs/eds/erob-canopen.eds"),
        file("drives/erob-canopen.toml")
    );
    for mode in ["csp", "csv", "cst", "ip", "pp", "pv", "pt"] {
        let text = std::fs::read_to_string(file(&format!("configs/erob-modes/erob-{mode}.toml"))).unwrap();
        let ends = [text.clone(), text.replace("drive = \"erob-canopen\"", &drive)]
            .map(|text| run(&Config::parse(mode, &text).unwrap())[0]);
        assert!((ends[0] - ends[1]).abs() < 0.01, "{mode}: {ends:?}");
    }
}

#[test]
fn what_a_drive_lacks_is_said_and_not_demanded() {
    let sheet = repository().join("tests/eds/vendors/schunk-lwa4p.eds");
    let text = configuration(&format!("eds = {:?}\ncounts_per_turn = 65536", sheet.display().to_string()));
    let config = Config::parse("one.toml", &text).unwrap();
    assert_eq!(config.warnings(), []);
    let losses = config.losses();
    for object in ["1029", "6085", "603F", "6076"] {
        assert!(losses.iter().any(|loss| loss.contains(object)), "{object}: {losses:?}");
    }
}
