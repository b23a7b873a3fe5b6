//! The engine, given any frames, requests, streams, faults and delays.
//!
//! Six drives of the simplest kind obey what they are commanded, unless the input has them do something else. What is
//! looked at is what leaves on the wire.

use std::collections::VecDeque;
use std::sync::OnceLock;

use takt::config::{Config, Control};
use takt::controller::assemble;
use takt::drive::{PdoPlan, ProcessData};
use takt_rt::cia402::{Command, State};
use takt_rt::door::{Asked, Door, Move, Request, RequestId, Snapshot, StreamCommand};
use takt_rt::engine::{BusSet, Engine, SendBatch, Transmission};
use takt_rt::frame::{Frame, Id};
use takt_rt::plan;
use takt_rt::port::{BusHealth, BusState, Received};
use takt_rt::record::{CycleRecord, Event, MAX_AXES, Timing};
use takt_rt::stop::{Phase, StopCategory};

use super::input::Input;

/// Cycles that one input can last.
const CYCLES_AT_MOST: u64 = 4_000;

/// The smallest bound of a streamed step: rad.
const STREAM_STEP: f64 = 2e-8;

fn configurations() -> &'static [Config; 3] {
    static CONFIGURATIONS: OnceLock<[Config; 3]> = OnceLock::new();
    CONFIGURATIONS.get_or_init(|| {
        [
            include_str!("../../configs/arm6-erob.toml"),
            include_str!("../../configs/arm6-erob-csv.toml"),
            include_str!("../../configs/arm6-erob-cst.toml"),
        ]
        .map(|text| Config::parse("arm6-erob", text).expect("the example is sound"))
    })
}

/// Whatever comes in: no panic, no step of an enabled axis beyond its velocity limit, no axis enabled that should not be,
/// and a reason for every stop. Returns the phases that the group went through.
pub fn run(bytes: &[u8]) -> Vec<Phase> {
    let mut input = Input::new(bytes);
    // Most of the time in CSP, where a set-point on the wire is a position.
    let number = match input.byte() % 8 {
        6 => 1,
        7 => 2,
        _ => 0,
    };
    let mut machine = Machine::new(&configurations()[number]);
    while !input.is_empty() && machine.slot < CYCLES_AT_MOST && !machine.engine.is_leaving() {
        machine.act(&mut input);
    }
    machine.phases
}

/// The other side of the door.
#[derive(Default)]
struct Hall {
    requests: VecDeque<Request>,
    stream: Option<StreamCommand>,
    snapshot: Snapshot,
}

impl Door for Hall {
    fn request(&mut self) -> Option<Asked> {
        self.requests.pop_front().map(|request| Asked { id: RequestId(1), request })
    }

    fn stream(&mut self) -> Option<StreamCommand> {
        self.stream.take()
    }

    fn service_frame(&mut self, _bus: usize) -> Option<Frame> {
        None
    }

    fn received(&mut self, _bus: usize, _frame: &Received) -> bool {
        true
    }

    fn record(&mut self, record: &CycleRecord) -> bool {
        assert!(record.axes().iter().all(|axis| axis.position_set.is_finite()), "{:?}", record.axes());
        true
    }

    fn event(&mut self, _event: &Event) -> bool {
        true
    }

    fn publish(&mut self, snapshot: &Snapshot) {
        self.snapshot = *snapshot;
    }
}

/// A drive that obeys at once.
#[derive(Clone, Copy)]
struct ObedientDrive {
    state: State,
    counts: i32,
    is_silent: bool,
}

struct Machine {
    config: &'static Config,
    engine: Engine,
    hall: Hall,
    drives: Vec<ObedientDrive>,
    /// What each of them reports.
    feedback: Vec<Vec<PdoPlan>>,
    /// The target on the wire of the last cycle, of each axis that the engine holds for enabled.
    targets: Vec<Option<i32>>,
    slot: u64,
    phases: Vec<Phase>,
    buses: Vec<BusHealth>,
}

impl Machine {
    fn new(config: &'static Config) -> Self {
        let drive = ObedientDrive { state: State::SwitchOnDisabled, counts: 0, is_silent: false };
        Self {
            config,
            engine: assemble::engine(config).expect("the example is sound"),
            hall: Hall::default(),
            drives: vec![drive; config.axes.len()],
            feedback: config.axes.iter().map(|axis| ProcessData::of(axis).feedback).collect(),
            targets: vec![None; config.axes.len()],
            slot: 0,
            phases: vec![Phase::Passive],
            buses: vec![BusHealth::default(); config.buses.len()],
        }
    }

    fn now_ns(&self) -> u64 {
        self.slot * self.config.cycle.period_ns
    }

    fn act(&mut self, input: &mut Input<'_>) {
        match input.byte() % 16 {
            0..6 => {
                for _ in 0..=input.byte() {
                    self.cycle(Transmission::Free);
                }
            }
            6 => {
                self.slot += u64::from(input.byte());
                self.cycle(Transmission::Free);
            }
            7 => self.cycle(Transmission::TooLate),
            8 => self.cycle(Transmission::Blocked),
            9 => {
                let bus = usize::from(input.byte()) % (self.buses.len() + 1);
                let received = Received { frame: input.frame(), at_ns: self.now_ns() };
                self.engine.receive(bus, &received, &mut self.hall);
            }
            10 => self.request(input),
            11 => self.hall.stream = Some(self.stream(input)),
            12 => {
                let states =
                    [BusState::ErrorActive, BusState::ErrorPassive, BusState::BusOff, BusState::Down];
                let bus = usize::from(input.byte()) % self.buses.len();
                self.buses[bus].state = states[usize::from(input.byte()) % states.len()];
            }
            13 => {
                let drive = usize::from(input.byte()) % self.drives.len();
                let drive = &mut self.drives[drive];
                match input.byte() % 4 {
                    0 => drive.is_silent = !drive.is_silent,
                    1 => drive.state = State::Fault,
                    2 => drive.state = State::SwitchOnDisabled,
                    _ => drive.counts = drive.counts.wrapping_add(input.word() as i32),
                }
            }
            14 => self.hall.requests.extend([Request::Sync(true), Request::Activate, Request::Enable]),
            _ => {
                let to_rest = self.movement(input, true);
                self.hall.requests.push_back(Request::Move(to_rest));
            }
        }
    }

    fn request(&mut self, input: &mut Input<'_>) {
        let categories = [StopCategory::Zero, StopCategory::One, StopCategory::Two];
        let request = match input.byte() % 12 {
            0 => Request::Sync(input.byte() & 1 == 1),
            1 => Request::RatedTorque { axis: input.byte(), torque: input.number() },
            2 => Request::Activate,
            3 | 4 => Request::Enable,
            5 => Request::Move(self.movement(input, false)),
            6 => Request::Stream,
            7 => Request::Stop(categories[usize::from(input.byte()) % 3]),
            8 => Request::Disable,
            9 | 10 => Request::ResetFaults,
            _ => Request::Leave,
        };
        self.hall.requests.push_back(request);
    }

    /// A move to anywhere, or one that is possible.
    fn movement(&self, input: &mut Input<'_>, is_possible: bool) -> Move {
        let mut asked = Move {
            id: input.word(),
            target: [0.0; MAX_AXES],
            target_velocity: [0.0; MAX_AXES],
            velocity_scale: 1.0,
            acceleration_scale: 1.0,
            minimum_duration_s: 0.0,
        };
        for (axis, target) in self.config.axes.iter().zip(&mut asked.target) {
            let share = f64::from(input.byte()) / 255.0;
            let range = axis.limits.position_max - axis.limits.position_min;
            *target = if is_possible { axis.limits.position_min + share * range } else { input.number() };
        }
        if !is_possible {
            asked.target_velocity[usize::from(input.byte()) % self.config.axes.len()] = input.number();
            asked.velocity_scale = input.number();
            asked.acceleration_scale = input.number();
            asked.minimum_duration_s = input.number();
        }
        asked
    }

    /// A stream near the present set-points, or anywhere.
    fn stream(&self, input: &mut Input<'_>) -> StreamCommand {
        let is_near = input.byte() > 32;
        let valid_until_ns = self.now_ns() + 1_000_000 * u64::from(input.byte());
        // From steps that the jerk limits allow from rest to ones that nothing allows.
        let largest_step = STREAM_STEP * f64::from(1u32 << (input.byte() % 20));
        let mut set_points = [plan::State::default(); MAX_AXES];
        for (axis, point) in self.engine.axes().iter().zip(&mut set_points) {
            *point = if is_near {
                let step = f64::from(input.byte() as i8) / 128.0 * largest_step;
                plan::State { position: axis.set_point().position + step, ..plan::State::default() }
            } else {
                plan::State {
                    position: input.number(),
                    velocity: input.number(),
                    acceleration: input.number(),
                }
            };
        }
        StreamCommand { valid_until_ns, set_points }
    }

    fn cycle(&mut self, transmission: Transmission) {
        self.slot += 1;
        let now_ns = self.now_ns();
        self.report();
        let before = self.engine.phase();
        let mut held_back = BusSet::default();
        if transmission == Transmission::Blocked {
            (0..self.buses.len()).for_each(|bus| held_back.insert(bus));
        }
        self.engine.hold_back(held_back);
        let has_commands = self.engine.compute(self.slot, now_ns, &self.buses, transmission, &mut self.hall);
        assert!(!has_commands || transmission != Transmission::TooLate);
        let mut sent = vec![SendBatch::new(); self.buses.len()];
        for (bus, batch) in sent.iter_mut().enumerate() {
            if has_commands {
                self.engine.set_points(bus, self.slot, batch);
            }
        }
        assert!(transmission == Transmission::Free || sent.iter().all(|batch| batch.is_empty()));
        self.obey(&sent, before);
        for (bus, batch) in sent.iter_mut().enumerate() {
            self.engine.services(bus, &mut self.hall, batch);
        }
        let timing = Timing { slot: self.slot, ..Timing::default() };
        self.engine.finish(timing, now_ns, &self.buses, &mut self.hall);
        if self.phases.last() != Some(&self.engine.phase()) {
            self.phases.push(self.engine.phase());
        }
        if self.engine.phase() == Phase::Stopping {
            assert!(self.hall.snapshot.stop.is_some(), "a stop without a reason");
        }
    }

    /// Every drive that speaks says its state and position.
    fn report(&mut self) {
        for ((axis, drive), feedback) in self.config.axes.iter().zip(&self.drives).zip(&self.feedback) {
            if drive.is_silent {
                continue;
            }
            for pdo in feedback {
                let values = pdo.objects.iter().map(|object| match object.index {
                    0x6041 => u64::from(drive.state.statusword_bits()),
                    0x6064 => u64::from(drive.counts as u32),
                    _ => 0,
                });
                let frame = packed(pdo.id, pdo.objects.iter().map(|object| object.bits).zip(values));
                let received = Received { frame, at_ns: self.now_ns() };
                self.engine.receive(axis.bus, &received, &mut self.hall);
            }
        }
    }

    /// The drives take what was sent to them, and what was sent is looked at.
    fn obey(&mut self, sent: &[SendBatch], before: Phase) {
        for index in 0..self.config.axes.len() {
            let axis = &self.config.axes[index];
            let id = Id::canopen(0x200, axis.node);
            let Some(frame) = sent[axis.bus].iter().find(|frame| frame.id() == id) else { continue };
            let word = frame.first_word();
            let command = Command::decode(word as u16);
            let phase = self.engine.phase();
            let may_enable = !matches!(phase, Phase::Passive | Phase::Disabled | Phase::Disabling);
            assert!(may_enable || command != Command::EnableOperation, "{before:?} to {phase:?}");
            let target = (word >> 16) as u32 as i32;
            let drive = &mut self.drives[index];
            drive.state = drive.state.after(command, true);
            if axis.control != Control::Position {
                continue;
            }
            if drive.state == State::OperationEnabled {
                drive.counts = target;
            }
            let shown = self.engine.axes()[index].is_enabled().then_some(target);
            if let (Some(last), Some(now)) = (self.targets[index], shown) {
                let per_unit = axis.counts_per_turn * axis.gear_ratio / std::f64::consts::TAU;
                let most = axis.limits.velocity * self.config.cycle.period_ns as f64 * 1e-9 * per_unit;
                let step = f64::from(now) - f64::from(last);
                assert!(step.abs() <= most + 2.0, "{}: {step} counts, at most {most}; {before:?}", axis.name);
                assert!(phase != Phase::Holding || before != Phase::Holding || step == 0.0, "{step} at rest");
            }
            self.targets[index] = shown;
        }
    }
}

fn packed(id: Id, fields: impl Iterator<Item = (u8, u64)>) -> Frame {
    let (word, bits) = fields
        .fold((0u64, 0u32), |(word, shift), (bits, value)| (word | value << shift, shift + u32::from(bits)));
    Frame::data(id, &word.to_le_bytes()[..bits as usize / 8]).expect("a PDO has at most eight bytes")
}
