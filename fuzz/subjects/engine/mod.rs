//! The engine, given any frames, requests, streams, callbacks, faults and delays, of one group or two.
//!
//! Drives of the simplest kind obey what they are commanded, unless the input has them do something else ([`drive`]). What
//! is looked at is what leaves on the wire, and what the engine says of itself ([`watch`]).

mod asking;
mod drive;
mod leading;
mod watch;

use std::collections::{BTreeSet, VecDeque};
use std::sync::OnceLock;

use takt::config::{Config, Control, DriveFamily};
use takt::controller::assemble;
use takt_rt::{
    AxisSnapshot, AxisTarget, BitSet, BusHealth, BusState, CallbackCycle, CallbackId, CallbackReturn,
    Command, CycleInput, CycleRecord, CycleTiming, Deadline, DriveState, Engine, Event, Frame, HostInterface,
    LookAhead, MAX_AXES, OperationMode, Phase, Received, Request, RequestEnvelope, RequestId, RequestTarget,
    SendBatch, Snapshot, StreamPoint, StreamSample, StreamWish,
};

use super::input::Input;
use drive::ObedientDrive;
use leading::Leading;
use watch::Watch;

/// Cycles that one input can last.
const CYCLES_AT_MOST: u64 = 4_000;

/// By the first byte of an input: most of the time in CSP, where a set-point on the wire is a position.
fn configuration(number: u8) -> &'static Config {
    static CONFIGURATIONS: OnceLock<[Config; 9]> = OnceLock::new();
    let configurations = CONFIGURATIONS.get_or_init(|| {
        [
            include_str!("../../../configs/arm6-erob.toml"),
            include_str!("../../../configs/arm6-erob-csv.toml"),
            include_str!("../../../configs/arm6-erob-cst.toml"),
            include_str!("../../../configs/mixed-arm.toml"),
            include_str!("../../../configs/gantry-yz-aim.toml"),
            include_str!("../../../configs/erob-modes/erob-pp.toml"),
            include_str!("../../../configs/erob-modes/erob-pt.toml"),
            include_str!("every-mode.toml"),
            include_str!("two-groups.toml"),
        ]
        .map(|text| Config::parse("example", text).expect("the example is sound"))
    });
    &configurations[match number % 16 {
        number @ 6..=12 => usize::from(number - 5),
        13 | 14 => 7,
        15 => 8,
        _ => 0,
    }]
}

/// What keeps the frames of a cycle from leaving.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Disturbed {
    /// Nothing.
    No,
    /// They are ready too late.
    Late,
    /// Every bus is behind.
    Blocked,
}

/// What a group has gone through.
#[derive(Default)]
pub struct Journey {
    pub phases: Vec<Phase>,
    /// The modes of axes that were enabled while the group moved, with the families of their drives.
    pub modes_in_motion: Vec<(OperationMode, DriveFamily)>,
    /// Requests that were taken up and those that were refused.
    pub taken: u64,
    pub refused: u64,
    /// Calls of the callback.
    pub calls: u64,
    /// The rules of all stops.
    pub stops: BTreeSet<&'static str>,
    /// True if one group was in motion while another one was not.
    pub are_apart: bool,
}

/// Whatever comes in: no panic, no set-point of an enabled axis beyond its limits or with a step beyond its limits, no axis
/// enabled that should not be, no motion with a latched fault, an end and a reason of every stop, an event for every change.
pub fn run(bytes: &[u8]) -> Journey {
    let mut input = Input::new(bytes);
    let mut machine = Machine::new(configuration(input.byte()));
    while !input.is_empty() && machine.slot < CYCLES_AT_MOST && !machine.engine.is_shutting_down() {
        machine.act(&mut input);
    }
    machine.journey
}

/// The other side of the host interface.
struct Hall {
    requests: VecDeque<(RequestTarget, Request)>,
    asked: u64,
    leading: Leading,
    /// What the stream wants in the next cycle, in place of its points.
    wish: Option<StreamWish>,
    points: Box<LookAhead<MAX_AXES, Vec<StreamPoint>>>,
    services: VecDeque<Frame>,
    events: Vec<Event>,
    is_retired: bool,
    /// True if set-points left with the last cycle, by its record.
    is_commanded: bool,
    snapshot: Snapshot,
}

impl Hall {
    fn new(config: &Config) -> Self {
        let points = vec![StreamPoint::default(); 32];
        Self {
            requests: VecDeque::new(),
            asked: 0,
            leading: Leading::default(),
            wish: None,
            points: Box::new(LookAhead::new(points, assemble::look_ahead(config, &config.axes_of_group(0)))),
            services: VecDeque::new(),
            events: vec![],
            is_retired: false,
            is_commanded: false,
            snapshot: Snapshot::default(),
        }
    }
}

impl HostInterface for Hall {
    fn request(&mut self) -> Option<RequestEnvelope> {
        let (target, request) = self.requests.pop_front()?;
        self.asked += 1;
        self.is_retired |= request == Request::InhibitEnable;
        Some(RequestEnvelope { id: RequestId(self.asked), target, request })
    }

    fn begin_stream(&mut self, _group: u8) {
        self.points.begin();
    }

    fn stream(&mut self, _group: u8, slot_start_ns: u64, sample: &mut StreamSample) {
        self.points.sample(slot_start_ns, sample);
        if let Some(wish) = self.wish.take() {
            sample.wish = wish;
        }
    }

    fn take_callback(&mut self, _group: u8, _callback: CallbackId) -> bool {
        true
    }

    fn callback(
        &mut self,
        _group: u8,
        _callback: CallbackId,
        _cycle: &CallbackCycle,
        _axes: &[AxisSnapshot; MAX_AXES],
        targets: &mut [Option<AxisTarget>; MAX_AXES],
    ) -> CallbackReturn {
        self.leading.call(targets)
    }

    fn service_frame(&mut self, _bus: usize) -> Option<Frame> {
        self.services.pop_front()
    }

    fn received(&mut self, _bus: usize, _frame: &Received) -> bool {
        true
    }

    fn record(&mut self, record: &CycleRecord) -> bool {
        assert!(record.axes().iter().all(|axis| axis.position_set.is_finite()), "{:?}", record.axes());
        self.is_commanded = record.is_commanded;
        true
    }

    fn event(&mut self, event: &Event) -> bool {
        self.events.push(*event);
        true
    }

    fn publish(&mut self, snapshot: &Snapshot) {
        self.snapshot = *snapshot;
    }
}

struct Machine {
    config: &'static Config,
    engine: Box<Engine>,
    hall: Hall,
    drives: Vec<ObedientDrive>,
    watch: Watch,
    /// The target on the wire of the last cycle, of each axis that the engine holds for enabled, and the cycles in which
    /// its set-point has gone on since then.
    targets: Vec<Option<(i32, u32)>>,
    slot: u64,
    journey: Journey,
    buses: Vec<BusHealth>,
    held_back: BitSet,
    /// For how many slots each bus has been behind, and from how many on frames may leave again to show whether it still is.
    trials: Vec<(u32, u32)>,
}

impl Machine {
    fn new(config: &'static Config) -> Self {
        Self {
            config,
            engine: assemble::engine(config).expect("the example is sound"),
            hall: Hall::new(config),
            drives: drive::drives(config),
            watch: Watch::new(config),
            targets: vec![None; config.axes.len()],
            slot: 0,
            journey: Journey { phases: vec![Phase::Passive], ..Journey::default() },
            buses: vec![BusHealth::default(); config.buses.len()],
            held_back: BitSet::default(),
            trials: vec![(0, 1); config.buses.len()],
        }
    }

    fn now_ns(&self) -> u64 {
        self.slot * self.config.cycle.period_ns
    }

    fn act(&mut self, input: &mut Input<'_>) {
        match input.byte() % 16 {
            0..3 => {
                for _ in 0..=input.byte() {
                    self.cycle(Disturbed::No);
                }
            }
            3 => self.disturb(input),
            4 | 5 => {
                let sweep = asking::Sweep::new(&self.engine, self.period_s(), input);
                for cycle in sweep.cycles() {
                    self.hall.wish = Some(sweep.wish(cycle));
                    self.cycle(Disturbed::No);
                }
            }
            6 => {
                self.slot += u64::from(input.byte());
                self.cycle(Disturbed::No);
            }
            7 => self.cycle(Disturbed::Late),
            8 => self.cycle(Disturbed::Blocked),
            9 => {
                let bus = usize::from(input.byte()) % (self.buses.len() + 1);
                let received = Received { frame: input.frame(), at_ns: self.now_ns() };
                self.engine.receive(bus, &received);
            }
            10 => {
                let request = asking::request(self.config, self.now_ns(), input);
                let target = self.target(input);
                self.hall.requests.push_back((target, request));
            }
            11 => {
                let point = asking::point(&self.engine, self.now_ns(), input);
                // One that is of no use is counted.
                let _ = self.hall.points.insert(&point, self.now_ns());
            }
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
                    1 => drive.state = DriveState::Fault,
                    2 => drive.state = DriveState::SwitchOnDisabled,
                    _ => drive.turn(input.word() as i32),
                }
            }
            14 => {
                let all = [Request::Sync(true), Request::Activate, Request::Enable];
                self.hall.requests.extend(all.map(|request| (RequestTarget::All, request)));
            }
            _ => {
                let to_rest = asking::possible_move(self.config, input);
                let target = self.target(input);
                self.hall.requests.push_back((target, Request::Move(to_rest)));
            }
        }
    }

    /// For whom a request is: for one of several groups, mostly.
    fn target(&self, input: &mut Input<'_>) -> RequestTarget {
        if self.config.groups.len() < 2 {
            return RequestTarget::All;
        }
        match input.byte() % 8 {
            0 => RequestTarget::All,
            1 => RequestTarget::Group(input.byte()),
            number => RequestTarget::Group(number % 2),
        }
    }

    /// What else can be wrong with buses and drives, and what a callback does.
    fn disturb(&mut self, input: &mut Input<'_>) {
        let kind = input.byte();
        if kind >= 192 {
            if let Some(request) = self.hall.leading.change(self.config, input) {
                let target = self.target(input);
                self.hall.requests.push_back((target, request));
            }
            return;
        }
        match kind % 4 {
            0 => {
                let mut full = BitSet::default();
                full.insert(self.slot as usize % self.buses.len());
                self.engine.not_taken(full);
            }
            1 => {
                let bus = usize::from(input.byte()) % self.buses.len();
                if !self.held_back.take(bus) {
                    self.held_back.insert(bus);
                }
            }
            2 => {
                let drive = usize::from(input.byte()) % self.drives.len();
                self.drives[drive].is_late = !self.drives[drive].is_late;
            }
            _ => self.serve(input.frame()),
        }
    }

    /// What each group is doing.
    fn phases(&self) -> Vec<Phase> {
        (0..).map_while(|group| self.engine.phase(group)).collect()
    }

    fn period_s(&self) -> f64 {
        self.config.cycle.period_ns as f64 * 1e-9
    }

    fn cycle(&mut self, disturbed: Disturbed) {
        self.slot += 1;
        let now_ns = self.now_ns();
        self.report();
        let before = self.phases();
        let mut held_back = self.held_back;
        if disturbed == Disturbed::Blocked {
            (0..self.buses.len()).for_each(|bus| held_back.insert(bus));
        }
        let asked = self.hall.asked;
        let input = CycleInput {
            suspended_ns: 0,
            slot: self.slot,
            slot_start_ns: now_ns,
            set_points_due_ns: now_ns,
            now_ns,
            buses: &self.buses,
            behind: held_back,
        };
        self.engine.compute(&input, &mut self.hall);
        let deadline = if disturbed == Disturbed::Late { Deadline::Missed } else { Deadline::Met };
        let mut sent = vec![SendBatch::new(); self.buses.len()];
        for (bus, batch) in sent.iter_mut().enumerate() {
            self.engine.encode(bus, deadline, &mut self.hall, batch);
        }
        // After its deadline, or behind a backlog, nothing leaves but what stops the drives: NMT and SDO requests.
        let may_stop = |frame: &Frame| matches!(frame.id().value() & 0x780, 0x000 | 0x600);
        for (bus, batch) in sent.iter().enumerate() {
            let is_trial = self.is_trial(bus, held_back.contains(bus), !batch.iter().all(may_stop));
            let is_held = held_back.contains(bus) && !is_trial || disturbed == Disturbed::Late;
            assert!(!is_held || batch.iter().all(may_stop));
        }
        let timing = CycleTiming { slot: self.slot, ..CycleTiming::default() };
        self.engine.finish(timing, now_ns, &self.buses, &mut self.hall);
        let has_commands = self.hall.is_commanded;
        assert!(!has_commands || deadline == Deadline::Met);
        self.obey(&sent, &before, has_commands);
        self.watch.has_driven = self.hall.leading.has_driven;
        self.watch.look(&self.engine, &self.hall.events, &self.hall.snapshot, has_commands);
        self.hall.events.clear();
        if self.hall.is_retired {
            self.watch.retire();
        }
        self.note(self.hall.asked - asked);
    }

    /// Returns `true` if frames may leave on a bus that is behind: it may only look so, and they show it. The next ones come after twice
    /// the time. What may leave at any time is no trial.
    fn is_trial(&mut self, bus: usize, is_behind: bool, has_held_frames: bool) -> bool {
        let has_cycle = self.slot.is_multiple_of(self.config.buses[bus].divider.into());
        let (slots, next) = &mut self.trials[bus];
        if has_cycle && !is_behind {
            (*slots, *next) = (0, 1);
            return false;
        }
        *slots += u32::from(is_behind || *slots > 0);
        let is_trial = *slots >= *next;
        if is_trial && has_held_frames {
            *next = 2 * *slots;
        }
        is_trial
    }

    fn note(&mut self, asked: u64) {
        let phases = self.phases();
        let journey = &mut self.journey;
        for phase in &phases {
            if journey.phases.last() != Some(phase) {
                journey.phases.push(*phase);
            }
        }
        journey.are_apart |= phases.windows(2).any(|pair| {
            let is_led = |phase: Phase| matches!(phase, Phase::Moving | Phase::Streaming);
            is_led(pair[0]) != is_led(pair[1])
        });
        journey.calls = self.hall.leading.calls;
        let stops = self.hall.snapshot.groups().iter().filter_map(|group| group.stop);
        journey.stops.extend(stops.map(|stop| stop.rule().key()));
        for axis in self.engine.axes() {
            let phase = phases[self.config.group_of_axis(axis.number().into())];
            let family = self.config.axes[usize::from(axis.number())].drive.clone();
            let mode = (axis.parameters().law.operation_mode(), family);
            let is_moved = matches!(phase, Phase::Moving | Phase::Streaming) && axis.is_enabled();
            if is_moved && !journey.modes_in_motion.contains(&mode) {
                journey.modes_in_motion.push(mode);
            }
        }
        journey.taken += asked;
        journey.refused = self.hall.snapshot.rejected;
    }

    /// The host wants to send a frame: any one but process data, which are the engine's alone.
    fn serve(&mut self, frame: Frame) {
        if !self.drives.iter().any(|drive| drive.is_commanded_by(frame.id())) {
            self.hall.services.push_back(frame);
        }
    }

    /// SYNC, and what the drives say to it.
    fn report(&mut self) {
        let (slot, now_ns) = (self.slot, self.now_ns());
        for (bus, parameters) in self.config.buses.iter().enumerate() {
            if !slot.is_multiple_of(parameters.divider.into()) {
                continue;
            }
            let has_sync = self.engine.sync(bus, slot, now_ns).is_some();
            let on_bus = |(axis, _): &(&takt::config::Axis, _)| axis.bus == bus;
            for (_, drive) in self.config.axes.iter().zip(&mut self.drives).filter(on_bus) {
                for frame in drive.tell(now_ns, has_sync) {
                    self.engine.receive(bus, &Received { frame, at_ns: now_ns });
                }
            }
        }
    }

    /// The drives take what was sent to them, and what was sent is looked at.
    fn obey(&mut self, sent: &[SendBatch], before: &[Phase], has_acted: bool) {
        let (phases, period_s) = (self.phases(), self.period_s());
        for index in 0..self.config.axes.len() {
            let group = self.config.group_of_axis(index);
            let (before, phase) = (before[group], phases[group]);
            let (axis, drive) = (&self.config.axes[index], &mut self.drives[index]);
            if let Some((_, cycles)) = self.targets[index].as_mut().filter(|_| has_acted) {
                *cycles += 1;
            }
            let mut is_commanded = false;
            for frame in &sent[axis.bus] {
                if !drive.is_commanded_by(frame.id()) {
                    continue;
                }
                is_commanded = true;
                let word = drive.take(frame);
                let enables = word.is_some_and(|word| Command::decode(word) == Command::EnableOperation);
                let may_enable = !matches!(phase, Phase::Passive | Phase::Disabled | Phase::Disabling);
                assert!(may_enable || !enables, "{before:?} to {phase:?}");
            }
            drive.pass(period_s);
            let Some(target) = drive.position_target().filter(|_| is_commanded) else { continue };
            let shown = self.engine.axes()[index].is_enabled().then_some((target, 0));
            if let (Some((last, cycles)), Some((now, _))) = (self.targets[index], shown) {
                let per_unit = self.engine.axes()[index].parameters().scale.resolution();
                // A drive gets the way of one cycle of its bus in that cycle, however many slots of it were used.
                let slots = cycles.max(self.config.buses[axis.bus].divider);
                let most = axis.limits.velocity * period_s * per_unit * f64::from(slots);
                let step = f64::from(now) - f64::from(last);
                assert!(step.abs() <= most + 2.0, "{}: {step} counts, at most {most}; {before:?}", axis.name);
                let is_at_rest = phase == Phase::Holding && before == Phase::Holding;
                let is_simple = axis.control == Control::Position && self.buses.len() == 1;
                assert!(!(is_at_rest && is_simple) || step == 0.0, "{step} at rest");
            }
            self.targets[index] = shown;
        }
    }
}
