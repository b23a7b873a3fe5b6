//! The identity of a drive (objects 1000 and 1018) and its texts.

use takt_wire::canopen::objects::*;

use super::axis_session::{AxisSession, StepResult};
use super::check::Check;

/// A device of the profile CiA 402.
pub const PROFILE_CIA402: Check = Check::Profile(402);

/// Compares the drive's identity with the configuration. `unknown` is expected of a device type that is not configured.
pub async fn compare(c: &AxisSession<'_>, unknown: Check) -> StepResult {
    c.step(
        "identity",
        "another drive than configured answers under this node ID: check the wiring and the node IDs, or correct \
         `identity` in the configuration",
    );
    let configured = c.axis.identity;
    let expected = |value: Option<u32>| value.map_or(Check::Any, |value| Check::Equals(value.into()));
    let device_type = configured.device_type;
    let profile = device_type.map_or(unknown, |value| Check::Equals(value.into()));
    c.read(DEVICE_TYPE, profile, |facts, value| facts.identity.device_type = value as u32).await?;
    let vendor = expected(configured.vendor);
    c.read(VENDOR_ID, vendor, |facts, value| facts.identity.vendor_id = value as u32).await?;
    let product = expected(configured.product);
    c.read(PRODUCT_CODE, product, |facts, value| facts.identity.product_code = value as u32).await?;
    let revision = expected(configured.revision);
    c.read(REVISION_NUMBER, revision, |facts, value| facts.identity.revision_number = value as u32).await
}

/// Reads the names and versions that the drive has.
pub async fn read_texts(c: &AxisSession<'_>) -> StepResult {
    c.read_text(DEVICE_NAME, |facts, text| facts.texts.device_name = Some(text)).await?;
    c.read_text(HARDWARE_VERSION, |facts, text| facts.texts.hardware_version = Some(text)).await?;
    c.read_text(SOFTWARE_VERSION, |facts, text| facts.texts.software_version = Some(text)).await?;
    Ok(())
}
