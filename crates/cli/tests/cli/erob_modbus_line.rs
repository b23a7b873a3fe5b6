//! Drives on a Modbus line of this machine: procedures, `takt drive`, and a simulated drive behind a pseudo-terminal, in real time.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use takt::family;
use takt::family::commission::TargetDrive;
use takt::family::erob::motion::{Motion, Profile};
use takt::family::erob::procedure::{self, End, MotionFailure, Run};
use takt::family::erob_modbus::drive::{AccessError, ErobDrive};
use takt::family::erob_modbus::registers;
use takt::link::modbus_line::ModbusLine;
use takt::link::serial_line::{SerialLineError, SerialSettings};
use takt::procedure::{ModbusClient, ModbusSession, Procedure, ProcedureError};
use takt::sim::erob_modbus::{ErobModbusDrive, ErobModbusParameters, SimulatedLine};
use takt::sim::pseudo_terminal::PseudoTerminal;
use takt::sim::serial_host::host;
use takt_wire::modbus::exception::ExceptionCode;
use takt_wire::modbus::frame::{RegisterRange, RegisterValues, Request, SlaveAddress};
use takt_wire::modbus::line_timing::LineTiming;
use takt_wire::modbus::master::{Answer, Master, MasterTiming, Repeat, RequestError, RequestFailure};

use crate::printed::ends_with;
use crate::simulated::at_once;

const SLAVE: u8 = 2;
const SETTINGS: SerialSettings = SerialSettings::new(115_200);
const TIMING: MasterTiming = MasterTiming::new(LineTiming::new(115_200));

fn drive(address: u8) -> ErobModbusDrive {
    ErobModbusDrive::new(ErobModbusParameters {
        address,
        bit_rate_code: 4,
        module: crate::erob_module::module(),
        reply_ns: 1_000_000,
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

/// Carries out a procedure on a line. `hear` is called for each of its events.
fn carry_out<T: Clone, E: Clone>(
    line: &mut ModbusLine,
    procedure: &mut Procedure<ModbusClient, T, E>,
    mut hear: impl FnMut(),
) -> Result<Result<T, ProcedureError<E>>, SerialLineError> {
    loop {
        procedure.receive(&line.read()?);
        let mut frames = vec![];
        procedure.poll(line.now_ns(), &mut |frame| frames.push(frame));
        for frame in &frames {
            line.write(frame)?;
        }
        while procedure.take_event().is_some() {
            hear();
        }
        if let Some(outcome) = procedure.outcome() {
            return Ok(outcome.clone());
        }
    }
}

/// Sends a request to a slave, and waits for its outcome.
fn ask(
    line: &mut ModbusLine,
    master: &mut Master,
    address: u8,
    request: Request,
) -> Result<Answer, RequestError> {
    master.start(slave(address), request, Repeat::Allowed).unwrap();
    loop {
        if let Some(frame) = master.poll(line.now_ns()) {
            line.write(&frame).unwrap();
        }
        if let Some(outcome) = master.take_outcome() {
            return outcome;
        }
        master.receive(&line.read().unwrap());
    }
}

fn slave(address: u8) -> SlaveAddress {
    SlaveAddress::new(address).unwrap()
}

#[test]
fn a_motion_is_carried_out_over_a_line_of_this_machine() {
    let ended = with_a_line(|path| {
        let mut line = ModbusLine::open(&path.display().to_string(), &SETTINGS).unwrap();
        let session = ModbusSession::new(ModbusClient::new(slave(SLAVE), TIMING));
        let drive = ErobDrive::new(session.clone());
        let profile = Profile { velocity: 100_000, acceleration: 1_000_000, deceleration: 1_000_000 };
        let family = family::all().into_iter().find(|family| family.word() == "erob-modbus").unwrap();
        let target = TargetDrive::unconfigured(SLAVE, family.unconfigured().unwrap()).unwrap();
        let motion = Motion::To(30_000, profile);
        let work = async move {
            let run = Run { motion, duration_ns: None, keeps_enabled: false, target: &target };
            procedure::carry_out(&drive, run).await
        };
        let mut procedure = Procedure::<_, _, MotionFailure<AccessError>>::new(session, work);
        let mut readings = 0;
        let outcome = carry_out(&mut line, &mut procedure, || readings += 1);
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
    let session = ModbusSession::new(ModbusClient::new(slave(SLAVE), TIMING));
    let drive = ErobDrive::new(session.clone());
    let work = async move { drive.read(&registers::FAULT_CODE).await };
    let mut procedure = Procedure::<_, _, AccessError>::new(session, work);
    let error = carry_out(&mut line, &mut procedure, || {}).unwrap_err();
    assert!(matches!(&error, SerialLineError::System { device, .. } if *device == path), "{error}");
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
        assert_eq!(done(line, &["communication-timeout", "750 ms"])["communication_timeout_ms"], 750);
        assert_eq!(done(line, &["read", "0x0002"])["objects"][0]["raw"], 750);
        refused(line, &["communication-timeout", "5 s"], "at most 4 s");
        done(line, &["communication-timeout", "0 ms"]);
        done(line, &["velocity", "20 deg/s", "--duration", "0.3", "--keep-enabled"]);
        done(line, &["emergency-stop"]);
        assert_eq!(
            done(line, &["info"])["velocity"].as_f64().map(|velocity| velocity.abs() < 0.01),
            Some(true)
        );
        done(line, &["disable"]);
        assert_eq!(done(line, &["clear-fault"])["cleared"], 0);
        refused(line, &["zero"], "WIPES THE COUNT OF TURNS");
        done(line, &["zero", "--yes"]);
        refused(line, &["write", "actual position", "0 deg"], "can only be read");
        refused(line, &["torque", "1 Nm", "--max-velocity", "10 deg/s"], "the value is a current in mA");
        refused(line, &["torque", "20000", "--raw", "--max-velocity", "20000"], "peak current, 12600 mA");
        let swung = done(line, &[&["move", "reciprocate", "2 deg", "--times", "1"], &profile[..]].concat());
        assert_eq!((&swung["moves"], &swung["state"]), (&2.into(), &"motor off".into()), "{swung}");
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
fn takt_sim_puts_drives_on_a_line_that_takt_drive_opens() {
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

/// A program at the other end of a line, which ends with its test: the simulated turntable behind a pseudo-terminal, or a slave.
struct Hosted(Child);

impl Hosted {
    fn turntable(link: &Path) -> Self {
        let mut takt = at_once(env!("CARGO_BIN_EXE_takt"));
        takt.args(["sim", "--serial", "erob-modbus:2", "--pty"]).arg(link).stderr(Stdio::null());
        let hosted = Self(takt.spawn().unwrap());
        while !link.exists() {
            thread::sleep(Duration::from_millis(5));
        }
        hosted
    }
}

impl Drop for Hosted {
    fn drop(&mut self) {
        kill(Pid::from_raw(self.0.id() as i32), Signal::SIGTERM).unwrap();
        self.0.wait().unwrap();
    }
}

/// `takt run` with the turntable beside a simulated arm, on this line, with patience on both ends of the line: its threads have no
/// real-time rights, and on a busy machine they are late, which is not what is tried here.
fn run_command(folder: &Path, link: &Path, options: &[&str]) -> Command {
    let hasty = "communication_timeout = \"500 ms\"";
    let patient = "communication_timeout = \"4 s\"\nmissed_feedback_cycles = 100";
    let text = include_str!("../../../../configs/turntable-modbus.toml").replacen(hasty, patient, 1);
    assert!(text.contains(patient));
    let text = format!("{text}\n[cycle.missed_slots]\nstop = 100000\n");
    let config = folder.join("turntable.toml");
    fs::write(&config, text).unwrap();
    let mut takt = at_once(env!("CARGO_BIN_EXE_takt"));
    takt.current_dir(folder)
        .arg("run")
        .arg(config)
        .arg("--bus")
        .arg(format!("table=serial:{}", link.display()));
    takt.args(options).arg("--json").stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    takt
}

/// What is known of the drive after a run.
fn assert_off_and_without_fault(link: &Path) {
    let info = done(link, &["info"]);
    assert_eq!((&info["state"], &info["error_code"]), (&"motor off".into(), &0.into()), "{info}");
}

#[test]
fn takt_run_moves_the_turntable_on_a_line_of_this_machine_beside_the_arm() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("rs485");
    let _hosted = Hosted::turntable(&link);
    let output = run_command(folder.path(), &link, &[]).output().unwrap();
    ends_with(0, &output);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let position = report["axes"][2]["final_position"].as_f64().unwrap();
    assert!(position.to_degrees().abs() < 0.5, "{report}");
    let line = &report["buses"][1];
    assert!(line["tx_frames"].as_u64().unwrap() > 100, "{line}");
    assert!(line["load_percent"].as_f64().unwrap() > 5.0, "{line}");
    assert_off_and_without_fault(&link);
}

/// Returns `true` if a process has a file open.
fn has_open(process: u32, path: &Path) -> bool {
    let file = fs::canonicalize(path).unwrap();
    let descriptors = fs::read_dir(format!("/proc/{process}/fd")).into_iter().flatten().flatten();
    descriptors.filter_map(|descriptor| fs::read_link(descriptor.path()).ok()).any(|open| open == file)
}

#[test]
fn ctrl_c_stops_the_turntable_on_its_line_in_control() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("rs485");
    let _hosted = Hosted::turntable(&link);
    let mut child = run_command(folder.path(), &link, &["--duration", "600"]).spawn().unwrap();
    // To open the line, to see whether that is refused, would keep takt off it for this moment.
    while !has_open(child.id(), &link) {
        assert_eq!(child.try_wait().unwrap(), None, "the run has ended");
        thread::sleep(Duration::from_millis(5));
    }
    thread::sleep(Duration::from_secs(4));
    kill(Pid::from_raw(child.id() as i32), Signal::SIGINT).unwrap();
    let output = child.wait_with_output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(130), "{errors}");
    assert_off_and_without_fault(&link);
}

#[test]
fn a_line_is_refused_while_another_takt_commands_it_and_is_taken_over_in_control() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("rs485");
    let _hosted = Hosted::turntable(&link);
    let first = run_command(folder.path(), &link, &["--duration", "600"]).spawn().unwrap();
    thread::sleep(Duration::from_secs(4));
    let refused = run_command(folder.path(), &link, &[]).output().unwrap();
    let errors = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(2), "{errors}");
    let second = run_command(folder.path(), &link, &["--take-over"]).output().unwrap();
    let errors = String::from_utf8_lossy(&second.stderr).into_owned();
    assert_eq!(second.status.code(), Some(0), "{errors}");
    let first = first.wait_with_output().unwrap();
    assert_eq!(first.status.code(), Some(130), "{}", String::from_utf8_lossy(&first.stderr));
    assert_off_and_without_fault(&link);
}

#[test]
fn a_line_that_is_unplugged_stops_the_group_with_one_reason() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("rs485");
    let hosted = Hosted::turntable(&link);
    // Keeps the number of the pseudo-terminal: another test would get it while this run still has its lock.
    let _number = fs::File::open(&link).unwrap();
    let child = run_command(folder.path(), &link, &["--duration", "600"]).spawn().unwrap();
    thread::sleep(Duration::from_secs(4));
    drop(hosted);
    let output = child.wait_with_output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{errors}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(report["stop"].to_string().contains("table"), "{}", report["stop"]);
    assert!(report["unreached"].to_string().contains("table"), "{report}");
}

fn python(script: &str, line: &Path) -> Command {
    let mut command = Command::new(std::env::var_os("PYTHON").expect("tests/peers/modbus sets PYTHON"));
    command
        .arg(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("tests/peers").join(script))
        .arg(line);
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
        let mut server = python("modbus_slave.py", &paths[0]);
        let mut server = Hosted(server.stdout(Stdio::piped()).spawn().unwrap());
        let mut said = String::new();
        BufReader::new(server.0.stdout.take().unwrap()).read_line(&mut said).unwrap();
        assert_eq!(said, "ready\n");
        let mut line = ModbusLine::open(&paths[1].display().to_string(), &SETTINGS).unwrap();
        let mut master = Master::new(TIMING);
        let mut ask_it = |address, request| ask(&mut line, &mut master, address, request);
        let mut ask = |request: Request| ask_it(7, request);
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
        let other = ask_it(8, read(0, 1));
        drop(server);
        // A server that knows of no such device says so, or is silent.
        assert!(other.is_err(), "{other:?}");
    });
}
