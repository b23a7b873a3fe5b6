//! What the pages are told, as JSON.

use serde::Serialize;
use serde_json::{Value, json};
use takt_rt::BusHealth;

use super::super::pages::PageNumber;
use super::super::view::{bus_state, rounded};
use takt::family::scan::FoundDevice;
use takt::words::Words;
use takt_tools::commission::{AxisReading, Failure, ProcedureError, Report, ReportItem, TargetDrive};

/// A drive as pages see it.
#[derive(Clone, Debug, Serialize)]
pub struct DriveView {
    pub bus: usize,
    pub node: Option<u8>,
    pub name: String,
    /// The family that moves it; `None` where none does.
    pub family: Option<String>,
    /// `rad`, `m`, or `counts` where its units are not known.
    pub unit: &'static str,
    /// True if it stands in the configuration.
    pub is_configured: bool,
    pub position_min: Option<f64>,
    pub position_max: Option<f64>,
    pub velocity: Option<f64>,
    pub acceleration: Option<f64>,
    pub torque: Option<f64>,
    /// What a scan has found of it.
    pub found: Option<FoundView>,
}

/// What a scan has found.
#[derive(Clone, Debug, Serialize)]
pub struct FoundView {
    protocol: Words,
    kind: Words,
    vendor: Option<String>,
    product: Option<String>,
    firmware: Option<String>,
    serial: Option<String>,
    remarks: Vec<Words>,
}

impl FoundView {
    /// Returns `true` if it is this device, where neither has a node ID.
    pub fn is(&self, found: &FoundDevice) -> bool {
        self.serial == found.serial && self.product == found.product
    }

    pub fn of(found: &FoundDevice) -> Self {
        Self {
            protocol: found.answered.words(),
            kind: found.kind.clone().into(),
            vendor: found.vendor.clone(),
            product: found.product.clone(),
            firmware: found.firmware.clone(),
            serial: found.serial.clone(),
            remarks: found.remarks.iter().cloned().map(Words::from).collect(),
        }
    }
}

impl DriveView {
    /// Of a drive that can be moved.
    pub fn of(target: &TargetDrive, bus: usize) -> Self {
        let limits = target.limits.as_ref();
        let finite = |value: f64| value.is_finite().then_some(value);
        Self {
            bus,
            node: Some(target.node),
            name: target.name.clone(),
            family: Some(target.drive.word.to_owned()),
            unit: if target.has_units() { target.position_quantity().unit } else { "counts" },
            is_configured: target.axis.is_some(),
            position_min: limits.and_then(|limits| finite(limits.position_min)),
            position_max: limits.and_then(|limits| finite(limits.position_max)),
            velocity: limits.and_then(|limits| finite(limits.velocity)),
            acceleration: limits.and_then(|limits| finite(limits.acceleration)),
            torque: limits.and_then(|limits| finite(limits.torque)),
            found: None,
        }
    }

    /// Of a device that no family here moves.
    pub fn found(found: &FoundDevice, bus: usize) -> Self {
        Self {
            bus,
            node: found.node,
            name: found.node.map_or_else(|| found.kind.clone(), |node| format!("node {node}")),
            family: None,
            unit: "counts",
            is_configured: false,
            position_min: None,
            position_max: None,
            velocity: None,
            acceleration: None,
            torque: None,
            found: Some(FoundView::of(found)),
        }
    }
}

/// A bus as pages see it.
#[derive(Clone, Debug, Serialize)]
pub struct BusView {
    pub name: String,
    pub interface: String,
    /// True if it is a serial line, which has no frames.
    pub is_line: bool,
}

/// Whether a drive has torque, as far as this panel gave it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Torque {
    /// None by this panel.
    #[default]
    Off,
    /// For this page.
    Held(PageNumber),
    /// It could not be taken away.
    Unsure,
}

/// What runs.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct RunningView {
    /// The drive; `None` for what concerns a whole bus.
    pub drive: Option<usize>,
    pub bus: usize,
    /// As the page has asked for it.
    pub action: &'static str,
    /// The step it is in.
    pub step: &'static str,
    pub done: u32,
    pub of: u32,
    /// True if it is only a reading, which gives way to everything.
    pub is_watch: bool,
}

/// Everything that pages are told.
pub struct Told {
    pub name: String,
    pub families: Vec<&'static str>,
    pub buses: Vec<BusView>,
    pub drives: Vec<DriveView>,
    pub torque: Vec<Torque>,
    pub health: Vec<Option<BusHealth>>,
    pub running: Option<RunningView>,
    pub watched: Option<usize>,
    pub reading: Option<(usize, AxisReading)>,
    /// It rises when the drives change.
    pub version: u64,
}

impl Told {
    /// What changes seldom.
    pub fn machine(&self) -> Value {
        json!({
            "name": self.name, "program": env!("CARGO_PKG_VERSION"), "version": self.version,
            "families": self.families, "buses": self.buses, "drives": self.drives,
        })
    }

    /// What changes often.
    pub fn state(&self) -> Value {
        let buses: Vec<Value> =
            self.health.iter().map(|health| health.as_ref().map_or(Value::Null, bus)).collect();
        let torque: Vec<&str> = self
            .torque
            .iter()
            .map(|torque| match torque {
                Torque::Off => "off",
                Torque::Held(_) => "on",
                Torque::Unsure => "unsure",
            })
            .collect();
        json!({
            "version": self.version, "running": self.running, "watched": self.watched, "torque": torque,
            "buses": buses, "reading": self.reading.as_ref().map(|(drive, reading)| view(*drive, reading)),
        })
    }
}

fn bus(health: &BusHealth) -> Value {
    json!({
        "state": bus_state(health.state), "tx_frames": health.tx_frames, "rx_frames": health.rx_frames,
        "errors": health.errors, "overruns": health.tx_overruns + health.rx_overruns,
    })
}

fn view(drive: usize, reading: &AxisReading) -> Value {
    json!({
        "drive": drive, "position": rounded(reading.position), "position_counts": reading.position_counts,
        "velocity": rounded(reading.velocity), "torque": reading.torque.map(rounded),
        "current_a": reading.current_a, "temperature_c": reading.temperature_c,
        "statusword": reading.statusword, "state": reading.state, "time_ms": reading.at_ns / 1_000_000,
    })
}

/// How an errand with a drive has ended.
pub fn outcome(
    drive: usize,
    action: &str,
    outcome: &Result<Report, ProcedureError>,
    notes: &[String],
) -> Value {
    let failed = outcome.as_ref().err();
    let ended = match failed {
        None => "done",
        Some(failed) if failed.failure == Failure::Interrupted => "interrupted",
        Some(failed) if failed.failure.is_refusal() => "refused",
        Some(_) => "failed",
    };
    let items: Vec<Value> = outcome.as_ref().map_or_else(
        |_| vec![],
        |report| {
            let item = |item: &ReportItem| json!({ "key": item.key, "label": item.label, "text": item.text });
            report.items().iter().map(item).collect()
        },
    );
    let notes: Vec<Words> = notes.iter().cloned().map(Words::from).collect();
    let consequence = match failed.map(|failed| &failed.failure) {
        Some(Failure::NeedsConsent { consequence, .. }) => Some(Words::from(*consequence)),
        _ => None,
    };
    json!({
        "drive": drive, "action": action, "ended": ended, "step": failed.map(|failed| failed.step),
        "failure": failed.map(|failed| failed.failure.words()),
        "advice": failed.and_then(|failed| failed.failure.advice()).map(Words::from),
        "consequence": consequence, "items": items, "notes": notes,
    })
}
