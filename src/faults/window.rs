//! From when to when a fault is there.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use takt_rt::Nanoseconds;

use super::cue::{Cue, Cues};

/// From when to when, counted from a cue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// What it is counted from.
    pub cue: Cue,
    /// From the cue to the beginning.
    pub after_ns: Nanoseconds,
    /// From the beginning to the end; `None` lasts to the end of the run.
    pub lasts_ns: Option<Nanoseconds>,
}

const NOT_YET: Nanoseconds = Nanoseconds::MAX;

/// How a fault went, for whoever looks from outside.
#[derive(Debug)]
pub struct Course {
    began_ns: AtomicU64,
    ended_ns: AtomicU64,
    frames: AtomicU64,
    is_impossible: AtomicBool,
}

impl Default for Course {
    fn default() -> Self {
        Self {
            began_ns: AtomicU64::new(NOT_YET),
            ended_ns: AtomicU64::new(NOT_YET),
            frames: AtomicU64::new(0),
            is_impossible: AtomicBool::new(false),
        }
    }
}

impl Course {
    /// When it began, if it has.
    pub fn began_ns(&self) -> Option<Nanoseconds> {
        Some(self.began_ns.load(Ordering::Acquire)).filter(|ns| *ns != NOT_YET)
    }

    /// When it ended, if it has.
    pub fn ended_ns(&self) -> Option<Nanoseconds> {
        Some(self.ended_ns.load(Ordering::Acquire)).filter(|ns| *ns != NOT_YET)
    }

    /// Frames that it has broken or made.
    pub fn frames(&self) -> u64 {
        self.frames.load(Ordering::Relaxed)
    }

    /// Whether it could not be done, because the port has no drive that can be broken in this way.
    pub fn is_impossible(&self) -> bool {
        self.is_impossible.load(Ordering::Relaxed)
    }

    pub(super) fn count_frame(&self) {
        // Only the thread of the port writes.
        self.frames.store(self.frames() + 1, Ordering::Relaxed);
    }

    pub(super) fn was_impossible(&self) {
        self.is_impossible.store(true, Ordering::Relaxed);
    }
}

/// What has changed at a look at the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// Nothing.
    None,
    /// The fault has begun.
    Began,
    /// The fault is over.
    Ended,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Waiting,
    Active { until_ns: Nanoseconds },
    Over,
}

/// Watches a window.
#[derive(Debug)]
pub struct Timer {
    window: Window,
    cues: Arc<Cues>,
    course: Arc<Course>,
    opened_ns: Option<Nanoseconds>,
    state: State,
}

impl Timer {
    pub fn new(window: Window, cues: Arc<Cues>, course: Arc<Course>) -> Self {
        Self { window, cues, course, opened_ns: None, state: State::Waiting }
    }

    /// Whether the fault is there.
    pub fn is_active(&self) -> bool {
        matches!(self.state, State::Active { .. })
    }

    pub fn course(&self) -> &Course {
        &self.course
    }

    /// Looks at the time. A window that lies between two looks is there from the first of them to the second.
    pub fn look(&mut self, now_ns: Nanoseconds) -> Edge {
        let opened_ns = *self.opened_ns.get_or_insert(now_ns);
        match self.state {
            State::Waiting => {
                let cue_ns = match self.window.cue {
                    Cue::Start => Some(opened_ns),
                    cue => self.cues.at_ns(cue),
                };
                let Some(begins_ns) = cue_ns.map(|cue_ns| cue_ns.saturating_add(self.window.after_ns)) else {
                    return Edge::None;
                };
                if now_ns < begins_ns {
                    return Edge::None;
                }
                let lasts_ns = self.window.lasts_ns.unwrap_or(NOT_YET);
                self.state = State::Active { until_ns: begins_ns.saturating_add(lasts_ns) };
                self.course.began_ns.store(now_ns, Ordering::Release);
                Edge::Began
            }
            State::Active { until_ns } if now_ns >= until_ns => {
                self.end(now_ns);
                Edge::Ended
            }
            State::Active { .. } | State::Over => Edge::None,
        }
    }

    /// Ends the fault before its time.
    pub fn end(&mut self, now_ns: Nanoseconds) {
        self.state = State::Over;
        self.course.ended_ns.store(now_ns, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::{Phase, Snapshot};

    fn timer(window: Window) -> (Timer, Arc<Cues>) {
        let cues = Arc::new(Cues::default());
        (Timer::new(window, Arc::clone(&cues), Arc::default()), cues)
    }

    #[test]
    fn a_window_begins_after_its_cue_and_ends_after_its_length() {
        let window = Window { cue: Cue::Moving, after_ns: 10, lasts_ns: Some(5) };
        let (mut timer, cues) = timer(window);
        assert_eq!(timer.look(100), Edge::None);
        cues.observe(&Snapshot { phase: Phase::Moving, at_ns: 100, ..Snapshot::default() });
        let edges = [109, 110, 114, 115, 200].map(|now_ns| timer.look(now_ns));
        assert_eq!(edges, [Edge::None, Edge::Began, Edge::None, Edge::Ended, Edge::None]);
        assert_eq!((timer.course().began_ns(), timer.course().ended_ns()), (Some(110), Some(115)));
    }

    #[test]
    fn a_window_between_two_looks_is_there_from_the_first_to_the_second() {
        let (mut timer, _) = timer(Window { cue: Cue::Start, after_ns: 10, lasts_ns: Some(5) });
        let edges = [0, 100, 101].map(|now_ns| timer.look(now_ns));
        assert_eq!(edges, [Edge::None, Edge::Began, Edge::Ended]);
    }

    #[test]
    fn a_window_without_an_end_stays() {
        let (mut timer, _) = timer(Window { cue: Cue::Start, ..Window::default() });
        assert_eq!(timer.look(7), Edge::Began);
        assert_eq!(timer.look(u64::MAX - 1), Edge::None);
        assert!(timer.is_active());
    }
}
