//! The complete module: it receives requests and time, moves its joint, and replies.

use takt_rt::{Frame, Nanoseconds};
use takt_wire::modbus::exception::ExceptionCode;
use takt_wire::modbus::frame::{LongRead, ReceivedRequest, RegisterRange, Request, Values, reply_frame};

use super::registers::{
    BIT_RATE, COMMUNICATION_TIMEOUT, OPERATION_MODE, SLAVE_ADDRESS, Settings, TARGET_CURRENT, TARGET_VELOCITY,
};
use crate::commanded_module::{CommandedModule, ModuleParameters, NotEnabled};
use crate::defect::{Defect, Unsupported};
use crate::drive::{Drive, DriveFault, Observation};
use crate::mailbox::Mailbox;
use crate::plant::Gravity;

/// From enabling until a motion can start: until then a start is taken and does nothing.
const ENABLING_NS: Nanoseconds = 500_000_000;
/// Behind the last register.
const FIRST_BEYOND: u16 = 0x0100;
/// The fault of a master that is silent.
const TIMEOUT_FAULT: u16 = 0x0FA2;

/// What a simulated module is made with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErobModbusParameters {
    /// The address of the slave, 1 to 247.
    pub address: u8,
    /// The code of its bit rate: register 0x0001.
    pub bit_rate_code: u16,
    /// The module without its protocol.
    pub module: ModuleParameters,
    /// From a request to its reply. Not published.
    pub reply_ns: Nanoseconds,
    /// True if it has a torque sensor.
    pub has_torque_sensor: bool,
}

/// A simulated module.
#[derive(Clone, Debug)]
pub struct ErobModbusDrive {
    parameters: ErobModbusParameters,
    /// What it listens to: new values count after the next power-on.
    address: u8,
    bit_rate_code: u16,
    settings: Settings,
    module: CommandedModule,
    reply: Option<(Nanoseconds, Vec<u8>)>,
    /// When the master was heard last; `None` before the first request.
    heard_ns: Option<Nanoseconds>,
}

impl ErobModbusDrive {
    /// A module whose supply is switched on at time 0.
    pub fn new(parameters: ErobModbusParameters) -> Self {
        let ErobModbusParameters { address, bit_rate_code, module, .. } = parameters;
        let settings = Settings::new(address, bit_rate_code);
        let module = CommandedModule::new(module, settings.of_module());
        Self { parameters, address, bit_rate_code, settings, module, reply: None, heard_ns: None }
    }

    /// The bit rate that it listens to: bit/s.
    pub const fn bit_rate(&self) -> u32 {
        match self.bit_rate_code {
            1 => 9_600,
            2 => 19_200,
            3 => 38_400,
            _ => 115_200,
        }
    }

    /// Takes a request whose last byte has come. Those of other slaves are ignored.
    pub fn receive(&mut self, now_ns: Nanoseconds, frame: &[u8]) {
        self.run_until(now_ns);
        // 1 to 127 registers (manual 1.5, reading of registers).
        if let Some(read) = LongRead::decode(frame).filter(|read| read.slave.number() == self.address) {
            self.heard_ns = Some(now_ns);
            let addresses = read.start..=read.start + (read.count - 1);
            // No such range is without gaps: these are zero.
            let value = |address| self.shown(address).or((address < FIRST_BEYOND).then_some(0));
            let values: Option<Values> = addresses.map(value).collect();
            if let Some(values) = values.filter(|_| !self.module.is_silent()) {
                self.reply = Some((now_ns.saturating_add(self.parameters.reply_ns), read.reply(&values)));
                return;
            }
        }
        let Some(ReceivedRequest { address, request }) = ReceivedRequest::decode(frame) else { return };
        let is_for_all = address == 0;
        if !is_for_all && address != self.address {
            return;
        }
        self.heard_ns = Some(now_ns);
        let outcome = match request {
            Ok(Request::Read(range)) if !is_for_all => self.read(range),
            Ok(Request::Read(_)) => return,
            Ok(Request::WriteOne { register, value }) => self.write(now_ns, register, &[value]),
            Ok(Request::WriteSeveral(write)) => self.write(now_ns, write.start(), write.values()),
            Err(code) => Err(code),
        };
        let outcome = outcome.as_ref().map(Values::as_slice).map_err(|code| *code);
        if let Some(reply) = reply_frame(frame, outcome).filter(|_| !self.module.is_silent()) {
            self.reply = Some((now_ns.saturating_add(self.parameters.reply_ns), reply));
        }
    }

    /// Advances to a time. Returns a reply whose first byte is due by then, and when that is.
    pub fn reply_by(&mut self, now_ns: Nanoseconds) -> Option<(Nanoseconds, Vec<u8>)> {
        self.run_until(now_ns);
        self.reply.take_if(|(due_ns, _)| *due_ns <= now_ns)
    }

    fn read(&self, range: RegisterRange) -> Result<Values, ExceptionCode> {
        let addresses = range.start()..=range.start() + (range.count() - 1);
        addresses.map(|address| self.shown(address).ok_or(ExceptionCode::ILLEGAL_ADDRESS)).collect()
    }

    fn write(&mut self, now_ns: Nanoseconds, start: u16, words: &[u16]) -> Result<Values, ExceptionCode> {
        match (start, words) {
            (0x00F0..=0x00F4 | 0x00F6 | 0x00F7 | 0x00F9, [value]) => self.command(now_ns, start, *value)?,
            _ => {
                self.settings.write(start, words, self.module.is_enabled())?;
                self.module.take_settings(self.settings.of_module());
            }
        }
        Ok(Values::new())
    }

    fn command(&mut self, now_ns: Nanoseconds, register: u16, value: u16) -> Result<(), ExceptionCode> {
        match (register, value) {
            (0x00F0, 0) => self.module.disable(),
            (0x00F0, 1) => self.module.enable(now_ns).map_err(|error| match error {
                NotEnabled::Starting => ExceptionCode::BUSY,
                NotEnabled::Faulted => ExceptionCode::DEVICE_FAILURE,
            })?,
            (0x00F0, _) | (0x00F6, 0) => return Err(ExceptionCode::ILLEGAL_VALUE),
            (0x00F1, _) => self.start(now_ns)?,
            (0x00F2, _) => {
                self.module.stop();
                self.end_set_point();
            }
            (0x00F3, _) => {
                self.module.stop_in_an_emergency();
                self.end_set_point();
            }
            (0x00F4, _) => self.module.end_reciprocation(),
            (0x00F6, _) => self.module.clear_fault(),
            (0x00F7, _) => self.module.save(now_ns),
            _ => self.module.reset_encoder(),
        }
        Ok(())
    }

    fn start(&mut self, now_ns: Nanoseconds) -> Result<(), ExceptionCode> {
        match self.module.enabled_ns(now_ns) {
            Some(enabled_ns) if enabled_ns < ENABLING_NS && self.settings.get(OPERATION_MODE) == 3 => Ok(()),
            _ => self.module.start().map_err(|_| ExceptionCode::DEVICE_FAILURE),
        }
    }

    /// What a stop does beside position control: torque control is also disabled.
    fn end_set_point(&mut self) {
        match self.settings.get(OPERATION_MODE) {
            1 if self.module.is_enabled() => {
                self.settings.set(TARGET_CURRENT, 0);
                self.module.disable();
            }
            2 if self.module.is_enabled() => self.settings.set(TARGET_VELOCITY, 0),
            _ => return,
        }
        self.module.take_settings(self.settings.of_module());
    }

    /// What a read of an address brings.
    fn shown(&self, address: u16) -> Option<u16> {
        let module = &self.module;
        let milliamperes = module.milliamperes().round() as i32;
        let demand = module.motion().map_or(module.counts(), |motion| motion.position().round() as i32);
        let demanded_velocity = module.demanded_velocity().round() as i32;
        let velocity = module.velocity().round() as i32;
        // The first register of two, and the number in them.
        let (start, number) = match address {
            0x0060 => return Some(module.fault()),
            0x0061 => return Some(self.motion_status()),
            0x0063 => return Some(module.reached_status()),
            0x0064 | 0x0065 => (0x0064, demand),
            0x0066 | 0x0067 => (0x0066, module.counts()),
            0x0068 | 0x0069 => (0x0068, demand.wrapping_sub(module.counts())),
            0x006C | 0x006D => (0x006C, demanded_velocity),
            0x006E | 0x006F => (0x006E, velocity),
            0x0070 | 0x0071 => (0x0070, demanded_velocity.wrapping_sub(velocity)),
            0x0072..=0x0075 => (address & !1, milliamperes),
            0x0076 | 0x0077 => (0x0076, 48_000),
            0x0078 => return Some(35),
            0x007B | 0x007C if self.parameters.has_torque_sensor => {
                (0x007B, (1000.0 * module.torque()).round() as i32)
            }
            0x007D | 0x007E => (0x007D, module.twist()),
            _ => return self.settings.word(address),
        };
        let number = number.cast_unsigned();
        Some(if address == start { (number >> 16) as u16 } else { number as u16 })
    }

    fn motion_status(&self) -> u16 {
        match self.module.motion() {
            Some(motion) if motion.has_ended_reciprocation() => 3,
            _ => self.module.is_moving().into(),
        }
    }

    /// What the motor does when the master is silent is in no manual. Here its power is cut, and the brake engages.
    fn supervise_the_master(&mut self, now_ns: Nanoseconds) {
        let most_ms = u64::try_from(self.settings.get(COMMUNICATION_TIMEOUT)).unwrap_or(0);
        let Some(heard_ns) = self.heard_ns.filter(|_| most_ms > 0) else { return };
        let silent_ns = heard_ns.saturating_add(most_ms * 1_000_000);
        if now_ns > silent_ns && self.module.fault() == 0 {
            self.module.run_until(silent_ns);
            // It is armed again by the next request.
            self.heard_ns = None;
            self.module.fail(TIMEOUT_FAULT);
        }
    }

    fn run_until(&mut self, now_ns: Nanoseconds) {
        self.supervise_the_master(now_ns);
        self.module.run_until(now_ns);
        if self.module.has_saved(now_ns) {
            self.settings.save();
        }
    }
}

/// Its place on a simulated bus, of which it hears nothing: its joint is there, loads and faults reach it.
impl Drive for ErobModbusDrive {
    fn node(&self) -> u8 {
        self.address
    }

    fn receive(&mut self, _: Nanoseconds, _: &Frame, _: &mut Mailbox) {}

    fn advance(&mut self, now_ns: Nanoseconds, _: &mut Mailbox) {
        self.run_until(now_ns);
    }

    fn wake_ns(&self) -> Nanoseconds {
        self.module.wake_ns()
    }

    fn observe(&mut self, now_ns: Nanoseconds) -> Observation {
        self.run_until(now_ns);
        self.module.observe()
    }

    fn inject_fault(&mut self, fault: DriveFault) {
        self.module.inject_fault(fault);
    }

    /// It starts with its saved parameters.
    fn power_cycle(&mut self, now_ns: Nanoseconds, _: &mut Mailbox) {
        self.run_until(now_ns);
        self.settings.restore();
        self.address = u8::try_from(self.settings.get(SLAVE_ADDRESS)).unwrap_or(self.address);
        self.bit_rate_code = self.settings.get(BIT_RATE) as u16;
        (self.reply, self.heard_ns) = (None, None);
        self.module.power_cycle(now_ns, self.settings.of_module());
    }

    fn set_gravity(&mut self, gravity: Gravity) {
        self.module.set_gravity(gravity);
    }

    fn set_load_torque(&mut self, torque: f64) {
        self.module.set_load_torque(torque);
    }

    fn inject_defect(&mut self, _: Nanoseconds, defect: Defect, is_present: bool) -> Result<(), Unsupported> {
        self.module.inject_defect(defect, is_present)
    }
}
