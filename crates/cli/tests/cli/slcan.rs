//! A bus behind an SLCAN adapter: `takt sim --pty` in one process, its master in another one, in wall-clock time.

use std::fs::OpenOptions;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use serde_json::Value;
use tempfile::TempDir;

use crate::simulated::Simulated;

/// A joint that is moved slowly, by a controller that bears late cycles: the machine that tests run on is busy.
const SLOW_JOINT: &str = r#"
name = "slow"
[cycle]
period = "20 ms"
[cycle.missed_slots]
stop = 100000
[master]
heartbeat_timeout = "30 s"
[[bus]]
name = "can"
[[axis]]
name = "joint"
bus = "can"
node = 1
drive = "erob-canopen"
missed_feedback_cycles = 1000
limits = { position = ["-170 deg", "170 deg"], velocity = "90 deg/s", acceleration = "360 deg/s^2", torque = "31 Nm" }
[[program.move]]
to = "20 deg"
"#;

/// The slow joint behind an adapter.
struct SlowJoint {
    simulated: Simulated,
    folder: TempDir,
}

impl SlowJoint {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let config = folder.path().join("config.toml");
        std::fs::write(&config, SLOW_JOINT).unwrap();
        Self { simulated: Simulated::new(&[config.to_str().unwrap()]), folder }
    }

    fn config(&self) -> PathBuf {
        self.folder.path().join("config.toml")
    }

    fn adapter(&self) -> &Path {
        &self.simulated.path
    }

    /// `slcan:` and the path of the adapter.
    fn interface(&self) -> String {
        format!("slcan:{}", self.adapter().display())
    }
}

fn takt() -> Command {
    Command::new(env!("CARGO_BIN_EXE_takt"))
}

fn words(output: &Output) -> String {
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    format!("{out}\n{err}")
}

#[test]
fn an_arm_behind_an_adapter_is_moved_by_another_process_time_and_again() {
    let simulated = SlowJoint::new();
    for _ in 0..2 {
        let bus = format!("can={}", simulated.interface());
        let run = takt().arg("run").arg(simulated.config()).args(["--bus", &bus, "--json"]).output().unwrap();
        assert_eq!(run.status.code(), Some(0), "{}", words(&run));
        let report: Value = serde_json::from_slice(&run.stdout).unwrap();
        assert_eq!(report["stop"], Value::Null, "{report}");
        let position = report["axes"][0]["final_position"].as_f64().unwrap();
        assert!((position - 20f64.to_radians()).abs() < 1e-3, "{report}");
        let counted = &report["buses"][0];
        assert!(counted["tx_frames"].as_u64().unwrap() > 50 && counted["rx_frames"].as_u64().unwrap() > 50);
        assert_eq!(counted["errors"], 0, "{counted}");
        assert!(words(&run).contains("USB is not hard real time"), "{}", words(&run));
    }
}

#[test]
fn a_drive_behind_an_adapter_is_read_without_a_configuration() {
    let simulated = SlowJoint::new();
    let read = takt()
        .args(["drive", "--bus", &simulated.interface(), "--node", "1", "--family", "erob-canopen", "read"])
        .arg("1000")
        .output()
        .unwrap();
    assert_eq!(read.status.code(), Some(0), "{}", words(&read));
    // Device type: CiA 402.
    assert!(words(&read).contains("0x00420192"), "{}", words(&read));
}

#[test]
fn whoever_opens_the_line_may_talk_to_the_drives_by_hand() {
    let simulated = SlowJoint::new();
    let mut line = OpenOptions::new().read(true).write(true).open(simulated.adapter()).unwrap();
    line.write_all(b"C\rS8\rO\r").unwrap();
    // An SDO read of 1000 sub 0: the answer comes once the drive has booted. The adapter answers each line, so a reading ends.
    let mut heard = String::new();
    for _ in 0..200 {
        line.write_all(b"t60184000100000000000\r").unwrap();
        thread::sleep(Duration::from_millis(50));
        let mut bytes = [0; 1_024];
        let count = line.read(&mut bytes).unwrap();
        heard.push_str(std::str::from_utf8(&bytes[..count]).unwrap());
        if heard.contains("t58184300100092014200\r") {
            return;
        }
    }
    panic!("no answer of the drive: {heard:?}");
}

#[test]
fn the_jitter_of_sync_is_measured_behind_an_adapter() {
    let simulated = SlowJoint::new();
    let measured = takt()
        .args(["jitter", "--cycles", "200", "--json", "--bus", &simulated.interface()])
        .output()
        .unwrap();
    assert_eq!(measured.status.code(), Some(0), "{}", words(&measured));
    let report: Value = serde_json::from_slice(&measured.stdout).unwrap();
    for pass in report["passes"].as_array().unwrap() {
        // Where the computer is too late for a slot, its SYNC is left out.
        let of_slots = pass["sync_sent"].as_u64().unwrap() + pass["missed_slots"].as_u64().unwrap();
        assert!(of_slots >= 200 && pass["bus_errors"] == 0, "{report}");
    }
}

#[test]
fn one_master_at_a_time_may_use_an_adapter() {
    let simulated = SlowJoint::new();
    let read = |bus: &str| {
        let options = ["--node", "1", "--family", "erob-canopen", "read", "1000"];
        takt().args(["drive", "--bus", bus]).args(options).output().unwrap()
    };
    let bus = format!("can={}", simulated.interface());
    let start = || {
        let mut run = takt();
        run.arg("run").arg(simulated.config()).args(["--bus", &bus, "--duration", "600"]);
        run.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    };
    let mut running = start();
    // The other path of the same device leads to the same lock.
    let device = format!("slcan:{}", std::fs::canonicalize(simulated.adapter()).unwrap().display());
    let mut refused = String::new();
    for _ in 0..60 {
        // The run may have found the reading below to be the master.
        if running.try_wait().unwrap().is_some() {
            running = start();
        }
        thread::sleep(Duration::from_millis(300));
        let output = read(&device);
        if !output.status.success() {
            refused = words(&output);
            break;
        }
    }
    running.kill().unwrap();
    running.wait().unwrap();
    assert!(refused.contains("has a master already"), "{refused}");
}

#[test]
fn what_is_no_adapter_is_named_with_the_cure_by_every_tool() {
    let tools: [fn(&mut Command, &str); 5] = [
        |takt, interface| {
            takt.args(["run", "../../configs/first.toml", "--bus", &format!("can={interface}")]);
        },
        |takt, interface| {
            takt.args([
                "drive",
                "--bus",
                interface,
                "--node",
                "1",
                "--family",
                "erob-canopen",
                "read",
                "1000",
            ]);
        },
        |takt, interface| {
            takt.args(["lss", "--bus", interface, "--only", "inquire"]);
        },
        |takt, interface| {
            takt.args(["jitter", "--cycles", "1", "--bus", interface]);
        },
        |takt, interface| {
            takt.args(["sim", "../../configs/first.toml", "--bus", &format!("can={interface}")]);
        },
    ];
    for tool in tools {
        for (interface, problem) in [
            ("slcan:/dev/takt-none", "there is no /dev/takt-none"),
            ("slcan:/dev/null", "/dev/null is no serial line"),
            ("slcan:ttyACM0", "\"ttyACM0\" cannot be the path of a serial line"),
            ("slcan:/dev/ttyACM0@1", "\"1\" cannot be the baud rate"),
        ] {
            let mut takt = takt();
            tool(&mut takt, interface);
            let output = takt.output().unwrap();
            assert_eq!(output.status.code(), Some(2), "{}", words(&output));
            assert!(words(&output).contains(problem), "{interface}: {}", words(&output));
        }
    }
}
