//! `takt sim --serial`: the simulated devices on serial lines, as any program finds them.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::thread;
use std::time::Duration;

use takt_wire::hollow_lines::encoder::{self, EncoderReading};
use takt_wire::hollow_lines::motor_data::{MotorCommand, MotorMode, MotorReply, MotorRun};
use takt_wire::hollow_lines::transparent::{FrameReader, TransparentFrame};

use crate::simulated::Simulated;

/// A simulated device in a process of its own, and its line.
struct Device {
    _simulated: Simulated,
    line: File,
}

impl Device {
    fn new(kind: &str) -> Self {
        let simulated = Simulated::new(&["--serial", kind]);
        let line = OpenOptions::new().read(true).write(true).open(&simulated.path).unwrap();
        Self { _simulated: simulated, line }
    }

    /// The frame that answers a request.
    fn ask(&mut self, request: TransparentFrame) -> TransparentFrame {
        self.line.write_all(&request.encode()).unwrap();
        let mut reader = FrameReader::default();
        loop {
            let mut byte = [0];
            self.line.read_exact(&mut byte).unwrap();
            if let Some(frame) = reader.push(byte[0]) {
                return frame;
            }
        }
    }

    fn motor(&mut self, id: u8, command: MotorCommand) -> MotorReply {
        let reply = self.ask(TransparentFrame { id, data: command.encode().unwrap() });
        assert_eq!(reply.id, 100);
        MotorReply::decode(&reply.data).unwrap()
    }

    /// What the console types until these words come.
    fn type_line(&mut self, line: &str, until: &str) -> String {
        self.line.write_all(format!("{line}\n\r").as_bytes()).unwrap();
        let mut heard = String::new();
        while !heard.contains(until) {
            let mut bytes = [0; 256];
            let count = self.line.read(&mut bytes).unwrap();
            heard.push_str(std::str::from_utf8(&bytes[..count]).unwrap());
        }
        heard
    }
}

#[test]
fn a_device_that_has_no_addresses_says_so_when_it_is_given_one() {
    for device in ["hollow-rs485", "hollow-modbus"] {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_takt"));
        let output = command.args(["sim", "--serial", &format!("{device}:1")]).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        let words = format!("{device} has no addresses: write --serial {device}");
        assert!(output.status.code() == Some(2) && said.contains(&words), "{said}");
    }
}

#[test]
fn a_motor_behind_the_rs_485_module_is_moved_to_a_position() {
    let mut module = Device::new("hollow-rs485");
    let start = module.motor(2, MotorCommand::default());
    assert_eq!((start.id, start.position, start.is_running), (2, 0, false));
    let go = MotorCommand {
        position: -50_000,
        velocity: 1 << 20,
        mode: MotorMode::Position,
        run: MotorRun::Run,
        ..MotorCommand::default()
    };
    let mut reply = module.motor(2, go);
    while reply.position != go.position {
        assert!(reply.is_running && reply.position > go.position, "{reply:?}");
        thread::sleep(Duration::from_millis(1));
        reply = module.motor(2, go);
    }
    assert_eq!(module.motor(1, MotorCommand::default()).position, 0);
}

#[test]
fn the_hollow_encoder_is_read() {
    let reply = Device::new("hollow-encoder").ask(encoder::REQUEST);
    assert_eq!(EncoderReading::of(&reply).position, 678_257);
}

#[test]
fn the_console_moves_its_motor_and_shows_its_parameters() {
    let mut console = Device::new("hollow-console");
    assert!(console.type_line("s", "ClrZeroPoint").contains("c) position loop gain 20"));
    console.type_line("c", "position loop gain");
    assert!(console.type_line("30.0", "ClrZeroPoint").contains("c) position loop gain 30"));
    console.type_line("r", "free");
    console.type_line("m10.0", "running");
}
