//! What is done with each frame: decoded, counted, shown, written.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::time::Duration;

use takt_rt::{BusState, Frame, Nanoseconds};
use takt_wire::bus_log::{Direction, LogWriter, LoggedFrame, is_time_of_day};

use super::line::{Line, LineStyle, TimeStyle};
use super::statistics;
use super::watched_bus::WatchedBus;
use crate::exit::Exit;
use crate::print::Collected;
use takt::config::{Config, Interface};
use takt_tools::monitor::{BusDecoder, BusStatistics, FrameFilter, NamedDrive};

/// Text that is collected before it is printed.
const PRINTED_BYTES: usize = 1 << 14;

/// A log that is being written.
#[derive(Debug)]
pub struct OpenLog {
    pub writer: LogWriter<BufWriter<File>>,
    pub path: PathBuf,
}

/// What is wanted.
#[derive(Debug)]
pub struct SessionOptions {
    pub filter: FrameFilter,
    pub shows_frames: bool,
    pub shows_statistics: bool,
    pub is_json: bool,
    pub time: TimeStyle,
    pub duration: Option<Duration>,
    pub count: Option<u64>,
    pub log: Option<OpenLog>,
    pub bit_rate: u32,
    pub data_bit_rate: Option<u32>,
}

/// Watches buses.
pub struct Session {
    options: SessionOptions,
    config: Option<Config>,
    drives: Vec<NamedDrive>,
    buses: Vec<WatchedBus>,
    style: LineStyle,
    printed: Collected,
    first_ns: Option<Nanoseconds>,
    shown: u64,
    /// True if a log could not be written.
    is_log_broken: bool,
    is_bus_lost: bool,
    remarks: Vec<String>,
}

impl Session {
    pub fn new(options: SessionOptions, config: Option<Config>, drives: Vec<NamedDrive>) -> Self {
        let mut style = LineStyle::new(options.time);
        if let Some(config) = &config {
            style.widen_bus(config.buses.iter().map(|bus| bus.name.as_str()));
        }
        Self {
            options,
            config,
            drives,
            buses: vec![],
            style,
            printed: Collected::default(),
            first_ns: None,
            shown: 0,
            is_log_broken: false,
            is_bus_lost: false,
            remarks: vec![],
        }
    }

    pub const fn config(&self) -> Option<&Config> {
        self.config.as_ref()
    }

    pub fn buses(&self) -> &[WatchedBus] {
        &self.buses
    }

    /// Adds a bus; `number` is its number in the configuration.
    pub fn add_bus(&mut self, name: &str, number: Option<usize>) -> usize {
        let of_config = self.config.as_ref().zip(number);
        let decoder = match of_config {
            Some((config, number)) => BusDecoder::of(config, number),
            None => BusDecoder::with_drives(&self.drives),
        };
        let settings = of_config.and_then(|(config, number)| config.buses.get(number));
        let (bit_rate, data_bit_rate) = match settings {
            Some(bus) => (bus.bit_rate, bus.data_bit_rate),
            None => (self.options.bit_rate, self.options.data_bit_rate),
        };
        self.buses.push(WatchedBus {
            name: settings.map_or(name, |bus| &bus.name).to_owned(),
            decoder,
            statistics: BusStatistics::new(bit_rate, data_bit_rate),
            shown: BTreeMap::new(),
        });
        self.style.widen_bus(self.buses.iter().map(|bus| bus.name.as_str()));
        self.buses.len() - 1
    }

    /// The number in the configuration of the bus that a log calls like this: by its name or that of its interface, or the only one.
    pub fn number_of(&self, name: &str) -> Option<usize> {
        let buses = &self.config.as_ref()?.buses;
        let is_interface = |interface: &Interface| interface.to_string() == name;
        let underscored = |own: &str| own.split_whitespace().collect::<Vec<_>>().join("_");
        let place = buses.iter().position(|bus| {
            bus.name == name || underscored(&bus.name) == name || is_interface(&bus.interface)
        });
        place.or((buses.len() == 1).then_some(0))
    }

    /// Takes a frame. Returns whether more are wanted.
    pub fn take(
        &mut self,
        bus: usize,
        unix_ns: Nanoseconds,
        direction: Option<Direction>,
        frame: &Frame,
    ) -> bool {
        let first_ns = *self.first_ns.get_or_insert(unix_ns);
        if !is_time_of_day(unix_ns) && self.style.count_from_start() {
            self.remarks
                .push("the log has no times of day: its times are shown from its first frame".to_owned());
        }
        let since_ns = unix_ns.saturating_sub(first_ns);
        if self.options.duration.is_some_and(|duration| u128::from(since_ns) > duration.as_nanos()) {
            return false;
        }
        let Some(watched) = self.buses.get_mut(bus) else { return true };
        let decoded = watched.decoder.decode(frame);
        watched.statistics.add(unix_ns, frame);
        if !self.options.filter.takes(frame, &decoded) {
            return true;
        }
        self.shown += 1;
        if let Some(log) = &mut self.options.log {
            let logged = LoggedFrame { at_ns: unix_ns, bus: &watched.name, direction, frame: *frame };
            if let Err(error) = log.writer.add(&logged, &decoded.line()) {
                self.remarks.push(format!("{} is not complete: {error}", log.path.display()));
                self.is_log_broken = true;
                self.options.log = None;
            }
        }
        let line = Line { since_ns, unix_ns, bus: &watched.name, direction, frame, decoded: &decoded };
        if self.options.shows_frames {
            match self.options.is_json {
                true => line.json(&mut self.printed.text),
                false => self.style.line(&line, &mut self.printed.text),
            }
        }
        if self.options.shows_statistics {
            watched.shown.insert(frame.id().arbitration_key(), decoded);
        }
        if self.printed.text.len() >= PRINTED_BYTES {
            self.print();
        }
        self.wants_more()
    }

    /// Tells that the state of a bus has changed.
    pub fn tell_state(&mut self, bus: usize, state: BusState, errors: u64) {
        let Some(watched) = self.buses.get(bus) else { return };
        let words = match state {
            BusState::ErrorActive => "error active",
            BusState::ErrorPassive => "error passive",
            BusState::BusOff => "bus-off",
            BusState::Down => "down",
        };
        if self.options.is_json {
            let event = serde_json::json!({ "bus": watched.name, "state": words, "errors": errors });
            self.printed.text.push_str(&format!("{event}\n"));
        } else if self.options.shows_frames {
            self.printed
                .text
                .push_str(&format!("-- bus `{}` is {words}, {errors} errors so far\n", watched.name));
        }
    }

    /// A remark for the end.
    pub fn remark(&mut self, remark: String) {
        self.remarks.push(remark);
    }

    /// Takes that nothing more could be heard on a bus at the end.
    pub fn lose_bus(&mut self, bus: usize, state: BusState) {
        let name = self.buses.get(bus).map_or("", |bus| &bus.name);
        self.remarks.push(match state {
            BusState::BusOff => format!(
                "bus `{name}` is off (bus-off): check wiring, termination and bit rate; the interface is heard again after a restart \
                 (restart-ms)"
            ),
            _ => format!("the interface of bus `{name}` went down, or has gone: nothing more was heard"),
        });
        self.is_bus_lost = true;
    }

    /// Prints what was collected.
    pub fn print(&mut self) {
        self.printed.print();
    }

    /// Returns `true` if anybody wants more frames.
    pub fn wants_more(&self) -> bool {
        let is_unread = self.printed.has_no_reader() && self.options.log.is_none();
        let is_counted_out = self.options.count.is_some_and(|count| self.shown >= count);
        !(is_counted_out || is_unread)
    }

    /// How long to watch.
    pub const fn duration(&self) -> Option<Duration> {
        self.options.duration
    }

    /// Prints what is left, and the summary.
    pub fn finish(mut self, is_interrupted: bool) -> Exit {
        if self.options.shows_statistics {
            let text = match self.options.is_json {
                true => statistics::json(&self.buses),
                false => statistics::text(&self.buses),
            };
            self.printed.text.push_str(&text);
        }
        self.print();
        if let Some(log) = &mut self.options.log
            && let Err(error) = log.writer.flush()
        {
            self.remarks.push(format!("{} is not complete: {error}", log.path.display()));
            self.is_log_broken = true;
        }
        let has_reader = !self.printed.has_no_reader();
        if has_reader && !self.options.is_json && !self.options.shows_statistics {
            for bus in &self.buses {
                say!("{}", statistics::summary(bus, self.buses.len() > 1));
            }
        }
        if has_reader || self.is_log_broken {
            self.remarks.iter().for_each(|remark| say!("note: {remark}"));
        }
        match self.printed.failed() {
            Some(failed) => failed,
            None if self.is_log_broken => Exit::Stopped,
            None if is_interrupted && has_reader => Exit::Interrupted,
            None if self.is_bus_lost => Exit::Stopped,
            None => Exit::Done,
        }
    }
}
