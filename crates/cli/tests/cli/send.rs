//! `takt send` as a user meets it: simulated drives behind an adapter, and an adapter that the test plays.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use serde_json::Value;
use takt::sim::pseudo_terminal::PseudoTerminal;

use crate::printed::{ends_with, errors, said};
use crate::simulated::Simulated;

fn takt(subcommand: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    command.arg(subcommand).current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null());
    command.env_remove("COLUMNS").env_remove("NO_COLOR");
    command
}

fn send(arguments: &[&str]) -> Output {
    takt("send").args(arguments).output().unwrap()
}

/// Drives behind an adapter, and that adapter.
fn simulated() -> (Simulated, String) {
    let simulated = Simulated::new(&["tests/monitor/canopen.toml"]);
    let interface = format!("slcan:{}", simulated.path.display());
    (simulated, interface)
}

#[test]
fn a_frame_is_sent_and_what_comes_back_is_shown_with_its_meaning() {
    let (_simulated, interface) = simulated();
    // The drive is read: its device type.
    let read = ["601#40.0010.00.00000000", "--bus", &interface, "--wait", "0.5"];
    let output = send(&read);
    ends_with(0, &output);
    let text = said(&output);
    assert!(
        text.contains("> 601#4000100000000000  SDO request node 1: read 1000:00 (device type)"),
        "{text}"
    );
    assert!(text.contains("SDO response node 1: 1000:00 (device type) is 0x00420192"), "{text}");
    let output =
        takt("send").args(read).args(["--json", "--config", "tests/monitor/canopen.toml"]).output().unwrap();
    ends_with(0, &output);
    let objects: Vec<Value> = said(&output).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!((&objects[0]["direction"], &objects[0]["axis"]), (&"sent".into(), &"joint".into()));
    assert!(
        objects.iter().any(|object| object["direction"] == "received" && object["service"] == "SDO response")
    );
}

#[test]
fn a_frame_is_sent_as_often_as_it_is_wanted() {
    let (_simulated, interface) = simulated();
    let output = send(&["701#R", "080#", "--bus", &interface, "--count", "3", "--period", "5 ms"]);
    ends_with(0, &output);
    let sent: Vec<String> =
        said(&output).lines().filter(|line| line.contains('>')).map(str::to_owned).collect();
    assert_eq!(sent.len(), 6, "{sent:?}");
    assert!(sent[0].contains("701#R0") && sent[1].ends_with("SYNC"), "{sent:?}");
}

#[test]
fn nothing_is_sent_where_a_running_takt_is_the_master() {
    let (_simulated, interface) = simulated();
    let mut watch = takt("drive")
        .args(["--bus", &interface, "--node", "1", "--family", "erob-canopen", "watch"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(watch.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
    let output = send(&["000#0101", "--bus", &interface]);
    watch.kill().unwrap();
    watch.wait().unwrap();
    ends_with(2, &output);
    let words = errors(&output);
    assert!(words.contains("has a master already") && words.contains("Nothing was sent"), "{words}");
    assert!(words.contains("or add --force") && output.stdout.is_empty(), "{words}");
}

/// Sends on an adapter on which these lines are heard all the time. Returns what the adapter was sent, too.
fn beside(lines: &[u8], arguments: &[&str]) -> (Output, String) {
    let mut line = PseudoTerminal::open().unwrap();
    let interface = format!("slcan:{}", line.path().display());
    let mut child = takt("send")
        .args(["--bus", &interface])
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut sent = String::new();
    loop {
        let has_ended = child.try_wait().unwrap().is_some();
        let mut bytes = [0; 256];
        while let Ok(count @ 1..) = line.read(&mut bytes) {
            sent.push_str(std::str::from_utf8(&bytes[..count]).unwrap());
        }
        if has_ended {
            return (child.wait_with_output().unwrap(), sent);
        }
        // Nobody may read it yet, or any more.
        let _ = line.write(lines);
        thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn nothing_is_sent_where_another_master_is_heard_or_a_drive_has_torque_unless_it_is_forced() {
    for (heard, words) in [
        (&b"t0800\r"[..], "another master is active"),
        (b"t20561F0000000000\r", "set-points for node 5"),
        // Feedback of a drive that is enabled: its statusword is 1637.
        (b"t18523716\r", "node 5 has torque"),
    ] {
        let (output, sent) = beside(heard, &["605#4041600000000000"]);
        ends_with(2, &output);
        assert!(
            errors(&output).contains(words) && errors(&output).contains("--force"),
            "{}",
            errors(&output)
        );
        assert!(!sent.contains("t605"), "{sent:?}");
    }
    let (output, sent) = beside(b"t18523716\r", &["605#4041600000000000", "--force"]);
    ends_with(0, &output);
    assert!(sent.contains("t60584041600000000000\r"), "{sent:?}");
}

#[test]
fn what_the_drives_are_is_known_from_a_configuration() {
    // Statusword 1250: switch on disabled is no torque, 1637 is.
    let known = ["--config", "tests/monitor/canopen.toml", "601#4041600000000000"];
    let (output, sent) = beside(b"t181750120000000008\r", &known);
    ends_with(0, &output);
    assert!(sent.contains("t60184041600000000000\r"), "{sent:?}");
    let (output, _) = beside(b"t181737160000000008\r", &known);
    ends_with(2, &output);
    assert!(errors(&output).contains("joint has torque"), "{}", errors(&output));
}

#[test]
fn frames_of_every_kind_leave_as_they_are_written() {
    let (output, sent) = beside(
        b"",
        &["00000123#DE.AD", "701#R4", "123##1000102030405060708090A0B", "--data-bit-rate", "5 Mbit/s"],
    );
    ends_with(0, &output);
    for line in ["T000001232DEAD\r", "r7014\r", "b1239000102030405060708090A0B\r"] {
        assert!(sent.contains(line), "{sent:?}");
    }
}

#[test]
fn a_wrong_text_is_pointed_at_and_a_wrong_bus_is_named() {
    let refused = |arguments: &[&str]| {
        let output = send(arguments);
        ends_with(2, &output);
        assert!(output.stdout.is_empty());
        errors(&output)
    };
    let words = refused(&["123#DEADBEE", "--bus", "can0"]);
    assert!(
        words.contains("the last byte has one digit instead of two\n  123#DEADBEE\n             ^"),
        "{words}"
    );
    assert!(refused(&["12#00", "--bus", "can0"]).contains("the identifier has 2 digits"));
    assert!(refused(&["123#00", "--bus", "sim"]).contains("a simulated bus is within the process"));
    assert!(refused(&["123#00", "--bus", "takt-none"]).contains("there is no interface takt-none"));
    let words = refused(&["123#00", "--bus", "arm", "--config", "../../configs/mixed-arm.toml"]);
    assert!(words.contains("a simulated bus is within the process"), "{words}");
    let words = refused(&["123#00", "--bus", "can0", "--config", "../../configs/mixed-arm.toml"]);
    assert!(words.contains("NAME=can0; they are: arm, wrist"), "{words}");
    let words = refused(&["123##1DEAD", "--bus", "slcan:/dev/takt-none"]);
    assert!(words.contains("--data-bit-rate"), "{words}");
    assert!(refused(&["123#00", "--bus", "can0", "--period", "5"]).contains("write it as \"10 ms\""));
}
