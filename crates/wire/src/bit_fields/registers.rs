//! Registers of drives of bit fields: what a register file says.

use takt_rt::Nanoseconds;

use super::{
    FieldDevice, IdExpression, RegisterByte, RegisterFrame, RegisterProtocol, RegisterScan, Setting, Zeroing,
};

/// What all drives of a make have in common, whatever mode they are set to: their registers, and how these are read, written and stored.
#[derive(Clone, Debug, PartialEq)]
pub struct RegisterFile {
    /// How a register is read, and those that a scan reads.
    pub protocol: RegisterProtocol,
    /// How a register is written.
    pub write: Option<RegisterExchange>,
    /// How the registers are stored.
    pub store: Option<StoreExchange>,
    /// The request for a reply as after a command.
    pub status: Option<RegisterFrame>,
    /// The identifiers by which every drive of the make answers any frame.
    pub hears: Vec<IdExpression>,
    /// What zeroing does to a running drive.
    pub zeroing: Zeroing,
    /// True if clearing faults takes the torque of a running drive away.
    pub clear_stops: bool,
    /// True if a drive forgets its last command when its torque is taken away.
    pub forgets_command: bool,
    /// The bit rates of the bus by the code of their register: arbitration and data phase, which are the same in classic CAN.
    pub bit_rates: Vec<(u32, [u32; 2])>,
    /// The registers.
    pub registers: Vec<Register>,
}

/// A request and its reply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegisterExchange {
    /// The request.
    pub request: RegisterFrame,
    /// The reply.
    pub reply: RegisterFrame,
}

/// How registers are stored. A drive with torque does not store.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoreExchange {
    /// Request and reply.
    pub exchange: RegisterExchange,
    /// The length of the reply.
    pub reply_bytes: usize,
    /// From the request to the reply.
    pub takes_ns: Nanoseconds,
}

/// A register of 32 bits.
#[derive(Clone, Debug, PartialEq)]
pub struct Register {
    /// Its number.
    pub number: u8,
    /// Its name.
    pub name: String,
    /// True if it is a floating-point number (IEEE 754), otherwise an unsigned one.
    pub is_float: bool,
    /// What may be written. `None`: it is read-only.
    pub range: Option<Interval>,
    /// The bits of a written number that count.
    pub mask: u32,
    /// What a new drive has.
    pub value: f64,
    /// What it is for the drive.
    pub role: Option<RegisterRole>,
}

/// An interval as in the tables of data sheets: `(0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The lower end.
    pub low: f64,
    /// The upper end.
    pub high: f64,
    /// True if the lower end belongs to it.
    pub has_low: bool,
    /// True if the upper end belongs to it.
    pub has_high: bool,
}

/// What a register is for the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RegisterRole {
    /// The identifier of its replies.
    MasterId,
    /// Its motor ID.
    MotorId,
    /// The mode that it is in.
    Mode,
    /// The longest time between two frames to a drive with torque. 0: none.
    TimeOut {
        /// One code of it.
        unit_ns: Nanoseconds,
        /// The error of a drive that has heard nothing for longer.
        error: u16,
    },
    /// The version of the firmware.
    Firmware,
    /// The code of the bit rate of the bus.
    BitRate,
    /// A number that a configuration has to give, or a gain as a factor of the one of a new drive.
    Setting(Setting),
    /// The position of the shaft: rad.
    Position,
    /// The position of the motor before its gear: rad.
    MotorPosition,
    /// The gear ratio.
    GearRatio,
    /// A temperature: °C.
    Temperature,
    /// The most current: A.
    MostCurrent,
}

impl Interval {
    /// Reads `(10, 3.4e38]`. `None` if it is none.
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        let (has_low, text) = match text.strip_prefix('[') {
            Some(rest) => (true, rest),
            None => (false, text.strip_prefix('(')?),
        };
        let (has_high, text) = match text.strip_suffix(']') {
            Some(rest) => (true, rest),
            None => (false, text.strip_suffix(')')?),
        };
        let (low, high) = text.split_once(',')?;
        let (low, high) = (low.trim().parse().ok()?, high.trim().parse().ok()?);
        (low < high).then_some(Self { low, high, has_low, has_high })
    }

    /// Returns `true` if a number is in it.
    pub fn contains(&self, number: f64) -> bool {
        let is_above = number > self.low || self.has_low && number == self.low;
        let is_below = number < self.high || self.has_high && number == self.high;
        is_above && is_below
    }
}

impl Register {
    /// The bits of a number in this register.
    pub fn bits_of(&self, number: f64) -> u32 {
        if self.is_float { (number as f32).to_bits() } else { number as u32 }
    }

    /// The number of these bits in this register.
    pub fn number_of(&self, bits: u32) -> f64 {
        if self.is_float { f32::from_bits(bits).into() } else { bits.into() }
    }

    /// Returns `true` if these bits may be written.
    pub fn takes(&self, bits: u32) -> bool {
        self.range.is_some_and(|range| range.contains(self.number_of(bits)))
    }
}

impl RegisterFile {
    /// The registers that a scan reads, where nothing else is known of them: they are read-only.
    pub fn of_scan(scan: &RegisterScan) -> Self {
        let protocol = &scan.protocol;
        let register = |number, is_float, role, value| Register {
            number,
            name: String::new(),
            is_float,
            range: None,
            mask: u32::MAX,
            value,
            role: Some(role),
        };
        let mut registers = vec![
            register(protocol.master_id, false, RegisterRole::MasterId, 0.0),
            register(protocol.mode, false, RegisterRole::Mode, scan.mode_is.into()),
        ];
        registers
            .extend(protocol.firmware.map(|number| register(number, false, RegisterRole::Firmware, 1.0)));
        let settings = protocol.settings.iter();
        registers.extend(
            settings.map(|(setting, number)| register(*number, true, RegisterRole::Setting(*setting), 1.0)),
        );
        Self {
            protocol: protocol.clone(),
            write: None,
            store: None,
            status: None,
            hears: vec![],
            zeroing: Zeroing::WhenStopped,
            clear_stops: false,
            forgets_command: false,
            bit_rates: vec![],
            registers,
        }
    }

    /// The register with this number.
    pub fn register(&self, number: u8) -> Option<&Register> {
        self.registers.iter().find(|register| register.number == number)
    }

    /// The register with this role.
    pub fn with_role(&self, is_it: impl Fn(RegisterRole) -> bool) -> Option<&Register> {
        self.registers.iter().find(|register| register.role.is_some_and(&is_it))
    }
}

/// What a frame says of a register.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RegisterRequest {
    /// The register.
    pub register: Option<u8>,
    /// The value.
    pub value: u32,
}

impl RegisterFrame {
    /// What a payload asks the drive with this motor ID. `None` if it is another request, or one to another drive. Bytes behind the last
    /// one that counts may be missing.
    pub fn read(&self, motor: u8, payload: &[u8]) -> Option<RegisterRequest> {
        let mut request = RegisterRequest::default();
        let mut shift = 0;
        for (at, described) in self.payload.into_iter().enumerate() {
            let byte = payload.get(at).copied();
            match described {
                RegisterByte::Any => {}
                RegisterByte::Byte(own) if byte? != own => return None,
                RegisterByte::Motor if byte? != motor => return None,
                RegisterByte::Byte(_) | RegisterByte::Motor => {}
                RegisterByte::Register => request.register = Some(byte?),
                RegisterByte::Value => {
                    request.value |= u32::from(byte?) << shift;
                    shift += 8;
                }
            }
        }
        Some(request)
    }

    /// The payload of an answer.
    pub fn payload(&self, motor: u8, register: u8, value: u32) -> [u8; 8] {
        let mut value = value.to_le_bytes().into_iter();
        self.payload.map(|byte| match byte {
            RegisterByte::Byte(byte) => byte,
            RegisterByte::Motor => motor,
            RegisterByte::Register => register,
            RegisterByte::Value => value.next().unwrap_or(0),
            RegisterByte::Any => 0,
        })
    }
}

impl FieldDevice {
    /// The registers of the drive, as far as they are known.
    pub fn register_file(&self) -> Option<RegisterFile> {
        let described = self.description.registers.clone();
        described.or_else(|| match &self.description.scan {
            Some(super::DescribedScan::Registers(scan)) => Some(RegisterFile::of_scan(scan)),
            _ => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_is_read_as_a_data_sheet_writes_it() {
        let range = Interval::parse("(0.0, 1]").unwrap();
        assert!(range.contains(1.0) && range.contains(0.5) && !range.contains(0.0) && !range.contains(1.1));
        assert!(!range.contains(f64::NAN));
        let range = Interval::parse("[80, 200)").unwrap();
        assert!(range.contains(80.0) && !range.contains(200.0));
        for text in ["", "0, 1", "(1, 0)", "(0; 1)", "[0, x]"] {
            assert_eq!(Interval::parse(text), None, "{text}");
        }
    }
}
