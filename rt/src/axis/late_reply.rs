//! Whether a drive answers before it is asked again, be it by SYNC or by set-points. PDOs carry no number: an answer that is
//! late by a whole cycle looks like one to the next question. What tells is a question that is left out: a punctual drive is
//! silent in that cycle, one that is late is so as many cycles later.

/// An answer that is later than this is not waited for.
const LATEST_CYCLES: u16 = 50;

/// Counts a drive's answers against the questions, SYNCs or set-points, that they belong to. Cycles are those of its bus.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LateReplyDetector {
    unanswered: u16,
    /// Cycles since the question that was left out, while its silence is waited for.
    since_gap: Option<u16>,
    late_cycles: u16,
}

impl LateReplyDetector {
    /// Begins anew, with no question on the way.
    pub(super) fn begin(&mut self) {
        *self = Self::default();
    }

    /// Forgets what was found, but not what is still unanswered.
    pub(super) fn forget_findings(&mut self) {
        *self = Self { unanswered: self.unanswered, ..Self::default() };
    }

    /// A question leaves.
    pub(super) fn ask(&mut self) {
        self.unanswered = self.unanswered.saturating_add(1);
    }

    /// The question of a cycle is left out.
    pub(super) fn skip_request(&mut self) {
        self.since_gap = Some(0);
    }

    /// An answer comes, whenever that is.
    pub(super) fn answer(&mut self) {
        self.unanswered = self.unanswered.saturating_sub(1);
    }

    /// Takes whether a cycle has had an answer. Returns whether it was to have one.
    pub(super) fn pass(&mut self, has_answer: bool) -> bool {
        let Some(cycles) = self.since_gap else { return true };
        if !has_answer || cycles >= LATEST_CYCLES {
            *self = Self { unanswered: cycles, since_gap: None, late_cycles: cycles };
        } else {
            self.since_gap = Some(cycles + 1);
        }
        cycles > 0 || has_answer
    }

    /// Questions that have had no answer, or none yet.
    pub(super) const fn unanswered(&self) -> u16 {
        self.unanswered
    }

    /// How many cycles late the answers have been found to be; 0 for none.
    pub(super) const fn late_cycles(&self) -> u16 {
        self.late_cycles
    }

    /// Whether every question has been answered in its own cycle.
    pub(super) const fn is_punctual(&self) -> bool {
        self.unanswered == 0 && self.since_gap.is_none()
    }

    /// Whether nothing but a question that is left out can tell.
    pub(super) const fn is_reply_unverified(&self) -> bool {
        self.unanswered > 0 && self.since_gap.is_none() && self.late_cycles == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive that answers so many cycles late is asked, and one question is left out.
    fn found(late: u16) -> LateReplyDetector {
        let mut late_reply = LateReplyDetector::default();
        for cycle in 0..200 {
            let is_left_out = cycle == 100;
            if is_left_out {
                assert_eq!(late_reply.is_reply_unverified(), late > 0);
                assert_eq!(late_reply.unanswered(), late);
                late_reply.skip_request();
            } else {
                late_reply.ask();
            }
            let has_answer = cycle >= late && cycle - late != 100;
            if has_answer {
                late_reply.answer();
            }
            assert_eq!(late_reply.pass(has_answer), !(is_left_out && late == 0));
        }
        late_reply
    }

    #[test]
    fn a_sync_that_is_left_out_tells_how_late_the_answers_are() {
        for late in [0, 1, 2, 7, 40] {
            assert_eq!(found(late).late_cycles(), late);
            assert_eq!(found(late).is_punctual(), late == 0);
        }
    }

    #[test]
    fn an_answer_that_was_lost_is_cleared_up_by_silence() {
        let mut late_reply = LateReplyDetector::default();
        late_reply.ask();
        assert!(late_reply.pass(false) && late_reply.is_reply_unverified());
        late_reply.skip_request();
        assert!(!late_reply.pass(false));
        assert!(late_reply.is_punctual() && late_reply.late_cycles() == 0);
    }
}
