//! What the drive tells of itself, and the other drives on the bus.

use takt_wire::erob_can::client::RequestTiming;
use takt_wire::erob_can::entries::{self, Entry};
use takt_wire::erob_can::frame::NODES;
use takt_wire::erob_can::module_information::{ModuleNumbers, UnknownField};

use super::super::failure::FAULT_CURE;
use super::super::module;
use crate::family::commission::scan::report;
use crate::family::commission::{Failure, Report, TargetDrive};
use crate::family::erob::module::CommandedModule as _;
use crate::family::erob::selection;
use crate::family::erob_can::session::ErobCanSession;

/// So long a scan waits for the answer of a node. A drive answers within 1 ms.
const SCAN: RequestTiming = RequestTiming { timeout_ns: 10_000_000, silence_ns: 0, read_retries: 0 };

/// `info`
pub async fn info(c: &ErobCanSession, s: &TargetDrive) -> Result<Report, Failure> {
    c.connect(s).await?;
    let mut report = Report::new();
    let information = module::information(c).await?;
    report.add("firmware", "firmware version", information.firmware, information.firmware.to_string());
    match information.numbers {
        Some(numbers) => identity(c, &mut report, &numbers),
        None => c.note(
            "the firmware is too old to tell serial number and model (index 0232, from firmware X5061715X on)",
        ),
    }
    c.step("condition");
    let reading = c.status().await?.reading(c.now_ns(), s);
    report.add("state", "state", reading.state, reading.state);
    for (key, label, entry) in [
        ("mode", "operating mode", &entries::OPERATING_MODE),
        ("running_state", "running state", &entries::RUNNING_STATE),
    ] {
        add(c, s, &mut report, key, label, entry).await?;
    }
    let (position, counts) = (reading.position, reading.position_counts);
    let shown = format!("{} ({counts} counts)", s.position_quantity().show(position));
    report.add("position", "position", position, shown);
    report.add("position_counts", "position counts", counts, counts.to_string());
    report.add("velocity", "velocity", reading.velocity, s.velocity_quantity().show(reading.velocity));
    for (key, label, entry) in [
        ("motor_current_ma", "motor current", &entries::MOTOR_CURRENT),
        ("continuous_current_ma", "continuous current", &entries::CONTINUOUS_CURRENT),
        ("voltage_mv", "DC bus voltage", &entries::BUS_VOLTAGE),
        ("temperature_c", "power stage temperature", &entries::TEMPERATURE),
        ("position_min_counts", "position limit, lowest", &entries::POSITION_LIMIT_MINIMUM),
        ("position_max_counts", "position limit, highest", &entries::POSITION_LIMIT_MAXIMUM),
    ] {
        add(c, s, &mut report, key, label, entry).await?;
    }
    c.step("errors");
    let code = c.read(&entries::ERROR_CODE).await?;
    report.add("error_code", "error", code, s.error_words(code as u16));
    if code != 0 {
        c.note(FAULT_CURE);
    }
    Ok(report)
}

async fn add(
    c: &ErobCanSession,
    s: &TargetDrive,
    report: &mut Report,
    key: &'static str,
    label: &str,
    entry: &Entry,
) -> Result<(), Failure> {
    let value = c.read(entry).await?;
    report.add(key, label, value, selection::words::<ErobCanSession>(s, entry, value.into()));
    Ok(())
}

/// Serial number, model and versions, as far as the manual's tables know the numbers.
fn identity(c: &ErobCanSession, report: &mut Report, numbers: &ModuleNumbers) {
    let mut add = |key, label, text: Result<String, UnknownField>| match text {
        Ok(text) => report.add(key, label, text.clone(), text),
        Err(unknown) => c.note(format!("{label}: {unknown}")),
    };
    add("model_number", "model number", numbers.model_number());
    add("serial_number", "serial number", numbers.serial_number());
    add("hardware_version", "hardware version", Ok(numbers.hardware_version()));
    add("module_version", "module version", numbers.module_version());
}

/// `scan`: asks every node ID for its firmware version.
pub async fn scan(c: &ErobCanSession) -> Result<Report, Failure> {
    c.step("scan");
    let mut found = vec![];
    for node in NODES {
        c.turn_to(node, SCAN);
        if let Ok(firmware) = c.read(&entries::FIRMWARE_VERSION).await {
            found.push((node, firmware));
        }
        if c.is_interrupted() {
            return Err(Failure::Interrupted);
        }
    }
    let nodes: Vec<u8> = found.iter().map(|(node, _)| *node).collect();
    let words = |node| {
        let firmware = found.iter().find(|(found, _)| *found == node).map_or(0, |(_, firmware)| *firmware);
        format!("eRob with its own protocol, firmware {firmware}")
    };
    Ok(report(&nodes, words))
}
