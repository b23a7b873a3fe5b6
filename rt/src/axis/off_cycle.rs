//! The report of a drive that is spoken to outside of the cycle, because it answers too slowly for it.

use crate::cia402::DriveState;
use crate::pdo::FeedbackSlot;

/// What a drive has said outside of the cycle. At the joint: rad, rad/s and N·m, or m, m/s and N.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct OffCycleReport {
    /// Its state: [`DriveState::OperationEnabled`] while it follows set-points, [`DriveState::SwitchedOn`] while it is being enabled or
    /// disabled, so that it may have torque.
    pub state: DriveState,
    /// The actual position.
    pub position: f64,
    /// The actual velocity.
    pub velocity: f64,
    /// The actual torque; 0 where it is not known.
    pub torque: f64,
    /// Its error; 0 for none.
    pub error_code: u16,
    /// Its temperature (°C); `None` where it is not known.
    pub temperature: Option<f32>,
}

impl OffCycleReport {
    /// The numbers that it brings.
    pub(super) const SLOTS: [FeedbackSlot; 6] = [
        FeedbackSlot::Statusword,
        FeedbackSlot::OperationModeDisplay,
        FeedbackSlot::Position,
        FeedbackSlot::Velocity,
        FeedbackSlot::Torque,
        FeedbackSlot::ErrorCode,
    ];
}
