//! What the drive of an axis reports.

use super::position_watch::{Judgement, Reach};
use super::{Axis, FeedbackSince};
use crate::cia402::State as DriveState;
use crate::frame::Frame;
use crate::pdo::{FeedbackSlot, TooShort};
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};
use crate::watch::NodeComplaint;

/// A fault shows in the statusword within this many slots of the emergency message that announces it.
const EMERGENCY_GRACE_CYCLES: u8 = 3;

fn seconds(ns: Nanoseconds) -> f64 {
    ns as f64 / NANOSECONDS_PER_SECOND as f64
}

/// A report of a joint where it cannot have got to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jump {
    /// How far that is from where it was: rad (m).
    pub distance: f64,
    /// How far it can have got: rad (m).
    pub reach: f64,
}

impl Axis {
    /// Begins to wait for the feedback of a cycle. What arrived before `now_ns` and has not been used is too late for its
    /// own cycle, and is no feedback of this one.
    pub fn expect_feedback(&mut self, now_ns: Nanoseconds) {
        self.expected_since_ns = now_ns;
        self.arrived = 0;
    }

    /// SYNC begins: no drive has been asked anything yet.
    pub fn begin_sync(&mut self) {
        self.punctuality.begin();
    }

    /// SYNC asks the drive for the feedback of a cycle; see [`Axis::expect_feedback`].
    pub fn ask(&mut self, now_ns: Nanoseconds) {
        self.expect_feedback(now_ns);
        self.punctuality.ask();
    }

    /// SYNC is left out in a cycle, to see whether the drive's silence falls into it.
    pub fn leave_out(&mut self, now_ns: Nanoseconds) {
        self.expect_feedback(now_ns);
        self.punctuality.leave_out();
    }

    /// The next set-point is left out, which asks a drive that answers them: as [`Axis::leave_out`] for one that answers SYNC.
    pub fn leave_out_set_point(&mut self) {
        self.is_next_left_out = true;
    }

    /// What asks the drive, SYNCs or set-points, and has had no answer, or none yet; 0 for one that reports when it likes.
    pub fn unanswered(&self) -> u16 {
        self.punctuality.unanswered()
    }

    /// How many cycles of its bus late the drive has been found to report, always; 0 if it has not been.
    pub fn late_cycles(&self) -> u16 {
        self.punctuality.late_cycles()
    }

    /// Whether only a SYNC or a set-point that is left out can tell if the drive reports in time.
    pub fn is_doubtful(&self) -> bool {
        self.punctuality.is_doubtful()
    }

    /// Takes feedback PDO number `pdo` (from 0) that arrived at `at_ns`. One that is late changes nothing, nor one that is
    /// too short.
    pub fn receive(&mut self, pdo: usize, frame: &Frame, at_ns: Nanoseconds) -> Result<(), TooShort> {
        if pdo == 0 {
            self.punctuality.answer();
        }
        if at_ns < self.expected_since_ns {
            return Ok(());
        }
        let Some(parameters) = self.parameters.feedback.get(pdo) else { return Ok(()) };
        parameters.mapping.unpack(frame.first_word(), frame.payload().len(), &mut self.feedback)?;
        let bit = 1 << (pdo & 7);
        if self.arrived & bit != 0 {
            self.duplicate_watch.again();
        }
        self.arrived |= bit;
        Ok(())
    }

    /// Takes the error code of an emergency message; 0 says that all errors are gone.
    pub fn receive_emergency(&mut self, code: u16) {
        self.emergency_code = code;
        self.since_emergency = (code != 0).then_some(0);
    }

    /// Forgets what has been wrong with the drive. The code of a fault is known until it is there no more.
    pub fn begin_fault_reset(&mut self) {
        self.since_emergency = None;
        self.is_being_reset = self.state.is_faulted();
        if !self.is_being_reset {
            self.emergency_code = 0;
        }
    }

    /// Whether a fault that was there when the last reset began has been there ever since.
    pub fn is_being_reset(&self) -> bool {
        self.is_being_reset
    }

    /// Lets time pass in a slot in which the axis' bus has no cycle.
    pub fn wait(&mut self, elapsed_s: f64) {
        self.span_s += elapsed_s;
    }

    /// Begins a command phase with what has arrived. `elapsed_s` is the time since the last slot.
    pub fn begin_cycle(&mut self, elapsed_s: f64) {
        self.span_s += elapsed_s;
        let expected = (1u8 << self.parameters.feedback.len().min(7)) - 1;
        if !self.punctuality.pass(self.arrived != 0) {
            return;
        }
        if self.arrived & expected != expected {
            self.age = self.age.saturating_add(1);
            return;
        }
        let longest_s = self.take_span_s();
        self.arrived = 0;
        self.age = 0;
        self.judge_position(longest_s);
        self.count_standing(longest_s);
        self.is_heard = true;
        self.notice_state();
        self.following_error = if self.is_profile() { 0.0 } else { self.sent[2].position - self.position };
    }

    /// The time from the report before this one to this one, in seconds.
    fn take_span_s(&mut self) -> f64 {
        let slots_s = core::mem::take(&mut self.span_s);
        let longest_s = slots_s.max(core::mem::replace(&mut self.last_span_s, slots_s));
        let asked_ns = self.expected_since_ns;
        let asked_before_ns = core::mem::replace(&mut self.asked_ns, asked_ns);
        match self.parameters.feedback_since {
            // It tells where it was when it was asked. SYNC, or a set-point, that leaves late is not a fast joint.
            FeedbackSince::Sync | FeedbackSince::SetPoint
                if asked_before_ns > 0 && asked_ns > asked_before_ns =>
            {
                seconds(asked_ns - asked_before_ns)
            }
            FeedbackSince::Sync => slots_s,
            // One that answers set-points tells where it was in the cycle before: the time for which there were none is behind
            // its report, not before it. Whoever may be either has had the longer time, and is believed to be no faster.
            FeedbackSince::SetPoint | FeedbackSince::CommandPhase => longest_s,
        }
    }

    /// Takes the position of this cycle's report, and the velocity, unless the joint cannot be there.
    fn judge_position(&mut self, span_s: f64) {
        let scale = &self.parameters.scale;
        let counts = self.feedback.feedback(FeedbackSlot::Position);
        let position = scale.position_from_counts(counts);
        let reach = Reach { velocity: self.parameters.limits.velocity, count: 1.0 / scale.resolution() };
        match self.position_watch.judge(position, span_s, reach) {
            Judgement::Believed { velocity } => {
                self.jump = None;
                self.velocity = if self.reports(FeedbackSlot::Velocity) {
                    scale.velocity_from_drive(self.feedback.feedback(FeedbackSlot::Velocity))
                } else {
                    velocity
                };
                self.believe(position, counts);
            }
            Judgement::Doubtful { distance, reach } => self.jump = Some(Jump { distance, reach }),
        }
    }

    fn believe(&mut self, position: f64, counts: i32) {
        (self.position, self.position_counts) = (position, counts);
        if !self.is_position_known {
            self.is_position_known = true;
            self.start_from_actual();
        }
    }

    /// Takes the position that the drive has reported otherwise than by process data, if there has been none.
    pub fn set_reported_position(&mut self, counts: i32) {
        if !self.is_heard {
            self.believe(self.parameters.scale.position_from_counts(counts), counts);
        }
    }

    fn reports(&self, slot: FeedbackSlot) -> bool {
        self.parameters.feedback.iter().any(|pdo| pdo.mapping.carries(slot))
    }

    /// Whether the drive has reported at all.
    pub fn is_heard(&self) -> bool {
        self.is_heard
    }

    /// Cycles since the drive last reported in time.
    pub fn feedback_age(&self) -> u16 {
        self.age
    }

    /// A drive that was enabled is taken for disabled only when it says so again: one false statusword would let its
    /// set-point follow the joint while the drive still obeys, and disable it. A fault counts at once.
    fn notice_state(&mut self) {
        let shown = self.parameters.dialect.state(self.statusword());
        let contradicts = self.state == DriveState::OperationEnabled
            && shown != DriveState::OperationEnabled
            && !shown.is_faulted();
        self.contradictions = if contradicts { self.contradictions.saturating_add(1) } else { 0 };
        if self.contradictions == 1 {
            return;
        }
        if self.state.is_faulted() && !shown.is_faulted() {
            self.emergency_code = 0;
            self.is_being_reset = false;
        }
        self.state = shown;
    }

    /// The drive's state by its statuswords.
    pub fn drive_state(&self) -> DriveState {
        self.state
    }

    /// Where the joint has been reported in this cycle, if it cannot have got to there. It is not believed to be there before
    /// the next report agrees.
    pub fn jump(&self) -> Option<Jump> {
        self.jump.filter(|_| self.age == 0)
    }

    /// Object 6041 as last received.
    pub fn statusword(&self) -> u16 {
        self.feedback.feedback(FeedbackSlot::Statusword) as u16
    }

    /// Object 603F if it is reported, else the code of the last emergency message.
    pub fn error_code(&self) -> u16 {
        match self.feedback.feedback(FeedbackSlot::ErrorCode) as u16 {
            0 => self.emergency_code,
            code => code,
        }
    }

    /// The mode that the drive shows, if it reports one that differs from ours. One that has not reported yet shows none.
    pub fn foreign_mode(&self) -> Option<i8> {
        let is_shown = self.is_heard && self.reports(FeedbackSlot::OperationModeDisplay);
        let shown = self.feedback.feedback(FeedbackSlot::OperationModeDisplay) as i8;
        let ours = self.parameters.law.operation_mode() as i8;
        (is_shown && shown != ours).then_some(shown)
    }

    /// Whether the drive follows set-points.
    pub fn is_enabled(&self) -> bool {
        self.drive_state() == DriveState::OperationEnabled && !self.is_lost
    }

    /// The actual position (rad or m): the last one that was believed.
    pub fn position(&self) -> f64 {
        self.position
    }

    /// The actual velocity (rad/s or m/s).
    pub fn velocity(&self) -> f64 {
        self.velocity
    }

    /// What the node's error control messages say against it.
    pub fn node_complaint(&self) -> Option<NodeComplaint> {
        self.node_watch.complaint(self.parameters.heartbeat_timeout_cycles)
    }

    /// Whether another node answers under the same number.
    pub fn is_duplicate(&self) -> bool {
        self.duplicate_watch.is_duplicate()
    }

    /// The code of an emergency message that the statusword has had time to explain by a fault.
    pub fn unexplained_emergency(&self) -> Option<u16> {
        self.since_emergency.filter(|cycles| *cycles >= EMERGENCY_GRACE_CYCLES).map(|_| self.emergency_code)
    }
}
