//! A controller in real time, from the configuration to what is left of the run.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use takt_rt::linux::MonotonicClock;
use takt_rt::{Clock, Request, Snapshot, StopCategory};

use super::assemble::{self, AssembleError};
use super::channels::{ChannelSizes, Observer, RequestNumbers, Streamer, channels};
use super::handle::WaitingRequests;
use super::outcome::{Interrupt, Outcome, Progress};
use super::quiet;
use super::realtime_thread::{self, Begun, Ended, StartError, Work};
use super::supervisor::Supervisor;
use super::time_of_day::TimeOfDayKeeper;
use crate::bus::port::{OpenError, Port};
use crate::bus::trace::Trace;
use crate::config::Config;
use crate::faults::Rehearsal;
use crate::telemetry::{
    BlackBoxOptions, Destination, Fault, LogSummary, Logger, LoggerOptions, LoggerThread, Machine, Notice,
    WallClock, panic_message,
};

/// A pause between two looks at the controller.
const PAUSE: Duration = Duration::from_millis(1);

/// What a run is asked for beside its configuration.
#[derive(Default)]
pub struct SessionOptions {
    /// Repeat the program until this time is over.
    pub duration_ns: Option<u64>,
    /// Where to record to, instead of where the configuration says.
    pub recording: Option<Destination>,
    /// Whether a refused step of the real-time set-up ends the run before anything moves.
    pub is_realtime_required: bool,
    /// Faults that are played on the buses.
    pub rehearsal: Option<Arc<Rehearsal>>,
}

/// What is left of a run.
#[derive(Clone, Debug)]
pub struct Session {
    /// How it ended.
    pub outcome: Outcome,
    /// The state after the last cycle.
    pub snapshot: Snapshot,
    /// Where the last move led (rad or m), an axis each; `None` if the program did not finish.
    pub target: Option<Vec<f64>>,
    /// The axes whose drives could not be reached in the end: see [`Supervisor::unreached`].
    pub unreached: Vec<usize>,
    /// What came of the real-time set-up.
    pub begun: Begun,
    /// How the loop was; `None` if the thread died.
    pub ended: Option<Ended>,
    /// How long the buses were open.
    pub open_ns: u64,
    /// What the logger leaves behind.
    pub log: LogSummary,
}

/// Why there was no run.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The configuration asks for what cannot be done.
    #[error(transparent)]
    Assemble(#[from] AssembleError),
    /// A bus cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The logger has no thread.
    #[error("the logger could not be started: {0}")]
    Logger(std::io::Error),
    /// The real-time thread does not run.
    #[error(transparent)]
    Start(#[from] StartError),
}

/// Runs the program of a configuration. `notify` hears what the logger has to say, from its thread. `watch` is called
/// about once in a millisecond with the newest state and what the run is doing, and may ask it to end.
///
/// When `notify` or `watch` panics, the panic is caught, that one is not called again, and the group stops in category 1;
/// the run then ends as [`Outcome::CallbackPanicked`].
///
/// # Errors
/// See [`SessionError`]; nothing has moved then.
pub fn run(
    config: &Config,
    options: SessionOptions,
    notify: Box<dyn FnMut(&Notice) + Send>,
    watch: impl FnMut(&Snapshot, Progress) -> Option<Interrupt>,
) -> Result<Session, SessionError> {
    lead(config, options, notify, watch, None)
}

/// Somebody who commands the group from another thread, in place of the program.
pub(super) struct Remote {
    /// What is asked of the group.
    pub requests: Arc<WaitingRequests>,
    /// Where the ways to see the state and to stream are handed out, and the numbers of requests, once the real-time
    /// thread runs.
    pub introduce: mpsc::SyncSender<(Observer, Streamer, RequestNumbers)>,
}

/// As [`run`]; with a remote, the group does what that asks for.
pub(super) fn lead(
    config: &Config,
    options: SessionOptions,
    notify: Box<dyn FnMut(&Notice) + Send>,
    mut watch: impl FnMut(&Snapshot, Progress) -> Option<Interrupt>,
    remote: Option<Remote>,
) -> Result<Session, SessionError> {
    let mut clock = MonotonicClock::default();
    let engine = Box::new(assemble::engine(config)?);
    let (ports, traces) = open_ports(config, options.rehearsal.as_deref())?;
    let (rt, mut host, log) = channels(&ChannelSizes::of(config));
    let mut supervisor = match remote {
        Some(_) => Supervisor::serving(config),
        None => Supervisor::new(config, options.duration_ns),
    };

    let own = |is_wanted: bool| is_wanted.then(|| Destination::Directory(config.telemetry.directory.clone()));
    let started_ns = clock.now_ns();
    let logger_options = LoggerOptions {
        machine: Machine::of(config),
        wall_clock: WallClock::starting_now(started_ns),
        started_ns,
        recording: options.recording.or_else(|| own(config.telemetry.is_recorded)),
        candump: own(config.telemetry.is_candump_written),
        black_box: config
            .telemetry
            .black_box_ns
            .map(|span_ns| BlackBoxOptions { span_ns, directory: config.telemetry.directory.clone() }),
        traces,
    };
    // The logger's thread starts before the real-time thread is elevated and inherits nothing of it.
    let logger =
        LoggerThread::start(Logger::new(log, logger_options, notify)).map_err(SessionError::Logger)?;
    let work = Work {
        engine,
        plan: assemble::slot_plan(config),
        ports,
        host: rt,
        spin_guard_ns: config.realtime.spin_guard_ns,
        is_realtime_required: options.is_realtime_required,
    };
    let running = match realtime_thread::start(realtime_thread::thread_config(&config.realtime), work) {
        Ok(running) => running,
        Err(error) => {
            logger.finish();
            return Err(error.into());
        }
    };
    let begun = running.begun();
    if let (Some(remote), Some(streamer)) = (&remote, host.take_streamer()) {
        // Whoever no longer waits for it has given up; the run then ends as it was told to.
        let _ = remote.introduce.send((host.observer(), streamer, host.numbers()));
    }
    let mut time_of_day = TimeOfDayKeeper::of(config);
    let mut time_to_tell = None;
    let (mut panicked, mut is_watched) = (None, true);
    while !running.is_finished() {
        supervisor.poll(clock.now_ns(), &mut host);
        let now_ns = clock.now_ns();
        let time = time_of_day.poll(now_ns, || WallClock::starting_now(now_ns));
        time_to_tell = time.or(time_to_tell).filter(|time| host.request(*time).is_err());
        if let Some(remote) = &remote {
            remote.requests.hand_over(|asked| host.ask(asked).is_ok());
        }
        if let Some(rehearsal) = &options.rehearsal {
            rehearsal.observe(&host.snapshot());
        }
        let mut panics_now = None;
        if is_watched {
            // What the caller's function has left half done is the caller's; it is not called again.
            match catch_unwind(AssertUnwindSafe(|| watch(&host.snapshot(), supervisor.progress()))) {
                Ok(interrupt) => interrupt.into_iter().for_each(|interrupt| supervisor.interrupt(interrupt)),
                Err(payload) => {
                    let message = panic_message(&*payload);
                    logger.fault(Fault::CallbackPanicked(message.clone()));
                    is_watched = false;
                    panics_now = Some(message);
                }
            }
        }
        if panicked.is_none() {
            panicked = panics_now.or_else(|| logger.panic().map(str::to_owned));
            if panicked.is_some() {
                // The queue is emptied in every cycle; were it full, the way out below disables the group as well.
                let _ = host.request(Request::Stop(StopCategory::One));
                supervisor.interrupt(Interrupt::Controlled);
            }
        }
        quiet::sleep(PAUSE, config.cycle.period_ns);
    }
    let ended = running.join();
    if ended.is_none() {
        logger.fault(Fault::ThreadDied);
    }
    let outcome = match (supervisor.outcome().cloned().unwrap_or(Outcome::ThreadDied), panicked) {
        (Outcome::Interrupted | Outcome::Finished, Some(message)) => Outcome::CallbackPanicked { message },
        (outcome, _) => outcome,
    };
    let target =
        supervisor.target().filter(|_| outcome == Outcome::Finished && options.duration_ns.is_none());
    Ok(Session {
        snapshot: host.snapshot(),
        target: target.map(<[f64]>::to_vec),
        unreached: supervisor.unreached().to_vec(),
        outcome,
        begun,
        ended,
        open_ns: clock.now_ns().saturating_sub(started_ns),
        log: logger.finish(),
    })
}

fn open_ports(config: &Config, rehearsal: Option<&Rehearsal>) -> Result<(Vec<Port>, Vec<Trace>), OpenError> {
    let mut ports = Vec::with_capacity(config.buses.len());
    let mut traces = Vec::new();
    let is_traced = config.telemetry.is_candump_written || config.telemetry.black_box_ns.is_some();
    for (index, bus) in config.buses.iter().enumerate() {
        let port = Port::open(config, index)?;
        let port = match rehearsal {
            Some(rehearsal) => rehearsal.wrap(index, port),
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
