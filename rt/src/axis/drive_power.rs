//! What is commanded of the power of a drive, and what is known of it.

use super::Axis;
use super::exchange::Exchange;
use super::power::{Power, SetPoint, Unreleased};
use crate::bit_fields::ReplyValue;
use crate::cia402::DriveState;
use crate::fault::Fault;

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
            Exchange::BitFields(by) => {
                self.field_drive.reported(by, ReplyValue::Run).is_some_and(|run| run != 0.0)
            }
            _ => matches!(self.drive_state(), DriveState::OperationEnabled | DriveState::QuickStopActive),
        }
    }
}
