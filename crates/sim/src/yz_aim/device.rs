//! Controlword and statusword (manual 5.04). This drive has no CiA 402 state machine, only a level that the controlword
//! sets.

use takt_rt::{DriveState, Nanoseconds, controlword};

use super::parameters::Quirks;

/// The level that the controlword has set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// No controlword since power-up: the shaft is held.
    Cold,
    /// Off: the shaft is free.
    Off,
    /// 0006h: the shaft is free.
    Ready,
    /// 0007h: the shaft is free.
    SwitchedOn,
    /// 000Fh: the drive follows set-points.
    Enabled,
}

impl Level {
    fn wanted(word: u16) -> Self {
        const VOLTAGE_AND_QUICK_STOP: u16 = 0x06;
        match word & 0x0F {
            bits if bits & VOLTAGE_AND_QUICK_STOP != VOLTAGE_AND_QUICK_STOP => Self::Off,
            0x0F => Self::Enabled,
            0x07 => Self::SwitchedOn,
            _ => Self::Ready,
        }
    }

    /// The corresponding CiA 402 state, for an observer.
    pub fn state(self) -> DriveState {
        match self {
            Self::Cold | Self::Off => DriveState::SwitchOnDisabled,
            Self::Ready => DriveState::ReadyToSwitchOn,
            Self::SwitchedOn => DriveState::SwitchedOn,
            Self::Enabled => DriveState::OperationEnabled,
        }
    }
}

/// Conditions for other bits of the statusword.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conditions {
    /// Bit 2: the motor is energised.
    pub is_energised: bool,
    /// Bit 3: alarm.
    pub has_alarm: bool,
    /// Bit 10: target reached.
    pub is_target_reached: bool,
    /// Bit 4 in mode 6, in which the motor turns without a controlword.
    pub is_homing: bool,
    /// Bit 12: homing complete.
    pub is_homed: bool,
    /// Bit 13: homing error.
    pub has_homing_error: bool,
}

/// The state that the controlword has set.
#[derive(Clone, Copy, Debug)]
pub struct YzAimDevice {
    level: Level,
    /// True if 0006h has been received since power-up.
    has_shut_down: bool,
    word: u16,
    raised_ns: Option<Nanoseconds>,
}

impl YzAimDevice {
    /// A drive after power-up.
    pub const fn cold() -> Self {
        Self { level: Level::Cold, has_shut_down: false, word: 0, raised_ns: None }
    }

    /// The level.
    pub fn level(&self) -> Level {
        self.level
    }

    /// Returns `true` if controlword bit 8 halts the motion.
    pub fn is_halted(&self) -> bool {
        self.level == Level::Enabled && self.word & controlword::HALT != 0
    }

    /// Controlword bit 5: a written target starts a move at once.
    pub fn is_immediate(&self) -> bool {
        self.word & controlword::BIT_5 != 0
    }

    /// Controlword bit 6: targets are relative.
    pub fn is_relative(&self) -> bool {
        self.word & controlword::RELATIVE != 0
    }

    /// Takes a controlword.
    ///
    /// With the quirks, two kinds of controlword have no effect: one that skips 0006h after power-up, and one that
    /// raises the level too soon after the last.
    pub fn take(&mut self, now_ns: Nanoseconds, word: u16, quirks: &Quirks) {
        let wanted = Level::wanted(word);
        let is_raising = wanted > self.level.max(Level::Off);
        let is_too_soon = self
            .raised_ns
            .is_some_and(|raised_ns| now_ns.saturating_sub(raised_ns) < quirks.controlword_interval_ns);
        let is_too_far = quirks.needs_shutdown_first && !self.has_shut_down && wanted > Level::Ready;
        if is_raising && (is_too_soon || is_too_far) {
            return;
        }
        if is_raising {
            self.raised_ns = Some(now_ns);
        }
        self.has_shut_down |= wanted == Level::Ready;
        self.level = wanted;
        self.word = word;
    }

    /// The statusword. Bits 6 to 9, 11, 14 and 15 do not exist.
    pub fn statusword(&self, conditions: Conditions) -> u16 {
        let is_ready = self.level >= Level::Ready;
        let bits = [
            (is_ready, 0),
            (self.level >= Level::SwitchedOn, 1),
            (conditions.is_energised, 2),
            (conditions.has_alarm, 3),
            (is_ready || conditions.is_homing, 4),
            (is_ready, 5),
            (conditions.is_target_reached, 10),
            (conditions.is_homed, 12),
            (conditions.has_homing_error, 13),
        ];
        bits.into_iter().fold(0, |word, (is_set, bit)| word | u16::from(is_set) << bit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MILLISECOND_NS: Nanoseconds = 1_000_000;

    fn energised() -> Conditions {
        Conditions { is_energised: true, is_target_reached: true, ..Conditions::default() }
    }

    #[test]
    fn a_drive_after_power_up_ignores_0007_and_000f_before_0006() {
        let mut device = YzAimDevice::cold();
        for word in [0x07, 0x0F, 0x2F] {
            device.take(0, word, &Quirks::default());
            assert_eq!(device.statusword(energised()), 0x0404);
        }
        let steps = [(0x06, Level::Ready), (0x07, Level::SwitchedOn), (0x0F, Level::Enabled)];
        for ((word, level), now_ns) in steps.into_iter().zip([100, 120, 140]) {
            device.take(now_ns * MILLISECOND_NS, word, &Quirks::default());
            assert_eq!(device.level(), level);
        }
        assert_eq!(device.statusword(energised()), 0x0437);
    }

    #[test]
    fn a_controlword_too_soon_is_ignored_unless_it_lowers_the_level() {
        let mut device = YzAimDevice::cold();
        device.take(0, 0x06, &Quirks::default());
        device.take(19 * MILLISECOND_NS, 0x07, &Quirks::default());
        assert_eq!(device.level(), Level::Ready);
        device.take(20 * MILLISECOND_NS, 0x07, &Quirks::default());
        assert_eq!(device.level(), Level::SwitchedOn);
        device.take(21 * MILLISECOND_NS, 0x00, &Quirks::default());
        assert_eq!(device.level(), Level::Off);
    }

    #[test]
    fn without_quirks_000f_alone_enables() {
        let mut device = YzAimDevice::cold();
        device.take(0, 0x0F, &Quirks::none());
        assert_eq!(device.level(), Level::Enabled);
    }
}
