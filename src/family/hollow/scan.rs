//! How a motor is found. No request of the manual leaves a motor on CAN alone: it answers commands, and every command changes what it
//! does. The gentlest is the one that stops it, which takes its torque; a person must ask for it. In the Modbus mode of the converter
//! the registers are read, which shows the last reply.

use std::ops::RangeInclusive;

use takt_rt::{Frame, FrameKind, Id};
use takt_wire::hollow_lines::motor_data::DATA_BYTES;
use takt_wire::hollow_lines::registers::{BAUD_RATE, FIRST_ADDRESS, from_registers};
use takt_wire::modbus::frame::RegisterRange;
use takt_wire::modbus::master::{RequestError, RequestFailure};

use crate::family::scan::{Answered, FoundDevice, OwnProtocol, Reading, ScanSession, StartingKeys};
use crate::procedure::ModbusSession;

use super::{CAN, CAN_FD};

/// Motor IDs. 100 is the identifier of replies, as motors come.
const MOTORS: RangeInclusive<u8> = 1..=99;
/// CANopen begins behind these identifiers, beside NMT. Replies are expected there.
const BELOW_CANOPEN: u32 = 0x80;
/// From here on no motor has its commands.
const MASTER_IDS: u32 = 100;
/// The frame that stops a motor (section 3.3 of the manual).
const STOP: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD];
/// What stopping does.
const CONSEQUENCE: &str = "a motor that has torque loses it, and what it holds may fall";

/// The bytes of a frame below CANopen, with its identifier.
fn low_frame(frame: &Frame) -> Option<(u32, &[u8])> {
    let id = frame.id().value();
    let is_low = !frame.id().is_extended() && id < BELOW_CANOPEN && frame.kind() != FrameKind::Remote;
    is_low.then(|| (id, frame.payload()))
}

/// Motors over CAN, in normal and in extended mode.
#[derive(Clone, Copy, Debug)]
pub struct CanScan;

const CAN_NAME: &str = "motor commands on CAN";
const ALIKE: &str =
    "a motor in MIT mode answers alike (drive = \"bit-fields\"): its name plate tells which it is";

impl OwnProtocol for CanScan {
    fn name(&self) -> &'static str {
        CAN_NAME
    }

    fn nodes(&self) -> RangeInclusive<u8> {
        MOTORS
    }

    fn question(&self, node: u8) -> Option<Frame> {
        Some(Frame::of(Id::canopen(0, node), STOP))
    }

    /// Six bytes in normal mode. Eight in extended mode, as many as a command has, which is told apart by its identifier.
    fn replying(&self, frame: &Frame) -> Option<u8> {
        let (id, payload) = low_frame(frame).filter(|_| !frame.is_fd())?;
        let is_reply = payload.len() == 6 || (payload.len() == 8 && id >= MASTER_IDS);
        payload.first().copied().filter(|node| is_reply && MOTORS.contains(node))
    }

    fn consequence(&self) -> Option<&'static str> {
        Some(CONSEQUENCE)
    }

    fn read<'a>(&'a self, _: &'a ScanSession, node: u8, reply: Frame) -> Reading<'a> {
        Box::pin(async move {
            let mut device = motor(node, Answered::Own(CAN_NAME));
            let mode = if reply.payload().len() == 6 { "in normal mode" } else { "in extended mode" };
            device.kind = format!("{} {mode}", CAN.name);
            show_reply(&mut device, &reply);
            device.remark(ALIKE);
            device
        })
    }

    fn overheard(&self, node: u8) -> FoundDevice {
        let mut device = motor(node, Answered::Heard(CAN_NAME));
        device.remark(ALIKE);
        device
    }
}

fn show_reply(device: &mut FoundDevice, reply: &Frame) {
    let id = reply.id().value();
    device.reply_id = Some(id);
    device.remark(format!("its replies have the identifier 0x{id:03X}"));
}

fn motor(node: u8, answered: Answered) -> FoundDevice {
    let mut device = FoundDevice::new(Some(node), answered, CAN.name);
    device.drive = Some(CAN.word);
    device
}

/// Motors over CAN FD.
#[derive(Clone, Copy, Debug)]
pub struct FdScan;

const FD_NAME: &str = "motor commands on CAN FD";

impl OwnProtocol for FdScan {
    fn name(&self) -> &'static str {
        FD_NAME
    }

    fn nodes(&self) -> RangeInclusive<u8> {
        MOTORS
    }

    /// All bytes 0: stop and free, in torque mode, without a current (section 4.1 of the manual).
    fn question(&self, node: u8) -> Option<Frame> {
        Frame::fd(Id::canopen(0, node), &[0; DATA_BYTES], false).ok()
    }

    /// The last byte is the motor's ID. In a command it sets the zero, and is 0 or 1.
    fn replying(&self, frame: &Frame) -> Option<u8> {
        let (id, payload) = low_frame(frame).filter(|_| frame.is_fd())?;
        let data: &[u8; DATA_BYTES] = payload.try_into().ok()?;
        data.last().copied().filter(|node| MOTORS.contains(node) && u32::from(*node) != id)
    }

    fn consequence(&self) -> Option<&'static str> {
        Some(CONSEQUENCE)
    }

    fn read<'a>(&'a self, _: &'a ScanSession, node: u8, reply: Frame) -> Reading<'a> {
        Box::pin(async move {
            let mut device = fd_motor(node, Answered::Own(FD_NAME));
            show_reply(&mut device, &reply);
            device
        })
    }

    fn overheard(&self, node: u8) -> FoundDevice {
        fd_motor(node, Answered::Heard(FD_NAME))
    }
}

fn fd_motor(node: u8, answered: Answered) -> FoundDevice {
    let mut device = FoundDevice::new(Some(node), answered, CAN_FD.name);
    device.drive = Some(CAN_FD.word);
    device
}

/// Looks whether a slave is the converter in its Modbus mode, with a motor: 16 registers of a byte each and no more, the last of which is
/// the ID of the motor, once that has been commanded.
pub async fn look(session: &ModbusSession, bit_rate: u32) -> Option<FoundDevice> {
    if bit_rate != BAUD_RATE {
        return None;
    }
    let node = session.slave().number();
    let range = |count| RegisterRange::new(FIRST_ADDRESS, count);
    let values = session.read_registers(range(DATA_BYTES as u16)?).await.ok()?;
    let data = from_registers(values.as_slice().try_into().ok()?).ok()?;
    let is_fresh = data == [0; DATA_BYTES];
    let [.., own] = data;
    if !is_fresh && own != node {
        return None;
    }
    let further = session.read_registers(range(DATA_BYTES as u16 + 1)?).await;
    if !matches!(further, Err(RequestError { failure: RequestFailure::Refused(_), .. })) {
        return None;
    }
    let mut device = FoundDevice::new(Some(node), Answered::Modbus { bit_rate }, CAN_FD.name);
    device.drive = Some(CAN_FD.word);
    device.remark(
        "it is behind a converter in its Modbus mode, which is too slow for an axis; with one of its switches on, the converter is a bus: \
         rs485-canfd:/dev/ttyUSB0",
    );
    if is_fresh {
        device.remark(
            "it has not been commanded since it was switched on: the converter has no reply of it yet",
        );
    }
    Some(device)
}

/// The keys of an axis that are those of the motor's data sheet.
pub fn starting_keys(found: &FoundDevice) -> Option<StartingKeys> {
    let (Answered::Own(name) | Answered::Heard(name)) = found.answered else { return None };
    let master_id = match found.reply_id {
        Some(id) => format!("master_id = 0x{id:03X}  # every motor needs its own"),
        None => {
            "master_id = 0x065  # YOURS: the identifier of its replies; every motor needs its own".to_owned()
        }
    };
    let mut axis = vec![master_id];
    if name == FD_NAME {
        axis.push("pole_pairs = 14  # YOURS: by the data sheet of the motor".to_owned());
        axis.push("kp = 100  # YOURS: of 255\nkd = 20  # YOURS: of 255".to_owned());
    } else {
        axis.extend([
            "position_full_scale = \"1 turn\"  # Pmax of the motor".to_owned(),
            "velocity_full_scale = \"200 rad/s\"  # YOURS: by the data sheet of the motor".to_owned(),
            "current_full_scale = 10  # YOURS: A, by the data sheet of the motor".to_owned(),
            "kp = 2000  # YOURS: of 4095\nkd = 500  # YOURS: of 4095".to_owned(),
        ]);
    }
    axis.push("torque_constant = 0.23  # YOURS: N·m/A, by the data sheet of the motor".to_owned());
    if found.kind.contains("extended") {
        axis.push("extended = true".to_owned());
    }
    Some(StartingKeys { axis, ..StartingKeys::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(id: u32, bytes: &[u8]) -> Frame {
        Frame::data(Id::base(id).unwrap(), bytes).unwrap()
    }

    #[test]
    fn replies_are_told_from_commands_by_length_and_identifier() {
        let normal = frame(0x64, &[7, 0x80, 0, 0x80, 8, 0]);
        assert_eq!(CanScan.replying(&normal), Some(7));
        let extended = frame(0x65, &[7, 0x80, 0, 0x80, 8, 0, 0, 0]);
        assert_eq!(CanScan.replying(&extended), Some(7));
        let command = frame(7, &[7, 0x80, 0, 0x80, 8, 0, 0, 0]);
        assert_eq!(CanScan.replying(&command), None);
        assert_eq!(CanScan.replying(&CanScan.question(7).unwrap()), None);
        assert_eq!(CanScan.replying(&frame(0x181, &[7, 0, 0, 0, 0, 0])), None);
    }

    #[test]
    fn no_question_starts_a_motor() {
        assert_eq!(format!("{:?}", CanScan.question(7).unwrap()), "007#FFFFFFFFFFFFFFFD");
        let fd = FdScan.question(7).unwrap();
        assert_eq!((fd.payload(), FdScan.replying(&fd)), (&[0; 16][..], None), "run is 0, and zero is 0");
        assert!(CanScan.consequence().is_some() && FdScan.consequence().is_some());
    }
}
