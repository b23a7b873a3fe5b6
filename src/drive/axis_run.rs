//! Carries out a list of steps on one drive. No input and output: frames and time are handed in, frames are handed
//! out; every wait is bounded.

mod answers;

use takt_rt::{Frame, Id, Nanoseconds};

use super::facts::AxisFacts;
use super::failure::Cause;
use super::step::{Action, Source, Step, When};
use crate::canopen::dcf::Download;
use crate::canopen::emcy::Emergency;
use crate::canopen::nmt::{ErrorControl, NmtState, NmtTarget};
use crate::canopen::objects::DEVICE_TYPE;
use crate::canopen::pdo_inquiry::PdoInquiry;
use crate::canopen::sdo::{Client, Timing, Transfer};
use crate::config::Axis;

/// How long to wait between two readings of an object that is waited for.
const AWAIT_PAUSE_NS: Nanoseconds = 5_000_000;
/// How often a drive may restart in the middle of a procedure that begins anew then.
const MAX_RESTARTS: u8 = 3;

/// Another protocol that a drive may speak in place of CANopen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OtherProtocol {
    pub name: &'static str,
    /// A harmless question.
    pub question: Frame,
    /// The identifier of the answer.
    pub answer: Id,
}

/// What to do when a step fails or the drive restarts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Policy {
    /// A failed step ends the procedure; a restarted drive begins at this step again.
    RestartFrom(usize),
    /// A failed step or a restart ends the procedure.
    Strict,
    /// A failed step is passed over, unless the drive has fallen silent; the first failure is told in the end.
    BestEffort,
}

/// A list of steps on one drive, and how far they have come.
#[derive(Debug)]
pub(super) struct AxisRun {
    node: u8,
    policy: Policy,
    other_protocol: Option<OtherProtocol>,
    steps: Vec<Step>,
    current: usize,
    phase: Phase,
    client: Client,
    timing: Timing,
    axis: Axis,
    /// While the PDOs are being asked for.
    inquiry: Option<PdoInquiry>,
    reported: Option<NmtState>,
    facts: AxisFacts,
    failure: Option<(usize, Cause)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The step has not begun.
    Begin,
    /// The client is busy with the step's own transfer; waiting steps remember when they began.
    Transfer { began_ns: Nanoseconds },
    /// The client is reading back what was written.
    ReadBack { written: i64 },
    /// The client is reading back bytes that were written.
    Verify,
    /// A number was not yet as wanted.
    Pause { began_ns: Nanoseconds, until_ns: Nanoseconds },
    /// A state was commanded.
    AwaitState { began_ns: Nanoseconds, commanded_ns: Nanoseconds },
    /// The node has not reported its state: does it speak otherwise?
    Inquire { waited_ns: Nanoseconds, has_answered: bool },
    /// All steps are done or have been given up.
    Over,
}

/// How a step has gone on.
type Progress = Result<(), Cause>;

impl AxisRun {
    pub fn new(
        axis: &Axis,
        timing: Timing,
        steps: Vec<Step>,
        policy: Policy,
        other_protocol: Option<OtherProtocol>,
    ) -> Self {
        Self {
            node: axis.node,
            policy,
            other_protocol,
            steps,
            current: 0,
            phase: Phase::Begin,
            client: Client::new(axis.node, timing),
            timing,
            axis: axis.clone(),
            inquiry: None,
            reported: None,
            facts: AxisFacts { dialect: axis.drive.dialect(), ..AxisFacts::default() },
            failure: None,
        }
    }

    /// Goes on with other steps, keeping what is known of the drive.
    pub fn continue_with(&mut self, steps: Vec<Step>, policy: Policy) {
        self.steps = steps;
        self.policy = policy;
        self.current = 0;
        self.phase = Phase::Begin;
    }

    pub fn is_over(&self) -> bool {
        self.phase == Phase::Over
    }

    pub fn facts(&self) -> &AxisFacts {
        &self.facts
    }

    /// The step that failed first, and why.
    pub fn failure(&self) -> Option<(&Step, Cause)> {
        let (step, cause) = self.failure?;
        Some((self.steps.get(step)?, cause))
    }

    /// Steps done, and steps in all.
    pub fn progress(&self) -> (usize, usize) {
        (self.current.min(self.steps.len()), self.steps.len())
    }

    /// What is being done.
    pub fn step_name(&self) -> Option<&'static str> {
        self.steps.get(self.current).map(|step| step.name)
    }

    /// Sends what is due and lets time pass.
    pub fn poll(&mut self, now_ns: Nanoseconds, send: &mut impl FnMut(Frame)) {
        while !self.is_over() {
            while let Some(frame) = self.client.poll(now_ns) {
                if let Some(Action::Reach { command }) = self.action() {
                    send(command.frame(NmtTarget::Node(self.node)));
                }
                send(frame);
            }
            while let Some(frame) = self.inquiry.as_mut().and_then(|inquiry| inquiry.poll(now_ns)) {
                send(frame);
            }
            let before = (self.current, self.phase, self.client.is_busy());
            let progress = match self.client.take_outcome() {
                Some(outcome) => self.transferred(now_ns, outcome),
                None => self.advance(now_ns, send),
            };
            let progress = progress.and_then(|()| self.inquired());
            if let Err(cause) = progress {
                self.fail(cause);
            }
            if before == (self.current, self.phase, self.client.is_busy()) {
                break;
            }
        }
    }

    /// Takes a frame that was received on the drive's bus.
    pub fn receive(&mut self, frame: &Frame) {
        if self.is_over() {
            return;
        }
        self.client.receive(frame);
        if let Some(inquiry) = &mut self.inquiry {
            inquiry.receive(frame);
        }
        if let Some(message) = ErrorControl::decode(frame).filter(|message| message.node == self.node) {
            self.hear(message.state);
        }
        if let Some(emergency) = Emergency::decode(frame).filter(|emergency| emergency.node == self.node) {
            self.facts.keep_emergency(emergency);
        }
        if let (Phase::Inquire { has_answered, .. }, Some(other)) = (&mut self.phase, self.other_protocol) {
            *has_answered |= frame.id() == other.answer;
        }
    }

    fn hear(&mut self, state: NmtState) {
        self.reported = Some(state);
        let awaited = match (self.phase, self.action()) {
            (Phase::AwaitState { .. } | Phase::Inquire { .. }, Some(Action::Nmt { awaited, .. })) => awaited,
            _ => None,
        };
        if awaited == Some(state) {
            self.client.reset();
            self.next_step();
        } else if state == NmtState::BootUp && self.current > 0 {
            self.restart();
        }
    }

    fn restart(&mut self) {
        self.facts.restarts = self.facts.restarts.saturating_add(1);
        let times = self.facts.restarts;
        match self.policy {
            Policy::RestartFrom(step) if times <= MAX_RESTARTS => {
                self.client.reset();
                self.inquiry = None;
                self.current = step;
                self.phase = Phase::Begin;
            }
            _ => self.fail(Cause::Restarted { times }),
        }
    }

    fn action(&self) -> Option<Action> {
        self.steps.get(self.current).map(|step| step.action.clone())
    }

    fn next_step(&mut self) {
        self.current += 1;
        self.phase = if self.current < self.steps.len() { Phase::Begin } else { Phase::Over };
    }

    fn fail(&mut self, cause: Cause) {
        let is_lost = cause.is_silence() || matches!(cause, Cause::Restarted { .. });
        self.failure.get_or_insert((self.current, cause));
        if self.policy == Policy::BestEffort && !is_lost {
            self.next_step();
        } else {
            self.phase = Phase::Over;
        }
    }

    /// What is due by time alone.
    fn advance(&mut self, now_ns: Nanoseconds, send: &mut impl FnMut(Frame)) -> Progress {
        let Some(Step { when, action, .. }) = self.steps.get(self.current).cloned() else {
            self.phase = Phase::Over;
            return Ok(());
        };
        match (self.phase, action) {
            (Phase::Begin, _) if when == When::HasTorque && !self.facts.state().has_torque() => {
                self.next_step();
                Ok(())
            }
            (Phase::Begin, Action::Nmt { command, awaited, .. }) => {
                send(command.frame(NmtTarget::Node(self.node)));
                match awaited {
                    Some(_) => self.phase = Phase::AwaitState { began_ns: now_ns, commanded_ns: now_ns },
                    None => self.next_step(),
                }
                Ok(())
            }
            (Phase::Begin, action) => self.begin_transfer(now_ns, action),
            (Phase::Pause { began_ns, until_ns }, action) if now_ns >= until_ns => {
                self.begin_transfer(began_ns, action)
            }
            (
                Phase::AwaitState { began_ns, commanded_ns },
                Action::Nmt { command, within_ns, repeat_ns, .. },
            ) => {
                if now_ns.saturating_sub(began_ns) >= within_ns {
                    return self.inquire(now_ns.saturating_sub(began_ns), send);
                }
                if now_ns.saturating_sub(commanded_ns) >= repeat_ns {
                    send(command.frame(NmtTarget::Node(self.node)));
                    self.phase = Phase::AwaitState { began_ns, commanded_ns: now_ns };
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// The node has not reported the awaited state: finds out whether anything there speaks at all.
    fn inquire(&mut self, waited_ns: Nanoseconds, send: &mut impl FnMut(Frame)) -> Progress {
        if let Some(other) = self.other_protocol {
            send(other.question);
        }
        self.phase = Phase::Inquire { waited_ns, has_answered: false };
        self.start(Transfer::Upload { object: DEVICE_TYPE.address });
        Ok(())
    }

    fn start(&mut self, transfer: Transfer) {
        // The client is free: its outcome was taken before the phase could change.
        let started = self.client.start(transfer);
        debug_assert!(started.is_ok());
    }

    fn begin_transfer(&mut self, began_ns: Nanoseconds, action: Action) -> Progress {
        let transfer = match action {
            Action::ReadProcessData => {
                self.inquiry = Some(PdoInquiry::of_first_four(self.node, self.timing));
                self.phase = Phase::Transfer { began_ns };
                return Ok(());
            }
            Action::Write { object, value, .. } => {
                let value = self.value_of(value);
                let data = object.data_type.encode(value).ok_or(Cause::DoesNotFit { object, value })?;
                Transfer::Download { object: object.address, data }
            }
            Action::Read { object, .. } | Action::Await { object, .. } => {
                Transfer::Upload { object: object.address }
            }
            Action::Reach { .. } => Transfer::Upload { object: DEVICE_TYPE.address },
            Action::ReadText { object, .. } => Transfer::Upload { object },
            Action::WriteBytes(Download { object, data }) => Transfer::Download { object, data },
            Action::Nmt { .. } => return Ok(()),
        };
        self.start(transfer);
        self.phase = Phase::Transfer { began_ns };
        Ok(())
    }

    fn value_of(&self, source: Source) -> i64 {
        match source {
            Source::Value(value) => value,
            Source::ActualPosition => self.facts.position_counts.into(),
        }
    }
}
