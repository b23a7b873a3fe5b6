//! The output of `takt lss`.

use serde::Serialize;

use takt_rt::Nanoseconds;
use takt_tools::commission::bus_session::SessionEvent;
use takt_tools::commission::layer_settings::LayerSettingFailure;
use takt_wire::canopen::lss::{LssAddress, LssError, LssRequest, LssResponse};

use super::super::exit::Exit;
use super::super::print;

/// The identity of a device.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Device {
    vendor: u32,
    product: u32,
    revision: u32,
    serial: u32,
}

impl From<LssAddress> for Device {
    fn from(LssAddress { vendor, product, revision, serial }: LssAddress) -> Self {
        Self { vendor, product, revision, serial }
    }
}

impl Device {
    fn words(self) -> String {
        let Self { vendor, product, revision, serial } = self;
        format!("0x{vendor:08X}:0x{product:08X}:0x{revision:08X}:0x{serial:08X}")
    }
}

/// The result.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// The devices that a scan has found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub devices: Option<Vec<Device>>,
    /// Why the scan ended before all devices were found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
    /// The device that was meant, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device: Option<Device>,
    /// The node ID that it has or was given.
    pub node: Option<u8>,
    /// The bit rate that it was given, in bit/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bit_rate: Option<u32>,
    /// True if it has stored its settings.
    pub is_stored: bool,
    /// True if it was told to change to the bit rate.
    pub is_activated: bool,
    /// True if it keeps its old node ID until it is reset.
    pub is_reset_needed: bool,
    /// The node ID with which a device has booted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub booted_node: Option<u8>,
    /// True if a boot-up message was due and has not come.
    pub is_boot_up_missing: bool,
}

/// Shows the result.
pub struct Output {
    pub action: &'static str,
    pub is_json: bool,
}

#[derive(Serialize)]
struct Printed<'a> {
    action: &'a str,
    /// `done`, `interrupted` or `failed`.
    ended: &'static str,
    failure: Option<String>,
    advice: Option<&'static str>,
    result: &'a Report,
}

/// Shows a frame with its meaning in LSS.
pub fn show(at_ns: Nanoseconds, seen: &SessionEvent) {
    let (direction, frame, words) = match seen {
        SessionEvent::Sent(frame) => {
            ('>', frame, LssRequest::decode(frame).map(|request| request.to_string()))
        }
        SessionEvent::Received(frame) => {
            ('<', frame, LssResponse::decode(frame).map(|response| response.to_string()))
        }
        SessionEvent::Procedure(_) => return,
    };
    let at_s = at_ns as f64 / 1e9;
    say!("{at_s:11.6} {direction} {:<22} {}", format!("{frame:?}"), words.unwrap_or_default());
}

fn advice(failure: LayerSettingFailure) -> Option<&'static str> {
    match failure {
        LayerSettingFailure::NoDevice => Some(
            "check its supply, the wiring and the bit rate; a device that has a node ID is named by --device or \
             --only; a device without LSS cannot be found in this way",
        ),
        LayerSettingFailure::Task(LssError::NoReply { .. }) => {
            Some("check the identity, the wiring and the bit rate; the device may not have this service")
        }
        LayerSettingFailure::Task(LssError::Refused { .. }) => {
            Some("the device does not support this value or cannot store")
        }
        LayerSettingFailure::Task(LssError::ScanLost) => Some("scan again; the bus may be busy or disturbed"),
        LayerSettingFailure::Implausible(_) => Some("switch the devices off and on, then try again"),
        LayerSettingFailure::SeveralDevices { .. } => {
            Some("name the device by --device, or leave a single device on the bus")
        }
        LayerSettingFailure::Interrupted => None,
    }
}

impl Output {
    /// Shows the result.
    pub fn finish(&self, report: &Report, outcome: Result<(), LayerSettingFailure>) -> Exit {
        let failure = outcome.err();
        let (ended, exit) = match failure {
            None => ("done", Exit::Done),
            Some(LayerSettingFailure::Interrupted) => ("interrupted", Exit::Interrupted),
            Some(_) => ("failed", Exit::Stopped),
        };
        if self.is_json {
            let printed = Printed {
                action: self.action,
                ended,
                failure: failure.map(|failure| failure.to_string()),
                advice: failure.and_then(advice),
                result: report,
            };
            return print::json(&printed, exit);
        }
        let exit = print::text(&text(report), exit);
        if let Some(failure) = failure {
            say!("takt: {}: {failure}", self.action);
            if let Some(advice) = advice(failure) {
                say!("  try: {advice}");
            }
        }
        exit
    }
}

fn text(report: &Report) -> String {
    let mut lines = vec![];
    if let Some(devices) = &report.devices {
        lines.extend(devices.iter().map(|device| format!("without a node ID  {}", device.words())));
        lines.push(match devices.len() {
            0 => "no device without a node ID".to_owned(),
            1 => "1 device".to_owned(),
            count => format!("{count} devices"),
        });
    }
    lines.extend(report.remark.as_ref().map(|remark| {
        format!("note: the scan ended early: {remark}; switch the devices off and on, then scan again")
    }));
    lines.extend(report.device.map(|device| format!("device       {}", device.words())));
    lines.extend(report.node.map(|node| format!("node ID      {node}")));
    lines.extend(report.bit_rate.map(|rate| format!("bit rate     {} kbit/s", rate / 1000)));
    lines.extend(report.booted_node.map(|node| format!("booted       as node {node}")));
    if report.is_boot_up_missing {
        lines.push(
            "note: the device has sent no boot-up message with this node ID; switch it off and on, and look whether it \
             comes"
                .to_owned(),
        );
    }
    if report.is_stored {
        lines.push("stored       yes".to_owned());
    }
    if report.is_reset_needed {
        lines.push("note: the device keeps its old node ID until it is reset".to_owned());
    }
    if report.is_activated {
        lines.push(
            "note: the devices change to this bit rate and stay in configuration: change the interface as well, then \
             `takt lss --bus … --bit-rate … wait`"
                .to_owned(),
        );
    }
    lines.into_iter().map(|line| format!("  {line}\n")).collect()
}
