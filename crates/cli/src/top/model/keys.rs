//! What a key leads to: a selection, a question, a request, or a step of the jog.

use std::time::Duration;

use takt_rt::{Nanoseconds, OperationMode, Phase, RequestTarget, StopCategory, StreamState};

use super::{Model, Question, SPEEDS};
use crate::top::jog::{Jog, JogStep, Wish};
use crate::top::request::Request;
use takt::telemetry::words;

/// A velocity of profile velocity holds for this time.
const VALID_FOR: Duration = Duration::from_millis(250);

/// A key, as far as it means something here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// A letter, a sign or the space bar.
    Letter(char),
    /// ↑
    Up,
    /// ↓
    Down,
    /// ←
    Left,
    /// →
    Right,
    /// Escape.
    Escape,
    /// Ctrl-C.
    Interrupt,
}

impl Model {
    /// A key was pressed, or repeated: what that leads to.
    pub fn key(&mut self, now_ns: Nanoseconds, key: Key) -> Vec<Request> {
        // Stopping comes first, whatever is shown or asked.
        match key {
            Key::Letter(' ') => return self.stop(StopCategory::Two),
            Key::Letter('x' | 'X') => return self.stop(StopCategory::One),
            _ => {}
        }
        let is_jog = matches!(key, Key::Left | Key::Right);
        let mut requests = if is_jog { vec![] } else { self.end_jog(now_ns) };
        if let Some(question) = self.question.take() {
            match key {
                Key::Letter('y' | 'Y') => requests.push(question.request),
                _ => self.message = Some(("nothing was done".to_owned(), false)),
            }
            return requests;
        }
        if self.is_help_shown && !matches!(key, Key::Letter('q') | Key::Interrupt) {
            self.is_help_shown = false;
            return requests;
        }
        match key {
            Key::Letter('q' | 'Q') | Key::Interrupt => requests.push(Request::Quit),
            Key::Letter('?') => self.is_help_shown = true,
            Key::Up | Key::Letter('k') => self.select(-1),
            Key::Down | Key::Letter('j') => self.select(1),
            Key::Letter('g') if self.machine.groups.len() > 1 => self.is_for_all = !self.is_for_all,
            Key::Letter('+' | '=') => self.speed = (self.speed + 1).min(SPEEDS.len() - 1),
            Key::Letter('-') => self.speed = self.speed.saturating_sub(1),
            Key::Letter('t') => requests.push(Request::TakeLease),
            Key::Letter('T') => self.ask(now_ns, Request::TakeOver, "take the lease from whoever has it"),
            Key::Letter('r') => {
                self.is_lease_wanted = false;
                requests.push(Request::Release);
            }
            Key::Letter('e') => self.ask_of_axes(now_ns, Request::Enable, "enable"),
            Key::Letter('d') => self.ask_of_axes(now_ns, Request::Disable, "bring to rest and disable"),
            Key::Letter('c') => self.ask_of_axes(now_ns, Request::ClearFaults, "clear the faults of"),
            Key::Left | Key::Right => requests.extend(self.jog_key(now_ns, key == Key::Right)),
            Key::Letter(_) | Key::Escape => {}
        }
        requests
    }

    fn select(&mut self, by: isize) {
        let count = self.machine.axes.len().max(1);
        self.axis = self.axis.saturating_add_signed(by).min(count - 1);
    }

    /// A stop of all axes. It needs no lease.
    fn stop(&mut self, category: StopCategory) -> Vec<Request> {
        self.jog.forget();
        self.question = None;
        vec![Request::Stop { target: RequestTarget::All, category }]
    }

    fn ask_of_axes(&mut self, now_ns: Nanoseconds, request: fn(RequestTarget) -> Request, verb: &str) {
        if self.must_take_lease() {
            return;
        }
        let words = format!("{verb} {}", self.target_words());
        self.ask(now_ns, request(self.target()), &words);
    }

    fn ask(&mut self, now_ns: Nanoseconds, request: Request, words: &str) {
        self.message = None;
        self.question = Some(Question { request, words: words.to_owned(), asked_ns: now_ns });
    }

    /// Says so if this view does not command.
    fn must_take_lease(&mut self) -> bool {
        if self.commands() {
            return false;
        }
        self.message = Some(("this view only observes: take the lease with t first".to_owned(), true));
        true
    }

    /// Returns `true` if the selected axis can be moved now.
    pub(super) fn is_selected_ready(&self) -> bool {
        let is_ready = matches!(self.phase(), Some(Phase::Holding | Phase::Streaming));
        is_ready && self.selected().is_some_and(|axis| axis.is_heard)
    }

    /// The phase of the group of the selected axis.
    fn phase(&self) -> Option<Phase> {
        self.seen.snapshot.groups().get(self.group_of(self.axis)).map(|group| group.phase)
    }

    fn jog_key(&mut self, now_ns: Nanoseconds, is_positive: bool) -> Vec<Request> {
        if self.must_take_lease() {
            return vec![];
        }
        let refusal = self.jog_refusal();
        if refusal.is_some() {
            self.message = refusal.map(|words| (words, true));
            return self.end_jog(now_ns);
        }
        let steps = self.jog.key(now_ns, Wish { axis: self.axis, is_positive });
        if let Jog::Pressed { .. } = self.jog {
            self.message = Some(("hold the key to move".to_owned(), false));
        } else if self.jog.moving().is_some() {
            self.message = None;
        }
        steps.into_iter().flat_map(|step| self.jog_requests(now_ns, step)).collect()
    }

    /// Why the selected axis cannot be jogged, in words.
    fn jog_refusal(&self) -> Option<String> {
        if self.is_silent() {
            return Some("the controller shows no cycles: nothing is moved".to_owned());
        }
        let axis = self.selected()?;
        match self.phase() {
            Some(Phase::Holding) => {}
            Some(Phase::Streaming) => {
                let group = self.seen.snapshot.groups().get(self.group_of(self.axis));
                if group.is_some_and(|group| group.stream.state == StreamState::Callback) {
                    return Some("a callback leads the axes: stop them with SPACE first".to_owned());
                }
            }
            Some(Phase::Disabled | Phase::Passive) => {
                return Some("the axes are not enabled: enable them with e first".to_owned());
            }
            phase => {
                let phase = phase.map_or("unknown", words::phase);
                return Some(format!("not possible while {phase}: stop with SPACE, or wait"));
            }
        }
        if !axis.is_heard {
            return Some("the drive has not reported yet: nothing is moved".to_owned());
        }
        match OperationMode::from_number(axis.mode_set) {
            Some(mode @ (OperationMode::ProfilePosition | OperationMode::ProfileTorque)) => {
                Some(format!("an axis in {} is not jogged: it takes no velocity", mode.name()))
            }
            _ if self.speed().0 <= 0.0 => Some("the axis has no velocity limit to take a part of".to_owned()),
            _ => None,
        }
    }

    pub(super) fn end_jog(&mut self, now_ns: Nanoseconds) -> Vec<Request> {
        let steps = self.jog.end(now_ns);
        steps.into_iter().flat_map(|step| self.jog_requests(now_ns, step)).collect()
    }

    /// What a step of the jog asks of the controller.
    pub(super) fn jog_requests(&self, now_ns: Nanoseconds, step: JogStep) -> Option<Request> {
        let (wish, part) = match step {
            JogStep::Begin(wish) => (wish, None),
            JogStep::Move(wish) => (wish, Some(if wish.is_positive { 1.0 } else { -1.0 })),
            JogStep::Rest(wish) => (wish, Some(0.0)),
        };
        let axis = wish.axis;
        let velocity = part.map(|part: f64| part * self.speed().0);
        let mode = self.seen.snapshot.axes().get(axis).map_or(0, |axis| axis.mode_set);
        let plans_itself = OperationMode::from_number(mode) == Some(OperationMode::ProfileVelocity);
        match (velocity, plans_itself) {
            (None, true) => None,
            // A stream that has run dry goes on with the next point.
            (None, false) if self.phase() == Some(Phase::Streaming) => None,
            (None, false) => Some(Request::BeginStream(self.target_of(axis))),
            (Some(velocity), true) => {
                Some(Request::ProfileVelocity { at_ns: now_ns, axis, velocity, valid_for: VALID_FOR })
            }
            (Some(velocity), false) => {
                let target = self.target_of(axis);
                let of_axis = |other: usize| if other == axis { velocity } else { 0.0 };
                let velocities = self.axes_of(target).into_iter().map(of_axis).collect();
                Some(Request::Velocities { target, at_ns: now_ns, velocities })
            }
        }
    }

    fn axes_of(&self, target: RequestTarget) -> Vec<usize> {
        match target {
            RequestTarget::All => (0..self.machine.axes.len()).collect(),
            RequestTarget::Group(group) => self.groups.get(usize::from(group)).cloned().unwrap_or_default(),
        }
    }
}
