//! A controller whose frames are written down, in virtual time.

use std::path::Path;

use takt::channels::LogSide;
use takt::config::{Axis, Config, ProgramMove, ProgramTarget};
use takt::sim::{Observation, SimulatedBus};
use takt::{Outcome, VirtualRun};
use takt_rt::{
    BusHealth, BusPort, Event, EventKind, Frame, Phase, ReceiveBatch, Received, Request, RequestId,
    StopReason,
};

/// A minute is more than any of these programs takes.
pub const CYCLES_AT_MOST: u64 = 60_000;

/// What a port may do to a frame of a drive before the controller sees it.
type Alter = Box<dyn FnMut(Frame) -> Frame>;

/// When the controller handed over what, and how many of its frames were waiting for the wire then.
pub type Sent = (u64, Frame, usize);

/// A simulated bus on which everything is written down.
pub struct Watched {
    pub bus: SimulatedBus,
    pub sent: Vec<Sent>,
    /// When what came from the drives.
    pub received: Vec<(u64, Frame)>,
    pub alter: Option<Alter>,
}

impl Watched {
    fn new(bus: SimulatedBus) -> Self {
        Self { bus, sent: vec![], received: vec![], alter: None }
    }

    /// When frames with this identifier were handed over, and their payload.
    pub fn sent_with(&self, id: u32) -> Vec<(u64, Vec<u8>)> {
        let frames = self.sent.iter().filter(|(_, frame, _)| frame.id().value() == id);
        frames.map(|(at_ns, frame, _)| (*at_ns, frame.payload().to_vec())).collect()
    }
}

impl BusPort for Watched {
    fn send(&mut self, now_ns: u64, frames: &[Frame]) -> usize {
        let waiting = self.bus.unconfirmed(now_ns);
        self.sent.extend(frames.iter().map(|frame| (now_ns, *frame, waiting)));
        self.bus.send(now_ns, frames)
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        self.bus.receive(now_ns, batch);
        for received in batch.iter_mut() {
            if let Some(alter) = &mut self.alter {
                *received = Received { frame: alter(received.frame), ..*received };
            }
            self.received.push((received.at_ns, received.frame));
        }
    }

    fn unconfirmed(&mut self, now_ns: u64) -> usize {
        self.bus.unconfirmed(now_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.bus.health()
    }
}

/// A controller with its log.
pub struct World {
    pub config: Config,
    pub run: VirtualRun<Watched>,
    log: LogSide,
    pub events: Vec<Event>,
}

pub fn text_of(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{name}: {error}"))
}

pub fn parse(text: &str) -> Config {
    Config::parse("test.toml", text).unwrap_or_else(|error| panic!("{:?}", miette::Report::new(error)))
}

pub fn load(name: &str) -> Config {
    parse(&text_of(name))
}

impl World {
    pub fn new(config: Config) -> Self {
        let buses = (0..config.buses.len()).map(|bus| takt::simulated_bus(&config, bus)).collect();
        Self::on(config, buses)
    }

    /// On these buses in place of those of the configuration.
    pub fn on(config: Config, buses: Vec<SimulatedBus>) -> Self {
        let ports = buses.into_iter().map(Watched::new).collect();
        let (run, log) = VirtualRun::new(&config, ports).unwrap();
        Self { config, run, log, events: vec![] }
    }

    /// A controller that holds where its axes are for an hour, to be commanded by the test.
    pub fn holding(config: Config) -> Self {
        let buses = (0..config.buses.len()).map(|bus| takt::simulated_bus(&config, bus)).collect();
        Self::holding_on(config, buses)
    }

    /// The same on these buses in place of those of the configuration.
    pub fn holding_on(mut config: Config, buses: Vec<SimulatedBus>) -> Self {
        let position = config.axes.iter().map(|axis| axis.simulated.initial_position).collect();
        config.program.repeat = 1;
        config.program.moves = vec![ProgramMove {
            group: 0,
            target: ProgramTarget::Position(position),
            velocity_scale: 1.0,
            acceleration_scale: 1.0,
            minimum_duration_s: 0.0,
            dwell_s: 3600.0,
        }];
        let mut world = Self::on(config, buses);
        world.run_until(|world| world.finished_motions() > 0);
        world.run_until(|world| world.phase() == Phase::Holding);
        world.run_for(50);
        world
    }

    pub fn step(&mut self) -> bool {
        let goes_on = self.run.step();
        while self.log.next_record(|_| ()).is_some() {}
        while let Some(event) = self.log.take_event() {
            self.events.push(event);
        }
        goes_on
    }

    pub fn run_for(&mut self, cycles: usize) {
        for _ in 0..cycles {
            assert!(self.step(), "the run has ended: {:?}", self.outcome());
        }
    }

    pub fn run_until(&mut self, is_there: impl Fn(&mut Self) -> bool) {
        for _ in 0..CYCLES_AT_MOST {
            if is_there(self) {
                return;
            }
            assert!(self.step(), "the run has ended: {:?}", self.outcome());
        }
        panic!("still {:?}", self.phase());
    }

    /// To the end of the run; `each` is called after every cycle.
    pub fn run_to_the_end(&mut self, mut each: impl FnMut(&mut Self)) -> Outcome {
        for _ in 0..CYCLES_AT_MOST {
            let goes_on = self.step();
            each(self);
            if !goes_on {
                break;
            }
        }
        self.outcome().expect("the run has not ended")
    }

    pub fn outcome(&self) -> Option<Outcome> {
        self.run.supervisor().outcome().cloned()
    }

    pub fn phase(&self) -> Phase {
        self.run.snapshot().groups[0].phase
    }

    pub fn request(&mut self, request: Request) -> RequestId {
        let id = self.run.host().request(request).unwrap();
        self.run_for(1);
        id
    }

    /// How many motions have reached their target.
    pub fn finished_motions(&self) -> usize {
        let is_finished = |event: &&Event| matches!(event.kind, EventKind::MotionFinished { .. });
        self.events.iter().filter(is_finished).count()
    }

    pub fn port(&mut self, bus: usize) -> &mut Watched {
        &mut self.run.ports()[bus]
    }

    /// The truth about an axis.
    pub fn observe(&mut self, axis: usize) -> Observation {
        let Axis { bus, node, .. } = self.config.axes[axis];
        self.port(bus).bus.observe(node).unwrap()
    }

    pub fn stops(&self) -> Vec<StopReason> {
        let stops = self.events.iter().filter_map(|event| match event.kind {
            EventKind::Stop(reason) => Some(reason),
            _ => None,
        });
        stops.collect()
    }
}
