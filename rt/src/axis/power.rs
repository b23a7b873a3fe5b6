//! The power of the drive of an axis: what is commanded of it, and what the drive has confirmed.

use super::Axis;
use crate::bit_fields::ReplyValue;
use crate::cia402::DriveState;
use crate::fault::Fault;

/// Reports in a row that show torque, after which a drive that has confirmed that it has none is not disabled any more: one
/// corrupted statusword is no torque.
const CONTRADICTIONS: u8 = 4;

/// The power of a drive. The module documentation of [`crate::axis`] has the table of states and events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) enum Power {
    /// The drive has confirmed that it has no torque.
    Off {
        /// Reports in a row that show torque all the same.
        contradictions: u8,
    },
    /// The group is being enabled, and the drive is not to be enabled yet.
    Enabling,
    /// The drive may be led to operation enabled, and kept there.
    On,
    /// The drive is to have no torque, and has not confirmed that yet.
    Releasing(SetPoint),
    /// The drive has not confirmed in time that it has no torque, or has got torque by itself.
    NotReleased(Unreleased),
}

/// The set-point of a drive that is to have no torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) enum SetPoint {
    /// It goes on to rest while the drive obeys, and follows the joint afterwards.
    Led,
    /// It stays where it is: the drive has left operation enabled by itself, or cannot be reached.
    Kept,
}

/// Why a drive is not known to have no torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) enum Unreleased {
    /// It has not reported.
    Silent,
    /// It shows torque.
    Disobeying,
    /// It has shown torque after it had confirmed that it has none.
    EnabledItself,
}

impl Default for Power {
    fn default() -> Self {
        Self::Releasing(SetPoint::Led)
    }
}

impl Power {
    /// The drive is brought up again, which gives it no torque: that it had none stays confirmed, and whatever else is known is forgotten.
    pub(super) fn anew(self) -> Self {
        match self {
            Self::Off { .. } => Self::Off { contradictions: 0 },
            _ => Self::default(),
        }
    }

    /// The group begins to enable its drives: every drive must show anew that it may be enabled.
    fn begin_watch(&mut self) {
        if !matches!(self, Self::NotReleased(_)) {
            *self = Self::Enabling;
        }
    }

    /// The conditions for enabling hold.
    fn grant(&mut self) {
        if *self == Self::Enabling {
            *self = Self::On;
        }
    }

    /// The drive has left operation enabled by itself, or cannot be reached.
    fn latch_off(&mut self) {
        *self = Self::Releasing(SetPoint::Kept);
    }

    /// The group begins to disable its drives.
    fn release(&mut self) {
        if !matches!(self, Self::Releasing(_) | Self::NotReleased(_)) {
            *self = Self::Releasing(SetPoint::Led);
        }
    }

    /// The drive has confirmed that it has no torque.
    fn confirm_off(&mut self) {
        if matches!(self, Self::Releasing(_) | Self::NotReleased(_)) {
            *self = Self::Off { contradictions: 0 };
        }
    }

    /// The drive is not waited for any longer.
    fn give_up(&mut self, reason: Unreleased) {
        if matches!(self, Self::Releasing(_)) {
            *self = Self::NotReleased(reason);
        }
    }

    /// The drive has reported.
    fn note_report(&mut self, shows_torque: bool) {
        if let Self::Off { contradictions } = *self {
            *self = match contradictions + 1 {
                _ if !shows_torque => Self::Off { contradictions: 0 },
                CONTRADICTIONS => Self::NotReleased(Unreleased::EnabledItself),
                contradictions => Self::Off { contradictions },
            };
        }
    }
}

impl Axis {
    /// Begins to watch the power: the group begins to enable its drives.
    pub(super) fn begin_to_watch_power(&mut self) {
        self.power.begin_watch();
    }

    /// Takes the power from the drive for good: it has left operation enabled by itself, or cannot be reached. It is not led
    /// back before it is watched anew, and its set-point stays.
    pub fn latch_off(&mut self) {
        self.power.latch_off();
    }

    /// The group begins to disable its drives.
    pub fn release_power(&mut self) {
        self.power.release();
    }

    /// Takes what the drive has shown while its group is disabled, or is about to be. A drive that has not confirmed that it has no
    /// torque is not waited for any longer if `is_overdue`. Its set-point follows the joint again.
    pub fn settle_power(&mut self, is_overdue: bool) {
        if self.confirms_off() {
            self.power.confirm_off();
        } else if is_overdue {
            self.power.give_up(if self.is_reporting() { Unreleased::Disobeying } else { Unreleased::Silent });
        }
    }

    /// Takes a report for the power of a drive that is to have none.
    #[inline]
    pub(super) fn note_power_report(&mut self) {
        if self.is_power_off() {
            let shows_torque = self.shows_torque();
            self.power.note_report(shows_torque);
        }
    }

    /// The fault of a drive that is not known to have no torque. That it is silent is one only where no other fault has been
    /// latched.
    pub fn unreleased_fault(&self, has_fault: bool) -> Option<Fault> {
        let (state, silent_cycles) = (self.drive_state(), self.feedback_age());
        match self.power {
            Power::NotReleased(Unreleased::Silent) if has_fault => None,
            Power::NotReleased(Unreleased::Silent | Unreleased::Disobeying) => {
                Some(Fault::NotDisabled { state, silent_cycles })
            }
            Power::NotReleased(Unreleased::EnabledItself) => Some(Fault::DriveEnabled { state }),
            Power::Off { .. } | Power::Enabling | Power::On | Power::Releasing(_) => None,
        }
    }

    /// Grants power to the drive if it may be enabled. It has been disabled for so long that nothing older is under way in
    /// either direction, it shows no fault, its reports come in their own cycle, and its joint is at rest. The set-point leaps to the joint:
    /// somebody may have turned it faster than the set-point follows.
    pub fn prepare_to_enable(&mut self, period_s: f64) {
        if self.shows_rest_without_torque()
            && !self.drive_state().is_faulted()
            && self.is_position_commandable()
            && self.controlwords.is_disabled_for_long()
        {
            if !self.is_on_joint(period_s) && self.power == Power::Enabling {
                self.start_from_actual();
            }
            self.power.grant();
        }
    }

    /// Returns `true` if the drive may be led to operation enabled and kept there.
    pub fn is_power_granted(&self) -> bool {
        self.power == Power::On
    }

    /// Returns `true` if the drive has been taken out of operation enabled for good.
    pub(super) fn is_latched_off(&self) -> bool {
        matches!(self.power, Power::Releasing(SetPoint::Kept))
    }

    /// Returns `true` if the drive is known to have no torque.
    pub const fn is_power_off(&self) -> bool {
        matches!(self.power, Power::Off { .. })
    }

    /// Returns `true` if the drive has not given up its torque in time.
    pub const fn is_not_released(&self) -> bool {
        matches!(self.power, Power::NotReleased(_))
    }

    /// Returns `true` if the drive follows set-points.
    #[inline]
    pub fn is_enabled(&self) -> bool {
        self.drive_state() == DriveState::OperationEnabled && !self.is_latched_off()
    }

    /// Returns `true` if the drive has confirmed that it has no torque since it was told to have none: by a report, or by SDO.
    #[inline]
    pub(super) fn confirms_off(&self) -> bool {
        let is_told = self.is_told_to_switch_off() && !self.may_be_switching_on();
        is_told && !self.has_torque() && (self.is_reporting() || self.has_confirmed_by_service())
    }

    fn is_reporting(&self) -> bool {
        self.is_heard() && self.feedback_age() <= self.parameters.missed_feedback_cycles
    }

    /// Returns `true` if the last report shows torque that the drive was not told to have. The reaction to a fault is none.
    fn shows_torque(&self) -> bool {
        match &self.parameters.exchange {
            super::Exchange::BitFields(by) => {
                self.field_drive.reported(by, ReplyValue::Run).is_some_and(|run| run != 0.0)
            }
            _ => matches!(self.drive_state(), DriveState::OperationEnabled | DriveState::QuickStopActive),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Power::{self, Enabling, NotReleased, Off, On, Releasing};
    use super::{CONTRADICTIONS, SetPoint, Unreleased};

    const OFF: Power = Off { contradictions: 0 };
    const LED: Power = Releasing(SetPoint::Led);
    const KEPT: Power = Releasing(SetPoint::Kept);
    const STUCK: Power = NotReleased(Unreleased::Disobeying);

    /// What becomes of each state, in the order Off, Enabling, On, Releasing (led, kept), NotReleased.
    fn after(event: impl Fn(&mut Power)) -> [Power; 6] {
        [OFF, Enabling, On, LED, KEPT, STUCK].map(|mut power| {
            event(&mut power);
            power
        })
    }

    #[test]
    fn every_event_leads_where_the_table_says() {
        let silent = NotReleased(Unreleased::Silent);
        assert_eq!(after(|power| *power = power.anew()), [OFF, LED, LED, LED, LED, LED]);
        assert_eq!(after(Power::begin_watch), [Enabling, Enabling, Enabling, Enabling, Enabling, STUCK]);
        assert_eq!(after(Power::grant), [OFF, On, On, LED, KEPT, STUCK]);
        assert_eq!(after(Power::latch_off), [KEPT; 6]);
        assert_eq!(after(Power::release), [LED, LED, LED, LED, KEPT, STUCK]);
        assert_eq!(after(Power::confirm_off), [OFF, Enabling, On, OFF, OFF, OFF]);
        assert_eq!(
            after(|power| power.give_up(Unreleased::Silent)),
            [OFF, Enabling, On, silent, silent, STUCK]
        );
    }

    #[test]
    fn a_drive_that_is_off_has_enabled_itself_when_some_reports_in_a_row_show_torque() {
        let enabled_itself = NotReleased(Unreleased::EnabledItself);
        for reports in 0..=CONTRADICTIONS {
            let shown = after(|power| (0..reports).for_each(|_| power.note_report(true)));
            let off = if reports < CONTRADICTIONS { Off { contradictions: reports } } else { enabled_itself };
            assert_eq!(shown, [off, Enabling, On, LED, KEPT, STUCK]);
        }
        let mut power = OFF;
        for shows_torque in [true, true, true, false, true, true, true] {
            power.note_report(shows_torque);
        }
        assert_eq!(power, Off { contradictions: CONTRADICTIONS - 1 });
    }
}
