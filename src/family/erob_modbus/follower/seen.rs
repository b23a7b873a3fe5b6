//! What is read of a drive, and what it has said.

use takt_rt::Nanoseconds;
use takt_wire::modbus::frame::{RegisterRange, Values};

use crate::family::erob::module::ReachedStatus;
use crate::family::erob_modbus::register::Register;
use crate::family::erob_modbus::registers;

/// The registers of one read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// Whether it is at its target, and where it is: 0x0063 to 0x0069.
    Place,
    /// Velocity and current: 0x006C to 0x0075.
    Speed,
    /// Fault and motion: 0x0060 and 0x0061.
    Fault,
    /// The continuous current, for which the torque is known: 0x00B0 and 0x00B1.
    Rating,
    /// 0x0078
    Temperature,
}

impl Reading {
    /// The registers.
    pub fn range(self) -> Option<RegisterRange> {
        let (first, count) = match self {
            Self::Fault => (registers::FAULT_CODE, 2),
            Self::Place => (registers::REACHED_STATUS, 7),
            Self::Speed => (registers::DEMANDED_VELOCITY, 10),
            Self::Rating => (registers::CONTINUOUS_CURRENT, 2),
            Self::Temperature => (registers::TEMPERATURE, 1),
        };
        RegisterRange::new(first.address, count)
    }
}

/// What the drive has said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// counts
    pub position: f64,
    pub at_ns: Nanoseconds,
    /// counts/s
    pub velocity: f64,
    pub speed_at_ns: Nanoseconds,
    pub milliamperes: f64,
    pub continuous_milliamperes: Option<f64>,
    /// °C
    pub temperature: Option<f32>,
    pub fault: u16,
    pub is_motor_off: bool,
    /// The fault and the velocity must have been read before anything is reported.
    pub is_fault_known: bool,
    pub is_speed_known: bool,
}

impl Seen {
    /// Before the first reading.
    pub const NOTHING: Self = Self {
        position: 0.0,
        at_ns: 0,
        velocity: 0.0,
        speed_at_ns: 0,
        milliamperes: 0.0,
        continuous_milliamperes: None,
        temperature: None,
        fault: 0,
        is_motor_off: true,
        is_fault_known: false,
        is_speed_known: false,
    };

    /// Returns `true` if all is known that a report tells.
    pub const fn is_whole(&self) -> bool {
        self.is_fault_known && self.is_speed_known && self.at_ns > 0
    }

    /// Takes the words of a reading; `None` if they are not those of its registers.
    pub fn take(&mut self, now_ns: Nanoseconds, reading: Reading, values: &Values) -> Option<()> {
        let first = reading.range()?.start();
        let number = |register: &Register| {
            let at = usize::from(register.address - first);
            let words = values.get(at..at + usize::from(register.number.words()))?;
            register.decode(words).map(|value| value as f64)
        };
        match reading {
            Reading::Fault => {
                self.fault = values.first().copied()?;
                self.is_fault_known = true;
            }
            Reading::Speed => {
                self.velocity = number(&registers::ACTUAL_VELOCITY)?;
                self.milliamperes = number(&registers::MOTOR_CURRENT)?;
                (self.speed_at_ns, self.is_speed_known) = (now_ns, true);
            }
            Reading::Rating => {
                self.continuous_milliamperes = Some(number(&registers::CONTINUOUS_CURRENT)?);
            }
            Reading::Temperature => self.temperature = Some(number(&registers::TEMPERATURE)? as f32),
            Reading::Place => {
                self.is_motor_off = ReachedStatus::from(values.first().copied()?) == ReachedStatus::MotorOff;
                self.position = number(&registers::ACTUAL_POSITION)?;
                self.at_ns = now_ns;
            }
        }
        Some(())
    }
}
