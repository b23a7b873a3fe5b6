//! `takt run`: the main job.

use std::io::{IsTerminal, stderr};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use takt::bus::schedule;
use takt::config::{Config, Interface, Master};
use takt::controller::realtime_thread::StartError;
use takt::controller::session::{self, Session, SessionError, SessionOptions};
use takt::controller::{Interrupt, Outcome, Progress};
use takt::faults::{Fault, Rehearsal, Scenario, ScenarioError, Tidings};
use takt::telemetry::{Destination, Machine, Notice, RealtimeReport, RunOutcome, RunReport, words};
use takt_rt::{Event, EventKind, Snapshot, StopReason};

use super::configuration::{self, BusOverride};
use super::exit::Exit;
use super::interruption;
use super::print;
use super::refusal::Refusal;

/// Bring the drives up, run the motion program of a configuration, stop in control, and report.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The configuration (TOML)
    config: PathBuf,
    /// Connect a bus to another interface than the configuration says: sim, can0, vcan0 …
    #[arg(long = "bus", value_name = "NAME=INTERFACE")]
    buses: Vec<BusOverride>,
    /// Repeat the program until this many seconds are over
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = configuration::seconds)]
    duration: Option<Duration>,
    /// Record to this file instead of a new one in the configured folder
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Play the faults of this scenario (TOML), to see what they lead to; configs/faults has examples
    #[arg(long, value_name = "FILE.toml")]
    faults: Option<PathBuf>,
    /// End with exit code 3 before anything moves if the system refuses a step of the real-time set-up
    #[arg(long)]
    require_realtime: bool,
    /// Print the report as one JSON object
    #[arg(long)]
    json: bool,
}

/// The report, and how the run ended.
#[derive(Serialize)]
struct Printed<'a> {
    #[serde(flatten)]
    report: &'a RunReport,
    /// `finished`, `interrupted`, `stopped` or `failed`.
    ended: &'static str,
    /// Why the run failed, in words, where it was not a stop of the group.
    failure: Option<String>,
    /// The axes whose drives could not be reached in the end.
    unreached: Vec<&'a str>,
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
    let config = match configuration::load(&arguments.config, &arguments.buses) {
        Ok(config) => config,
        Err(refusal) => return refusal.print(arguments.json),
    };
    if let Err(refused) = schedule::verify(&config) {
        return Refusal::from(refused.to_string()).print(arguments.json);
    }
    let rehearsal = match arguments.faults.as_deref().map(|path| rehearsal(path, &config)).transpose() {
        Ok(rehearsal) => rehearsal,
        Err(refusal) => return refusal.print(arguments.json),
    };
    let mut signals = match Signals::watch() {
        Ok(signals) => signals,
        Err(error) => {
            say!("takt: cannot watch for Ctrl-C: {error}");
            return Exit::Stopped;
        }
    };
    let bar = progress_bar(&config);
    let options = SessionOptions {
        duration_ns: arguments.duration.map(|duration| duration.as_nanos() as u64),
        recording: arguments.record.map(Destination::File),
        is_realtime_required: arguments.require_realtime,
        rehearsal: rehearsal.clone(),
    };
    let notify = notices(&bar, Machine::of(&config));
    let mut drawn = Drawn::new(bar.clone());
    let mut hints = Hints::new(&config);
    let mut tidings = Tidings::default();
    let mut tell = || {
        let news = rehearsal.as_deref().map_or_else(Vec::new, |rehearsal| tidings.next(rehearsal));
        news.iter().for_each(|tiding| bar.suspend(|| say!("takt: {tiding}")));
    };
    let session = session::run(&config, options, notify, |snapshot, progress| {
        drawn.show(&progress);
        hints.look(snapshot).for_each(|hint| bar.suspend(|| say!("takt: {hint}")));
        tell();
        signals.next()
    });
    tell();
    bar.finish_and_clear();
    match session {
        Ok(session) => report(&config, &session, arguments.json),
        Err(error) => refuse(&error, arguments.json),
    }
}

/// Reads a scenario. What a person should know before it is played on real drives is said.
fn rehearsal(path: &Path, config: &Config) -> Result<Arc<Rehearsal>, Refusal> {
    let scenario = Scenario::load(path, config).map_err(|error| match error {
        ScenarioError::Wrong(error) => Refusal::from(error),
        unreadable @ ScenarioError::Unreadable { .. } => unreadable.to_string().into(),
    })?;
    let is_real =
        |fault: &Fault| config.buses.get(fault.bus).is_some_and(|bus| bus.interface != Interface::Simulated);
    if let Some(fault) = scenario.faults.iter().find(|fault| is_real(fault)) {
        say!(
            "takt: fault `{}` (line {}) is played on real drives: keep away from them, and keep the emergency stop in \
             your hand",
            fault.kind,
            fault.line
        );
    }
    Ok(Arc::new(Rehearsal::new(scenario)))
}

fn refuse(error: &SessionError, is_json: bool) -> Exit {
    let SessionError::Start(StartError::Refused(report)) = error else {
        return Refusal::from(error.to_string()).print(is_json);
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
    let outcome = RunOutcome {
        realtime: RealtimeReport::new(&session.begun.report, spin_guard_ns, faults),
        last: session.snapshot,
        buses_open_ns: session.open_ns,
        targets: session.target.clone(),
        stop: stop_of(session),
    };
    let report = RunReport::new(&session.log, &outcome);
    let named = session.unreached.iter().filter_map(|axis| config.axes.get(*axis));
    let unreached: Vec<&str> = named.map(|axis| axis.name.as_str()).collect();
    if !unreached.is_empty() {
        say!("takt: {}", unreachable(&unreached, &config.master));
    }
    let failure = failure(&session.outcome, &session.log.machine);
    let (ended, exit) = match session.outcome {
        Outcome::Finished => ("finished", Exit::Done),
        Outcome::Interrupted => ("interrupted", Exit::Interrupted),
        Outcome::Stopped(_) => ("stopped", Exit::Stopped),
        _ => ("failed", Exit::Stopped),
    };
    if as_json {
        return print::json(&Printed { report: &report, ended, failure, unreached }, exit);
    }
    match failure {
        Some(failure) => {
            say!("takt: {failure}");
            report.telemetry.black_boxes.iter().for_each(|path| say!("black box: {}", path.display()));
            exit
        }
        None => print::text(&report.picture(print::emphasis()), exit),
    }
}

fn stop_of(session: &Session) -> Option<StopReason> {
    match session.outcome {
        Outcome::Stopped(stop) => Some(stop),
        Outcome::Interrupted => session.snapshot.stop,
        _ => None,
    }
}

/// What a person must know of drives that gave no answer any more.
fn unreachable(axes: &[&str], master: &Master) -> String {
    let by_themselves = match master.heartbeat_ns {
        Some(_) => format!(
            "each stops by itself {} ms after the last heartbeat that it has heard",
            master.heartbeat_timeout_ns / 1_000_000
        ),
        None => "nothing stops them, since `heartbeat` is off".to_owned(),
    };
    format!(
        "{}: no answer in the end, so it is not known whether they have stopped; {by_themselves}. Look before you come near, \
         and switch their power off before you repair the bus",
        axes.join(", ")
    )
}

/// What a report does not say by itself.
fn failure(outcome: &Outcome, machine: &Machine) -> Option<String> {
    let is_reported = matches!(outcome, Outcome::Finished | Outcome::Interrupted | Outcome::Stopped(_));
    (!is_reported).then(|| outcome.words(machine))
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

/// A progress bar that is redrawn some times a second at most, and only when it has changed.
struct Drawn {
    bar: ProgressBar,
    last: Option<(Instant, Progress)>,
}

impl Drawn {
    const INTERVAL: Duration = Duration::from_millis(100);

    fn new(bar: ProgressBar) -> Self {
        Self { bar, last: None }
    }

    fn show(&mut self, progress: &Progress) {
        if self.last.as_ref().is_some_and(|(at, _)| at.elapsed() < Self::INTERVAL) {
            return;
        }
        if let Some(fraction) = progress.fraction {
            self.bar.set_position((fraction * BAR_STEPS as f64) as u64);
        }
        self.bar.set_message(progress.what.clone());
        self.last = Some((Instant::now(), progress.clone()));
    }
}

/// Says once for each bus what is the likely cause of frames that find no room.
struct Hints {
    /// The buses that nothing has been said of.
    silent: Vec<(usize, String)>,
}

impl Hints {
    fn new(config: &Config) -> Self {
        Self { silent: config.buses.iter().map(|bus| bus.name.clone()).enumerate().collect() }
    }

    fn look(&mut self, snapshot: &Snapshot) -> impl Iterator<Item = String> {
        let has_overrun =
            |bus: &(usize, String)| snapshot.buses.get(bus.0).is_some_and(|health| health.tx_overruns > 0);
        let (said, silent) = std::mem::take(&mut self.silent).into_iter().partition(has_overrun);
        self.silent = silent;
        let said: Vec<(usize, String)> = said;
        said.into_iter().map(|(_, name)| {
            format!(
                "bus {name} takes no more frames: nobody acknowledges them. Is the drives' power on, is the bus \
                 terminated, is the bit rate right?"
            )
        })
    }
}

/// What is no part of an ordinary run.
fn is_urgent(event: &Event) -> bool {
    matches!(event.kind, EventKind::Stop(_) | EventKind::Emergency { .. } | EventKind::Rejected { .. })
}

/// Says at once what people should not have to wait for.
fn notices(bar: &ProgressBar, machine: Machine) -> Box<dyn FnMut(&Notice) + Send> {
    let bar = bar.clone();
    Box::new(move |notice| {
        let text = match notice {
            Notice::NotWritten(text) => format!("takt: {text}"),
            Notice::Event(event) if is_urgent(event) => words::event(event, &machine),
            Notice::Event(_) => return,
        };
        bar.suspend(|| say!("{text}"));
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_find_no_room_are_explained_once_for_each_bus() {
        let arm = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/arm6-erob.toml");
        let Ok(config) = Config::load(&arm) else { panic!("the example is sound") };
        let mut hints = Hints::new(&config);
        let mut snapshot = Snapshot::default();
        assert_eq!(hints.look(&snapshot).count(), 0);
        snapshot.buses[1].tx_overruns = 1;
        let said: Vec<String> = hints.look(&snapshot).collect();
        assert!(said.len() == 1 && said[0].starts_with("bus wrist "), "{said:?}");
        assert_eq!(hints.look(&snapshot).count(), 0);
        snapshot.buses[0].tx_overruns = 1;
        assert_eq!(hints.look(&snapshot).count(), 1);
    }
}
