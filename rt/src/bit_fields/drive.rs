//! A drive that is spoken to by bit fields: in each cycle one frame to it, and one reply.

use arrayvec::ArrayVec;

use super::frame::{FieldFrame, ReplyError};
use super::life_cycle::{
    CommandTargets, FieldMode, Life, LifeCycle, LifeState, LifeStep, LifeWish, OwnFrame,
};
use super::values::{CommandValue, CommandValues, ReplyValue, ReplyValues};
use crate::cia402::DriveState;
use crate::frame::Frame;

/// What is known of a drive that is spoken to by bit fields.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct FieldDriveParameters {
    /// The command of a cycle.
    pub command: FieldFrame<CommandValue>,
    /// The reply to it.
    pub reply: FieldFrame<ReplyValue>,
    /// How the drive is started and stopped.
    pub life_cycle: LifeCycle,
    /// What the position of a command is counted from.
    pub position_reference: PositionReference,
    /// What velocity and torque are beside a target that is not theirs.
    pub beside_target: BesideTarget,
    /// The gains of the drive's position loop.
    pub gains: FieldGains,
    /// The width of the range in which the reported position wraps around: rad (m). `None` where it does not.
    pub position_span: Option<f64>,
    /// How a drive is set up that replies otherwise until it is; `None` where nothing shows that.
    pub set_up_again: Option<SetUpAgain>,
}

/// The most frames by which a drive is set up.
pub const MAX_SETUP_FRAMES: usize = 8;

/// The frames that set a drive up which forgets that with its power, and the length by which its replies show that it has.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct SetUpAgain {
    /// The length in bytes of a reply of the drive before it is set up.
    pub reply_bytes: usize,
    /// The frames, in their order.
    pub frames: ArrayVec<OwnFrame, MAX_SETUP_FRAMES>,
}

/// What the fields for velocity and torque are, where the drive follows a position, and that for torque, where it follows a velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum BesideTarget {
    /// What is fed forward.
    #[default]
    FeedForward,
    /// The most that the drive may use.
    Limits {
        /// rad/s (m/s)
        velocity: f64,
        /// N·m (N)
        torque: f64,
    },
}

impl BesideTarget {
    /// Velocity and torque of a command: targets, what is fed forward, or limits. A drive that is not to run gets no limit to use.
    const fn of(self, wish: LifeWish, targets: &FieldTargets) -> (f64, f64) {
        let FieldTargets { velocity, torque, .. } = *targets;
        match (self, wish) {
            (Self::Limits { velocity, torque }, LifeWish::Run(FieldMode::Position)) => (velocity, torque),
            (Self::Limits { torque, .. }, LifeWish::Run(FieldMode::Velocity)) => (velocity, torque),
            _ => (velocity, torque),
        }
    }

    /// The same at standstill, before the drive is told this mode by a frame of its own.
    const fn before(self, mode: FieldMode, targets: &FieldTargets) -> (f64, f64) {
        match (self, mode) {
            (Self::Limits { torque, .. }, FieldMode::Position | FieldMode::Velocity) => (0.0, torque),
            _ => (0.0, targets.torque),
        }
    }
}

/// The gains that a command carries to the position loop of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum FieldGains {
    /// Always these, in the unit of their fields.
    Fixed {
        /// The field `Stiffness`.
        stiffness: f64,
        /// The field `Damping`.
        damping: f64,
    },
    /// Those of each cycle, in N·m/rad and N·m·s/rad: the drive closes the loop that is closed here for another drive that follows
    /// torques.
    Commanded,
}

impl Default for FieldGains {
    fn default() -> Self {
        Self::Fixed { stiffness: 0.0, damping: 0.0 }
    }
}

/// What the position of a command is counted from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum PositionReference {
    /// The drive's zero.
    #[default]
    Zero,
    /// The present position: a command is the way that is left to the target.
    Present,
}

/// What a running drive is to follow, with what is fed forward beside it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FieldTargets {
    /// rad (m)
    pub position: f64,
    /// rad/s (m/s)
    pub velocity: f64,
    /// N·m (N)
    pub torque: f64,
    /// N·m/rad (N/m); for [`FieldGains::Commanded`] alone.
    pub stiffness: f64,
    /// N·m·s/rad (N·s/m); for [`FieldGains::Commanded`] alone.
    pub damping: f64,
}

/// The mode of a drive that is spoken to by bit fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunningMode {
    /// It does not run. Its mode is told again before it does.
    None,
    /// This one.
    Known(FieldMode),
    /// It shows a code that is none of its modes.
    Unknown,
}

/// A drive that is spoken to by bit fields, as its replies show it. What does not change of it is passed in: always the same.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct FieldDrive {
    life: Life,
    reply: ReplyValues,
    /// `None` before the first reply.
    position: Option<ExtendedPosition>,
    ways: Ways,
    /// The next frame that sets the drive up, where it has shown that it is not.
    set_up: Option<u8>,
}

/// The ways (rad, m) that a drive has been commanded which counts from where it is. Each one that is commanded twice is gone twice.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
struct Ways {
    /// That of the last command, until it is answered.
    last: f64,
    /// Those of the commands before it that have had no reply.
    unanswered: f64,
}

impl Ways {
    /// A command leaves before the last one was answered, or after that. Returns how far the drive is beyond its last report.
    fn begin_command(&mut self) -> f64 {
        self.unanswered += core::mem::take(&mut self.last);
        self.unanswered
    }
}

/// A position beyond the range in which it is reported.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
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
    /// The one frame of this cycle, which leads the drive where it is wanted. The targets count while it runs; until then its target
    /// is rest at its actual position, with the same gains.
    ///
    /// A drive whose replies show that it has lost its power is set up again while it is told to stop, and at no other time.
    pub fn step(&mut self, by: &FieldDriveParameters, wish: LifeWish, targets: &FieldTargets) -> Frame {
        if self.set_up.is_some()
            && let Some(frame) = self.next_of_set_up(by)
        {
            return frame;
        }
        let (run, zero, mode, kind) = match self.life.step(wish, &by.life_cycle) {
            LifeStep::Own(frame) => return frame,
            LifeStep::Command { run, zero, mode, targets } => (run, zero, mode, targets),
        };
        let present = self.position(by).unwrap_or(0.0) + self.ways.begin_command();
        let followed = match kind {
            CommandTargets::Rest => {
                FieldTargets { position: present, velocity: 0.0, torque: 0.0, ..*targets }
            }
            CommandTargets::SetPoints | CommandTargets::Before(_) => *targets,
        };
        let position = match by.position_reference {
            // The drive knows its position only within its range.
            PositionReference::Zero => followed.position - self.laps_distance(by),
            PositionReference::Present => {
                self.ways.last = followed.position - present;
                self.ways.last
            }
        };
        let (velocity, torque) = match kind {
            CommandTargets::Before(mode) => by.beside_target.before(mode, &followed),
            _ => by.beside_target.of(wish, &followed),
        };
        let (stiffness, damping) = match by.gains {
            FieldGains::Fixed { stiffness, damping } => (stiffness, damping),
            FieldGains::Commanded => (followed.stiffness, followed.damping),
        };
        let mut values = CommandValues::default();
        values.set(CommandValue::Position, position);
        values.set(CommandValue::Velocity, velocity);
        values.set(CommandValue::Torque, torque);
        values.set(CommandValue::Stiffness, stiffness);
        values.set(CommandValue::Damping, damping);
        values.set(CommandValue::Mode, mode.into());
        values.set(CommandValue::Run, f64::from(u8::from(run)));
        values.set(CommandValue::Zero, f64::from(u8::from(zero)));
        by.command.frame(&values)
    }

    /// The next frame that sets the drive up, if it is told to stop.
    #[inline(never)]
    fn next_of_set_up(&mut self, by: &FieldDriveParameters) -> Option<Frame> {
        if !matches!(self.life.state(), LifeState::Stopping | LifeState::Stopped) {
            return None;
        }
        let at = self.set_up.take()?;
        let own = by.set_up_again.as_ref()?.frames.get(usize::from(at))?;
        self.set_up = Some(at.saturating_add(1));
        Some(Frame::of(own.id, own.payload))
    }

    /// Takes a reply.
    ///
    /// # Errors
    /// The frame is no reply of this drive. Nothing is changed then.
    pub fn receive(&mut self, by: &FieldDriveParameters, frame: &Frame) -> Result<(), ReplyError> {
        if let Err(error) = by.reply.receive(frame, &mut self.reply) {
            self.see_whether_set_up(by, error);
            return Err(error);
        }
        self.ways = Ways::default();
        let reported = self.reply.get(ReplyValue::Position);
        self.position = Some(match (self.position, by.position_span) {
            // What the drive has been told as zero is where the count begins.
            (Some(last), Some(span)) if !self.is_zeroing() => last.after(reported, span),
            _ => ExtendedPosition { reported, laps: 0 },
        });
        self.life.receive(self.shows_torque(by));
        Ok(())
    }

    /// Notes that the drive replies as it does before it is set up.
    #[cold]
    fn see_whether_set_up(&mut self, by: &FieldDriveParameters, error: ReplyError) {
        if let (Some(again), ReplyError::Length { received, .. }) = (&by.set_up_again, error)
            && received == again.reply_bytes
        {
            // The frames under way are sent to their end first.
            self.set_up.get_or_insert(0);
        }
    }

    /// Returns `true` if the last reply shows that the drive has torque; `None` for a drive that does not show it.
    fn shows_torque(&self, by: &FieldDriveParameters) -> Option<bool> {
        self.reported(by, ReplyValue::Run).map(|run| run != 0.0)
    }

    fn is_zeroing(&self) -> bool {
        matches!(self.life.state(), LifeState::Telling(super::Setting::Zero))
    }

    fn laps_distance(&self, by: &FieldDriveParameters) -> f64 {
        match (self.position, by.position_span) {
            (Some(ExtendedPosition { laps, .. }), Some(span)) => f64::from(laps) * span,
            _ => 0.0,
        }
    }

    /// The actual position: rad (m). `None` before the first reply.
    pub fn position(&self, by: &FieldDriveParameters) -> Option<f64> {
        self.position.map(|position| position.value(by.position_span.unwrap_or(0.0)))
    }

    /// A value of the last reply.
    pub fn reported(&self, by: &FieldDriveParameters, value: ReplyValue) -> Option<f64> {
        (self.position.is_some() && by.reply.carries(value)).then(|| self.reply.get(value))
    }

    /// How far the drive is.
    pub const fn state(&self) -> LifeState {
        self.life.state()
    }

    /// Returns `true` if it may have torque, whatever its last reply shows: it is told to start, or is told to stop and has not shown for long enough
    /// that it has.
    pub const fn may_have_torque(&self) -> bool {
        matches!(
            self.state(),
            LifeState::Starting(_) | LifeState::Running(_) | LifeState::Changing { .. } | LifeState::Stopping
        )
    }

    /// The same in the states of CiA 402, in which every drive is led. A drive that is told to stop may have torque; that it has an error is
    /// said by one reply, which may be corrupted.
    ///
    /// | drive | state of CiA 402 |
    /// | --- | --- |
    /// | it replies with an error, in Starting, Running, Changing and Stopping, or with torque | fault reaction active |
    /// | it replies with an error, in any other | fault |
    /// | Stopping | quick stop active |
    /// | Stopped, Telling, Told | ready to switch on |
    /// | Choosing, Aligning, Starting | switched on |
    /// | Running, Changing | operation enabled |
    pub fn drive_state(&self, by: &FieldDriveParameters) -> DriveState {
        let has_error = self.reported(by, ReplyValue::Error).is_some_and(|error| error != 0.0);
        match self.life.state() {
            _ if has_error && self.may_have_torque() => DriveState::FaultReactionActive,
            _ if has_error && self.shows_torque(by) == Some(true) => DriveState::FaultReactionActive,
            _ if has_error => DriveState::Fault,
            LifeState::Stopping => DriveState::QuickStopActive,
            LifeState::Stopped | LifeState::Telling(_) | LifeState::Told(_) => DriveState::ReadyToSwitchOn,
            LifeState::Choosing(_) | LifeState::Aligning(_) | LifeState::Starting(_) => {
                DriveState::SwitchedOn
            }
            LifeState::Running(_) | LifeState::Changing { .. } => DriveState::OperationEnabled,
        }
    }

    /// The mode that it runs in, by its reply, or by what it has been told where it does not show it.
    pub fn mode(&self, by: &FieldDriveParameters) -> RunningMode {
        let (LifeState::Running(told) | LifeState::Changing { from: told, .. }) = self.life.state() else {
            return RunningMode::None;
        };
        match (&by.life_cycle, self.reported(by, ReplyValue::Mode)) {
            (LifeCycle::ByFields { modes }, Some(shown)) => {
                modes.mode(shown).map_or(RunningMode::Unknown, RunningMode::Known)
            }
            _ => RunningMode::Known(told),
        }
    }
}
