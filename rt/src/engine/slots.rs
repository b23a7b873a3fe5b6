//! Which slots were used: what was missed, and whether that is too often.

use crate::watch::{LeakyBucket, TimingLadder, TimingLevel};

/// The slots of a run.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct SlotWatch {
    ladder: TimingLadder,
    bucket: LeakyBucket,
    level: TimingLevel,
    /// The slot of the present cycle; `None` before the first.
    pub(super) present: Option<u64>,
    /// Missed since the start.
    pub(super) missed: u64,
    /// Missed in the present cycle.
    pub(super) missed_now: u64,
    /// Cycles in a row whose set-points were ready too late.
    pub(super) late_cycles: u32,
}

impl SlotWatch {
    pub(super) fn new(ladder: TimingLadder) -> Self {
        Self {
            ladder,
            bucket: LeakyBucket::default(),
            level: TimingLevel::Normal,
            present: None,
            missed: 0,
            missed_now: 0,
            late_cycles: 0,
        }
    }

    /// Judges from now on as another one does.
    #[cfg(feature = "checkpoint")]
    pub(super) fn take_ladder_of(&mut self, other: &Self) {
        self.ladder = other.ladder;
    }

    /// Begins the cycle of a slot. Returns the slots since the one before: 1 if none was skipped.
    #[inline]
    pub(super) fn begin(&mut self, slot: u64) -> u64 {
        let elapsed = self.present.map_or(1, |last| slot.saturating_sub(last));
        self.present = Some(slot);
        let was_late = self.late_cycles > 0;
        self.bucket.take(elapsed.saturating_sub(1) + u64::from(was_late), self.ladder.leak_slots);
        self.missed_now = elapsed.saturating_sub(1);
        self.missed += self.missed_now;
        elapsed
    }

    /// Ends the cycle: its set-points were ready too late, or in time. A slot whose set-points were late is a missed one.
    pub(super) fn end(&mut self, is_late: bool) {
        self.late_cycles = if is_late { self.late_cycles.saturating_add(1) } else { 0 };
        self.missed_now += u64::from(is_late);
        self.missed += u64::from(is_late);
    }

    /// Takes over the present level. Returns it when it has changed.
    pub(super) fn changed_level(&mut self) -> Option<TimingLevel> {
        let level = self.ladder.level(self.bucket.filled());
        let is_changed = level != self.level;
        self.level = level;
        is_changed.then_some(level)
    }

    pub(super) const fn level(&self) -> TimingLevel {
        self.level
    }

    /// Missed slots that are not yet forgiven, and how many are too many.
    pub(super) const fn unforgiven(&self) -> (u32, u32) {
        (self.bucket.filled(), self.ladder.unfit)
    }

    /// From how many on no stream begins.
    pub(super) const fn degraded(&self) -> u32 {
        self.ladder.degraded
    }

    /// Forgives every missed slot.
    pub(super) fn forgive(&mut self) {
        self.bucket.empty();
    }
}
