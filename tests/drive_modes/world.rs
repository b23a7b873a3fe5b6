//! A controller whose frames are written down, in virtual time.

use std::f64::consts::TAU;
use std::path::Path;

use takt::config::{Axis, Config, ProgramMove, ProgramTarget, Travel};
use takt::internals::RunInside;
use takt::internals::channels::LogSide;
use takt::sim::{Observation, SimulatedBus};
use takt::{Outcome, VirtualRun};
use takt_rt::{
    BusHealth, BusPort, Event, EventKind, Frame, Id, MotionState, Phase, ProfileMove, ProfileTarget,
    ReceiveBatch, Received, Request, RequestId, StopReason,
};

pub const MILLISECOND_NS: u64 = 1_000_000;
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
    last_motion: RequestId,
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

/// One YZ-AIM on a ball screw in this mode, on a bus at half the rate of the controller, and one step of its program.
pub fn one_yz_aim(mode: &str, step: &str) -> String {
    format!(
        r#"
name = "one"
[[bus]]
name = "can"
period = "2 ms"
[[axis]]
name = "x"
bus = "can"
node = 1
drive = "yz-aim"
mode = "{mode}"
travel = "linear"
lead = "10 mm"
[axis.limits]
position = ["0 mm", "800 mm"]
velocity = "0.15 m/s"
acceleration = "1 m/s^2"
torque = "300 N"
[axis.joint]
inertia = "4 kg"
viscous_friction = "20 N s/m"
coulomb_friction = "5 N"
[[program.move]]
{step}
"#
    )
}

impl World {
    pub fn new(config: Config) -> Self {
        let buses = (0..config.buses.len()).map(|bus| SimulatedBus::new(&config, bus)).collect();
        Self::on(config, buses)
    }

    /// On these buses in place of those of the configuration.
    pub fn on(config: Config, buses: Vec<SimulatedBus>) -> Self {
        let ports = buses.into_iter().map(Watched::new).collect();
        let (run, log) = VirtualRun::new(&config, ports).unwrap();
        Self { config, run, log, events: vec![], last_motion: RequestId::default() }
    }

    /// A controller that holds where its axes are for an hour, to be commanded by the test.
    pub fn holding(config: Config) -> Self {
        let buses = (0..config.buses.len()).map(|bus| SimulatedBus::new(&config, bus)).collect();
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

    /// The axes whose drives showed an error during the shut-down, with its code.
    pub fn drive_errors(&self) -> &[(usize, u16)] {
        self.run.supervisor().drive_errors()
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

    /// Whether the last target that [`World::drive_to`] has given is reached.
    pub fn is_reached(&self) -> bool {
        self.run.snapshot().motions.of(self.last_motion) == Some(MotionState::Finished)
    }

    /// Gives an axis in a profile mode a target that stays valid for an hour.
    pub fn drive_to(&mut self, axis: u8, target: ProfileTarget) {
        let valid_until_ns = self.run.snapshot().at_ns + 3_600_000 * MILLISECOND_NS;
        self.last_motion =
            self.request(Request::SetProfileTarget(ProfileMove { axis, target, valid_until_ns }));
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

    pub fn phases(&self) -> Vec<Phase> {
        let phases = self.events.iter().filter_map(|event| match event.kind {
            EventKind::PhaseChanged { to, .. } => Some(to),
            _ => None,
        });
        phases.collect()
    }
}

/// Counts for one rad (m) of an axis.
pub fn counts_per_unit(axis: &Axis) -> f64 {
    let travel_per_turn = match axis.travel {
        Travel::Rotary => TAU,
        Travel::Linear { lead_m } => lead_m,
    };
    axis.counts_per_turn * axis.gear_ratio / travel_per_turn
}

pub fn id(function: u16, node: u8) -> u32 {
    Id::canopen(function, node).value()
}

pub fn word(payload: &[u8]) -> u16 {
    u16::from_le_bytes([payload[0], payload[1]])
}

pub fn counts(payload: &[u8]) -> i32 {
    i32::from_le_bytes(payload.try_into().unwrap())
}
