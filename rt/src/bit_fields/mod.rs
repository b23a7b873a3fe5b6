//! Drives that are spoken to by frames of fixed bit fields, without an object dictionary: one command for each drive and cycle, and one
//! reply.
//!
//! Which bits of a frame are what is data: [`BitField`] says where a number lies, how wide it is, its sign and its linear scale.
//! [`FrameLayout`] checks that and compiles it to shifts and masks, as [`Mapping`](crate::Mapping) does for PDOs. [`FieldFrame`] adds
//! identifier and kind of frame. How a drive is started and stopped is code: [`LifeCycle`].

mod drive;
mod frame;
mod layout;
mod life_cycle;
mod values;

pub use drive::{
    BesideTarget, FieldDrive, FieldDriveParameters, FieldGains, FieldTargets, MAX_SETUP_FRAMES,
    PositionReference, RunningMode, SetUpAgain,
};
pub use frame::{FieldFrame, ReplyError, StateCodes};
pub use layout::{
    BitField, BitRange, ByteOrder, CodeRange, FieldBits, FrameLayout, LayoutError, LinearScale,
    MAX_FIELD_BYTES, MAX_FIELDS, Number,
};
pub use life_cycle::{
    CommandTargets, FieldMode, Life, LifeCycle, LifeState, LifeStep, LifeWish, ModeCodes, OwnFrame,
    OwnFrames, Setting,
};
pub use values::{CommandValue, CommandValues, FieldValue, ReplyValue, ReplyValues};
