//! Process data objects, compiled: a mapping becomes a list of shifts and masks between the eight bytes of a frame
//! and the numbers of an axis' process image, so that the cycle packs and unpacks without asking what is what.

use arrayvec::ArrayVec;

/// The PDOs that a CANopen drive has in each direction here.
pub const MAX_PDOS: usize = 4;

/// When a command is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum TransmissionType {
    /// In every cycle of its bus.
    EveryCycle,
    /// When the controlword changes, and again while the drive is not enabled or is not to be.
    OnControlword,
}

/// The most axes of a node (CiA 402-2, multi-axis devices).
pub const MAX_NODE_AXES: u8 = 8;
/// The distance between the objects of two axes of a node.
const AXIS_OFFSET: u16 = 0x800;

/// How many axes a node has before this one, as a factor that no index overflows by.
const fn axes_before(node_axis: u8) -> u16 {
    let before = node_axis.saturating_sub(1);
    if before < MAX_NODE_AXES { before as u16 } else { MAX_NODE_AXES as u16 - 1 }
}

/// The most objects one PDO maps here (byte-wise mapping of classic frames).
pub const MAX_OBJECTS: usize = 8;

/// An object as a mapping parameter names it (CiA 301, 7.5.2.36): index, sub-index and length in bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct MappedObject {
    /// Index in the object dictionary.
    pub index: u16,
    /// Sub-index.
    pub subindex: u8,
    /// Length in bits: 8, 16 or 32.
    pub bits: u8,
}

impl MappedObject {
    /// The object `index:subindex` of `bits` bits.
    pub const fn new(index: u16, subindex: u8, bits: u8) -> Self {
        Self { index, subindex, bits }
    }

    /// Reads the value of a mapping parameter sub-entry.
    pub const fn from_parameter(value: u32) -> Self {
        Self { index: (value >> 16) as u16, subindex: (value >> 8) as u8, bits: value as u8 }
    }

    /// Returns `true` if this is no object but a gap in a mapping: data types map as dummies (CiA 301, 7.4.7.1).
    pub const fn is_dummy(self) -> bool {
        matches!(self.index, 0x0001..=0x001F)
    }

    /// The object of axis number `node_axis` of a node, counted from 1, that this one is of the first axis (CiA 402-2, multi-axis
    /// devices). What is no object of the drive profile is the same for every axis.
    pub const fn of_node_axis(self, node_axis: u8) -> Self {
        match self.index {
            0x6000..=0x67FF => Self { index: self.index + AXIS_OFFSET * axes_before(node_axis), ..self },
            _ => self,
        }
    }

    /// The object of the first axis of a node that corresponds to this one of axis number `node_axis`. One of another axis
    /// corresponds to none, and becomes an object that nobody knows.
    pub const fn as_of_first_axis(self, node_axis: u8) -> Self {
        match self.index {
            0x6000..=0x9FFF => {
                Self { index: self.index.saturating_sub(AXIS_OFFSET * axes_before(node_axis)), ..self }
            }
            _ => self,
        }
    }

    /// The value of a mapping parameter sub-entry.
    pub const fn parameter(self) -> u32 {
        (self.index as u32) << 16 | (self.subindex as u32) << 8 | self.bits as u32
    }
}

impl core::fmt::Display for MappedObject {
    /// The index and the sub-index, as `6041:00`.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:04X}:{:02X}", self.index, self.subindex)
    }
}

/// The commanded numbers of an axis, in drive units, by what they mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum CommandSlot {
    /// 6040
    Controlword,
    /// 6060
    OperationMode,
    /// 607A
    TargetPosition,
    /// 60FF
    TargetVelocity,
    /// 6071
    TargetTorque,
    /// 60B1
    VelocityOffset,
    /// 60B2
    TorqueOffset,
    /// An object without a value. A gap in a mapping is filled with zero, anything else is refused.
    Zero,
}

/// The reported numbers of an axis, in drive units, by what they mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum FeedbackSlot {
    /// 6041
    Statusword,
    /// 6061
    OperationModeDisplay,
    /// 6064
    Position,
    /// 606C
    Velocity,
    /// 6077
    Torque,
    /// 6078
    Current,
    /// 603F
    ErrorCode,
    /// An object that takt has no use for.
    Ignored,
}

impl CommandSlot {
    /// Where an object's value comes from; [`CommandSlot::Zero`] for one that takt does not know.
    pub const fn of(object: MappedObject) -> Self {
        match (object.index, object.subindex) {
            (0x6040, 0) => Self::Controlword,
            (0x6060, 0) => Self::OperationMode,
            // 60C1:1, the target of interpolated position, is a position as well.
            (0x607A, 0) | (0x60C1, 1) => Self::TargetPosition,
            (0x60FF, 0) => Self::TargetVelocity,
            (0x6071, 0) => Self::TargetTorque,
            (0x60B1, 0) => Self::VelocityOffset,
            (0x60B2, 0) => Self::TorqueOffset,
            _ => Self::Zero,
        }
    }
}

impl CommandSlot {
    /// The object whose value it is.
    pub const fn object(self) -> MappedObject {
        match self {
            Self::Controlword => MappedObject::new(0x6040, 0, 16),
            Self::OperationMode => MappedObject::new(0x6060, 0, 8),
            Self::TargetPosition => MappedObject::new(0x607A, 0, 32),
            Self::TargetVelocity => MappedObject::new(0x60FF, 0, 32),
            Self::TargetTorque => MappedObject::new(0x6071, 0, 16),
            Self::VelocityOffset => MappedObject::new(0x60B1, 0, 32),
            Self::TorqueOffset => MappedObject::new(0x60B2, 0, 16),
            Self::Zero => MappedObject::new(0x0005, 0, 8),
        }
    }
}

impl FeedbackSlot {
    /// Where an object's value goes; [`FeedbackSlot::Ignored`] for one that takt does not know.
    pub const fn of(object: MappedObject) -> Self {
        match (object.index, object.subindex) {
            (0x6041, 0) => Self::Statusword,
            (0x6061, 0) => Self::OperationModeDisplay,
            (0x6064, 0) => Self::Position,
            (0x606C, 0) => Self::Velocity,
            (0x6077, 0) => Self::Torque,
            (0x6078, 0) => Self::Current,
            (0x603F, 0) => Self::ErrorCode,
            _ => Self::Ignored,
        }
    }

    const fn is_signed(self) -> bool {
        !matches!(self, Self::Statusword | Self::ErrorCode | Self::Ignored)
    }
}

/// A set of the numbers that an axis may report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(crate) struct FeedbackSlots(u8);

impl FeedbackSlots {
    /// The numbers that these feedback mappings fill together.
    pub(crate) fn of<'a>(mappings: impl IntoIterator<Item = &'a Mapping>) -> Self {
        let fields = mappings.into_iter().flat_map(|mapping| &mapping.fields);
        Self(fields.fold(0, |slots, field| slots | 1 << (field.slot & 7)))
    }

    /// These numbers.
    pub(crate) fn with(slots: impl IntoIterator<Item = FeedbackSlot>) -> Self {
        Self(slots.into_iter().fold(0, |set, slot| set | 1 << (slot as u8 & 7)))
    }

    /// Returns `true` if a number is in the set.
    pub(crate) const fn contains(self, slot: FeedbackSlot) -> bool {
        self.0 >> slot as u8 & 1 == 1
    }
}

const IMAGE_SLOTS: usize = 8;

/// The numbers of one direction of an axis, in drive units. Unsigned 32-bit objects keep their bit pattern.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct ProcessImage([i32; IMAGE_SLOTS]);

impl ProcessImage {
    /// Sets what will be sent.
    pub fn set(&mut self, slot: CommandSlot, value: i32) {
        self.0[slot as usize % IMAGE_SLOTS] = value;
    }

    /// What will be sent.
    pub fn command(&self, slot: CommandSlot) -> i32 {
        self.0[slot as usize % IMAGE_SLOTS]
    }

    /// Takes what was received.
    pub(crate) fn take(&mut self, slot: FeedbackSlot, value: i32) {
        self.0[slot as usize % IMAGE_SLOTS] = value;
    }

    /// What was received last; 0 when nothing was.
    pub fn feedback(&self, slot: FeedbackSlot) -> i32 {
        self.0[slot as usize % IMAGE_SLOTS]
    }
}

/// One object of a compiled mapping: `bits` bits from bit `shift` of the payload, to or from image slot `slot`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
struct Field {
    shift: u8,
    slot: u8,
    mask: u32,
    /// The sign bit of a signed object narrower than 32 bits, else 0.
    sign: u32,
}

/// A compiled PDO mapping.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Mapping {
    fields: ArrayVec<Field, MAX_OBJECTS>,
    bytes: u8,
}

/// Why a mapping cannot be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MappingError {
    /// More than [`MAX_OBJECTS`] objects.
    TooManyObjects {
        /// How many were given.
        given: usize,
    },
    /// More than the eight bytes of a classic frame.
    TooLong {
        /// The object that no longer fits.
        object: MappedObject,
        /// The length up to and with it, in bits.
        bits: u32,
    },
    /// A length other than 8, 16 or 32 bits.
    Width {
        /// The object.
        object: MappedObject,
    },
    /// An object that takt would have to send but has no value for.
    NothingToSend {
        /// The object.
        object: MappedObject,
    },
}

impl core::error::Error for MappingError {}

impl core::fmt::Display for MappingError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooManyObjects { given } => {
                write!(f, "{given} objects are mapped, but a PDO takes no more than {MAX_OBJECTS}")
            }
            Self::TooLong { object, bits } => {
                write!(f, "the PDO is {bits} bits long with object {object}, but takes no more than 64")
            }
            Self::Width { object } => {
                write!(f, "object {object} is mapped with {} bits, not 8, 16 or 32", object.bits)
            }
            Self::NothingToSend { object } => write!(f, "there is no value to send for object {object}"),
        }
    }
}

impl Mapping {
    /// Compiles what we send to a drive (its RPDO). Gaps are filled with zero.
    pub fn commands(objects: &[MappedObject]) -> Result<Self, MappingError> {
        Self::compile(objects, |object| match CommandSlot::of(object) {
            CommandSlot::Zero if !object.is_dummy() => Err(MappingError::NothingToSend { object }),
            slot => Ok((slot as u8, false)),
        })
    }

    /// Compiles what a drive sends to us (its TPDO). Objects without a use here are passed over in place.
    pub fn feedback(objects: &[MappedObject]) -> Result<Self, MappingError> {
        Self::compile(objects, |object| {
            let slot = FeedbackSlot::of(object);
            Ok((slot as u8, slot.is_signed()))
        })
    }

    /// The bits of the payload that carry a number, and not a gap.
    pub(crate) fn own_bits(&self) -> u64 {
        let fields = self.fields.iter().filter(|field| field.slot != CommandSlot::Zero as u8);
        fields.fold(0, |bits, field| bits | u64::from(field.mask) << field.shift)
    }

    fn compile(
        objects: &[MappedObject],
        slot_of: impl Fn(MappedObject) -> Result<(u8, bool), MappingError>,
    ) -> Result<Self, MappingError> {
        let mut fields = ArrayVec::new();
        let mut shift = 0u32;
        for &object in objects {
            if !matches!(object.bits, 8 | 16 | 32) {
                return Err(MappingError::Width { object });
            }
            let end = shift + u32::from(object.bits);
            if end > 64 {
                return Err(MappingError::TooLong { object, bits: end });
            }
            let (slot, signed) = slot_of(object)?;
            let sign = if signed && object.bits < 32 { 1 << (object.bits - 1) } else { 0 };
            let mask = u32::MAX >> (32 - object.bits);
            fields
                .try_push(Field { shift: shift as u8, slot, mask, sign })
                .map_err(|_| MappingError::TooManyObjects { given: objects.len() })?;
            shift = end;
        }
        Ok(Self { fields, bytes: (shift / 8) as u8 })
    }

    /// Returns `true` if it carries a number to a drive, where it is a mapping of commands.
    pub fn sends(&self, slot: CommandSlot) -> bool {
        self.fields.iter().any(|field| field.slot == slot as u8)
    }

    /// The length of the payload in bytes.
    pub fn length(&self) -> usize {
        self.bytes.into()
    }

    /// Packs the image into a payload, of which the first [`Mapping::length`] bytes count.
    pub fn pack(&self, image: &ProcessImage) -> [u8; 8] {
        let mut word = 0u64;
        for field in &self.fields {
            let value = image.0[field.slot as usize % IMAGE_SLOTS] as u32 & field.mask;
            word |= u64::from(value) << (field.shift & 63);
        }
        word.to_le_bytes()
    }

    /// Unpacks a payload (the first eight bytes, low byte first) of `length` bytes into the image. A payload
    /// shorter than the mapping changes nothing and is refused; a longer one is taken (CiA 301, 7.2.2.4).
    pub fn unpack(&self, word: u64, length: usize, image: &mut ProcessImage) -> Result<(), TooShort> {
        if length < self.length() {
            return Err(TooShort { expected: self.length(), received: length });
        }
        for field in &self.fields {
            let raw = (word >> (field.shift & 63)) as u32 & field.mask;
            image.0[field.slot as usize % IMAGE_SLOTS] = (raw ^ field.sign).wrapping_sub(field.sign) as i32;
        }
        Ok(())
    }
}

/// A PDO with fewer bytes than its mapping says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooShort {
    /// What the mapping says, in bytes.
    pub expected: usize,
    /// What came, in bytes.
    pub received: usize,
}

impl core::error::Error for TooShort {}

impl core::fmt::Display for TooShort {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { expected, received } = self;
        write!(f, "the PDO has {received} bytes, but its mapping has {expected}")
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    const STATUSWORD: MappedObject = MappedObject::new(0x6041, 0, 16);
    const POSITION: MappedObject = MappedObject::new(0x6064, 0, 32);
    const MODE: MappedObject = MappedObject::new(0x6061, 0, 8);
    const TORQUE: MappedObject = MappedObject::new(0x6077, 0, 16);
    const CONTROLWORD: MappedObject = MappedObject::new(0x6040, 0, 16);
    const TARGET: MappedObject = MappedObject::new(0x607A, 0, 32);

    #[test]
    fn the_manuals_set_point_frame_comes_out_byte_for_byte() {
        let mapping = Mapping::commands(&[CONTROLWORD, TARGET]).unwrap();
        let mut image = ProcessImage::default();
        image.set(CommandSlot::Controlword, 0x2F);
        image.set(CommandSlot::TargetPosition, 2_225_000);
        assert_eq!(mapping.pack(&image)[..mapping.length()], [0x2F, 0x00, 0x68, 0xF3, 0x21, 0x00]);
    }

    #[test]
    fn signed_objects_keep_their_sign_and_words_do_not_grow_one() {
        let mapping = Mapping::feedback(&[STATUSWORD, MODE, TORQUE]).unwrap();
        let mut image = ProcessImage::default();
        let payload = u64::from_le_bytes([0xB7, 0x92, 0xFF, 0x18, 0xFC, 0, 0, 0]);
        mapping.unpack(payload, 5, &mut image).unwrap();
        assert_eq!(image.feedback(FeedbackSlot::Statusword), 0x92B7);
        assert_eq!(image.feedback(FeedbackSlot::OperationModeDisplay), -1);
        assert_eq!(image.feedback(FeedbackSlot::Torque), -1000);
    }

    #[test]
    fn a_short_pdo_changes_nothing() {
        let mapping = Mapping::feedback(&[STATUSWORD, POSITION]).unwrap();
        let mut image = ProcessImage::default();
        assert_eq!(mapping.unpack(u64::MAX, 5, &mut image), Err(TooShort { expected: 6, received: 5 }));
        assert_eq!(image, ProcessImage::default());
    }

    #[test]
    fn mappings_that_cannot_be_are_refused_with_the_object() {
        let bit = MappedObject::new(0x6041, 0, 1);
        assert_eq!(Mapping::feedback(&[bit]), Err(MappingError::Width { object: bit }));
        assert_eq!(
            Mapping::feedback(&[POSITION, POSITION, MODE]),
            Err(MappingError::TooLong { object: MODE, bits: 72 })
        );
        let unknown = MappedObject::new(0x2005, 1, 16);
        assert_eq!(Mapping::commands(&[unknown]), Err(MappingError::NothingToSend { object: unknown }));
        assert!(Mapping::feedback(&[unknown]).is_ok());
        // Its value would be zero in every cycle: a drive that does not move.
        let profile_velocity = MappedObject::new(0x6081, 0, 32);
        let refused = Mapping::commands(&[CONTROLWORD, profile_velocity]);
        assert_eq!(refused, Err(MappingError::NothingToSend { object: profile_velocity }));
        assert!(Mapping::commands(&[MappedObject::new(0x60B1, 0, 32)]).is_ok());
        let gap = MappedObject::new(0x0005, 0, 8);
        assert_eq!(Mapping::commands(&[gap, TARGET]).unwrap().length(), 5);
    }

    #[test]
    fn a_mapping_parameter_reads_back_as_it_was_written() {
        assert_eq!(TARGET.parameter(), 0x607A_0020);
        assert_eq!(MappedObject::from_parameter(0x607A_0020), TARGET);
    }

    fn feedback_objects() -> impl Strategy<Value = Vec<MappedObject>> {
        let object = prop_oneof![
            Just(STATUSWORD),
            Just(POSITION),
            Just(MODE),
            Just(TORQUE),
            Just(MappedObject::new(0x3333, 7, 32)),
        ];
        prop::collection::vec(object, 0..=8)
    }

    proptest! {
        #[test]
        fn unpacking_takes_each_object_from_its_own_bytes(objects in feedback_objects(), word: u64) {
            let Ok(mapping) = Mapping::feedback(&objects) else { return Ok(()) };
            let mut image = ProcessImage::default();
            mapping.unpack(word, 8, &mut image).unwrap();
            let bytes = word.to_le_bytes();
            let mut at = 0;
            let mut expected = ProcessImage::default();
            for object in objects {
                let size = usize::from(object.bits / 8);
                let raw = &bytes[at..at + size];
                at += size;
                let value = match size {
                    1 => i32::from(raw[0] as i8),
                    2 if object == STATUSWORD => i32::from(u16::from_le_bytes([raw[0], raw[1]])),
                    2 => i32::from(i16::from_le_bytes([raw[0], raw[1]])),
                    _ => i32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]]),
                };
                expected.0[FeedbackSlot::of(object) as usize] = value;
            }
            prop_assert_eq!(mapping.length(), at);
            prop_assert_eq!(image, expected);
        }

        #[test]
        fn any_payload_and_length_is_answered_without_a_panic(objects in feedback_objects(), word: u64, length in 0usize..=64) {
            if let Ok(mapping) = Mapping::feedback(&objects) {
                let mut image = ProcessImage::default();
                prop_assert_eq!(mapping.unpack(word, length, &mut image).is_ok(), length >= mapping.length());
            }
        }
    }
}
