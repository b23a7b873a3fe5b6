//! A frame of bit fields on the wire.

use super::layout::{BitField, ByteOrder, FrameLayout, LayoutError};
use super::values::{CommandValue, CommandValues, FieldValue, ReplyValue, ReplyValues};
use crate::frame::{Frame, FrameFormat, Id};
use crate::sender_byte::SenderByte;
use core::marker::PhantomData;

/// A command to a drive or a reply of one: identifier, kind of frame and layout.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct FieldFrame<V> {
    id: Id,
    format: FrameFormat,
    sender: Option<SenderByte>,
    states: Option<StateCodes>,
    layout: FrameLayout,
    direction: PhantomData<V>,
}

/// The codes of [`ReplyValue::State`]. Every other one is an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct StateCodes {
    /// The drive has no torque.
    pub stopped: u8,
    /// The drive has torque.
    pub running: u8,
}

/// A frame that is no reply of this layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReplyError {
    /// It has another length. A drive may show its mode by the length of its replies.
    Length {
        /// The length of the layout in bytes.
        expected: usize,
        /// The length of the frame in bytes.
        received: usize,
    },
    /// A field holds no finite number.
    NoNumber {
        /// The field, by its place in the layout.
        field: usize,
    },
}

impl core::error::Error for ReplyError {}

impl core::fmt::Display for ReplyError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Length { expected, received } => {
                write!(f, "a reply has {received} bytes instead of {expected}")
            }
            Self::NoNumber { field } => write!(f, "field {field} of a reply holds no finite number"),
        }
    }
}

impl<V: FieldValue> FieldFrame<V> {
    /// Compiles a frame of `bytes` bytes; see [`FrameLayout::compile`].
    ///
    /// # Errors
    /// What is wrong with a field, or a length that such a frame does not have.
    pub fn compile(
        id: Id,
        format: FrameFormat,
        bytes: usize,
        order: ByteOrder,
        fields: &[BitField<V>],
    ) -> Result<Self, LayoutError> {
        let has_length = match format {
            FrameFormat::Classic => bytes <= 8,
            FrameFormat::Fd | FrameFormat::FdBitRateSwitch => matches!(bytes, 0..=8 | 12 | 16),
        };
        if !has_length {
            return Err(LayoutError::Length { bytes });
        }
        let layout = FrameLayout::compile(bytes, order, fields)?;
        Ok(Self { id, format, sender: None, states: None, layout, direction: PhantomData })
    }

    /// The same, known by a byte of its payload where several drives send by its identifier.
    #[must_use]
    pub fn sent_by(self, sender: SenderByte) -> Self {
        Self { sender: Some(sender), ..self }
    }

    /// Its identifier.
    pub const fn id(&self) -> Id {
        self.id
    }

    /// Its kind.
    pub const fn format(&self) -> FrameFormat {
        self.format
    }

    /// Returns `true` if it has a field for a value.
    pub fn carries(&self, value: V) -> bool {
        let is_of_state = |shown: ReplyValue| self.states.is_some() && shown.slot() == value.slot();
        self.layout.carries(value.slot()) || is_of_state(ReplyValue::Run) || is_of_state(ReplyValue::Error)
    }

    /// The byte by which it is known where several drives send by its identifier.
    pub const fn sender(&self) -> Option<SenderByte> {
        self.sender
    }
}

impl FieldFrame<CommandValue> {
    /// What one code of a field is, in the unit of its value; 0 where there is no such field, or codes are not whole numbers.
    pub fn unit_of(&self, value: CommandValue) -> f64 {
        self.layout.unit_of(value.slot())
    }

    /// The frame that carries these values.
    #[inline]
    pub fn frame(&self, values: &CommandValues) -> Frame {
        let bytes = self.layout.pack(&values.0);
        let payload = bytes.get(..self.layout.length()).unwrap_or_default();
        Frame::filled(self.id, self.format.kind(), payload)
    }

    /// The values that a frame of this layout carries: what [`FieldFrame::frame`] has packed, for those who listen.
    ///
    /// # Errors
    /// The frame is no command of this layout.
    pub fn values(&self, frame: &Frame) -> Result<CommandValues, ReplyError> {
        let (expected, received) = (self.layout.length(), frame.payload().len());
        if expected != received {
            return Err(ReplyError::Length { expected, received });
        }
        let mut values = CommandValues::default();
        self.layout.unpack(frame.payload(), &mut values.0).map_err(|field| ReplyError::NoNumber { field })?;
        Ok(values)
    }
}

impl FieldFrame<ReplyValue> {
    /// The same, whose field for the state has these codes: [`ReplyValue::Run`] and [`ReplyValue::Error`] come from them.
    #[must_use]
    pub fn with_states(self, states: StateCodes) -> Self {
        Self { states: Some(states), ..self }
    }

    /// Takes the values of a reply.
    ///
    /// # Errors
    /// The frame is no reply of this layout. Nothing is changed then.
    #[inline]
    pub fn receive(&self, frame: &Frame, values: &mut ReplyValues) -> Result<(), ReplyError> {
        let (expected, received) = (self.layout.length(), frame.payload().len());
        if expected != received {
            return Err(ReplyError::Length { expected, received });
        }
        self.layout.unpack(frame.payload(), &mut values.0).map_err(|field| ReplyError::NoNumber { field })?;
        if let Some(StateCodes { stopped, running }) = self.states {
            let code = values.get(ReplyValue::State);
            let (is_running, is_stopped) = (code == f64::from(running), code == f64::from(stopped));
            values.set(ReplyValue::Run, f64::from(u8::from(is_running)));
            values.set(ReplyValue::Error, if is_running || is_stopped { 0.0 } else { code });
        }
        Ok(())
    }
}
