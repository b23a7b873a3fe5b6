//! What an eRob says of itself, with its temperature.

use super::objects::TEMPERATURE;
use crate::family::commission::failure::Failure;
use crate::family::commission::profile;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;

/// `info`
pub async fn info(c: &SdoSession, s: &TargetDrive) -> Result<Report, Failure> {
    let mut report = profile::info::info(c, s).await?;
    c.step("temperature");
    if let Some(degrees) = c.read_optional(&TEMPERATURE).await? {
        report.add("temperature_c", "temperature", degrees, format!("{degrees} °C"));
    }
    Ok(report)
}
