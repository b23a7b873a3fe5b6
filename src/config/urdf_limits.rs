//! Limits of an axis that come from a robot description.

use std::path::PathBuf;

use serde::Serialize;

/// Which limits of an axis come from a robot description.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UrdfLimits {
    /// The file.
    pub file: PathBuf,
    /// The joint there.
    pub joint: String,
    /// Origin of the position limits.
    pub position: LimitOrigin,
    /// Origin of the velocity limit.
    pub velocity: LimitOrigin,
    /// Origin of the torque limit.
    pub torque: LimitOrigin,
}

/// Origin of a limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LimitOrigin {
    /// The configuration, which may be narrower than the robot description.
    Configuration,
    /// `<limit>` of the joint.
    Limit,
    /// The soft limits in `<safety_controller>` of the joint, which are narrower.
    SafetyController,
}
