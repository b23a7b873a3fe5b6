//! A controller of simulated drives, as a page sees and commands it.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::json;
use takt_rt::{NANOSECONDS_PER_SECOND, Nanoseconds, StopCategory};

use super::breakage::Breakage;
use crate::command::{Command, ProblemView, target_of};
use crate::motions::{LOOK, Motions, Problem};
use crate::view::{EventView, MachineView, Viewer};
use takt::command::{AnyHandle, Events};
use takt::config::{Config, ConfigSources};
use takt::controller::{VirtualController, assemble};
use takt::telemetry::{
    BlackBox, Emphasis, FilesInMemory, Logger, LoggerOptions, Machine, Recorded, RecordingOptions,
    RecordingReport, WallClock,
};

/// The one page, which always commands.
const PAGE: u64 = 1;
/// What the black box keeps before an incident.
const BLACK_BOX_NS: Nanoseconds = 2 * NANOSECONDS_PER_SECOND;
/// Cycles that a report shows up to the stop.
const REPORTED_CYCLES: u64 = 20;

/// A controller of simulated drives in virtual time, with the messages of the panel.
pub struct SimulatedArm {
    config: Config,
    controller: VirtualController,
    motions: Motions,
    viewer: Viewer,
    events: Events,
    told: Told,
    black_boxes: FilesInMemory,
    /// Until when time has been asked to pass.
    due_ns: Nanoseconds,
    /// The time of day at zero of virtual time.
    started_ms: u64,
}

/// The events that pages were told.
#[derive(Default)]
struct Told {
    number: u64,
    missed: u64,
}

/// The files of a configuration.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Files {
    /// The name of the configuration itself.
    main: PathBuf,
    /// Each with its text.
    files: Vec<(PathBuf, String)>,
    /// The time of day, in ms since 1970.
    time_ms: u64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stop {
    group: Option<u8>,
    category: u8,
}

impl SimulatedArm {
    /// Brings the simulated drives of a configuration up and enables them: `{"main": NAME, "files": [[NAME, TEXT]], "time_ms": NOW}`.
    ///
    /// # Errors
    /// Why it cannot be, in words.
    pub fn start(files: &str) -> Result<Self, String> {
        let Files { main, files, time_ms } =
            serde_json::from_str(files).map_err(|error| error.to_string())?;
        let files = files.into_iter().map(|(name, text)| (name, text.into_bytes())).collect();
        let sources = ConfigSources { main: Some(main), files, interfaces: vec![] };
        let config = sources.config().map_err(|error| error.to_string())?;
        let wall_clock = WallClock::fixed(time_ms.saturating_mul(1_000_000));
        let black_boxes = FilesInMemory::default();
        let again = assemble::rerun_parts(&config).map_err(|error| error.to_string())?;
        let logger = |log, traces, journal| {
            let machine = Machine::of(&config);
            let black_box = BlackBox::in_memory(BLACK_BOX_NS, black_boxes.clone(), &machine, wall_clock);
            let options = LoggerOptions {
                machine,
                wall_clock,
                started_ns: 0,
                recording: None,
                recording_options: RecordingOptions::default(),
                candump: None,
                black_box: None,
                traces,
            };
            Logger::new(log, options, Box::new(|_| {})).with_black_box(black_box).with_journal(
                Some(journal),
                Some(again),
                &sources,
            )
        };
        let controller =
            VirtualController::start_logged(&config, logger).map_err(|error| format!("{error:?}"))?;
        Ok(Self {
            motions: Motions::new(controller.handle().into()),
            viewer: Viewer::default(),
            events: controller.events(),
            told: Told::default(),
            due_ns: controller.now_ns(),
            started_ms: time_ms,
            controller,
            black_boxes,
            config,
        })
    }

    fn handle(&self) -> AnyHandle {
        self.controller.handle().into()
    }

    /// What does not change, as the panel tells it.
    pub fn machine(&self) -> String {
        text(&MachineView::of(&self.handle(), false))
    }

    /// The number and the name by which the page is greeted.
    pub fn page(&self) -> String {
        message("page", &json!({ "number": PAGE, "key": "page" }))
    }

    /// Lets a time pass. Returns the messages to the page: events, problems, and the state.
    pub fn advance(&mut self, by_ms: f64) -> String {
        let by_ns = if by_ms.is_finite() { (by_ms.max(0.0) * 1e6) as Nanoseconds } else { 0 };
        self.due_ns = self.due_ns.saturating_add(by_ns);
        let mut messages = String::new();
        while self.controller.now_ns() < self.due_ns && !self.controller.has_ended() {
            let left_ns = self.due_ns.saturating_sub(self.controller.now_ns());
            self.controller.pass(LOOK.min(Duration::from_nanos(left_ns)));
            let problems = std::cell::RefCell::new(String::new());
            let machine = self.controller.machine();
            self.motions.look(|Problem { refusal, .. }| {
                problems.borrow_mut().push_str(&message("problem", &refusal.view(Some(machine))));
            });
            messages.push_str(&problems.into_inner());
        }
        // A command may have let time pass, too.
        self.due_ns = self.due_ns.max(self.controller.now_ns());
        messages.push_str(&self.news());
        let state = self.viewer.view(&self.handle(), Some(PAGE), 1, self.time_ms());
        messages.push_str(&message("state", &state));
        messages
    }

    /// Carries a command of the page out.
    ///
    /// # Errors
    /// As the panel tells it: `{"error": …, "words": …}`.
    pub fn command(&mut self, command: &str) -> Result<(), String> {
        let command: Command = read(command)?;
        let carried_out = self.motions.carry_out(PAGE, command, self.motions.stops(), &|| true);
        carried_out.map_err(|refusal| text(&refusal.view(Some(self.controller.machine()))))
    }

    /// Stops a group, or all: `{"group": null, "category": 1}`.
    ///
    /// # Errors
    /// As [`SimulatedArm::command`].
    pub fn stop(&mut self, stop: &str) -> Result<(), String> {
        let Stop { group, category } = read(stop)?;
        let category = match category {
            0 => StopCategory::Zero,
            1 => StopCategory::One,
            2 => StopCategory::Two,
            _ => return Err(malformed("stop categories are 0, 1 and 2")),
        };
        let stopped = target_of(group, self.controller.machine())
            .and_then(|target| self.motions.stop(target, category));
        stopped.map_err(|refusal| text(&refusal.view(Some(self.controller.machine()))))
    }

    /// Breaks something, or mends it: `{"what": "silent", "axis": 2, "is_broken": true}`.
    ///
    /// # Errors
    /// As [`SimulatedArm::command`].
    pub fn break_something(&mut self, breakage: &str) -> Result<(), String> {
        let breakage: Breakage = read(breakage)?;
        breakage.carry_out(&self.config, &self.controller).map_err(|words| malformed(&words))
    }

    /// The names of the files of the black box, the oldest first, as a list.
    pub fn black_boxes(&self) -> String {
        let names: Vec<String> = self.black_boxes.all().into_iter().map(|file| file.name).collect();
        text(&names)
    }

    /// The bytes of a file of the black box, by its place in that list.
    ///
    /// # Errors
    /// There is none.
    pub fn black_box(&self, place: usize) -> Result<Vec<u8>, String> {
        let file = self.black_boxes.all().into_iter().nth(place);
        file.map(|file| file.bytes()).ok_or_else(|| "there is no such file".to_owned())
    }

    /// What `takt report` says of a file of the black box.
    ///
    /// # Errors
    /// There is none, or it cannot be read.
    pub fn report(&self, place: usize) -> Result<String, String> {
        let bytes = self.black_box(place)?;
        let name = self.black_boxes.all().into_iter().nth(place).map(|file| file.name).unwrap_or_default();
        let recorded =
            Recorded::in_memory(Path::new(&name), bytes.into()).map_err(|error| error.to_string())?;
        let report = RecordingReport::new(&recorded, None, REPORTED_CYCLES);
        Ok(report.map_err(|error| error.to_string())?.render(Emphasis::None))
    }

    /// The events since the last call.
    fn news(&mut self) -> String {
        let time_ms = self.time_ms();
        let Self { events, told, controller, .. } = self;
        let mut messages = String::new();
        for event in events.by_ref() {
            told.number += 1;
            let view = EventView::of(told.number, &event, controller.machine(), time_ms);
            messages.push_str(&message("event", &view));
        }
        let missed = events.missed();
        if missed > told.missed {
            told.number += 1;
            messages
                .push_str(&message("event", &EventView::missed(told.number, missed - told.missed, time_ms)));
            told.missed = missed;
        }
        messages
    }

    fn time_ms(&self) -> u64 {
        self.started_ms.saturating_add(self.controller.now_ns() / 1_000_000)
    }
}

/// As the server of the panel sends it.
fn message(name: &str, value: &impl Serialize) -> String {
    format!("event: {name}\ndata: {}\n\n", text(value))
}

fn text(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_else(|error| malformed(&error.to_string()))
}

fn read<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, String> {
    serde_json::from_str(text).map_err(|error| malformed(&error.to_string()))
}

fn malformed(words: &str) -> String {
    json!(ProblemView::of("refused", words.to_owned())).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    use crate::browser::replay::replay;

    fn arm() -> SimulatedArm {
        let text = include_str!("../../../../configs/arm6-erob.toml");
        let files =
            json!({ "main": "arm.toml", "files": [["arm.toml", text]], "time_ms": 1_700_000_000_000_u64 });
        SimulatedArm::start(&files.to_string()).unwrap()
    }

    fn phase(arm: &mut SimulatedArm, after_ms: f64) -> String {
        let messages = arm.advance(after_ms);
        let state = messages.rsplit("data: ").next().unwrap();
        let state: Value = serde_json::from_str(state).unwrap();
        state["groups"][0]["phase"].as_str().unwrap().to_owned()
    }

    #[test]
    fn an_arm_that_is_broken_stops_and_its_black_box_says_why() {
        for (what, cause) in [("silent", "joint2"), ("blocked", "following error"), ("bus_off", "bus")] {
            let mut arm = arm();
            assert_eq!(phase(&mut arm, 1.0), "holding");
            arm.command(r#"{"do":"move","axis":1,"to":0.8,"relative":false,"velocity":1,"acceleration":1}"#)
                .unwrap();
            assert_eq!(phase(&mut arm, 300.0), "moving");
            arm.break_something(&format!(r#"{{"what":"{what}","axis":1,"is_broken":true}}"#)).unwrap();
            assert_ne!(phase(&mut arm, 2000.0), "moving", "{what}");
            assert!(arm.black_boxes().contains("black-box"), "{what}");
            let report = arm.report(0).unwrap();
            assert!(report.contains(cause), "{what}: {report}");
        }
    }

    /// A black box of a joint that was blocked long after the beginning of the run, and the cycles before that.
    fn late_black_box() -> (Vec<u8>, u64) {
        let mut arm = arm();
        let mut to = 0.8;
        for _ in 0..3 {
            let command = json!({ "do": "move", "axis": 1, "to": to, "relative": false, "velocity": 1, "acceleration": 1 });
            arm.command(&command.to_string()).unwrap();
            arm.advance(2000.0);
            to = -to;
        }
        let command =
            json!({ "do": "move", "axis": 1, "to": to, "relative": false, "velocity": 1, "acceleration": 1 });
        arm.command(&command.to_string()).unwrap();
        arm.advance(300.0);
        arm.break_something(r#"{"what":"blocked","axis":1,"is_broken":true}"#).unwrap();
        arm.advance(2000.0);
        (arm.black_box(0).unwrap(), 6000)
    }

    #[test]
    fn a_black_box_is_replayed_bit_for_bit_though_its_journal_begins_in_the_middle_of_the_run() {
        let (bytes, before) = late_black_box();
        let result: Value = serde_json::from_str(&replay("box.mcap", bytes, &[]).unwrap()).unwrap();
        let count = |key: &str| result[key].as_u64().unwrap();
        assert!(result["identical"].as_bool().unwrap(), "{result:#}");
        assert!(count("compared") > 2000 && count("cycles") < before, "{result:#}");
        assert_eq!((count("missing"), count("differing")), (0, 0));
        assert!(result["stops"][0].as_str().unwrap().contains("joint2"), "{result:#}");
    }

    #[test]
    fn a_black_box_shows_what_another_limit_would_have_done() {
        let (bytes, _) = late_black_box();
        let stricter = ["axes.joint2.following_error.limit=0.01".to_owned()];
        let result: Value =
            serde_json::from_str(&replay("box.mcap", bytes.clone(), &stricter).unwrap()).unwrap();
        assert!(result["differing"].as_u64().unwrap() > 0, "{result:#}");
        assert!(result["stops"][0].as_str().unwrap().contains("allowed: 0.0100"), "{result:#}");
        let faster = ["cycle.period=2 ms".to_owned()];
        let refusal = replay("box.mcap", bytes, &faster).unwrap_err();
        assert!(refusal.contains("another period"), "{refusal}");
    }

    #[test]
    fn what_cannot_be_is_refused_in_the_words_of_the_panel() {
        let mut arm = arm();
        let refusal = arm.command(r#"{"do":"explode"}"#).unwrap_err();
        assert!(refusal.contains(r#""error":"refused""#) && refusal.contains("unknown variant"), "{refusal}");
        assert!(arm.stop(r#"{"group":null,"category":3}"#).is_err());
        assert!(arm.break_something(r#"{"what":"silent","axis":9,"is_broken":true}"#).is_err());
        assert!(arm.black_box(0).is_err());
        assert!(SimulatedArm::start(r#"{"main":"a.toml","files":[],"time_ms":0}"#).is_err());
    }
}
