//! Which feedback has arrived in this cycle of the bus, and how old the last complete feedback is.

use super::parameters::FeedbackSince;
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};

/// Reports that are further apart than this many cycles of the bus have slots between them that were missed.
const USUAL_SPAN: f64 = 1.5;

/// The feedback PDOs of an axis as they arrive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct Reception {
    /// What arrived before this is no feedback of the present cycle.
    expected_since_ns: Nanoseconds,
    /// The same of the cycle of the last complete feedback; 0 before the first one.
    last_expected_since_ns: Nanoseconds,
    /// Which feedback PDOs have arrived since then, a bit each.
    arrived: u8,
    /// Times within which feedback is expected that have passed since the last complete feedback: cycles of the bus, for most drives.
    age_cycles: u16,
    /// Cycles of the bus that have passed of the present one.
    waited_cycles: u16,
    /// The period of the bus.
    cycle_s: f64,
    /// Cycles of the bus within which feedback is expected; 0 counts as 1.
    report_cycles: u16,
    /// Time since the last complete feedback.
    span_s: f64,
    /// Time between the last complete feedback and the one before it: missed slots make it longer than a cycle.
    last_span_s: f64,
}

/// The time that a complete feedback may tell of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ReportSpan {
    /// Seconds in which the joint may have moved since the report before.
    pub(super) longest_s: f64,
    /// The time within which a report is expected: the period of the bus, for most drives.
    pub(super) cycle_s: f64,
    /// True if no slot was missed, so that the time is known.
    pub(super) is_known: bool,
}

impl Reception {
    /// Takes over the period of the bus, and in how many of its cycles feedback is expected.
    pub(super) fn set_cycle(&mut self, cycle_s: f64, report_cycles: u16) {
        (self.cycle_s, self.report_cycles) = (cycle_s, report_cycles);
    }

    /// The time within which feedback is expected.
    #[inline]
    fn report_s(&self) -> f64 {
        self.cycle_s * f64::from(self.report_cycles.max(1))
    }

    /// The period of the bus.
    pub(super) const fn cycle_s(&self) -> f64 {
        self.cycle_s
    }

    /// Begins to wait for the feedback of a cycle. What arrived earlier and has not been used is dropped.
    pub(super) fn begin_request(&mut self, now_ns: Nanoseconds) {
        self.expected_since_ns = now_ns;
        self.arrived = 0;
    }

    /// Drops what has arrived in this cycle.
    pub(super) fn drop_arrived(&mut self) {
        self.arrived = 0;
    }

    /// Reports are expected from now on: none has been missed.
    pub(super) fn begin(&mut self) {
        (self.arrived, self.age_cycles, self.waited_cycles) = (0, 0, 0);
    }

    /// Returns `true` if a PDO that arrived then belongs to the present cycle.
    pub(super) const fn is_in_time(&self, at_ns: Nanoseconds) -> bool {
        at_ns >= self.expected_since_ns
    }

    /// Takes the arrival of feedback PDO number `pdo`. Returns whether it had arrived in this cycle before.
    pub(super) fn note_arrival(&mut self, pdo: usize) -> bool {
        let bit = 1 << (pdo & 7);
        let was_there = self.arrived & bit != 0;
        self.arrived |= bit;
        was_there
    }

    /// Returns `true` if any feedback PDO has arrived in this cycle.
    pub(super) const fn has_any(&self) -> bool {
        self.arrived != 0
    }

    /// Lets time pass.
    pub(super) fn pass(&mut self, elapsed_s: f64) {
        self.span_s += elapsed_s;
    }

    /// Ends the reception of a cycle in which so many PDOs were to arrive. `None` if they have not all arrived.
    #[inline]
    pub(super) fn complete(&mut self, pdos: usize, since: FeedbackSince) -> Option<ReportSpan> {
        let expected = (1u8 << pdos.min(7)) - 1;
        if self.arrived & expected != expected {
            self.waited_cycles = self.waited_cycles.saturating_add(1);
            if self.waited_cycles >= self.report_cycles {
                self.waited_cycles = 0;
                self.age_cycles = self.age_cycles.saturating_add(1);
            }
            return None;
        }
        let longest_s = self.take_span_s(since);
        self.arrived = 0;
        (self.age_cycles, self.waited_cycles) = (0, 0);
        let cycle_s = self.report_s();
        Some(ReportSpan { longest_s, cycle_s, is_known: longest_s < USUAL_SPAN * cycle_s })
    }

    /// Seconds in which the joint may have moved since the last complete feedback.
    fn take_span_s(&mut self, since: FeedbackSince) -> f64 {
        let slots_s = core::mem::take(&mut self.span_s);
        let longest_s = slots_s.max(core::mem::replace(&mut self.last_span_s, slots_s));
        let asked_ns = self.expected_since_ns;
        let asked_before_ns = core::mem::replace(&mut self.last_expected_since_ns, asked_ns);
        match since {
            // A drive reports where it was when it was asked. SYNC that leaves late is not a fast joint.
            FeedbackSince::Sync | FeedbackSince::SetPoint
                if asked_before_ns > 0 && asked_ns > asked_before_ns =>
            {
                (asked_ns - asked_before_ns) as f64 / NANOSECONDS_PER_SECOND as f64
            }
            FeedbackSince::Sync => slots_s,
            // A drive that answers set-points tells where it was in the cycle before. After a gap in the set-points, the gap lies
            // behind its report and not before it. Such a drive has had the longer time of both, so that it counts as no faster
            // than it is.
            FeedbackSince::SetPoint | FeedbackSince::CommandPhase => longest_s,
        }
    }

    /// Cycles of the bus since the last complete feedback, with those in which none was asked for.
    #[inline]
    pub(super) fn cycles_since_report(&self) -> u16 {
        if self.span_s == 0.0 { 0 } else { self.cycles_in_span() }
    }

    fn cycles_in_span(&self) -> u16 {
        // The sum of many periods may be a little less than their multiple.
        const ROUNDING: f64 = 1e-6;
        (self.span_s / self.report_s() + ROUNDING) as u16
    }

    /// Cycles of the bus since the last complete feedback, in which it was asked for.
    pub(super) const fn age_cycles(&self) -> u16 {
        self.age_cycles
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drive_that_reports_every_few_cycles_is_not_missed_in_between() {
        let mut reception = Reception::default();
        reception.set_cycle(1e-3, 3);
        let mut ages = [0; 9];
        for (cycle, age) in ages.iter_mut().enumerate() {
            reception.begin_request(1);
            reception.pass(1e-3);
            if cycle == 0 {
                reception.note_arrival(0);
            }
            reception.complete(1, FeedbackSince::CommandPhase);
            *age = reception.age_cycles();
        }
        assert_eq!(ages, [0, 0, 0, 1, 1, 1, 2, 2, 2]);
        assert_eq!(reception.cycles_since_report(), 2);
    }

    fn reception() -> Reception {
        let mut reception = Reception::default();
        reception.set_cycle(1e-3, 1);
        reception
    }

    #[test]
    fn feedback_is_complete_when_every_pdo_of_the_cycle_has_arrived() {
        let mut reception = reception();
        reception.begin_request(100);
        assert!(!reception.is_in_time(99) && reception.is_in_time(100));
        assert!(!reception.note_arrival(1));
        assert!(reception.note_arrival(1), "it comes twice");
        reception.pass(1e-3);
        assert_eq!(reception.complete(2, FeedbackSince::Sync), None);
        assert_eq!(reception.age_cycles(), 1);
        reception.note_arrival(0);
        reception.pass(1e-3);
        let span = reception.complete(2, FeedbackSince::Sync);
        assert_eq!(span, Some(ReportSpan { longest_s: 2e-3, cycle_s: 1e-3, is_known: false }));
        assert_eq!((reception.age_cycles(), reception.has_any()), (0, false));
    }

    #[test]
    fn a_drive_that_answers_set_points_may_have_had_the_longer_of_the_last_two_times() {
        for (since, expected_s) in [(FeedbackSince::Sync, 1e-3), (FeedbackSince::SetPoint, 5e-3)] {
            let mut reception = reception();
            let mut report = |elapsed_s: f64| {
                reception.note_arrival(0);
                reception.pass(elapsed_s);
                reception.complete(1, since).unwrap()
            };
            report(5e-3);
            assert_eq!(report(1e-3).longest_s, expected_s);
            assert!(report(1e-3).is_known);
        }
    }
}
