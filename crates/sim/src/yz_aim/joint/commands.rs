//! The effects of the values that a master writes.

use takt_rt::{Nanoseconds, controlword};
use takt_wire::canopen::object::ObjectAddress;

use super::{COUNTS_PER_SECOND_PER_RPM, COUNTS_PER_TURN, YzAimJoint, mode};
use crate::cia402::homing::Homing;
use crate::cia402::node::CanopenNode;
use crate::yz_aim::device::Level;

/// The homing methods that the manual names but does not describe.
const UNDESCRIBED: [i64; 2] = [20, 22];
/// The two values of 260Ah that set the multi-turn zero.
const ZERO_ARM: i64 = 60_006;
const ZERO: i64 = 60_016;
/// 2619h: return to the multi-turn zero at power-up.
const RETURN_TO_ZERO: i64 = 6;

impl YzAimJoint {
    /// Applies the controlword in the dictionary.
    fn take_controlword(&mut self, now_ns: Nanoseconds) {
        let word = self.number(self.places.controlword) as u16;
        // The drive clears bit 4 by itself.
        self.canopen.dictionary.set_at(self.places.controlword, (word & !controlword::BIT_4).into());
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
    fn change_mode(&mut self) {
        let mode = self.mode();
        if std::mem::replace(&mut self.last_mode, mode) == mode {
            return;
        }
        self.homing = Homing::idle();
        self.engage();
        if mode == mode::HOMING {
            self.begin_homing();
        }
    }

    fn begin_homing(&mut self) {
        let method = self.number(self.places.homing_method);
        let is_described = self.parameters.homing.has_undescribed_methods || !UNDESCRIBED.contains(&method);
        (self.homing, self.homing_s) = (Homing::idle(), 0.0);
        self.homing.start(if is_described { method } else { 0 }, &self.switches());
    }

    /// Applies the effects of an RPDO, whose data is in the dictionary. The controlword takes effect last, except for a target that it
    /// activates at once.
    pub(super) fn apply_rpdo(&mut self, now_ns: Nanoseconds, number: usize, is_by_sync: bool) {
        let word = self.number(self.places.controlword) as u16;
        self.change_mode();
        let carries = |unit: &Self, place| unit.canopen.pdos.carries(number, place);
        let has_controlword = carries(self, self.places.controlword);
        if has_controlword {
            self.take_controlword(now_ns);
        }
        let has_started = has_controlword && word & controlword::BIT_4 != 0;
        if is_by_sync && !has_controlword {
            self.interpolate();
        } else if carries(self, self.places.target_position) && !has_started {
            self.take_target();
        }
    }

    /// Applies a target in 607Ah that bit 5 activates at once.
    fn take_target(&mut self) {
        if self.is_in_mode(mode::PROFILE_POSITION) && self.device.is_immediate() {
            self.follow_target();
        }
    }

    fn follow_target(&mut self) {
        if std::mem::take(&mut self.ignores_target) {
            return;
        }
        let base = if self.device.is_relative() { self.motion.target() } else { 0.0 };
        self.motion.move_to(base + self.real(self.places.target_position));
    }

    /// Applies a target that SYNC activates.
    fn interpolate(&mut self) {
        if !self.interpolates() {
            return self.take_target();
        }
        if !std::mem::take(&mut self.ignores_target) {
            self.motion.interpolate_to(self.real(self.places.target_position));
        }
    }

    /// Applies the effects of a value that was written by SDO.
    pub(super) fn apply_written(
        &mut self,
        ObjectAddress { index, subindex }: ObjectAddress,
        now_ns: Nanoseconds,
    ) {
        let value = self.number(self.canopen.dictionary.place(index, subindex));
        if let Some(bit_rate) = self.bit_rate_change.written(index, value) {
            self.next_bit_rate = bit_rate;
        }
        match index {
            0x1016 => self.is_master_lost = false,
            0x2601 if value == 1 => self.clear_alarms(now_ns),
            0x260A => self.take_gear_numerator(value),
            0x260C => self.travel(value as f64),
            0x2614 if value == 1 => self.canopen.begin_save(now_ns),
            0x6040 => self.take_controlword(now_ns),
            0x6060 => self.change_mode(),
            0x607A => self.take_target(),
            _ => {}
        }
    }

    fn clear_alarms(&mut self, now_ns: Nanoseconds) {
        if self.alarms.clear(now_ns) {
            self.canopen.dictionary.set_at(self.places.output_enable, 1);
        }
        if self.alarms.is_stopped() {
            self.canopen.dictionary.set_at(self.places.output_enable, 0);
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
        let numerator = self.real(self.places.gear_numerator);
        let gear = if numerator > 0.0 { numerator / self.real(self.places.gear_denominator) } else { 1.0 };
        self.motion.move_to(self.motion.target() + (steps * gear).round());
    }

    /// Sets the multi-turn zero (manual V.2): 60006, then 60016.
    fn take_gear_numerator(&mut self, value: i64) {
        let is_armed = std::mem::replace(&mut self.is_zero_armed, value == ZERO_ARM);
        if value != ZERO || !is_armed || !self.has_battery() {
            return;
        }
        // The new position is 0 or a positive number of one digit.
        let counts = self.random.within(0..10) as i32;
        self.set_counts(counts);
        self.alarms.has_lost_battery = false;
        let CanopenNode { dictionary, .. } = &mut self.canopen;
        if let Some(place) = self.places.gear_numerator {
            dictionary.set(place, dictionary.saved(place));
        }
    }

    /// Starts the move of the special function at power-up (manual V.3.B).
    pub(super) fn move_after_power_up(&mut self) {
        let turn = COUNTS_PER_TURN as i32;
        let target = match self.special_function {
            RETURN_TO_ZERO if self.has_battery() && !self.alarms.has_lost_battery => 0.0,
            angle @ 30.. => f64::from(self.counts().div_euclid(turn) * turn) + angle as f64,
            _ => return,
        };
        // The last digit of 6083h: 0 to 9 for 100 to 1000 r/min.
        let digit = self.number(self.places.acceleration) % 10;
        self.power_up_speed = Some((digit + 1) as f64 * 100.0 * COUNTS_PER_SECOND_PER_RPM);
        self.engage();
        self.was_energised = true;
        self.motion.move_to(target);
    }
}
