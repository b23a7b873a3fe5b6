//! The measured values in the object dictionary and the TPDOs.

use super::{COUNTS_PER_SECOND_PER_RPM, YzAimJoint, mode};
use crate::feedback_defects::ShownObjects;
use crate::object_dictionary::SimulatedDictionary;
use crate::pdo_engine::PdoEngine;
use crate::yz_aim::device::{Conditions, Level};
use crate::yz_aim::objects::at;
use crate::yz_aim::process_data::Transmission;

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
/// The objects that a defect can change in the TPDOs. No TPDO has a mode, and their mapping is fixed.
const SHOWN: ShownObjects = ShownObjects {
    statusword: Some(at::STATUSWORD),
    mode_display: None,
    position: Some(at::POSITION),
    instead_of_position: None,
};

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
                let wanted = self.dictionary.real(at::TARGET_VELOCITY);
                let highest = self.parameters.maximum_speed_rpm;
                (wanted.clamp(-highest, highest) - self.velocity_rpm()).abs() <= SPEED_WINDOW_RPM
            }
            (Level::Enabled, mode::INTERPOLATION) => is_near(),
            (Level::Enabled | Level::Cold, _) => !self.motion.is_moving() && is_near(),
            _ => self.is_at_rest(),
        }
    }

    /// Writes the values of the TPDOs to the dictionary with the effect of the defects, and lets the PDOs take them. TPDO3 has
    /// the velocity in a scale of its own.
    pub(super) fn report(
        &mut self,
        take: impl FnOnce(&mut Transmission, &mut PdoEngine, &SimulatedDictionary),
    ) {
        let scale = if self.parameters.quirks.has_fine_velocity_in_tpdo3 { 10.0 } else { 1.0 };
        let (position, statusword, velocity) = (self.counts(), self.statusword(), self.velocity_rpm());
        self.dictionary.set(at::POSITION, position.into());
        self.dictionary.set(at::STATUSWORD, statusword.into());
        self.dictionary.set_within(at::VELOCITY, scale * velocity);
        let truth = self.defects.falsify(SHOWN, &mut self.dictionary);
        take(&mut self.transmission, &mut self.pdos, &self.dictionary);
        truth.restore(&mut self.dictionary);
    }

    /// Writes the measured values to the dictionary.
    pub(super) fn measure(&mut self) {
        let position = i64::from(self.counts());
        let velocity = self.actual().velocity;
        let amperes = self.torque.abs() / self.parameters.torque_per_ampere();
        let has_over_voltage = self.alarms.has_over_voltage(self.now_ns);
        let volts = if has_over_voltage { OVER_VOLTAGE } else { self.parameters.supply_voltage };
        // Approximation: the back-EMF takes four fifths of the output at the highest speed.
        let output = 0.8 * velocity / self.parameters.highest_speed()
            + 0.2 * self.torque / self.parameters.peak_torque;
        let has_battery = self.parameters.has_battery && !self.alarms.has_lost_battery;
        let at_position = self.joint.position();
        let inputs = u8::from(self.parameters.switches.dir(at_position))
            | u8::from(self.parameters.switches.pu(at_position)) << 1;
        let (statusword, alarm, shows_alarm) = (self.statusword(), self.alarm_code(), self.shows_alarm());
        let dictionary = &mut self.dictionary;
        dictionary.set(at::ERROR_REGISTER, shows_alarm.into());
        dictionary.set(at::ALARM_CODE, alarm.into());
        dictionary.set_within(at::OUTPUT, 32_767.0 * output);
        dictionary.set(at::BATTERY_LEVEL, if has_battery { FULL_BATTERY } else { 0 });
        dictionary.set(at::STATUSWORD, statusword.into());
        dictionary.set(at::POSITION_INTERNAL, position);
        dictionary.set(at::POSITION, position);
        dictionary.set_within(at::VELOCITY, 10.0 * velocity / COUNTS_PER_SECOND_PER_RPM);
        dictionary.set_within(at::CURRENT, CURRENT_SCALE * amperes);
        dictionary.set_within(at::VOLTAGE, VOLTAGE_SCALE * volts);
        dictionary.set(at::INPUTS, inputs.into());
    }
}
