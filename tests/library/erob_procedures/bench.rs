//! A module on its bus or on its line, and what went over it.

use std::fmt::Debug;

use takt::family::commission::{Failure, TargetDrive};
use takt::family::erob::module::CommandedModule;
use takt::family::erob::motion::{Motion, Profile};
use takt::family::erob::procedure::{self, Ended, MotionFailure, Run};
use takt::family::{self, Client, Procedure, ProcedureEvent, ProcedureSession};
use takt::procedure::ProcedureError;
use takt::sim::commanded_module::ModuleParameters;
use takt::sim::{Defect, DriveFault, Observation};
use takt_rt::DriveState;

pub const MS: u64 = 1_000_000;
pub const SECOND: u64 = 1_000 * MS;
pub const COUNTS_PER_TURN: f64 = 524_288.0;
pub const PROFILE: Profile = Profile { velocity: 30_000, acceleration: 90_000, deceleration: 90_000 };

/// The module without its protocol. It can be enabled 8 s after power-on.
pub fn module() -> ModuleParameters {
    ModuleParameters { ready_ns: 8 * SECOND, ..crate::erob_module::module() }
}

/// A bus or a line with a module.
pub trait Wire: 'static {
    const FAMILY: &'static str;
    /// The module as a procedure sees it.
    type Drive: CommandedModule<Client = Self::Client, Error = Self::Error> + 'static;
    type Client: Client;
    type Error: Clone + Debug + Into<Failure>;

    fn new(module: ModuleParameters) -> Self;
    fn drive(&mut self) -> Self::Drive;
    fn send(&mut self, now_ns: u64, messages: &[<Self::Client as Client>::Message]);
    fn receive(&mut self, now_ns: u64) -> Vec<<Self::Client as Client>::Message>;
    fn observe(&mut self, now_ns: u64) -> Observation;
    fn inject_fault(&mut self, fault: DriveFault);
    fn inject_defect(&mut self, defect: Defect, is_present: bool);
    fn power_cycle(&mut self, now_ns: u64);
    /// The address and the value of a write or a command; `None` for a read.
    fn written(message: &<Self::Client as Client>::Message) -> Option<(u16, Option<i64>)>;
}

pub type Outcome<T, E> = Result<T, ProcedureError<E>>;
pub type MotionOutcome<W> = Outcome<Ended, MotionFailure<<W as Wire>::Error>>;

/// What the axis of a module is: its encoder, without limits.
pub fn target<W: Wire>() -> TargetDrive {
    let family = family::all().into_iter().find(|family| family.word() == W::FAMILY).unwrap();
    TargetDrive::unconfigured(1, family.unconfigured().unwrap()).unwrap()
}

/// A module, and what went over its wire.
pub struct Bench<W: Wire> {
    pub wire: W,
    pub now_ns: u64,
    pub sent: Vec<<W::Client as Client>::Message>,
    pub steps: Vec<&'static str>,
    pub notes: Vec<String>,
    /// rad/s
    pub fastest: f64,
}

impl<W: Wire> Bench<W> {
    /// A module that is switched on now.
    pub fn of(module: ModuleParameters) -> Self {
        Self { wire: W::new(module), now_ns: 0, sent: vec![], steps: vec![], notes: vec![], fastest: 0.0 }
    }

    /// A module that has been switched on for long enough.
    pub fn ready() -> Self {
        Self { now_ns: 9 * SECOND, ..Self::of(module()) }
    }

    pub fn observe(&mut self) -> Observation {
        self.wire.observe(self.now_ns)
    }

    /// Runs a procedure to its end. `touch` sees the wire and its time at every millisecond since its beginning, and says whether to
    /// interrupt it.
    pub fn run<T: Clone, E: Clone, F>(
        &mut self,
        work: impl FnOnce(W::Drive) -> F,
        mut touch: impl FnMut(&mut W, u64, u64) -> bool,
    ) -> Outcome<T, E>
    where
        F: Future<Output = Result<T, E>> + 'static,
    {
        let drive = self.wire.drive();
        let session: ProcedureSession<W::Client> = drive.session().clone();
        let mut procedure = Procedure::new(session, work(drive));
        let began_ns = self.now_ns;
        self.sent.clear();
        loop {
            self.wire.receive(self.now_ns).iter().for_each(|message| procedure.receive(message));
            let mut messages = vec![];
            procedure.poll(self.now_ns, &mut |message| messages.push(message));
            self.wire.send(self.now_ns, &messages);
            self.sent.extend(messages);
            while let Some(event) = procedure.take_event() {
                match event {
                    ProcedureEvent::Step(name) => self.steps.push(name),
                    ProcedureEvent::Note(text) => self.notes.push(text),
                    ProcedureEvent::Progress { .. } => {}
                    ProcedureEvent::Reading(reading) => {
                        self.fastest = self.fastest.max(reading.velocity.abs());
                    }
                }
            }
            if let Some(outcome) = procedure.outcome() {
                return outcome.clone();
            }
            let passed_ns = self.now_ns - began_ns;
            assert!(passed_ns < 2 * 3_600 * SECOND, "it does not end: {:?}", self.steps);
            if passed_ns.is_multiple_of(MS) && touch(&mut self.wire, self.now_ns, passed_ns / MS) {
                procedure.interrupt();
            }
            self.now_ns += MS / 4;
        }
    }

    /// As [`Bench::run`], to its own end.
    pub fn run_alone<T: Clone, E: Clone, F>(&mut self, work: impl FnOnce(W::Drive) -> F) -> Outcome<T, E>
    where
        F: Future<Output = Result<T, E>> + 'static,
    {
        self.run(work, |_, _, _| false)
    }

    /// A motion on an axis, while `touch` looks on. Without an end of its own it lasts until it is interrupted.
    pub fn carry_out_on(
        &mut self,
        target: TargetDrive,
        motion: Motion,
        touch: impl FnMut(&mut W, u64, u64) -> bool,
    ) -> MotionOutcome<W> {
        let work = async move |drive: W::Drive| {
            let run = Run { motion, duration_ns: None, keeps_enabled: false, target: &target };
            procedure::carry_out(&drive, run).await
        };
        self.run(work, touch)
    }

    pub fn carry_out_with(
        &mut self,
        motion: Motion,
        touch: impl FnMut(&mut W, u64, u64) -> bool,
    ) -> MotionOutcome<W> {
        self.carry_out_on(target::<W>(), motion, touch)
    }

    pub fn carry_out(&mut self, motion: Motion) -> MotionOutcome<W> {
        self.carry_out_with(motion, |_, _, _| false)
    }

    pub fn carry_out_until(&mut self, motion: Motion, end_ms: u64) -> MotionOutcome<W> {
        self.carry_out_with(motion, |_, _, ms| ms == end_ms)
    }

    /// What was written, in its order: the address, and the value unless it is a command without one.
    pub fn written(&self) -> Vec<(u16, Option<i64>)> {
        self.sent.iter().filter_map(W::written).collect()
    }

    /// Where a write stands among those that were sent.
    pub fn place_of(&self, address: u16, value: i64) -> usize {
        let written = self.written();
        let place = written.iter().position(|write| *write == (address, Some(value)));
        place.unwrap_or_else(|| panic!("{address:04X} = {value} is not in {written:X?}"))
    }

    pub fn assert_at_rest_and_disabled(&mut self) {
        let truth = self.observe();
        assert!(truth.state != DriveState::OperationEnabled && truth.is_braked, "{truth:?}");
        self.now_ns += SECOND;
        assert_eq!(self.observe().velocity, 0.0);
    }
}
