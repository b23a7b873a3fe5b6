//! The effects of the values that a master writes.

use takt_rt::{Nanoseconds, controlword};
use takt_wire::canopen::object::ObjectAddress;

use super::{COUNTS_PER_SECOND_PER_RPM, COUNTS_PER_TURN, YzAimJoint, mode};
use crate::drive::NodeState;
use crate::pdo_engine::is_parameter;
use crate::yz_aim::device::Level;
use crate::yz_aim::homing::Homing;
use crate::yz_aim::objects::at;

/// Time from 2614h = 1 until everything is stored.
const SAVE_NS: Nanoseconds = 50_000_000;
/// The two values of 260Ah that set the multi-turn zero.
const ZERO_ARM: i64 = 60_006;
const ZERO: i64 = 60_016;
/// 2619h: return to the multi-turn zero at power-up.
const RETURN_TO_ZERO: i64 = 6;

impl YzAimJoint {
    /// Applies the controlword in the dictionary.
    pub(super) fn take_controlword(&mut self, now_ns: Nanoseconds) {
        let word = self.dictionary.number(at::CONTROLWORD) as u16;
        // The drive clears bit 4 by itself.
        self.dictionary.set(at::CONTROLWORD, (word & !controlword::BIT_4).into());
        if word & controlword::FAULT_RESET != 0 {
            self.clear_alarms(now_ns);
        }
        let before = self.device.level();
        self.device.take(now_ns, word, &self.parameters.quirks);
        let level = self.device.level();
        if level != before {
            self.engage();
            self.ignores_target = level == Level::Enabled && self.parameters.quirks.ignores_first_target;
        }
        if word & controlword::BIT_4 != 0 && self.is_in_mode(mode::PROFILE_POSITION) {
            self.follow_target();
        } else if word & controlword::BIT_4 != 0 && self.is_in_mode(mode::HOMING) {
            self.begin_homing();
        }
    }

    /// Applies a change of 6060h.
    pub(super) fn change_mode(&mut self, before: i64) {
        let mode = self.mode();
        if mode == before {
            return;
        }
        self.homing = Homing::idle();
        self.engage();
        if mode == mode::HOMING {
            self.begin_homing();
        }
    }

    fn begin_homing(&mut self) {
        let has_undescribed_methods = self.parameters.homing.has_undescribed_methods;
        self.homing = Homing::start(self.dictionary.number(at::HOMING_METHOD), has_undescribed_methods);
    }

    /// Applies a target in 607Ah that bit 5 activates at once.
    pub(super) fn take_target(&mut self) {
        if self.is_in_mode(mode::PROFILE_POSITION) && self.device.is_immediate() {
            self.follow_target();
        }
    }

    fn follow_target(&mut self) {
        if std::mem::take(&mut self.ignores_target) {
            return;
        }
        let base = if self.device.is_relative() { self.motion.target() } else { 0.0 };
        self.motion.move_to(base + self.dictionary.real(at::TARGET_POSITION));
    }

    /// Applies a target that SYNC activates.
    pub(super) fn interpolate(&mut self) {
        if !self.interpolates() {
            return self.take_target();
        }
        if !std::mem::take(&mut self.ignores_target) {
            self.motion.interpolate_to(self.dictionary.real(at::TARGET_POSITION));
        }
    }

    /// Applies the effects of a value that was written by SDO.
    pub(super) fn written(&mut self, address: ObjectAddress, place: usize, before: i64, now_ns: Nanoseconds) {
        let value = self.dictionary.number(place);
        if let Some(bit_rate) = self.bit_rate_change.written(place, value) {
            self.next_bit_rate = bit_rate;
        }
        match place {
            at::CONTROLWORD => self.take_controlword(now_ns),
            at::OPERATION_MODE => self.change_mode(before),
            at::TARGET_POSITION => self.take_target(),
            at::OUTPUT_ENABLE if value == 1 => self.clear_alarms(now_ns),
            at::INCREMENTAL_POSITION => self.travel(value as f64),
            at::GEAR_NUMERATOR => self.take_gear_numerator(value),
            at::SAVE_FLAG if value == 1 => self.save_ns = now_ns + SAVE_NS,
            _ => self.written_parameter(address.index, now_ns),
        }
    }

    /// Applies the effects of a communication parameter.
    fn written_parameter(&mut self, index: u16, now_ns: Nanoseconds) {
        match index {
            0x1016 => {
                self.network.stop_master_monitor();
                self.is_master_lost = false;
            }
            0x1017 => self.network.schedule_heartbeat(now_ns, &self.dictionary),
            index if is_parameter(index) => {
                self.pdos.update(&self.dictionary);
                // Event timers run in NMT operational only; they start when the node enters it.
                if index >= 0x1800 && self.network.state() == NodeState::Operational {
                    self.transmission.schedule_events(now_ns, &self.pdos);
                }
            }
            _ => {}
        }
    }

    fn clear_alarms(&mut self, now_ns: Nanoseconds) {
        if self.alarms.clear(now_ns) {
            self.dictionary.set(at::OUTPUT_ENABLE, 1);
        }
        if self.alarms.is_stopped() {
            self.dictionary.set(at::OUTPUT_ENABLE, 0);
        }
    }

    /// Moves by an increment of 260Ch, in pulses before the electronic gear.
    fn travel(&mut self, steps: f64) {
        let is_positioning = self.is_in_mode(mode::PROFILE_POSITION) || self.device.level() == Level::Cold;
        if !is_positioning || !self.is_energised() {
            return;
        }
        self.power_up_speed = None;
        // A numerator of 0 is a switch, not a ratio.
        let numerator = self.dictionary.real(at::GEAR_NUMERATOR);
        let gear = if numerator > 0.0 { numerator / self.dictionary.real(at::GEAR_DENOMINATOR) } else { 1.0 };
        self.motion.move_to(self.motion.target() + (steps * gear).round());
    }

    /// Sets the multi-turn zero (manual V.2): 60006, then 60016.
    fn take_gear_numerator(&mut self, value: i64) {
        let is_armed = std::mem::replace(&mut self.is_zero_armed, value == ZERO_ARM);
        if value != ZERO || !is_armed || !self.parameters.has_battery {
            return;
        }
        // The new position is 0 or a positive number of one digit.
        let counts = self.random.within(0..10) as i32;
        self.set_counts(counts);
        self.alarms.has_lost_battery = false;
        self.dictionary.set(at::GEAR_NUMERATOR, self.dictionary.saved(at::GEAR_NUMERATOR));
    }

    /// Starts the move of the special function at power-up (manual V.3.B).
    pub(super) fn move_after_power_up(&mut self) {
        let turn = COUNTS_PER_TURN as i32;
        let target = match self.special_function {
            RETURN_TO_ZERO if self.parameters.has_battery && !self.alarms.has_lost_battery => 0.0,
            angle @ 30.. => f64::from(self.counts().div_euclid(turn) * turn) + angle as f64,
            _ => return,
        };
        // The last digit of 6083h: 0 to 9 for 100 to 1000 r/min.
        let digit = self.dictionary.number(at::ACCELERATION) % 10;
        self.power_up_speed = Some((digit + 1) as f64 * 100.0 * COUNTS_PER_SECOND_PER_RPM);
        self.engage();
        self.was_energised = true;
        self.motion.move_to(target);
    }
}
