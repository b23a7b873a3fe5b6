//! The RS-485 module in its Modbus mode, with motors behind it: 16 registers for the 16 bytes of a frame.
//!
//! A write of all registers is a command to the motor of that address. A read returns the last reply of the motor; before the first
//! write there is none, and all registers are zero.

use std::collections::VecDeque;

use takt_rt::Nanoseconds;
use takt_wire::hollow_lines::motor_data::{DATA_BYTES, MotorCommand};
use takt_wire::hollow_lines::registers::{BAUD_RATE, FIRST_ADDRESS, from_registers, to_registers};
use takt_wire::modbus::exception::ExceptionCode;
use takt_wire::modbus::frame::{ReceivedRequest, Request, reply_frame};
use takt_wire::modbus::line_timing::LineTiming;
use takt_wire::modbus::request_gathering::RequestGathering;

use super::motor::Motor;
use crate::serial_device::SerialDevice;

/// The time from a request to its reply.
const REPLY_NS: Nanoseconds = 1_000_000;
/// A program on a pseudo-terminal may write a frame in pieces so far apart.
const PAUSE_NS: Nanoseconds = 20_000_000;

/// A module with motors behind it.
pub struct RegisterBridge {
    gathering: RequestGathering,
    /// Each with its last reply.
    motors: Vec<(Motor, [u8; DATA_BYTES])>,
    replies: VecDeque<(Nanoseconds, Vec<u8>)>,
}

impl RegisterBridge {
    /// A module with a motor of each identifier.
    pub fn new(ids: &[u8]) -> Self {
        Self {
            gathering: RequestGathering::lenient(LineTiming::new(BAUD_RATE), PAUSE_NS),
            motors: ids.iter().map(|id| (Motor::new(*id), [0; DATA_BYTES])).collect(),
            replies: VecDeque::new(),
        }
    }

    /// What the motor of that address makes of a request; `None` where no motor has it.
    fn answer(
        &mut self,
        now_ns: Nanoseconds,
        received: ReceivedRequest,
    ) -> Option<Result<Vec<u16>, ExceptionCode>> {
        let (motor, last) = self.motors.iter_mut().find(|(motor, _)| received.address == motor.id())?;
        motor.advance(now_ns);
        let request = match received.request {
            Ok(request) => request,
            Err(code) => return Some(Err(code)),
        };
        let all = |start: u16, count: usize| start == FIRST_ADDRESS && count == DATA_BYTES;
        Some(match request {
            Request::Read(range) if usize::from(range.start() + range.count()) <= DATA_BYTES => {
                let registers = to_registers(last);
                let from = usize::from(range.start());
                Ok(registers.get(from..from + usize::from(range.count())).unwrap_or_default().to_vec())
            }
            Request::Read(_) => Err(ExceptionCode::ILLEGAL_ADDRESS),
            Request::WriteSeveral(values) if all(values.start(), values.values().len()) => {
                let data =
                    values.values().try_into().ok().and_then(|registers| from_registers(registers).ok());
                match data.map(|data| MotorCommand::decode(&data)) {
                    Some(Ok(command)) => {
                        motor.obey(now_ns, command);
                        *last = motor.reply().encode().unwrap_or(*last);
                        Ok(vec![])
                    }
                    _ => Err(ExceptionCode::ILLEGAL_VALUE),
                }
            }
            Request::WriteSeveral(_) => Err(ExceptionCode::ILLEGAL_ADDRESS),
            // The manual names the functions 03 and 10 alone.
            _ => Err(ExceptionCode::ILLEGAL_FUNCTION),
        })
    }
}

impl SerialDevice for RegisterBridge {
    fn receive(&mut self, now_ns: Nanoseconds, byte: u8, _answer: &mut Vec<u8>) {
        let Some(bytes) = self.gathering.receive(now_ns, &[byte]) else { return };
        let Some(received) = ReceivedRequest::decode(&bytes) else { return };
        if let Some(outcome) = self.answer(now_ns, received) {
            let outcome = outcome.as_ref().map(Vec::as_slice).map_err(|code| *code);
            self.replies.extend(reply_frame(&bytes, outcome).map(|reply| (now_ns + REPLY_NS, reply)));
        }
    }

    fn advance(&mut self, now_ns: Nanoseconds, answer: &mut Vec<u8>) -> Nanoseconds {
        self.motors.iter_mut().for_each(|(motor, _)| motor.advance(now_ns));
        while self.replies.front().is_some_and(|(due_ns, _)| *due_ns <= now_ns) {
            let reply = self.replies.pop_front().map(|(_, reply)| reply);
            self.gathering.hear(now_ns);
            answer.extend(reply.into_iter().flatten());
        }
        self.replies.front().map_or(Nanoseconds::MAX, |(due_ns, _)| *due_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(bridge: &mut RegisterBridge, now_ns: Nanoseconds, request: &[u8]) -> Vec<u8> {
        let mut answer = vec![];
        request.iter().for_each(|byte| bridge.receive(now_ns, *byte, &mut answer));
        bridge.advance(now_ns + REPLY_NS, &mut answer);
        answer
    }

    #[test]
    fn it_answers_the_frames_of_the_manual() {
        let mut bridge = RegisterBridge::new(&[1]);
        let write = [&[1, 0x10, 0, 0, 0, 0x10, 0x20][..], &[0; 32], &[0x83, 0xBC]].concat();
        assert_eq!(answer(&mut bridge, 0, &write), [1, 0x10, 0, 0, 0, 0x10, 0xC1, 0xC5]);
        let read = answer(&mut bridge, 100_000_000, &[1, 3, 0, 0, 0, 0x10, 0x44, 6]);
        assert_eq!(read.len(), 37);
        // Temperature and motor identifier.
        assert_eq!(read[31..35], [0, 30, 0, 1]);
    }

    #[test]
    fn another_address_is_silent_and_another_function_or_register_is_refused() {
        let mut bridge = RegisterBridge::new(&[2]);
        assert!(answer(&mut bridge, 0, &[1, 3, 0, 0, 0, 0x10, 0x44, 6]).is_empty());
        let slave = takt_wire::modbus::frame::SlaveAddress::new(2).unwrap();
        let one = Request::WriteOne { register: 0, value: 1 }.frame(slave);
        assert_eq!(answer(&mut bridge, 100_000_000, &one)[1..3], [0x86, 1]);
        let beyond = Request::Read(takt_wire::modbus::frame::RegisterRange::new(8, 9).unwrap()).frame(slave);
        assert_eq!(answer(&mut bridge, 200_000_000, &beyond)[1..3], [0x83, 2]);
    }
}
