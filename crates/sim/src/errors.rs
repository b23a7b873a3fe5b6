//! Errors of a simulated device: emergency messages, the error register 1001 and the error history 1003, as far as its
//! dictionary has them (CiA 301, 7.2.7, 7.5.2.2, 7.5.2.4).

use std::collections::VecDeque;

use crate::drive::DriveFault;
use crate::object_dictionary::SimulatedDictionary;

/// Capacity for emergency messages that wait to be sent.
const PENDING: usize = 8;

/// An error of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceError {
    /// An injected fault.
    Fault(DriveFault),
    /// An injected error code.
    Alarm(u16),
    /// The heartbeat or the node guarding of the master timed out.
    MasterLost,
    /// A PDO was shorter than its mapping.
    PdoLength,
    /// SYNC had another length than object 1019 says.
    SyncLength,
    /// The event timer of an RPDO ran out.
    RpdoTimeout,
    /// The following error exceeded its window.
    FollowingError,
}

impl DeviceError {
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
            Self::SyncLength => 0x8240,
            Self::RpdoTimeout => 0x8250,
            Self::FollowingError => 0x8611,
        }
    }

    /// The bits of the error register, including the generic error bit.
    const fn register(self) -> u8 {
        1 | match self.code() >> 12 {
            2 => 1 << 1,
            3 => 1 << 2,
            4 => 1 << 3,
            8 if self.code() < 0x8300 => 1 << 4,
            _ => 1 << 5,
        }
    }

    /// Returns `true` if power is cut at once, because a controlled deceleration is not possible: faults of current (2xxx),
    /// voltage (3xxx), hardware (5xxx) and sensors (73xx).
    pub const fn cuts_power(self) -> bool {
        match self {
            Self::Fault(DriveFault::OverTemperature) => false,
            Self::Fault(_) => true,
            Self::Alarm(code) => matches!(code >> 8, 0x20..=0x3F | 0x50..=0x5F | 0x73),
            _ => false,
        }
    }
}

/// Emergency messages that wait to be sent.
#[derive(Clone, Debug)]
pub struct Errors {
    register: Option<usize>,
    /// The number of errors in the history, then the errors, the latest first.
    history: Vec<usize>,
    pending: VecDeque<[u8; 8]>,
    has_error: bool,
}

impl Errors {
    /// No error.
    pub fn new(dictionary: &SimulatedDictionary) -> Self {
        Self {
            register: dictionary.place(0x1001, 0),
            history: (0..=254).map_while(|subindex| dictionary.place(0x1003, subindex)).collect(),
            pending: VecDeque::with_capacity(PENDING),
            has_error: false,
        }
    }

    /// Records an error in register and history, and queues an emergency message.
    pub fn raise(&mut self, error: DeviceError, dictionary: &mut SimulatedDictionary) {
        let register = dictionary.number_at(self.register).unwrap_or(0) as u8 | error.register();
        dictionary.set_at(self.register, register.into());
        for pair in self.history.windows(2).skip(1).rev() {
            dictionary.set(pair[1], dictionary.number(pair[0]));
        }
        if let [count, first, ..] = self.history[..] {
            dictionary.set(first, error.code().into());
            let most = self.history.len() as i64 - 1;
            dictionary.set(count, (dictionary.number(count) + 1).min(most));
        }
        self.has_error = true;
        self.queue(error.code(), register);
    }

    /// Clears the error register and queues the "error reset" message.
    pub fn clear(&mut self, dictionary: &mut SimulatedDictionary) {
        if self.has_error {
            self.has_error = false;
            dictionary.set_at(self.register, 0);
            self.queue(0, 0);
        }
    }

    /// Returns `true` if an emergency message waits.
    pub fn is_pending(&self) -> bool {
        !self.pending.is_empty()
    }

    /// Removes and returns the oldest emergency message.
    pub fn next(&mut self) -> Option<[u8; 8]> {
        self.pending.pop_front()
    }

    /// Discards everything, as a restart does.
    pub fn reset(&mut self) {
        self.pending.clear();
        self.has_error = false;
    }

    fn queue(&mut self, code: u16, register: u8) {
        if self.pending.len() < PENDING {
            let [low, high] = code.to_le_bytes();
            self.pending.push_back([low, high, register, 0, 0, 0, 0, 0]);
        }
    }
}
