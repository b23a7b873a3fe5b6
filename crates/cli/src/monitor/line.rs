//! A frame in one line, for people and for programs.

use clap::ValueEnum;
use serde_json::json;
use takt_rt::{Frame, FrameKind, Nanoseconds};
use takt_wire::bus_log::{Direction, is_time_of_day};

use crate::columns::columns;
use crate::print;
use takt::telemetry::{Emphasis, WallClock};
use takt_tools::monitor::{Decoded, Service};

/// The fewest columns for the meaning beside the frame. Where there are fewer, it stands below.
const FEWEST_BESIDE: usize = 40;
/// The spaces before a meaning that stands below its frame.
const BELOW: usize = 6;
/// The letters of a classic frame with eight bytes and 11 bits.
const FRAME_LETTERS: usize = 20;

/// A frame and what is known of it.
pub struct Line<'a> {
    pub since_ns: Nanoseconds,
    pub unix_ns: Nanoseconds,
    pub bus: &'a str,
    pub direction: Option<Direction>,
    pub frame: &'a Frame,
    pub decoded: &'a Decoded,
}

impl Line<'_> {
    /// `>` to the drives, `<` from them: by the log, which is of the controller's machine, or else by the protocol.
    fn arrow(&self) -> char {
        match (self.direction, self.decoded.service.is_to_drives()) {
            (Some(Direction::Sent), _) | (None, Some(true)) => '>',
            (Some(Direction::Received), _) | (None, Some(false)) => '<',
            (None, None) => ' ',
        }
    }

    /// As a JSON object.
    pub fn json(&self, text: &mut String) {
        let Decoded { service, node, who, words, values, axes, .. } = self.decoded;
        let hexadecimal: String = self.frame.payload().iter().map(|byte| format!("{byte:02X}")).collect();
        let values: Vec<_> = values
            .iter()
            .map(|value| {
                json!({
                    "name": value.name, "object": value.object.map(|object| object.to_string()),
                    "raw": value.raw, "value": value.value, "text": value.text,
                })
            })
            .collect();
        let object = json!({
            "time": is_time_of_day(self.unix_ns).then_some(self.unix_ns as f64 / 1e9),
            "since_start": self.since_ns as f64 / 1e9,
            "bus": self.bus,
            "direction": self.direction.map(|direction| match direction {
                Direction::Sent => "sent",
                Direction::Received => "received",
            }),
            "to_drives": service.is_to_drives(),
            "id": self.frame.id().value(),
            "extended": self.frame.id().is_extended(),
            "format": match self.frame.kind() {
                FrameKind::Data => "data",
                FrameKind::Remote => "remote",
                FrameKind::Fd => "fd",
                FrameKind::FdBitRateSwitch => "fd-brs",
            },
            "length": self.frame.length(),
            "data": hexadecimal,
            "frame": format!("{:?}", self.frame),
            "kind": service.kind().word(),
            "service": service.name(),
            "node": node,
            "axis": (!axes.is_empty()).then_some(who),
            "meaning": words,
            "values": values,
        });
        text.push_str(&object.to_string());
        text.push('\n');
    }
}

/// What the time of a frame is counted from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TimeStyle {
    /// The first frame
    Start,
    /// The frame before it
    Delta,
    /// The time of day (UTC)
    Clock,
}

/// How lines look.
pub struct LineStyle {
    time: TimeStyle,
    before_ns: Nanoseconds,
    columns: Option<usize>,
    emphasis: Emphasis,
    /// The letters of the longest name of a bus; 0 where there is only one bus.
    bus_letters: usize,
}

impl LineStyle {
    pub fn new(time: TimeStyle) -> Self {
        Self {
            time,
            before_ns: 0,
            columns: columns().map(usize::from),
            emphasis: print::emphasis(),
            bus_letters: 0,
        }
    }

    /// Makes room for the names of buses, where there are several.
    pub fn widen_bus<'a>(&mut self, names: impl ExactSizeIterator<Item = &'a str>) {
        let is_needed = names.len() > 1;
        let longest = names.map(|name| name.chars().count()).max().unwrap_or(0);
        self.bus_letters = if is_needed { longest.max(self.bus_letters) } else { self.bus_letters };
    }

    /// Counts times from the first frame. Returns `true` if they were to be times of day until now.
    pub fn count_from_start(&mut self) -> bool {
        let is_clock = self.time == TimeStyle::Clock;
        if is_clock {
            self.time = TimeStyle::Start;
        }
        is_clock
    }

    /// Writes a line, or several where the terminal is narrow.
    pub fn line(&mut self, line: &Line<'_>, text: &mut String) {
        let before_ns = std::mem::replace(&mut self.before_ns, line.since_ns);
        let time = match self.time {
            TimeStyle::Start => seconds(line.since_ns),
            TimeStyle::Delta => seconds(line.since_ns.saturating_sub(before_ns)),
            TimeStyle::Clock => WallClock::fixed(0).moment(line.unix_ns),
        };
        let bus = match self.bus_letters {
            0 => String::new(),
            letters => format!("{:<letters$} ", line.bus),
        };
        let frame = format!("{:?}", line.frame);
        let arrow = line.arrow();
        let used = time.chars().count() + 1 + bus.chars().count() + 2 + frame.len().max(FRAME_LETTERS) + 2;
        let head = head(line.decoded);
        let meaning = match line.decoded.words.as_str() {
            "" => head.clone(),
            words => format!("{head}: {words}"),
        };
        let (indentation, is_below) = match self.columns {
            Some(columns) if columns < used + FEWEST_BESIDE => (BELOW, true),
            _ => (used, false),
        };
        let wrapped = match self.columns {
            None => meaning,
            Some(columns) => {
                let spaces = " ".repeat(indentation);
                // The first line has the spaces as well, so that it is as long as the others.
                let options =
                    textwrap::Options::new(columns).initial_indent(&spaces).subsequent_indent(&spaces);
                let filled = textwrap::fill(&meaning, options);
                filled.get(indentation..).unwrap_or_default().to_owned()
            }
        };
        let (time, wrapped) =
            (self.emphasis.faint(&time), self.coloured(line.decoded.service, &head, &wrapped));
        let bus = self.emphasis.faint(&bus);
        if is_below {
            let spaces = " ".repeat(BELOW);
            text.push_str(&format!("{time} {bus}{arrow} {frame}\n{spaces}{wrapped}\n"));
        } else {
            text.push_str(&format!("{time} {bus}{arrow} {frame:<FRAME_LETTERS$}  {wrapped}\n"));
        }
    }

    /// The service in colour: faults stand out, and what comes in every cycle does not.
    fn coloured(&self, service: Service, head: &str, text: &str) -> String {
        let Some(rest) = text.strip_prefix(head) else { return text.to_owned() };
        let head = match service {
            Service::Emergency => self.emphasis.bad(head),
            Service::Nmt | Service::LssRequest => self.emphasis.heading(head),
            Service::SdoRequest | Service::SdoResponse | Service::LssResponse => self.emphasis.accent(head),
            Service::Rpdo(_) | Service::Tpdo(_) | Service::Command | Service::Reply => {
                self.emphasis.good(head)
            }
            _ => self.emphasis.faint(head),
        };
        format!("{head}{rest}")
    }
}

/// Service and who is concerned.
fn head(decoded: &Decoded) -> String {
    let (service, who) = (decoded.service.name(), &decoded.who);
    if who.is_empty() { service } else { format!("{service} {who}") }
}

fn seconds(ns: Nanoseconds) -> String {
    format!("{:11.6}", ns as f64 / 1e9)
}
