//! The life cycle of a run, without input and output: bring-up, enable, motion program, stop, disable, leave.
//!
//! ```text
//! Configure → Start → Activate → Enable → Run → Settle → Disable → Leave → Done
//!     └────────── any failure, stop or interrupt ─────────┴──────────↗
//! ```
//!
//! [`Supervisor::poll`] is called now and then with the host's side of the host interface. It never blocks, so it runs beside the
//! real-time thread as well as between the cycles of a run in virtual time.

use std::collections::VecDeque;

use takt_rt::{
    AxisSnapshot, Frame, Phase, Request, RequestEnvelope, Rule, Snapshot, StopCategory, StopReason,
};

use super::channels::{HostSide, RequestNumbers};
use super::outcome::{Interrupt, Outcome, Progress};
use super::program::{ProgramRunner, Step};
use crate::config::Config;
use crate::drive::{AxisFacts, BringUp, Leave};

/// The group must get where it was told to within this time; the engine has time-outs of its own, which are shorter.
const PATIENCE_NS: u64 = 8_000_000_000;
/// Standstill before the brakes: the drives settle on their last set-point.
const SETTLE_NS: u64 = 300_000_000;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Configure,
    Start,
    Activate,
    ResetFaults,
    Enable,
    Run,
    Settle {
        until_ns: u64,
    },
    Disable,
    Leave,
    /// The power is being taken without farewell.
    Cut,
    Done,
}

/// Leads a controller through its life.
pub struct Supervisor {
    axes: usize,
    stage: Stage,
    stage_since_ns: Option<u64>,
    bring_up: BringUp,
    leave: Leave,
    program: ProgramRunner,
    facts: Vec<AxisFacts>,
    outgoing: VecDeque<RequestEnvelope>,
    numbers: RequestNumbers,
    interrupt: Option<Interrupt>,
    outcome: Option<Outcome>,
    /// See [`Supervisor::unreached`].
    unreached: Vec<usize>,
    deadline_ns: Option<u64>,
    duration_ns: Option<u64>,
    /// Whether somebody else commands the group once it is enabled.
    is_serving: bool,
}

impl Supervisor {
    /// A run of the configuration's program; with a duration, the program is repeated until that is over.
    pub fn new(config: &Config, duration_ns: Option<u64>) -> Self {
        Self {
            axes: config.axes.len(),
            stage: Stage::Configure,
            stage_since_ns: None,
            bring_up: BringUp::new(config),
            leave: Leave::new(config),
            program: ProgramRunner::new(&config.program, duration_ns.is_some()),
            facts: Vec::new(),
            outgoing: VecDeque::new(),
            numbers: RequestNumbers::default(),
            interrupt: None,
            outcome: None,
            unreached: Vec::new(),
            deadline_ns: None,
            duration_ns,
            is_serving: false,
        }
    }

    /// A group that is brought up and enabled, and then left to somebody else's requests until it is interrupted. A stop
    /// does not end the run: whoever commands the group decides what follows it.
    pub fn serving(config: &Config) -> Self {
        Self { is_serving: true, ..Self::new(config, None) }
    }

    /// Asks the run to end. A harder interrupt overtakes a softer one.
    pub fn interrupt(&mut self, interrupt: Interrupt) {
        self.interrupt = self.interrupt.max(Some(interrupt));
    }

    /// How the run ended; `None` while it goes on.
    pub fn outcome(&self) -> Option<&Outcome> {
        if self.stage == Stage::Done { self.outcome.as_ref() } else { None }
    }

    /// The axes whose drives gave no answer to the farewell, though they had been brought up: nobody has heard whether they
    /// have stopped.
    pub fn unreached(&self) -> &[usize] {
        &self.unreached
    }

    /// What the drives have said of themselves; empty before they are configured.
    pub fn facts(&self) -> &[AxisFacts] {
        &self.facts
    }

    /// Where the last move led (rad or m), an axis each.
    pub fn target(&self) -> Option<&[f64]> {
        self.program.target()
    }

    /// Does what is due.
    pub fn poll(&mut self, now_ns: u64, host: &mut HostSide) {
        while let Some((bus, received)) = host.take_service() {
            self.bring_up.receive(bus, &received.frame);
            self.leave.receive(bus, &received.frame);
        }
        let snapshot = host.snapshot();
        self.numbers = host.numbers();
        self.heed_interrupt(now_ns);
        let since_ns = *self.stage_since_ns.get_or_insert(now_ns);
        self.step(now_ns, now_ns.saturating_sub(since_ns), &snapshot, host);
        while let Some(request) = self.outgoing.front() {
            if host.ask(*request).is_err() {
                break;
            }
            self.outgoing.pop_front();
        }
    }

    fn step(&mut self, now_ns: u64, elapsed_ns: u64, snapshot: &Snapshot, host: &mut HostSide) {
        match self.stage {
            Stage::Configure => self.configure(now_ns, host),
            Stage::Start => self.start(now_ns, host),
            Stage::Activate => self.activate(now_ns, elapsed_ns, snapshot),
            Stage::ResetFaults => self.reset_faults(now_ns, elapsed_ns, snapshot),
            Stage::Enable => self.enable(now_ns, elapsed_ns, snapshot),
            Stage::Run => self.run(now_ns, snapshot),
            Stage::Settle { until_ns } => {
                let is_moving = matches!(snapshot.phase, Phase::Moving | Phase::Streaming | Phase::Stopping);
                if let Some(stop) = own_stop(snapshot) {
                    self.end(now_ns, Outcome::Stopped(stop));
                } else if is_moving && elapsed_ns <= PATIENCE_NS {
                    self.stage = Stage::Settle { until_ns: now_ns + SETTLE_NS };
                } else if is_moving || now_ns >= until_ns {
                    // Whoever still moves the group by then does not want it to end: it is stopped first.
                    self.begin_disable(now_ns);
                }
            }
            Stage::Disable => {
                if matches!(snapshot.phase, Phase::Disabled | Phase::Passive) {
                    self.note_fault_of_disabling(snapshot);
                    self.begin_leave(now_ns);
                } else if elapsed_ns > PATIENCE_NS {
                    self.outcome.get_or_insert(Outcome::Stuck { phase: snapshot.phase });
                    self.begin_leave(now_ns);
                }
            }
            Stage::Leave => self.say_farewell(now_ns, elapsed_ns, host),
            Stage::Cut => {
                // The last controlwords take effect at the SYNC after them, and may have to wait for the bus: the loop goes
                // on until it shows, or until the engine waits no longer.
                let is_off = matches!(snapshot.phase, Phase::Disabled | Phase::Passive);
                if (is_off && elapsed_ns > 0) || elapsed_ns > PATIENCE_NS {
                    self.ask(Request::Shutdown);
                    self.enter(Stage::Done, now_ns);
                }
            }
            Stage::Done => {}
        }
    }

    fn configure(&mut self, now_ns: u64, host: &mut HostSide) {
        self.bring_up.poll(now_ns, &mut sending_through(host));
        match self.bring_up.outcome() {
            None => {}
            Some(Err(error)) => self.end(now_ns, Outcome::BringUpFailed(error)),
            Some(Ok(facts)) => {
                for (axis, facts) in (0..).zip(&facts) {
                    if let Some(data) = &facts.process_data {
                        self.ask(data.request(axis));
                    }
                    if let Some(torque) = facts.rated_torque {
                        self.ask(Request::RatedTorque { axis, torque });
                    }
                }
                self.facts = facts;
                // It has just succeeded, so the second stage can begin.
                let _ = self.bring_up.start();
                self.enter(Stage::Start, now_ns);
            }
        }
    }

    fn start(&mut self, now_ns: u64, host: &mut HostSide) {
        self.bring_up.poll(now_ns, &mut sending_through(host));
        match self.bring_up.outcome() {
            None => {}
            Some(Err(error)) => self.end(now_ns, Outcome::BringUpFailed(error)),
            Some(Ok(facts)) => {
                // Some drives report by process data only when they are given a target.
                let positions = (0..)
                    .zip(&facts)
                    .map(|(axis, facts)| Request::Position { axis, counts: facts.position_counts });
                positions.for_each(|position| self.ask(position));
                // Every node is operational: each answers the first SYNC, unless it always answers late.
                self.ask(Request::Sync(true));
                self.ask(Request::Activate);
                self.enter(Stage::Activate, now_ns);
            }
        }
    }

    fn activate(&mut self, now_ns: u64, elapsed_ns: u64, snapshot: &Snapshot) {
        let silent = self.shown(snapshot).iter().position(|axis| !axis.is_heard);
        match silent {
            None if snapshot.phase == Phase::Disabled => {
                if self.faulted(snapshot).is_some() {
                    self.ask(Request::ResetFaults);
                    self.enter(Stage::ResetFaults, now_ns);
                } else {
                    self.begin_enable(now_ns);
                }
            }
            Some(axis) if elapsed_ns > PATIENCE_NS => self.end(now_ns, Outcome::NotHeard { axis }),
            _ if elapsed_ns > PATIENCE_NS => self.end(now_ns, Outcome::Stuck { phase: snapshot.phase }),
            _ => {}
        }
    }

    fn reset_faults(&mut self, now_ns: u64, elapsed_ns: u64, snapshot: &Snapshot) {
        match self.faulted(snapshot) {
            None => self.begin_enable(now_ns),
            Some((axis, code)) if elapsed_ns > PATIENCE_NS / 4 => {
                self.end(now_ns, Outcome::FaultPersists { axis, code });
            }
            Some(_) => {}
        }
    }

    fn begin_enable(&mut self, now_ns: u64) {
        self.ask(Request::Enable);
        self.enter(Stage::Enable, now_ns);
    }

    fn enable(&mut self, now_ns: u64, elapsed_ns: u64, snapshot: &Snapshot) {
        // Whoever commands the group may have been quicker to see that it holds.
        let is_enabled =
            matches!(snapshot.phase, Phase::Holding | Phase::Moving | Phase::Streaming | Phase::Stopping);
        if let Some(stop) = own_stop(snapshot).filter(|_| !(self.is_serving && is_enabled)) {
            self.end(now_ns, Outcome::Stopped(stop));
        } else if is_enabled {
            self.deadline_ns = self.duration_ns.map(|duration_ns| now_ns + duration_ns);
            self.enter(Stage::Run, now_ns);
        } else if elapsed_ns > PATIENCE_NS {
            self.end(now_ns, Outcome::Stuck { phase: snapshot.phase });
        }
    }

    fn run(&mut self, now_ns: u64, snapshot: &Snapshot) {
        if self.is_serving {
            return;
        }
        if let Some(stop) = own_stop(snapshot) {
            return self.end(now_ns, Outcome::Stopped(stop));
        }
        if self.deadline_ns.is_some_and(|deadline_ns| now_ns >= deadline_ns) {
            self.ask(Request::Stop(StopCategory::Two));
            return self.end(now_ns, Outcome::Finished);
        }
        match self.program.poll(now_ns, snapshot, &self.numbers) {
            Step::Wait => {}
            Step::Begin(requests) => self.outgoing.extend(requests),
            Step::Refused { number, refusal } => self.end(now_ns, Outcome::MoveRefused { number, refusal }),
            Step::Finished => self.end(now_ns, Outcome::Finished),
        }
    }

    fn heed_interrupt(&mut self, now_ns: u64) {
        match (self.interrupt, self.stage) {
            (None, _) | (_, Stage::Done | Stage::Cut) => {}
            (Some(Interrupt::Immediate), _) => {
                self.ask(Request::InhibitEnable);
                self.ask(Request::Stop(StopCategory::Zero));
                self.outcome.get_or_insert(Outcome::Interrupted);
                self.enter(Stage::Cut, now_ns);
            }
            (Some(Interrupt::Controlled), Stage::Settle { .. } | Stage::Disable | Stage::Leave) => {}
            (Some(Interrupt::Controlled), Stage::Run) => {
                self.ask(Request::Stop(StopCategory::Two));
                self.end(now_ns, Outcome::Interrupted);
            }
            (Some(Interrupt::Controlled), _) => self.end(now_ns, Outcome::Interrupted),
        }
    }

    /// Begins the way out from wherever the run is.
    fn end(&mut self, now_ns: u64, outcome: Outcome) {
        let was_running = matches!(self.stage, Stage::Run);
        let has_been_active = !matches!(self.stage, Stage::Configure | Stage::Start);
        self.outcome.get_or_insert(outcome);
        if was_running && !matches!(self.outcome, Some(Outcome::Stopped(_))) {
            self.enter(Stage::Settle { until_ns: now_ns + SETTLE_NS }, now_ns);
        } else if has_been_active {
            self.begin_disable(now_ns);
        } else {
            self.begin_leave(now_ns);
        }
    }

    fn begin_disable(&mut self, now_ns: u64) {
        // In this order, so that nobody enables what has just been disabled.
        self.ask(Request::InhibitEnable);
        self.ask(Request::Disable);
        self.enter(Stage::Disable, now_ns);
    }

    /// A run that had been well so far was not, if the drives did not let themselves be disabled as they should.
    fn note_fault_of_disabling(&mut self, snapshot: &Snapshot) {
        let fault = own_stop(snapshot).filter(|stop| stop.phase == Phase::Disabling);
        if let (Some(stop), Some(Outcome::Finished | Outcome::Interrupted)) = (fault, &self.outcome) {
            self.outcome = Some(Outcome::Stopped(stop));
        }
    }

    fn begin_leave(&mut self, now_ns: u64) {
        self.enter(Stage::Leave, now_ns);
    }

    fn say_farewell(&mut self, now_ns: u64, elapsed_ns: u64, host: &mut HostSide) {
        self.leave.poll(now_ns, &mut sending_through(host));
        let left = self.leave.outcome();
        if left.is_some() || elapsed_ns > PATIENCE_NS {
            if let (Some(Err(error)), false) = (left, self.facts.is_empty()) {
                let silent = error.failures.into_iter().filter(|failure| failure.cause.is_silence());
                self.unreached = silent.map(|failure| failure.axis).collect();
            }
            self.ask(Request::Sync(false));
            self.ask(Request::Shutdown);
            self.enter(Stage::Done, now_ns);
        }
    }

    fn ask(&mut self, request: Request) {
        self.outgoing.push_back(RequestEnvelope { id: self.numbers.next(), request });
    }

    fn enter(&mut self, stage: Stage, now_ns: u64) {
        self.stage = stage;
        self.stage_since_ns = Some(now_ns);
    }

    fn shown<'a>(&self, snapshot: &'a Snapshot) -> &'a [AxisSnapshot] {
        snapshot.axes.get(..self.axes).unwrap_or(&snapshot.axes)
    }

    fn faulted(&self, snapshot: &Snapshot) -> Option<(usize, u16)> {
        let axes = self.shown(snapshot);
        axes.iter().position(|axis| axis.drive_state.is_faulted()).map(|axis| (axis, axes[axis].error_code))
    }

    /// What the run is doing.
    pub fn progress(&self) -> Progress {
        let (what, fraction) = match self.stage {
            Stage::Configure | Stage::Start => {
                let progress = self.bring_up.progress();
                (format!("bring-up: {}", progress.step), Some(progress.fraction))
            }
            Stage::Activate | Stage::ResetFaults | Stage::Enable => ("enabling".to_owned(), None),
            Stage::Run => {
                let (begun, all) = self.program.progress();
                let of = all.map_or(String::new(), |all| format!(" of {all}"));
                (format!("move {begun}{of}"), all.map(|all| begun.saturating_sub(1) as f64 / all as f64))
            }
            Stage::Settle { .. } => ("settling".to_owned(), Some(1.0)),
            Stage::Disable => ("stopping".to_owned(), Some(1.0)),
            Stage::Leave => ("leaving".to_owned(), Some(1.0)),
            Stage::Cut => ("cutting the power".to_owned(), Some(1.0)),
            Stage::Done => ("done".to_owned(), Some(1.0)),
        };
        Progress { what, fraction }
    }
}

/// A stop that nobody asked for.
fn own_stop(snapshot: &Snapshot) -> Option<StopReason> {
    snapshot.stop.filter(|stop| stop.rule() != Rule::Requested)
}

/// Hands the frames of a procedure to the service channel. A frame that finds no room is lost like one on a bad bus:
/// the procedure asks again.
fn sending_through(host: &mut HostSide) -> impl FnMut(usize, Frame) {
    |bus, frame| {
        let _ = host.send_service(bus, frame);
    }
}
