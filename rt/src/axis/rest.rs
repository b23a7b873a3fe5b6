//! Whether the joint of an axis has come to rest, by what its drive reports.

use super::{Axis, SETTLED_CYCLES};
use crate::cia402::State as DriveState;
use crate::control::ControlLaw;
use crate::dialect::Dialect;

/// A joint slower than this fraction of its velocity limit stands.
const AT_REST: f64 = 0.02;
/// Reports that are further apart than this many cycles of the bus have slots between them that were missed.
const USUAL_SPAN: f64 = 1.5;

impl Axis {
    /// Begins to come to rest: from now on it counts for how long the joint has stood.
    pub fn begin_stop(&mut self) {
        self.stop_profile();
        self.standing_reports = 0;
    }

    /// Whether a stop of the joint is over: it has stood for as long as its drive may take to act on what it was told, and in
    /// profile position it is where it was sent. One that turns round or swings back stands for a moment on its way, and one
    /// that was just about to move does before it begins. For a joint that follows set-points and does not obey nobody waits.
    pub fn has_stopped(&self) -> bool {
        if !self.is_profile() && !self.is_obeying() {
            return true;
        }
        let is_on_its_way = self.parameters.law == ControlLaw::ProfilePosition && self.is_enabled();
        self.is_settled() && (!is_on_its_way || self.is_target_reached())
    }

    /// Takes whether a report shows the joint standing. Over slots that were missed nobody knows how far it has moved in which
    /// time: such a report may show a coasting joint that stands.
    pub(super) fn count_standing(&mut self, span_s: f64) {
        let is_known = span_s < USUAL_SPAN * self.cycle_s;
        self.standing_reports = match self.is_standing() {
            true if is_known => self.standing_reports.saturating_add(1),
            true => self.standing_reports,
            false => 0,
        };
    }

    /// Whether the joint has been reported to stand for some cycles, since the last stop began.
    pub(super) fn is_settled(&self) -> bool {
        self.standing_reports >= SETTLED_CYCLES
    }

    /// Whether the joint follows set-points that stand, and is still behind them.
    pub fn is_catching_up(&self) -> bool {
        !self.is_profile() && self.is_obeying() && !self.is_standing()
    }

    /// Whether the drive must bring its joint to rest by its own quick stop (object 6085) before its power is taken. The set-points
    /// stand, and the joint still moves: a loop that is closed over the bus makes it swing, and another set-point would not help.
    pub fn must_quick_stop(&self) -> bool {
        let is_moving = match self.drive_state() {
            DriveState::OperationEnabled => self.is_obeying(),
            DriveState::QuickStopActive => self.age <= self.parameters.missed_feedback_cycles,
            _ => false,
        };
        let has_quick_stop = self.parameters.dialect == Dialect::Cia402;
        has_quick_stop && !self.is_profile() && is_moving && !self.is_settled()
    }

    /// Whether the joint is heard, enabled and where it is to be, as far as a following error is allowed.
    fn is_obeying(&self) -> bool {
        self.is_enabled()
            && self.age <= self.parameters.missed_feedback_cycles
            && self.following_error.abs() <= self.parameters.following_error_limit
    }

    /// Whether the joint is reported to stand.
    pub(super) fn is_standing(&self) -> bool {
        self.velocity.abs() <= AT_REST * self.parameters.limits.velocity
    }
}
