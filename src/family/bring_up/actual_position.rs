//! The actual position of a drive (6064), and the target position (607A) made equal to it.

use takt_wire::canopen::objects::{POSITION_ACTUAL_VALUE, TARGET_POSITION};

use super::axis_session::{AxisSession, StepResult};
use super::check::Check;

/// Reads the actual position.
pub async fn read(c: &AxisSession<'_>) -> StepResult {
    c.read(POSITION_ACTUAL_VALUE, Check::Any, |facts, value| facts.position_counts = value as i32).await
}

/// Sets the target position to the actual one. Enabling with an old target would make the axis jump.
pub async fn make_target(c: &AxisSession<'_>) -> StepResult {
    read(c).await?;
    let position = c.facts().position_counts.into();
    c.write_and_read_back(TARGET_POSITION, position).await
}
