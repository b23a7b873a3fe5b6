//! A bench with one simulated drive in virtual time, and everything that is seen of a procedure on it.

use std::cell::Cell;

use takt::commission::bus_session::{self, Seen};
use takt::commission::dictionary::{self, Choice};
use takt::commission::{
    Amount, Course, Event, Failed, Pace, ReadObject, Report, Request, Subject, procedure,
};
use takt::controller::VirtualClock;
use takt::sim::{Observation, SimulatedBus};
use takt_rt::{BusPort, Frame, Id, ReceiveBatch};

pub const MS: u64 = 1_000_000;
pub const SECOND: u64 = 1_000 * MS;
pub const NODE: u8 = 1;

pub struct Bench {
    pub subject: Subject,
    pub bus: SimulatedBus,
    pub clock: VirtualClock,
    pub sent: Vec<Frame>,
    pub steps: Vec<&'static str>,
    pub notes: Vec<String>,
    /// The highest speed of the joint that a reading has shown: rad/s.
    pub fastest: f64,
}

impl Bench {
    pub fn of(subject: Subject, bus: SimulatedBus) -> Self {
        let clock = VirtualClock::default();
        Self { subject, bus, clock, sent: vec![], steps: vec![], notes: vec![], fastest: 0.0 }
    }

    pub fn run(&mut self, request: Request) -> Result<Report, Failed> {
        self.run_interrupted(request, |_| 0)
    }

    /// `interruptions` tells how many requests to end there have been up to a step.
    pub fn run_interrupted(
        &mut self,
        request: Request,
        interruptions: impl Fn(&str) -> usize,
    ) -> Result<Report, Failed> {
        self.run_as(self.subject.clone(), request, interruptions)
    }

    pub fn run_as(
        &mut self,
        subject: Subject,
        request: Request,
        interruptions: impl Fn(&str) -> usize,
    ) -> Result<Report, Failed> {
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
        bus_session::run(procedure(subject, request), bus, clock, is_interrupted, |_, seen| match seen {
            Seen::Event(Event::Step(name)) => {
                step.set(name);
                steps.push(name);
            }
            Seen::Event(Event::Note(text)) => notes.push(text),
            Seen::Event(Event::Reading(reading)) => *fastest = fastest.max(reading.velocity.abs()),
            Seen::Sent(frame) => sent.push(frame),
            Seen::Received(_) => {}
        })
    }

    /// Runs a procedure for a time at most; `touch` may do something to the bus meanwhile.
    pub fn run_for(
        &mut self,
        request: Request,
        until_ns: u64,
        mut touch: impl FnMut(&mut SimulatedBus, u64),
    ) -> Option<Result<Report, Failed>> {
        let mut procedure = procedure(self.subject.clone(), request);
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

    /// Position of this frame among the frames that were sent.
    pub fn sent_at(&self, frame: Frame) -> usize {
        let found = self.sent.iter().position(|sent| *sent == frame);
        found.unwrap_or_else(|| panic!("{frame:?} was not sent: {:?}", self.sent))
    }
}

pub fn degrees(degrees: f64) -> Amount {
    Amount::Joint(degrees.to_radians())
}

pub fn move_to(course: Course) -> Request {
    Request::Move { course, pace: brisk(), keeps_enabled: false }
}

pub fn absolute(position: f64) -> Course {
    Course::Absolute { to: degrees(position), is_immediate: false }
}

pub fn brisk() -> Pace {
    Pace {
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

pub fn read(bench: &mut Bench, name: &str) -> i64 {
    let Ok(Choice::Known(entry)) = dictionary::find(bench.subject.family, name) else { panic!("{name}") };
    let object = ReadObject { address: entry.object.address, entry: Some(entry), data_type: None };
    let report = bench.run(Request::Read { objects: vec![object] }).unwrap();
    serde_json::to_value(&report).unwrap()["objects"][0]["raw"].as_i64().unwrap()
}
