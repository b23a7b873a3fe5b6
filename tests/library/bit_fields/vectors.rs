//! The frames of the hollow-shaft motors' manual over CAN and CAN FD, each in both directions: the codec of the cycle makes and reads them by
//! the shipped descriptions, and the simulated drive reads and makes them bit by bit.

use std::f64::consts::TAU;

use takt::config::Axis;
use takt::config::bit_fields;
use takt::sim::bit_fields::{Command, Reply};
use takt_rt::{
    CommandValue, CommandValues, FieldDriveParameters, Frame, FrameFormat, Id, LifeCycle, OwnFrame,
    OwnFrames, ReplyValue, ReplyValues,
};

use crate::bit_fields::machine::{HOLLOW, HOLLOW_FD, MIT, axis, device};
use crate::rows::columns;

const VECTORS: &str = include_str!("../../vectors/hollow-motor-vectors.csv");
const MASTER_ID: u16 = 0x64;
const COUNTS_PER_TURN: f64 = 1_048_576.0;
const POLE_PAIRS: f64 = 14.0;

struct Row {
    id: String,
    bytes: Vec<u8>,
    values: Vec<(String, f64)>,
}

fn rows() -> Vec<Row> {
    let is_of_bus = |row: &Vec<String>| matches!(row[2].as_str(), "can" | "canfd");
    let rows = VECTORS.lines().skip(1).map(columns).filter(is_of_bus);
    let rows = rows.filter(|row| !row[8].starts_with("MISPRINT"));
    let number = |text: &str| match text.strip_prefix("0x") {
        Some(digits) => i64::from_str_radix(digits, 16).ok().map(|number| number as f64),
        None => text.parse().ok(),
    };
    rows.map(|row| Row {
        bytes: row[5].split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect(),
        values: row[7]
            .split(' ')
            .filter_map(|word| {
                let (name, value) = word.split_once('=')?;
                Some((name.to_owned(), number(value)?))
            })
            .collect(),
        id: row[0].clone(),
    })
    .collect()
}

impl Row {
    fn get(&self, name: &str) -> f64 {
        self.values.iter().find(|(own, _)| own == name).map_or(0.0, |(_, value)| *value)
    }

    fn eight(&self) -> [u8; 8] {
        self.bytes.clone().try_into().unwrap()
    }
}

fn motor(keys: &str, more: &str) -> (Axis, FieldDriveParameters) {
    let axis = axis(&format!("{keys}master_id = {MASTER_ID}\n{more}"));
    let compiled = bit_fields::compile(device(&axis), &axis).unwrap();
    (axis, compiled)
}

fn master() -> Id {
    Id::base(MASTER_ID.into()).unwrap()
}

/// What a code of 16 or 12 bits is, by the formulas of the manual.
fn centred(code: f64, bits: i32, full_scale: f64) -> f64 {
    let half = 2f64.powi(bits - 1);
    (code - half) / half * full_scale
}

fn packed_command(row: &Row) -> Command {
    Command {
        position: centred(row.get("pos"), 16, TAU),
        velocity: centred(row.get("vel"), 12, 200.0),
        torque: centred(row.get("cur"), 12, 4.0),
        stiffness: row.get("kp"),
        damping: row.get("kd"),
        ..Command::default()
    }
}

fn flexible_command(row: &Row) -> Command {
    Command {
        position: row.get("pos") / COUNTS_PER_TURN * TAU,
        velocity: row.get("vel") / 8_388_608.0 * 1000.0 / POLE_PAIRS * TAU,
        torque: row.get("cur") / 32_768.0 * 100.0,
        stiffness: row.get("kp"),
        damping: row.get("kd"),
        mode: row.get("mode") as u8,
        run: row.get("run") == 1.0,
        zero: row.get("zero") == 1.0,
    }
}

fn assert_command(row: &Row, keys: &str, command: Command) {
    let (axis, compiled) = motor(keys, "");
    let read = Command::read(device(&axis), &row.bytes);
    assert_eq!(read, command, "{}", row.id);
    let mut values = CommandValues::default();
    for (value, to) in [
        (CommandValue::Position, command.position),
        (CommandValue::Velocity, command.velocity),
        (CommandValue::Torque, command.torque),
        (CommandValue::Stiffness, command.stiffness),
        (CommandValue::Damping, command.damping),
        (CommandValue::Mode, command.mode.into()),
        (CommandValue::Run, f64::from(u8::from(command.run))),
        (CommandValue::Zero, f64::from(u8::from(command.zero))),
    ] {
        values.set(value, to);
    }
    let frame = compiled.command.frame(&values);
    assert_eq!((frame.id(), frame.payload()), (Id::canopen(0, 1), &row.bytes[..]), "{}", row.id);
}

fn assert_reply(row: &Row, keys: &str, more: &str, reply: Reply) {
    let (axis, compiled) = motor(keys, more);
    let made = reply.frame(device(&axis), master()).unwrap();
    assert_eq!(made.payload(), row.bytes, "{}", row.id);
    let mut values = ReplyValues::default();
    compiled.reply.receive(&made, &mut values).unwrap();
    for (value, expected) in [
        (ReplyValue::Position, reply.position),
        (ReplyValue::Velocity, reply.velocity),
        (ReplyValue::Torque, reply.torque),
        (ReplyValue::Sender, reply.motor_id.into()),
    ] {
        assert!((values.get(value) - expected).abs() < 1e-9, "{}: {value:?}", row.id);
    }
    if compiled.reply.carries(ReplyValue::Temperature) {
        assert_eq!(values.get(ReplyValue::Temperature), reply.temperature, "{}", row.id);
        assert_eq!(values.get(ReplyValue::Mode), f64::from(reply.mode), "{}", row.id);
        assert_eq!(values.get(ReplyValue::Run), f64::from(u8::from(reply.run)), "{}", row.id);
    }
}

/// Byte 0 of a Damiao reply is the state, then the lowest four bits of the motor ID.
#[test]
fn a_damiao_motor_tells_the_lowest_bits_of_its_id_beside_its_state() {
    for description in ["damiao-dm-mit", "damiao-dm-position-velocity", "damiao-dm-velocity"] {
        let gains = if description == "damiao-dm-mit" { "" } else { "kp = 60\nkd = 1.5\n" };
        let mode = if description == "damiao-dm-velocity" { "mode = \"csv\"\n" } else { "" };
        let keys = format!("{}{mode}description = {description:?}\n", MIT.replace(gains, ""));
        let (axis, _) = motor(&keys, "");
        for (motor_id, byte) in [(1, 0x11), (9, 0x19), (0x12, 0x12), (126, 0x1E)] {
            let reply = Reply { state: 1, motor_id, ..NOTHING }.frame(device(&axis), master()).unwrap();
            assert_eq!(reply.payload()[0], byte, "{description}: motor {motor_id}");
        }
    }
}

const NOTHING: Reply = Reply {
    position: 0.0,
    velocity: 0.0,
    torque: 0.0,
    temperature: 0.0,
    mode: 0,
    run: false,
    error: 0,
    state: 0,
    motor_id: 1,
};

fn flexible_reply(row: &Row) -> Reply {
    let Command { position, velocity, torque, mode, run, .. } = flexible_command(row);
    let motor_id = row.get("id") as u8;
    Reply {
        position,
        velocity,
        torque,
        temperature: row.get("temp"),
        mode,
        run,
        motor_id,
        error: 0,
        state: 0,
    }
}

/// A frame with a meaning of its own, by the last byte of it.
fn own(frames: &OwnFrames, id: &str) -> OwnFrame {
    match id {
        "can-start" => frames.start,
        "can-stop" => frames.stop,
        "can-mode-torque" => frames.torque.unwrap(),
        "can-mode-velocity" => frames.velocity.unwrap(),
        "can-mode-position" => frames.position.unwrap(),
        "can-set-zero" => frames.zero.unwrap(),
        other => panic!("{other}"),
    }
}

fn assert_setup(row: &Row, more: &str, place: usize) {
    let (axis, _) = motor(HOLLOW, more);
    let setup = device(&axis).setup(1);
    let expected = OwnFrame { id: Id::extended(1).unwrap(), payload: row.eight() };
    assert_eq!(setup.get(place), Some(&expected), "{}", row.id);
}

fn assert_code(row: &Row, value: CommandValue, to: f64) {
    let (axis, compiled) = motor(HOLLOW, "");
    let mut values = CommandValues::default();
    values.set(value, to);
    let frame = compiled.command.frame(&values);
    let [high, low, velocity, between, .., torque_high, torque_low] = frame.payload() else { panic!() };
    let code = match value {
        CommandValue::Position => u16::from_be_bytes([*high, *low]),
        CommandValue::Velocity => u16::from(*velocity) << 4 | u16::from(*between) >> 4,
        _ => u16::from_be_bytes([torque_high & 0xF, *torque_low]),
    };
    assert_eq!(code.to_be_bytes(), row.bytes[..], "{}", row.id);
    let Command { position, velocity, torque, .. } = Command::read(device(&axis), frame.payload());
    let (read, bits, full_scale) = match value {
        CommandValue::Position => (position, 16, TAU),
        CommandValue::Velocity => (velocity, 12, 200.0),
        _ => (torque, 12, 4.0),
    };
    assert_eq!(read, centred(code.into(), bits, full_scale), "{}", row.id);
}

#[test]
fn every_frame_of_the_manual_over_can_and_can_fd_is_made_and_read_as_printed() {
    let rows = rows();
    assert_eq!(rows.len(), 24);
    let (_, compiled) = motor(HOLLOW, "");
    let LifeCycle::ByFrames(frames) = compiled.life_cycle else { panic!() };
    for row in &rows {
        match row.id.as_str() {
            id @ ("can-start" | "can-stop" | "can-mode-torque" | "can-mode-velocity"
            | "can-mode-position" | "can-set-zero") => {
                assert_eq!(own(&frames, id), OwnFrame { id: Id::canopen(0, 1), payload: row.eight() });
            }
            "can-ext-mode" => assert_setup(row, "extended = true\n", 0),
            "can-normal-mode" => assert_setup(row, "", 0),
            "can-gain-speed-kp" => assert_setup(row, "velocity_loop_kp = 1\n", 0),
            "can-gain-speed-ki" => assert_setup(row, "velocity_loop_ki = 1\n", 0),
            "can-gain-current-kp" => assert_setup(row, "current_loop_kp = 1\n", 0),
            "can-gain-current-ki" => assert_setup(row, "current_loop_ki = 1\n", 0),
            "float-1" => {
                let (axis, _) = motor(HOLLOW, "velocity_loop_kp = 1\n");
                assert_eq!(device(&axis).setup(1)[0].payload[2..6], row.bytes);
            }
            "can-cmd-example" | "can-cmd-c-program" => assert_command(row, HOLLOW, packed_command(row)),
            "scale-pos-180" => assert_code(row, CommandValue::Position, TAU / 2.0),
            "scale-vel-pos" => assert_code(row, CommandValue::Velocity, 100.0),
            "scale-vel-neg" => assert_code(row, CommandValue::Velocity, -100.0),
            "scale-cur" => assert_code(row, CommandValue::Torque, 2.0),
            "can-reply-normal" => {
                let Command { position, velocity, torque, .. } = packed_command(row);
                assert_reply(row, HOLLOW, "", Reply { position, velocity, torque, ..NOTHING });
            }
            "can-reply-extended" => {
                let Command { velocity, torque, .. } = packed_command(row);
                let position = row.get("pos") / COUNTS_PER_TURN * TAU;
                let reply = Reply { position, velocity, torque, ..NOTHING };
                assert_reply(row, HOLLOW, "extended = true\n", reply);
            }
            "canfd-poll" => assert_command(row, HOLLOW_FD, flexible_command(row)),
            "canfd-reply-30c" | "canfd-reply-negative" => {
                assert_reply(row, HOLLOW_FD, "", flexible_reply(row));
            }
            other => panic!("a row that nobody looks at: {other}"),
        }
    }
}

#[test]
fn flexible_data_rate_frames_switch_the_bit_rate_where_the_configuration_says_so() {
    for (more, format) in [("", FrameFormat::Fd), ("bit_rate_switch = true\n", FrameFormat::FdBitRateSwitch)]
    {
        let (axis, compiled) = motor(HOLLOW_FD, more);
        assert_eq!((compiled.command.format(), compiled.reply.format()), (format, format));
        let frame: Frame = NOTHING.frame(device(&axis), master()).unwrap();
        assert_eq!(frame.kind(), format.kind());
    }
}

#[test]
fn gear_direction_and_zero_are_in_the_scales_of_every_field() {
    let keys =
        format!("{HOLLOW_FD}master_id = 0x64\nreversed = true\ngear_ratio = 3\nzero_counts = 262144\n");
    let axis = axis(&keys);
    let compiled = bit_fields::compile(device(&axis), &axis).unwrap();
    let mut values = CommandValues::default();
    values.set(CommandValue::Position, 0.5);
    values.set(CommandValue::Velocity, -1.0);
    values.set(CommandValue::Torque, 1.5);
    let command = Command::read(device(&axis), compiled.command.frame(&values).payload());
    let turn = 1.0 / COUNTS_PER_TURN;
    assert!((command.position / TAU - (0.25 - 3.0 * 0.5 / TAU)).abs() <= turn, "{command:?}");
    assert!((command.velocity - 3.0).abs() < 1e-4, "{command:?}");
    assert!((command.torque + 0.5).abs() <= 0.5 * 100.0 / 32_768.0, "{command:?}");
    let reply =
        Reply { position: command.position, velocity: command.velocity, torque: command.torque, ..NOTHING };
    let mut read = ReplyValues::default();
    compiled.reply.receive(&reply.frame(device(&axis), master()).unwrap(), &mut read).unwrap();
    assert!((read.get(ReplyValue::Position) - 0.5).abs() < 1e-5);
    assert!((read.get(ReplyValue::Velocity) + 1.0).abs() < 1e-4);
    assert!((read.get(ReplyValue::Torque) - 1.5).abs() < 0.01);
}
