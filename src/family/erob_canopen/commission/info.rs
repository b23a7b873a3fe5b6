//! What an eRob says of itself, with its temperature.

use takt_rt::Nanoseconds;

use super::objects::TEMPERATURE;
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::polling;
use crate::family::commission::profile;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;
use crate::procedure::AxisReading;

/// `info`
pub async fn info(c: &SdoSession, s: &TargetDrive) -> Result<Report, Failure> {
    let mut report = profile::info::info(c, s).await?;
    c.step("temperature");
    if let Some(degrees) = c.read_optional(&TEMPERATURE).await? {
        report.add("temperature_c", "temperature", degrees, format!("{degrees} °C"));
    }
    Ok(report)
}

/// `watch`
pub async fn watch(
    c: &SdoSession,
    s: &TargetDrive,
    every_ns: Nanoseconds,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    contact::connect(c, s).await?;
    let rated = profile::reading::rated_torque(c, s).await?;
    let read_all = async || {
        let reading = profile::reading::read(c, s, rated).await?;
        let temperature = c.read_optional(&TEMPERATURE).await?;
        Ok(AxisReading { temperature_c: temperature.map(|degrees| degrees as f64), ..reading })
    };
    polling::watch(c, every_ns, duration_ns, read_all).await
}
