//! What the drive of an axis says of itself: its state by its statuswords, and its errors.

use crate::cia402::{DriveState, statusword};

/// A fault shows in the statusword within this many slots of the emergency message that announces it.
const EMERGENCY_GRACE_CYCLES: u8 = 3;
/// Reports in a row without the remote bit that make a drive local: some statuswords may be corrupted.
const LOCAL_REPORTS: u8 = 5;

/// What a drive has reported of its state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct DriveReport {
    state: DriveState,
    /// Statuswords in a row that do not show operation enabled, after one that did.
    contradictions: u8,
    /// The error code of the last emergency message; 0 for none.
    emergency_code: u16,
    /// Slots since that message, while no fault has to be expected for it otherwise.
    since_emergency_cycles: Option<u8>,
    /// True if a fault that was there when the last reset began has been there ever since.
    is_being_reset: bool,
    /// Reports in a row without statusword bit 9 (remote) of a drive that has set it since it was enabled; `None` if it has not.
    without_remote: Option<u8>,
}

impl DriveReport {
    /// Takes the state that a statusword shows.
    ///
    /// A drive that was enabled counts as disabled only when a second statusword says so. One corrupted statusword would
    /// otherwise let the set-point follow the joint while the drive still obeys, and disable it. A fault counts at once.
    pub(super) fn note_state(&mut self, shown: DriveState) {
        if shown == self.state {
            self.contradictions = 0;
            return;
        }
        let contradicts = self.state == DriveState::OperationEnabled && !shown.is_faulted();
        self.contradictions = if contradicts { self.contradictions.saturating_add(1) } else { 0 };
        if self.contradictions == 1 {
            return;
        }
        if self.state.is_faulted() && !shown.is_faulted() {
            (self.emergency_code, self.is_being_reset) = (0, false);
        }
        self.state = shown;
    }

    /// Takes the statusword of the state that was noted last.
    #[inline]
    pub(super) fn note_remote(&mut self, word: u16) {
        self.without_remote = match self.without_remote {
            _ if self.state != DriveState::OperationEnabled => None,
            _ if word & statusword::REMOTE != 0 => Some(0),
            without => without.map(|reports| reports.saturating_add(1)),
        };
    }

    /// Returns true if an enabled drive no longer obeys the bus: it has obeyed it by its statusword since it was enabled.
    #[inline]
    pub(super) fn is_local(&self) -> bool {
        self.without_remote.is_some_and(|reports| reports >= LOCAL_REPORTS)
    }

    /// The drive's state.
    pub(super) const fn state(&self) -> DriveState {
        self.state
    }

    /// Takes the error code of an emergency message; 0 says that all errors are gone.
    pub(super) fn note_emergency(&mut self, code: u16) {
        self.emergency_code = code;
        self.since_emergency_cycles = (code != 0).then_some(0);
    }

    /// The error code of the last emergency message; 0 for none.
    pub(super) const fn emergency_code(&self) -> u16 {
        self.emergency_code
    }

    /// Expects no explanation of an emergency message any more. Its code is kept.
    pub(super) fn dismiss_emergency(&mut self) {
        self.since_emergency_cycles = None;
    }

    /// A fault reset begins. The code of a fault is kept until the fault is gone.
    pub(super) fn begin_fault_reset(&mut self) {
        self.dismiss_emergency();
        self.is_being_reset = self.state.is_faulted();
        if !self.is_being_reset {
            self.emergency_code = 0;
        }
    }

    /// Returns `true` if a fault that was there when the last reset began has been there ever since.
    pub(super) const fn is_being_reset(&self) -> bool {
        self.is_being_reset
    }

    /// Lets a slot pass.
    pub(super) fn pass(&mut self) {
        self.since_emergency_cycles = self.since_emergency_cycles.map(|cycles| cycles.saturating_add(1));
    }

    /// The code of an emergency message that the statusword has had time to explain by a fault.
    pub(super) fn unexplained_emergency(&self) -> Option<u16> {
        let is_over = self.since_emergency_cycles.is_some_and(|cycles| cycles >= EMERGENCY_GRACE_CYCLES);
        is_over.then_some(self.emergency_code)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_statusword_that_contradicts_operation_enabled_counts_for_nothing_and_a_fault_counts_at_once() {
        let mut report = DriveReport::default();
        report.note_state(DriveState::OperationEnabled);
        report.note_state(DriveState::SwitchedOn);
        assert_eq!(report.state(), DriveState::OperationEnabled);
        report.note_state(DriveState::SwitchedOn);
        assert_eq!(report.state(), DriveState::SwitchedOn);
        report.note_state(DriveState::OperationEnabled);
        report.note_state(DriveState::Fault);
        assert_eq!(report.state(), DriveState::Fault);
    }

    #[test]
    fn the_code_of_a_fault_is_kept_until_the_fault_is_gone() {
        let mut report = DriveReport::default();
        report.note_state(DriveState::Fault);
        report.note_emergency(0x2310);
        report.begin_fault_reset();
        assert_eq!(report.emergency_code(), 0x2310);
        assert!(report.is_being_reset());
        report.note_state(DriveState::SwitchOnDisabled);
        assert_eq!((report.emergency_code(), report.is_being_reset()), (0, false));
    }

    #[test]
    fn a_drive_is_local_when_a_remote_bit_that_it_has_set_while_it_is_enabled_is_gone_for_some_reports() {
        const ENABLED: u16 = 0x0037;
        let local_after = |words: &[u16]| {
            let mut report = DriveReport::default();
            words
                .iter()
                .map(|word| {
                    report.note_state(DriveState::decode(*word));
                    report.note_remote(*word);
                    report.is_local()
                })
                .position(|is_local| is_local)
        };
        let remote = ENABLED | statusword::REMOTE;
        assert_eq!(local_after(&[remote, ENABLED, ENABLED, ENABLED, ENABLED, ENABLED]), Some(5));
        assert_eq!(local_after(&[remote, ENABLED, ENABLED, ENABLED, ENABLED, remote, ENABLED]), None);
        assert_eq!(local_after(&[ENABLED; 20]), None, "a drive without this bit");
        assert_eq!(
            local_after(&[0x0231, 0x0231, ENABLED, ENABLED, ENABLED, ENABLED, ENABLED, ENABLED]),
            None
        );
    }

    #[test]
    fn an_emergency_message_has_some_slots_to_be_explained_by_a_fault() {
        let mut report = DriveReport::default();
        report.note_emergency(0x8130);
        for _ in 0..EMERGENCY_GRACE_CYCLES {
            assert_eq!(report.unexplained_emergency(), None);
            report.pass();
        }
        assert_eq!(report.unexplained_emergency(), Some(0x8130));
        report.note_emergency(0);
        assert_eq!(report.unexplained_emergency(), None);
    }
}
