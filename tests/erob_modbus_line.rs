//! Drives on a Modbus line of this machine: the master's threads, and a simulated drive behind a pseudo-terminal, in real time.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use takt::internals::family::erob_modbus::drive::{AccessError, ErobDrive};
use takt::internals::family::erob_modbus::motion::{self, End, Motion, MotionFailure, Profile};
use takt::internals::family::erob_modbus::registers;
use takt::internals::link::modbus_line::{LineThread, ModbusLine};
use takt::internals::link::serial_line::{SerialLineError, SerialSettings};
use takt::internals::modbus::exception::ExceptionCode;
use takt::internals::modbus::frame::{RegisterRange, RegisterValues, Request, SlaveAddress};
use takt::internals::modbus::line_timing::LineTiming;
use takt::internals::modbus::master::{Answer, Repeat, RequestFailure};
use takt::internals::procedure::{ModbusClient, ModbusSession, Procedure};
use takt::internals::sim::erob_modbus::{ErobModbusDrive, ErobModbusParameters, SimulatedLine};
use takt::internals::sim::pseudo_terminal::PseudoTerminal;
use takt::internals::sim::serial_line::host;
use takt::sim::plant::{Encoder, JointParameters};

const SLAVE: u8 = 2;
const SETTINGS: SerialSettings = SerialSettings::new(115_200);

fn drive(address: u8) -> ErobModbusDrive {
    let joint = JointParameters {
        inertia: 0.3,
        viscous_friction: 2.0,
        coulomb_friction: 4.0,
        friction_shape: takt::config::FrictionShape::Constant,
        brake_torque: 60.0,
    };
    ErobModbusDrive::new(ErobModbusParameters {
        address,
        bit_rate_code: 4,
        joint,
        encoder: Encoder { counts_per_unit: 524_288.0 / std::f64::consts::TAU, zero_counts: 0.0 },
        counts_per_turn: 524_288.0,
        initial_position: 0.0,
        peak_torque: 60.0,
        torque_per_ampere: 31.0 / 6.3,
        highest_velocity: 3.0,
        ready_ns: 0,
        reply_ns: 1_000_000,
        has_battery: true,
        has_torque_sensor: false,
    })
}

/// Ends what waits for it, even if a test fails.
struct Over<'a>(&'a AtomicBool);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Does something with the path of a line that has the drives 2 and 3.
fn with_a_line<T>(work: impl FnOnce(&Path) -> T) -> T {
    let mut terminal = PseudoTerminal::open().unwrap();
    let path = terminal.path().to_owned();
    let is_over = AtomicBool::new(false);
    thread::scope(|scope| {
        let hosting = scope.spawn(|| {
            let drives = vec![drive(SLAVE), drive(3)];
            let mut line = SimulatedLine::lenient(LineTiming::new(115_200), 20_000_000, drives);
            host(&mut line, &mut terminal, &is_over)
        });
        let over = Over(&is_over);
        let done = work(&path);
        drop(over);
        hosting.join().unwrap().unwrap();
        done
    })
}

fn slave(address: u8) -> SlaveAddress {
    SlaveAddress::new(address).unwrap()
}

#[test]
fn a_motion_is_carried_out_over_a_line_of_this_machine() {
    let ended = with_a_line(|path| {
        let mut line = ModbusLine::open(&path.display().to_string(), &SETTINGS).unwrap();
        let session = ModbusSession::new(ModbusClient::new(slave(SLAVE), line.master_timing()));
        let drive = ErobDrive::new(session.clone());
        let profile = Profile { velocity: 100_000, acceleration: 1_000_000, deceleration: 1_000_000 };
        let work = async move { motion::carry_out(&drive, Motion::To(30_000, profile)).await };
        let mut procedure = Procedure::<_, _, MotionFailure>::new(session, work);
        let mut readings = 0;
        let outcome = line.carry_out(&mut procedure, |event| {
            readings += usize::from(event.is_some());
            false
        });
        assert!(readings > 5);
        outcome.unwrap().unwrap()
    });
    assert_eq!(ended.end, End::Arrived);
    assert!((ended.position - 30_000).abs() < 60, "{ended:?}");
}

#[test]
fn a_line_that_ends_is_told_with_its_device() {
    let terminal = PseudoTerminal::open().unwrap();
    let path = terminal.path().display().to_string();
    let mut line = ModbusLine::open(&path, &SETTINGS).unwrap();
    drop(terminal);
    let session = ModbusSession::new(ModbusClient::new(slave(SLAVE), line.master_timing()));
    let drive = ErobDrive::new(session.clone());
    let work = async move { drive.read(&registers::FAULT_CODE).await };
    let mut procedure = Procedure::<_, _, AccessError>::new(session, work);
    let error = line.carry_out(&mut procedure, |_| false).unwrap_err();
    assert!(matches!(&error, SerialLineError::System { device, .. } if *device == path), "{error}");
}

#[test]
fn one_thread_serves_the_requests_of_several_owners_for_several_slaves() {
    with_a_line(|path| {
        let line = ModbusLine::open(&path.display().to_string(), &SETTINGS).unwrap();
        let (thread, handle) = LineThread::spawn(line).unwrap();
        thread::scope(|scope| {
            for address in [2, 3, 2, 3] {
                let handle = handle.clone();
                scope.spawn(move || {
                    for _ in 0..10 {
                        let read = Request::Read(RegisterRange::new(0, 1).unwrap());
                        let answer = handle.ask(slave(address), read, Repeat::Allowed).unwrap();
                        let expected = Answer::Values([u16::from(address)].into_iter().collect());
                        assert_eq!(answer, Ok(expected));
                    }
                });
            }
        });
        let absent = handle.ask(slave(9), Request::WriteOne { register: 0xF0, value: 0 }, Repeat::Never);
        assert_eq!(absent.unwrap().unwrap_err().failure, RequestFailure::NoReply);
        drop(handle);
        thread.join().unwrap();
    });
}

fn takt(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_takt")).args(arguments).stdin(Stdio::null()).output().unwrap()
}

/// What the program says of a drive on a line, and how it ends.
fn drive_command(line: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let bus = format!("serial:{}", line.display());
    let target = ["drive", "--bus", &bus, "--node", "2", "--family", "erob-modbus"];
    let output = takt(&[&target[..], arguments].concat());
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[track_caller]
fn done(line: &Path, arguments: &[&str]) -> serde_json::Value {
    let (code, said, errors) = drive_command(line, &[arguments, &["--json"]].concat());
    assert_eq!(code, Some(0), "{arguments:?}: {said}{errors}");
    let object: serde_json::Value = serde_json::from_str(&said).unwrap();
    object["result"].clone()
}

#[track_caller]
fn refused(line: &Path, arguments: &[&str], words: &str) {
    let (code, said, errors) = drive_command(line, arguments);
    assert_ne!(code, Some(0), "{said}");
    assert!(errors.contains(words), "{arguments:?}: {errors}");
}

#[test]
fn takt_drive_commissions_a_drive_on_a_serial_line() {
    with_a_line(|line| {
        let info = done(line, &["info"]);
        assert_eq!((&info["state"], &info["position_counts"]), (&"motor off".into(), &0.into()));
        let profile =
            ["--velocity", "60 deg/s", "--acceleration", "300 deg/s^2", "--deceleration", "300 deg/s^2"];
        let moved = done(line, &[&["move", "relative", "4 deg"], &profile[..]].concat());
        assert!(moved["error_counts"].as_i64().unwrap().abs() < 60, "{moved}");
        let moved = done(line, &[&["move", "absolute", "-1 deg"], &profile[..]].concat());
        let position = moved["position"].as_f64().unwrap().to_degrees();
        assert!((position + 1.0).abs() < 0.05, "{moved}");
        done(line, &["velocity", "20 deg/s", "--duration", "0.5"]);
        done(line, &["torque", "1500", "--raw", "--max-velocity", "20000", "--duration", "0.3"]);
        done(line, &["write", "profile velocity", "30 deg/s"]);
        let read = done(line, &["read", "profile velocity", "0x0060"]);
        assert_eq!((&read["objects"][0]["raw"], &read["objects"][1]["raw"]), (&43_691.into(), &0.into()));
        assert_eq!(done(line, &["clear-fault"])["cleared"], 0);
        refused(line, &["zero"], "WIPES THE COUNT OF TURNS");
        done(line, &["zero", "--yes"]);
        refused(line, &["write", "actual position", "0 deg"], "can only be read");
        refused(line, &["torque", "1 Nm", "--max-velocity", "10 deg/s"], "the value is a current in mA");
        refused(line, &["home"], "no homing");
    });
}

#[test]
fn a_line_and_a_family_that_do_not_belong_together_are_refused() {
    let target = ["drive", "--bus", "serial:/dev/takt-none", "--node", "2", "--family"];
    for (family, words) in [
        ("erob-modbus", "there is no /dev/takt-none"),
        ("erob-can", "the family erob-can is on a CAN bus, not on a serial line"),
    ] {
        let output = takt(&[&target[..], &[family, "info"]].concat());
        let errors = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && errors.contains(words), "{errors}");
    }
    let output = takt(&["drive", "--bus", "vcan0", "--node", "2", "--family", "erob-modbus", "info"]);
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && errors.contains("--bus serial:/dev/ttyUSB0"), "{errors}");
    let output =
        takt(&["drive", "--bus", "serial:ttyUSB0@fast", "--node", "2", "--family", "erob-modbus", "info"]);
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && errors.contains("serial:/dev/ttyUSB0@19200"), "{errors}");
}

#[test]
fn a_configuration_cannot_have_such_an_axis_yet_and_says_what_there_is() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/single-erob.toml");
    let text = std::fs::read_to_string(path).unwrap().replace("erob-canopen", "erob-modbus");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("turntable.toml");
    std::fs::write(&file, text).unwrap();
    let output = takt(&["check", file.to_str().unwrap()]);
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(
        !output.status.success() && errors.contains("`takt drive --bus serial:/dev/ttyUSB0`"),
        "{errors}"
    );
}

#[test]
fn takt_sim_puts_drives_on_a_line_that_takt_drive_opens() {
    struct Hosted(Child);
    impl Drop for Hosted {
        fn drop(&mut self) {
            kill(Pid::from_raw(self.0.id() as i32), Signal::SIGTERM).unwrap();
            self.0.wait().unwrap();
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("rs485");
    let _hosted = Hosted(
        Command::new(env!("CARGO_BIN_EXE_takt"))
            .args(["sim", "--serial", "erob-modbus:3,2", "--pty"])
            .arg(&link)
            .stderr(Stdio::null())
            .spawn()
            .unwrap(),
    );
    while !link.exists() {
        thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(done(&link, &["info"])["state"], "motor off");
    for (line, words) in [
        ("yz-aim:2", "no family of drives on a serial line"),
        ("erob-modbus:2,2", "two slaves cannot have the address 2"),
        ("erob-modbus:248", "from 1 to 247, not 248"),
    ] {
        let output = takt(&["sim", "--serial", line]);
        let errors = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && errors.contains(words), "{errors}");
    }
}

fn python(script: &str, line: &Path) -> Command {
    let mut command = Command::new(std::env::var_os("PYTHON").expect("tests/peers/modbus sets PYTHON"));
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers").join(script)).arg(line);
    command
}

#[test]
#[ignore = "needs pymodbus: tests/peers/modbus installs it and runs this"]
fn pymodbus_reads_writes_and_moves_the_simulated_drive() {
    with_a_line(|path| {
        let output = python("modbus_master.py", path).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stdout));
    });
}

/// Passes bytes on from one pseudo-terminal to another one, in both directions, until `is_over`.
fn relay(ends: &mut [PseudoTerminal; 2], is_over: &AtomicBool) {
    let mut bytes = [0; 512];
    while !is_over.load(Ordering::Relaxed) {
        for (from, to) in [(0, 1), (1, 0)] {
            ends[from].wait(1_000_000);
            if let Ok(count) = ends[from].read(&mut bytes) {
                ends[to].write_all(&bytes[..count]).unwrap();
            }
        }
    }
}

#[test]
#[ignore = "needs pymodbus: tests/peers/modbus installs it and runs this"]
fn the_master_reads_and_writes_a_slave_of_pymodbus() {
    let mut ends = [PseudoTerminal::open().unwrap(), PseudoTerminal::open().unwrap()];
    let paths = ends.each_ref().map(|end| end.path().to_owned());
    let is_over = AtomicBool::new(false);
    thread::scope(|scope| {
        scope.spawn(|| relay(&mut ends, &is_over));
        let _over = Over(&is_over);
        let mut server = python("modbus_slave.py", &paths[0]).stdout(Stdio::piped()).spawn().unwrap();
        let mut said = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut said).unwrap();
        assert_eq!(said, "ready\n");
        let (thread, handle) =
            LineThread::spawn(ModbusLine::open(&paths[1].display().to_string(), &SETTINGS).unwrap()).unwrap();
        let ask = |request: Request| handle.ask(slave(7), request, Repeat::Allowed).unwrap();
        let read = |start, count| Request::Read(RegisterRange::new(start, count).unwrap());
        for (start, count) in [(0, 1), (5, 125), (100, 100)] {
            let values = (start..start + count).collect();
            assert_eq!(ask(read(start, count)), Ok(Answer::Values(values)));
        }
        let values: Vec<u16> = (0..123).map(|value| 0xFF00 + value).collect();
        let write = RegisterValues::new(10, &values).unwrap();
        assert_eq!(ask(Request::WriteSeveral(write)), Ok(Answer::Written));
        assert_eq!(ask(Request::WriteOne { register: 11, value: 0xABCD }), Ok(Answer::Written));
        let written = [0xFF00, 0xABCD, 0xFF02].into_iter().collect();
        assert_eq!(ask(read(10, 3)), Ok(Answer::Values(written)));
        let refusal = ask(read(1_000, 1)).unwrap_err().failure;
        assert_eq!(refusal, RequestFailure::Refused(ExceptionCode::ILLEGAL_ADDRESS));
        let other = handle.ask(slave(8), read(0, 1), Repeat::Never).unwrap();
        drop(handle);
        thread.join().unwrap();
        server.kill().unwrap();
        server.wait().unwrap();
        // A server that knows of no such device says so, or is silent.
        assert!(other.is_err(), "{other:?}");
    });
}
