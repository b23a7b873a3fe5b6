//! Alarms of a YZ-AIM: causes, effect on the motor, and how they are cleared (manual, chapter IIb.3).

use takt_rt::Nanoseconds;

/// An alarm that stops the motor until it is cleared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum StoppingAlarm {
    /// The rotor is blocked.
    BlockedRotor = 0x12,
    /// The motor does not reach the demanded speed.
    Stall = 0x14,
    /// A supply above 52 V.
    OverVoltage = 0x15,
}

impl StoppingAlarm {
    /// The alarm with this code in 260Eh.
    pub fn of(code: u16) -> Option<Self> {
        [Self::BlockedRotor, Self::Stall, Self::OverVoltage].into_iter().find(|alarm| *alarm as u16 == code)
    }
}

/// Code of the alarm for lost battery power.
pub const BATTERY: u16 = 0x10;
/// Code of the alarm for lost communication.
pub const COMMUNICATION_LOST: u16 = 0x20;
/// Duration of an over-voltage. It cannot be cleared earlier.
const OVER_VOLTAGE_NS: Nanoseconds = 100_000_000;

/// All alarms except lost communication, which follows the heartbeat.
#[derive(Clone, Copy, Debug, Default)]
pub struct Alarms {
    stopping: Option<StoppingAlarm>,
    /// The turn count was lost with the battery power. The motor keeps running.
    pub has_lost_battery: bool,
    over_voltage_until_ns: Nanoseconds,
}

impl Alarms {
    /// Raises an alarm that stops the motor. The first alarm stays.
    pub fn raise(&mut self, now_ns: Nanoseconds, alarm: StoppingAlarm) {
        if alarm == StoppingAlarm::OverVoltage {
            self.over_voltage_until_ns = now_ns + OVER_VOLTAGE_NS;
        }
        self.stopping.get_or_insert(alarm);
    }

    /// Returns `true` if an alarm stops the motor.
    pub fn is_stopped(&self) -> bool {
        self.stopping.is_some()
    }

    /// Returns `true` if the supply voltage is too high now.
    pub fn has_over_voltage(&self, now_ns: Nanoseconds) -> bool {
        now_ns < self.over_voltage_until_ns
    }

    /// Clears the alarm, as controlword bit 7 and 2601h = 1 do. Returns whether the motor may turn again.
    pub fn clear(&mut self, now_ns: Nanoseconds) -> bool {
        if self.has_over_voltage(now_ns) {
            return false;
        }
        self.stopping.take().is_some()
    }

    /// The alarms that remain after a power cycle.
    pub fn after_power_up(&self) -> Self {
        Self { has_lost_battery: self.has_lost_battery, ..Self::default() }
    }

    /// The code in 260Eh: alarms that stop the motor come first.
    pub fn code(&self, is_master_lost: bool) -> u16 {
        match self.stopping {
            Some(alarm) => alarm as u16,
            None if is_master_lost => COMMUNICATION_LOST,
            None if self.has_lost_battery => BATTERY,
            None => 0,
        }
    }
}
