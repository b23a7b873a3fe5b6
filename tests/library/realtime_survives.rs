//! The loop in its real-time thread on simulated buses, while other parts of the program fail.

use std::cell::Cell;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use takt::Ended;
use takt::Outcome;
use takt::Port;
use takt::channels::{ChannelSizes, HostSide, LogSide, channels};
use takt::config::Config;
use takt::controller::realtime_thread::{self, LoopParts, ThreadSetup};
use takt::controller::session::{self};
use takt::controller::{Supervisor, assemble};
use takt::link::trace::Trace;
use takt::telemetry::LoggerThread;
use takt::telemetry::{
    BlackBoxOptions, Incident, Logger, LoggerOptions, Machine, Notice, Recorded, RecordingOptions, WallClock,
};
use takt::{Session, SessionOptions};
use takt_rt::linux::MonotonicClock;
use takt_rt::{
    BusHealth, BusPort, Clock, EventKind, Frame, Phase, ReceiveBatch, Request, Snapshot, StopCategory,
    StreamPoint,
};

fn arm(directory: &Path) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/arm6-erob.toml");
    let mut config = Config::load(&path).unwrap();
    config.program.moves.truncate(2);
    config.telemetry.directory = directory.to_owned();
    config.telemetry.is_recorded = false;
    config
}

/// The result of a run in the real-time thread.
struct Left {
    outcome: Option<Outcome>,
    ended: Option<Ended>,
    snapshot: Snapshot,
    log: LogSide,
    traces: Vec<Trace>,
}

/// Runs the program. `each` is called about once in a millisecond, and `wrap` may wrap the ports.
fn run<P: BusPort + Send + 'static>(
    config: &Config,
    wrap: impl Fn(Port) -> P,
    mut each: impl FnMut(&mut HostSide),
) -> Left {
    let (rt, mut host, log) = channels(&ChannelSizes::of(config));
    let mut clock = MonotonicClock::default();
    let (ports, traces) = (0..config.buses.len())
        .map(|bus| {
            let (port, trace) = Port::open(config, bus).unwrap().traced(&config.buses[bus].name);
            (wrap(port), trace)
        })
        .unzip();
    let work = LoopParts {
        engine: assemble::engine(config).unwrap(),
        plan: assemble::slot_plan(config),
        ports,
        host: rt,
        spin_guard_ns: None,
        is_realtime_required: false,
        clock_journal: None,
        watch: Default::default(),
    };
    let running = realtime_thread::start(ThreadSetup::of(&config.realtime), work).unwrap();
    let mut supervisor = Supervisor::new(config, None);
    while !running.is_finished() {
        supervisor.poll(clock.now_ns(), &mut host);
        each(&mut host);
        thread::sleep(Duration::from_millis(1));
    }
    let ended = running.join();
    Left { outcome: supervisor.outcome().cloned(), ended, snapshot: host.snapshot(), log, traces }
}

/// Counts the cycles. Each cycle reads the health of each bus once.
struct Counted {
    port: Port,
    cycles: Arc<AtomicU64>,
}

impl BusPort for Counted {
    fn send(&mut self, now_ns: u64, frames: &[Frame]) -> usize {
        self.port.send(now_ns, frames)
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        self.port.receive(now_ns, batch);
    }

    fn unconfirmed(&mut self, now_ns: u64) -> usize {
        self.port.unconfirmed(now_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.cycles.fetch_add(1, Ordering::Relaxed);
        self.port.health()
    }
}

#[test]
fn a_stuck_logger_loses_only_records_and_frames_and_they_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = arm(folder.path());
    config.telemetry.ring_records = 64;
    let asked = Arc::new(AtomicU64::new(0));
    let mut left = run(&config, |port| Counted { port, cycles: Arc::clone(&asked) }, |_| {});
    assert_eq!(left.outcome, Some(Outcome::Finished));
    assert!(left.ended.is_some());
    let cycles = asked.load(Ordering::Relaxed) / config.buses.len() as u64;
    assert_eq!(left.log.records_written(), 64);
    assert_eq!(left.log.records_dropped(), cycles - 64);
    for trace in &mut left.traces {
        let kept = std::iter::from_fn(|| trace.take()).count() as u64;
        assert!(kept > 1_000 && trace.dropped() > cycles, "{kept} kept, {} dropped", trace.dropped());
    }
}

#[test]
fn a_client_that_floods_the_queue_and_the_stream_does_not_prevent_the_end_of_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let config = arm(folder.path());
    let point = StreamPoint { at_ns: u64::MAX, ..StreamPoint::default() };
    let refused = Cell::new(0_u64);
    let left = run(
        &config,
        |port| port,
        |host| {
            for _ in 0..100 {
                // It is refused, since nothing streams.
                let _ = host.streamer().push(&[point]);
                // Requests that are granted at any time and change nothing.
                if host.request(Request::Sync(true)).is_err() {
                    refused.set(refused.get() + 1);
                }
            }
        },
    );
    assert_eq!(left.outcome, Some(Outcome::Finished));
    assert!(refused.get() > 10_000, "the queue was full {} times", refused.get());
}

/// A port that panics in the real-time thread after so many calls.
struct Fatal {
    port: Port,
    sends: u32,
}

impl BusPort for Fatal {
    fn send(&mut self, now_ns: u64, frames: &[Frame]) -> usize {
        self.sends += 1;
        assert!(self.sends < 2_000, "a defect");
        self.port.send(now_ns, frames)
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        self.port.receive(now_ns, batch);
    }

    fn unconfirmed(&mut self, now_ns: u64) -> usize {
        self.port.unconfirmed(now_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.port.health()
    }
}

#[test]
fn after_a_panic_of_the_real_time_thread_its_last_cycles_and_frames_are_in_the_black_box() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = arm(folder.path());
    config.telemetry.ring_records = 8_192;
    let left = run(&config, |port| Fatal { port, sends: 0 }, |_| {});
    assert!(left.ended.is_none() && left.outcome.is_none());
    let options = LoggerOptions {
        machine: Machine::of(&config),
        wall_clock: WallClock::fixed(0),
        started_ns: 0,
        recording: None,
        recording_options: RecordingOptions::default(),
        candump: None,
        black_box: Some(BlackBoxOptions { span_ns: 5_000_000_000, directory: folder.path().to_owned() }),
        traces: left.traces,
    };
    let logger = LoggerThread::start(Logger::new(left.log, options, Box::new(|_| {}))).unwrap();
    logger.incident(Incident::ThreadDied);
    let files = logger.finish().black_boxes.files;
    let recorded = Recorded::open(&files[0]).unwrap();
    assert_eq!(recorded.cause().unwrap().rule, "thread_died");
    assert_eq!(recorded.slots.unwrap().1, left.snapshot.slot);
    let bytes = fs::read(&files[0]).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    assert!(messages.filter(|message| message.channel.topic == "/frames/base").count() > 1_000);
}

/// After the panic, the group was stopped in category 1, and its drives are without power. On a loaded computer a thread that is late in too
/// many cycles takes the power sooner.
fn assert_stopped_in_control(session: &Session, message: &str) {
    assert_eq!(session.outcome, Outcome::CallbackPanicked { message: message.to_owned() });
    let was_late = session.snapshot.missed_slots > 0;
    let category = session.snapshot.groups[0].stop.map(|stop| stop.category);
    assert!(category == Some(StopCategory::One) || was_late, "{:?}", session.snapshot);
    assert_eq!(session.snapshot.groups[0].phase, Phase::Disabled);
    assert!(session.ended.is_some(), "the real-time thread has ended regularly");
    let recorded = Recorded::open(&session.log.black_boxes.files[0]).unwrap();
    assert_eq!(recorded.cause().unwrap().rule, "callback_panicked");
    let decelerated = recorded.events.iter().any(|event| {
        event.kind == Some(EventKind::PhaseChanged { from: Phase::Moving, to: Phase::Stopping })
    });
    assert!(decelerated || was_late, "{:?}", recorded.events);
}

#[test]
fn a_panic_of_the_callers_watch_is_caught_and_stops_the_group_in_category_1() {
    let folder = tempfile::tempdir().unwrap();
    let config = arm(folder.path());
    let mut calls_in_motion = 0;
    let session = session::run(&config, SessionOptions::default(), Box::new(|_| {}), |snapshot, _| {
        calls_in_motion += u32::from(snapshot.groups[0].phase == Phase::Moving);
        assert!(calls_in_motion < 100, "a mistake in watch");
        None
    });
    assert_stopped_in_control(&session.unwrap(), "a mistake in watch");
}

#[test]
fn a_panic_of_the_callers_notify_is_caught_and_stops_the_group_in_category_1() {
    let folder = tempfile::tempdir().unwrap();
    let config = arm(folder.path());
    let notify = |notice: &Notice| {
        if let Notice::Event(event) = notice {
            let begins = matches!(event.kind, EventKind::PhaseChanged { to: Phase::Moving, .. });
            assert!(!begins, "a mistake in notify");
        }
    };
    let mut last_watched = Phase::Passive;
    let session = session::run(&config, SessionOptions::default(), Box::new(notify), |snapshot, _| {
        last_watched = snapshot.groups[0].phase;
        None
    });
    assert_stopped_in_control(&session.unwrap(), "a mistake in notify");
    assert_eq!(last_watched, Phase::Disabled, "watch was called until the end");
}
