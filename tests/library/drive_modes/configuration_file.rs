//! A DCF or concise DCF written to simulated drives at bring-up, and read back.

use std::path::Path;

use takt::Outcome;
use takt::config::Config;
use takt_wire::canopen::dcf::{self, DeviceConfiguration, Download};
use takt_wire::canopen::eds;
use takt_wire::canopen::object::ObjectAddress;

use crate::drive_modes::one_yz_aim::one_yz_aim;
use crate::drive_modes::wire::id;
use crate::drive_modes::world::{World, load, parse};

/// A YZ-AIM that interpolates and moves a little.
fn yz_aim() -> Config {
    parse(&one_yz_aim("ip", "to = \"20 mm\""))
}

fn with_file(file: &str) -> Config {
    let mut config = yz_aim();
    let dictionary = eds::parse("servo.dcf", file.as_bytes()).unwrap().dictionary;
    config.axes[0].dcf = Some(DeviceConfiguration::of(Path::new("servo.dcf"), &dictionary, 1));
    config
}

fn entry(object: &str, data_type: u8, value: &str) -> String {
    format!(
        "[{object}]\nParameterName=p\nObjectType=7\nDataType={data_type}\nAccessType=rw\nParameterValue={value}\n"
    )
}

/// The frames to or from the drive's SDO server that begin so.
fn said(world: &mut World, first: &[u8]) -> usize {
    let port = world.port(0);
    let asked =
        port.sent.iter().map(|(_, frame, _)| frame).filter(|frame| frame.id().value() == id(0x600, 1));
    let answered =
        port.received.iter().map(|(_, frame)| frame).filter(|frame| frame.id().value() == id(0x580, 1));
    asked.chain(answered).filter(|frame| frame.payload().starts_with(first)).count()
}

fn refusal(config: Config) -> (World, String) {
    let mut world = World::new(config);
    let outcome = world.run_to_the_end(|_| {});
    let Outcome::BringUpFailed(error) = outcome else { panic!("{outcome:?}") };
    (world, error.to_string())
}

#[test]
fn a_yz_aim_is_given_the_values_of_its_file_which_are_read_back_before_it_moves() {
    let file = entry("60FBsub1", 6, "2000") + &entry("60F9sub2", 6, "0x1F4");
    let mut world = World::new(with_file(&file));
    assert_eq!(world.run_to_the_end(|_| {}), Outcome::Finished, "{:?}", world.stops());
    for (written, read) in [
        ([0x2B, 0xFB, 0x60, 1, 0xD0, 0x07], [0x4B, 0xFB, 0x60, 1, 0xD0, 0x07]),
        ([0x2B, 0xF9, 0x60, 2, 0xF4, 0x01], [0x4B, 0xF9, 0x60, 2, 0xF4, 0x01]),
    ] {
        assert_eq!((said(&mut world, &written), said(&mut world, &read)), (1, 1), "{written:02X?}");
    }
    assert!((world.observe(0).position - 0.02).abs() < 1e-4, "{}", world.observe(0).position);
}

#[test]
fn a_yz_aim_takes_a_concise_dcf_as_well() {
    let gain = Download { object: ObjectAddress::new(0x60FB, 1), data: vec![0xB8, 0x0B] };
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), dcf::encode_concise(std::slice::from_ref(&gain))).unwrap();
    let mut config = yz_aim();
    config.axes[0].dcf = Some(DeviceConfiguration::load(file.path(), 1).unwrap());
    let mut world = World::new(config);
    assert_eq!(world.run_to_the_end(|_| {}), Outcome::Finished, "{:?}", world.stops());
    assert_eq!(said(&mut world, &[0x4B, 0xFB, 0x60, 1, 0xB8, 0x0B]), 1);
}

#[test]
fn an_object_that_a_yz_aim_does_not_have_is_named_with_the_node_and_the_silence() {
    let (mut world, text) = refusal(with_file(&entry("6084", 7, "1500")));
    for part in [
        "axis `x` (node 1 on bus `can`), configuration file",
        "writing 0x000005DC to 6084:00",
        "no reply within",
        "this drive does not answer at all for an object that it does not have",
        "`dcf`",
    ] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
    assert_eq!(said(&mut world, &[0x80, 0x84, 0x60]), 0, "silence, no abort");
    assert!(world.port(0).sent_with(id(0x500, 1)).is_empty(), "no target");
}

#[test]
fn a_value_that_a_yz_aim_refuses_is_named_with_its_reason() {
    let (_, text) = refusal(with_file(&entry("60FBsub1", 6, "7")));
    for part in ["writing 0x0007 to 60FB:01", "abort", "node 1"] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
}

#[test]
fn the_file_wins_over_the_settings_of_bring_up_and_what_is_overwritten_is_said() {
    let mut config = parse(include_str!("../../../configs/single-erob.toml"));
    let node = config.axes[0].node;
    // A quick-stop deceleration, and two heartbeat times: the own one is what the controller writes, too.
    let file = entry("6085", 7, "123456") + &entry("1016sub1", 7, "0x007F03E8") + &entry("1017", 6, "0");
    let dictionary = eds::parse("joint.dcf", file.as_bytes()).unwrap().dictionary;
    config.axes[0].dcf = Some(DeviceConfiguration::of(Path::new("joint.dcf"), &dictionary, node));
    let words: Vec<String> = config.warnings().iter().map(ToString::to_string).collect();
    let [warning] = &words[..] else { panic!("{words:?}") };
    assert!(warning.contains("overwrites the value that `dcf` has for 1016:01"), "{warning}");
    let mut world = World::new(config);
    assert_eq!(world.run_to_the_end(|_| {}), Outcome::Finished, "{:?}", world.stops());
    let sent = world.port(0).sent.iter().map(|(_, frame, _)| frame);
    let to_drive = sent.filter(|frame| frame.id().value() == id(0x600, node));
    let written: Vec<_> =
        to_drive.filter(|frame| frame.payload().starts_with(&[0x23, 0x85, 0x60, 0])).collect();
    assert_eq!(written.len(), 1, "{written:?}");
    assert_eq!(written[0].payload()[4..], 123_456_u32.to_le_bytes());
}

#[test]
fn a_file_by_which_a_drive_brakes_less_than_planned_is_refused_with_object_and_value() {
    for object in ["60C6", "6084"] {
        let mut config = load("erob-modes/erob-pv.toml");
        let dictionary = eds::parse("servo.dcf", entry(object, 7, "20000").as_bytes()).unwrap().dictionary;
        config.axes[0].dcf = Some(DeviceConfiguration::of(Path::new("servo.dcf"), &dictionary, 1));
        let (_, text) = refusal(config);
        for part in ["planner of the drive", object, "20000", "at least"] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}
