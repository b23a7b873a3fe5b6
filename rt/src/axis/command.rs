//! What is sent to the drive of an axis.

use super::{Axis, CommandPdo, FeedbackSince, SETTLED_CYCLES, TransmissionType};
use crate::cia402::{Goal, controlword};
use crate::control::{ControlLaw, LoopInput};
use crate::frame::Frame;
use crate::pdo::CommandSlot;
use crate::profile::ProfileTarget;

impl Axis {
    /// Writes the command of this cycle of the axis' bus: one step towards `goal`, unless another controlword is to be
    /// sent, and the target.
    pub fn command(&mut self, goal: Goal, other_word: Option<u16>) {
        let is_enabled = self.is_enabled();
        let word = other_word.unwrap_or_else(|| self.word_towards(goal));
        // A drive that is not to be enabled is told so again and again, whatever it seems to show: what was sent may not have
        // got to it, and what was received may have been another's.
        let spacing = self.parameters.controlword_spacing_cycles;
        let is_repeated = spacing > 0
            && self.since_controlword >= spacing.max(SETTLED_CYCLES)
            && !(is_enabled && goal == Goal::Enabled);
        self.is_controlword_due = word != self.base_word || is_repeated;
        self.since_controlword =
            if self.is_controlword_due { 0 } else { self.since_controlword.saturating_add(1) };
        self.base_word = word;
        // One that has shown torque shows as well when it has none any more.
        self.is_led_up = !self.drive_state().has_torque()
            && match word {
                controlword::SWITCH_ON | controlword::ENABLE_OPERATION => true,
                _ => self.is_led_up && self.since_controlword < SETTLED_CYCLES,
            };
        self.sent = [self.delay.due(), self.sent[0], self.sent[1]];
        self.ask_by_set_point();

        let parameters = &self.parameters;
        let law = parameters.law;
        if !is_enabled {
            self.profile.rest(law.idle(self.position_counts));
            self.profile_target = None;
        }
        let (raw, torque) = if law.is_profile() {
            let torque = match self.profile_target {
                Some(ProfileTarget::Torque(torque)) => torque,
                _ => 0.0,
            };
            (self.profile.target_raw(), torque)
        } else if is_enabled || law.target_slot() == CommandSlot::TargetPosition {
            let input = LoopInput {
                set: self.sent[0],
                due: self.sent[2],
                position: self.position,
                velocity: self.velocity,
            };
            law.target(&input, &parameters.scale, &parameters.limits)
        } else {
            (law.idle(self.position_counts), 0.0)
        };
        self.torque_set = torque;
        self.command.set(law.target_slot(), raw);
        let mode_bits = if is_enabled { self.mode_bits() } else { 0 };
        self.command.set(CommandSlot::Controlword, (word | mode_bits).into());
    }

    /// The set-point of this cycle asks a drive that answers it, unless it is left out.
    fn ask_by_set_point(&mut self) {
        self.is_left_out = core::mem::take(&mut self.is_next_left_out);
        if self.parameters.feedback_since == FeedbackSince::SetPoint && self.is_position_known {
            if self.is_left_out { self.punctuality.leave_out() } else { self.punctuality.ask() }
        }
    }

    /// Whether a controlword that leads the drive up may still be under way, whatever the drive shows.
    pub fn is_led_up(&self) -> bool {
        self.is_led_up
    }

    /// The controlword that brings the drive one step nearer to `goal`.
    fn word_towards(&self, goal: Goal) -> u16 {
        let is_too_early = goal == Goal::Enabled
            && !self.is_enabled()
            && self.base_word != 0
            && self.since_controlword < self.parameters.controlword_spacing_cycles;
        if is_too_early {
            return self.base_word;
        }
        self.parameters.dialect.controlword(self.drive_state(), goal, self.base_word)
    }

    /// What the mode of operation adds to the controlword of an enabled drive.
    fn mode_bits(&mut self) -> u16 {
        let has_handshake = self.parameters.dialect.acknowledges_set_points();
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
            // Interpolate (CiA 402-2, interpolated position mode).
            ControlLaw::Interpolated if has_handshake => controlword::BIT_4,
            _ => 0,
        }
    }

    /// The controlword that was written last.
    pub fn controlword(&self) -> u16 {
        self.command.command(CommandSlot::Controlword) as u16
    }

    /// The frames of this cycle's command; none while it is not known where the drive is.
    pub fn frames(&self) -> impl Iterator<Item = Frame> {
        let is_due = |command: &CommandPdo| {
            self.is_position_known
                && match command.cadence {
                    TransmissionType::EveryCycle => !self.is_left_out,
                    TransmissionType::OnControlword => self.is_controlword_due,
                }
        };
        self.parameters.commands.iter().filter(move |command| is_due(command)).filter_map(|command| {
            let payload = command.pdo.mapping.pack(&self.command);
            Frame::data(command.pdo.id, payload.get(..command.pdo.mapping.length())?).ok()
        })
    }
}
