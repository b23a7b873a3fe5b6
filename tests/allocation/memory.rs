//! The memory of a run does not grow with its duration, with a recording or without.

use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use takt::Port;
use takt::VirtualRun;
use takt::config::{Config, ConfigSources};
use takt::controller::assemble;
use takt::telemetry::{
    BlackBoxOptions, Logger, LoggerOptions, Machine, RecordingDestination, RecordingOptions, WallClock,
};

use crate::heap;

/// A writer that keeps only the length of a recording.
#[derive(Clone, Default)]
struct Length(Arc<AtomicU64>);

impl Write for Length {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The bytes on the heap at the end of every minute of six axes in motion, with a recording or without. The black box is
/// always on, with the journal that it is replayed by.
fn held_every_minute(minutes: usize, recording: Option<RecordingDestination>) -> Vec<i64> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/arm6-erob.toml");
    let mut config = Config::load(&path).unwrap();
    config.program.repeat = 1_000_000;
    let mut traces = vec![];
    let ports = (0..config.buses.len()).map(|bus| {
        let (port, trace) = Port::open(&config, bus).unwrap().traced(&config.buses[bus].name);
        traces.push(trace);
        port
    });
    let (mut run, log) = VirtualRun::new(&config, ports.collect()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let options = LoggerOptions {
        machine: Machine::of(&config),
        wall_clock: WallClock::fixed(0),
        started_ns: 0,
        recording,
        recording_options: RecordingOptions::default(),
        candump: None,
        black_box: Some(BlackBoxOptions { span_ns: 5_000_000_000, directory: folder.path().to_owned() }),
        traces,
    };
    let logger = Logger::new(log, options, Box::new(|_| {}));
    let again = assemble::rerun_parts(&config).unwrap();
    let mut logger = logger.with_journal(Some(run.journal()), Some(again), &ConfigSources::default());
    let mut held = Vec::with_capacity(minutes);
    for cycle in 1..=minutes as u64 * 60_000 {
        assert!(run.step(), "the run has ended in cycle {cycle}: {:?}", run.supervisor().outcome());
        logger.drain();
        if cycle.is_multiple_of(60_000) {
            held.push(heap().held_bytes);
        }
    }
    let summary = logger.finish();
    assert_eq!((summary.records_dropped, summary.frames_dropped), (0, 0));
    held
}

#[test]
fn the_memory_of_a_run_grows_only_by_the_index_of_its_recording() {
    // The last seconds of the journal are kept as blocks, whose lengths depend on the values in them.
    const BLOCKS_DIFFER_BY: i64 = 2048;
    let held = held_every_minute(3, None);
    let is_steady = held.iter().all(|bytes| (bytes - held[0]).abs() < BLOCKS_DIFFER_BY);
    assert!(is_steady, "bytes held, without a recording: {held:?}");

    let recorded = Length::default();
    let destination = RecordingDestination::Stream("length".to_owned(), Box::new(recorded.clone()));
    let held = held_every_minute(3, Some(destination));
    // An MCAP file ends with an index of its chunks. It takes some 500 bytes of memory for each chunk of a third of a second.
    let in_two_minutes = recorded.0.load(Ordering::Relaxed) as i64 * 2 / 3;
    assert!(in_two_minutes > 10_000_000, "{in_two_minutes} bytes were recorded in two minutes");
    assert!(held[2] - held[0] < in_two_minutes / 40, "{held:?} bytes held, {in_two_minutes} recorded");
}
