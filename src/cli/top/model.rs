//! What the view knows, and what it does with a key: without I/O and without a clock.

use std::collections::VecDeque;
use std::time::Duration;

use takt_rt::{
    AxisLimits, AxisSnapshot, Event, EventKind, Nanoseconds, OperationMode, Phase, RequestTarget, Snapshot,
    StopCategory, StreamState,
};

use super::jog::{Jog, JogStep, Wish};
use super::request::Request;
use crate::command::LeaseHolder;
use crate::printable::printable;
use crate::telemetry::{LoopTiming, Machine, words};

/// Lines of events that are kept.
const EVENTS: usize = 200;
/// The parts of the velocity limit that an axis is jogged at.
const SPEEDS: [f64; 6] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.3];
/// The one in the beginning.
const FIRST_SPEED: usize = 2;
/// A question is answered within this time.
const ASKED_NS: Nanoseconds = 5_000_000_000;
/// A lease that is wanted is renewed so often.
const RENEWAL_NS: Nanoseconds = 300_000_000;
/// Who commands is shown within this time.
const SHOWN_NS: Nanoseconds = 100_000_000;
/// A process that has shown no cycle for so long is called silent, and nothing is jogged.
pub const SILENT: Duration = Duration::from_millis(500);
/// A velocity of profile velocity holds for this time.
const VALID_FOR: Duration = Duration::from_millis(250);
/// Rates are those of this time.
const RATES_NS: Nanoseconds = 1_000_000_000;
/// Histograms are those of this time.
const TIMING_NS: Nanoseconds = 10_000_000_000;

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

/// What was seen of a controller at one time.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Its state.
    pub snapshot: Snapshot,
    /// Its timing since the start.
    pub timing: LoopTiming,
    /// Who commands.
    pub lease: Option<LeaseHolder>,
    /// How long ago its process last showed a cycle.
    pub silent_for: Duration,
    /// Whether it has ended, or its process has.
    pub has_ended: bool,
}

/// What is known at one time, for rates.
#[derive(Clone, Copy)]
struct Sample {
    at_ns: Nanoseconds,
    snapshot: Snapshot,
    timing: LoopTiming,
}

/// A question that waits for a key.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// What is done when the answer is yes.
    pub request: Request,
    /// In words: "enable all axes".
    pub words: String,
    asked_ns: Nanoseconds,
}

/// An event, as it is shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// When.
    pub at_ns: Nanoseconds,
    /// What, with the cure.
    pub words: String,
    /// How often in a row it has happened.
    pub times: u64,
    /// Whether it is not part of an ordinary run.
    pub is_urgent: bool,
}

/// The view of one controller.
pub struct Model {
    /// By which it was connected.
    pub name: String,
    /// Names and units.
    pub machine: Machine,
    /// Of each axis.
    pub limits: Vec<Option<AxisLimits>>,
    /// The axes of each group, in its order; none where all axes are one group.
    groups: Vec<Vec<usize>>,
    /// The newest of what was seen.
    pub seen: Seen,
    /// When it was seen.
    pub seen_ns: Nanoseconds,
    /// The events, the oldest first.
    pub events: VecDeque<Line>,
    /// Events that came too fast.
    pub missed_events: u64,
    /// The axis that is selected.
    pub axis: usize,
    /// Whether commands are for all axes, or for the group of the selected one.
    pub is_for_all: bool,
    /// The jog.
    pub jog: Jog,
    speed: usize,
    /// The question that waits.
    pub question: Option<Question>,
    /// The last message, and whether it is of a failure.
    pub message: Option<(String, bool)>,
    /// Whether the help is shown.
    pub is_help_shown: bool,
    /// The own process.
    process: u32,
    is_lease_wanted: bool,
    renewed_ns: Nanoseconds,
    samples: VecDeque<Sample>,
}

impl Model {
    /// A view of a controller, in the process of this number.
    pub fn new(
        name: &str,
        mut machine: Machine,
        (limits, groups): (Vec<Option<AxisLimits>>, Vec<Vec<usize>>),
        process: u32,
        (seen, now_ns): (Seen, Nanoseconds),
    ) -> Self {
        let names = machine.axes.iter_mut().map(|axis| &mut axis.name);
        let names = names.chain(machine.buses.iter_mut().map(|bus| &mut bus.name)).chain(&mut machine.groups);
        names.chain([&mut machine.name]).for_each(|name| *name = printable(name));
        let mut model = Self {
            name: name.to_owned(),
            machine,
            limits,
            groups,
            seen,
            seen_ns: now_ns,
            events: VecDeque::new(),
            missed_events: 0,
            axis: 0,
            is_for_all: true,
            jog: Jog::Off,
            speed: FIRST_SPEED,
            question: None,
            message: None,
            is_help_shown: false,
            process,
            is_lease_wanted: false,
            renewed_ns: 0,
            samples: VecDeque::new(),
        };
        model.observe(now_ns, seen);
        model
    }

    /// The controller was looked at.
    pub fn observe(&mut self, now_ns: Nanoseconds, seen: Seen) {
        (self.seen, self.seen_ns) = (seen, now_ns);
        let Seen { snapshot, timing, .. } = seen;
        let newest_ns = self.samples.back().map_or(0, |sample| sample.at_ns);
        if self.samples.is_empty() || now_ns.saturating_sub(newest_ns) >= RATES_NS / 4 {
            self.samples.push_back(Sample { at_ns: now_ns, snapshot, timing });
        }
        while self.samples.get(1).is_some_and(|second| second.at_ns + TIMING_NS <= now_ns) {
            self.samples.pop_front();
        }
    }

    /// Something has happened.
    pub fn happened(&mut self, event: &Event) {
        let is_urgent = matches!(
            event.kind,
            EventKind::Stop(_)
                | EventKind::Emergency { .. }
                | EventKind::Rejected(_)
                | EventKind::MissedSlots { .. }
        );
        let text = words::event(event, &self.machine);
        let text = printable(&text);
        if let Some(last) = self.events.back_mut().filter(|last| last.words == text) {
            (last.at_ns, last.times) = (event.at_ns, last.times + 1);
            return;
        }
        if self.events.len() == EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(Line { at_ns: event.at_ns, words: text, times: 1, is_urgent });
    }

    /// A request was answered.
    pub fn answered(&mut self, now_ns: Nanoseconds, request: &Request, answer: Result<(), String>) {
        match answer {
            Ok(()) => {
                if let Some(done) = request.done() {
                    self.message = Some((done.to_owned(), false));
                }
                if matches!(request, Request::TakeLease | Request::TakeOver) {
                    (self.is_lease_wanted, self.renewed_ns) = (true, now_ns);
                    self.seen.lease = Some(LeaseHolder { process: self.process, expires_in: Duration::ZERO });
                }
            }
            Err(why) => {
                self.message = Some((format!("{}: {why}", request.name()), true));
                match request {
                    Request::RenewLease | Request::TakeLease | Request::TakeOver => {
                        self.is_lease_wanted = false;
                        self.jog.forget();
                    }
                    Request::BeginStream(_)
                    | Request::Velocities { .. }
                    | Request::ProfileVelocity { .. } => {
                        self.jog.forget();
                    }
                    _ => {}
                }
            }
        }
    }

    /// Whether this view commands.
    pub fn commands(&self) -> bool {
        self.is_lease_wanted && self.seen.lease.is_none_or(|holder| holder.process == self.process)
    }

    /// Whether the controller shows no cycles at present.
    pub fn is_silent(&self) -> bool {
        self.seen.has_ended || self.seen.silent_for >= SILENT
    }

    /// The selected axis.
    pub fn selected(&self) -> Option<&AxisSnapshot> {
        self.seen.snapshot.axes().get(self.axis)
    }

    /// The velocity that the selected axis is jogged at, and its part of the limit.
    pub fn speed(&self) -> (f64, f64) {
        let part = SPEEDS.get(self.speed).copied().unwrap_or(SPEEDS[0]);
        let limit = self.limits.get(self.axis).copied().flatten().map_or(0.0, |limits| limits.velocity);
        (if limit.is_finite() { part * limit } else { 0.0 }, part)
    }

    /// The group of an axis.
    fn group_of(&self, axis: usize) -> usize {
        self.machine.axes.get(axis).map_or(0, |axis| axis.group)
    }

    /// Whose axes commands are for.
    pub fn target(&self) -> RequestTarget {
        if self.is_for_all { RequestTarget::All } else { self.target_of(self.axis) }
    }

    /// The group of an axis as a target: all axes where there are no groups.
    fn target_of(&self, axis: usize) -> RequestTarget {
        match self.machine.groups.len() {
            0 | 1 => RequestTarget::All,
            _ => RequestTarget::Group(u8::try_from(self.group_of(axis)).unwrap_or(0)),
        }
    }

    /// The same in words.
    pub fn target_words(&self) -> String {
        match self.target() {
            RequestTarget::All => "all axes".to_owned(),
            RequestTarget::Group(group) => format!("group {}", self.machine.group_name(group)),
        }
    }

    /// The rates of a bus in the last second: its load in percent, and frames sent and received a second.
    pub fn rates(&self, bus: usize) -> Option<(f64, f64, f64)> {
        let newest = self.seen.snapshot.buses().get(bus)?;
        let sample = self.samples.iter().rev().find(|sample| sample.at_ns + RATES_NS <= self.seen_ns)?;
        let before = sample.snapshot.buses().get(bus)?;
        let elapsed_ns = self.seen.snapshot.at_ns.checked_sub(sample.snapshot.at_ns).filter(|ns| *ns > 0)?;
        let elapsed_s = elapsed_ns as f64 / 1e9;
        let rate = |now: u64, before: u64| now.saturating_sub(before) as f64 / elapsed_s;
        let load = 100.0 * newest.busy_ns.saturating_sub(before.busy_ns) as f64 / elapsed_ns as f64;
        Some((load, rate(newest.tx_frames, before.tx_frames), rate(newest.rx_frames, before.rx_frames)))
    }

    /// The timing of the last ten seconds, or since the view has begun.
    pub fn recent_timing(&self) -> LoopTiming {
        let oldest = self.samples.front().map_or_else(LoopTiming::default, |sample| sample.timing);
        self.seen.timing.since(&oldest)
    }

    /// Time passes: what that leads to.
    pub fn pass(&mut self, now_ns: Nanoseconds) -> Vec<Request> {
        if self.question.as_ref().is_some_and(|question| now_ns.saturating_sub(question.asked_ns) > ASKED_NS)
        {
            self.question = None;
            self.message = Some(("not confirmed in time: nothing was done".to_owned(), false));
        }
        let mut requests = vec![];
        // What is shown may be a little older than the answer to what was asked.
        if self.is_lease_wanted && !self.commands() && now_ns.saturating_sub(self.renewed_ns) > SHOWN_NS {
            let process = self.seen.lease.map_or(0, |holder| holder.process);
            self.is_lease_wanted = false;
            self.jog.forget();
            self.message = Some((format!("process {process} has taken over: this view only observes"), true));
        }
        if self.seen.has_ended {
            self.is_lease_wanted = false;
            self.jog.forget();
        }
        if self.jog.moving().is_some() && (self.is_silent() || !self.is_selected_ready()) {
            requests.extend(self.end_jog(now_ns));
        }
        if self.is_lease_wanted && now_ns.saturating_sub(self.renewed_ns) >= RENEWAL_NS {
            self.renewed_ns = now_ns;
            requests.push(Request::RenewLease);
        }
        let steps = self.jog.pass(now_ns);
        requests.extend(steps.into_iter().flat_map(|step| self.jog_requests(now_ns, step)));
        requests
    }

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

    /// Whether the selected axis can be moved now.
    fn is_selected_ready(&self) -> bool {
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

    fn end_jog(&mut self, now_ns: Nanoseconds) -> Vec<Request> {
        let steps = self.jog.end(now_ns);
        steps.into_iter().flat_map(|step| self.jog_requests(now_ns, step)).collect()
    }

    /// What a step of the jog asks of the controller.
    fn jog_requests(&self, now_ns: Nanoseconds, step: JogStep) -> Option<Request> {
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
