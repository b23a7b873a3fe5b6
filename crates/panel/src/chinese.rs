//! Whether everything that takt says has a Chinese template on the page (`page/chinese.js`), with the same fields.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::time::Duration;

use serde_json::Value;
use takt_rt::{
    AxisPoint, DriveState, Event, EventKind, OperationMode, Origin, Phase, RejectReason, RequestError,
    RequestId, RequestKind, Rule, StopCategory, StopCause, StopReason, StreamState, TimingLevel,
};
use takt_wire::canopen::nmt::NmtState;
use takt_wire::canopen::object::{DataType, Object};
use takt_wire::canopen::sdo::{AbortCode, SdoError};

use super::access::Denied;
use super::command::CommandRefusal;
use super::gate::Problematic;
use super::pages::PageRefusal;
use takt::command::{CommandError, LeaseError, MotionError, PointRefusal, StreamError, needed};
use takt::config::{Config, Quantity};
use takt::family;
use takt::family::commission::Failure;
use takt::procedure::Access;
use takt::telemetry::{Machine, words};
use takt::words::Words;

const REPOSITORY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// The rows of the table: the English template and the Chinese one.
fn table() -> Vec<(String, String)> {
    let rows = include_str!("page/chinese.js").split_once("CHINESE = {\n").unwrap().1;
    let rows = rows.lines().map(str::trim).filter(|row| row.starts_with('"'));
    rows.map(|row| {
        let row: BTreeMap<String, String> =
            serde_json::from_str(&format!("{{{}}}", row.strip_suffix(',').unwrap())).unwrap();
        row.into_iter().next().unwrap()
    })
    .collect()
}

/// The names of the fields of a template.
fn fields(template: &str) -> BTreeSet<&str> {
    let names = template.split('{').skip(1).filter_map(|rest| Some(rest.split_once('}')?.0));
    names.filter(|name| name.chars().all(|letter| letter.is_ascii_lowercase() || letter == '_')).collect()
}

fn has_chinese(text: &str) -> bool {
    text.chars().any(|letter| matches!(letter, '\u{4e00}'..='\u{9fff}' | '：' | '；' | '（'))
}

/// Looks words up as the page does.
struct Page {
    table: BTreeMap<String, String>,
}

impl Page {
    fn new() -> Self {
        Self { table: table().into_iter().collect() }
    }

    /// Fails unless words and those in their fields have a Chinese template with the same fields.
    #[track_caller]
    fn has(&self, words: impl Into<Words>) {
        self.has_sent(&serde_json::to_value(words.into()).unwrap());
    }

    #[track_caller]
    fn has_sent(&self, words: &Value) {
        let text = words["text"].as_str().unwrap();
        let Some(chinese) = words["zh"].as_str().or(self.table.get(text).map(String::as_str)) else {
            // The page has the rules among its own texts.
            let is_rule = Rule::ALL.iter().any(|rule| rule.key() == text);
            return assert!(text.is_empty() || is_rule, "{text:?} has no Chinese template");
        };
        let sent = words["fields"].as_object().cloned().unwrap_or_default();
        assert_eq!(fields(chinese), sent.keys().map(String::as_str).collect(), "{text:?}: {chinese:?}");
        sent.values().filter(|field| field.is_object()).for_each(|field| self.has_sent(field));
    }
}

fn machine() -> Machine {
    let config = Path::new(REPOSITORY).join("configs/arm-and-gripper.toml");
    Machine::of(&Config::load(&config).unwrap())
}

/// All that takt may say: the source without this file, each space of any length one.
fn source() -> String {
    fn add(folder: &Path, to: &mut String) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => add(&path, to),
                false if path.ends_with("chinese.rs") => {}
                false if path.extension().is_some_and(|kind| kind == "rs" || kind == "toml") => {
                    to.push_str(&fs::read_to_string(&path).unwrap());
                }
                false => {}
            }
        }
    }
    let mut source = String::new();
    for folder in ["src", "crates", "rt/src", "drives"] {
        add(&Path::new(REPOSITORY).join(folder), &mut source);
    }
    let source = source.replace("\\\"", "\"").replace("\\\n", "\n");
    source.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A template whose English sentence is said nowhere is one that was left behind when the sentence was changed.
#[test]
fn each_row_stands_once_for_a_sentence_of_the_source_with_the_fields_of_the_english_template() {
    let (source, mut seen) = (source(), BTreeSet::new());
    for (english, chinese) in table() {
        assert!(has_chinese(&chinese) && fields(&english) == fields(&chinese), "{english:?}: {chinese:?}");
        assert!(source.contains(&format!("\"{}\"", english)), "{english:?} is said nowhere");
        assert!(seen.insert(english.clone()), "{english:?} stands twice");
    }
}

#[test]
fn every_event_is_chinese() {
    let page = Page::new();
    let mut kinds = vec![
        EventKind::MotionFinished { request: RequestId(7) },
        EventKind::MissedSlots { count: 1 },
        EventKind::MissedSlots { count: 30 },
        EventKind::Emergency { axis: 1, code: 0, register: 0, manufacturer: [0; 5] },
        EventKind::Emergency { axis: 1, code: 0x7305, register: 0x21, manufacturer: [1, 2, 3, 4, 0xFF] },
    ];
    kinds.extend(Phase::ALL.map(|to| EventKind::PhaseChanged { from: Phase::Enabling, to }));
    kinds.extend(StreamState::ALL.map(|state| EventKind::Stream { state }));
    kinds.extend(TimingLevel::ALL.map(|level| EventKind::Timing { level }));
    kinds.extend(OperationMode::ALL.map(|mode| EventKind::Mode { axis: 0, mode }));
    kinds.extend(DriveState::ALL.map(|state| EventKind::DriveState { axis: 0, state, statusword: 0x1637 }));
    kinds.extend(RequestKind::ALL.map(|request| {
        let reason = RejectReason::Phase;
        EventKind::Rejected(RequestError { request, reason, axis: None, phase: Phase::Moving })
    }));
    for kind in kinds {
        page.has(words::event(&Event { slot: 1, at_ns: 2, group: Some(0), kind }, &machine()));
    }
}

#[test]
fn every_stop_is_chinese_with_its_cure_whatever_has_caused_it() {
    let (page, mut machine) = (Page::new(), machine());
    for plans_own_profile in [false, true] {
        machine.axes[0].plans_own_profile = plans_own_profile;
        for rule in Rule::ALL {
            for (value, limit, origin, category) in [
                (3.0, 8.0, Origin::Axis(0), StopCategory::One),
                (1.0, 0.0, Origin::Axis(0), StopCategory::Two),
                (0.0, 0.0, Origin::Group, StopCategory::Zero),
                (501.0, 500.0, Origin::Group, StopCategory::One),
                (1541.0, 0.0, Origin::Bus(0), StopCategory::Zero),
                (6.0, 29.0, Origin::Bus(0), StopCategory::Zero),
            ] {
                let Some(cause) = StopCause::from_numbers(rule, value, limit) else { continue };
                let stop = StopReason { category, cause, origin, slot: 9, phase: Phase::Moving };
                page.has(words::stop(&stop, &machine));
            }
        }
    }
}

#[test]
fn every_rejection_is_chinese_whatever_was_asked() {
    let (page, request) = (Page::new(), RequestKind::Move);
    let mut all: Vec<RequestError> = RejectReason::all()
        .map(|reason| RequestError { request, reason, axis: Some(0), phase: Phase::Holding })
        .collect();
    for rule in Rule::ALL {
        let reason = RejectReason::StopLatched { rule };
        all.push(RequestError { request, reason, axis: None, phase: Phase::Disabled });
    }
    all.extend(RequestKind::ALL.map(|request| {
        let reason = RejectReason::TooLate;
        RequestError { request, reason, axis: None, phase: Phase::Holding }
    }));
    all.iter().for_each(|rejected| page.has(words::rejection(rejected, &machine())));
}

#[test]
fn every_error_code_and_every_cure_of_every_family_is_chinese() {
    let page = Page::new();
    let families = family::all().into_iter().map(|family| Some(family.word()));
    for family in families.chain([None]) {
        for code in 0..=u16::MAX {
            page.has(family::error_words(family, code));
            page.has(family::error_cure(family, code));
        }
    }
}

#[test]
fn every_refusal_of_a_command_is_chinese() {
    let page = Page::new();
    let axis = || "slide".to_owned();
    let after = Duration::from_millis(300);
    let leases = [
        LeaseError::Held { process: 4711, expires_in: after },
        LeaseError::TakenOver { process: 4711 },
        LeaseError::ReadOnly,
        LeaseError::TooManyClients,
        LeaseError::Lost,
    ];
    let of_controller = [
        CommandError::Count { given: 1, axes: 2 },
        CommandError::NoSuchAxis { axis: 7, axes: 2 },
        CommandError::NoSuchGroup { name: "left".to_owned(), groups: vec!["left".to_owned()] },
        CommandError::NoSuchGroup { name: "left".to_owned(), groups: vec![] },
        CommandError::OutsideLimits { axis: axis(), value: 2.0, lowest: -1.0, highest: 1.0 },
        CommandError::Full { waiting: 16 },
        CommandError::Budget { budget: after, longest: after },
        CommandError::TooManyCallbacks,
        CommandError::SeveralGroups { groups: vec!["left".to_owned()] },
        CommandError::NoTrajectory,
        CommandError::Unanswered,
        CommandError::Overtaken,
        CommandError::NoReply { after },
        CommandError::Ended,
    ];
    let wrong_modes =
        needed::ALL.map(|needed| CommandError::WrongMode { axis: axis(), needed: needed.to_owned() });
    let motions = [
        MotionError::Overtaken,
        MotionError::Replaced,
        MotionError::Forgotten,
        MotionError::NotInTime,
        MotionError::Ended,
    ];
    let points = [
        PointRefusal::NotFinite { value: AxisPoint::Velocity(f64::NAN) },
        PointRefusal::NotFinite { value: AxisPoint::Torque(f64::NAN) },
        PointRefusal::TooLarge { number: 1e10, largest: 1e9 },
        PointRefusal::NoTorqueInMode { mode: OperationMode::Homing },
        PointRefusal::NoFeedForward,
        PointRefusal::Torque { torque: 9.0, limit: 3.0 },
        PointRefusal::Stiffness { stiffness: 9.0, limit: 3.0 },
        PointRefusal::Damping { damping: 9.0, limit: 3.0 },
    ];
    let streams =
        points.map(|reason| StreamError::Refused { point: 0, axis: 1, reason }).into_iter().chain([
            StreamError::Count { given: 1, axes: 2 },
            StreamError::NotStreaming,
            StreamError::Full,
            StreamError::NoReply { after },
            StreamError::Ended,
        ]);
    let own = [
        CommandRefusal::NoSuchGroup { group: 3, groups: 2 },
        CommandRefusal::NoSuchMode { mode: 77 },
        CommandRefusal::WrongMode { axis: axis(), mode: "profile position", quantity: "velocity" },
        CommandRefusal::WrongMode { axis: axis(), mode: "no mode", quantity: "torque" },
        CommandRefusal::NothingToRenew,
        CommandRefusal::Discarded,
        CommandRefusal::Busy,
        CommandRefusal::BusyWithDrive,
    ];
    let all = own
        .into_iter()
        .chain(of_controller.into_iter().chain(wrong_modes).map(CommandRefusal::from))
        .chain(leases.map(CommandError::from).map(CommandRefusal::from))
        .chain(motions.map(CommandRefusal::from))
        .chain(streams.map(CommandRefusal::from));
    all.for_each(|refusal| {
        page.has_sent(&serde_json::to_value(refusal.view(Some(&machine()))).unwrap()["words"]);
    });
}

#[test]
fn every_refusal_of_a_page_is_chinese() {
    let page = Page::new();
    for refusal in [
        PageRefusal::TooManyPages,
        PageRefusal::NotOpen,
        PageRefusal::NotPresent,
        PageRefusal::NotCommander { commander: Some(3) },
        PageRefusal::NotCommander { commander: None },
        PageRefusal::TooOften { per_second: 10 },
        PageRefusal::Overtaken,
    ] {
        page.has(refusal.words());
    }
}

#[test]
fn every_refusal_of_a_request_is_chinese() {
    let (page, host) = (Page::new(), "left".to_owned());
    for refusal in [
        Problematic::Denied(Denied::Host { host: host.clone() }),
        Problematic::Denied(Denied::Origin { origin: host }),
        Problematic::Denied(Denied::NoToken),
        Problematic::Denied(Denied::WrongToken),
        Problematic::NoHeader,
        Problematic::MediaType,
        Problematic::TooLarge,
        Problematic::TooSlow,
        Problematic::Malformed("node IDs are 1 to 127".into()),
        Problematic::Malformed("stop categories are 0, 1 and 2".into()),
    ] {
        page.has_sent(&serde_json::to_value(refusal.told().1).unwrap()["words"]);
    }
}

#[test]
fn every_failure_of_a_procedure_and_its_advice_is_chinese() {
    const OBJECT: Object = Object::new(0x6041, 0, DataType::U16, "6041");
    let (page, object, family) = (Page::new(), OBJECT, "slide");
    let (value, low, high, quantity) = (2.0, -1.0, 1.0, Quantity::ANGLE);
    let mut failures = vec![
        Failure::Interrupted,
        Failure::Silent { node: 5, reported: None, other_protocol: None },
        Failure::TextTransfer { object: object.address, error: SdoError::ToggleNotAlternated },
        Failure::Length { object, received: 3 },
        Failure::DoesNotFit { object, value: 70_000 },
        Failure::NotKept { object, written: 1, received: 2 },
        Failure::OtherDrive { family, expected: 1, received: 2 },
        Failure::Faulted { what: family::standard_error(0x8611), advice: None },
        Failure::FaultPersists {
            what: family::standard_error(0x8611),
            advice: Some("check the supply and its cable"),
        },
        Failure::Enabled,
        Failure::Disabled { statusword: 0x1250 },
        Failure::OutsideLimits { quantity, value, low, high },
        Failure::AtLimit { quantity, value, low, high },
        Failure::Jumped { counts: 300 },
        Failure::Homing("the drive reports a homing error (statusword bit 13)"),
    ];
    let states = [NmtState::BootUp, NmtState::Stopped, NmtState::Operational, NmtState::PreOperational];
    failures.extend(states.map(|state| Failure::Silent {
        node: 5,
        reported: Some(state),
        other_protocol: None,
    }));
    for what in [
        "the acknowledgement of the set-point",
        "the end of the acknowledgement",
        "the end of homing",
        "the end of the fault",
        "the target",
        "the mode",
        "standstill",
        "a state without torque",
    ] {
        failures.push(Failure::NotInTime { object, what, last: 0, waited_ns: 500_000_000 });
    }
    let aborts = AbortCode::LISTED.iter().copied().chain([AbortCode::Other(7)]).map(SdoError::Aborted);
    let silence = SdoError::NoReply { attempts: 3, reply_timeout_ns: 500_000_000, unusable: 0 };
    for error in aborts.chain([silence]) {
        for access in [Access::Read, Access::Write(3), Access::ReadBack(3)] {
            failures.push(Failure::Transfer { object, access, error });
        }
    }
    for failure in failures {
        page.has(failure.words());
        failure.advice().into_iter().for_each(|advice| page.has(advice));
    }
}
