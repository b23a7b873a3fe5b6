//! Runs a list of steps on one drive, without input and output: the caller passes time and frames in, and sends the
//! frames that come out. Every wait has a timeout.

mod answers;

use takt_rt::{Frame, Nanoseconds};

use super::facts::AxisFacts;
use super::failure::FailureCause;
use super::step::{Action, Condition, ProcedureStep, ValueSource};
use crate::canopen::dcf::Download;
use crate::canopen::emcy::Emergency;
use crate::canopen::nmt::{ErrorControl, NmtState, NmtTarget};
use crate::canopen::objects::DEVICE_TYPE;
use crate::canopen::pdo_reader::PdoReader;
use crate::canopen::sdo::{SdoClient, SdoTiming, Transfer};
use crate::config::Axis;
use crate::family::OtherProtocol;

/// Pause between two reads of a polled object.
const AWAIT_PAUSE_NS: Nanoseconds = 5_000_000;
/// Number of restarts after which a procedure that can begin again gives up.
const MAX_RESTARTS: u8 = 3;

/// What happens when a step fails or the drive restarts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Policy {
    /// A failed step ends the procedure. After a restart the procedure continues at this step.
    RestartFrom(usize),
    /// A failed step or a restart ends the procedure.
    Strict,
    /// A failed step is skipped, unless the drive no longer answers. The first failure is reported at the end.
    BestEffort,
}

/// A list of steps on one drive, and its state.
#[derive(Debug)]
pub(super) struct AxisRun {
    node: u8,
    policy: Policy,
    other_protocol: Option<OtherProtocol>,
    steps: Vec<ProcedureStep>,
    current: usize,
    phase: StepPhase,
    client: SdoClient,
    timing: SdoTiming,
    axis: Axis,
    /// Set while the PDO configuration is read.
    pdo_reader: Option<PdoReader>,
    reported: Option<NmtState>,
    facts: AxisFacts,
    failure: Option<(usize, FailureCause)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum StepPhase {
    /// The step has not begun.
    Begin,
    /// The step's own transfer is under way. `began_ns` is the beginning of a polling step.
    Transfer { began_ns: Nanoseconds },
    /// The client reads back a written number.
    ReadBack { written: i64 },
    /// The client reads back written bytes.
    Verify,
    /// Pause before the next read of a polled object.
    Pause { began_ns: Nanoseconds, until_ns: Nanoseconds },
    /// An NMT state was commanded and is awaited.
    AwaitState { began_ns: Nanoseconds, commanded_ns: Nanoseconds },
    /// The awaited NMT state was not reported. A probe finds out whether anything answers under this node ID.
    Probe { waited_ns: Nanoseconds, has_answered: bool },
    /// All steps are done or have failed.
    Over,
}

/// The result of a step so far.
type StepResult = Result<(), FailureCause>;

impl AxisRun {
    pub fn new(
        axis: &Axis,
        timing: SdoTiming,
        steps: Vec<ProcedureStep>,
        policy: Policy,
        other_protocol: Option<OtherProtocol>,
    ) -> Self {
        Self {
            node: axis.node,
            policy,
            other_protocol,
            steps,
            current: 0,
            phase: StepPhase::Begin,
            client: SdoClient::new(axis.node, timing),
            timing,
            axis: axis.clone(),
            pdo_reader: None,
            reported: None,
            facts: AxisFacts { codec: axis.drive.codec, ..AxisFacts::default() },
            failure: None,
        }
    }

    /// Continues with other steps; the facts of the drive stay.
    pub fn continue_with(&mut self, steps: Vec<ProcedureStep>, policy: Policy) {
        self.steps = steps;
        self.policy = policy;
        self.current = 0;
        self.phase = StepPhase::Begin;
    }

    pub fn is_over(&self) -> bool {
        self.phase == StepPhase::Over
    }

    pub fn facts(&self) -> &AxisFacts {
        &self.facts
    }

    /// The first failed step, and the cause.
    pub fn failure(&self) -> Option<(&ProcedureStep, FailureCause)> {
        let (step, cause) = self.failure?;
        Some((self.steps.get(step)?, cause))
    }

    /// Number of finished steps, and of all steps.
    pub fn progress(&self) -> (usize, usize) {
        (self.current.min(self.steps.len()), self.steps.len())
    }

    /// The name of the current step.
    pub fn step_name(&self) -> Option<&'static str> {
        self.steps.get(self.current).map(|step| step.name)
    }

    /// Advances to `now_ns` and sends the frames that are due.
    pub fn poll(&mut self, now_ns: Nanoseconds, send: &mut impl FnMut(Frame)) {
        while !self.is_over() {
            while let Some(frame) = self.client.poll(now_ns) {
                if let Some(Action::WakeUp { command }) = self.action() {
                    send(command.frame(NmtTarget::Node(self.node)));
                }
                send(frame);
            }
            while let Some(frame) = self.pdo_reader.as_mut().and_then(|pdo_reader| pdo_reader.poll(now_ns)) {
                send(frame);
            }
            let before = (self.current, self.phase, self.client.is_busy());
            let progress = match self.client.take_outcome() {
                Some(outcome) => self.transferred(now_ns, outcome),
                None => self.advance(now_ns, send),
            };
            let progress = progress.and_then(|()| self.take_pdo_configuration());
            if let Err(cause) = progress {
                self.fail(cause);
            }
            if before == (self.current, self.phase, self.client.is_busy()) {
                break;
            }
        }
    }

    /// Passes a frame received on the drive's bus.
    pub fn receive(&mut self, frame: &Frame) {
        if self.is_over() {
            return;
        }
        self.client.receive(frame);
        if let Some(pdo_reader) = &mut self.pdo_reader {
            pdo_reader.receive(frame);
        }
        if let Some(message) = ErrorControl::decode(frame).filter(|message| message.node == self.node) {
            self.take_nmt_state(message.state);
        }
        if let Some(emergency) = Emergency::decode(frame).filter(|emergency| emergency.node == self.node) {
            self.facts.keep_emergency(emergency);
        }
        if let (StepPhase::Probe { has_answered, .. }, Some(other)) = (&mut self.phase, self.other_protocol) {
            *has_answered |= frame.id() == other.answer;
        }
    }

    fn take_nmt_state(&mut self, state: NmtState) {
        self.reported = Some(state);
        let awaited = match (self.phase, self.action()) {
            (StepPhase::AwaitState { .. } | StepPhase::Probe { .. }, Some(Action::Nmt { awaited, .. })) => {
                awaited
            }
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
                self.pdo_reader = None;
                self.current = step;
                self.phase = StepPhase::Begin;
            }
            _ => self.fail(FailureCause::Restarted { times }),
        }
    }

    fn action(&self) -> Option<Action> {
        self.steps.get(self.current).map(|step| step.action.clone())
    }

    fn next_step(&mut self) {
        self.current += 1;
        self.phase = if self.current < self.steps.len() { StepPhase::Begin } else { StepPhase::Over };
    }

    fn fail(&mut self, cause: FailureCause) {
        let is_lost = cause.is_silence() || matches!(cause, FailureCause::Restarted { .. });
        self.failure.get_or_insert((self.current, cause));
        if self.policy == Policy::BestEffort && !is_lost {
            self.next_step();
        } else {
            self.phase = StepPhase::Over;
        }
    }

    /// Advances the current step by time.
    fn advance(&mut self, now_ns: Nanoseconds, send: &mut impl FnMut(Frame)) -> StepResult {
        let Some(ProcedureStep { condition, action, .. }) = self.steps.get(self.current).cloned() else {
            self.phase = StepPhase::Over;
            return Ok(());
        };
        match (self.phase, action) {
            (StepPhase::Begin, _)
                if condition == Condition::HasTorque && !self.facts.state().has_torque() =>
            {
                self.next_step();
                Ok(())
            }
            (StepPhase::Begin, Action::Nmt { command, awaited, .. }) => {
                send(command.frame(NmtTarget::Node(self.node)));
                match awaited {
                    Some(_) => self.phase = StepPhase::AwaitState { began_ns: now_ns, commanded_ns: now_ns },
                    None => self.next_step(),
                }
                Ok(())
            }
            (StepPhase::Begin, action) => self.begin_transfer(now_ns, action),
            (StepPhase::Pause { began_ns, until_ns }, action) if now_ns >= until_ns => {
                self.begin_transfer(began_ns, action)
            }
            (
                StepPhase::AwaitState { began_ns, commanded_ns },
                Action::Nmt { command, within_ns, repeat_ns, .. },
            ) => {
                if now_ns.saturating_sub(began_ns) >= within_ns {
                    return self.probe(now_ns.saturating_sub(began_ns), send);
                }
                if now_ns.saturating_sub(commanded_ns) >= repeat_ns {
                    send(command.frame(NmtTarget::Node(self.node)));
                    self.phase = StepPhase::AwaitState { began_ns, commanded_ns: now_ns };
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Probes the node by SDO and by the other protocol, because it has not reported the awaited state.
    fn probe(&mut self, waited_ns: Nanoseconds, send: &mut impl FnMut(Frame)) -> StepResult {
        if let Some(other) = self.other_protocol {
            send(other.request);
        }
        self.phase = StepPhase::Probe { waited_ns, has_answered: false };
        self.start(Transfer::Upload { object: DEVICE_TYPE.address });
        Ok(())
    }

    fn start(&mut self, transfer: Transfer) {
        // The client is free, because its outcome was taken before the phase changed.
        let started = self.client.start(transfer);
        debug_assert!(started.is_ok());
    }

    fn begin_transfer(&mut self, began_ns: Nanoseconds, action: Action) -> StepResult {
        let transfer = match action {
            Action::ReadProcessData => {
                self.pdo_reader = Some(PdoReader::of_first_four(self.node, self.timing));
                self.phase = StepPhase::Transfer { began_ns };
                return Ok(());
            }
            Action::Write { object, value, .. } => {
                let value = self.value_of(value);
                let data =
                    object.data_type.encode(value).ok_or(FailureCause::DoesNotFit { object, value })?;
                Transfer::Download { object: object.address, data }
            }
            Action::Read { object, .. } | Action::Await { object, .. } => {
                Transfer::Upload { object: object.address }
            }
            Action::WakeUp { .. } => Transfer::Upload { object: DEVICE_TYPE.address },
            Action::ReadText { object, .. } => Transfer::Upload { object },
            Action::WriteBytes(Download { object, data }) => Transfer::Download { object, data },
            Action::Nmt { .. } => return Ok(()),
        };
        self.start(transfer);
        self.phase = StepPhase::Transfer { began_ns };
        Ok(())
    }

    fn value_of(&self, source: ValueSource) -> i64 {
        match source {
            ValueSource::Value(value) => value,
            ValueSource::ActualPosition => self.facts.position_counts.into(),
        }
    }
}
