//! `takt run`: the main job.

use std::io::{IsTerminal, stderr};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::config::{Axis, Config, Interface, Master};
use crate::controller::realtime_thread::StartError;
use crate::controller::session::{self, Session, SessionError, SessionOptions};
use crate::controller::{Controller, Interrupt, Outcome, Progress, StartFailure};
use crate::family;
use crate::faults::{FaultEvents, FaultInjector, Scenario, ScenarioError, ScenarioFault};
use crate::monitor::BusDecoder;
use crate::panel::{FrameSource, Listening, PanelError};
use crate::remote::now_ns;
use crate::schedule;
use crate::serve::{self, ServeError, ServeOptions};
use crate::telemetry::{
    EachCycle, Machine, Notice, RealtimeReport, RecordingDestination, RecordingOptions, RunEnd, RunOutcome,
    RunReport, words,
};
use takt_rt::{Event, EventKind, Fault, Snapshot, StopReason};

use super::configuration::{self, BusOverride};
use super::exit::Exit;
use super::full_queue::{self, FullQueues};
use super::interruption;
use super::metrics::{self, Metrics};
use super::ownership;
use super::panel::{self, AccessArguments};
use super::print;
use super::service::Notifier;
use super::usage_error::UsageError;

/// Bring the drives up, run the motion program of a configuration, stop in control, and report.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The configuration (TOML)
    config: PathBuf,
    /// Connect a bus to another interface than the configuration says: sim, can0, vcan0 …, slcan:/dev/ttyACM0,
    /// rs485-canfd:/dev/ttyUSB0
    #[arg(long = "bus", value_name = "NAME=INTERFACE")]
    buses: Vec<BusOverride>,
    /// Repeat the program until this many seconds are over
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = configuration::seconds)]
    duration: Option<Duration>,
    /// Record to this file instead of a new one in the configured folder
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Begin the next file of the recording when one has this size: 64M, 2G. The files are numbered: run.0001.mcap
    #[arg(long, value_name = "SIZE", allow_hyphen_values = true, value_parser = recording_size)]
    record_size_limit: Option<u64>,
    /// Keep so many files of the recording, the newest ones, and remove older ones
    #[arg(long, value_name = "N", requires = "record_size_limit", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=9999))]
    record_keep: Option<u32>,
    /// Do not compress the recording and the black box (zstd)
    #[arg(long)]
    record_uncompressed: bool,
    /// Play the faults of this scenario (TOML), to see what they lead to; configs/faults has examples
    #[arg(long, value_name = "FILE.toml")]
    faults: Option<PathBuf>,
    /// Let other processes observe and command the controller by this name until Ctrl-C, instead of running the program
    #[arg(long, value_name = "NAME", conflicts_with = "duration")]
    serve: Option<String>,
    /// Who may observe (read) and command (write) the served controller, as file permissions
    #[arg(long, value_name = "MODE", default_value = "600", requires = "serve", value_parser = permissions)]
    serve_mode: u32,
    /// Tell Prometheus at http://ADDRESS/metrics how the run goes: HOST:PORT, or a port of this computer alone, as 9464. Whoever reaches the
    /// address can read
    #[arg(long, value_name = "ADDRESS", value_parser = metrics::address)]
    metrics: Option<SocketAddr>,
    /// Show and command the controller in the browser until Ctrl-C, instead of running the program: a host and a port, or a port on
    /// loopback
    #[arg(long, value_name = "ADDRESS", conflicts_with = "duration", value_parser = crate::panel::address)]
    panel: Option<SocketAddr>,
    #[command(flatten)]
    panel_access: AccessArguments,
    /// Have another takt of this host that commands one of the buses stop in control first, and take them over
    #[arg(long)]
    take_over: bool,
    /// End with exit code 3 before anything moves if the system refuses a step of the real-time set-up
    #[arg(long)]
    require_realtime: bool,
    /// Print the report as one JSON object
    #[arg(long)]
    json: bool,
}

/// The report, with what is known beside it.
#[derive(Serialize)]
struct Printed<'a> {
    #[serde(flatten)]
    report: &'a RunReport,
    /// Why the run ended, in words, where it was neither its end, nor Ctrl-C, nor a stop of the group.
    failure: Option<String>,
    /// The axes whose drives could not be reached in the end.
    unreached: Vec<&'a str>,
    /// The errors that drives showed in the end.
    drive_errors: Vec<DriveError>,
}

/// The error that a drive shows.
#[derive(Serialize)]
struct DriveError {
    axis: String,
    error: String,
    cure: &'static str,
}

/// Real-time set-up that was required and refused, as an object.
#[derive(Serialize)]
struct PrintedRefusal<'a> {
    error: String,
    problems: [(); 0],
    realtime: &'a RealtimeReport,
}

/// Runs it.
pub fn run(arguments: Arguments) -> Exit {
    let (config, sources) = match configuration::load_with_sources(&arguments.config, &arguments.buses) {
        Ok(loaded) => loaded,
        Err(error) => return error.print(arguments.json),
    };
    if let Err(refused) = schedule::verify(&config) {
        return UsageError::from(refused.to_string()).print(arguments.json);
    }
    config.warnings().iter().for_each(|warning| say!("takt: warning: {warning}"));
    let serve_options = ServeOptions::default().with_mode(arguments.serve_mode);
    if let Some(Err(error)) = arguments.serve.as_ref().map(|name| serve::verify(name, &serve_options)) {
        return UsageError::from(error.to_string()).print(arguments.json);
    }
    let listening = arguments.panel.map(|address| arguments.panel_access.listen(address)).transpose();
    let listening = match listening {
        Ok(listening) => listening,
        Err(error) => return error.print(arguments.json),
    };
    let fault_injector =
        match arguments.faults.as_deref().map(|path| fault_injector(path, &config)).transpose() {
            Ok(fault_injector) => fault_injector,
            Err(error) => return error.print(arguments.json),
        };
    let metrics = arguments.metrics.map(|_| Arc::new(Metrics::new(Machine::of(&config))));
    // It answers until the report is printed.
    let _answering = match arguments.metrics.zip(metrics.as_ref()).map(|(at, metrics)| answer_at(at, metrics))
    {
        None => None,
        Some(Ok(server)) => Some(server),
        Some(Err(error)) => return error.print(arguments.json),
    };
    let signals = match Signals::watch() {
        Ok(signals) => signals,
        Err(error) => {
            say!("takt: cannot watch for Ctrl-C: {error}");
            return Exit::Stopped;
        }
    };
    let bar = progress_bar(&config);
    let options = SessionOptions {
        duration_ns: arguments.duration.map(|duration| duration.as_nanos() as u64),
        recording: arguments.record.map(RecordingDestination::File),
        recording_options: RecordingOptions {
            is_compressed: !arguments.record_uncompressed,
            size_limit_bytes: arguments.record_size_limit,
            keep: arguments.record_keep.map(|keep| keep as usize),
        },
        is_realtime_required: arguments.require_realtime,
        each_cycle: metrics
            .clone()
            .map(|metrics| -> EachCycle { Box::new(move |cycle| metrics.cycle(cycle)) }),
        fault_injector: fault_injector.clone(),
        if_owned: ownership::if_owned(arguments.take_over),
        frames: listening.as_ref().map(|_| Arc::default()),
        sources,
    };
    let notify = notices(&bar, Machine::of(&config), metrics.clone());
    let notifier = Arc::new(Mutex::new(Notifier::of_environment(&Machine::of(&config))));
    let mut watcher = Watcher {
        throttled_bar: ThrottledBar::new(bar.clone(), Machine::of(&config)),
        full_queues: FullQueues::new(&config),
        fault_injector,
        fault_events: FaultEvents::default(),
        signals,
        bar: bar.clone(),
        metrics,
        notifier: Arc::clone(&notifier),
    };
    let session = if arguments.serve.is_none() && listening.is_none() {
        let session =
            session::run(&config, options, notify, |snapshot, progress| watcher.watch(snapshot, &progress));
        watcher.tell();
        session.map_err(|error| NoSession::from(StartFailure::from(error)))
    } else {
        let serve = arguments.serve.as_deref().map(|name| (name, serve_options));
        offered(&config, options, notify, watcher, (serve, listening))
    };
    tell_manager(&notifier, Notifier::stop);
    bar.finish_and_clear();
    match session {
        Ok(session) => report(&config, &session, arguments.json),
        Err(NoSession::Start(StartFailure::NotEnabled(session))) => report(&config, &session, arguments.json),
        Err(NoSession::Start(StartFailure::Session(error))) => refuse(&error, arguments.json),
        Err(NoSession::Start(error)) => {
            say!("takt: {error}");
            Exit::Stopped
        }
        Err(NoSession::Serve(error)) => UsageError::from(error.to_string()).print(arguments.json),
        Err(NoSession::Show(error)) => UsageError::from(error.to_string()).print(arguments.json),
    }
}

/// Begins to answer scrapers.
fn answer_at(address: SocketAddr, metrics: &Arc<Metrics>) -> Result<metrics::Server, UsageError> {
    let (server, bound) = metrics
        .serve(address)
        .map_err(|error| format!("the metrics cannot be served at {address}: {error}"))?;
    if !bound.ip().is_loopback() {
        say!("takt: whoever reaches {bound} can read the metrics");
    }
    say!("takt: metrics at http://{bound}/metrics");
    Ok(server)
}

/// Tells the service manager, if there is one.
fn tell_manager(notifier: &Mutex<Option<Notifier>>, tell: impl FnOnce(&mut Notifier)) {
    // A panic of another holder of the lock leaves what was told.
    if let Some(notifier) = notifier.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
        tell(notifier);
    }
}

/// Why a run has no result.
enum NoSession {
    Start(StartFailure),
    Serve(ServeError),
    Show(PanelError),
}

impl From<StartFailure> for NoSession {
    fn from(error: StartFailure) -> Self {
        Self::Start(error)
    }
}

/// Offers the controller to other processes, and in the browser, until it is interrupted.
fn offered(
    config: &Config,
    options: SessionOptions,
    notify: Box<dyn FnMut(&Notice) + Send>,
    mut watcher: Watcher,
    (serve, listening): (Option<(&str, ServeOptions)>, Option<Listening>),
) -> Result<Session, NoSession> {
    let bar = watcher.bar.clone();
    let watch = move |snapshot: &Snapshot, progress| watcher.watch(snapshot, &progress);
    let decoders = (0..config.buses.len()).map(|bus| BusDecoder::of(config, bus)).collect();
    let frames = options.frames.clone().map(|feed| FrameSource { feed, decoders });
    let controller = Controller::start_watched(config.clone(), options, notify, watch)?;
    let server = serve
        .as_ref()
        .map(|(name, options)| serve::serve(controller.handle(), name, options.clone()))
        .transpose();
    let panel = listening.map(|listening| listening.show(controller.handle(), None, frames)).transpose();
    let (_server, panel) = match (server, panel) {
        (Ok(server), Ok(panel)) => (server, panel),
        (Err(error), _) => {
            controller.finish()?;
            return Err(NoSession::Serve(error));
        }
        (_, Err(error)) => {
            controller.finish()?;
            return Err(NoSession::Show(error));
        }
    };
    if let Some((name, _)) = serve {
        bar.suspend(|| say!("takt: served by the name {name}, until Ctrl-C"));
    }
    if let Some(panel) = &panel {
        bar.suspend(|| say!("takt: {}", panel::greeting(panel.address())));
    }
    Ok(controller.ended()?)
}

/// The size of a file: a number of bytes, or of KiB, MiB or GiB.
fn recording_size(text: &str) -> Result<u64, String> {
    let (number, unit) = match text.char_indices().last() {
        Some((at, letter)) if letter.is_ascii_alphabetic() => (&text[..at], letter.to_ascii_uppercase()),
        _ => (text, 'B'),
    };
    let shift = ['B', 'K', 'M', 'G'].iter().position(|known| *known == unit).map(|power| 10 * power);
    let bytes =
        number.parse::<u64>().ok().zip(shift).and_then(|(number, shift)| number.checked_mul(1 << shift));
    match bytes {
        None => Err("a size is a whole number of bytes, or of K, M or G, as in 64M".to_owned()),
        Some(bytes) if bytes < RecordingOptions::SMALLEST_LIMIT_BYTES => {
            Err("a file of a recording needs 1M at least".to_owned())
        }
        Some(bytes) => Ok(bytes),
    }
}

/// File permissions, in octal.
fn permissions(text: &str) -> Result<u32, String> {
    u32::from_str_radix(text, 8).map_err(|_| "file permissions are octal digits, as in 640".to_owned())
}

/// What is looked at and told during a run.
struct Watcher {
    throttled_bar: ThrottledBar,
    full_queues: FullQueues,
    fault_injector: Option<Arc<FaultInjector>>,
    fault_events: FaultEvents,
    signals: Signals,
    bar: ProgressBar,
    metrics: Option<Arc<Metrics>>,
    notifier: Arc<Mutex<Option<Notifier>>>,
}

impl Watcher {
    fn watch(&mut self, snapshot: &Snapshot, progress: &Progress) -> Option<Interrupt> {
        if self.throttled_bar.show(progress, snapshot)
            && let Some(metrics) = &self.metrics
        {
            metrics.state(snapshot);
        }
        tell_manager(&self.notifier, |notifier| notifier.look(now_ns(), snapshot, progress));
        let Self { full_queues, bar, .. } = self;
        full_queues.poll(snapshot).for_each(|hint| bar.suspend(|| say!("takt: {hint}")));
        self.tell();
        self.signals.next()
    }

    /// Tells which faults were injected since the last call.
    fn tell(&mut self) {
        let Some(fault_injector) = self.fault_injector.as_deref() else { return };
        for fault_event in self.fault_events.next(fault_injector) {
            self.bar.suspend(|| say!("takt: {fault_event}"));
        }
    }
}

/// Reads a scenario. Warns before faults are injected on real drives.
fn fault_injector(path: &Path, config: &Config) -> Result<Arc<FaultInjector>, UsageError> {
    let scenario = Scenario::load(path, config).map_err(|error| match error {
        ScenarioError::Wrong(error) => UsageError::from(error),
        unreadable @ ScenarioError::Unreadable { .. } => unreadable.to_string().into(),
    })?;
    let is_real = |fault: &ScenarioFault| {
        config.buses.get(fault.bus).is_some_and(|bus| bus.interface != Interface::Simulated)
    };
    if let Some(fault) = scenario.faults.iter().find(|fault| is_real(fault)) {
        say!(
            "takt: fault `{}` (line {}) is played on real drives: keep away from them, and keep the emergency stop in \
             your hand",
            fault.kind,
            fault.line
        );
    }
    Ok(Arc::new(FaultInjector::new(scenario)))
}

fn refuse(error: &SessionError, is_json: bool) -> Exit {
    let report = match error {
        SessionError::Start(StartError::Refused(report)) => report,
        SessionError::Claim(error) => return ownership::usage_error(error).print(is_json),
        error => return UsageError::from(error.to_string()).print(is_json),
    };
    let realtime = RealtimeReport::new(report, 0, 0);
    if is_json {
        let printed = PrintedRefusal { error: error.to_string(), problems: [], realtime: &realtime };
        return print::indented_json(&printed, Exit::RealtimeRefused);
    }
    say!("takt: {error}");
    realtime.refused.iter().for_each(|refused| say!("  refused: {refused}"));
    realtime.grant_with.iter().for_each(|command| say!("  grant it with: {command}"));
    Exit::RealtimeRefused
}

fn report(config: &Config, session: &Session, as_json: bool) -> Exit {
    let faults = session.ended.map_or(0, |ended| ended.page_faults.minor + ended.page_faults.major);
    let spin_guard_ns = session.ended.map_or(0, |ended| ended.spin_guard_ns);
    let (ended, exit) = match session.outcome {
        Outcome::Finished => (RunEnd::Finished, Exit::Done),
        Outcome::Interrupted => (RunEnd::Interrupted, Exit::Interrupted),
        Outcome::TakenOver { .. } => (RunEnd::TakenOver, Exit::Interrupted),
        Outcome::Stopped(_) => (RunEnd::Stopped, Exit::Stopped),
        _ => (RunEnd::Failed, Exit::Stopped),
    };
    let outcome = RunOutcome {
        ended,
        realtime: RealtimeReport::new(&session.begun.report, spin_guard_ns, faults),
        last: session.snapshot,
        buses_open_ns: session.open_ns,
        targets: session.targets.clone(),
        stop: stop_of(session),
    };
    let report = RunReport::new(&session.log, &outcome);
    let named: Vec<&Axis> = session.unreached.iter().filter_map(|axis| config.axes.get(*axis)).collect();
    let (on_line, on_bus): (Vec<&Axis>, Vec<&Axis>) =
        named.iter().partition(|axis| axis.drive.protocol.is_of_serial_line());
    let unreached: Vec<&str> = named.iter().map(|axis| axis.name.as_str()).collect();
    let on_bus: Vec<&str> = on_bus.iter().map(|axis| axis.name.as_str()).collect();
    if !on_bus.is_empty() {
        say!("takt: {}", unreachable(&on_bus, &by_themselves(&config.master)));
    }
    for axis in on_line {
        say!("takt: {}", unreachable(&[axis.name.as_str()], &by_itself(axis, config)));
    }
    let drive_errors = drive_errors(session);
    drive_errors.iter().for_each(|DriveError { axis, error, cure }| {
        say!("takt: {axis}: the drive shows {error}; try: {cure}");
    });
    let failure = failure(config, session);
    let exit = if report.telemetry.not_written.is_empty() { exit } else { exit.and_failed() };
    if as_json {
        return print::json(&Printed { report: &report, failure, unreached, drive_errors }, exit);
    }
    match failure {
        Some(failure) if ended == RunEnd::TakenOver => {
            say!("takt: {failure}");
            print::text(&report.render(print::emphasis()), exit)
        }
        Some(failure) => {
            say!("takt: {failure}");
            report.telemetry.black_boxes.iter().for_each(|path| say!("black box: {}", path.display()));
            exit
        }
        None => print::text(&report.render(print::emphasis()), exit),
    }
}

/// The errors of the drives that the stop does not tell already.
fn drive_errors(session: &Session) -> Vec<DriveError> {
    let machine = &session.log.machine;
    let told = stop_of(session).and_then(|stop| Some((stop.axis()?, stop.cause.fault().copied()?)));
    let is_told = |axis, code| told == Some((axis, Fault::DriveFault { error_code: code }));
    let errors =
        session.drive_errors.iter().filter_map(|(axis, code)| Some((u8::try_from(*axis).ok()?, *code)));
    let errors = errors.filter(|(axis, code)| !is_told(*axis, *code));
    let error = |(axis, code)| DriveError {
        axis: machine.axis_name(axis),
        error: machine.drive_error(axis, code),
        cure: machine.drive_cure(axis, code),
    };
    errors.map(error).collect()
}

fn stop_of(session: &Session) -> Option<StopReason> {
    match session.outcome {
        Outcome::Stopped(stop) => Some(stop),
        Outcome::Interrupted | Outcome::TakenOver { .. } => session.snapshot.first_stop(),
        _ => None,
    }
}

/// What a drive on a serial line does without its master.
fn by_itself(axis: &Axis, config: &Config) -> String {
    let watchdog_ns =
        family::of(&axis.drive).off_cycle_budget(axis, config).and_then(|budget| budget.watchdog_ns);
    watchdog_ns.map_or("nothing stops it, since its communication time-out is off".to_owned(), |ns| {
        format!(
            "its communication time-out is over {} ms after the last request that it has heard",
            ns / 1_000_000
        )
    })
}

/// What drives on a CAN bus do without their master.
fn by_themselves(master: &Master) -> String {
    match master.heartbeat_ns {
        Some(_) => format!(
            "each stops by itself {} ms after the last heartbeat that it has heard",
            master.heartbeat_timeout_ns / 1_000_000
        ),
        None => "nothing stops them, since `heartbeat` is off".to_owned(),
    }
}

/// The warning about drives that no longer answered.
fn unreachable(axes: &[&str], by_themselves: &str) -> String {
    format!(
        "{}: no answer in the end, so it is not known whether they have stopped; {by_themselves}. Make sure of that before you come near, \
         and switch their power off before you repair the bus",
        axes.join(", ")
    )
}

/// Why the run ended, where the report does not say it.
fn failure(config: &Config, session: &Session) -> Option<String> {
    let words = session.outcome.words(&session.log.machine);
    match session.outcome {
        Outcome::Finished | Outcome::Interrupted | Outcome::Stopped(_) => None,
        Outcome::BringUpFailed(_) | Outcome::NotHeard { .. } | Outcome::Stuck { .. } => {
            // A drive cannot answer a frame that it was not sent.
            Some(
                full_queue::cause(config, &session.snapshot)
                    .map_or(words.clone(), |cause| format!("{words}; {cause}")),
            )
        }
        _ => Some(words),
    }
}

/// Ctrl-C and SIGTERM. The first asks for a controlled stop, the second for an immediate one.
struct Signals {
    arrived: Arc<AtomicBool>,
    next: Interrupt,
}

impl Signals {
    fn watch() -> std::io::Result<Self> {
        Ok(Self { arrived: interruption::watch()?, next: Interrupt::Controlled })
    }

    fn next(&mut self) -> Option<Interrupt> {
        let has_arrived = self.arrived.swap(false, Ordering::Relaxed);
        has_arrived.then(|| std::mem::replace(&mut self.next, Interrupt::Immediate))
    }
}

const BAR_STEPS: u64 = 1000;

fn progress_bar(config: &Config) -> ProgressBar {
    if !stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(BAR_STEPS);
    if let Ok(style) = ProgressStyle::with_template("{prefix}  [{bar:40}]  {elapsed}  {wide_msg}") {
        bar.set_style(style.progress_chars("━╸─"));
    }
    bar.set_prefix(config.name.clone());
    bar
}

/// A progress bar that is updated at most ten times a second.
struct ThrottledBar {
    bar: ProgressBar,
    machine: Machine,
    last: Option<(Instant, Progress)>,
}

impl ThrottledBar {
    const INTERVAL: Duration = Duration::from_millis(100);

    fn new(bar: ProgressBar, machine: Machine) -> Self {
        Self { bar, machine, last: None }
    }

    /// Returns whether it was time for it.
    fn show(&mut self, progress: &Progress, snapshot: &Snapshot) -> bool {
        if self.last.as_ref().is_some_and(|(at, _)| at.elapsed() < Self::INTERVAL) {
            return false;
        }
        if let Some(fraction) = progress.fraction {
            self.bar.set_position((fraction * BAR_STEPS as f64) as u64);
        }
        let silence =
            words::silence(snapshot, &self.machine).map_or(String::new(), |text| format!("; {text}"));
        self.bar.set_message(format!("{}{silence}", progress.what));
        self.last = Some((Instant::now(), progress.clone()));
        true
    }
}

/// Whether an event is not part of an ordinary run.
fn is_urgent(event: &Event) -> bool {
    matches!(event.kind, EventKind::Stop(_) | EventKind::Emergency { .. } | EventKind::Rejected { .. })
}

/// Prints messages that must not wait for the end of the run.
fn notices(
    bar: &ProgressBar,
    machine: Machine,
    metrics: Option<Arc<Metrics>>,
) -> Box<dyn FnMut(&Notice) + Send> {
    let bar = bar.clone();
    Box::new(move |notice| {
        if let (Notice::Event(event), Some(metrics)) = (notice, &metrics) {
            metrics.event(event);
        }
        let text = match notice {
            Notice::NotWritten(text) => format!("takt: {text}"),
            Notice::Event(event) if is_urgent(event) => words::event(event, &machine),
            Notice::Event(_) => return,
        };
        bar.suspend(|| say!("{text}"));
    })
}
