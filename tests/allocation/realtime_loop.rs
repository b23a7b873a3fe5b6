//! The loop in its real-time thread on its ports allocates nothing and causes no page fault.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use takt::Outcome;
use takt::Port;
use takt::channels::{ChannelSizes, channels};
use takt::config::Config;
use takt::controller::realtime_thread::{self, LoopParts, ThreadSetup};
use takt::controller::{Supervisor, assemble};
use takt::telemetry::LoggerThread;
use takt::telemetry::{BlackBoxOptions, Logger, LoggerOptions, Machine, RecordingOptions, WallClock};
use takt_rt::Frame;
use takt_rt::linux::MonotonicClock;
use takt_rt::{BusHealth, BusPort, Clock, ReceiveBatch};

use crate::heap;

/// Notes after each of its calls how often the loop has used the heap since the first one, which the loop makes before its first SYNC.
/// What the thread does at its end is not of the loop.
struct Watched {
    port: Port,
    calls_at_begin: Option<u64>,
    calls_in_loop: Arc<AtomicU64>,
}

impl Watched {
    fn note(&mut self) {
        let calls = heap().calls;
        let at_begin = *self.calls_at_begin.get_or_insert(calls);
        self.calls_in_loop.fetch_max(calls - at_begin, Ordering::Relaxed);
    }
}

impl BusPort for Watched {
    fn send(&mut self, now_ns: u64, frames: &[Frame]) -> usize {
        self.note();
        self.port.send(now_ns, frames)
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        self.note();
        self.port.receive(now_ns, batch);
    }

    fn unconfirmed(&mut self, now_ns: u64) -> usize {
        self.port.unconfirmed(now_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.port.health()
    }
}

/// Pages that the kernel has moved since it started, to have larger ranges free. Each costs a page fault at its next access, locked or not,
/// unless the kernel has PREEMPT_RT (vm.compact_unevictable_allowed).
fn moved_pages() -> u64 {
    let counters = std::fs::read_to_string("/proc/vmstat").unwrap();
    let count = counters.lines().find_map(|line| line.strip_prefix("pgmigrate_success "));
    count.map_or(0, |count| count.parse().unwrap())
}

#[test]
fn the_loop_allocates_nothing_from_bring_up_to_the_last_cycle() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/arm6-erob.toml");
    let mut config = Config::load(&path).unwrap();
    config.program.moves.truncate(2);

    let (rt, mut host, log) = channels(&ChannelSizes::of(&config));
    let mut clock = MonotonicClock::default();
    let started_ns = clock.now_ns();
    let mut traces = vec![];
    let calls_in_loop = Arc::<AtomicU64>::default();
    let ports = (0..config.buses.len()).map(|bus| {
        let (port, trace) = Port::open(&config, bus).unwrap().traced(&config.buses[bus].name);
        traces.push(trace);
        Watched { port, calls_at_begin: None, calls_in_loop: Arc::clone(&calls_in_loop) }
    });
    let work = LoopParts {
        engine: assemble::engine(&config).unwrap(),
        plan: assemble::slot_plan(&config),
        ports: ports.collect(),
        host: rt,
        spin_guard_ns: None,
        is_realtime_required: false,
        clock_journal: None,
        watch: Default::default(),
    };
    let folder = tempfile::tempdir().unwrap();
    let options = LoggerOptions {
        machine: Machine::of(&config),
        wall_clock: WallClock::starting_now(started_ns),
        started_ns,
        recording: None,
        recording_options: RecordingOptions::default(),
        candump: None,
        black_box: Some(BlackBoxOptions { span_ns: 5_000_000_000, directory: folder.path().to_owned() }),
        traces,
    };
    let logger = LoggerThread::start(Logger::new(log, options, Box::new(|_| {}))).unwrap();
    let running = realtime_thread::start(ThreadSetup::of(&config.realtime), work).unwrap();
    let memory_locked = running.begun().report.memory_locked;

    let moved_before = moved_pages();
    let mut supervisor = Supervisor::new(&config, None);
    while !running.is_finished() {
        supervisor.poll(clock.now_ns(), &mut host);
        thread::sleep(Duration::from_millis(1));
    }
    let ended = running.join().unwrap();
    let log = logger.finish();

    assert_eq!(supervisor.outcome(), Some(&Outcome::Finished));
    assert!(log.statistics.cycles > 1_000, "{} cycles", log.statistics.cycles);
    assert_eq!(calls_in_loop.load(Ordering::Relaxed), 0);
    if memory_locked && moved_pages() == moved_before {
        assert_eq!((ended.page_faults.minor, ended.page_faults.major), (0, 0));
    }
}
