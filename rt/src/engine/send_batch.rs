//! The frames for one bus in one cycle.

use arrayvec::ArrayVec;

use crate::frame::Frame;

/// The most frames that the engine hands to one bus in one cycle.
pub const SEND_BATCH: usize = 64;

/// Frames for one bus.
pub type SendBatch = ArrayVec<Frame, SEND_BATCH>;
