//! What the fields of commands and replies carry.

/// What a field of a command carries. Values are in SI units at the joint; a mode is a code of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
#[repr(u8)]
pub enum CommandValue {
    /// rad (m)
    Position,
    /// rad/s (m/s)
    Velocity,
    /// N·m (N)
    Torque,
    /// The gain of the drive's position loop: N·m/rad, or the drive's own unit.
    Stiffness,
    /// The damping of the drive's position loop: N·m·s/rad, or the drive's own unit.
    Damping,
    /// The mode of operation.
    Mode,
    /// 1: the drive is to have torque.
    Run,
    /// 1: the present position is to become zero.
    Zero,
    /// Always zero: what is sent is the code of zero.
    Nothing,
}

/// What a field of a reply carries. Values are in SI units at the joint; states are codes of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
#[repr(u8)]
pub enum ReplyValue {
    /// rad (m)
    Position,
    /// rad/s (m/s)
    Velocity,
    /// N·m (N)
    Torque,
    /// °C
    Temperature,
    /// The mode of operation.
    Mode,
    /// 1: the drive has torque.
    Run,
    /// An error, or 0 for none.
    Error,
    /// The number by which the drive names itself.
    Sender,
    /// Nothing that is used here.
    Ignored,
    /// A code that shows stopped, running, or an error, see [`FieldFrame::with_states`](super::FieldFrame::with_states).
    State,
}

/// What a field may carry in one direction.
pub trait FieldValue: Copy {
    /// Its place among the values of its direction, below 10.
    fn slot(self) -> u8;
    /// Returns `true` if a frame may have several fields with it.
    fn may_repeat(self) -> bool;
}

impl FieldValue for CommandValue {
    fn slot(self) -> u8 {
        self as u8
    }

    fn may_repeat(self) -> bool {
        self == Self::Nothing
    }
}

impl FieldValue for ReplyValue {
    fn slot(self) -> u8 {
        self as u8
    }

    fn may_repeat(self) -> bool {
        self == Self::Ignored
    }
}

/// Values in each direction.
pub(super) const SLOTS: usize = 10;

/// What a drive is to be told. Everything is zero at first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CommandValues(pub(super) [f64; SLOTS]);

impl CommandValues {
    /// Sets a value. [`CommandValue::Nothing`] stays zero.
    pub fn set(&mut self, value: CommandValue, to: f64) {
        if let Some(place) = self.0.get_mut(usize::from(value.slot())).filter(|_| !value.may_repeat()) {
            *place = to;
        }
    }

    /// A value.
    pub fn get(&self, value: CommandValue) -> f64 {
        self.0.get(usize::from(value.slot())).copied().unwrap_or(0.0)
    }
}

/// What a drive has replied last. Everything is zero at first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct ReplyValues(pub(super) [f64; SLOTS]);

impl ReplyValues {
    /// A value.
    pub fn get(&self, value: ReplyValue) -> f64 {
        self.0.get(usize::from(value.slot())).copied().unwrap_or(0.0)
    }

    pub(super) fn set(&mut self, value: ReplyValue, to: f64) {
        if let Some(place) = self.0.get_mut(usize::from(value.slot())) {
            *place = to;
        }
    }
}
