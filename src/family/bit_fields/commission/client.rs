//! The master's side of a drive of bit fields, apart from any cycle: a command in each period, and the drive's reply to it.

use std::collections::VecDeque;

use takt_rt::{
    FieldDrive, FieldDriveParameters, FieldTargets, Frame, LifeState, LifeWish, Nanoseconds, ReplyError,
};

use crate::procedure::{Client, ProcedureSession};

/// Sends the command of each period, by the same codec as the cycle, and takes the replies.
#[derive(Debug)]
pub struct FieldClient {
    parameters: FieldDriveParameters,
    drive: FieldDrive,
    period_ns: Nanoseconds,
    /// When the next frame is due; `None`: nothing is sent.
    due_ns: Option<Nanoseconds>,
    wish: LifeWish,
    targets: FieldTargets,
    /// Frames that go first, each in the place of a command.
    first: VecDeque<Frame>,
    /// True if no command follows the frames that go first.
    falls_silent: bool,
    replies: u64,
    replied_ns: Nanoseconds,
    /// The last frame of the drive that was no reply as described, since the last one that was.
    unreadable: Option<ReplyError>,
    now_ns: Nanoseconds,
}

/// A session with a drive of bit fields.
pub type FieldSession = ProcedureSession<FieldClient>;

impl FieldClient {
    /// A client that says nothing yet.
    pub fn new(parameters: FieldDriveParameters, period_ns: Nanoseconds) -> Self {
        Self {
            parameters,
            drive: FieldDrive::default(),
            period_ns,
            due_ns: None,
            wish: LifeWish::Stop,
            targets: FieldTargets::default(),
            first: VecDeque::new(),
            falls_silent: false,
            replies: 0,
            replied_ns: 0,
            unreadable: None,
            now_ns: 0,
        }
    }

    /// How the drive is spoken to.
    pub const fn parameters(&self) -> &FieldDriveParameters {
        &self.parameters
    }

    /// From one frame to the next.
    pub const fn period_ns(&self) -> Nanoseconds {
        self.period_ns
    }

    /// The drive, as its replies show it.
    pub const fn drive(&self) -> &FieldDrive {
        &self.drive
    }

    /// Begins to send.
    pub fn speak(&mut self) {
        self.due_ns.get_or_insert(self.now_ns);
    }

    /// Where the drive is to be led from now on.
    pub fn lead(&mut self, wish: LifeWish) {
        self.wish = wish;
    }

    /// What a running drive follows from now on.
    pub fn follow(&mut self, targets: FieldTargets) {
        self.targets = targets;
    }

    /// Sends a frame in the place of the next command.
    pub fn send_first(&mut self, frame: Frame) {
        self.first.push_back(frame);
    }

    /// Sends the frames that go first, and no command behind them.
    pub fn fall_silent_after_first(&mut self) {
        self.falls_silent = true;
    }

    /// Returns `true` if frames wait that go first.
    pub fn has_frames_first(&self) -> bool {
        !self.first.is_empty()
    }

    /// Replies so far.
    pub const fn replies(&self) -> u64 {
        self.replies
    }

    /// How long ago the last reply came.
    pub const fn silent_ns(&self) -> Nanoseconds {
        self.now_ns.saturating_sub(self.replied_ns)
    }

    /// What was wrong with the last frame of the drive, if it was no reply as described.
    pub const fn unreadable(&self) -> Option<ReplyError> {
        self.unreadable
    }

    /// The actual position of the joint: rad (m). `None` before the first reply.
    pub fn position(&self) -> Option<f64> {
        self.drive.position(&self.parameters)
    }

    /// How far the drive is.
    pub const fn state(&self) -> LifeState {
        self.drive.state()
    }
}

impl Client for FieldClient {
    type Message = Frame;

    fn poll(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        self.now_ns = now_ns;
        if self.falls_silent && self.first.is_empty() {
            return None;
        }
        let due_ns = self.due_ns.filter(|due_ns| *due_ns <= now_ns)?;
        // A period that was missed is not made up for: two frames must not follow each other at once.
        let next_ns = due_ns.saturating_add(self.period_ns);
        self.due_ns = Some(next_ns.max(now_ns.saturating_add(self.period_ns / 2)));
        let first = self.first.pop_front();
        Some(first.unwrap_or_else(|| self.drive.step(&self.parameters, self.wish, &self.targets)))
    }

    fn receive(&mut self, frame: &Frame) {
        let reply = &self.parameters.reply;
        let is_sender = reply.sender().is_none_or(|sender| sender.has_sent(frame.payload()));
        if frame.id() != reply.id() || !is_sender {
            return;
        }
        match self.drive.receive(&self.parameters, frame) {
            Ok(()) => {
                self.replies += 1;
                self.replied_ns = self.now_ns;
                self.unreadable = None;
            }
            Err(error) => self.unreadable = Some(error),
        }
    }
}
