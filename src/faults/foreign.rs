//! A foreign station on the bus.

use takt_rt::{Frame, Nanoseconds};
use takt_wire::canopen::nmt::{ErrorControl, NmtState};

use super::effect::ForeignFrames;

/// Most frames sent in one call, so that a long pause between calls does not cause a burst.
const FRAMES_AT_ONCE: u32 = 64;

/// A foreign station that sends periodically.
#[derive(Debug)]
pub struct ForeignStation {
    frames: ForeignFrames,
    due_ns: Option<Nanoseconds>,
    sent: u64,
    sent_at_once: u32,
    /// The controller's last frame with the identifier of [`ForeignFrames::SetPoints`].
    last_set_points: Option<Frame>,
}

impl ForeignStation {
    pub fn new(frames: ForeignFrames) -> Self {
        Self { frames, due_ns: None, sent: 0, sent_at_once: 0, last_set_points: None }
    }

    pub fn begin(&mut self, now_ns: Nanoseconds) {
        self.due_ns = Some(now_ns);
    }

    /// Takes a frame that the controller sends. Once the station has begun, it repeats the last frame from before.
    pub fn observe(&mut self, frame: &Frame) {
        if let ForeignFrames::SetPoints { id, .. } = self.frames
            && frame.id() == id
            && self.due_ns.is_none()
        {
            self.last_set_points = Some(*frame);
        }
    }

    /// The next frame and its due time; `None` when no frame is due up to `now_ns`.
    pub fn next(&mut self, now_ns: Nanoseconds) -> Option<(Nanoseconds, Frame)> {
        let due_ns = self.due_ns.filter(|due_ns| *due_ns <= now_ns);
        let Some(due_ns) = due_ns else {
            self.sent_at_once = 0;
            return None;
        };
        if self.sent_at_once == FRAMES_AT_ONCE {
            self.sent_at_once = 0;
            self.due_ns = self.period_ns().map(|period_ns| now_ns.saturating_add(period_ns.max(1)));
            return None;
        }
        let frame = self.frame()?;
        self.sent += 1;
        self.sent_at_once += 1;
        self.due_ns = self.period_ns().map(|period_ns| due_ns.saturating_add(period_ns.max(1)));
        Some((due_ns, frame))
    }

    /// Returns `true` if every frame has been sent.
    pub fn is_finished(&self) -> bool {
        self.due_ns.is_none()
    }

    fn frame(&self) -> Option<Frame> {
        match self.frames {
            ForeignFrames::Frame { frame, .. } => Some(frame),
            ForeignFrames::SetPoints { .. } => self.last_set_points,
            ForeignFrames::DuplicateNode { node, .. } => {
                let state = if self.sent == 0 { NmtState::BootUp } else { NmtState::PreOperational };
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
