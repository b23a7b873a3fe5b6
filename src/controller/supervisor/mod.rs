//! The life cycle of a run, without input and output: bring-up, enabling, motion program, stop, disabling, shut-down.
//!
//! ```text
//! Configure → Start → Activate → Enable → Run → Settle → Disable → ShutDown → Done
//!     └────────── any failure, stop or interrupt ─────────┴──────────↗
//! ```
//!
//! [`Supervisor::poll`] is called repeatedly with the host's side of the channels. It never blocks. So it runs beside the
//! real-time thread, and also between the cycles of a run in virtual time.

mod again;
mod bring_up_again;
mod ending;
mod phases;
mod start_up;

use std::collections::VecDeque;

use takt_rt::{
    AxisSnapshot, BusState, Frame, Request, RequestEnvelope, RequestId, RequestTarget, Snapshot, StopCategory,
};
use tracing::{info, warn};

use super::arrival::Arrival;
use super::assemble::enabled_from_ns;
use super::lines::Lines;
use super::off_cycle::OffCycleDrives;
use super::outcome::{Interrupt, Outcome, Progress};
use super::program::{ProgramProgress, ProgramRunner, ProgramStep};
use crate::channels::{HostSide, RequestNumbers};
use crate::config::Config;
use crate::family;
use crate::family::bring_up::{AxisFacts, BringUp, Shutdown};
use crate::telemetry::BusReport;
use again::BringUpAgain;
use phases::fault_stop;

pub use phases::unreleased_stop;

/// A stage must be completed within this time, where every drive can be enabled at once. The engine has its own, shorter time-outs.
const STAGE_TIMEOUT_NS: u64 = 8_000_000_000;
/// From one question of a client to the next: one frame of a bus in a cycle is for all services, and those of the controller go on.
const QUESTION_SPACING_NS: u64 = 2_000_000;

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
    ShutDown,
    /// The power is being removed, without a shut-down of the drives.
    RemovePower,
    Done,
}

impl Stage {
    const fn name(self) -> &'static str {
        match self {
            Self::Configure => "configure",
            Self::Start => "start",
            Self::Activate => "activate",
            Self::ResetFaults => "reset faults",
            Self::Enable => "enable",
            Self::Run => "run",
            Self::Settle { .. } => "settle",
            Self::Disable => "disable",
            Self::ShutDown => "shut down",
            Self::RemovePower => "remove power",
            Self::Done => "done",
        }
    }
}

/// What becomes of the drives when they have been brought up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AfterBringUp {
    /// They are enabled.
    Enable,
    /// They stay disabled until a client enables them.
    StayDisabled,
}

/// Takes a controller through its life cycle.
pub struct Supervisor {
    axes: usize,
    stage: Stage,
    stage_since_ns: Option<u64>,
    stage_timeout_ns: u64,
    bring_up: BringUp,
    /// That of groups that have gone back to passive, while it is under way.
    again: Option<BringUpAgain>,
    off_cycle: OffCycleDrives,
    /// True if the drive of an axis has PDOs: such a one tells its position at bring-up, and confirms its shut-down by SDO.
    has_pdos: Vec<bool>,
    shutdown: Shutdown,
    /// For how long the drive of each axis is told to stop at least.
    least_shut_down_ns: Vec<u64>,
    /// The program of each group.
    programs: Vec<ProgramRunner>,
    arrival: Arrival,
    facts: Vec<AxisFacts>,
    outgoing: VecDeque<RequestEnvelope>,
    /// Room for the state that is looked at; `None` before the first look, and during each.
    seen: Option<Box<Snapshot>>,
    numbers: RequestNumbers,
    /// When the next question of a client may be sent.
    next_question_ns: u64,
    interrupt: Option<Interrupt>,
    outcome: Option<Outcome>,
    /// See [`Supervisor::unreached`].
    unreached: Vec<usize>,
    /// See [`Supervisor::drive_errors`].
    drive_errors: Vec<(usize, u16)>,
    deadline_ns: Option<u64>,
    duration_ns: Option<u64>,
    /// True if a client commands the group, in place of the program.
    is_serving: bool,
    after_bring_up: AfterBringUp,
    /// The buses, and their states as `tracing` knows them.
    buses: Vec<(String, BusState)>,
}

impl Supervisor {
    /// A run of the configuration's program; with a duration, the program is repeated until that is over.
    pub fn new(config: &Config, duration_ns: Option<u64>) -> Self {
        Self {
            axes: config.axes.len(),
            stage: Stage::Configure,
            stage_since_ns: None,
            stage_timeout_ns: STAGE_TIMEOUT_NS + enabled_from_ns(config),
            bring_up: BringUp::new(config),
            again: None,
            off_cycle: OffCycleDrives::new(config),
            has_pdos: config.axes.iter().map(|axis| family::has_pdos(axis, config)).collect(),
            shutdown: Shutdown::new(config),
            least_shut_down_ns: config
                .axes
                .iter()
                .map(|axis| family::least_shut_down_ns(axis, config))
                .collect(),
            programs: (0..config.groups.len().max(1))
                .map(|group| {
                    let axes = config.axes_of_group(group);
                    ProgramRunner::new(&config.program, group, axes, duration_ns.is_some())
                })
                .collect(),
            arrival: Arrival::of(config),
            facts: Vec::new(),
            outgoing: VecDeque::new(),
            seen: None,
            numbers: RequestNumbers::default(),
            next_question_ns: 0,
            interrupt: None,
            outcome: None,
            unreached: Vec::new(),
            drive_errors: Vec::new(),
            deadline_ns: None,
            duration_ns,
            is_serving: false,
            after_bring_up: AfterBringUp::Enable,
            buses: config.buses.iter().map(|bus| (bus.name.clone(), BusState::default())).collect(),
        }
    }

    /// The same run on these serial lines. Without them, the drives of lines are simulated.
    #[must_use]
    pub fn with_lines(mut self, lines: Lines) -> Self {
        self.off_cycle.set_lines(lines);
        self
    }

    /// The serial lines.
    pub fn lines(&self) -> &Lines {
        self.off_cycle.lines()
    }

    /// Ends the serial lines: their drives are disabled, if they are not yet.
    pub(super) fn close_lines(&mut self) {
        self.off_cycle.set_lines(Lines::default());
    }

    /// A run without a program: the group is brought up, is enabled or not, and then executes the requests of clients until it is
    /// interrupted. A stop does not end this run, since the client decides what follows it.
    pub fn serving(config: &Config, after_bring_up: AfterBringUp) -> Self {
        Self { is_serving: true, after_bring_up, ..Self::new(config, None) }
    }

    /// Asks the run to end. An immediate interrupt replaces a controlled one.
    pub fn interrupt(&mut self, interrupt: Interrupt) {
        self.interrupt = self.interrupt.max(Some(interrupt));
    }

    /// How the run ended; `None` while it goes on.
    pub fn outcome(&self) -> Option<&Outcome> {
        if self.stage == Stage::Done { self.outcome.as_ref() } else { None }
    }

    /// The axes whose drives did not confirm in the end that they have no torque: their newest report is old, or shows torque, or they
    /// did not carry out the shut-down. It is unknown whether they have stopped. Of a bring-up that failed they are those that it did
    /// not reach.
    pub fn unreached(&self) -> &[usize] {
        &self.unreached
    }

    /// The axes whose drives showed an error during the shut-down, with its code. A drive without an error code in its
    /// process data tells it there alone.
    pub fn drive_errors(&self) -> &[(usize, u16)] {
        &self.drive_errors
    }

    /// The data that the drives have reported about themselves; empty before they are configured.
    pub fn facts(&self) -> &[AxisFacts] {
        &self.facts
    }

    /// The target of the last move of each axis (rad or m); `None` before the first one, and after one that has no target
    /// position.
    pub fn targets(&self) -> Vec<Option<f64>> {
        let mut targets = vec![None; self.axes];
        for (axis, target) in self.programs.iter().flat_map(ProgramRunner::targets) {
            if let Some(place) = targets.get_mut(axis) {
                *place = Some(target);
            }
        }
        targets
    }

    /// Takes received frames and the newest state, and sends the frames and requests that are due.
    pub fn poll(&mut self, now_ns: u64, host: &mut HostSide) {
        while let Some((bus, received)) = host.take_service() {
            self.bring_up.receive(bus, &received.frame);
            if let Some(again) = &mut self.again {
                again.receive(bus, &received.frame);
            }
            self.off_cycle.receive(now_ns, bus, &received.frame);
            self.shutdown.receive(bus, &received.frame);
        }
        let mut snapshot = self.seen.take().unwrap_or_default();
        host.read_snapshot(&mut snapshot);
        self.tell_of_buses(&snapshot);
        self.numbers = host.numbers();
        self.handle_interrupt(now_ns);
        let since_ns = *self.stage_since_ns.get_or_insert(now_ns);
        self.step(now_ns, now_ns.saturating_sub(since_ns), &snapshot, host);
        if !matches!(self.stage, Stage::Configure | Stage::Start | Stage::Done) {
            let is_brought_up = |axis| self.again.as_ref().is_some_and(|again| again.speaks_to(axis));
            self.off_cycle.poll(now_ns, &snapshot, host, is_brought_up);
        }
        if self.stage == Stage::Run {
            self.bring_up_again(now_ns, &snapshot, host);
            self.pass_question_on(now_ns, host);
        }
        while let Some(request) = self.outgoing.front() {
            if host.submit(*request).is_err() {
                break;
            }
            self.outgoing.pop_front();
        }
        self.seen = Some(snapshot);
    }

    /// Sends a question of a client, if the last one was long enough ago.
    fn pass_question_on(&mut self, now_ns: u64, host: &mut HostSide) {
        if now_ns < self.next_question_ns {
            return;
        }
        if let Some((bus, question)) = host.questions().take() {
            // One that finds no room is lost, as on a disturbed bus.
            let _ = host.send_service(bus, question);
            self.next_question_ns = now_ns + QUESTION_SPACING_NS;
        }
    }

    fn step(&mut self, now_ns: u64, elapsed_ns: u64, snapshot: &Snapshot, host: &mut HostSide) {
        match self.stage {
            Stage::Configure => self.configure(now_ns, host),
            Stage::Start => self.start(now_ns, host),
            Stage::Activate => self.wait_for_reports(now_ns, elapsed_ns, snapshot),
            Stage::ResetFaults => self.reset_faults(now_ns, elapsed_ns, snapshot),
            Stage::Enable => self.enable(now_ns, elapsed_ns, snapshot),
            Stage::Run => self.run(now_ns, snapshot),
            Stage::Settle { until_ns } => self.settle(now_ns, elapsed_ns, until_ns, snapshot),
            Stage::Disable => self.disable(now_ns, elapsed_ns, snapshot),
            Stage::ShutDown => self.shut_down(now_ns, elapsed_ns, snapshot, host),
            Stage::RemovePower => self.remove_power(now_ns, elapsed_ns, snapshot),
            Stage::Done => {}
        }
    }

    fn run(&mut self, now_ns: u64, snapshot: &Snapshot) {
        if self.is_serving {
            return;
        }
        if let Some(stop) = fault_stop(snapshot) {
            return self.end(now_ns, Outcome::Stopped(stop));
        }
        if self.deadline_ns.is_some_and(|deadline_ns| now_ns >= deadline_ns) {
            self.request(Request::Stop(StopCategory::Two));
            return self.end(now_ns, Outcome::Finished);
        }
        let (mut ending, mut are_finished) = (None, true);
        for program in &mut self.programs {
            let step = program.poll(now_ns, snapshot, &self.numbers);
            are_finished &= step == ProgramStep::Finished;
            match step {
                ProgramStep::Wait | ProgramStep::Finished => {}
                ProgramStep::Begin(requests) => self.outgoing.extend(requests),
                ProgramStep::Refused { number, refusal } => {
                    ending = ending.or(Some(Outcome::MoveRefused { number, refusal }));
                }
                ProgramStep::Replaced { number } => {
                    ending = ending.or(Some(Outcome::MoveReplaced { number }))
                }
            }
        }
        if let Some(outcome) = ending.or(are_finished.then_some(Outcome::Finished)) {
            self.end(now_ns, outcome);
        }
    }

    fn request(&mut self, request: Request) {
        self.request_of(RequestTarget::All, request);
    }

    fn request_of(&mut self, target: RequestTarget, request: Request) -> RequestId {
        let id = self.numbers.next();
        self.outgoing.push_back(RequestEnvelope { id, target, request });
        id
    }

    /// Tells `tracing` of buses whose state has changed.
    fn tell_of_buses(&mut self, snapshot: &Snapshot) {
        for ((bus, known), health) in self.buses.iter_mut().zip(snapshot.buses()) {
            if *known != health.state {
                *known = health.state;
                let (bus, state) = (bus.as_str(), BusReport::state_words(health.state));
                match health.state {
                    BusState::ErrorActive => info!(target: "takt::bus", bus, state, "{bus}: {state}"),
                    _ => warn!(target: "takt::bus", bus, state, "{bus}: {state}"),
                }
            }
        }
    }

    fn enter(&mut self, stage: Stage, now_ns: u64) {
        // A stage that goes on is entered again.
        if std::mem::discriminant(&self.stage) != std::mem::discriminant(&stage) {
            info!(target: "takt::run", stage = stage.name(), "{}", stage.name());
        }
        self.stage = stage;
        self.stage_since_ns = Some(now_ns);
    }

    fn axes_of<'a>(&self, snapshot: &'a Snapshot) -> &'a [AxisSnapshot] {
        snapshot.axes.get(..self.axes).unwrap_or(&snapshot.axes)
    }

    fn faulted(&self, snapshot: &Snapshot) -> Option<(usize, u16)> {
        let axes = self.axes_of(snapshot);
        axes.iter().position(|axis| axis.drive_state.is_faulted()).map(|axis| (axis, axes[axis].error_code))
    }

    /// How far the programs of all groups are together.
    fn programs_progress(&self) -> ProgramProgress {
        let nothing = ProgramProgress { begun: 0, all: Some(0), done: 0.0 };
        self.programs.iter().map(ProgramRunner::progress).fold(nothing, |sum, own| ProgramProgress {
            begun: sum.begun + own.begun,
            all: sum.all.zip(own.all).map(|(sum, own)| sum + own),
            done: sum.done + own.done,
        })
    }

    /// The present step of the run.
    pub fn progress(&self) -> Progress {
        let (what, fraction) = match self.stage {
            Stage::Configure | Stage::Start => {
                let progress = self.bring_up.progress();
                (format!("bring-up: {}", progress.step), Some(progress.fraction))
            }
            Stage::Activate | Stage::ResetFaults | Stage::Enable => ("enabling".to_owned(), None),
            Stage::Run => {
                let ProgramProgress { begun, all, done } = self.programs_progress();
                let of = all.map_or(String::new(), |all| format!(" of {all}"));
                (format!("move {begun}{of}"), all.map(|all| done / all as f64))
            }
            Stage::Settle { .. } => ("settling".to_owned(), Some(1.0)),
            Stage::Disable => ("stopping".to_owned(), Some(1.0)),
            Stage::ShutDown => ("shutting down".to_owned(), Some(1.0)),
            Stage::RemovePower => ("removing the power".to_owned(), Some(1.0)),
            Stage::Done => ("done".to_owned(), Some(1.0)),
        };
        let is_ending = matches!(
            self.stage,
            Stage::Settle { .. } | Stage::Disable | Stage::ShutDown | Stage::RemovePower | Stage::Done
        );
        Progress { what, fraction, is_ending }
    }
}

/// Passes the frames of a procedure to the service channel. If the channel is full, the frame is lost as on a disturbed bus,
/// and the procedure repeats it.
fn service_sender(host: &mut HostSide) -> impl FnMut(usize, Frame) {
    |bus, frame| {
        let _ = host.send_service(bus, frame);
    }
}
