//! `takt lss` on simulated devices.

use std::process::{Command, Output, Stdio};

use serde_json::Value;

use crate::printed::{ends_with, errors, said};

const FIRST: &str = "0x331:1:0x100:0x1234";
const SECOND: &str = "0x331:1:0x100:0xFFFFFFFE";
const KNOWN: &str = "0x5A65726F:2:3:4@9";

fn lss(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    command.arg("lss").args(arguments).stdin(Stdio::null()).output().unwrap()
}

/// On a bus with two devices without a node ID and one that has one.
fn simulated(arguments: &[&str]) -> Output {
    let bus = ["--bus", "sim", "--simulate", FIRST, "--simulate", SECOND, "--simulate", KNOWN];
    lss(&[&bus, arguments].concat())
}

#[track_caller]
fn result(arguments: &[&str]) -> Value {
    let output = simulated(&[&["--json"], arguments].concat());
    ends_with(0, &output);
    let object: Value = serde_json::from_str(&said(&output)).unwrap();
    assert_eq!(object["ended"], "done");
    object["result"].clone()
}

#[test]
fn a_scan_finds_every_device_without_a_node_id_and_no_other() {
    let result = result(&["scan"]);
    let serials: Vec<u64> = result["devices"]
        .as_array()
        .unwrap()
        .iter()
        .map(|device| device["serial"].as_u64().unwrap())
        .collect();
    assert_eq!(serials, [0x1234, 0xFFFF_FFFE]);
    let output = simulated(&["scan"]);
    assert!(said(&output).contains("without a node ID  0x00000331:0x00000001:0x00000100:0x00001234"));
    assert!(said(&output).contains("2 devices"), "{}", said(&output));
}

#[test]
fn a_device_that_gets_a_node_id_boots_with_it() {
    let found = result(&["set-id", "5"]);
    assert_eq!(
        (&found["node"], &found["booted_node"], &found["is_stored"]),
        (&5.into(), &5.into(), &false.into())
    );
    assert_eq!(found["device"]["serial"], 0x1234, "the first that the scan finds");
    let named = result(&["--device", SECOND, "set-id", "7", "--store"]);
    assert_eq!((&named["booted_node"], &named["is_stored"]), (&7.into(), &true.into()));
    assert_eq!(named["device"]["serial"], 0xFFFF_FFFE_u32);
}

fn three_canopennode_devices(arguments: &[&str]) -> Output {
    let devices = ["0x331:1:0x100:0x1234", "0x331:1:0x101:0", "0x332:1:0:0xFFFFFFFF"];
    let devices = devices.map(|identity| format!("{identity},canopennode"));
    let simulated = devices.iter().flat_map(|device| ["--simulate", device.as_str()]);
    lss(&["--bus", "sim"].into_iter().chain(simulated).chain(arguments.iter().copied()).collect::<Vec<_>>())
}

#[test]
fn a_scan_finds_all_of_three_devices_that_answer_every_scan_request_in_configuration_state() {
    let output = three_canopennode_devices(&["scan"]);
    ends_with(0, &output);
    let text = said(&output);
    for identity in ["0x00000331:0x00000001:0x00000100:0x00001234", "0x00000101:0x00000000", "0xFFFFFFFF"] {
        assert!(text.contains(identity), "{identity}: {text}");
    }
    assert!(text.contains("3 devices") && !text.contains("note"), "{text}");
}

#[test]
fn a_scan_that_finds_an_identity_of_zeros_ends_with_a_remark() {
    let output = lss(&["--bus", "sim", "--simulate", "0:0:0:0", "--simulate", FIRST, "--json", "scan"]);
    ends_with(0, &output);
    let object: Value = serde_json::from_str(&said(&output)).unwrap();
    assert_eq!(object["result"]["devices"].as_array().map(Vec::len), Some(0));
    let remark = object["result"]["remark"].as_str().unwrap();
    assert!(remark.contains("identity of zeros"), "{remark}");
    let output = lss(&["--bus", "sim", "--simulate", "0:0:0:0", "set-id", "3"]);
    ends_with(1, &output);
    assert!(errors(&output).contains("identity of zeros"), "{}", errors(&output));
}

#[test]
fn two_devices_are_refused_where_only_one_was_meant() {
    for action in [&["set-id", "5"][..], &["set-bitrate", "500 kbit/s"], &["store"], &["inquire"]] {
        let output = simulated(&[&["--only"], action].concat());
        ends_with(1, &output);
        let words = errors(&output);
        assert!(
            words.contains("3 devices answered, though --only means one: nothing was changed"),
            "{words}"
        );
        assert!(words.contains("try: name the device by --device"), "{words}");
    }
    let output = simulated(&["--only", "--verbose", "set-id", "5"]);
    assert!(!errors(&output).contains("7E5#1105"), "no node ID was configured: {}", errors(&output));
}

#[test]
fn a_boot_up_that_does_not_come_is_said() {
    let device = format!("{FIRST},no-boot-up");
    let output = lss(&["--bus", "sim", "--simulate", &device, "set-id", "5"]);
    ends_with(0, &output);
    assert!(said(&output).contains("no boot-up message with this node ID"), "{}", said(&output));
    assert!(!said(&output).contains("booted "), "{}", said(&output));
}

#[test]
fn the_wait_of_a_scan_is_an_option() {
    let duration = |wait: &str| {
        let output = simulated(&["--verbose", "--scan-wait", wait, "scan"]);
        ends_with(0, &output);
        let last = errors(&output).lines().last().unwrap().trim().to_owned();
        last.split_whitespace().next().unwrap().parse::<f64>().unwrap()
    };
    let (short, long) = (duration("2 ms"), duration("100 ms"));
    assert!(long > 30.0 * short, "simulated time: {short} s and {long} s");
}

#[test]
fn a_device_that_had_a_node_id_keeps_it_until_it_is_reset_and_this_is_said() {
    let identity = KNOWN.split('@').next().unwrap();
    let output = simulated(&["--device", identity, "set-id", "12"]);
    ends_with(0, &output);
    assert!(said(&output).contains("keeps its old node ID until it is reset"), "{}", said(&output));
    assert!(!said(&output).contains("booted"), "{}", said(&output));
}

#[test]
fn a_device_reports_its_identity_and_node_id() {
    let identity = KNOWN.split('@').next().unwrap();
    let known = result(&["--device", identity, "inquire"]);
    assert_eq!((&known["device"]["vendor"], &known["node"]), (&0x5A65_726F_u32.into(), &9.into()));
    let found = result(&["inquire"]);
    assert_eq!((&found["device"]["serial"], &found["node"]), (&0x1234.into(), &Value::Null));
    let output = lss(&["--bus", "sim", "inquire", "--simulate", SECOND, "--only"]);
    ends_with(0, &output);
    assert!(said(&output).contains("0xFFFFFFFE"), "{}", said(&output));
}

#[test]
fn a_bit_rate_is_set_stored_and_activated_with_a_note_on_the_next_step() {
    let output = simulated(&[
        "--device",
        FIRST,
        "--verbose",
        "set-bitrate",
        "500 kbit/s",
        "--store",
        "--activate",
        "200",
    ]);
    ends_with(0, &output);
    for words in ["bit rate     500 kbit/s", "stored       yes", "change the interface as well", "wait"] {
        assert!(said(&output).contains(words), "{words}: {}", said(&output));
    }
    // Configured, stored, activated; no frame follows at the old bit rate.
    let sent: Vec<String> =
        errors(&output).lines().filter(|line| line.contains(" > ")).map(str::to_owned).collect();
    for (line, frame) in sent.iter().rev().zip(["7E5#15C800", "7E5#17", "7E5#130002"]) {
        assert!(line.contains(frame), "{frame}: {sent:?}");
    }
    ends_with(0, &simulated(&["wait"]));
    ends_with(0, &simulated(&["--device", FIRST, "store"]));
}

#[test]
fn who_is_not_there_is_told_with_what_to_try() {
    let output = simulated(&["--device", "1:2:3:4", "inquire"]);
    ends_with(1, &output);
    assert!(errors(&output).contains("inquire: no device answered within"), "{}", errors(&output));
    assert!(errors(&output).contains("try: check the identity"), "{}", errors(&output));
    let output = lss(&["--bus", "sim", "--simulate", KNOWN, "set-id", "5"]);
    ends_with(1, &output);
    assert!(errors(&output).contains("no device without a node "), "{}", errors(&output));
    let output = lss(&["--bus", "sim", "--simulate", KNOWN, "scan"]);
    ends_with(0, &output);
    assert!(said(&output).contains("no device without a node ID"), "{}", said(&output));
}

#[test]
fn bad_words_are_refused_before_anything_is_sent() {
    for (arguments, words) in [
        (vec!["--bus", "sim", "scan"], "add --simulate"),
        (vec!["--bus", "can0", "--simulate", FIRST, "scan"], "--bus sim"),
        (vec!["--bus", "takt-none", "scan"], "there is no interface takt-none"),
        (vec!["--bus", "sim", "--simulate", "1:2:3", "scan"], "VENDOR:PRODUCT:REVISION:SERIAL"),
        (vec!["--bus", "sim", "--simulate", FIRST, "set-id", "128"], "1 to 127, or none"),
        (vec!["--bus", "sim", "--simulate", FIRST, "set-bitrate", "400 kbit/s"], "LSS knows 10, 20, 50"),
        (
            vec!["--bus", "sim", "--simulate", FIRST, "--only", "--device", FIRST, "inquire"],
            "cannot be used with",
        ),
        (vec!["--bus", "sim", "--simulate", FIRST, "--scan-wait", "5 s", "scan"], "1 ms to 1 s"),
        (vec!["--bus", "sim", "--simulate", "1:2:3:4,quiet", "scan"], "canopennode, no-boot-up"),
        (vec!["scan"], "--bus"),
    ] {
        let output = lss(&arguments);
        ends_with(2, &output);
        assert!(errors(&output).contains(words), "{words}: {}", errors(&output));
        assert!(output.stdout.is_empty());
    }
}

#[test]
fn an_lss_device_needs_a_bus_with_a_real_interface_in_the_simulator_of_drives() {
    for (device, words) in [
        ("1:2:3:4", "--lss: the bus `can` has no real interface"),
        ("wrist=1:2:3:4@5,canopennode", "--lss: the bus `wrist` has no real interface"),
        ("1:2:3", "VENDOR:PRODUCT:REVISION:SERIAL"),
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
        let output =
            command.args(["sim", "../../configs/single-erob.toml", "--lss", device]).output().unwrap();
        ends_with(2, &output);
        assert!(errors(&output).contains(words), "{words}: {}", errors(&output));
    }
}
