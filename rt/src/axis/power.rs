//! Whether the drive of an axis may have power.

/// The permission of a drive to reach and to keep operation enabled. It is decided here, from what the drive reports; the
/// module documentation of [`crate::axis`] has the table of states and events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) enum Power {
    /// The drive is not to be enabled.
    #[default]
    Off,
    /// A fault reset has been requested for the fault that the drive still shows.
    Resetting,
    /// The drive may be led to operation enabled, and kept there.
    Granted,
    /// The drive has left operation enabled by itself, or cannot be reached. It is not enabled again, and its set-point stays
    /// where it is.
    LatchedOff,
}

impl Power {
    /// The group begins to enable its drives: every drive must show anew that it may be enabled.
    pub(super) fn begin_watch(&mut self) {
        if *self != Self::Resetting {
            *self = Self::Off;
        }
    }

    /// The conditions for enabling hold.
    pub(super) fn grant(&mut self) {
        if *self == Self::Off {
            *self = Self::Granted;
        }
    }

    /// The drive has left operation enabled by itself, or cannot be reached.
    pub(super) fn latch_off(&mut self) {
        *self = Self::LatchedOff;
    }

    /// The group is disabled: nothing that the last enabling has left behind counts any more.
    pub(super) fn release_latch(&mut self) {
        self.begin_watch();
    }

    /// A fault reset begins.
    pub(super) fn begin_fault_reset(&mut self, is_faulted: bool) {
        if is_faulted {
            *self = Self::Resetting;
        } else {
            self.note_fault_gone();
        }
    }

    /// The drive shows no fault any more.
    pub(super) fn note_fault_gone(&mut self) {
        if *self == Self::Resetting {
            *self = Self::Off;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Power::{self, Granted, LatchedOff, Off, Resetting};

    /// What becomes of each state, in the order Off, Resetting, Granted, LatchedOff.
    fn after(event: impl Fn(&mut Power)) -> [Power; 4] {
        [Off, Resetting, Granted, LatchedOff].map(|mut power| {
            event(&mut power);
            power
        })
    }

    #[test]
    fn every_event_leads_where_the_table_says() {
        assert_eq!(after(Power::begin_watch), [Off, Resetting, Off, Off]);
        assert_eq!(after(Power::grant), [Granted, Resetting, Granted, LatchedOff]);
        assert_eq!(after(Power::latch_off), [LatchedOff; 4]);
        assert_eq!(after(Power::release_latch), [Off, Resetting, Off, Off]);
        assert_eq!(after(|power| power.begin_fault_reset(true)), [Resetting; 4]);
        assert_eq!(after(|power| power.begin_fault_reset(false)), [Off, Off, Granted, LatchedOff]);
        assert_eq!(after(Power::note_fault_gone), [Off, Off, Granted, LatchedOff]);
    }
}
