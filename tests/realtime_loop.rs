//! The loop in its real-time thread on its ports allocates nothing and causes no page fault.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use takt::Outcome;
use takt::Port;
use takt::config::Config;
use takt::internals::channels::{ChannelSizes, channels};
use takt::internals::controller::realtime_thread::{self, LoopParts};
use takt::internals::controller::{Supervisor, assemble};
use takt::internals::telemetry::LoggerThread;
use takt::telemetry::{BlackBoxOptions, Logger, LoggerOptions, Machine, RecordingOptions, WallClock};
use takt_rt::Frame;
use takt_rt::linux::MonotonicClock;
use takt_rt::{BusHealth, BusPort, Clock, ReceiveBatch};

thread_local! {
    static IS_WATCHED: Cell<bool> = const { Cell::new(false) };
}

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);
/// [`ALLOCATIONS`] at the last call of a port. Later allocations belong to the end of the thread, not to the loop.
static SEEN_BY_LOOP: AtomicU64 = AtomicU64::new(0);

/// Counts the calls of the watched thread to the allocator: allocating, reallocating and freeing.
struct Counting;

impl Counting {
    fn count() {
        if IS_WATCHED.with(Cell::get) {
            ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        }
    }
}

// SAFETY: every call is passed on unchanged to the system's allocator, and counting touches no memory of the heap.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        Self::count();
        // SAFETY: the caller keeps the same contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        Self::count();
        // SAFETY: the caller keeps the same contract.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        Self::count();
        // SAFETY: the caller keeps the same contract.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Starts to watch its thread at the first call, which the loop makes before its first SYNC.
struct Watched(Port);

impl Watched {
    fn watch() {
        IS_WATCHED.with(|flag| flag.set(true));
        SEEN_BY_LOOP.store(ALLOCATIONS.load(Ordering::Relaxed), Ordering::Relaxed);
    }
}

impl BusPort for Watched {
    fn send(&mut self, now_ns: u64, frames: &[Frame]) -> usize {
        Self::watch();
        self.0.send(now_ns, frames)
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        Self::watch();
        self.0.receive(now_ns, batch);
    }

    fn unconfirmed(&mut self, now_ns: u64) -> usize {
        self.0.unconfirmed(now_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.0.health()
    }
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
    let ports = (0..config.buses.len()).map(|bus| {
        let (port, trace) = Port::open(&config, bus).unwrap().traced(&config.buses[bus].name);
        traces.push(trace);
        Watched(port)
    });
    let work = LoopParts {
        engine: assemble::engine(&config).unwrap(),
        plan: assemble::slot_plan(&config),
        ports: ports.collect(),
        host: rt,
        spin_guard_ns: None,
        is_realtime_required: false,
        clock_journal: None,
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
    let running = realtime_thread::start(realtime_thread::thread_config(&config.realtime), work).unwrap();
    let memory_locked = running.begun().report.memory_locked;

    let mut supervisor = Supervisor::new(&config, None);
    while !running.is_finished() {
        supervisor.poll(clock.now_ns(), &mut host);
        thread::sleep(Duration::from_millis(1));
    }
    let ended = running.join().unwrap();
    let log = logger.finish();

    assert_eq!(supervisor.outcome(), Some(&Outcome::Finished));
    assert!(log.statistics.cycles > 1_000, "{} cycles", log.statistics.cycles);
    assert_eq!(SEEN_BY_LOOP.load(Ordering::Relaxed), 0);
    if memory_locked {
        assert_eq!((ended.page_faults.minor, ended.page_faults.major), (0, 0));
    }
}
