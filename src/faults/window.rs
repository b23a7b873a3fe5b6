//! The time window of a fault.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use takt_rt::Nanoseconds;

use super::trigger::{Trigger, TriggerTimes};

/// The time window of a fault, counted from a trigger.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// The trigger.
    pub trigger: Trigger,
    /// From the trigger to the beginning.
    pub after_ns: Nanoseconds,
    /// From the beginning to the end; `None`: to the end of the run.
    pub lasts_ns: Option<Nanoseconds>,
}

const NOT_YET: Nanoseconds = Nanoseconds::MAX;

/// The progress of a fault, readable from any thread.
#[derive(Debug)]
pub struct FaultProgress {
    began_ns: AtomicU64,
    ended_ns: AtomicU64,
    frames: AtomicU64,
    is_impossible: AtomicBool,
}

impl Default for FaultProgress {
    fn default() -> Self {
        Self {
            began_ns: AtomicU64::new(NOT_YET),
            ended_ns: AtomicU64::new(NOT_YET),
            frames: AtomicU64::new(0),
            is_impossible: AtomicBool::new(false),
        }
    }
}

impl FaultProgress {
    /// When it began, if it has.
    pub fn began_ns(&self) -> Option<Nanoseconds> {
        Some(self.began_ns.load(Ordering::Acquire)).filter(|ns| *ns != NOT_YET)
    }

    /// When it ended, if it has.
    pub fn ended_ns(&self) -> Option<Nanoseconds> {
        Some(self.ended_ns.load(Ordering::Acquire)).filter(|ns| *ns != NOT_YET)
    }

    /// Number of frames that it changed or sent.
    pub fn frames(&self) -> u64 {
        self.frames.load(Ordering::Relaxed)
    }

    /// Returns `true` if it could not be injected, because the port has no drive that can have it.
    pub fn is_impossible(&self) -> bool {
        self.is_impossible.load(Ordering::Relaxed)
    }

    pub(super) fn count_frame(&self) {
        // Only the thread of the port writes.
        self.frames.store(self.frames() + 1, Ordering::Relaxed);
    }

    pub(super) fn set_impossible(&self) {
        self.is_impossible.store(true, Ordering::Relaxed);
    }
}

/// The change at a call of [`WindowTimer::poll`].
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
enum WindowState {
    Waiting,
    Active { until_ns: Nanoseconds },
    Over,
}

/// Tracks a window.
#[derive(Debug)]
pub struct WindowTimer {
    window: Window,
    trigger_times: Arc<TriggerTimes>,
    progress: Arc<FaultProgress>,
    opened_ns: Option<Nanoseconds>,
    state: WindowState,
}

impl WindowTimer {
    pub fn new(window: Window, trigger_times: Arc<TriggerTimes>, progress: Arc<FaultProgress>) -> Self {
        Self { window, trigger_times, progress, opened_ns: None, state: WindowState::Waiting }
    }

    /// Returns `true` if the fault is active.
    pub fn is_active(&self) -> bool {
        matches!(self.state, WindowState::Active { .. })
    }

    pub fn progress(&self) -> &FaultProgress {
        &self.progress
    }

    /// Checks the time. A window that lies between two calls is active from the first of them to the second.
    pub fn poll(&mut self, now_ns: Nanoseconds) -> Edge {
        let opened_ns = *self.opened_ns.get_or_insert(now_ns);
        match self.state {
            WindowState::Waiting => {
                let trigger_ns = match self.window.trigger {
                    Trigger::Start => Some(opened_ns),
                    trigger => self.trigger_times.at_ns(trigger),
                };
                let Some(begins_ns) =
                    trigger_ns.map(|trigger_ns| trigger_ns.saturating_add(self.window.after_ns))
                else {
                    return Edge::None;
                };
                if now_ns < begins_ns {
                    return Edge::None;
                }
                let lasts_ns = self.window.lasts_ns.unwrap_or(NOT_YET);
                self.state = WindowState::Active { until_ns: begins_ns.saturating_add(lasts_ns) };
                self.progress.began_ns.store(now_ns, Ordering::Release);
                Edge::Began
            }
            WindowState::Active { until_ns } if now_ns >= until_ns => {
                self.end(now_ns);
                Edge::Ended
            }
            WindowState::Active { .. } | WindowState::Over => Edge::None,
        }
    }

    /// Ends the fault before its time.
    pub fn end(&mut self, now_ns: Nanoseconds) {
        self.state = WindowState::Over;
        self.progress.ended_ns.store(now_ns, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::{Phase, Snapshot};

    fn timer(window: Window) -> (WindowTimer, Arc<TriggerTimes>) {
        let trigger_times = Arc::new(TriggerTimes::default());
        (WindowTimer::new(window, Arc::clone(&trigger_times), Arc::default()), trigger_times)
    }

    #[test]
    fn a_window_begins_after_its_trigger_and_ends_after_its_length() {
        let window = Window { trigger: Trigger::Moving, after_ns: 10, lasts_ns: Some(5) };
        let (mut timer, trigger_times) = timer(window);
        assert_eq!(timer.poll(100), Edge::None);
        let mut moving = Snapshot { at_ns: 100, ..Snapshot::default() };
        moving.groups[0].phase = Phase::Moving;
        trigger_times.observe(&moving);
        let edges = [109, 110, 114, 115, 200].map(|now_ns| timer.poll(now_ns));
        assert_eq!(edges, [Edge::None, Edge::Began, Edge::None, Edge::Ended, Edge::None]);
        assert_eq!((timer.progress().began_ns(), timer.progress().ended_ns()), (Some(110), Some(115)));
    }

    #[test]
    fn a_window_between_two_polls_lasts_from_the_first_to_the_second() {
        let (mut timer, _) = timer(Window { trigger: Trigger::Start, after_ns: 10, lasts_ns: Some(5) });
        let edges = [0, 100, 101].map(|now_ns| timer.poll(now_ns));
        assert_eq!(edges, [Edge::None, Edge::Began, Edge::Ended]);
    }

    #[test]
    fn a_window_without_an_end_stays() {
        let (mut timer, _) = timer(Window { trigger: Trigger::Start, ..Window::default() });
        assert_eq!(timer.poll(7), Edge::Began);
        assert_eq!(timer.poll(u64::MAX - 1), Edge::None);
        assert!(timer.is_active());
    }
}
