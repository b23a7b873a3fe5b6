//! The last frames of the buses, for the monitor of the pages.

use std::collections::VecDeque;

use serde::Serialize;

/// Frames that are kept.
const KEPT: usize = 4096;
/// Frames that a page is given at once.
const AT_ONCE: usize = 400;

/// A frame as pages see it.
#[derive(Clone, Debug, Serialize)]
pub struct FrameView {
    /// It rises by one from frame to frame.
    pub number: u64,
    /// The time of day in seconds since 1970.
    pub time: f64,
    /// The number of the bus.
    pub bus: usize,
    /// `>` sent, `<` received.
    pub direction: char,
    /// As in a candump log: `181#3712`.
    pub frame: String,
    /// What it means.
    pub words: String,
}

/// The last frames.
#[derive(Debug, Default)]
pub struct Frames {
    last: u64,
    kept: VecDeque<FrameView>,
}

/// Frames for a page.
#[derive(Debug, Serialize)]
pub struct FramesView {
    /// How many came before these and were not asked for in time.
    lost: u64,
    frames: Vec<FrameView>,
}

impl Frames {
    /// Keeps a frame; its number is given here.
    pub fn push(&mut self, frame: FrameView) {
        self.last += 1;
        if self.kept.len() == KEPT {
            self.kept.pop_front();
        }
        self.kept.push_back(FrameView { number: self.last, ..frame });
    }

    /// The number of the newest frame.
    pub const fn last(&self) -> u64 {
        self.last
    }

    /// The frames after the one with this number, the oldest first.
    pub fn after(&self, number: u64) -> FramesView {
        let first = self.kept.front().map_or(self.last + 1, |frame| frame.number);
        let new = self.kept.iter().filter(|frame| frame.number > number);
        FramesView {
            lost: first.saturating_sub(number.saturating_add(1)),
            frames: new.take(AT_ONCE).cloned().collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_gets_what_it_has_not_seen_and_is_told_what_it_has_missed() {
        let mut frames = Frames::default();
        let frame = |time| FrameView {
            number: 0,
            time,
            bus: 0,
            direction: '<',
            frame: "181#3712".to_owned(),
            words: String::new(),
        };
        (0..3).for_each(|time| frames.push(frame(f64::from(time))));
        let view = frames.after(1);
        let numbers: Vec<u64> = view.frames.iter().map(|frame| frame.number).collect();
        assert_eq!((numbers.as_slice(), view.lost), ([2, 3].as_slice(), 0));
        (0..2 * KEPT).for_each(|_| frames.push(frame(4.0)));
        let view = frames.after(3);
        assert_eq!((view.lost, view.frames.len()), (KEPT as u64, AT_ONCE));
        assert_eq!(frames.last(), 2 * KEPT as u64 + 3);
        assert_eq!(frames.after(u64::MAX).frames.len(), 0);
    }
}
