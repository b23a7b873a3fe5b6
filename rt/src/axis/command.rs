//! What is sent to the drive of an axis.

use super::late_reply::SetPointSkip;
use super::torque_loop::TorqueLoop;
use super::{Axis, AxisParameters, CommandPdo, FeedForward};
use crate::cia402::{DriveState, Goal, controlword};
use crate::control::{ControlLaw, LoopInput, TrackingError};
use crate::frame::Frame;
use crate::pdo::{CommandSlot, TransmissionType};

impl Axis {
    /// Writes the command of this cycle of the axis' bus: the target, and one step of the drive towards `goal`, unless another
    /// controlword is to be sent.
    #[inline]
    pub fn command(&mut self, goal: Goal, other_word: Option<u16>) {
        let is_enabled = self.is_enabled();
        let word = other_word.unwrap_or_else(|| self.word_towards(goal));
        let is_kept = is_enabled && goal == Goal::Enabled;
        let spacing_cycles = self.parameters.controlword_spacing_cycles;
        self.controlwords.take(word, spacing_cycles, is_kept, self.drive_state().has_torque());
        self.send_set_point(is_enabled);
        self.request_by_set_point();
        if !is_enabled {
            self.profile.rest(self.parameters.law.idle(self.joint.position_counts()));
        }
        if !is_enabled {
            self.forget_loops();
        }
        let input = self.loop_input();
        let (raw, torque) = self.target(is_enabled, &input);
        self.torque_set = torque;
        self.command.set(self.parameters.law.target_slot(), raw);
        let mode_bits = if is_enabled { self.mode_bits() } else { 0 };
        self.command.set(CommandSlot::Controlword, (word | mode_bits).into());
        if !self.has_pdos() {
            self.command_fields(word, &input, torque);
        }
    }

    /// The drive has no torque: what the loops have come to counts no more.
    fn forget_loops(&mut self) {
        self.torque_loop = TorqueLoop::default();
        self.error_if_unheard = TrackingError::default();
        self.command.set(CommandSlot::VelocityOffset, 0);
        self.command.set(CommandSlot::TorqueOffset, 0);
    }

    /// Returns true if the torque to command was NaN.
    #[inline]
    pub(crate) fn is_torque_undefined(&self) -> bool {
        self.torque_loop.is_undefined()
    }

    /// Sends the set-point that is due. A drive that follows positions gets no longer way than that of one cycle of its bus, also where its
    /// power is being taken: it may obey that later.
    #[inline]
    fn send_set_point(&mut self, is_enabled: bool) {
        let may_follow = is_enabled || self.drive_state() == DriveState::OperationEnabled;
        if may_follow && matches!(self.parameters.law, ControlLaw::Position | ControlLaw::Interpolated) {
            self.set_points.send_within(self.parameters.limits.velocity, self.reception.cycle_s());
        } else {
            self.set_points.send();
        }
    }

    /// The target in drive units, and the torque that is commanded with it.
    #[inline]
    fn target(&mut self, is_enabled: bool, input: &LoopInput) -> (i32, f64) {
        let AxisParameters { law, scale, limits, torque_limits, feed_forward, .. } = &self.parameters;
        if law.is_profile() {
            return (self.profile.target_raw(), self.profile.torque());
        }
        if !is_enabled && law.target_slot() != CommandSlot::TargetPosition {
            return (law.idle(self.joint.position_counts()), 0.0);
        }
        let cycle_s = self.reception.cycle_s();
        self.error_if_unheard = law.error_without_feedback(input.error, cycle_s);
        // Where nobody takes a torque, none is wanted either.
        let is_torque_taken = law.target_slot() == CommandSlot::TargetTorque || feed_forward.has_torque();
        let torque = if is_torque_taken {
            // Nothing, where an unlimited rate meets a period that is not known: `max` leaves out what is no number.
            let fade = (torque_limits.rate * cycle_s).max(0.0);
            self.torque_loop.next(law, input, limits.torque, fade)
        } else {
            0.0
        };
        let raw = law.target(input, torque, scale, limits);
        if *feed_forward != FeedForward::None {
            self.set_offsets(input.set.velocity, torque);
        }
        (raw, torque)
    }

    /// What the loops that are closed here act on in this cycle.
    #[inline]
    pub(super) fn loop_input(&self) -> LoopInput {
        LoopInput { set: self.set_points.sent_now(), error: self.tracking_error() }
    }

    /// How far the joint is behind its set-point. In a cycle without feedback the last position says nothing of that: the
    /// set-point has gone on since, and so has the joint.
    #[inline]
    fn tracking_error(&self) -> TrackingError {
        let age = self.feedback_age();
        if age > self.parameters.missed_feedback_cycles {
            return self.parameters.law.error_of_silent_drive(self.error_if_unheard);
        }
        if age > 0 {
            return self.error_if_unheard;
        }
        let due = self.set_points.due();
        TrackingError {
            position: due.position - self.joint.position(),
            velocity: due.velocity - self.joint.velocity(),
        }
    }

    /// Sets what the drive adds in its own loops: its velocity loop has the velocity of the set-point already where it follows
    /// velocities, and its torque loop the torque where it follows torques.
    fn set_offsets(&mut self, velocity: f64, torque: f64) {
        let AxisParameters { law, feed_forward, scale, limits, .. } = &self.parameters;
        let follows_position = law.target_slot() == CommandSlot::TargetPosition;
        let follows_torque = law.target_slot() == CommandSlot::TargetTorque;
        if feed_forward.has_velocity() && follows_position {
            self.command.set(CommandSlot::VelocityOffset, scale.velocity_command(velocity, limits));
        }
        if feed_forward.has_torque() && !follows_torque {
            self.command.set(CommandSlot::TorqueOffset, scale.torque_command(torque, limits));
        }
    }

    /// The set-point of this cycle requests the feedback of a drive that answers set-points, unless it is skipped.
    fn request_by_set_point(&mut self) {
        self.set_point_skip.begin_command();
        let is_sent = self.joint.is_known() || !self.has_pdos();
        if !(self.answers_set_points() && is_sent) {
            return;
        }
        self.is_asked_by_set_point = true;
        match self.set_point_skip {
            SetPointSkip::Now => self.late_reply.note_skip(),
            SetPointSkip::No | SetPointSkip::Next => self.late_reply.note_request(),
        }
    }

    /// Returns `true` if an enabling controlword may still be under way, whatever the drive shows.
    pub fn may_be_switching_on(&self) -> bool {
        self.controlwords.may_be_switching_on()
    }

    /// Returns `true` if the drive has been told to leave operation enabled since it was told to go there, if it can be told so by process
    /// data.
    pub fn is_told_to_switch_off(&self) -> bool {
        self.controlwords.leads_away() || self.is_pdo_unreachable()
    }

    /// The controlword that brings the drive one step nearer to `goal`.
    #[inline]
    fn word_towards(&self, goal: Goal) -> u16 {
        let last = self.controlwords.last();
        let is_on_its_way_up = goal == Goal::Enabled && !self.is_enabled();
        if is_on_its_way_up && self.controlwords.must_wait(self.parameters.controlword_spacing_cycles) {
            return last;
        }
        self.parameters.codec.controlword(self.drive_state(), goal, last)
    }

    /// The bits that the mode of operation adds to the controlword of an enabled drive.
    #[inline]
    fn mode_bits(&mut self) -> u16 {
        let has_handshake = self.parameters.codec.acknowledges_set_points();
        match self.parameters.law {
            ControlLaw::ProfilePosition if has_handshake => self.profile.position_bits(self.statusword()),
            ControlLaw::ProfilePosition => {
                self.profile.pass();
                controlword::BIT_5
            }
            ControlLaw::ProfileVelocity | ControlLaw::ProfileTorque => {
                self.profile.pass();
                0
            }
            // Bit 4: interpolate (CiA 402-2, interpolated position mode).
            ControlLaw::Interpolated if has_handshake => controlword::BIT_4,
            _ => 0,
        }
    }

    /// The controlword that was written last.
    pub fn controlword(&self) -> u16 {
        self.command.command(CommandSlot::Controlword) as u16
    }

    /// The PDOs of this cycle's command; none while the position of the joint is not known.
    /// Each with the number of axes whose parts it is to have.
    pub fn frames(&self) -> impl Iterator<Item = (Frame, u8)> {
        self.due_commands().map(|command| (self.frame_of(command), command.axes))
    }

    /// The frame of a PDO with the numbers of this cycle's command.
    #[inline]
    pub(crate) fn frame_of(&self, command: &CommandPdo) -> Frame {
        command.pdo.frame(&self.command)
    }

    /// The PDOs of this cycle's command; none while the position of the joint is not known.
    pub(crate) fn due_commands(&self) -> impl Iterator<Item = &CommandPdo> {
        let is_due = |command: &CommandPdo| {
            self.joint.is_known()
                && match command.transmission {
                    TransmissionType::EveryCycle => self.set_point_skip != SetPointSkip::Now,
                    TransmissionType::OnControlword => self.controlwords.is_due(),
                }
        };
        self.parameters.exchange.commands().iter().filter(move |command| is_due(command))
    }
}
