//! Machines of drives by their data sheets, and their runs in virtual time.

use std::path::{Path, PathBuf};

use takt::Config;
use takt::{Outcome, VirtualRun};
use takt_rt::Phase;

use crate::cia402_nodes::listening_bus::ListeningBus;

pub const MILLISECOND_NS: u64 = 1_000_000;
const CYCLES_AT_MOST: u64 = 60_000;

pub fn sheet(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/eds/vendors").join(name)
}

pub fn run_of(config: &Config) -> VirtualRun<ListeningBus> {
    let buses = (0..config.buses.len()).map(|bus| ListeningBus::new(takt::simulated_bus(config, bus)));
    VirtualRun::new(config, buses.collect()).unwrap().0
}

/// Runs until the first move has begun.
pub fn moving(config: &Config) -> VirtualRun<ListeningBus> {
    let mut run = run_of(config);
    while run.snapshot().groups[0].phase != Phase::Moving {
        assert!(run.step(), "{}: it ends before it moves: {:?}", config.name, run.supervisor().outcome());
    }
    run
}

pub fn finish(run: &mut VirtualRun<ListeningBus>) -> Option<Outcome> {
    run.run(CYCLES_AT_MOST, |_| ())
}
