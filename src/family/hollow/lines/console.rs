//! The console of a motor: its parameters, its mode, its zero point.
//!
//! The manual prints the items of the menus and not their text, so whatever is set is read back from the menu: what that shows counts.

use takt_rt::{FieldMode, Nanoseconds};
use takt_wire::hollow_lines::console::{
    BAUD_RATE, ConsoleCommand, ConsoleReader, PARAMETERS, Parameter, ParameterAccess, ZeroPoint,
};

use super::super::encoder_output::EncoderOutput;
use super::client::{LineClient, LineSession};
use super::menu::Menu;
use super::unsupported;
use crate::family::commission::{DriveTask, Failure, NamedEntry, Report, Task, ValueText};
use crate::procedure::Procedure;

/// The console has come to its end when it has typed nothing for so long.
const QUIET_NS: Nanoseconds = 150_000_000;
/// How long to wait for its first character.
const ANSWER_NS: Nanoseconds = 1_000_000_000;
/// A disturbed line is asked for again so often.
const TRIES: usize = 4;
/// The name of the zero point among the entries.
const ZERO_POINT: &str = "zero point";
/// The name of the setting of the encoder pins.
const STEP_CONFIG: &str = "STEP_CONFIG";

/// The parameters of the menu, and what is beside them.
pub fn entries() -> Vec<NamedEntry> {
    let parameters = PARAMETERS.iter().map(|parameter| {
        let (access, values) = match parameter.access {
            ParameterAccess::ReadOnly => ("read", String::new()),
            ParameterAccess::Range { lowest, highest } => ("read, write", format!("{lowest} to {highest}")),
        };
        NamedEntry {
            address: parameter.item.to_string(),
            name: parameter.name,
            access,
            unit: String::new(),
            values,
            note: parameter.meaning,
        }
    });
    let zero = NamedEntry {
        address: "zero".to_owned(),
        name: ZERO_POINT,
        access: "read, write",
        unit: "°".to_owned(),
        values: "5 to 355; write \"factory\" to clear it".to_owned(),
        note: "degrees from the zero of the factory; `zero` makes the present position the zero point",
    };
    let step = NamedEntry {
        address: "step".to_owned(),
        name: STEP_CONFIG,
        access: "read, write",
        unit: "°".to_owned(),
        values: "0 (the pins are an input), 1 to 360 degrees between two pulses of 1 ms".to_owned(),
        note: "the pins for encoder pulses; firmware whose menu does not show it cannot be set here",
    };
    parameters.chain([zero, step]).collect()
}

/// What is read or written.
#[derive(Clone, Debug, PartialEq)]
enum Entry {
    Parameter(Parameter),
    ZeroPoint,
    StepConfig,
}

impl Entry {
    fn named(name: &str) -> Result<Self, Failure> {
        let wanted = name.trim().to_lowercase();
        if matches!(wanted.as_str(), "zero" | ZERO_POINT) {
            return Ok(Self::ZeroPoint);
        }
        if matches!(wanted.as_str(), "step" | "step_config") {
            return Ok(Self::StepConfig);
        }
        let is_it = |parameter: &&Parameter| {
            wanted == parameter.item.to_string() || wanted == parameter.name.to_lowercase()
        };
        PARAMETERS.iter().find(is_it).copied().map(Self::Parameter).ok_or_else(|| {
            Failure::Unsuitable(format!("`{name}` is no entry of the console; `entries` lists them"))
        })
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Parameter(parameter) => parameter.name,
            Self::ZeroPoint => ZERO_POINT,
            Self::StepConfig => STEP_CONFIG,
        }
    }

    fn shown(&self, menu: &Menu) -> Option<f64> {
        match self {
            Self::Parameter(parameter) => menu.value(parameter),
            Self::ZeroPoint => menu.zero_point,
            Self::StepConfig => menu.step_config,
        }
    }
}

/// What is to be done, checked.
enum Work {
    Info,
    Read(Vec<Entry>),
    Write(Parameter, u16),
    ClearZeroPoint,
    SetZeroPoint,
    StepConfig(u16),
    Mode(FieldMode),
    Stop,
}

/// A task on the console.
///
/// # Errors
/// The console cannot do it, or a name or a value is wrong.
pub fn begin(task: Task, bit_rate: u32) -> Result<DriveTask<Vec<u8>>, Failure> {
    if bit_rate != BAUD_RATE {
        return Err(Failure::Unsuitable(format!(
            "the console has {BAUD_RATE} baud: --bus serial:/dev/ttyUSB0@{BAUD_RATE}"
        )));
    }
    let work = Work::of(task)?;
    let session = LineSession::new(LineClient::default());
    let c = session.clone();
    let procedure = Procedure::new(session, async move { carry_out(&c, work).await });
    Ok(DriveTask::new(procedure, |bytes: &Vec<u8>| format!("{:?}", String::from_utf8_lossy(bytes))))
}

impl Work {
    fn of(task: Task) -> Result<Self, Failure> {
        match task {
            Task::Info => Ok(Self::Info),
            Task::Read { names, .. } => {
                names.iter().map(|name| Entry::named(name)).collect::<Result<_, _>>().map(Self::Read)
            }
            Task::Write { name, value, .. } => Self::write(&Entry::named(&name)?, &value),
            Task::Zero { is_confirmed: true } => Ok(Self::SetZeroPoint),
            Task::Zero { is_confirmed: false } => Err(Failure::NeedsConsent {
                consequence: "the present position becomes the zero point of the motor, and lasts without power: every position is \
                              counted from there",
                option: "--yes",
            }),
            Task::Mode(mode) => Ok(Self::Mode(mode)),
            Task::Disable => Ok(Self::Stop),
            Task::Enable { .. } | Task::Move { .. } | Task::Velocity { .. } | Task::Torque { .. } => {
                Err(unsupported(
                    "the console moves the motor without limits, and shows no position while it does",
                    "move it over CAN: `--family hollow-can`, or over the converter: `--family hollow-can-fd --bus rs485-canfd:/dev/ttyUSB0`",
                ))
            }
            Task::Watch { .. } => Err(unsupported(
                "the console shows neither position nor velocity",
                "`watch` over CAN: `--family hollow-can`",
            )),
            Task::SetId { node } => {
                Self::write(&Entry::named("g")?, &ValueText { text: node.to_string(), is_raw: true })
            }
            Task::Save => {
                Err(unsupported("the console keeps what is set at once", "there is nothing to save"))
            }
            _ => Err(unsupported(
                "the console has no command for this",
                "`entries` lists what can be read and written; `mode` and `zero` set the rest",
            )),
        }
    }

    fn write(entry: &Entry, value: &ValueText) -> Result<Self, Failure> {
        let text = value.text.trim();
        let number = || {
            text.parse::<f64>().map_err(|_| {
                Failure::Unsuitable(format!("`{text}` is no whole number, as the {} takes it", entry.name()))
            })
        };
        match entry {
            Entry::Parameter(parameter) => {
                let checked = parameter.check(number()?);
                checked
                    .map(|value| Self::Write(*parameter, value))
                    .map_err(|error| Failure::Unsuitable(error.to_string()))
            }
            Entry::ZeroPoint if text.eq_ignore_ascii_case("factory") => Ok(Self::ClearZeroPoint),
            Entry::ZeroPoint => Err(unsupported(
                "the zero point is set where the motor stands",
                "turn it there and use `zero`; `write \"zero point\" factory` clears it",
            )),
            Entry::StepConfig => {
                let number = number()?;
                let whole = if number.fract() == 0.0 { number as i64 } else { -1 };
                let output = EncoderOutput::of_step_config(whole).and_then(EncoderOutput::step_config);
                output.map(Self::StepConfig).map_err(|error| Failure::Unsuitable(error.to_string()))
            }
        }
    }
}

async fn carry_out(c: &LineSession, work: Work) -> Result<Report, Failure> {
    match work {
        Work::Info => info(c).await,
        Work::Read(entries) => read(c, &entries).await,
        Work::Write(parameter, value) => write(c, &parameter, value).await,
        Work::SetZeroPoint => set_zero_point(c).await,
        Work::ClearZeroPoint => clear_zero_point(c).await,
        Work::StepConfig(value) => set_step_config(c, value).await,
        Work::Mode(mode) => set_mode(c, mode).await,
        Work::Stop => {
            c.step("stop");
            tell(c, ConsoleCommand::Stop).await?;
            let mut report = Report::new();
            report.add("state", "state", "free", "told to be free");
            Ok(report)
        }
    }
}

/// Types a command, and returns what the console types until it is quiet.
async fn tell(c: &LineSession, command: ConsoleCommand) -> Result<Vec<String>, Failure> {
    let text = command.encode().map_err(|error| Failure::Unsuitable(error.to_string()))?;
    c.say(text.clone());
    let (mut reader, mut lines) = (ConsoleReader::default(), vec![]);
    let (began_ns, mut has_heard) = (c.now_ns(), false);
    let typed = c.until(|| {
        while let Some(byte) = c.hear() {
            has_heard = true;
            lines.extend(reader.push(byte));
        }
        let waited_ns = c.now_ns().saturating_sub(began_ns);
        let is_over = if has_heard { c.silent_ns() >= QUIET_NS } else { waited_ns >= ANSWER_NS };
        (is_over || c.is_interrupted()).then_some(())
    });
    typed.await;
    if c.is_interrupted() {
        return Err(Failure::Interrupted);
    }
    // Some lines return what is typed.
    let echo = text.trim_end();
    lines.retain(|line: &String| line != echo);
    if lines.is_empty() {
        return Err(Failure::Request {
            what: "the console does not answer".to_owned(),
            cure: Some(
                "check the wiring (TX and RX, or A and B), the motor's supply, and that no other program types there",
            ),
        });
    }
    Ok(lines)
}

/// The menu of the parameters.
async fn menu(c: &LineSession) -> Result<Menu, Failure> {
    let mut last = Menu::default();
    for _ in 0..TRIES {
        match tell(c, ConsoleCommand::ParameterMenu).await {
            Ok(lines) => last = Menu::of(&lines),
            Err(Failure::Request { .. }) => continue,
            Err(failure) => return Err(failure),
        }
        if last.is_complete() {
            return Ok(last);
        }
    }
    Err(Failure::Request {
        what: match last == Menu::default() {
            true => "the console does not answer".to_owned(),
            false => format!(
                "the console does not show the parameters of the manual; it shows: {}",
                last.others.join(" / ")
            ),
        },
        cure: Some("check the wiring and the bit rate (19200), and the motor's supply"),
    })
}

async fn info(c: &LineSession) -> Result<Report, Failure> {
    c.step("read the menu");
    let menu = menu(c).await?;
    let mut report = Report::new();
    for parameter in &PARAMETERS {
        if let Some(value) = menu.value(parameter) {
            report.add(key_of(parameter), parameter.name, value, value.to_string());
        }
    }
    if let Some(degrees) = menu.zero_point {
        report.add("zero_point_deg", ZERO_POINT, degrees, zero_words(degrees));
    }
    if let Some(value) = menu.step_config {
        report.add("step_config", STEP_CONFIG, value, step_words(value));
    }
    Ok(report)
}

/// The key for programs.
fn key_of(parameter: &Parameter) -> &'static str {
    match parameter.item {
        'a' => "current_loop_bandwidth",
        'b' => "velocity_loop_bandwidth",
        'c' => "position_loop_gain",
        'd' => "position_loop_damping",
        'e' => "pmax",
        'f' => "can_fd",
        'g' => "can_id",
        'h' => "master_id",
        _ => "cw_config",
    }
}

fn zero_words(degrees: f64) -> String {
    match ZeroPoint::new(degrees) {
        Ok(zero) => zero.to_string(),
        Err(_) if degrees == 0.0 => "that of the factory".to_owned(),
        Err(error) => error.to_string(),
    }
}

fn step_words(value: f64) -> String {
    match EncoderOutput::of_step_config(value as i64) {
        Ok(EncoderOutput::Input) => "0: the pins are an input".to_owned(),
        Ok(output @ EncoderOutput::Pulses { degrees }) => {
            let limit = output.speed_limit().unwrap_or(0.0);
            format!("a pulse of 1 ms every {degrees}°; they run into each other at {limit} °/s")
        }
        Err(error) => error.to_string(),
    }
}

async fn read(c: &LineSession, entries: &[Entry]) -> Result<Report, Failure> {
    c.step("read the menu");
    let menu = menu(c).await?;
    let mut report = Report::new();
    let mut objects = vec![];
    for entry in entries {
        let Some(value) = entry.shown(&menu) else {
            return Err(Failure::Request {
                what: format!("the console does not show {}", entry.name()),
                cure: Some("other firmware of the motor may"),
            });
        };
        report.add("", entry.name(), value, value.to_string());
        objects.push(serde_json::json!({ "object": entry.name(), "value": value }));
    }
    Ok(report.under("objects", objects.into()))
}

async fn write(c: &LineSession, parameter: &Parameter, value: u16) -> Result<Report, Failure> {
    c.step("write");
    let before = menu(c).await?;
    tell(c, ConsoleCommand::Item(parameter.item)).await?;
    tell(c, ConsoleCommand::Value(value.into())).await?;
    let after = menu(c).await?;
    let (was, is) = (before.value(parameter), after.value(parameter));
    if is != Some(f64::from(value)) {
        return Err(not_kept(parameter.name, value.to_string(), is));
    }
    let mut report = Report::new();
    let was = was.unwrap_or_default();
    report.add("before", "before", was, was.to_string());
    report.add("read_back", parameter.name, value, value.to_string());
    if matches!(parameter.item, 'f' | 'g' | 'h') {
        c.note("give the motor and its configuration the same: identifiers and frames change at once or at the next power-up");
    }
    Ok(report)
}

fn not_kept(name: &str, written: String, shown: Option<f64>) -> Failure {
    let shown = shown.map_or_else(|| "nothing".to_owned(), |value| value.to_string());
    Failure::Contradicted(format!(
        "{name}: {written} was typed, and the menu shows {shown}; the manual does not print how values are typed, so set it by hand in a \
         terminal"
    ))
}

async fn set_zero_point(c: &LineSession) -> Result<Report, Failure> {
    c.step("zero point");
    let before = menu(c).await?.zero_point.unwrap_or_default();
    tell(c, ConsoleCommand::SetZeroPoint).await?;
    let after = menu(c).await?.zero_point.unwrap_or_default();
    if let Err(error) = ZeroPoint::new(after) {
        return Err(Failure::Contradicted(error.to_string()));
    }
    if (after - before).abs() < f64::EPSILON {
        c.note("the menu shows the same zero point as before: the motor stood there, or is nearer than 5 degrees to the zero of the factory");
    }
    let mut report = Report::new();
    report.add("before_deg", "before", before, zero_words(before));
    report.add("zero_point_deg", ZERO_POINT, after, zero_words(after));
    Ok(report)
}

async fn clear_zero_point(c: &LineSession) -> Result<Report, Failure> {
    c.step("zero point");
    tell(c, ConsoleCommand::ClearZeroPoint).await?;
    let after = menu(c).await?.zero_point.unwrap_or_default();
    if after != 0.0 {
        return Err(not_kept(ZERO_POINT, "that of the factory".to_owned(), Some(after)));
    }
    let mut report = Report::new();
    report.add("read_back", ZERO_POINT, after, zero_words(after));
    Ok(report)
}

async fn set_step_config(c: &LineSession, value: u16) -> Result<Report, Failure> {
    c.step("write");
    let before = menu(c).await?;
    if before.step_config.is_none() {
        return Err(unsupported(
            "the menu of this motor does not show STEP_CONFIG, and the manual does not say where it is set",
            "set it with the vendor's tool",
        ));
    }
    tell(c, ConsoleCommand::StepConfig).await?;
    tell(c, ConsoleCommand::Value(value.into())).await?;
    let after = menu(c).await?.step_config;
    if after != Some(f64::from(value)) {
        return Err(not_kept(STEP_CONFIG, value.to_string(), after));
    }
    let mut report = Report::new();
    report.add("read_back", STEP_CONFIG, value, step_words(value.into()));
    Ok(report)
}

async fn set_mode(c: &LineSession, mode: FieldMode) -> Result<Report, Failure> {
    c.step("mode");
    let (item, name) = match mode {
        FieldMode::Torque => ('a', "torque"),
        FieldMode::Velocity => ('b', "velocity"),
        FieldMode::Position => ('c', "position"),
    };
    tell(c, ConsoleCommand::ModeMenu).await?;
    let answer = tell(c, ConsoleCommand::Item(item)).await?;
    c.note(format!("the console answered: {}", answer.join(" / ")));
    let mut report = Report::new();
    report.add("mode", "mode", name, name);
    Ok(report)
}
