//! A lost heartbeat of the controller: drives begin to monitor it with the first one that they receive.

use takt::VirtualRun;
use takt::config::Config;
use takt::sim::SimulatedBus;
use takt_rt::{BusHealth, BusPort, DriveState, Frame, Id, Phase, ReceiveBatch};

use crate::faults::arm::folder;

const MILLISECOND_NS: u64 = 1_000_000;

/// A simulated bus that loses one of the controller's heartbeats.
struct LossyBus {
    bus: SimulatedBus,
    heartbeat: Id,
    /// The index of the lost heartbeat, counted from 0.
    lost: Option<usize>,
    heartbeats: usize,
}

impl BusPort for LossyBus {
    fn send(&mut self, now_ns: u64, frames: &[Frame]) -> usize {
        for (index, frame) in frames.iter().enumerate() {
            if frame.id() == self.heartbeat {
                self.heartbeats += 1;
                if self.lost.is_some_and(|lost| self.heartbeats == lost + 1) {
                    continue;
                }
            }
            if self.bus.send(now_ns, &[*frame]) == 0 {
                return index;
            }
        }
        frames.len()
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        self.bus.receive(now_ns, batch);
    }

    fn unconfirmed(&mut self, now_ns: u64) -> usize {
        self.bus.unconfirmed(now_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.bus.health()
    }
}

/// The first axis of a machine, with a long heartbeat period of the controller.
fn machine(name: &str) -> Config {
    let mut config = Config::load(&folder().join(format!("{name}.toml"))).unwrap();
    config.axes.iter_mut().for_each(|axis| axis.power_up_ns = 5 * MILLISECOND_NS);
    config.master.heartbeat_ns = Some(20_000 * MILLISECOND_NS);
    config.master.heartbeat_timeout_ns = 50_000 * MILLISECOND_NS;
    config
}

/// Runs until all axes are enabled and the first move has begun. Returns the number of heartbeats sent on the first
/// bus.
fn enabled(config: &Config, lost: Option<usize>) -> (VirtualRun<LossyBus>, usize) {
    let heartbeat = Id::canopen(0x700, config.master.node);
    let buses = (0..config.buses.len()).map(|bus| takt::simulated_bus(config, bus));
    let ports = buses.map(|bus| LossyBus { bus, heartbeat, lost, heartbeats: 0 }).collect();
    let (mut run, _) = VirtualRun::new(config, ports).unwrap();
    while run.snapshot().groups[0].phase != Phase::Moving {
        assert!(run.step(), "{}: it ends before it moves", config.name);
    }
    let heartbeats = run.ports()[0].heartbeats;
    (run, heartbeats)
}

#[test]
fn a_just_enabled_drive_stops_when_its_controller_dies_whichever_heartbeat_was_lost() {
    for name in ["single-erob", "gantry-yz-aim"] {
        let config = machine(name);
        let sent = enabled(&config, None).1;
        assert!(sent >= 2, "{name}: {sent} heartbeats");
        for lost in 0..sent {
            let (mut run, _) = enabled(&config, Some(lost));
            let died_ns = run.snapshot().at_ns;
            let port = &mut run.ports()[0];
            let mut observed = |at_ns: u64| -> Vec<DriveState> {
                port.receive(at_ns, &mut ReceiveBatch::new());
                config.axes.iter().map(|axis| port.bus.observe(axis.node).unwrap().state).collect()
            };
            assert!(observed(died_ns).iter().all(|state| *state == DriveState::OperationEnabled));
            let ticks = died_ns..=died_ns + config.master.heartbeat_timeout_ns;
            let states = ticks.step_by(MILLISECOND_NS as usize).map(observed).last().unwrap();
            // The heartbeat alarm of a YZ-AIM stops it and keeps its shaft locked.
            assert!(
                states.iter().all(|state| state.is_faulted()),
                "{name}, {lost} of {sent} lost: {states:?}"
            );
        }
    }
}
