//! The power of the drive of an axis: what is commanded of it, and what the drive has confirmed.

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
    pub(super) fn begin_watch(&mut self) {
        if !matches!(self, Self::NotReleased(_)) {
            *self = Self::Enabling;
        }
    }

    /// The conditions for enabling hold.
    pub(super) fn grant(&mut self) {
        if *self == Self::Enabling {
            *self = Self::On;
        }
    }

    /// The drive has left operation enabled by itself, or cannot be reached.
    pub(super) fn latch_off(&mut self) {
        *self = Self::Releasing(SetPoint::Kept);
    }

    /// The group begins to disable its drives.
    pub(super) fn release(&mut self) {
        if !matches!(self, Self::Releasing(_) | Self::NotReleased(_)) {
            *self = Self::Releasing(SetPoint::Led);
        }
    }

    /// The drive has confirmed that it has no torque.
    pub(super) fn confirm_off(&mut self) {
        if matches!(self, Self::Releasing(_) | Self::NotReleased(_)) {
            *self = Self::Off { contradictions: 0 };
        }
    }

    /// The drive is not waited for any longer.
    pub(super) fn give_up(&mut self, reason: Unreleased) {
        if matches!(self, Self::Releasing(_)) {
            *self = Self::NotReleased(reason);
        }
    }

    /// The drive has reported.
    pub(super) fn note_report(&mut self, shows_torque: bool) {
        if let Self::Off { contradictions } = *self {
            *self = match contradictions + 1 {
                _ if !shows_torque => Self::Off { contradictions: 0 },
                CONTRADICTIONS => Self::NotReleased(Unreleased::EnabledItself),
                contradictions => Self::Off { contradictions },
            };
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
