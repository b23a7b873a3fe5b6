//! Detects a blocked rotor, too long a time at the current limit, and a stall. Applies injected faults.

use takt_rt::Nanoseconds;

use super::{LoadMonitor, YzAimJoint};
use crate::defect::{Defect, Unsupported};
use crate::drive::DriveFault;
use crate::yz_aim::alarms::{BATTERY, COMMUNICATION_LOST, StoppingAlarm};

/// How long the speed may stay behind before it is a stall.
const STALL_S: f64 = 0.5;
/// How far the speed may stay behind, as a share of the highest speed.
const STALL_SHARE: f64 = 0.1;
/// From this share of a limit on, the motor is at the limit.
const AT_LIMIT: f64 = 0.999;
/// The value of 2618h that allows the peak torque at standstill.
const FULL_STANDSTILL_OUTPUT: f64 = 600.0;

impl YzAimJoint {
    /// The torque limit by 261Dh.
    fn current_limit(&self) -> f64 {
        let amperes = self.real(self.places.maximum_current) / 1000.0;
        amperes * self.parameters.torque_per_ampere()
    }

    /// The current torque limit.
    pub(super) fn torque_limit(&self) -> f64 {
        let limit = self.parameters.peak_torque.min(self.current_limit());
        if self.is_at_rest() {
            limit * (self.real(self.places.standstill_output) / FULL_STANDSTILL_OUTPUT).min(1.0)
        } else {
            limit
        }
    }

    /// Evaluates the last step.
    pub(super) fn monitor_load(&mut self, duration_s: f64) {
        let torque = self.torque.abs();
        let is_at_limit = torque > 0.0 && torque >= AT_LIMIT * self.torque_limit();
        let is_at_current_limit = torque > 0.0 && torque >= AT_LIMIT * self.current_limit();
        let is_at_rest = self.is_at_rest();
        let behind = (self.motion.velocity() - self.actual().velocity).abs();
        let is_behind = is_at_limit && !is_at_rest && behind > STALL_SHARE * self.parameters.highest_speed();
        let after = |seconds: f64, goes_on: bool| if goes_on { seconds + duration_s } else { 0.0 };
        self.load_monitor = LoadMonitor {
            blocked_s: after(self.load_monitor.blocked_s, is_at_limit && is_at_rest),
            at_current_limit_s: after(self.load_monitor.at_current_limit_s, is_at_current_limit),
            behind_s: after(self.load_monitor.behind_s, is_behind || self.motion.is_limited()),
        };
        let now_ns = self.stepped_ns;
        let is_blocked = is_over(self.load_monitor.blocked_s, self.number(self.places.standstill_output))
            || is_over(self.load_monitor.at_current_limit_s, self.number(self.places.maximum_current));
        if is_blocked {
            self.fail(now_ns, StoppingAlarm::BlockedRotor);
        } else if self.load_monitor.behind_s >= STALL_S {
            self.fail(now_ns, StoppingAlarm::Stall);
        }
    }

    /// Applies an injected fault. Faults without an alarm of this drive have no effect.
    pub(super) fn apply_fault(&mut self, now_ns: Nanoseconds, fault: DriveFault) {
        match fault {
            DriveFault::BlockedRotor | DriveFault::OverCurrent => {
                self.fail(now_ns, StoppingAlarm::BlockedRotor);
            }
            DriveFault::Stall => self.fail(now_ns, StoppingAlarm::Stall),
            DriveFault::OverVoltage => self.fail(now_ns, StoppingAlarm::OverVoltage),
            DriveFault::MultiTurnBattery if self.has_battery() => {
                self.alarms.has_lost_battery = true;
            }
            DriveFault::MultiTurnBattery
            | DriveFault::UnderVoltage
            | DriveFault::OverTemperature
            | DriveFault::Encoder => {}
        }
    }

    /// Raises one of the drive's own alarms.
    ///
    /// # Errors
    /// [`Unsupported`] when the drive has no alarm with this code.
    pub(super) fn raise(&mut self, now_ns: Nanoseconds, code: u16) -> Result<(), Unsupported> {
        match code {
            BATTERY if self.has_battery() => self.alarms.has_lost_battery = true,
            COMMUNICATION_LOST => {
                self.canopen.network.stop_master_monitor();
                self.is_master_lost = true;
            }
            _ => {
                let reason = match code {
                    BATTERY => "this YZ-AIM has no battery",
                    _ => "the alarms of a YZ-AIM are 0x10, 0x12, 0x14, 0x15 and 0x20",
                };
                let unknown = Unsupported { defect: Defect::Alarm { code }, reason };
                self.fail(now_ns, StoppingAlarm::of(code).ok_or(unknown)?);
            }
        }
        Ok(())
    }
}

/// Returns `true` if the time in the last digit of a parameter is over (in seconds); 0 turns the alarm off.
fn is_over(seconds: f64, parameter: i64) -> bool {
    let digit = parameter % 10;
    digit > 0 && seconds >= digit as f64
}
