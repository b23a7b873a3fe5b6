//! A drive is configured from a DCF or concise DCF before the controller writes its own values.

use std::path::Path;

use takt::config::Config;
use takt::family::bring_up::BringUpError;
use takt::family::bring_up::stages::BringUp;
use takt_wire::canopen::dcf::{self, DeviceConfiguration, Download};
use takt_wire::canopen::eds;
use takt_wire::canopen::sdo::AbortCode;

use takt_rt::{BusPort, ReceiveBatch};

use super::scripted_drive::{ScriptedDrive, at};
use super::world::{World, config};

/// The profile deceleration, a homing object that takt does not write, a mapping that takt overwrites, and a
/// controlword.
const FILE: &str = "\
[609A]\nParameterName=Homing acceleration\nDataType=7\nAccessType=rw\nParameterValue=1500\n\
[1800sub1]\nParameterName=COB-ID\nDataType=7\nAccessType=rw\nParameterValue=$NODEID+0x180\n\
[1A00sub0]\nParameterName=Count\nDataType=5\nAccessType=rw\nParameterValue=1\n\
[1A00sub1]\nParameterName=Mapped\nDataType=7\nAccessType=rw\nParameterValue=0x60640020\n\
[6040]\nParameterName=Controlword\nDataType=6\nAccessType=rw\nParameterValue=15\n\
[2380sub1]\nParameterName=Gain\nDataType=6\nAccessType=wo\nParameterValue=0x1234\n";

fn configured(file: &str) -> Config {
    let mut config = config(&[(0, 2)]);
    let dictionary = eds::parse("test.dcf", file.as_bytes()).unwrap().dictionary;
    config.axes[0].dcf = Some(DeviceConfiguration::of(Path::new("test.dcf"), &dictionary, 2));
    config
}

fn run(config: &Config, spoil: impl FnOnce(&mut ScriptedDrive)) -> (World, Result<(), BringUpError>) {
    let mut world = World::of(config);
    let drive = world.drive();
    drive.set(0x609A, 0, &[0; 4]);
    drive.set(0x2380, 1, &[0; 2]);
    spoil(drive);
    let outcome = world.run(&mut BringUp::new(config)).map(|_| ());
    (world, outcome)
}

#[test]
fn the_values_of_the_file_are_written_before_those_of_the_controller() {
    let (mut world, outcome) = run(&configured(FILE), |_| {});
    outcome.unwrap();
    let drive = world.drive();
    assert_eq!((drive.number(0x609A, 0), drive.number(0x2380, 1)), (1500, 0x1234));
    let writes: Vec<String> =
        drive.writes.iter().map(|(object, bytes)| format!("{object} {bytes:02X?}")).collect();
    let own = writes.iter().position(|write| write.starts_with("1005:00")).unwrap();
    let expected = [
        "1800:01 [82, 01, 00, 80]",
        "1A00:00 [00]",
        "1A00:01 [20, 00, 64, 60]",
        "1A00:00 [01]",
        "1800:01 [82, 01, 00, 00]",
        "2380:01 [34, 12]",
        "609A:00 [DC, 05, 00, 00]",
    ];
    assert_eq!(writes[own - expected.len()..own], expected);
    assert_eq!(drive.number(0x1A00, 1), 0x6041_0010, "the controller maps what it needs");
    assert!(
        !writes.iter().any(|write| write == "6040:00 [0F, 00]"),
        "a controlword of a file enables nothing"
    );
}

#[test]
fn a_concise_dcf_is_written_unchanged() {
    let list = [
        Download { object: at(0x2380, 1), data: vec![7, 0] },
        Download { object: at(0x609A, 0), data: vec![1, 0, 0, 0] },
        Download { object: at(0x2380, 1), data: vec![8, 0] },
    ];
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), dcf::encode_concise(&list)).unwrap();
    let mut config = config(&[(0, 2)]);
    let configuration = DeviceConfiguration::load(file.path(), 2).unwrap();
    assert_eq!(configuration.downloads, list);
    config.axes[0].dcf = Some(configuration);
    let (mut world, outcome) = run(&config, |_| {});
    outcome.unwrap();
    assert_eq!((world.drive().number(0x2380, 1), world.drive().number(0x609A, 0)), (8, 1));
}

#[test]
fn a_value_that_is_acknowledged_but_not_kept_is_reported() {
    let (_, outcome) = run(&configured(FILE), |drive| {
        drive.flaws.not_stored.insert(at(0x609A, 0));
    });
    let message = outcome.unwrap_err().to_string();
    for part in ["configuration file", "609A:00", "0x000005DC", "got 0x00000000", "`dcf`"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn a_value_that_is_refused_is_reported() {
    let (_, outcome) = run(&configured(FILE), |drive| {
        drive.flaws.refused.insert(at(0x609A, 0), AbortCode::ValueTooHigh);
    });
    let message = outcome.unwrap_err().to_string();
    for part in ["writing 0x000005DC to 609A:00", "expected it to be accepted"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn the_simulated_erob_accepts_its_own_eds_as_a_configuration() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/eds/erob-canopen.eds");
    let text = std::fs::read_to_string(path).unwrap();
    // Every default is configured, as in a DCF that a manufacturer's tool exports.
    let file: String = text
        .lines()
        .map(|line| match line.strip_prefix("DefaultValue=").filter(|value| !value.is_empty()) {
            Some(value) => format!("{line}\nParameterValue={value}\n"),
            None => format!("{line}\n"),
        })
        .collect();
    let dictionary = eds::parse("erob.dcf", file.as_bytes()).unwrap().dictionary;
    let configuration = DeviceConfiguration::of(Path::new("erob.dcf"), &dictionary, 2);
    assert!(configuration.downloads.len() > 60, "{}", configuration.downloads.len());
    let mut config = config(&[(0, 2)]);
    config.axes[0].dcf = Some(configuration);
    let mut bus = takt::simulated_bus(&config, 0);
    let mut bring_up = BringUp::new(&config);
    let mut batch = ReceiveBatch::new();
    for now_ns in (0..20_000_000_000).step_by(1_000_000) {
        bring_up.poll(now_ns, &mut |_, frame| {
            bus.send(now_ns, &[frame]);
        });
        bus.receive(now_ns + 1_000_000, &mut batch);
        for received in batch.drain(..) {
            bring_up.receive(0, &received.frame);
        }
        if let Some(outcome) = bring_up.outcome() {
            outcome.unwrap();
            return;
        }
    }
    panic!("no end after 20 s");
}
