//! What the view knows, and what it does with a key: without I/O and without a clock.

mod keys;

pub use keys::Key;

use std::collections::VecDeque;
use std::time::Duration;

use takt_rt::{AxisLimits, AxisSnapshot, Event, EventKind, Nanoseconds, RequestTarget, Snapshot};
use takt_wire::printable::printable;

use super::jog::Jog;
use super::request::Request;
use takt::command::LeaseHolder;
use takt::telemetry::{LoopTiming, Machine, words};

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
/// Rates are those of this time.
const RATES_NS: Nanoseconds = 1_000_000_000;
/// Histograms are those of this time.
const TIMING_NS: Nanoseconds = 10_000_000_000;

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
    /// True if it has ended, or its process has.
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
    /// True if it is not part of an ordinary run.
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
    /// True if commands are for all axes, or for the group of the selected one.
    pub is_for_all: bool,
    /// The jog.
    pub jog: Jog,
    speed: usize,
    /// The question that waits.
    pub question: Option<Question>,
    /// The last message, and whether it is of a failure.
    pub message: Option<(String, bool)>,
    /// True if the help is shown.
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
        let text = words::event(event, &self.machine).to_string();
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

    /// Returns `true` if this view commands.
    pub fn commands(&self) -> bool {
        self.is_lease_wanted && self.seen.lease.is_none_or(|holder| holder.process == self.process)
    }

    /// Returns `true` if the controller shows no cycles at present.
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
}
