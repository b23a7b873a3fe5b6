//! What the drive notices by itself: a blocked rotor, too long at the current limit, a loss of speed; and what breaks from
//! outside.

use takt_rt::Nanoseconds;

use super::YzAimJoint;
use crate::sim::defect::{Defect, Unsupported};
use crate::sim::drive::DriveFault;
use crate::sim::yz_aim::alarms::{BATTERY, COMMUNICATION_LOST, StoppingAlarm};
use crate::sim::yz_aim::objects::at;

/// For how long the speed may stay behind before it is a stall.
const STALL_S: f64 = 0.5;
/// What the speed may stay behind, in parts of the highest speed.
const STALL_SHARE: f64 = 0.1;
/// From this part of a limit on the motor is at it.
const AT_LIMIT: f64 = 0.999;
/// 2618h in its full range: what lets the motor give its peak torque at standstill.
const FULL_STANDSTILL_OUTPUT: f64 = 600.0;

/// For how long something has been wrong.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Watch {
    blocked_s: f64,
    at_current_limit_s: f64,
    behind_s: f64,
}

impl YzAimJoint {
    /// The torque that 261Dh allows.
    fn current_limit(&self) -> f64 {
        let amperes = self.dictionary.real(at::MAXIMUM_CURRENT) / 1000.0;
        amperes * self.parameters.torque_per_ampere()
    }

    /// The torque that the motor gives at most now.
    pub(super) fn torque_limit(&self) -> f64 {
        let limit = self.parameters.peak_torque.min(self.current_limit());
        if self.is_at_rest() {
            limit * (self.dictionary.real(at::STANDSTILL_OUTPUT) / FULL_STANDSTILL_OUTPUT).min(1.0)
        } else {
            limit
        }
    }

    /// Looks at the step that has been made.
    pub(super) fn watch(&mut self, duration_s: f64) {
        let torque = self.torque.abs();
        let is_at_limit = torque > 0.0 && torque >= AT_LIMIT * self.torque_limit();
        let is_at_current_limit = torque > 0.0 && torque >= AT_LIMIT * self.current_limit();
        let is_at_rest = self.is_at_rest();
        let behind = (self.motion.velocity() - self.actual().velocity).abs();
        let is_behind = is_at_limit && !is_at_rest && behind > STALL_SHARE * self.parameters.highest_speed();
        let after = |seconds: f64, goes_on: bool| if goes_on { seconds + duration_s } else { 0.0 };
        self.watch = Watch {
            blocked_s: after(self.watch.blocked_s, is_at_limit && is_at_rest),
            at_current_limit_s: after(self.watch.at_current_limit_s, is_at_current_limit),
            behind_s: after(self.watch.behind_s, is_behind || self.motion.is_limited()),
        };
        let now_ns = self.stepped_ns;
        let is_blocked = is_over(self.watch.blocked_s, self.dictionary.get(at::STANDSTILL_OUTPUT))
            || is_over(self.watch.at_current_limit_s, self.dictionary.get(at::MAXIMUM_CURRENT));
        if is_blocked {
            self.fail(now_ns, StoppingAlarm::BlockedRotor);
        } else if self.watch.behind_s >= STALL_S {
            self.fail(now_ns, StoppingAlarm::Stall);
        }
    }

    /// Something breaks from outside. What this drive has no alarm for goes unnoticed.
    pub(super) fn break_down(&mut self, now_ns: Nanoseconds, fault: DriveFault) {
        match fault {
            DriveFault::BlockedRotor | DriveFault::OverCurrent => {
                self.fail(now_ns, StoppingAlarm::BlockedRotor);
            }
            DriveFault::Stall => self.fail(now_ns, StoppingAlarm::Stall),
            DriveFault::OverVoltage => self.fail(now_ns, StoppingAlarm::OverVoltage),
            DriveFault::MultiTurnBattery if self.parameters.has_battery => {
                self.alarms.has_lost_battery = true;
            }
            DriveFault::MultiTurnBattery
            | DriveFault::UnderVoltage
            | DriveFault::OverTemperature
            | DriveFault::Encoder => {}
        }
    }

    /// One of the drive's own alarms comes, whatever the cause.
    ///
    /// # Errors
    /// [`Unsupported`] for a code that is none of them.
    pub(super) fn raise(&mut self, now_ns: Nanoseconds, code: u16) -> Result<(), Unsupported> {
        match code {
            BATTERY if self.parameters.has_battery => self.alarms.has_lost_battery = true,
            COMMUNICATION_LOST => self.network.lose_master(),
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

/// Whether the seconds in the ones digit of a parameter are over; 0 is no alarm.
fn is_over(seconds: f64, parameter: i64) -> bool {
    let digit = parameter % 10;
    digit > 0 && seconds >= digit as f64
}
