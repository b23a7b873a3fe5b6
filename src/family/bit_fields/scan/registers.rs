//! Drives that are found by reading a register. Reading changes nothing in a drive, whether it has torque or not.

use std::ops::RangeInclusive;

use takt_rt::{Frame, FrameFormat, FrameKind, Id, Nanoseconds};
use takt_wire::bit_fields::{
    FieldDevice, RegisterByte, RegisterFrame, RegisterProtocol, RegisterScan, Setting,
};

use super::Make;
use crate::family::scan::{Answered, FoundDevice, OwnProtocol, Reading, ScanSession};

/// So long a drive may take for a reply.
const REPLY_NS: Nanoseconds = 50_000_000;
/// How often a register is read that does not come.
const ATTEMPTS: usize = 2;
/// What CANopen sends to all nodes: NMT, SYNC, TIME.
const OF_CANOPEN: [u16; 3] = [0x000, 0x080, 0x100];

/// Drives whose registers are read alike.
#[derive(Debug)]
pub struct RegisterDrives {
    name: &'static str,
    protocol: RegisterProtocol,
    /// The descriptions, by the mode of the drive.
    makes: Vec<(u32, Make)>,
}

/// What a frame tells of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Told {
    motor: u8,
    register: u8,
    value: u32,
}

/// The frame that reads a register of a drive.
fn request(frame: &RegisterFrame, motor: u8, register: u8) -> Option<Frame> {
    let payload = frame.payload.map(|byte| match byte {
        RegisterByte::Byte(byte) => byte,
        RegisterByte::Motor => motor,
        RegisterByte::Register => register,
        RegisterByte::Value | RegisterByte::Any => 0,
    });
    Some(Frame::of(frame.id.id(motor, 0)?, payload))
}

/// What a frame tells, if it has the bytes of an answer.
fn told(frame: &RegisterFrame, received: &Frame) -> Option<Told> {
    let is_data = received.kind() != FrameKind::Remote && !received.id().is_extended();
    let payload: [u8; 8] = received.payload().try_into().ok().filter(|_| is_data)?;
    let mut told = Told { motor: 0, register: 0, value: 0 };
    let mut shift = 0;
    for (byte, has) in frame.payload.into_iter().zip(payload) {
        match byte {
            RegisterByte::Byte(byte) if byte != has => return None,
            RegisterByte::Byte(_) | RegisterByte::Any => {}
            RegisterByte::Motor => told.motor = has,
            RegisterByte::Register => told.register = has,
            RegisterByte::Value => {
                told.value |= u32::from(has).checked_shl(shift)?;
                shift += 8;
            }
        }
    }
    Some(told)
}

impl RegisterDrives {
    /// Those of a description.
    pub fn new(scan: RegisterScan, make: Make) -> Self {
        let RegisterScan { protocol, mode_is } = scan;
        // There are as many as descriptions, once in the life of the process.
        Self { name: protocol.name.clone().leak(), protocol, makes: vec![(mode_is, make)] }
    }

    /// Returns `true` if its registers are read so.
    pub fn is_read_by(&self, protocol: &RegisterProtocol) -> bool {
        self.protocol == *protocol
    }

    /// Adds the description of another mode.
    pub fn add(&mut self, mode_is: u32, make: Make) {
        self.makes.push((mode_is, make));
    }

    /// What a frame tells, if it is an answer of such a drive.
    fn told(&self, frame: &Frame) -> Option<Told> {
        let told = told(&self.protocol.reply, frame)?;
        let is_read = self.protocol.registers().any(|register| register == told.register);
        let is_own = is_read && self.nodes().contains(&told.motor);
        let master = u16::try_from(told.value).ok();
        // The register with the master ID has the identifier by which it comes.
        let is_consistent = told.register != self.protocol.master_id
            || master.is_some_and(|master| self.protocol.reply.id.id(told.motor, master) == Some(frame.id()));
        (is_own && is_consistent).then_some(told)
    }

    /// Reads a register. `None` where the drive does not tell it.
    async fn register(&self, session: &ScanSession, motor: u8, register: u8) -> Option<u32> {
        for _ in 0..ATTEMPTS {
            if session.is_interrupted() {
                return None;
            }
            let is_it = |frame: &Frame| {
                self.told(frame).is_some_and(|told| told.motor == motor && told.register == register)
            };
            session.count_request_of(self.name, motor);
            let request = request(&self.protocol.request, motor, register)?;
            if let Some(reply) = session.ask(request, is_it, REPLY_NS).await {
                return self.told(&reply).map(|told| told.value);
            }
        }
        None
    }

    async fn tell(&self, session: &ScanSession, motor: u8, reply: &Frame) -> FoundDevice {
        session.step("read the registers");
        let mut device = self.device(motor, Answered::Own(self.name));
        if let Some(number) = self.protocol.firmware {
            let firmware = self.register(session, motor, number).await;
            device.firmware = firmware.map(|firmware| firmware.to_string());
        }
        let first = self.told(reply).filter(|told| told.register == self.protocol.master_id);
        let master = match first {
            Some(told) => Some(told.value),
            None => self.register(session, motor, self.protocol.master_id).await,
        };
        let mode = self.register(session, motor, self.protocol.mode).await;
        if session.is_interrupted() {
            return device;
        }
        let (Some(master), Some(mode)) = (master, mode) else {
            device
                .remark("it does not tell its mode and its master ID (it answers now and then): scan again");
            return device;
        };
        device.reply_id = Some(master);
        device.remark(format!("its replies have the identifier 0x{master:03X}"));
        if OF_CANOPEN.into_iter().any(|id| u32::from(id) == master) {
            device.remark("CANopen nodes take such replies for commands of their master: give it a master ID of its own");
        }
        // A motor that is set to CAN FD replies by such frames.
        let is_described =
            |make: &Make| (make.description().command.format != FrameFormat::Classic) == reply.is_fd();
        match self.makes.iter().find(|(mode_is, make)| *mode_is == mode && is_described(make)) {
            Some((_, make)) => {
                make.name(&mut device);
                device.axis_keys =
                    vec![make.line(), format!("master_id = 0x{master:03X}  # every motor needs its own")];
                for setting in FieldDevice::needed(make.description()) {
                    let line = self.setting(session, motor, setting, &mut device).await;
                    device.axis_keys.push(line);
                }
                device.axis_keys.extend(make.gains());
            }
            None => device.remark(format!("there is no description for its mode ({mode})")),
        }
        device
    }

    /// The line of an axis with a number that a configuration has to give.
    async fn setting(
        &self,
        session: &ScanSession,
        motor: u8,
        setting: Setting,
        device: &mut FoundDevice,
    ) -> String {
        let key = setting.key();
        let register = self.protocol.settings.iter().find(|(own, _)| *own == setting);
        let value = match register {
            Some((_, register)) => self.register(session, motor, *register).await,
            None => None,
        };
        match value.map(f32::from_bits).filter(|value| value.is_finite() && *value > 0.0) {
            Some(value) => format!("{key} = {}", with_unit(setting, value)),
            None => {
                if register.is_some() {
                    device.remark(format!("it does not tell its `{key}`"));
                }
                format!("{key} = {}  # YOURS: by the data sheet of the motor", with_unit(setting, 10.0))
            }
        }
    }

    fn device(&self, motor: u8, answered: Answered) -> FoundDevice {
        let mut device = FoundDevice::new(Some(motor), answered, "motor with registers");
        device.vendor = self.makes.first().map(|(_, make)| make.description().drive.vendor.clone());
        device
    }
}

/// A number of a configuration.
fn with_unit(setting: Setting, value: f32) -> String {
    match setting {
        Setting::PositionFullScale => format!("\"{value} rad\""),
        Setting::VelocityFullScale => format!("\"{value} rad/s\""),
        Setting::TorqueFullScale => format!("\"{value} Nm\""),
        _ => value.to_string(),
    }
}

impl OwnProtocol for RegisterDrives {
    fn name(&self) -> &'static str {
        self.name
    }

    fn nodes(&self) -> RangeInclusive<u8> {
        let ids = || self.makes.iter().map(|(_, make)| &make.description().motor_ids);
        let lowest = ids().map(|ids| *ids.start()).min();
        let highest = ids().map(|ids| *ids.end()).max();
        RangeInclusive::new(lowest.unwrap_or(1), highest.unwrap_or(0))
    }

    fn question(&self, node: u8) -> Option<Frame> {
        request(&self.protocol.request, node, self.protocol.master_id)
    }

    fn replying(&self, frame: &Frame) -> Option<u8> {
        self.told(frame).map(|told| told.motor)
    }

    fn is_commanded_by(&self, node: u8, id: Id) -> bool {
        self.makes.iter().any(|(_, make)| make.device.request_ids(node).contains(&id))
    }

    fn read<'a>(&'a self, session: &'a ScanSession, node: u8, reply: Frame) -> Reading<'a> {
        Box::pin(async move { self.tell(session, node, &reply).await })
    }

    fn overheard(&self, node: u8) -> FoundDevice {
        self.device(node, Answered::Heard(self.name))
    }
}
