//! `takt run`: the main job.

mod report;
mod watcher;

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use clap::Args;

use takt::config::{Config, Interface};
use takt::controller::session::{self, Session, SessionOptions};
use takt::controller::{Controller, StartFailure};
use takt::faults::{FaultInjector, Scenario, ScenarioError, ScenarioFault};
use takt::schedule;
use takt::telemetry::{EachCycle, Machine, Notice, RecordingDestination, RecordingOptions};
use takt_panel::{FrameSource, Listening, MetricsServer, PanelError};
use takt_remote::{Claim, ServeError, ServeOptions};
use takt_rt::Snapshot;
use takt_tools::monitor::BusDecoder;

use super::configuration::{self, BusOverride};
use super::exit::Exit;
use super::metrics::{self, Metrics};
use super::ownership;
use super::panel::{self, AccessArguments};
use super::service::Notifier;
use super::usage_error::UsageError;
use watcher::Watcher;

/// Bring the drives up, run the motion program of a configuration, stop in control, and report.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The configuration (TOML)
    config: PathBuf,
    /// Connect a bus to another interface than the configuration says: sim, can0, vcan0 …, slcan:/dev/ttyACM0,
    /// rs485-canfd:/dev/ttyUSB0
    #[arg(long = "bus", value_name = "[NAME=]INTERFACE")]
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
    #[arg(long, value_name = "ADDRESS", conflicts_with = "duration", value_parser = takt_panel::address)]
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

/// Runs it.
pub fn run(arguments: Arguments) -> Exit {
    let is_json = arguments.json;
    run_or_refuse(arguments).unwrap_or_else(|error| error.print(is_json))
}

fn run_or_refuse(arguments: Arguments) -> Result<Exit, UsageError> {
    let is_json = arguments.json;
    let (config, sources) = configuration::load_with_sources(&arguments.config, &arguments.buses)?;
    schedule::verify(&config).map_err(|refused| refused.to_string())?;
    config.warnings().iter().for_each(|warning| say!("takt: warning: {warning}"));
    let serve_options = ServeOptions::default().with_mode(arguments.serve_mode);
    let claim = |name| Claim::new(name, serve_options).map(|claim| (name, claim));
    // Before any drive is enabled.
    let serve = arguments.serve.as_deref().map(claim).transpose().map_err(|error| error.to_string())?;
    let listening = arguments.panel.map(|address| arguments.panel_access.listen(address)).transpose()?;
    let fault_injector = arguments.faults.as_deref().map(|path| fault_injector(path, &config)).transpose()?;
    let metrics = arguments.metrics.map(|_| Arc::new(Metrics::new(Machine::of(&config))));
    // It answers until the report is printed.
    let _answering = arguments.metrics.zip(metrics.as_ref()).map(answer_at).transpose()?;
    let mut watcher = Watcher::new(&config, metrics.clone(), fault_injector.clone())?;
    let bar = watcher.bar.clone();
    let notifier = Arc::clone(&watcher.notifier);
    let notify = watcher::notices(&bar, Machine::of(&config), metrics.clone(), arguments.duration.is_some());
    let options = SessionOptions {
        duration_ns: arguments.duration.map(|duration| duration.as_nanos() as u64),
        recording: arguments.record.map(RecordingDestination::File),
        recording_options: RecordingOptions {
            is_compressed: !arguments.record_uncompressed,
            size_limit_bytes: arguments.record_size_limit,
            keep: arguments.record_keep.map(|keep| keep as usize),
        },
        is_realtime_required: arguments.require_realtime,
        each_cycle: metrics.map(|metrics| -> EachCycle { Box::new(move |cycle| metrics.cycle(cycle)) }),
        fault_injector,
        if_owned: ownership::if_owned(arguments.take_over),
        frames: listening.as_ref().map(|_| Arc::default()),
        sources,
    };
    let session = if serve.is_none() && listening.is_none() {
        let session =
            session::run(&config, options, notify, |snapshot, progress| watcher.watch(snapshot, &progress));
        watcher.tell();
        session.map_err(|error| NoSession::from(StartFailure::from(error)))
    } else {
        offered(&config, options, notify, watcher, (serve, listening))
    };
    watcher::tell_manager(&notifier, Notifier::stop);
    bar.finish_and_clear();
    match session {
        Ok(session) => Ok(report::tell(&config, &session, is_json)),
        Err(NoSession::Start(StartFailure::NotEnabled(session))) => {
            Ok(report::tell(&config, &session, is_json))
        }
        Err(NoSession::Start(StartFailure::Session(error))) => Ok(report::refuse(&error, is_json)),
        Err(NoSession::Start(error)) => {
            UsageError::from(error.to_string()).print(is_json);
            Ok(Exit::Stopped)
        }
        Err(NoSession::Serve(error)) => Err(error.to_string().into()),
        Err(NoSession::Show(error)) => Err(error.to_string().into()),
    }
}

/// Begins to answer scrapers.
fn answer_at((address, metrics): (SocketAddr, &Arc<Metrics>)) -> Result<MetricsServer, UsageError> {
    let metrics = Arc::clone(metrics);
    let server = MetricsServer::begin(address, move || metrics.text())
        .map_err(|error| format!("the metrics cannot be served at {address}: {error}"))?;
    let bound = server.address();
    if !bound.ip().is_loopback() {
        say!("takt: whoever reaches {bound} can read the metrics");
    }
    say!("takt: metrics at http://{bound}/metrics");
    Ok(server)
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
    (serve, listening): (Option<(&str, Claim)>, Option<Listening>),
) -> Result<Session, NoSession> {
    let bar = watcher.bar.clone();
    let watch = move |snapshot: &Snapshot, progress| watcher.watch(snapshot, &progress);
    let decoders = (0..config.buses.len()).map(|bus| BusDecoder::of(config, bus)).collect();
    let frames = options.frames.clone().map(|feed| FrameSource { feed, decoders });
    let controller = Controller::start_watched(config.clone(), options, notify, watch)?;
    let (name, claim) = serve.unzip();
    let server = claim.map(|claim| claim.serve(controller.handle())).transpose();
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
    if let Some(name) = name {
        bar.suspend(|| say!("takt: served by the name {name}, until Ctrl-C"));
    }
    if let Some(panel) = &panel {
        bar.suspend(|| say!("takt: {}", panel::greeting(panel)));
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

/// Reads a scenario. Warns before faults are injected on real drives.
fn fault_injector(path: &Path, config: &Config) -> Result<Arc<FaultInjector>, UsageError> {
    let scenario = Scenario::load(path, config).map_err(|error| match error {
        ScenarioError::Wrong(error) => UsageError::from(error),
        error => error.to_string().into(),
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
