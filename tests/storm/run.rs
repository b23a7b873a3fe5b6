//! One case from power-up to the end.

use std::hash::{DefaultHasher, Hasher};
use std::sync::Arc;

use takt::bus::port::Port;
use takt::config::Config;
use takt::controller::channels::LogSide;
use takt::controller::{Interrupt, VirtualRun};
use takt::faults::{Rehearsal, Scenario};
use takt::sim::{Observation, SimulatedBus};
use takt_rt::frame::Frame;
use takt_rt::port::{BusPort, ReceiveBatch};
use takt_rt::record::Event;
use takt_rt::stop::Phase;

use crate::case::Case;
use crate::client::{Client, is_open};
use crate::invariants::{Invariants, REST};
use crate::tap::Tap;

/// Bring-up, farewell and every patience of the life cycle together.
const END_AT_MOST_S: f64 = 45.0;

/// A controller in virtual time of which everything is seen.
pub struct World {
    pub run: VirtualRun<Tap>,
    pub log: LogSide,
    pub rehearsal: Arc<Rehearsal>,
    /// Of the present cycle.
    pub sent: Vec<Vec<Frame>>,
    pub truth: Vec<Observation>,
    pub events: Vec<Event>,
}

impl World {
    pub fn new(config: &Config, scenario: &Scenario) -> Self {
        let rehearsal = Arc::new(Rehearsal::new(scenario.clone()));
        let simulated = |bus| Port::Simulated(Box::new(SimulatedBus::new(config, bus)));
        let ports =
            (0..config.buses.len()).map(|bus| Tap::new(rehearsal.wrap(bus, simulated(bus)))).collect();
        let (run, log) = VirtualRun::new(config, ports).unwrap();
        Self { run, log, rehearsal, sent: vec![vec![]; config.buses.len()], truth: vec![], events: vec![] }
    }

    /// One cycle. Returns whether the run goes on.
    pub fn step(&mut self, config: &Config) -> bool {
        let goes_on = self.run.step();
        self.rehearsal.observe(&self.run.snapshot());
        let ports = self.run.ports();
        for (sent, port) in self.sent.iter_mut().zip(ports.iter_mut()) {
            sent.clear();
            std::mem::swap(sent, &mut port.sent);
        }
        self.truth.clear();
        self.truth.extend(config.axes.iter().map(|axis| ports[axis.bus].observe(axis.node)));
        self.events.clear();
        while let Some(event) = self.log.take_event() {
            self.events.push(event);
        }
        goes_on
    }
}

/// What is left of a case.
#[derive(Debug)]
pub struct Done {
    pub cycles: u64,
    /// Of all records, events and frames.
    pub fingerprint: u64,
}

/// Plays a case.
///
/// # Errors
/// The invariant that does not hold, and when.
pub fn play(case: &Case) -> Result<Done, String> {
    let config = &case.config;
    let mut world = World::new(config, &case.scenario);
    let mut invariants = Invariants::new(config, &case.scenario);
    let mut client = Client::new(case.dice);
    let mut hasher = DefaultHasher::new();
    let at_most = case.length + (END_AT_MOST_S * 1e9 / config.cycle.period_ns as f64) as u64;
    let (mut enabled, mut cycles) = (None, 0);
    let mut goes_on = true;
    while goes_on {
        goes_on = world.step(config);
        cycles += 1;
        let snapshot = world.run.snapshot();
        let wrong = |what: String| format!("cycle {cycles}, {:?}: {what}", snapshot.phase);
        fingerprint(&mut hasher, &world);
        invariants.check(config, &snapshot, &world.sent, &world.truth, &world.events).map_err(wrong)?;
        while let Some(checked) = world.log.next_record(|record| {
            hasher.write_u64(record.timing.slot);
            for axis in record.axes() {
                hasher.write_u64(axis.position_set.to_bits() ^ axis.position.to_bits().rotate_left(17));
                hasher.write_i32(axis.command_raw);
            }
            invariants.check_record(config, record)
        }) {
            checked.map_err(wrong)?;
        }
        if cycles > at_most {
            return Err(wrong("the run does not end".to_owned()));
        }
        if enabled.is_none() && snapshot.phase == Phase::Holding {
            enabled = Some(cycles);
        }
        let Some(enabled) = enabled else { continue };
        if cycles == enabled + case.length {
            let interrupt = if case.is_cut { Interrupt::Immediate } else { Interrupt::Controlled };
            world.run.interrupt(interrupt);
        }
        if case.has_client && cycles < enabled + case.length && is_open(&snapshot) {
            let wishes = client.wishes(config, &snapshot);
            for request in wishes.requests {
                let _ = world.run.host().request(request);
            }
            if let Some(command) = wishes.stream {
                world.run.host().stream(&command);
            }
            world.run.clock().stall(wishes.late_ns);
        }
    }
    at_rest(case, &mut world)?;
    Ok(Done { cycles, fingerprint: hasher.finish() })
}

/// Two seconds after the controller has gone, whatever it could not stop has been stopped by its own watchdog.
fn at_rest(case: &Case, world: &mut World) -> Result<(), String> {
    let end_ns = world.run.snapshot().at_ns;
    for now_ns in (1..=2000).map(|passed_ms| end_ns + passed_ms * 1_000_000) {
        for port in world.run.ports() {
            let mut batch = ReceiveBatch::new();
            port.receive(now_ns, &mut batch);
        }
    }
    let has_load = case.scenario.faults.iter().any(|fault| fault.kind == "load");
    for axis in case.config.axes.iter().filter(|_| !has_load) {
        let truth = world.run.ports()[axis.bus].observe(axis.node);
        if truth.velocity.abs() > REST {
            return Err(format!("{} is not at rest in the end: {truth:?}", axis.name));
        }
    }
    Ok(())
}

fn fingerprint(hasher: &mut DefaultHasher, world: &World) {
    for (bus, frames) in world.sent.iter().enumerate() {
        for frame in frames {
            hasher.write_u64(u64::from(frame.id().value()) << 8 | bus as u64);
            hasher.write(frame.payload());
        }
    }
    for event in &world.events {
        hasher.write(format!("{event:?}").as_bytes());
    }
    for truth in &world.truth {
        hasher.write_u64(truth.position.to_bits());
    }
}
