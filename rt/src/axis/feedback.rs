//! What the drive of an axis reports, and when.

use super::exchange::{Exchange, NoFeedback};
use super::joint::JointFacts;
use super::late_reply::SetPointSkip;
use super::off_cycle::OffCycleReport;
use super::{Axis, FeedbackSince, Jump};
use crate::cia402::DriveState;
use crate::frame::Frame;
use crate::pdo::FeedbackSlot;
use crate::time::Nanoseconds;
use crate::watch::NodeFault;

impl Axis {
    /// Begins to wait for the feedback of a cycle. What arrived before `now_ns` and has not been used is too late for its
    /// own cycle, and is no feedback of this one.
    pub fn expect_feedback(&mut self, now_ns: Nanoseconds) {
        self.reception.begin_request(now_ns);
    }

    /// SYNC begins: no drive has been asked for feedback yet.
    pub fn begin_sync(&mut self) {
        self.late_reply.begin();
    }

    /// The drive is brought up, and has to report from now on.
    pub fn begin_reports(&mut self) {
        self.late_reply.begin();
        self.reception.begin();
    }

    /// SYNC requests the feedback of a cycle from the drive; see [`Axis::expect_feedback`].
    pub fn request_feedback(&mut self, now_ns: Nanoseconds) {
        self.expect_feedback(now_ns);
        self.late_reply.note_request();
    }

    /// SYNC is skipped in a cycle, to see in which cycle the drive is silent for it.
    pub fn skip_request(&mut self, now_ns: Nanoseconds) {
        self.expect_feedback(now_ns);
        self.late_reply.note_skip();
    }

    /// The next set-point is skipped, which requests the feedback of a drive that answers set-points: as
    /// [`Axis::skip_request`] for one that answers SYNC.
    pub fn skip_next_set_point(&mut self) {
        self.set_point_skip = SetPointSkip::Next;
    }

    /// The requests, SYNCs or set-points, that have had no reply yet; 0 for a drive that reports when it likes.
    pub fn unanswered(&self) -> u16 {
        self.late_reply.unanswered()
    }

    /// How many cycles of its bus late the drive has been found to report, always; 0 if it has not been.
    pub fn late_cycles(&self) -> u16 {
        self.late_reply.late_cycles()
    }

    /// Returns `true` if only a skipped SYNC or set-point can tell if the drive reports in time.
    pub fn is_reply_unverified(&self) -> bool {
        self.late_reply.is_reply_unverified()
    }

    /// Takes feedback frame number `pdo` (from 0) that arrived at `at_ns`. One that is late changes nothing.
    ///
    /// # Errors
    /// What keeps it from being feedback of this drive. Nothing is changed then.
    #[inline]
    pub fn receive(&mut self, pdo: usize, frame: &Frame, at_ns: Nanoseconds) -> Result<(), NoFeedback> {
        if pdo == 0 {
            self.late_reply.note_reply();
        }
        if !self.reception.is_in_time(at_ns) {
            return Ok(());
        }
        if let Exchange::Pdos(pdos) = &self.parameters.exchange {
            let Some(parameters) = pdos.feedback.get(pdo) else { return Ok(()) };
            // No remote frame is feedback: what has a length has as many bytes.
            let unpacked = parameters.mapping.unpack(frame.first_word(), frame.length(), &mut self.feedback);
            unpacked.map_err(NoFeedback::Pdo)?;
        } else if self.is_off_cycle() {
            return Err(NoFeedback::OffCycle);
        } else {
            self.receive_fields(frame).map_err(NoFeedback::Reply)?;
        }
        if self.reception.note_arrival(pdo) {
            self.duplicate_node.note_repetition();
        }
        Ok(())
    }

    /// Takes a report of a drive that is spoken to outside of the cycle. One that carries no number changes nothing.
    pub fn receive_off_cycle(&mut self, report: &OffCycleReport) {
        let OffCycleReport { state, position, velocity, torque, error_code, temperature } = *report;
        let is_number = position.is_finite() && velocity.is_finite() && torque.is_finite();
        if !is_number || !self.is_off_cycle() {
            return;
        }
        let scale = &self.parameters.scale;
        self.feedback.take(FeedbackSlot::Statusword, state.statusword_bits().into());
        self.feedback.take(FeedbackSlot::OperationModeDisplay, self.mode_set().into());
        self.feedback.take(FeedbackSlot::Position, scale.position_to_counts(position));
        self.feedback.take(FeedbackSlot::Velocity, scale.velocity_to_drive(velocity));
        self.feedback.take(FeedbackSlot::Torque, scale.torque_to_per_mille(torque));
        self.feedback.take(FeedbackSlot::ErrorCode, error_code.into());
        self.off_cycle_temperature = temperature.filter(|temperature| temperature.is_finite());
        self.reception.note_arrival(0);
    }

    /// Drops what has arrived of a report in this cycle.
    pub fn drop_report(&mut self) {
        self.reception.drop_arrived();
    }

    /// Takes the error code of an emergency message; 0 says that all errors are gone.
    pub fn receive_emergency(&mut self, code: u16) {
        self.report.note_emergency(code);
    }

    /// Forgets what has been wrong with the drive. The code of a fault is known until it is there no more.
    pub fn begin_fault_reset(&mut self) {
        self.report.begin_fault_reset();
    }

    /// Lets time pass in a slot in which the axis' bus has no cycle.
    pub fn wait(&mut self, elapsed_s: f64) {
        self.reception.pass(elapsed_s);
    }

    /// Begins a command phase with what has arrived. `elapsed_s` is the time since the last slot. Returns whether the feedback
    /// of this cycle is complete.
    #[inline]
    pub fn begin_cycle(&mut self, elapsed_s: f64) -> bool {
        self.reception.pass(elapsed_s);
        if !self.late_reply.pass(self.reception.has_any()) {
            return false;
        }
        let pdos = self.parameters.exchange.reports();
        let Some(span) = self.reception.complete(pdos, self.parameters.feedback_since) else { return false };
        let counts = self.feedback.feedback(FeedbackSlot::Position);
        let velocity =
            self.reports(FeedbackSlot::Velocity).then_some(self.feedback.feedback(FeedbackSlot::Velocity));
        if self.joint.take_report(counts, velocity, span, JointFacts::of(&self.parameters)) {
            self.start_from_actual();
        }
        let statusword = self.statusword();
        self.report.note_state(self.parameters.codec.state(statusword));
        self.report.note_remote(statusword);
        self.note_power_report();
        self.note_service_report();
        self.note_measured();
        let behind = self.set_points.due().position - self.joint.position();
        self.following.set_error(if self.is_profile() { 0.0 } else { behind });
        true
    }

    /// Takes the position that the drive has reported by SDO, unless it reports by process data.
    pub fn set_reported_position(&mut self, counts: i32) {
        if self.joint.take_sdo_position(counts, JointFacts::of(&self.parameters)) {
            self.start_from_actual();
        }
    }

    /// The last value of an object that the drive reports; `None` if it does not report it, or has not reported yet.
    fn reported(&self, slot: FeedbackSlot) -> Option<i32> {
        (self.reported_slots.contains(slot) && self.is_heard()).then(|| self.feedback.feedback(slot))
    }

    /// Returns `true` if the process data of the drive carry a number that it reports.
    pub fn reports(&self, slot: FeedbackSlot) -> bool {
        self.reported_slots.contains(slot)
    }

    /// Returns `true` if the drive has reported at all.
    pub fn is_heard(&self) -> bool {
        self.joint.is_heard()
    }

    /// Cycles of the bus since the drive last reported in time, with those in which it was not asked.
    #[inline]
    pub fn cycles_since_report(&self) -> u16 {
        self.reception.cycles_since_report()
    }

    /// Cycles of the bus in which the drive was asked and did not report in time, since its last report.
    pub fn feedback_age(&self) -> u16 {
        self.reception.age_cycles()
    }

    /// The drive's state by its statuswords. After operation enabled one statusword alone that shows something else does not
    /// count, unless it shows a fault.
    pub fn drive_state(&self) -> DriveState {
        self.report.state()
    }

    /// Where the joint has been reported in this cycle, if it cannot have got there. The report is accepted when the next one
    /// agrees with it.
    #[inline]
    pub fn jump(&self) -> Option<Jump> {
        self.joint.jump().filter(|_| self.feedback_age() == 0)
    }

    /// Object 6041 as last received.
    pub fn statusword(&self) -> u16 {
        self.feedback.feedback(FeedbackSlot::Statusword) as u16
    }

    /// Object 603F if it is reported, else the code of the last emergency message.
    pub fn error_code(&self) -> u16 {
        match self.feedback.feedback(FeedbackSlot::ErrorCode) as u16 {
            0 => self.report.emergency_code(),
            code => code,
        }
    }

    /// The mode of operation (object 6061) that the drive shows, if it differs from ours. A drive that has not reported yet
    /// shows none. While the mode is being changed, the drive may show any.
    #[inline]
    pub fn foreign_mode(&self) -> Option<i8> {
        let is_foreign =
            |shown: &i8| *shown != self.parameters.law.operation_mode() as i8 && !self.is_changing_mode();
        self.mode().filter(is_foreign)
    }

    /// The mode of operation (object 6061) that the drive shows, if it reports it.
    pub fn mode(&self) -> Option<i8> {
        self.reported(FeedbackSlot::OperationModeDisplay).map(|mode| mode as i8)
    }

    /// The torque (N·m or N) that the drive reports in object 6077, if it does.
    pub fn torque(&self) -> Option<f64> {
        self.reported(FeedbackSlot::Torque).map(|torque| self.parameters.scale.torque_from_per_mille(torque))
    }

    /// The current that the drive reports in object 6078, in thousandths of the rated current, if it does.
    pub fn current_per_mille(&self) -> Option<i16> {
        self.reported(FeedbackSlot::Current).map(|current| current as i16)
    }

    /// The actual position (rad or m): the last plausible one.
    pub fn position(&self) -> f64 {
        self.joint.position()
    }

    /// Returns true if the drive can be commanded where the joint is: the joint is not beyond a wrap of the drive's position counter, nor may it
    /// as well be a lap of that away.
    pub fn is_position_commandable(&self) -> bool {
        self.joint.is_commandable(JointFacts::of(&self.parameters))
    }

    /// The actual velocity (rad/s or m/s).
    pub fn velocity(&self) -> f64 {
        self.joint.velocity()
    }

    /// What is wrong with the node, by its error control messages.
    #[inline]
    pub(crate) fn node_fault(&self) -> Option<NodeFault> {
        self.node_monitor.fault(self.parameters.supervision.timeout_cycles())
    }

    /// Returns `true` if another node answers with the same node ID.
    pub fn is_duplicate(&self) -> bool {
        self.duplicate_node.is_found()
    }

    /// Returns true if the enabled drive no longer obeys the bus, by statusword bit 9 (remote).
    #[inline]
    pub(crate) fn is_local(&self) -> bool {
        self.report.is_local()
    }

    /// The code of an emergency message that the statusword has had time to explain by a fault.
    pub fn unexplained_emergency(&self) -> Option<u16> {
        self.report.unexplained_emergency()
    }

    /// Returns `true` if the feedback is that of a drive with the conditions that enabling has: it comes in its own cycle and shows no
    /// torque, and the joint has stood for some cycles.
    pub(super) fn shows_rest_without_torque(&self) -> bool {
        self.feedback_age() == 0
            && self.late_reply.is_punctual()
            && !self.drive_state().has_torque()
            && self.joint.is_settled()
    }

    /// Returns `true` if the drive may have reported in this cycle. One that answers set-points, and was sent none, has missed no answer; one
    /// that is late may still have come.
    #[inline]
    pub fn is_due_to_report(&mut self) -> bool {
        if !self.answers_set_points() {
            return true;
        }
        let is_asked = core::mem::take(&mut self.is_asked_by_set_point);
        is_asked || self.reception.has_any()
    }

    /// Returns `true` if the drive answers set-points.
    pub(super) fn answers_set_points(&self) -> bool {
        self.parameters.feedback_since == FeedbackSince::SetPoint
    }
}
