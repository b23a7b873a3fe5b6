//! The RS-485 module in transparent mode, with motors behind it.

use std::collections::VecDeque;

use takt_rt::Nanoseconds;
use takt_wire::hollow_lines::motor_data::MotorCommand;
use takt_wire::hollow_lines::transparent::{FrameReader, TransparentFrame};

use super::motor::Motor;
use crate::serial_device::SerialDevice;

/// The time from a request to the reply of a motor.
const REPLY_NS: Nanoseconds = 500_000;
/// The identifier that motors reply to, by default.
const MASTER: u8 = 100;

/// A module with motors behind it. A motor replies to its own identifier alone; nothing replies to another one.
pub struct Bridge {
    reader: FrameReader,
    motors: Vec<Motor>,
    /// Motors that will reply, by their index, with the time of the reply.
    replying: VecDeque<(Nanoseconds, usize)>,
}

impl Bridge {
    /// A module with a motor of each identifier.
    pub fn new(ids: &[u8]) -> Self {
        let motors = ids.iter().map(|id| Motor::new(*id)).collect();
        Self { reader: FrameReader::default(), motors, replying: VecDeque::new() }
    }
}

impl SerialDevice for Bridge {
    fn receive(&mut self, now_ns: Nanoseconds, byte: u8, _answer: &mut Vec<u8>) {
        let Some(frame) = self.reader.push(byte) else { return };
        // A motor does not reply to what it does not understand.
        let Ok(command) = MotorCommand::decode(&frame.data) else { return };
        let addressed = self.motors.iter_mut().enumerate().find(|(_, motor)| motor.id() == frame.id);
        if let Some((index, motor)) = addressed {
            motor.obey(now_ns, command);
            self.replying.push_back((now_ns + REPLY_NS, index));
        }
    }

    fn advance(&mut self, now_ns: Nanoseconds, answer: &mut Vec<u8>) -> Nanoseconds {
        self.motors.iter_mut().for_each(|motor| motor.advance(now_ns));
        while let Some((_, index)) = self.replying.front().copied().filter(|(due_ns, _)| *due_ns <= now_ns) {
            self.replying.pop_front();
            let data = self.motors.get(index).and_then(|motor| motor.reply().encode().ok());
            answer.extend(data.into_iter().flat_map(|data| TransparentFrame { id: MASTER, data }.encode()));
        }
        self.replying.front().map_or(Nanoseconds::MAX, |(due_ns, _)| *due_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_wire::hollow_lines::motor_data::{MotorMode, MotorReply, MotorRun};

    fn replies(bridge: &mut Bridge, now_ns: Nanoseconds, id: u8, command: MotorCommand) -> Vec<MotorReply> {
        let mut answer = vec![];
        let request = TransparentFrame { id, data: command.encode().unwrap() };
        request.encode().into_iter().for_each(|byte| bridge.receive(now_ns, byte, &mut answer));
        bridge.advance(now_ns + REPLY_NS - 1, &mut answer);
        assert!(answer.is_empty(), "a motor needs its time");
        bridge.advance(now_ns + REPLY_NS, &mut answer);
        let mut reader = FrameReader::default();
        let frames: Vec<TransparentFrame> = answer.into_iter().filter_map(|byte| reader.push(byte)).collect();
        assert!(frames.iter().all(|frame| frame.id == MASTER));
        frames.iter().map(|frame| MotorReply::decode(&frame.data).unwrap()).collect()
    }

    #[test]
    fn a_motor_is_moved_and_replies_and_an_unknown_one_is_silent() {
        let mut bridge = Bridge::new(&[1, 2]);
        let go = MotorCommand {
            position: 20_000,
            velocity: 1 << 20,
            mode: MotorMode::Position,
            run: MotorRun::Run,
            ..MotorCommand::default()
        };
        let first = replies(&mut bridge, 0, 2, go);
        assert_eq!((first.len(), first[0].id, first[0].is_running), (1, 2, true));
        let later = replies(&mut bridge, 1_000_000_000, 2, go);
        assert_eq!((later[0].position, later[0].mode), (20_000, MotorMode::Position));
        assert_eq!(replies(&mut bridge, 2_000_000_000, 1, MotorCommand::default())[0].position, 0);
        assert_eq!(replies(&mut bridge, 3_000_000_000, 3, MotorCommand::default()), []);
    }
}
