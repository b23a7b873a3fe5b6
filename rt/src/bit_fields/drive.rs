//! A drive that is spoken to by bit fields: in each cycle one frame to it, and one reply.

use super::frame::{FieldFrame, ReplyError};
use super::life_cycle::{Life, LifeCycle, LifeState, LifeStep, LifeWish};
use super::values::{CommandValue, CommandValues, ReplyValue, ReplyValues};
use crate::frame::Frame;

/// What is known of a drive that is spoken to by bit fields.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldDriveParameters {
    /// The command of a cycle.
    pub command: FieldFrame<CommandValue>,
    /// The reply to it.
    pub reply: FieldFrame<ReplyValue>,
    /// How the drive is started and stopped.
    pub life_cycle: LifeCycle,
    /// What the position of a command is counted from.
    pub position_reference: PositionReference,
    /// The width of the range in which the reported position wraps around: rad (m). `None` where it does not.
    pub position_span: Option<f64>,
    /// Cycles in a row without a reply that are bridged.
    pub missed_reply_cycles: u32,
}

/// What the position of a command is counted from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PositionReference {
    /// The drive's zero.
    #[default]
    Zero,
    /// The present position: a command is the way that is left to the target.
    Present,
}

/// What a running drive is to follow. A drive that follows positions may take velocity and torque as limits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FieldTargets {
    /// rad (m)
    pub position: f64,
    /// rad/s (m/s)
    pub velocity: f64,
    /// N·m (N)
    pub torque: f64,
    /// The gain of the drive's position loop, in the unit of its field.
    pub stiffness: f64,
    /// The damping of the drive's position loop, in the unit of its field.
    pub damping: f64,
}

/// A drive that is spoken to by bit fields, as its replies show it.
#[derive(Clone, Debug)]
pub struct FieldDrive {
    parameters: FieldDriveParameters,
    life: Life,
    reply: ReplyValues,
    /// `None` before the first reply.
    position: Option<ExtendedPosition>,
}

/// A position beyond the range in which it is reported.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ExtendedPosition {
    reported: f64,
    laps: i32,
}

impl ExtendedPosition {
    /// The position after another report. Between two reports the joint moves by less than half of the range.
    fn after(self, reported: f64, span: f64) -> Self {
        let way = reported - self.reported;
        let laps = if way > span / 2.0 {
            self.laps.saturating_sub(1)
        } else if way < -span / 2.0 {
            self.laps.saturating_add(1)
        } else {
            self.laps
        };
        Self { reported, laps }
    }

    fn value(self, span: f64) -> f64 {
        self.reported + f64::from(self.laps) * span
    }
}

impl FieldDrive {
    /// A drive of which nothing is known yet.
    pub fn new(parameters: FieldDriveParameters) -> Self {
        Self { parameters, life: Life::default(), reply: ReplyValues::default(), position: None }
    }

    /// The one frame of this cycle, which leads the drive where it is wanted. The targets count while it runs; until then its targets
    /// are rest at its actual position.
    pub fn step(&mut self, wish: LifeWish, targets: &FieldTargets) -> Frame {
        let (run, zero, mode, is_at_rest) = match self.life.step(wish, &self.parameters.life_cycle) {
            LifeStep::Own(frame) => return frame,
            LifeStep::Command { run, zero, mode, is_at_rest } => (run, zero, mode, is_at_rest),
        };
        let present = self.position().unwrap_or(0.0);
        let targets = match is_at_rest {
            true => FieldTargets { position: present, ..FieldTargets::default() },
            false => *targets,
        };
        let position = match self.parameters.position_reference {
            // The drive knows its position only within its range.
            PositionReference::Zero => targets.position - self.laps_distance(),
            PositionReference::Present => targets.position - present,
        };
        let mut values = CommandValues::default();
        values.set(CommandValue::Position, position);
        values.set(CommandValue::Velocity, targets.velocity);
        values.set(CommandValue::Torque, targets.torque);
        values.set(CommandValue::Stiffness, targets.stiffness);
        values.set(CommandValue::Damping, targets.damping);
        values.set(CommandValue::Mode, mode.into());
        values.set(CommandValue::Run, f64::from(u8::from(run)));
        values.set(CommandValue::Zero, f64::from(u8::from(zero)));
        self.parameters.command.frame(&values)
    }

    /// Takes a reply.
    ///
    /// # Errors
    /// The frame is no reply of this drive. Nothing is changed then.
    pub fn receive(&mut self, frame: &Frame) -> Result<(), ReplyError> {
        self.parameters.reply.receive(frame, &mut self.reply)?;
        let reported = self.reply.get(ReplyValue::Position);
        self.position = Some(match (self.position, self.parameters.position_span) {
            // What the drive has been told as zero is where the count begins.
            (Some(last), Some(span)) if !self.is_zeroing() => last.after(reported, span),
            _ => ExtendedPosition { reported, laps: 0 },
        });
        let shows_torque = self.parameters.reply.carries(ReplyValue::Run);
        self.life.receive(shows_torque.then(|| self.reply.get(ReplyValue::Run) != 0.0));
        Ok(())
    }

    fn is_zeroing(&self) -> bool {
        matches!(self.life.state(), LifeState::Telling(super::Setting::Zero))
    }

    fn laps_distance(&self) -> f64 {
        match (self.position, self.parameters.position_span) {
            (Some(ExtendedPosition { laps, .. }), Some(span)) => f64::from(laps) * span,
            _ => 0.0,
        }
    }

    /// The actual position: rad (m). `None` before the first reply.
    pub fn position(&self) -> Option<f64> {
        self.position.map(|position| position.value(self.parameters.position_span.unwrap_or(0.0)))
    }

    /// A value of the last reply.
    pub fn reported(&self, value: ReplyValue) -> Option<f64> {
        (self.position.is_some() && self.parameters.reply.carries(value)).then(|| self.reply.get(value))
    }

    /// How far the drive is.
    pub const fn state(&self) -> LifeState {
        self.life.state()
    }

    /// Whether the drive has not replied for longer than is bridged, or never has.
    pub const fn is_stale(&self) -> bool {
        self.position.is_none() || self.life.unanswered_cycles() > self.parameters.missed_reply_cycles
    }
}
