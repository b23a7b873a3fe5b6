//! The registers of a simulated drive, which a scan reads.

use takt_rt::{Frame, FrameKind, Nanoseconds};
use takt_wire::bit_fields::{
    DescribedScan, FieldDevice, RegisterByte, RegisterFrame, RegisterProtocol, RegisterScan,
};

/// The version of the firmware that a simulated drive tells.
const FIRMWARE: u32 = 1;

/// Answers reads of registers.
#[derive(Clone, Debug)]
pub struct RegisterServer {
    scan: Option<RegisterScan>,
    /// The answer that is on its way.
    answer: Option<(Nanoseconds, Frame)>,
}

impl RegisterServer {
    /// The server of a drive, which has registers where its description says so.
    pub fn new(device: &FieldDevice) -> Self {
        let scan = match &device.description.scan {
            Some(DescribedScan::Registers(scan)) => Some(scan.clone()),
            Some(DescribedScan::Heartbeat(_)) | None => None,
        };
        Self { scan, answer: None }
    }

    /// Forgets what is on its way.
    pub fn reset(&mut self) {
        self.answer = None;
    }

    /// When the answer is ready, if there is one.
    pub fn due_ns(&self) -> Option<Nanoseconds> {
        self.answer.map(|(due_ns, _)| due_ns)
    }

    /// Takes a frame. Returns whether it reads a register of this drive; its answer is ready at `due_ns`.
    pub fn take(&mut self, frame: &Frame, device: &FieldDevice, motor: u8, due_ns: Nanoseconds) -> bool {
        let Some(scan) = &self.scan else { return false };
        let answer = read_register(&scan.protocol, frame, device, motor)
            .and_then(|register| Some((register, value(scan, device, register)?)))
            .and_then(|(register, value)| answer(&scan.protocol.reply, device, motor, register, value));
        let is_read = answer.is_some();
        self.answer = answer.map(|answer| (due_ns, answer)).or(self.answer);
        is_read
    }

    /// The answer, once it is ready.
    pub fn poll(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        self.answer.take_if(|(due_ns, _)| *due_ns <= now_ns).map(|(_, frame)| frame)
    }
}

/// The register that a frame reads from this drive.
fn read_register(protocol: &RegisterProtocol, frame: &Frame, device: &FieldDevice, motor: u8) -> Option<u8> {
    let RegisterFrame { id, payload } = protocol.request;
    let bytes: &[u8; 8] = frame.payload().try_into().ok()?;
    if frame.kind() != FrameKind::Data || frame.id() != device.id(&id, motor) {
        return None;
    }
    let mut register = None;
    for (described, byte) in payload.into_iter().zip(bytes) {
        let is_it = match described {
            RegisterByte::Byte(own) => own == *byte,
            RegisterByte::Motor => motor == *byte,
            RegisterByte::Register => {
                register = Some(*byte);
                true
            }
            RegisterByte::Value => true,
        };
        if !is_it {
            return None;
        }
    }
    register
}

/// What a register has. The drive does not answer for one that it does not have.
fn value(scan: &RegisterScan, device: &FieldDevice, register: u8) -> Option<u32> {
    let RegisterScan { protocol, mode_is } = scan;
    if register == protocol.master_id {
        return device.settings.master_id.map(u32::from);
    }
    if register == protocol.mode {
        return Some(*mode_is);
    }
    if Some(register) == protocol.firmware {
        return Some(FIRMWARE);
    }
    let (setting, _) = protocol.settings.iter().find(|(_, own)| *own == register)?;
    device.settings.get(*setting).map(|number| (number as f32).to_bits())
}

fn answer(
    described: &RegisterFrame,
    device: &FieldDevice,
    motor: u8,
    register: u8,
    value: u32,
) -> Option<Frame> {
    let mut value = value.to_le_bytes().into_iter();
    let payload = described.payload.map(|byte| match byte {
        RegisterByte::Byte(byte) => byte,
        RegisterByte::Motor => motor,
        RegisterByte::Register => register,
        RegisterByte::Value => value.next().unwrap_or(0),
    });
    Frame::data(device.id(&described.id, motor), &payload).ok()
}
