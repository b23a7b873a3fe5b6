//! Errors of the drive: emergency messages, the error register and the error history (CiA 301, 7.2.7, 7.5.2.2,
//! 7.5.2.4).

use super::dictionary::{ErobDictionary, at};
use crate::sim::drive::DriveFault;

/// Capacity for emergency messages that wait to be sent.
const PENDING: usize = 8;
/// Entries of the error history 1003.
const HISTORY: usize = 4;

/// An error of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErobError {
    /// An injected fault.
    Fault(DriveFault),
    /// An injected error code.
    Alarm(u16),
    /// The heartbeat or the node guarding of the master timed out.
    MasterLost,
    /// A PDO was shorter than its mapping.
    PdoLength,
    /// The following error exceeded its window.
    PositionLost,
}

impl ErobError {
    /// The emergency error code.
    pub const fn code(self) -> u16 {
        match self {
            Self::Fault(DriveFault::OverCurrent) => 0x2310,
            Self::Fault(DriveFault::OverVoltage) => 0x3210,
            Self::Fault(DriveFault::UnderVoltage) => 0x3220,
            Self::Fault(DriveFault::OverTemperature) => 0x4310,
            Self::Fault(DriveFault::Encoder) => 0x7305,
            Self::Fault(DriveFault::MultiTurnBattery) => 0x730F,
            Self::Fault(DriveFault::BlockedRotor) => 0x7121,
            Self::Fault(DriveFault::Stall) => 0x8400,
            Self::Alarm(code) => code,
            Self::MasterLost => 0x8130,
            Self::PdoLength => 0x8210,
            Self::PositionLost => 0x8611,
        }
    }

    /// The bits of the error register, including the generic error bit.
    const fn register(self) -> u32 {
        1 | match self.code() >> 12 {
            2 => 1 << 1,
            3 => 1 << 2,
            4 => 1 << 3,
            8 if self.code() < 0x8300 => 1 << 4,
            _ => 1 << 5,
        }
    }

    /// Whether power is cut at once, because a controlled deceleration is not possible: faults of current (2xxx),
    /// voltage (3xxx), hardware (5xxx) and sensors (73xx).
    pub const fn cuts_power(self) -> bool {
        match self {
            Self::Fault(DriveFault::OverTemperature)
            | Self::MasterLost
            | Self::PdoLength
            | Self::PositionLost => false,
            Self::Fault(_) => true,
            Self::Alarm(code) => matches!(code >> 8, 0x20..=0x3F | 0x50..=0x5F | 0x73),
        }
    }
}

/// Emergency messages that wait to be sent.
#[derive(Clone, Debug, Default)]
pub struct ErobErrors {
    pending: [[u8; 8]; PENDING],
    count: usize,
}

impl ErobErrors {
    /// Records an error in register and history, and queues an emergency message.
    pub fn raise(&mut self, error: ErobError, dictionary: &mut ErobDictionary) {
        let register = dictionary.get(at::ERROR_REGISTER) | error.register();
        dictionary.set(at::ERROR_REGISTER, register);
        for at in (at::ERROR_HISTORY + 2..=at::ERROR_HISTORY + HISTORY).rev() {
            dictionary.set(at, dictionary.get(at - 1));
        }
        dictionary.set(at::ERROR_HISTORY + 1, error.code().into());
        let count = dictionary.get(at::ERROR_HISTORY) + 1;
        dictionary.set(at::ERROR_HISTORY, count.min(HISTORY as u32));
        self.queue(error.code(), register);
    }

    /// Clears the error register and queues the "error reset" message.
    pub fn clear(&mut self, dictionary: &mut ErobDictionary) {
        if dictionary.get(at::ERROR_REGISTER) != 0 {
            dictionary.set(at::ERROR_REGISTER, 0);
            self.queue(0, 0);
        }
    }

    /// Whether an emergency message waits.
    pub fn is_pending(&self) -> bool {
        self.count > 0
    }

    /// Removes and returns the oldest emergency message.
    pub fn next(&mut self) -> Option<[u8; 8]> {
        let first = *self.pending.first().filter(|_| self.count > 0)?;
        self.pending.rotate_left(1);
        self.count -= 1;
        Some(first)
    }

    /// Discards the waiting messages.
    pub fn reset(&mut self) {
        self.count = 0;
    }

    fn queue(&mut self, code: u16, register: u32) {
        let [low, high] = code.to_le_bytes();
        if let Some(free) = self.pending.get_mut(self.count) {
            *free = [low, high, register as u8, 0, 0, 0, 0, 0];
            self.count += 1;
        }
    }
}
