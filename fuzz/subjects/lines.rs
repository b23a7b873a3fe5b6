//! Fuzzes every decoder of a serial line with arbitrary bytes.

use takt_rt::slcan::{AdapterLine, HostLine, LineReader, encode_frame};
use takt_wire::hollow_lines::console::{ConsoleCommand, ConsoleReader, TERMINATOR};
use takt_wire::hollow_lines::encoder::EncoderReading;
use takt_wire::hollow_lines::motor_data::{MotorCommand, MotorReply};
use takt_wire::hollow_lines::pulse_module::StiffnessSetting;
use takt_wire::hollow_lines::transparent::{FrameReader, TransparentFrame};

/// What is decoded can be encoded, and gives the same again. After any bytes, the next line is read.
pub fn run(bytes: &[u8]) {
    slcan(bytes);
    transparent(bytes);
    console(bytes);
    if let Some(setting) = bytes.first_chunk()
        && let Ok((first, setting)) = StiffnessSetting::decode(setting)
    {
        let bytes = setting.encode(first).unwrap();
        assert_eq!(StiffnessSetting::decode(&bytes), Ok((first, setting)));
    }
}

fn transparent(bytes: &[u8]) {
    let mut reader = FrameReader::default();
    let frames = bytes.iter().filter_map(|byte| reader.push(*byte)).collect::<Vec<_>>();
    for frame in frames {
        assert_eq!(TransparentFrame::decode(&frame.encode()), Some(frame));
        EncoderReading::of(&frame).angle();
        data(&frame.data);
    }
    bytes.as_chunks().0.iter().for_each(data);
    let last = TransparentFrame { id: 1, data: [0xA5; 16] };
    let found = last.encode().into_iter().filter_map(|byte| reader.push(byte)).last();
    assert_eq!(found, Some(last), "the frame behind any bytes is read");
}

fn data(data: &[u8; 16]) {
    if let Ok(command) = MotorCommand::decode(data) {
        assert_eq!(command.encode(), Ok(*data));
    }
    if let Ok(reply) = MotorReply::decode(data) {
        assert_eq!(MotorReply::decode(&reply.encode().unwrap()), Ok(reply));
    }
}

fn console(bytes: &[u8]) {
    let mut reader = ConsoleReader::default();
    for line in bytes.iter().filter_map(|byte| reader.push(*byte)) {
        let Ok(command) = ConsoleCommand::decode(&line) else { continue };
        // Numbers are typed to thousandths: what was typed once is typed the same again.
        let typed = command.encode().unwrap();
        let again = ConsoleCommand::decode(typed.strip_suffix(TERMINATOR).unwrap()).unwrap();
        assert_eq!(again.encode(), Ok(typed));
    }
}

fn slcan(bytes: &[u8]) {
    let mut reader = LineReader::default();
    for byte in bytes.iter().chain(b"\rt1230\r") {
        let Some(line) = reader.push(*byte) else { continue };
        let from_adapter = AdapterLine::decode(line);
        match HostLine::decode(line) {
            Ok(HostLine::Frame(frame)) => {
                assert_eq!(from_adapter, Ok(AdapterLine::Frame(frame)));
                assert_eq!(last_line(&encode_frame(&frame)), Some(HostLine::Frame(frame)));
            }
            Ok(HostLine::Command(command)) => {
                assert_eq!(last_line(&command.text()), Some(HostLine::Command(command)));
            }
            Ok(HostLine::Empty) | Err(_) => assert!(!matches!(from_adapter, Ok(AdapterLine::Frame(_)))),
        }
    }
    assert!(reader.push(b'\r').is_some(), "an empty line ends the reading");
}

fn last_line(bytes: &[u8]) -> Option<HostLine> {
    let mut reader = LineReader::default();
    let mut last = None;
    for byte in bytes {
        last = reader.push(*byte).and_then(|line| HostLine::decode(line).ok());
    }
    last
}
