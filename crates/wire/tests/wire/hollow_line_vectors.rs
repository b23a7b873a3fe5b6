//! The serial lines of the hollow-shaft motors against what their manual prints.

use std::num::NonZeroU16;

use crate::rows::columns;
use takt_rt::slcan::{
    BitRate, Command, DataBitRate, HostLine, LineError, LineReader, decode_frame, encode_frame,
};
use takt_rt::{Frame, Id};
use takt_wire::hollow_lines::console::{ConsoleCommand, ConsoleReader};
use takt_wire::hollow_lines::encoder::{self, EncoderReading};
use takt_wire::hollow_lines::motor_data::{MotorCommand, MotorMode, MotorReply, MotorScale};
use takt_wire::hollow_lines::pulse_module::{FIRST_BYTE_OF_EXAMPLE, StiffnessSetting};
use takt_wire::hollow_lines::registers;
use takt_wire::hollow_lines::transparent::{FRAME_BYTES, FrameReader, TransparentFrame};
use takt_wire::modbus::frame::{
    Received, ReceivedRequest, RegisterRange, RegisterValues, Reply, Request, SlaveAddress, evaluate,
    reply_frame,
};

const VECTORS: &str = include_str!("../../../../tests/vectors/hollow-motor-vectors.csv");

/// A row of the table.
struct Row {
    id: String,
    transport: String,
    content: String,
    is_misprint: bool,
}

fn rows_of(transport: &str) -> Vec<Row> {
    let rows = VECTORS.lines().skip(1).map(columns).map(|row| Row {
        id: row[0].clone(),
        transport: row[2].clone(),
        content: row[5].clone(),
        is_misprint: row[8].starts_with("MISPRINT"),
    });
    rows.filter(|row| row.transport == transport).collect()
}

fn named_row(id: &str) -> Row {
    let all = ["slcan", "canfd", "rs485-transparent", "modbus-rtu", "unspecified"];
    all.into_iter().flat_map(rows_of).find(|row| row.id == id).unwrap_or_else(|| panic!("no row {id}"))
}

/// The text of a row, in which `\r` and `\n` are written as escapes.
fn text(row: &Row) -> Vec<u8> {
    row.content.replace("\\r", "\r").replace("\\n", "\n").into_bytes()
}

fn bytes(text: &str) -> Vec<u8> {
    text.split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

/// The lines that an adapter finds in these bytes.
fn lines(bytes: &[u8]) -> Vec<Result<HostLine, LineError>> {
    let mut reader = LineReader::default();
    bytes.iter().filter_map(|byte| reader.push(*byte).map(HostLine::decode)).collect()
}

#[test]
fn every_line_to_the_adapter_is_written_and_read_as_the_manual_prints_it() {
    let motor = Id::base(1).unwrap();
    let command = |command: Command| (command.text().to_vec(), HostLine::Command(command));
    let frame = |frame: Frame| (encode_frame(&frame).to_vec(), HostLine::Frame(frame));
    let mut checked = 0;
    for row in rows_of("slcan").into_iter().filter(|row| !row.is_misprint) {
        let (written, line) = match row.id.as_str() {
            "slcan-bitrate" => command(Command::SetBitRate(BitRate::of(1_000_000).unwrap())),
            "slcan-data-bitrate" => command(Command::SetDataBitRate(DataBitRate::of(5_000_000).unwrap())),
            "slcan-open" => command(Command::Open),
            "slcan-can-poll" => frame(Frame::of(motor, [0, 0, 0x80, 0, 0, 0, 0x08, 0])),
            "slcan-canfd-poll-fixed" => {
                frame(Frame::fd(motor, &bytes(&named_row("canfd-poll").content), false).unwrap())
            }
            other => panic!("an unknown row: {other}"),
        };
        // The manual ends one of its lines with CR LF. A CANable takes the LF for the beginning of the next command.
        let printed = text(&row);
        assert_eq!(written, printed.strip_suffix(b"\n").unwrap_or(&printed), "{}", row.id);
        assert_eq!(lines(&printed), [Ok(line)], "{}", row.id);
        checked += 1;
    }
    assert_eq!(checked, 5);
}

#[test]
fn the_misprinted_frame_is_refused_for_its_two_digits_too_many() {
    let printed = text(&named_row("slcan-canfd-poll"));
    assert_eq!(lines(&printed), [Err(LineError::Digits { found: 34, expected: 32 })]);
    assert!(decode_frame(&printed[..printed.len() - 1]).is_err());
}

/// The frames in these bytes, and how many bytes belong to none.
fn transparent(bytes: &[u8]) -> (Vec<TransparentFrame>, u64) {
    let mut reader = FrameReader::default();
    let frames = bytes.iter().filter_map(|byte| reader.push(*byte)).collect();
    (frames, reader.discarded())
}

const STANDING: MotorReply = MotorReply {
    position: 0,
    velocity: 0,
    current: 0,
    mode: MotorMode::Torque,
    is_running: false,
    error: 0,
    temperature: 0,
    id: 1,
};

#[test]
fn every_frame_behind_the_rs_485_module_is_written_and_read_as_the_manual_prints_it() {
    let mut checked = 0;
    for row in rows_of("rs485-transparent").into_iter().filter(|row| !row.is_misprint) {
        let printed = bytes(&row.content);
        let (id, data) = match row.id.as_str() {
            "rs485-req-fixed" => (0x01, MotorCommand::default().encode().unwrap()),
            "rs485-rsp-fixed" => {
                (0x64, MotorReply { position: 34, temperature: 30, ..STANDING }.encode().unwrap())
            }
            "encoder-req-fixed" => (encoder::REQUEST.id, encoder::REQUEST.data),
            "encoder-rsp-fixed" => {
                (0x01, MotorReply { position: 678_257, id: 0, ..STANDING }.encode().unwrap())
            }
            other => panic!("an unknown row: {other}"),
        };
        let frame = TransparentFrame { id, data };
        assert_eq!(frame.encode().as_slice(), printed, "{}", row.id);
        assert_eq!(transparent(&printed), (vec![frame], 0), "{}", row.id);
        checked += 1;
    }
    assert_eq!(checked, 4);
}

#[test]
fn a_misprinted_frame_is_none_and_costs_no_other_one() {
    let sound = bytes(&named_row("rs485-req-fixed").content);
    let mut misprints = 0;
    for row in rows_of("rs485-transparent").into_iter().filter(|row| row.is_misprint) {
        let printed = bytes(&row.content);
        assert_ne!(printed.len(), FRAME_BYTES, "{}", row.id);
        let (frames, discarded) = transparent(&[printed.as_slice(), &sound].concat());
        assert_eq!((frames.len(), discarded as usize), (1, printed.len()), "{}", row.id);
        misprints += 1;
    }
    assert_eq!(misprints, 4);
}

#[test]
fn the_reading_of_the_hollow_encoder_is_an_angle() {
    let (frames, _) = transparent(&bytes(&named_row("encoder-rsp-fixed").content));
    let reading = EncoderReading::of(&frames[0]);
    assert_eq!(reading.position, 678_257);
    assert!((reading.angle().to_degrees() - 232.861).abs() < 1e-3);
}

#[test]
fn the_data_of_can_fd_frames_are_commands_and_replies() {
    let array = |id: &str| <[u8; 16]>::try_from(bytes(&named_row(id).content)).unwrap();
    let poll = MotorCommand { mode: MotorMode::Position, ..MotorCommand::default() };
    assert_eq!(MotorCommand::decode(&array("canfd-poll")), Ok(poll));
    assert_eq!(poll.encode(), Ok(array("canfd-poll")));
    let warm = MotorReply { position: 34, temperature: 30, ..STANDING };
    let negative = MotorReply { position: -81_266_187, current: 8, temperature: 31, ..STANDING };
    for (id, reply) in [("canfd-reply-30c", warm), ("canfd-reply-negative", negative)] {
        assert_eq!(MotorReply::decode(&array(id)), Ok(reply), "{id}");
        assert_eq!(reply.encode(), Ok(array(id)), "{id}");
    }
    let scale = MotorScale { pole_pairs: NonZeroU16::new(14).unwrap() };
    assert!((scale.current(negative.current) - 0.0244).abs() < 1e-4);
}

#[test]
fn the_registers_of_modbus_are_the_bytes_of_can_fd() {
    // Address, function 3, byte count; then two bytes a register; then the CRC.
    let reply = bytes(&named_row("modbus-read-rsp-fixed").content);
    let values: Vec<u16> =
        reply[3..35].chunks(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
    let read: [u16; 16] = values.try_into().unwrap();
    let data = <[u8; 16]>::try_from(bytes(&named_row("canfd-reply-negative").content)).unwrap();
    assert_eq!(registers::from_registers(&read), Ok(data));
    assert_eq!(registers::to_registers(&data), read);
    // Address, function 16, first register, count, byte count; then the registers.
    let request = bytes(&named_row("modbus-write-req-fixed").content);
    let written = registers::to_registers(&MotorCommand::default().encode().unwrap());
    assert_eq!(request[2..4], registers::FIRST_ADDRESS.to_be_bytes());
    assert_eq!(request[7..39], written.map(u16::to_be_bytes).concat());
}

/// Whole frames, with the CRC-16 of the crate against that of the manual.
#[test]
fn every_frame_of_the_modbus_bridge_is_written_and_read_as_the_manual_prints_it() {
    let slave = SlaveAddress::new(1).unwrap();
    let nothing = registers::to_registers(&MotorCommand::default().encode().unwrap());
    let negative = MotorReply { position: -81_266_187, current: 8, temperature: 31, ..STANDING };
    let shown = registers::to_registers(&negative.encode().unwrap());
    let write = Request::WriteSeveral(RegisterValues::new(registers::FIRST_ADDRESS, &nothing).unwrap());
    let read = Request::Read(RegisterRange::new(registers::FIRST_ADDRESS, 16).unwrap());
    let nothing_read: &[u16] = &[];
    let printed = |id: &str| bytes(&named_row(id).content);
    let sound = rows_of("modbus-rtu").into_iter().filter(|row| !row.is_misprint);
    let ids: Vec<String> = sound.map(|row| row.id).collect();
    let pairs = [
        (&write, "modbus-write-req-fixed", "modbus-write-rsp", Reply::Written, nothing_read),
        (&read, "modbus-read-req", "modbus-read-rsp-fixed", Reply::Values(shown.to_vec()), &shown),
    ];
    assert_eq!(ids, pairs.iter().flat_map(|(_, asked, replied, ..)| [*asked, *replied]).collect::<Vec<_>>());
    for (request, asked, replied, reply, values) in pairs {
        assert_eq!(request.frame(slave), printed(asked), "{asked}");
        let received = ReceivedRequest { address: 1, request: Ok(request.clone()) };
        assert_eq!(ReceivedRequest::decode(&printed(asked)), Some(received), "{asked}");
        assert_eq!(evaluate(request, slave, &printed(replied)), Received::Whole(Ok(reply)), "{replied}");
        assert_eq!(reply_frame(&printed(asked), Ok(values)), Some(printed(replied)), "{replied}");
    }
    for row in rows_of("modbus-rtu").into_iter().filter(|row| row.is_misprint) {
        let is_request = ReceivedRequest::decode(&bytes(&row.content)).is_some();
        let is_reply = evaluate(&read, slave, &bytes(&row.content)) == Received::Whole(Ok(Reply::Written));
        assert!(!is_request && !is_reply, "{}", row.id);
    }
}

#[test]
fn every_command_of_the_console_is_typed_and_read_as_the_manual_prints_it() {
    let mut checked = 0;
    for row in rows_of("serial-ascii").into_iter().filter(|row| !row.is_misprint) {
        let command = match row.id.as_str() {
            "serial-m10" => ConsoleCommand::Drive { is_forward: true, value: 10.0 },
            "serial-r" => ConsoleCommand::Stop,
            "serial-p" => ConsoleCommand::ModeMenu,
            "serial-s" => ConsoleCommand::ParameterMenu,
            other => panic!("an unknown row: {other}"),
        };
        let printed = text(&row);
        assert_eq!(command.encode().unwrap().as_bytes(), printed, "{}", row.id);
        let mut reader = ConsoleReader::default();
        let lines: Vec<String> = printed.iter().filter_map(|byte| reader.push(*byte)).collect();
        assert_eq!(lines.len(), 1, "{}", row.id);
        assert_eq!(ConsoleCommand::decode(&lines[0]), Ok(command), "{}", row.id);
        checked += 1;
    }
    assert_eq!(checked, 4);
}

#[test]
fn the_stiffness_of_the_pulse_module_is_set_as_in_the_example() {
    let printed = <[u8; 6]>::try_from(bytes(&named_row("pulse-module-pd").content)).unwrap();
    let setting = StiffnessSetting::PositionLoop { p: 0x10, d: 0x10 };
    assert_eq!(setting.encode(FIRST_BYTE_OF_EXAMPLE), Ok(printed));
    assert_eq!(StiffnessSetting::decode(&printed), Ok((FIRST_BYTE_OF_EXAMPLE, setting)));
}
