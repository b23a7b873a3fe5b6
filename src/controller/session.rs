//! A run in real time, from the configuration to its result.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use takt_rt::linux::{MonotonicClock, ThreadReport};
use takt_rt::{Clock, Request, SlotPlan, Snapshot, StopCategory};

use tracing::{info, warn};

use super::assemble::{self, AssembleError};
use super::interfaces::Interfaces;
use super::last_resort::LastResort;
use super::lines::Lines;
use super::outcome::{Interrupt, Outcome, Progress};
use super::port::Port;
use super::realtime_thread::{self, Begun, Ended, LoopParts, StartError, ThreadSetup};
use super::supervisor::{AfterBringUp, Supervisor};
use super::time_of_day::TimeOfDayKeeper;
use super::watchdog::{LoopWatch, Stalled, Watchdog};
use crate::channels::{
    self, BringUpFailures, CallbackGiver, ChannelSizes, ClientRequests, EventReader, HostSide, Observer,
    Questions, Streamer, TrajectoryGiver, channels, panic_message,
};
use crate::config::{Config, ConfigSources};

use crate::faults::FaultInjector;
use crate::journal::{RunJournal, clock_journal};
use crate::link::OpenError;
use crate::link::ownership::{ClaimError, IfOwned, Ownership};
use crate::link::trace::Trace;
use crate::sleep_alignment;
use crate::telemetry::{
    BlackBoxOptions, EachCycle, FrameFeed, Incident, LogSummary, Logger, LoggerOptions, LoggerThread,
    Machine, Notice, RecordingDestination, RecordingOptions, ShownTiming, WallClock, shown_timing,
};

/// The pause between two polls of the controller.
const PAUSE: Duration = Duration::from_millis(1);

/// Options of a run beside its configuration.
#[derive(Default)]
pub struct SessionOptions {
    /// Repeat the program until this time is over.
    pub duration_ns: Option<u64>,
    /// Where to record; `None` as the configuration says.
    pub recording: Option<RecordingDestination>,
    /// How it is written: compressed, and in how many files.
    pub recording_options: RecordingOptions,
    /// True if a refused step of the real-time set-up ends the run before anything moves.
    pub is_realtime_required: bool,
    /// Called by the logger's thread with the record of each cycle. It must not panic.
    pub each_cycle: Option<EachCycle>,
    /// Faults that are injected into the buses.
    pub fault_injector: Option<Arc<FaultInjector>>,
    /// Also passes the frames of all buses there.
    pub frames: Option<Arc<FrameFeed>>,
    /// What happens when another process of this host is the master of a bus already.
    pub if_owned: IfOwned,
    /// The files that the configuration was made of. A recording has them, so that it can be replayed.
    pub sources: ConfigSources,
}

/// The result of a run.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Session {
    /// How it ended.
    pub outcome: Outcome,
    /// The state after the last cycle.
    pub snapshot: Snapshot,
    /// The target of the last move of each axis (rad or m); `None` where that has no target position. Empty if the program did
    /// not finish.
    pub targets: Vec<Option<f64>>,
    /// The axes whose drives did not confirm in the end that they have no torque, also where the bring-up failed. It is unknown whether
    /// they have stopped.
    pub unreached: Vec<usize>,
    /// The axes whose drives showed an error during the shut-down, with its code. A drive without an error code in its process
    /// data tells it there alone.
    pub drive_errors: Vec<(usize, u16)>,
    /// The result of the real-time set-up.
    pub begun: Begun,
    /// Measurements of the loop; `None` if its thread panicked.
    pub ended: Option<Ended>,
    /// The time for which the buses were open.
    pub open_ns: u64,
    /// The result of the logger.
    pub log: LogSummary,
}

/// Why a run did not begin.
#[derive(thiserror::Error)]
#[non_exhaustive]
pub enum SessionError {
    /// The configuration cannot be executed.
    #[error(transparent)]
    Assemble(#[from] AssembleError),
    /// A bus may not be commanded by this process.
    #[error(transparent)]
    Claim(#[from] ClaimError),
    /// A bus cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The thread of the logger could not be started.
    #[error("the logger could not be started: {0}")]
    Logger(std::io::Error),
    /// The real-time thread could not be started.
    #[error(transparent)]
    Start(#[from] StartError),
    /// The thread that watches it could not be started.
    #[error("the watchdog could not be started: {0}")]
    Watchdog(std::io::Error),
}

impl fmt::Debug for SessionError {
    /// For `main`: the sentence, or the problems of a configuration.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Assemble(error) => fmt::Debug::fmt(error, formatter),
            other => fmt::Display::fmt(other, formatter),
        }
    }
}

/// Runs the program of a configuration. The logger calls `notify` from its thread. `watch` is called about once in a
/// millisecond with the newest state and the progress of the run, and may ask the run to end.
///
/// If `notify` or `watch` panics, the panic is caught, the function is not called again, and the group stops in category 1.
/// The run then ends as [`Outcome::CallbackPanicked`].
///
/// # Errors
/// See [`SessionError`]; nothing has moved then.
pub fn run(
    config: &Config,
    options: SessionOptions,
    notify: Box<dyn FnMut(&Notice) + Send>,
    watch: impl FnMut(&Snapshot, Progress) -> Option<Interrupt>,
) -> Result<Session, SessionError> {
    run_with(config, options, notify, watch, None)
}

/// What the clients of a running controller command and observe it by.
pub(super) struct RemoteHandles {
    /// Reads the state.
    pub observer: Observer,
    /// Sends the points of a stream.
    pub streamer: Streamer,
    /// Sends requests.
    pub clients: ClientRequests,
    /// Gives trajectories.
    pub trajectories: TrajectoryGiver,
    /// Gives callbacks.
    pub callbacks: CallbackGiver,
    /// Asks devices that are none of the configuration's.
    pub questions: Questions,
    /// Tells why drives were not brought up again.
    pub bring_up_failures: BringUpFailures,
    /// The times within a slot.
    pub plan: SlotPlan,
    /// Reads the events.
    pub events: EventReader,
    /// The result of the real-time set-up.
    pub realtime: ThreadReport,
    /// Reads the timing.
    pub timing: ShownTiming,
}

/// Who commands the group in place of the program.
pub(super) struct Remote {
    /// Takes the handles.
    pub handles: mpsc::SyncSender<RemoteHandles>,
    /// What becomes of the drives before the first command.
    pub after_bring_up: AfterBringUp,
}

impl RemoteHandles {
    /// `None` if they were taken before.
    fn of(host: &mut HostSide, plan: SlotPlan, begun: &Begun, timing: ShownTiming) -> Option<Self> {
        Some(Self {
            observer: host.observer(),
            streamer: host.streamer(),
            clients: host.clients(),
            trajectories: host.trajectories(),
            callbacks: host.callbacks(),
            questions: host.questions(),
            bring_up_failures: host.bring_up_failures(),
            plan,
            events: host.events(),
            realtime: begun.report,
            timing,
        })
    }
}

/// The same as [`run`]. With somebody who takes handles, the group executes the requests of handles instead of a program.
pub(super) fn run_with(
    config: &Config,
    options: SessionOptions,
    notify: Box<dyn FnMut(&Notice) + Send>,
    watch: impl FnMut(&Snapshot, Progress) -> Option<Interrupt>,
    remote: Option<Remote>,
) -> Result<Session, SessionError> {
    config.validate_on_this_machine().map_err(AssembleError::from)?;
    let ownership = Ownership::of(config, options.if_owned)?;
    lead_as_owner(config, options, notify, watch, remote, ownership)
}

/// As [`lead`], on buses that are claimed already.
fn lead_as_owner(
    config: &Config,
    options: SessionOptions,
    notify: Box<dyn FnMut(&Notice) + Send>,
    mut watch: impl FnMut(&Snapshot, Progress) -> Option<Interrupt>,
    remote: Option<Remote>,
    ownership: Ownership,
) -> Result<Session, SessionError> {
    let mut clock = MonotonicClock::default();
    let engine = assemble::engine(config)?;
    let lines = Lines::open(config, options.fault_injector.as_deref())?;
    let is_recorded = options.recording.is_some() || config.telemetry.is_recorded;
    let has_black_box = config.telemetry.black_box_ns.is_some();
    let is_traced =
        is_recorded || has_black_box || options.frames.is_some() || config.telemetry.is_candump_written;
    let mut interfaces = Interfaces::of(ownership);
    let (ports, traces) =
        open_ports(config, &lines, options.fault_injector.as_deref(), is_traced, &mut interfaces)?;
    let (mut rt, mut host, log) = channels(&ChannelSizes::of(config));
    let (clock_answers, journal) = match is_recorded || has_black_box {
        true => {
            let (answers, clock) = clock_journal();
            (Some(answers), Some(RunJournal { clock, host: channels::journal(&mut rt, &mut host) }))
        }
        false => (None, None),
    };
    let again = has_black_box.then(|| assemble::rerun_parts(config)).transpose()?;
    let loop_watch = Arc::new(LoopWatch::new(rt.abandonment()));
    let last_resort = LastResort::prepare(config);
    let mut supervisor = match &remote {
        Some(remote) => Supervisor::serving(config, remote.after_bring_up),
        None => Supervisor::new(config, options.duration_ns),
    }
    .with_lines(lines);

    let directory = |is_wanted: bool| {
        is_wanted.then(|| RecordingDestination::Directory(config.telemetry.directory.clone()))
    };
    let started_ns = clock.now_ns();
    let logger_options = LoggerOptions {
        machine: Machine::of(config),
        wall_clock: WallClock::starting_now(started_ns),
        started_ns,
        recording: options.recording.or_else(|| directory(config.telemetry.is_recorded)),
        recording_options: options.recording_options,
        candump: directory(config.telemetry.is_candump_written),
        black_box: config
            .telemetry
            .black_box_ns
            .map(|span_ns| BlackBoxOptions { span_ns, directory: config.telemetry.directory.clone() }),
        traces,
    };
    // The logger's thread starts first, so that it does not inherit the real-time priority.
    let (timing_writer, timing) = shown_timing();
    let logger = Logger::new(log, logger_options, notify)
        .with_each_cycle(options.each_cycle)
        .with_timing(timing_writer)
        .with_frames(options.frames)
        .with_journal(journal, again, &options.sources);
    let logger = LoggerThread::start(logger).map_err(SessionError::Logger)?;
    let parts = LoopParts {
        engine,
        plan: assemble::slot_plan(config),
        ports,
        host: rt,
        spin_guard_ns: config.realtime.spin_guard_ns,
        is_realtime_required: options.is_realtime_required,
        clock_journal: clock_answers,
        watch: Arc::clone(&loop_watch),
    };
    let watchdog =
        match Watchdog::start(loop_watch, last_resort, config.cycle.period_ns, config.realtime.priority) {
            Ok(watchdog) => watchdog,
            Err(error) => {
                logger.finish();
                return Err(SessionError::Watchdog(error));
            }
        };
    let running = match realtime_thread::start(ThreadSetup::of(&config.realtime), parts) {
        Ok(running) => running,
        Err(error) => {
            watchdog.end();
            logger.finish();
            return Err(error.into());
        }
    };
    let begun = running.begun();
    for refused in begun.report.refused() {
        let step = refused.step;
        warn!(target: "takt::realtime", ?step, "the real-time thread was refused {step:?}");
    }
    if let (Some(remote), Some(handles)) =
        (remote, RemoteHandles::of(&mut host, assemble::slot_plan(config), &begun, timing))
    {
        // This fails only if the client has given up. It has then asked the run to end.
        let _ = remote.handles.send(handles);
    }
    let mut time_of_day = TimeOfDayKeeper::of(config);
    let mut time_request = None;
    let (mut panicked, mut is_watched) = (None, true);
    let mut taken_over_by = None;
    while !running.is_finished() && watchdog.stalled().is_none() {
        supervisor.poll(clock.now_ns(), &mut host);
        host.free_callbacks();
        let now_ns = clock.now_ns();
        let time = time_of_day.poll(now_ns, || WallClock::starting_now(now_ns));
        time_request = time.or(time_request).filter(|time| host.request(*time).is_err());
        if let Some(fault_injector) = &options.fault_injector {
            fault_injector.observe(&host.snapshot());
        }
        interfaces.attach_removed(now_ns);
        if let Some(process) = interfaces.poll_release_request() {
            taken_over_by = Some(process);
            supervisor.interrupt(Interrupt::Controlled);
        }
        let mut panics_now = None;
        if is_watched {
            // After a panic the function is not called again, so its broken state has no effect.
            match catch_unwind(AssertUnwindSafe(|| watch(&host.snapshot(), supervisor.progress()))) {
                Ok(interrupt) => interrupt.into_iter().for_each(|interrupt| supervisor.interrupt(interrupt)),
                Err(payload) => {
                    let message = panic_message(&*payload);
                    logger.incident(Incident::CallbackPanicked(message.clone()));
                    is_watched = false;
                    panics_now = Some(message);
                }
            }
        }
        if panicked.is_none() {
            panicked = panics_now.or_else(|| logger.panic().map(str::to_owned));
            if panicked.is_some() {
                // The engine empties the queue in every cycle. If it is full, the interrupt below disables the group as well.
                let _ = host.request(Request::Stop(StopCategory::One));
                supervisor.interrupt(Interrupt::Controlled);
            }
        }
        sleep_alignment::sleep(PAUSE, config.cycle.period_ns);
    }
    let stalled = watchdog.stalled().cloned();
    let last_resort = watchdog.end();
    // A loop that stands still is left alone.
    let ended = if stalled.is_none() { running.join() } else { None };
    supervisor.close_lines();
    // The ports are closed with the thread. What is left to be done here does not concern the buses.
    drop(interfaces);
    let broken = match (stalled, &ended) {
        (Some(Stalled { after, told }), _) => {
            logger.incident(Incident::Stalled);
            Some(Outcome::Stalled { after, told })
        }
        (None, None) => {
            logger.incident(Incident::ThreadDied);
            let told = last_resort.map(|last_resort| last_resort.stop_drives()).unwrap_or_default();
            Some(Outcome::ThreadDied { told })
        }
        (None, Some(_)) => None,
    };
    if broken.is_some() {
        supervisor.abandon();
    }
    let outcome = broken.or_else(|| supervisor.outcome().cloned());
    let outcome = match (outcome.unwrap_or(Outcome::ThreadDied { told: vec![] }), panicked, taken_over_by) {
        (Outcome::Interrupted | Outcome::Finished, Some(message), _) => Outcome::CallbackPanicked { message },
        (Outcome::Interrupted, None, Some(process)) => Outcome::TakenOver { process },
        (outcome, ..) => outcome,
    };
    let words = outcome.words(&Machine::of(config));
    info!(target: "takt::run", outcome = words.as_str(), "the run has ended: {words}");
    let is_done = matches!(
        outcome,
        Outcome::Finished | Outcome::OffTarget { .. } | Outcome::PositionNotReported { .. }
    );
    let has_arrived = is_done && options.duration_ns.is_none();
    Ok(Session {
        snapshot: host.snapshot(),
        targets: if has_arrived { supervisor.targets() } else { vec![] },
        unreached: supervisor.unreached().to_vec(),
        drive_errors: supervisor.drive_errors().to_vec(),
        outcome,
        begun,
        ended,
        open_ns: clock.now_ns().saturating_sub(started_ns),
        log: logger.finish(),
    })
}

fn open_ports(
    config: &Config,
    lines: &Lines,
    fault_injector: Option<&FaultInjector>,
    is_traced: bool,
    interfaces: &mut Interfaces,
) -> Result<(Vec<Port>, Vec<Trace>), OpenError> {
    let mut ports = Vec::with_capacity(config.buses.len());
    let mut traces = Vec::new();
    for (index, bus) in config.buses.iter().enumerate() {
        let port = match lines.port(index) {
            Some(line) => Port::Line(Box::new(line)),
            None => Port::open(config, index)?,
        };
        interfaces.keep_attached(config, index, &port);
        let (name, interface, bit_rate) = (bus.name.as_str(), bus.interface.to_string(), bus.bit_rate);
        info!(target: "takt::bus", bus = name, interface, bit_rate, "{name}: opened on {interface}");
        let port = match fault_injector {
            Some(fault_injector) => fault_injector.wrap(index, port),
            None => port,
        };
        ports.push(if is_traced {
            let (port, trace) = port.traced(&bus.name);
            traces.push(trace);
            port
        } else {
            port
        });
    }
    Ok((ports, traces))
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::thread;

    use takt_rt::{Phase, StopCategory};

    use super::*;
    use crate::link::ownership::{InterfaceLock, LockError, Role};

    /// Simulated buses need no lock: this one stands for that of a real interface.
    #[test]
    fn a_run_that_is_taken_over_stops_in_control_before_it_releases_its_buses() {
        let interface = format!("test-session-{}", std::process::id());
        let mut config = Config::load(Path::new("configs/single-erob.toml")).unwrap();
        config.telemetry.is_recorded = false;
        let ownership = Ownership::of_locks(vec![InterfaceLock::take(Role::Master, &interface).unwrap()]);
        let has_moved = AtomicBool::new(false);
        let session = thread::scope(|scope| {
            let taking = scope.spawn(|| {
                while !has_moved.load(Ordering::Relaxed) {
                    thread::sleep(PAUSE);
                }
                assert!(matches!(InterfaceLock::take(Role::Master, &interface), Err(LockError::Held(_))));
                InterfaceLock::take_over(Role::Master, &interface).unwrap()
            });
            // Without an end, so that only the other one ends it.
            let options = SessionOptions { duration_ns: Some(600_000_000_000), ..SessionOptions::default() };
            let watch = |snapshot: &Snapshot, _| {
                has_moved.fetch_or(snapshot.groups[0].phase == Phase::Moving, Ordering::Relaxed);
                None
            };
            let session = lead_as_owner(&config, options, Box::new(|_| {}), watch, None, ownership).unwrap();
            let _taken = taking.join().unwrap();
            session
        });
        let pid = i32::try_from(std::process::id()).unwrap();
        assert!(
            matches!(session.outcome, Outcome::TakenOver { process } if process.pid == pid),
            "{:?}",
            session.outcome
        );
        let stop = session.snapshot.groups[0].stop.expect("it was stopped");
        assert_eq!((stop.category, stop.phase), (StopCategory::Two, Phase::Moving));
        assert!(
            matches!(session.snapshot.groups[0].phase, Phase::Disabled | Phase::Passive),
            "{:?}",
            session.snapshot.groups[0].phase
        );
    }
}
