//! What takt tells `tracing`: its order and its fields, in virtual time, and the program's option `--log`.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::{Arc, Mutex};

use takt::telemetry::{
    LogSide, Logger, LoggerOptions, Machine, RecordingDestination, RecordingOptions, WallClock,
};
use takt::{Config, FaultInjector, Outcome, Scenario, VirtualRun};
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};

const CYCLES_AT_MOST: u64 = 20_000;

/// Something that was told.
#[derive(Clone, Debug)]
struct Told {
    level: Level,
    target: String,
    fields: BTreeMap<&'static str, String>,
}

impl Told {
    fn field(&self, name: &str) -> &str {
        self.fields.get(name).map_or("", String::as_str)
    }
}

impl Visit for Told {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        self.fields.insert(field.name(), format!("{value:?}"));
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        self.fields.insert(field.name(), value.to_owned());
    }
}

/// Keeps all that is told.
#[derive(Clone, Default)]
struct Collector(Arc<Mutex<Vec<Told>>>);

impl Subscriber for Collector {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target().starts_with("takt")
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, event: &Event<'_>) {
        let metadata = event.metadata();
        let mut told =
            Told { level: *metadata.level(), target: metadata.target().to_owned(), fields: BTreeMap::new() };
        event.record(&mut told);
        self.0.lock().unwrap().push(told);
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

/// All that is told while this is done.
fn told_by(work: impl FnOnce()) -> Vec<Told> {
    let collector = Collector::default();
    tracing::subscriber::with_default(collector.clone(), work);
    collector.0.lock().unwrap().clone()
}

fn first() -> Config {
    Config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/first.toml")).unwrap()
}

fn logger(config: &Config, log: LogSide, recording: RecordingDestination) -> Logger {
    let options = LoggerOptions {
        machine: Machine::of(config),
        wall_clock: WallClock::fixed(0),
        started_ns: 0,
        recording: Some(recording),
        recording_options: RecordingOptions::default(),
        candump: None,
        black_box: None,
        traces: vec![],
    };
    Logger::new(log, options, Box::new(|_| {}))
}

/// Runs the program of the configuration, with the logger beside it.
fn run(config: &Config, faults: &str) -> (Vec<Told>, Option<Outcome>) {
    let scenario = if faults.is_empty() {
        Scenario::default()
    } else {
        Scenario::parse("faults", faults, config).unwrap()
    };
    let mut outcome = None;
    let told = told_by(|| {
        let injector = Arc::new(FaultInjector::new(scenario));
        let (mut run, log) = VirtualRun::with_faults(config, injector).unwrap();
        let recording = RecordingDestination::Stream("a recording".to_owned(), Box::new(std::io::sink()));
        let mut logger = logger(config, log, recording);
        outcome = run.run(CYCLES_AT_MOST, |_| {
            logger.drain();
        });
        logger.finish();
    });
    (told, outcome)
}

/// The values of a field of what has this target, in their order.
fn values<'a>(told: &'a [Told], target: &str, field: &str) -> Vec<&'a str> {
    let of_target = told.iter().filter(|told| told.target == target);
    of_target.map(|told| told.field(field)).filter(|value| !value.is_empty()).collect()
}

#[test]
fn a_run_tells_its_stages_and_phases_and_its_recording_in_their_order() {
    let (told, outcome) = run(&first(), "");
    assert_eq!(outcome, Some(Outcome::Finished));
    let stages = ["start", "activate", "enable", "run", "settle", "disable", "shut down", "done"];
    assert_eq!(values(&told, "takt::run", "stage"), stages);
    let phases = ["disabled", "enabling", "holding", "moving", "holding", "disabling", "disabled"];
    assert_eq!(values(&told, "takt::run", "to"), phases);
    let done = |told: &&Told| told.target == "takt::bring_up" && told.level == Level::INFO;
    let parts: Vec<&str> = told.iter().filter(done).map(|told| told.field("stage")).collect();
    assert_eq!(parts, ["configure", "start", "shut down"]);
    let of_bring_up = told.iter().find(|told| told.target == "takt::bring_up").unwrap();
    assert_eq!(["axis", "bus", "node"].map(|name| of_bring_up.field(name)), ["joint", "can", "1"]);
    assert!(!of_bring_up.field("step").is_empty(), "{of_bring_up:?}");
    let (begin, end) = (told.first().unwrap(), told.last().unwrap());
    assert_eq!((begin.target.as_str(), begin.field("file")), ("takt::recording", "a recording"));
    assert_eq!((end.target.as_str(), end.field("kind")), ("takt::recording", "recording"));
    assert!(told.iter().all(|told| told.level > Level::WARN), "{told:#?}");
}

#[test]
fn a_stop_for_a_fault_is_an_error_with_its_rule_its_axis_and_its_reason() {
    let fault = "[[fault]]\nkind = \"over-current\"\naxis = \"joint\"\nwhen = \"moving\"\nat = \"0.2 s\"\n";
    let (told, outcome) = run(&first(), fault);
    assert!(matches!(outcome, Some(Outcome::Stopped(_))), "{outcome:?}");
    let of_run = || told.iter().filter(|told| told.target == "takt::run");
    let stop = of_run().find(|told| told.level == Level::ERROR).unwrap();
    assert_eq!(stop.field("axis"), "joint");
    assert_eq!(stop.field("rule"), "drive_fault");
    assert!(stop.field("reason").contains("joint"), "{stop:?}");
    assert!(stop.field("slot").parse::<u64>().is_ok(), "{stop:?}");
    let faulted = of_run().find(|told| told.level == Level::WARN && !told.field("state").is_empty()).unwrap();
    assert!(faulted.field("state").contains("fault"), "{faulted:?}");
    let emergency = of_run().find(|told| !told.field("code").is_empty()).unwrap();
    assert!(!emergency.field("reason").is_empty() && !emergency.field("cure").is_empty(), "{emergency:?}");
}

#[test]
fn a_bus_that_goes_off_and_comes_back_is_told() {
    let fault = "[[fault]]\nkind = \"bus-off\"\nbus = \"can\"\nwhen = \"moving\"\nat = \"0.2 s\"\nrestart = \"0.1 s\"\n";
    let (told, _) = run(&first(), fault);
    assert_eq!(values(&told, "takt::bus", "state"), ["bus off", "error active"]);
    assert_eq!(values(&told, "takt::bus", "bus"), ["can", "can"]);
}

#[test]
fn a_drive_that_cannot_be_brought_up_is_an_error_with_its_step_its_reason_and_the_cure() {
    let config = first();
    let told = told_by(|| {
        let mut bus = takt::simulated_bus(&config, 0);
        bus.silence(1, true).unwrap();
        let (mut run, _log) = VirtualRun::new(&config, vec![bus]).unwrap();
        let outcome = run.run(CYCLES_AT_MOST, |_| {});
        assert!(matches!(outcome, Some(Outcome::BringUpFailed(_))), "{outcome:?}");
    });
    let failed = told.iter().find(|told| told.level == Level::ERROR).unwrap();
    assert_eq!((failed.target.as_str(), failed.field("axis")), ("takt::bring_up", "joint"));
    assert_eq!(failed.field("stage"), "configure");
    assert!(["step", "reason", "cure"].iter().all(|name| !failed.field(name).is_empty()), "{failed:?}");
}

fn takt_run(arguments: &[&str], variable: Option<&str>) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    command.arg("run").arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/first.toml"));
    command.args(arguments).current_dir(folder.path()).env_remove("TAKT_LOG");
    if let Some(level) = variable {
        command.env("TAKT_LOG", level);
    }
    command.output().unwrap()
}

#[test]
fn the_program_tells_on_standard_error_what_it_is_asked_for_and_nothing_otherwise() {
    let text = |output: &Output| String::from_utf8(output.stderr.clone()).unwrap();
    let silent = text(&takt_run(&[], None));
    assert!(!silent.contains("takt::"), "{silent}");
    for (arguments, variable) in [(&["--log", "info"][..], None), (&[], Some("info"))] {
        let told = text(&takt_run(arguments, variable));
        for expected in [
            "INFO takt::bus",
            "INFO takt::bring_up",
            "INFO takt::run",
            "INFO takt::recording",
            "stage=\"run\"",
        ] {
            assert!(told.contains(expected), "{expected}: {told}");
        }
        assert!(!told.contains("DEBUG"), "{told}");
    }
}

#[test]
fn a_level_that_there_is_not_is_refused() {
    let refused = takt_run(&[], Some("loud"));
    assert_eq!(refused.status.code(), Some(2));
    let text = String::from_utf8(refused.stderr).unwrap();
    assert!(text.contains("loud") && text.contains("debug"), "{text}");
}
