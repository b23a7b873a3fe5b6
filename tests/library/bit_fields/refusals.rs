//! Configurations and descriptions that are wrong, and what is said of them.

use proptest::prelude::*;
use takt::Config;
use takt::config::bit_fields;
use takt_wire::bit_fields::{FieldDevice, Setting, Settings};

use crate::bit_fields::machine::{HOLLOW, HOLLOW_FD, MIT, problems, text};

fn hollow(more: &str) -> String {
    format!("{HOLLOW}{more}")
}

fn two(first: &str, second: &str) -> String {
    text("1 ms", "", &[hollow(first), hollow(second)])
}

#[track_caller]
fn assert_says(text: &str, words: &[&str]) {
    let problems = problems(text);
    for word in words {
        assert!(problems.contains(word), "{word:?} is not in:\n{problems}");
    }
}

#[test]
fn two_motors_with_one_reply_identifier_are_refused_and_both_are_named() {
    let text = two("master_id = 0x64\n", "master_id = 0x64\n");
    assert_says(&text, &["master_id", "0x064", "`joint1`", "destroy each other's frames"]);
    Config::parse("right.toml", &two("master_id = 0x64\n", "master_id = 0x65\n")).unwrap();
}

#[test]
fn two_motors_with_one_motor_id_are_refused() {
    assert_says(&two("node = 3\nmaster_id = 0x64\n", "node = 3\nmaster_id = 0x65\n"), &["node"]);
}

#[test]
fn identifiers_of_nmt_and_of_other_drives_are_refused() {
    for (first, second, words) in [
        ("master_id = 0x80\n", "master_id = 0x65\n", ["0x080", "SYNC"]),
        ("master_id = 0x77F\n", "master_id = 0x65\n", ["0x77F", "the heartbeat of the controller"]),
        // The commands to the second motor.
        ("master_id = 2\n", "master_id = 0x65\n", ["0x002", "`joint1`"]),
        ("master_id = 1\n", "master_id = 0x65\n", ["0x001", "by which the commands to the motor are sent"]),
    ] {
        assert_says(&two(first, second), &words);
    }
    // Where no CANopen is on the bus, a motor may reply by the identifier of NMT.
    Config::parse("right.toml", &two("master_id = 0\n", "master_id = 0x65\n")).unwrap();
    let erob = "drive = \"erob-canopen\"\nnode = 5\n".to_owned();
    let by_nmt = format!("{HOLLOW}node = 1\nmaster_id = 0\n");
    assert_says(&text("1 ms", "", &[by_nmt.clone(), erob.clone()]), &["axis.bus", "0x000", "NMT"]);
    assert_says(&text("1 ms", "", &[erob.clone(), by_nmt]), &["master_id", "0x000", "NMT"]);
    let text = text("1 ms", "", &[erob, hollow("master_id = 0x185\nnode = 2\n")]);
    assert_says(&text, &["0x185", "`joint1`"]);
    // Node 12 of ODrive sends its heartbeat by the identifier of the feedback of node 1.
    let odrive =
        |node| format!("drive = \"bit-fields\"\ndescription = \"odrive-can-simple\"\nnode = {node}\n");
    let erob = "drive = \"erob-canopen\"\nnode = 1\n".to_owned();
    let beside = |node| self::text("1 ms", "", &[erob.clone(), odrive(node)]);
    assert_says(&beside(12), &["0x181", "`joint1`"]);
    Config::parse("beside.toml", &beside(13)).unwrap();
}

#[test]
fn motor_ids_beyond_those_of_the_make_are_refused() {
    for node in [100, 126] {
        assert_says(&two(&format!("node = {node}\nmaster_id = 0x64\n"), "master_id = 0x65\n"), &["1 to 99"]);
    }
}

#[test]
fn scales_that_differ_from_motor_to_motor_have_no_default() {
    let text = text("1 ms", "", &["drive = \"hollow-can\"\n".to_owned()]);
    assert_says(&text, &["`axis.master_id` is missing"]);
    let text = self::text("1 ms", "", &["drive = \"hollow-can\"\nmaster_id = 0x64\n".to_owned()]);
    for key in ["position_full_scale", "velocity_full_scale", "current_full_scale", "torque_constant"] {
        assert_says(&text, &[&format!("`axis.{key}` is missing")]);
    }
    let fd = self::text(
        "1 ms",
        "data_bit_rate = \"5 Mbit/s\"",
        &["drive = \"hollow-can-fd\"\nmaster_id = 0x64\n".to_owned()],
    );
    assert_says(&fd, &["`axis.pole_pairs` is missing", "`axis.torque_constant` is missing"]);
}

#[test]
fn a_motor_that_follows_positions_needs_gains_that_its_frames_can_carry() {
    let without = hollow("master_id = 0x64\n").replace("kp = 2000\n", "");
    assert_says(&text("1 ms", "", std::slice::from_ref(&without)), &["`axis.kp` is missing"]);
    Config::parse("cst.toml", &text("1 ms", "", &[format!("{without}mode = \"cst\"\n")])).unwrap();
    let stiff = hollow("master_id = 0x64\n").replace("kp = 2000", "kp = 5000");
    assert_says(&text("1 ms", "", &[stiff]), &["5000", "0 to 4095"]);
}

#[test]
fn a_joint_that_turns_further_than_its_frames_can_tell_is_refused() {
    let limits = "limits = { position = [-6, 8], velocity = 2, acceleration = 10, jerk = 200, torque = 3 }\n";
    let wide = hollow(&format!("master_id = 0x64\n{limits}"));
    assert_says(
        &text("1 ms", "", std::slice::from_ref(&wide)),
        &["positions that the frames of the drive can carry"],
    );
    Config::parse("extended.toml", &text("1 ms", "", &[format!("extended = true\n{wide}")])).unwrap();
}

#[test]
fn a_motor_of_can_fd_needs_a_bus_for_its_frames() {
    let keys = format!("{HOLLOW_FD}master_id = 0x64\n");
    assert_says(&text("1 ms", "", &[keys]), &["`data_bit_rate`"]);
}

#[test]
fn keys_of_another_drive_mean_nothing() {
    assert_says(
        &two("master_id = 0x64\npole_pairs = 3\n", "master_id = 0x65\n"),
        &["pole_pairs", "means nothing"],
    );
    let counts = two("master_id = 0x64\ncounts_per_turn = 4096\n", "master_id = 0x65\n");
    assert_says(&counts, &["counts_per_turn", "32768"]);
    let extended = hollow("extended = true\nmaster_id = 0x64\ncounts_per_turn = 2097152\n");
    assert_says(&text("1 ms", "", &[extended]), &["counts_per_turn", "1048576", "more turns can be counted"]);
}

#[test]
fn a_description_that_is_not_there_is_refused_with_those_that_are() {
    let text = text("2 ms", "", &[format!("{MIT}master_id = 0x11\ndescription = \"damiao\"\n")]);
    assert_says(&text, &["\"damiao\"", "damiao-dm-mit", "odrive-can-simple"]);
}

/// The description of a make with one thing changed.
fn changed(from: &str, to: &str) -> String {
    let text = include_str!("../../../drives/bit-fields/damiao-dm-mit.toml");
    assert!(text.contains(from), "{from}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("changed.toml");
    std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
    let keys = format!("{MIT}master_id = 0x11\ndescription = {:?}\n", path.display().to_string());
    match Config::parse("machine.toml", &crate::bit_fields::machine::text("2 ms", "", &[keys])) {
        Ok(_) => String::new(),
        Err(error) => format!("{error:?}"),
    }
}

#[test]
fn a_description_is_read_strictly_and_its_problems_are_named() {
    assert_eq!(changed("watchdog = false", "watchdog = true"), "");
    for (from, to, word) in [
        ("motor_ids", "motor_idz", "motor_ids"),
        ("bits = [16, 12]", "bits = [15, 12]", "have a bit in common"),
        ("bits = [52, 12]", "bits = [56, 12]", "ends at bit 68"),
        ("value = \"stiffness\"", "value = \"stiffnes\"", "stiffness"),
        ("unit = \"Nm/rad\"", "unit = \"N\"", "Nm/rad"),
        ("id = \"motor\"", "id = \"moter\"", "a sum of"),
        ("0xFF, 0xFC]", "0xFC]", "eight bytes"),
        ("reply_delay = \"300 us\"", "", "reply_delay"),
        ("beside_target = \"feed-forward\"", "", "beside_target"),
        ("are = 500", "are = 0", "codes"),
        ("order = \"big-endian\"", "order = \"big\"", "big-endian"),
        ("by = \"frames\"", "by = \"magic\"", "fields"),
    ] {
        let problems = changed(from, to);
        assert!(!problems.is_empty() && (problems.contains(word) || word == "codes"), "{to}: {problems}");
    }
}

#[test]
fn what_is_said_of_how_a_drive_is_found_is_read_strictly_too() {
    let known = "by = \"registers\"\nname = \"Damiao registers\"\nmode_is = 1\n";
    assert_eq!(changed(known, REGISTERS), "");
    let changed = |from: &str, to: &str| changed(known, &REGISTERS.replacen(from, to, 1));
    assert_eq!(changed("firmware = 14\n", ""), "");
    for (from, to, word) in [
        ("by = \"registers\"", "by = \"magic\"", "heartbeat"),
        ("by = \"registers\"", "by = \"heartbeat\"", "identifiers"),
        ("mode_is = 1", "", "mode_is"),
        ("master_id = 7", "master_id = 256", "255"),
        ("0x33, \"register\", 0, 0, 0, 0]", "0x33, 7, 0, 0, 0, 0]", "a frame that reads"),
        ("0x33, \"register\", 0, 0, 0, 0]", "0x33, \"register\", 0, 0, 0]", "eight bytes"),
        ("\"value\", \"value\"]", "\"value\", 0]", "four times"),
        ("settings = {", "settingz = {", "settings"),
    ] {
        assert!(REGISTERS.contains(from), "{from}");
        let problems = changed(from, to);
        assert!(problems.contains(word), "{to}: {problems}");
    }
}

/// How drives with registers are found that takt does not know.
const REGISTERS: &str = r#"by = "registers"
name = "Acme registers"
request = { id = "0x7FF", bytes = ["motor", 0, 0x33, "register", 0, 0, 0, 0] }
reply = { id = "master", bytes = ["motor", 0, 0x33, "register", "value", "value", "value", "value"] }
master_id = 7
mode = 10
mode_is = 1
firmware = 14
settings = { position_full_scale = 21, velocity_full_scale = 22, torque_full_scale = 23 }
"#;

/// Descriptions that are right.
const RIGHT: [&str; 5] = [
    include_str!("../../../drives/bit-fields/damiao-dm-mit.toml"),
    include_str!("../../../drives/bit-fields/odrive-can-simple.toml"),
    include_str!("../../../drives/bit-fields/t-motor-ak-mit.toml"),
    include_str!("../../../src/family/hollow/can_extended.toml"),
    include_str!("../../../src/family/hollow/can_fd.toml"),
];

proptest! {
    /// Words of one description stand in the place of words of another one.
    #[test]
    fn whatever_a_description_says_it_is_refused_or_can_be_compiled(
        which in 0..RIGHT.len(),
        from in 0..RIGHT.len(),
        swaps in prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>()), 1..4),
    ) {
        let others: Vec<&str> = RIGHT[from].split_whitespace().collect();
        let mut words: Vec<&str> = RIGHT[which].split_inclusive(' ').collect();
        for (place, word) in swaps {
            let place = place.index(words.len());
            words[place] = others[word.index(others.len())];
        }
        if let Ok(description) = bit_fields::parse("swapped.toml", &words.concat()) {
            let mut settings = Settings::default();
            Setting::ALL.into_iter().for_each(|(_, setting)| settings.set(setting, 2.0));
            settings.master_id = Some(0x65);
            let device = FieldDevice { description, settings };
            prop_assert!(bit_fields::check_command(&device).is_ok());
            prop_assert!(bit_fields::check_reply(&device).is_ok());
            for motor in device.description.motor_ids.clone() {
                device.request_ids(motor);
                device.setup(motor);
            }
        }
    }
}
