//! Somebody else on the bus.

use takt_rt::{Frame, Nanoseconds};

use super::effect::ForeignFrames;
use crate::canopen::nmt::{ErrorControl, NmtState};

/// Frames said in one look at the time at most, so that a long pause of the caller does not end in a storm.
const FRAMES_AT_ONCE: u32 = 64;

/// Somebody else who speaks in a rhythm.
#[derive(Debug)]
pub struct Foreigner {
    frames: ForeignFrames,
    due_ns: Option<Nanoseconds>,
    said: u64,
    said_at_once: u32,
    /// What the controller has commanded last under the identifier of [`ForeignFrames::SetPoints`].
    overheard: Option<Frame>,
}

impl Foreigner {
    pub fn new(frames: ForeignFrames) -> Self {
        Self { frames, due_ns: None, said: 0, said_at_once: 0, overheard: None }
    }

    pub fn begin(&mut self, now_ns: Nanoseconds) {
        self.due_ns = Some(now_ns);
    }

    /// Hears what the controller sends. Once it speaks itself, it repeats what it had heard before.
    pub fn overhear(&mut self, frame: &Frame) {
        if let ForeignFrames::SetPoints { id, .. } = self.frames
            && frame.id() == id
            && self.due_ns.is_none()
        {
            self.overheard = Some(*frame);
        }
    }

    /// What it says next, and when it was due; `None` when there is nothing more to say up to `now_ns`.
    pub fn next(&mut self, now_ns: Nanoseconds) -> Option<(Nanoseconds, Frame)> {
        let due_ns = self.due_ns.filter(|due_ns| *due_ns <= now_ns);
        let Some(due_ns) = due_ns else {
            self.said_at_once = 0;
            return None;
        };
        if self.said_at_once == FRAMES_AT_ONCE {
            self.said_at_once = 0;
            self.due_ns = self.period_ns().map(|period_ns| now_ns.saturating_add(period_ns.max(1)));
            return None;
        }
        let frame = self.frame()?;
        self.said += 1;
        self.said_at_once += 1;
        self.due_ns = self.period_ns().map(|period_ns| due_ns.saturating_add(period_ns.max(1)));
        Some((due_ns, frame))
    }

    /// Whether it has said everything.
    pub fn is_silent(&self) -> bool {
        self.due_ns.is_none()
    }

    fn frame(&self) -> Option<Frame> {
        match self.frames {
            ForeignFrames::Frame { frame, .. } => Some(frame),
            ForeignFrames::SetPoints { .. } => self.overheard,
            ForeignFrames::DuplicateNode { node, .. } => {
                let state = if self.said == 0 { NmtState::BootUp } else { NmtState::PreOperational };
                Some(ErrorControl { node, state }.frame())
            }
        }
    }

    fn period_ns(&self) -> Option<Nanoseconds> {
        match self.frames {
            ForeignFrames::Frame { period_ns, .. } => period_ns,
            ForeignFrames::SetPoints { period_ns, .. } | ForeignFrames::DuplicateNode { period_ns, .. } => {
                Some(period_ns)
            }
        }
    }
}
