//! Alarms: what is wrong, what the motor does about it, and what clears it (manual, chapter IIb.3).

use takt_rt::Nanoseconds;

/// An alarm that stops the motor until it is cleared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum StoppingAlarm {
    /// The rotor is blocked.
    BlockedRotor = 0x12,
    /// The motor does not come to the demanded speed.
    Stall = 0x14,
    /// More than 52 V.
    OverVoltage = 0x15,
}

impl StoppingAlarm {
    /// The alarm with this code in 260Eh.
    pub fn of(code: u16) -> Option<Self> {
        [Self::BlockedRotor, Self::Stall, Self::OverVoltage].into_iter().find(|alarm| *alarm as u16 == code)
    }
}

/// The code of the battery's power lost.
pub const BATTERY: u16 = 0x10;
/// The code of the communication lost.
pub const COMMUNICATION_LOST: u16 = 0x20;
/// How long an over-voltage lasts. It cannot be cleared before it is over.
const OVER_VOLTAGE_NS: Nanoseconds = 100_000_000;

/// All alarms but the one of the communication, which comes and goes with the heartbeat.
#[derive(Clone, Copy, Debug, Default)]
pub struct Alarms {
    stopping: Option<StoppingAlarm>,
    /// The multi-turn position was lost with the battery's power. The motor keeps running.
    pub has_lost_battery: bool,
    over_voltage_until_ns: Nanoseconds,
}

impl Alarms {
    /// Something is wrong that stops the motor. The first alarm stays.
    pub fn raise(&mut self, now_ns: Nanoseconds, alarm: StoppingAlarm) {
        if alarm == StoppingAlarm::OverVoltage {
            self.over_voltage_until_ns = now_ns + OVER_VOLTAGE_NS;
        }
        self.stopping.get_or_insert(alarm);
    }

    /// Whether the motor is stopped until the alarm is cleared.
    pub fn is_stopped(&self) -> bool {
        self.stopping.is_some()
    }

    /// Whether the supply's voltage is too high now.
    pub fn has_over_voltage(&self, now_ns: Nanoseconds) -> bool {
        now_ns < self.over_voltage_until_ns
    }

    /// What bit 7 of the controlword and 2601h = 1 do. Returns whether the motor may turn again.
    pub fn clear(&mut self, now_ns: Nanoseconds) -> bool {
        if self.has_over_voltage(now_ns) {
            return false;
        }
        self.stopping.take().is_some()
    }

    /// What is left of them when the supply returns.
    pub fn after_power_up(&self) -> Self {
        Self { has_lost_battery: self.has_lost_battery, ..Self::default() }
    }

    /// The code in 260Eh: what stops the motor before what does not.
    pub fn code(&self, is_master_lost: bool) -> u16 {
        match self.stopping {
            Some(alarm) => alarm as u16,
            None if is_master_lost => COMMUNICATION_LOST,
            None if self.has_lost_battery => BATTERY,
            None => 0,
        }
    }
}
