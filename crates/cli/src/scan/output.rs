//! What a scan shows: a progress bar on standard error, then a table, or an object.

use std::cell::RefCell;
use std::collections::BTreeMap;

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};
use takt_rt::Nanoseconds;

use super::super::columns::{columns, paragraph};
use super::super::table::Table;
use takt::family::scan::{Answered, FoundDevice, PlaceOfScan, Scanned};
use takt_tools::commission::ProcedureEvent;
use takt_tools::commission::bus_session::SessionEvent;
use takt_tools::commission::line_session::LineEvent;
use takt_tools::monitor::BusDecoder;

/// Below so many columns, each device has lines of its own.
const NARROW: u16 = 110;

/// Shows how far a scan is, and its frames.
pub struct Watcher {
    bar: ProgressBar,
    is_verbose: bool,
    decoder: RefCell<BusDecoder>,
}

impl Watcher {
    /// Of the scan of a bus.
    pub fn new(bus: &str, is_verbose: bool) -> Self {
        // indicatif draws on standard error, and only if that is a terminal.
        let bar = ProgressBar::new(1);
        let style = ProgressStyle::with_template("{prefix} {wide_bar} {percent:>3} % {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_prefix(bus.to_owned());
        Self { bar, is_verbose, decoder: RefCell::new(BusDecoder::with_drives(&[])) }
    }

    /// Shows an event on a CAN bus.
    pub fn see(&self, at_ns: Nanoseconds, event: &SessionEvent) {
        let (direction, frame) = match event {
            SessionEvent::Procedure(event) => return self.see_procedure(event),
            SessionEvent::Sent(frame) => ('>', frame),
            SessionEvent::Received(frame) => ('<', frame),
        };
        if self.is_verbose {
            let words = self.decoder.borrow_mut().decode(frame).line();
            let at_s = at_ns as f64 / 1e9;
            self.bar.suspend(|| say!("{at_s:11.6} {direction} {:<22} {words}", format!("{frame:?}")));
        }
    }

    /// Shows an event on a serial line.
    pub fn see_line(&self, at_ns: Nanoseconds, bit_rate: u32, event: &LineEvent<'_>) {
        let (direction, bytes) = match event {
            LineEvent::Procedure(event) => return self.see_procedure(event),
            LineEvent::Sent(bytes) => ('>', bytes),
            LineEvent::Received(bytes) => ('<', bytes),
        };
        if self.is_verbose {
            self.bar.suspend(|| say!("{:9.3} {bit_rate} {direction} {bytes:02X?}", at_ns as f64 / 1e9));
        }
    }

    fn see_procedure(&self, event: &ProcedureEvent) {
        match event {
            ProcedureEvent::Step(step) => self.bar.set_message(*step),
            ProcedureEvent::Progress { done, of } => {
                self.bar.set_length((*of).into());
                self.bar.set_position((*done).into());
            }
            ProcedureEvent::Note(_) | ProcedureEvent::Reading(_) => {}
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// A bus that was scanned.
pub struct ScannedBus {
    /// Its interface.
    pub name: String,
    /// The same for a configuration.
    pub place: PlaceOfScan,
    /// What was found there.
    pub found: Scanned,
}

/// The result in words.
pub fn text(buses: &[ScannedBus], is_interrupted: bool) -> String {
    let mut text = String::new();
    for (at, bus) in buses.iter().enumerate() {
        if at > 0 {
            text.push('\n');
        }
        let devices = &bus.found.devices;
        let count = match devices.len() {
            0 => "nothing found".to_owned(),
            1 => "1 device".to_owned(),
            count => format!("{count} devices"),
        };
        text.push_str(&format!("{}: {count}{}\n", bus.name, by_protocol(devices)));
        let is_narrow = columns().is_some_and(|columns| columns < NARROW);
        match (devices.is_empty(), is_narrow) {
            (true, _) => {}
            (false, true) => devices.iter().for_each(|device| text.push_str(&lines(device))),
            (false, false) => text.push_str(&table(devices)),
        }
        text.push_str(&notes(&bus.found));
        if devices.is_empty() && bus.found.remarks.is_empty() && !is_interrupted {
            text.push_str(&format!("{}\n", paragraph(&format!("try: {}", of_silence(&bus.name)), 5)));
        }
    }
    if is_interrupted {
        text.push_str("interrupted: this is what had been found\n");
    } else if buses.iter().any(|bus| bus.found.devices.iter().any(|device| device.drive.is_some())) {
        text.push_str("`takt scan … --config` writes a configuration for them.\n");
    }
    text
}

/// What to look at where nothing was found.
fn of_silence(bus: &str) -> &'static str {
    match bus.starts_with("serial:") {
        true => {
            "are the drives powered, is the bit rate right (--line-rate), are A and B the right way round?"
        }
        false => {
            "are the drives powered, is the bus terminated, is the bit rate right (--bit-rate), are the node IDs in the range \
             (--from, --to)? Motors that answer nothing but commands need --stop-motors, which takes their torque"
        }
    }
}

/// How many answered in which protocol, where there are several.
fn by_protocol(devices: &[FoundDevice]) -> String {
    let mut counts = BTreeMap::new();
    for device in devices {
        *counts.entry(device.answered.words().to_string()).or_insert(0) += 1;
    }
    if counts.len() < 2 {
        return String::new();
    }
    let words: Vec<String> = counts.into_iter().map(|(words, count)| format!("{count} {words}")).collect();
    format!(" ({})", words.join(", "))
}

fn table(devices: &[FoundDevice]) -> String {
    let mut table = Table::new([
        ">node",
        "device",
        "vendor",
        "product",
        "firmware",
        "serial number",
        "answered",
        "drive =",
    ]);
    for device in devices {
        table.row([
            number(device),
            device.kind.clone(),
            shown(&device.vendor),
            shown(&device.product),
            shown(&device.firmware),
            shown(&device.serial),
            device.answered.words().to_string(),
            device.drive.map_or_else(dash, |drive| format!("\"{drive}\"")),
        ]);
    }
    table.to_string()
}

/// A device in lines of its own.
fn lines(device: &FoundDevice) -> String {
    let first = format!("  {:<6} {}", format!("{}:", number(device)), device.kind);
    let mut lines = format!("{}\n", paragraph(&first, 9));
    let drive = device.drive.map(|drive| format!("drive = \"{drive}\""));
    let made =
        [&device.vendor, &device.product].into_iter().flatten().cloned().collect::<Vec<_>>().join(", ");
    let firmware = device.firmware.as_ref().map(|version| format!("firmware {version}"));
    let serial = device.serial.as_ref().map(|serial| format!("serial number {serial}"));
    let answered = Some(format!("answered by {}", device.answered.words()))
        .filter(|_| !matches!(device.answered, Answered::Heard(_) | Answered::OfController));
    let made = Some(made).filter(|made| !made.is_empty());
    for part in [made, firmware, serial, answered, drive].into_iter().flatten() {
        lines.push_str(&paragraph(&format!("         {part}"), 11));
        lines.push('\n');
    }
    lines
}

fn number(device: &FoundDevice) -> String {
    device.node.map_or_else(dash, |node| node.to_string())
}

fn shown(text: &Option<String>) -> String {
    text.clone().unwrap_or_else(dash)
}

fn dash() -> String {
    "-".to_owned()
}

fn notes(found: &Scanned) -> String {
    let of_devices = found.devices.iter().flat_map(|device| {
        let who = device.node.map_or_else(|| "without a node ID".to_owned(), |node| format!("node {node}"));
        device.remarks.iter().map(move |remark| format!("{who}: {remark}"))
    });
    let all = found.remarks.iter().cloned().chain(of_devices);
    all.map(|remark| format!("{}\n", paragraph(&format!("note: {remark}"), 6))).collect()
}

/// The result as an object.
pub fn json(buses: &[ScannedBus], is_interrupted: bool) -> Value {
    let of_device = |device: &FoundDevice| {
        json!({
            "node": device.node,
            "device": device.kind,
            "vendor": device.vendor,
            "product": device.product,
            "firmware": device.firmware,
            "serial": device.serial,
            "answered": device.answered.words().to_string(),
            "identity": device.identity.map(|identity| json!({
                "device_type": identity.device_type,
                "vendor": identity.vendor,
                "product": identity.product,
                "revision": identity.revision,
                "serial": identity.serial,
            })),
            "drive": device.drive,
            "remarks": device.remarks,
        })
    };
    let of_bus = |bus: &ScannedBus| {
        json!({
            "bus": bus.name,
            "bit_rate": bus.place.bit_rate,
            "devices": bus.found.devices.iter().map(of_device).collect::<Vec<_>>(),
            "remarks": bus.found.remarks,
        })
    };
    json!({
        "ended": if is_interrupted { "interrupted" } else { "done" },
        "buses": buses.iter().map(of_bus).collect::<Vec<_>>(),
    })
}
