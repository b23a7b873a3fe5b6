//! Identity, condition and settings of a YZ-AIM.

use takt_wire::canopen::object::Object;
use takt_wire::canopen::objects::*;
use takt_wire::canopen::sdo::SdoError;

use super::objects::*;
use super::reading::{self, alarm};
use super::words;
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
    condition(c, s, &mut report).await?;
    settings(c, &mut report).await?;
    Ok(report)
}

async fn condition(c: &SdoSession, s: &TargetDrive, report: &mut Report) -> Result<(), Failure> {
    c.step("condition");
    let alarm = alarm(c).await?;
    let clearing = alarm.advice().map_or(String::new(), |advice| format!("; {advice}"));
    report.add("alarm", "alarm", alarm.code(), format!("{alarm}{clearing}"));
    let reading = reading::read(c, s).await?;
    let word = reading.status_bits();
    report.add("state", "state", reading.state, format!("{} ({})", reading.state, words::statusword(word)));
    report.add("statusword", "statusword", word, format!("0x{word:04X}"));
    let mode = c.read(&MODES_OF_OPERATION).await?;
    report.add("mode", "mode", mode, words::mode(mode).unwrap_or("none"));
    let (position, counts) = (reading.position, reading.position_counts);
    let shown = format!("{} ({counts} counts)", s.position_quantity().show(position));
    report.add("position", "position", position, shown);
    report.add("position_counts", "position counts", counts, counts.to_string());
    report.add("velocity", "velocity", reading.velocity, s.velocity_quantity().show(reading.velocity));
    if let Some(current) = reading.current_a {
        report.add("current_a", "current", current, format!("{current} A"));
    }
    for (key, object, factor, unit) in [
        ("voltage_v", VOLTAGE, 1.0 / 327.0, "V"),
        ("temperature_c", TEMPERATURE, 1.0, "°C"),
        ("battery_percent", BATTERY, 10.0, "%"),
    ] {
        if let Some(value) = optional(c, &object).await? {
            let value = (value as f64 * factor * 100.0).round() / 100.0;
            report.add(key, object.name, value, format!("{value} {unit}"));
        }
    }
    Ok(())
}

async fn settings(c: &SdoSession, report: &mut Report) -> Result<(), Failure> {
    c.step("settings");
    if let (Some(numerator), Some(denominator)) =
        (optional(c, &GEAR_NUMERATOR).await?, optional(c, &GEAR_DENOMINATOR).await?)
    {
        report.add(
            "gear",
            "electronic gear",
            format!("{numerator}:{denominator}"),
            format!("{numerator}:{denominator}"),
        );
    }
    for (key, object) in [
        ("position_proportional", POSITION_PROPORTIONAL),
        ("velocity_proportional", VELOCITY_PROPORTIONAL),
        ("velocity_integration_ms", VELOCITY_INTEGRATION),
        ("acceleration", ACCELERATION),
        ("profile_velocity", PROFILE_VELOCITY),
        ("special_function", SPECIAL_FUNCTION),
        ("consumer_heartbeat", CONSUMER_HEARTBEAT_TIME),
        ("producer_heartbeat_ms", PRODUCER_HEARTBEAT_TIME),
    ] {
        if let Some(value) = optional(c, &object).await? {
            let shown = object.show(value);
            let text = meaning(&object, value).map_or(shown.clone(), |words| format!("{shown}: {words}"));
            report.add(key, object.name, value, text);
        }
    }
    Ok(())
}

/// Reads an object that a unit may lack: such a unit aborts the transfer or does not answer.
async fn optional(c: &SdoSession, object: &Object) -> Result<Option<i64>, Failure> {
    match c.read_optional(object).await {
        Err(Failure::Transfer { error: SdoError::NoReply { .. }, .. }) => Ok(None),
        other => other,
    }
}
