//! The registers of a simulated drive: what they have, what may be written, and what outlives the power.

use takt_rt::{Frame, Nanoseconds};
use takt_wire::bit_fields::{
    DescribedScan, FieldDevice, IdExpression, Register, RegisterFile, RegisterFrame, RegisterRole, Setting,
};

/// What a frame asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// What a register has.
    Read {
        /// Its number.
        register: u8,
    },
    /// A register is to have this.
    Write {
        /// Its number.
        register: u8,
        /// Its bits.
        value: u32,
    },
    /// All registers are to outlive the power.
    Store,
    /// A reply as after a command.
    Status,
}

/// An answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegisterAnswer {
    /// Its identifier.
    pub id: IdExpression,
    /// Its bytes, and how many of them are sent.
    pub payload: [u8; 8],
    /// How many of them are sent.
    pub bytes: usize,
    /// How much longer than a reply it takes.
    pub extra_ns: Nanoseconds,
}

/// What the registers say of the drive itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Adopted {
    /// The motor ID.
    pub motor_id: Option<u8>,
    /// The identifier of the replies.
    pub master_id: Option<u16>,
    /// The mode.
    pub mode: Option<u32>,
}

/// The registers of a drive.
#[derive(Clone, Debug)]
pub struct RegisterServer {
    file: Option<RegisterFile>,
    /// The bits of each register of the file.
    values: Vec<u32>,
    stored: Vec<u32>,
    /// The code of the bit rate of the bus, where the drive has such a register and the bus one of its bit rates.
    bus_code: Option<u32>,
    /// What is asked at every step.
    time_out: Option<(Nanoseconds, u16)>,
    is_on_bus: bool,
}

impl RegisterServer {
    /// The registers of a drive with this motor ID on a bus with these bit rates, as its configuration says.
    pub fn new(device: &FieldDevice, motor: u8, bit_rates: Option<[u32; 2]>) -> Self {
        let Some(file) = device.register_file() else {
            return Self {
                file: None,
                values: vec![],
                stored: vec![],
                bus_code: None,
                time_out: None,
                is_on_bus: true,
            };
        };
        let mode = match &device.description.scan {
            Some(DescribedScan::Registers(scan)) => Some(scan.mode_is),
            _ => None,
        };
        let code = file.bit_rates.iter().find(|(_, rates)| Some(*rates) == bit_rates).map(|(code, _)| *code);
        let value = |register: &Register| {
            let number = match register.role {
                Some(RegisterRole::MasterId) => device.settings.master_id.map(f64::from),
                Some(RegisterRole::MotorId) => Some(motor.into()),
                Some(RegisterRole::Mode) => mode.map(f64::from),
                Some(RegisterRole::BitRate) => code.map(f64::from),
                Some(RegisterRole::Setting(setting)) if !is_gain(setting) => device.settings.get(setting),
                _ => None,
            };
            register.bits_of(number.unwrap_or(register.value))
        };
        let values: Vec<u32> = file.registers.iter().map(value).collect();
        let stored = values.clone();
        Self { file: Some(file), values, stored, bus_code: code, time_out: None, is_on_bus: true }
    }

    /// Forgets what is not stored.
    pub fn boot(&mut self) {
        self.values.copy_from_slice(&self.stored);
    }

    /// What a frame asks of the drive with this motor ID.
    pub fn asked(&self, device: &FieldDevice, frame: &Frame, motor: u8) -> Option<Asked> {
        let file = self.file.as_ref()?;
        let read = |described: &RegisterFrame| {
            let is_it = device.id(&described.id, motor) == frame.id();
            is_it.then(|| described.read(motor, frame.payload())).flatten()
        };
        if let Some(request) = read(&file.protocol.request) {
            return Some(Asked::Read { register: request.register? });
        }
        if let Some(request) = file.write.and_then(|write| read(&write.request)) {
            return Some(Asked::Write { register: request.register?, value: request.value });
        }
        if file.store.is_some_and(|store| read(&store.exchange.request).is_some()) {
            return Some(Asked::Store);
        }
        file.status.and_then(|status| read(&status)).map(|_| Asked::Status)
    }

    fn place(&self, number: u8) -> Option<(usize, &Register)> {
        let registers = &self.file.as_ref()?.registers;
        registers.iter().enumerate().find(|(_, register)| register.number == number)
    }

    /// What a register is for.
    pub fn role(&self, number: u8) -> Option<RegisterRole> {
        self.place(number)?.1.role
    }

    /// The bits of a register. `live`: what is measured.
    fn bits(&self, number: u8, live: Option<f64>) -> Option<u32> {
        let (place, register) = self.place(number)?;
        live.map(|number| register.bits_of(number)).or_else(|| self.values.get(place).copied())
    }

    fn answer(&self, frame: RegisterFrame, number: u8, live: Option<f64>) -> Option<RegisterAnswer> {
        let motor = self.motor_id().unwrap_or(0);
        let payload = frame.payload(motor, number, self.bits(number, live)?);
        Some(RegisterAnswer { id: frame.id, payload, bytes: payload.len(), extra_ns: 0 })
    }

    /// The answer to a read. A drive does not answer for a register that it does not have.
    pub fn read(&self, number: u8, live: Option<f64>) -> Option<RegisterAnswer> {
        self.answer(self.file.as_ref()?.protocol.reply, number, live)
    }

    /// The answer to a write: what the register has now.
    pub fn written(&self, number: u8, live: Option<f64>) -> Option<RegisterAnswer> {
        self.answer(self.file.as_ref()?.write?.reply, number, live)
    }

    /// Writes a register. Returns `true` if it has taken the value.
    pub fn write(&mut self, number: u8, bits: u32) -> bool {
        let Some((place, register)) = self.place(number) else { return false };
        let (is_right, bits) = (register.takes(bits), bits & register.mask);
        match self.values.get_mut(place).filter(|_| is_right) {
            Some(value) => {
                *value = bits;
                true
            }
            None => false,
        }
    }

    /// Stores all registers.
    pub fn store(&mut self) -> Option<RegisterAnswer> {
        let store = self.file.as_ref()?.store?;
        self.stored.copy_from_slice(&self.values);
        let frame = store.exchange.reply;
        let payload = frame.payload(self.motor_id().unwrap_or(0), 0, 0);
        Some(RegisterAnswer { id: frame.id, payload, bytes: store.reply_bytes, extra_ns: store.takes_ns })
    }

    fn number_with(&self, is_it: impl Fn(RegisterRole) -> bool) -> Option<f64> {
        let register = self.file.as_ref()?.with_role(is_it)?;
        Some(register.number_of(self.bits(register.number, None)?))
    }

    fn motor_id(&self) -> Option<u8> {
        // The drives here have motor IDs of eight bits.
        self.number_with(|role| role == RegisterRole::MotorId).map(|number| number as u32 as u8)
    }

    /// What the registers say of the drive itself.
    pub fn adopted(&mut self) -> Option<Adopted> {
        self.file.as_ref()?;
        self.time_out = self.read_time_out();
        let code = self.number_with(|role| role == RegisterRole::BitRate);
        self.is_on_bus = self.bus_code.is_none_or(|bus| code.is_none_or(|own| own == f64::from(bus)));
        let number = |role| self.number_with(|own| own == role);
        Some(Adopted {
            motor_id: self.motor_id(),
            master_id: number(RegisterRole::MasterId).map(|id| id as u16),
            mode: number(RegisterRole::Mode).map(|mode| mode as u32),
        })
    }

    /// The settings in registers, with their numbers, and those of a new drive.
    pub fn settings(&self) -> [Option<(Setting, f64, f64)>; Setting::ALL.len()] {
        Setting::ALL.map(|(_, setting)| {
            let role = RegisterRole::Setting(setting);
            let number = self.number_with(|own| own == role)?;
            let register = self.file.as_ref()?.with_role(|own| own == role)?;
            Some((setting, number, register.value))
        })
    }

    /// The longest silence while the drive has torque, and the error after it.
    pub const fn time_out(&self) -> Option<(Nanoseconds, u16)> {
        self.time_out
    }

    fn read_time_out(&self) -> Option<(Nanoseconds, u16)> {
        let is_time_out = |role| matches!(role, RegisterRole::TimeOut { .. });
        let count = self.number_with(is_time_out).filter(|count| *count > 0.0)?;
        match self.file.as_ref()?.with_role(is_time_out)?.role? {
            RegisterRole::TimeOut { unit_ns, error } => {
                Some((unit_ns.saturating_mul(count as Nanoseconds), error))
            }
            _ => None,
        }
    }

    /// Turns of the motor for one of the shaft.
    pub fn gear_ratio(&self) -> f64 {
        self.number_with(|role| role == RegisterRole::GearRatio).unwrap_or(1.0)
    }

    /// The most current: A.
    pub fn most_current(&self) -> f64 {
        self.number_with(|role| role == RegisterRole::MostCurrent).unwrap_or(1.0)
    }

    /// Returns `true` unless the drive is set to another bit rate than that of its bus.
    pub const fn is_on_bus(&self) -> bool {
        self.is_on_bus
    }
}

/// Returns `true` for a gain, which a drive has as a factor of that of a new one.
const fn is_gain(setting: Setting) -> bool {
    matches!(
        setting,
        Setting::VelocityLoopKp | Setting::VelocityLoopKi | Setting::CurrentLoopKp | Setting::CurrentLoopKi
    )
}
