//! The last frames of the buses, for the monitor of the pages.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

/// Frames that are kept: those of more than half a second of two busy buses. A page asks four times a second.
const KEPT: usize = 16_384;
/// Frames that a page is given at once.
const AT_ONCE: usize = 1000;

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
    /// What it means, in English.
    pub words: String,
}

/// Which frames a page wants.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wanted {
    /// Those after the one with this number.
    after: u64,
    /// A part of the frame, of its meaning, or of both with a space between them, in any case; empty for all.
    #[serde(default)]
    filter: String,
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
    /// The newest of all: what the page has seen.
    last: u64,
    /// How many came since it last asked, and were too many.
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

    /// Counts frames that were lost on their way here.
    pub const fn lose(&mut self, count: u64) {
        self.last += count;
    }

    /// The number of the newest frame.
    pub const fn last(&self) -> u64 {
        self.last
    }

    /// The wanted frames, the oldest first; the newest of them, where they are too many.
    pub fn wanted(&self, wanted: &Wanted) -> FramesView {
        let number = wanted.after;
        let filter = wanted.filter.trim().to_lowercase();
        let is_wanted = |frame: &&FrameView| {
            filter.is_empty() || format!("{} {}", frame.frame, frame.words).to_lowercase().contains(&filter)
        };
        let begin = self.kept.partition_point(|frame| frame.number <= number);
        let kept = (self.kept.len() - begin) as u64;
        let new: Vec<&FrameView> = self.kept.range(begin..).filter(is_wanted).collect();
        let surplus = new.len().saturating_sub(AT_ONCE);
        FramesView {
            last: self.last,
            lost: self.last.saturating_sub(number).saturating_sub(kept) + surplus as u64,
            frames: new.into_iter().skip(surplus).cloned().collect(),
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
        let after = |after| Wanted { after, ..Wanted::default() };
        let view = frames.wanted(&after(1));
        let numbers: Vec<u64> = view.frames.iter().map(|frame| frame.number).collect();
        assert_eq!((numbers.as_slice(), view.lost, view.last), ([2, 3].as_slice(), 0, 3));
        (0..2 * KEPT).for_each(|_| frames.push(frame(4.0)));
        let view = frames.wanted(&after(3));
        assert_eq!((view.lost, view.frames.len()), ((2 * KEPT - AT_ONCE) as u64, AT_ONCE));
        assert_eq!(view.frames.last().unwrap().number, frames.last(), "the newest are shown");
        frames.lose(7);
        assert_eq!((frames.wanted(&after(view.last)).lost, frames.last()), (7, view.last + 7));
        assert_eq!(frames.wanted(&after(u64::MAX)).frames.len(), 0);
    }

    #[test]
    fn what_a_page_does_not_want_takes_no_room() {
        let mut frames = Frames::default();
        for number in 0..10_000 {
            let (frame, words) = if number == 77 { ("081#1043", "alarm 3") } else { ("080#", "SYNC") };
            frames.push(FrameView {
                number: 0,
                time: 0.0,
                bus: 0,
                direction: '<',
                frame: frame.to_owned(),
                words: words.to_owned(),
            });
        }
        for filter in ["alarm", " 081#1043 ALARM", "81#"] {
            let view = frames.wanted(&Wanted { after: 0, filter: filter.to_owned() });
            assert_eq!((view.frames.len(), view.lost, view.last), (1, 0, 10_000), "{filter}");
        }
    }
}
