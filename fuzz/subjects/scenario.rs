//! Fuzzes the reader of scenarios with arbitrary text, and the ports that inject its faults.

use std::sync::OnceLock;

use takt::Port;
use takt::config::Config;
use takt::faults::{FaultInjector, Scenario};
use takt_rt::{BusPort, Frame, Id, Phase, ReceiveBatch, Snapshot};

use super::configuration::assert_explained;

fn arm() -> &'static Config {
    static ARM: OnceLock<Config> = OnceLock::new();
    ARM.get_or_init(|| {
        let text = include_str!("../../configs/arm6-erob.toml");
        Config::parse("arm6-erob.toml", text).expect("the example is valid")
    })
}

/// Reads a text as a scenario, and runs a valid one for some cycles.
pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    match Scenario::parse("fuzz", text, arm()) {
        Err(error) => assert_explained(text, &error),
        Ok(scenario) => play(scenario),
    }
}

fn play(scenario: Scenario) {
    let fault_injector = FaultInjector::new(scenario);
    let mut ports: Vec<Port> = (0..arm().buses.len())
        .map(|bus| fault_injector.wrap(bus, Port::Simulated(Box::new(takt::simulated_bus(arm(), bus)))))
        .collect();
    let set_points: Vec<Frame> =
        (1..=6).map(|node| Frame::of(Id::canopen(0x200, node), [0x0F, 0, node, 0, 0, 0])).collect();
    for (slot, phase) in [Phase::Passive, Phase::Holding, Phase::Moving, Phase::Stopping, Phase::Disabled]
        .into_iter()
        .cycle()
        .take(20)
        .enumerate()
    {
        let at_ns = slot as u64 * 1_000_000;
        for port in &mut ports {
            port.send(at_ns, &[Frame::of(Id::canopen(0x080, 0), [])]);
            let mut batch = ReceiveBatch::new();
            port.receive(at_ns + 500_000, &mut batch);
            assert!(batch.iter().all(|received| received.at_ns <= at_ns + 500_000));
            port.unconfirmed(at_ns + 500_000);
            assert!(port.send(at_ns + 500_000, &set_points) <= set_points.len());
            port.health();
        }
        let mut snapshot = Snapshot { at_ns: at_ns + 510_000, ..Snapshot::default() };
        snapshot.groups[0].phase = phase;
        fault_injector.observe(&snapshot);
    }
}
