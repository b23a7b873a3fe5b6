//! Whether a drive answers in the same cycle in which it is asked, be it by SYNC or by set-points.
//!
//! PDOs carry no number: a reply that is late by a whole cycle looks like one to the next request. A request that is skipped
//! tells them apart. A punctual drive is silent in that cycle; a late one is silent as many cycles later as it is late.

/// A reply that is later than this is not waited for.
const LATEST_CYCLES: u16 = 50;

/// Counts a drive's replies against the requests, SYNCs or set-points, that they belong to. Cycles are those of its bus.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct LateReplyDetector {
    unanswered: u16,
    /// Cycles since the request that was skipped, while its silence is waited for.
    since_skip_cycles: Option<u16>,
    late_cycles: u16,
}

impl LateReplyDetector {
    /// Begins anew, with no request under way.
    pub(super) fn begin(&mut self) {
        *self = Self::default();
    }

    /// Forgets what was found, but not how many requests are unanswered.
    pub(super) fn forget_findings(&mut self) {
        *self = Self { unanswered: self.unanswered, ..Self::default() };
    }

    /// A request leaves.
    pub(super) fn note_request(&mut self) {
        self.unanswered = self.unanswered.saturating_add(1);
    }

    /// The request of a cycle is skipped.
    pub(super) fn note_skip(&mut self) {
        self.since_skip_cycles = Some(0);
    }

    /// A reply arrives, at any time.
    pub(super) fn note_reply(&mut self) {
        self.unanswered = self.unanswered.saturating_sub(1);
    }

    /// Ends a cycle that has had a reply, or has had none. Returns whether it was to have one.
    pub(super) fn pass(&mut self, has_reply: bool) -> bool {
        let Some(cycles) = self.since_skip_cycles else { return true };
        if !has_reply || cycles >= LATEST_CYCLES {
            *self = Self { unanswered: cycles, since_skip_cycles: None, late_cycles: cycles };
        } else {
            self.since_skip_cycles = Some(cycles + 1);
        }
        cycles > 0 || has_reply
    }

    /// Requests that have had no reply, or none yet.
    pub(super) const fn unanswered(&self) -> u16 {
        self.unanswered
    }

    /// How many cycles late the replies have been found to be; 0 for none.
    pub(super) const fn late_cycles(&self) -> u16 {
        self.late_cycles
    }

    /// Returns `true` if every request has been answered in its own cycle.
    pub(super) const fn is_punctual(&self) -> bool {
        self.unanswered == 0 && self.since_skip_cycles.is_none()
    }

    /// Returns `true` if only a request that is skipped can tell.
    pub(super) const fn is_reply_unverified(&self) -> bool {
        self.unanswered > 0 && self.since_skip_cycles.is_none() && self.late_cycles == 0
    }
}

/// The set-point that a drive which answers set-points is not sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) enum SetPointSkip {
    /// No set-point is.
    #[default]
    No,
    /// The next one is.
    Next,
    /// That of this cycle is.
    Now,
}

impl SetPointSkip {
    /// Begins a command.
    pub(super) fn begin_command(&mut self) {
        *self = if *self == Self::Next { Self::Now } else { Self::No };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive that answers so many cycles late is asked, and one request is skipped.
    fn found(late: u16) -> LateReplyDetector {
        let mut detector = LateReplyDetector::default();
        for cycle in 0..200 {
            let is_skipped = cycle == 100;
            if is_skipped {
                assert_eq!(detector.is_reply_unverified(), late > 0);
                assert_eq!(detector.unanswered(), late);
                detector.note_skip();
            } else {
                detector.note_request();
            }
            let has_reply = cycle >= late && cycle - late != 100;
            if has_reply {
                detector.note_reply();
            }
            assert_eq!(detector.pass(has_reply), !(is_skipped && late == 0));
        }
        detector
    }

    #[test]
    fn a_request_that_is_skipped_tells_how_late_the_replies_are() {
        for late in [0, 1, 2, 7, 40] {
            assert_eq!(found(late).late_cycles(), late);
            assert_eq!(found(late).is_punctual(), late == 0);
        }
    }

    #[test]
    fn a_reply_that_was_lost_is_cleared_up_by_silence() {
        let mut detector = LateReplyDetector::default();
        detector.note_request();
        assert!(detector.pass(false) && detector.is_reply_unverified());
        detector.note_skip();
        assert!(!detector.pass(false));
        assert!(detector.is_punctual() && detector.late_cycles() == 0);
    }

    #[test]
    fn one_set_point_is_skipped_and_the_next_is_sent_again() {
        let mut skip = SetPointSkip::Next;
        skip.begin_command();
        assert_eq!(skip, SetPointSkip::Now);
        skip.begin_command();
        assert_eq!(skip, SetPointSkip::No);
    }
}
