//! The measured values in the object dictionary and the TPDOs.

use super::{COUNTS_PER_SECOND_PER_RPM, YzAimJoint, mode};
use crate::yz_aim::device::{Conditions, Level};

/// Counts of 6079h for one volt.
const VOLTAGE_SCALE: f64 = 327.0;
/// The reported voltage at an over-voltage: V.
const OVER_VOLTAGE: f64 = 53.0;
/// Counts of 6078h for one ampere.
const CURRENT_SCALE: f64 = 2000.0;
/// Position window of "target reached": counts.
const POSITION_WINDOW: f64 = 10.0;
/// Speed window of "target reached": r/min.
const SPEED_WINDOW_RPM: f64 = 5.0;
const FULL_BATTERY: i64 = 10;
/// The values of 2614h.
const STORING: i64 = 1;
const STORED: i64 = 2;

impl YzAimJoint {
    pub(super) fn statusword(&self) -> u16 {
        let is_homing = self.mode() == mode::HOMING && self.homing.is_begun();
        self.device.statusword(Conditions {
            is_energised: self.is_energised(),
            has_alarm: self.shows_alarm(),
            is_target_reached: self.is_target_reached(),
            is_homing,
            is_homed: is_homing && self.homing.is_done(),
            has_homing_error: is_homing && self.homing.has_failed(),
        })
    }

    fn is_target_reached(&self) -> bool {
        let is_near = || (self.motion.target() - self.actual().position).abs() <= POSITION_WINDOW;
        match (self.device.level(), self.mode()) {
            (_, mode::HOMING) if self.homing.is_begun() => self.homing.is_done(),
            (Level::Enabled, _) if self.device.is_halted() => self.is_at_rest(),
            (Level::Enabled, mode::VELOCITY) => {
                let wanted = self.real(self.places.target_velocity);
                let highest = self.parameters.maximum_speed_rpm;
                (wanted.clamp(-highest, highest) - self.velocity_rpm()).abs() <= SPEED_WINDOW_RPM
            }
            (Level::Enabled, mode::INTERPOLATION) => is_near(),
            (Level::Enabled | Level::Cold, _) => !self.motion.is_moving() && is_near(),
            _ => self.is_at_rest(),
        }
    }

    /// Writes the velocity to the dictionary in the scale of TPDO3.
    pub(super) fn measure_velocity_of_pdo(&mut self) {
        let scale = if self.parameters.quirks.has_fine_velocity_in_tpdo3 { 10.0 } else { 1.0 };
        let velocity = scale * self.velocity_rpm();
        self.canopen.dictionary.set_within_at(self.places.velocity, velocity);
    }

    /// Writes the measured values to the dictionary.
    pub(super) fn measure_all(&mut self) {
        let position = i64::from(self.counts());
        let velocity = self.actual().velocity;
        let amperes = self.torque.abs() / self.parameters.torque_per_ampere();
        let has_over_voltage = self.alarms.has_over_voltage(self.now_ns);
        let volts = if has_over_voltage { OVER_VOLTAGE } else { self.parameters.supply_voltage };
        // Approximation: the back-EMF takes four fifths of the output at the highest speed.
        let output = 0.8 * velocity / self.parameters.highest_speed()
            + 0.2 * self.torque / self.parameters.peak_torque;
        let has_battery = self.has_battery() && !self.alarms.has_lost_battery;
        let at_position = self.joint.position();
        let inputs = u8::from(self.parameters.switches.dir(at_position))
            | u8::from(self.parameters.switches.pu(at_position)) << 1;
        let (statusword, alarm, shows_alarm) = (self.statusword(), self.alarm_code(), self.shows_alarm());
        let is_saving = self.canopen.is_saving();
        let (dictionary, places) = (&mut self.canopen.dictionary, &self.places);
        dictionary.set_at(places.error_register, shows_alarm.into());
        dictionary.set_at(places.alarm_code, alarm.into());
        dictionary.set_within_at(places.output, 32_767.0 * output);
        dictionary.set_at(places.battery_level, if has_battery { FULL_BATTERY } else { 0 });
        dictionary.set_at(places.statusword, statusword.into());
        dictionary.set_at(places.position_internal, position);
        dictionary.set_at(places.position, position);
        dictionary.set_within_at(places.velocity, 10.0 * velocity / COUNTS_PER_SECOND_PER_RPM);
        dictionary.set_within_at(places.current, CURRENT_SCALE * amperes);
        dictionary.set_within_at(places.voltage, VOLTAGE_SCALE * volts);
        dictionary.set_at(places.inputs, inputs.into());
        if dictionary.number_at(places.save_flag) == Some(STORING) && !is_saving {
            dictionary.set_at(places.save_flag, STORED);
        }
    }
}
