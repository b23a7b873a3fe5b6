//! A test bench: one simulated drive in virtual time, and a record of a procedure on it.

use std::cell::Cell;

use takt::VirtualClock;
use takt::family::commission::{
    CommandValue, MotionProfile, MoveKind, ProcedureError, Report, TargetDrive, Task, ValueText,
};
use takt::procedure::ProcedureEvent;
use takt::sim::{Observation, SimulatedBus};
use takt_rt::{BusPort, Frame, Id, ReceiveBatch};
use takt_tools::commission::bus_session::{self, SessionEvent};

pub const MS: u64 = 1_000_000;
pub const SECOND: u64 = 1_000 * MS;
pub const NODE: u8 = 1;

pub struct Bench {
    pub target: TargetDrive,
    pub bus: SimulatedBus,
    pub clock: VirtualClock,
    pub sent: Vec<Frame>,
    pub steps: Vec<&'static str>,
    pub notes: Vec<String>,
    /// The highest joint speed in a reading: rad/s.
    pub fastest: f64,
}

impl Bench {
    pub fn of(target: TargetDrive, bus: SimulatedBus) -> Self {
        let clock = VirtualClock::default();
        Self { target, bus, clock, sent: vec![], steps: vec![], notes: vec![], fastest: 0.0 }
    }

    pub fn run(&mut self, request: Task) -> Result<Report, ProcedureError> {
        self.run_interrupted(request, |_| 0)
    }

    /// `interruptions` returns the number of interruptions until a step.
    pub fn run_interrupted(
        &mut self,
        request: Task,
        interruptions: impl Fn(&str) -> usize,
    ) -> Result<Report, ProcedureError> {
        self.run_as(self.target.clone(), request, interruptions)
    }

    pub fn run_as(
        &mut self,
        target: TargetDrive,
        request: Task,
        interruptions: impl Fn(&str) -> usize,
    ) -> Result<Report, ProcedureError> {
        let Self { bus, clock, sent, steps, notes, fastest, .. } = self;
        sent.clear();
        steps.clear();
        notes.clear();
        let step = Cell::new("");
        let mut asked = 0;
        let is_interrupted = || {
            let is_more = interruptions(step.get()) > asked;
            asked += usize::from(is_more);
            is_more
        };
        let task = match target.family().commission(target.clone(), request) {
            Ok(task) => task,
            Err(failure) => return Err(ProcedureError { step: "command line", failure }),
        };
        bus_session::run(task.procedure, bus, clock, is_interrupted, |_, seen| match seen {
            SessionEvent::Procedure(ProcedureEvent::Step(name)) => {
                step.set(name);
                steps.push(name);
            }
            SessionEvent::Procedure(ProcedureEvent::Note(text)) => notes.push(text),
            SessionEvent::Procedure(ProcedureEvent::Reading(reading)) => {
                *fastest = fastest.max(reading.velocity.abs())
            }
            SessionEvent::Sent(frame) => sent.push(frame),
            SessionEvent::Procedure(ProcedureEvent::Progress { .. }) | SessionEvent::Received(_) => {}
        })
    }

    /// Runs a procedure for a limited time; `touch` may change the bus meanwhile.
    pub fn run_for(
        &mut self,
        request: Task,
        until_ns: u64,
        mut touch: impl FnMut(&mut SimulatedBus, u64),
    ) -> Option<Result<Report, ProcedureError>> {
        let task = self.target.family().commission(self.target.clone(), request).unwrap();
        let mut procedure = task.procedure;
        for now_ns in (0..until_ns).step_by((MS / 2) as usize) {
            touch(&mut self.bus, now_ns);
            let mut batch = ReceiveBatch::new();
            self.bus.receive(now_ns, &mut batch);
            batch.iter().for_each(|received| procedure.receive(&received.frame));
            let mut frames = vec![];
            procedure.poll(now_ns, &mut |frame| frames.push(frame));
            self.bus.send(now_ns, &frames);
            if let Some(outcome) = procedure.outcome() {
                return Some(outcome.clone());
            }
        }
        None
    }

    pub fn observe(&mut self) -> Observation {
        self.bus.observe(NODE).unwrap()
    }

    /// The index of this frame among the sent frames.
    pub fn sent_at(&self, frame: Frame) -> usize {
        let found = self.sent.iter().position(|sent| *sent == frame);
        found.unwrap_or_else(|| panic!("{frame:?} was not sent: {:?}", self.sent))
    }
}

pub fn degrees(degrees: f64) -> CommandValue {
    CommandValue::Joint(degrees.to_radians())
}

pub fn move_to(kind: MoveKind) -> Task {
    Task::Move { kind, profile: brisk(), keeps_enabled: false }
}

pub fn absolute(position: f64) -> MoveKind {
    MoveKind::Absolute { to: degrees(position), is_immediate: false }
}

pub fn brisk() -> MotionProfile {
    MotionProfile {
        velocity: Some(degrees(60.0)),
        acceleration: Some(degrees(200.0)),
        deceleration: Some(degrees(200.0)),
    }
}

pub fn write_u16(index: u16, value: u16) -> Frame {
    let ([low, high], [a, b]) = (index.to_le_bytes(), value.to_le_bytes());
    Frame::of(Id::canopen(0x600, NODE), [0x2B, low, high, 0, a, b, 0, 0])
}

pub fn number(report: &Report, key: &str) -> f64 {
    report.get(key).and_then(serde_json::Value::as_f64).unwrap_or_else(|| panic!("{key} of {report:?}"))
}

pub fn write(name: &str, value: i64) -> Task {
    let value = ValueText { text: value.to_string(), is_raw: true };
    Task::Write { name: name.to_owned(), value, data_type: None }
}

pub fn read(bench: &mut Bench, name: &str) -> i64 {
    let report = bench.run(Task::Read { names: vec![name.to_owned()], data_type: None }).unwrap();
    serde_json::to_value(&report).unwrap()["objects"][0]["raw"].as_i64().unwrap()
}
