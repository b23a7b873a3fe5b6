//! Identity, ratings, condition and errors.

use serde_json::json;
use takt_rt::{DriveState, OperationMode};
use takt_wire::canopen::emcy::{ErrorCode, ErrorRegister};
use takt_wire::canopen::objects::*;

use super::access::read_if_there;
use super::objects::*;
use super::reading;
use super::words::{modes_words, statusword_words};
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;

/// `info`
pub async fn info(c: &SdoSession, s: &TargetDrive) -> Result<Report, Failure> {
    contact::connect(c, s).await?;
    let mut report = Report::new();
    contact::report_identity(c, s, &mut report).await?;
    texts(c, s, &mut report).await?;
    let rated = ratings(c, s, &mut report).await?;
    condition(c, s, rated, &mut report).await?;
    errors(c, s, &mut report).await?;
    Ok(report)
}

async fn texts(c: &SdoSession, s: &TargetDrive, report: &mut Report) -> Result<(), Failure> {
    for (key, label, address) in [
        ("device_name", "device name", DEVICE_NAME),
        ("hardware_version", "hardware version", HARDWARE_VERSION),
        ("software_version", "firmware version", SOFTWARE_VERSION),
    ] {
        if s.has(address)
            && let Some(text) = c.read_text(address).await?
        {
            report.add(key, label, text.clone(), text);
        }
    }
    Ok(())
}

async fn ratings(c: &SdoSession, s: &TargetDrive, report: &mut Report) -> Result<Option<f64>, Failure> {
    c.step("ratings");
    if let Some(current) = read_if_there(c, s, &MOTOR_RATED_CURRENT).await? {
        let amperes = current as f64 / 1000.0;
        report.add("rated_current_a", "rated current", amperes, format!("{amperes} A"));
    }
    let rated = reading::rated_torque(c, s).await?;
    if let Some(rated) = rated {
        report.add("rated_torque", "rated torque", rated, s.effort_quantity().show(rated));
    }
    if let Some(supported) = read_if_there(c, s, &SUPPORTED_DRIVE_MODES).await? {
        report.add("supported_modes", "modes", supported, modes_words(supported as u32));
    }
    Ok(rated)
}

async fn condition(
    c: &SdoSession,
    s: &TargetDrive,
    rated: Option<f64>,
    report: &mut Report,
) -> Result<(), Failure> {
    c.step("condition");
    let reading = reading::read(c, s, rated).await?;
    let word = reading.status_bits();
    report.add("state", "state", DriveState::decode(word).name(), statusword_words(word));
    report.add("statusword", "statusword", word, format!("0x{word:04X}"));
    if let Some(mode) = read_if_there(c, s, &MODES_OF_OPERATION_DISPLAY).await? {
        let known = i8::try_from(mode).ok().and_then(OperationMode::from_number);
        report.add("mode", "mode", mode, known.map_or("none", OperationMode::name));
    }
    let (position, counts) = (reading.position, reading.position_counts);
    let shown = format!("{} ({counts} counts)", s.position_quantity().show(position));
    report.add("position", "position", position, shown);
    report.add("position_counts", "position counts", counts, counts.to_string());
    if !reading.velocity.is_nan() {
        report.add("velocity", "velocity", reading.velocity, s.velocity_quantity().show(reading.velocity));
    }
    if let Some(torque) = reading.torque {
        report.add("torque", "torque", torque, s.effort_quantity().show(torque));
    }
    if let Some(millivolts) = read_if_there(c, s, &DC_LINK_VOLTAGE).await? {
        let volts = millivolts as f64 / 1000.0;
        report.add("voltage_v", "DC link voltage", volts, format!("{volts} V"));
    }
    if let Some(degrees) = reading.temperature_c {
        report.add("temperature_c", "temperature", degrees, format!("{degrees} °C"));
    }
    Ok(())
}

async fn errors(c: &SdoSession, s: &TargetDrive, report: &mut Report) -> Result<(), Failure> {
    c.step("errors");
    if let Some(register) = read_if_there(c, s, &ERROR_REGISTER).await? {
        report.add("error_register", "error register", register, ErrorRegister(register as u8).to_string());
    }
    if let Some(code) = read_if_there(c, s, &ERROR_CODE).await? {
        let code = code as u16;
        report.add("error_code", "error", code, s.error_words(code));
        if code != ErrorCode::NONE.0 {
            c.note(s.error_cure(code));
        }
    }
    let count = read_if_there(c, s, &ERROR_HISTORY_COUNT).await?.unwrap_or(0);
    let mut history = vec![];
    for entry in 1..=u8::try_from(count).unwrap_or(0) {
        if let Some(value) = read_if_there(c, s, &error_history(entry)).await? {
            history.push(value as u16);
        }
    }
    let words: Vec<String> = history.iter().map(|code| s.error_words(*code).to_string()).collect();
    let text = if words.is_empty() { "empty".to_owned() } else { words.join(", ") };
    report.add("error_history", "error history", json!(history), text);
    Ok(())
}
