//! The object dictionary of a simulated device: its objects as an electronic data sheet describes them, their values, and
//! the non-volatile memory.

use crate::canopen::eds;
use crate::canopen::eds::{AccessType, DataTypeCode, ObjectType, ValueKind};
use crate::canopen::object::ObjectAddress;

use super::sdo_reply::AbortCode;

/// Room for a value of variable length, such as a text, when the data sheet has a shorter one: bytes.
const TEXT_CAPACITY: usize = 64;

/// How the value of an object is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectKind {
    /// A number without a sign, or a bit pattern.
    Unsigned,
    /// A number with a sign.
    Signed,
    /// Bytes of variable length: a text or a domain.
    Bytes,
}

/// One entry of the dictionary.
#[derive(Clone, Debug)]
pub struct ObjectEntry {
    /// Index and sub-index.
    pub address: ObjectAddress,
    /// How its value is stored.
    pub kind: ObjectKind,
    /// The length of a number in bytes; 0 for a variable length.
    pub length: usize,
    /// Whether SDO can read it.
    pub is_readable: bool,
    /// Whether SDO can write it.
    pub is_writable: bool,
    /// Whether an RPDO can map it.
    pub maps_to_rpdo: bool,
    /// Whether a TPDO can map it.
    pub maps_to_tpdo: bool,
    /// Whether a restart keeps its value after "save".
    pub is_saved: bool,
    low: i128,
    high: i128,
    default: u64,
    saved: u64,
    value: u64,
    bytes: Vec<u8>,
}

impl ObjectEntry {
    fn mask(&self) -> u64 {
        if self.length >= 8 { u64::MAX } else { (1 << (8 * self.length)) - 1 }
    }

    fn signed(&self, bits: u64) -> i128 {
        let unused = 64 - 8 * self.length.clamp(1, 8) as u32;
        match self.kind {
            ObjectKind::Signed => i128::from((bits << unused).cast_signed() >> unused),
            _ => i128::from(bits & self.mask()),
        }
    }

    fn check_range(&self, bits: u64) -> Result<(), AbortCode> {
        match self.signed(bits) {
            value if value > self.high => Err(AbortCode::ValueTooHigh),
            value if value < self.low => Err(AbortCode::ValueTooLow),
            _ => Ok(()),
        }
    }
}

/// The objects of a device in the order of their addresses. Every entry has a place, by which it is found at once.
#[derive(Clone, Debug, Default)]
pub struct SimulatedDictionary {
    entries: Vec<ObjectEntry>,
    /// The data types that a PDO may map as placeholders.
    dummies: Vec<u16>,
}

impl SimulatedDictionary {
    /// The dictionary of a device with this node ID, by its data sheet. `is_missing` names what the sheet lists and the
    /// device lacks, `is_constant` what it cannot write.
    pub fn of(
        sheet: &eds::ObjectDictionary,
        node: u8,
        is_missing: impl Fn(ObjectAddress) -> bool,
        is_constant: impl Fn(ObjectAddress) -> bool,
    ) -> Self {
        let device_objects = sheet
            .objects
            .iter()
            .filter(|object| object.index >= 0x1000 && object.object_type != ObjectType::Null);
        let mut entries: Vec<ObjectEntry> = vec![];
        for object in device_objects {
            let highest = object.entries.last().map_or(0, |entry| entry.address.subindex);
            let described = object.entries.iter().filter(|entry| !is_missing(entry.address));
            entries.extend(described.map(|entry| {
                let is_count = object.object_type.has_sub_objects() && entry.address.subindex == 0;
                read_entry(entry, node, is_count.then_some(highest), is_constant(entry.address))
            }));
        }
        entries.sort_by_key(|entry| entry.address);
        let mut own = Self { entries, dummies: sheet.dummies.iter().map(|code| code.0).collect() };
        own.take_identity(&sheet.device);
        own
    }

    /// The identity of the device, where object 1018 has no default: the file says it in `[DeviceInfo]` as well.
    fn take_identity(&mut self, device: &eds::DeviceInfo) {
        let stated = [device.vendor_number, device.product_number, device.revision_number];
        for (subindex, number) in (1..).zip(stated) {
            if let (Some(place), Some(number)) = (self.place(0x1018, subindex), number)
                && self.entry(place).value == 0
            {
                self.set_factory(place, number.into());
            }
        }
    }

    /// The place of an entry, or why there is none.
    pub fn find(&self, address: ObjectAddress) -> Result<usize, AbortCode> {
        self.entries.binary_search_by_key(&address, |entry| entry.address).map_err(|place| {
            let is_index_of = |place: Option<usize>| {
                place
                    .and_then(|place| self.entries.get(place))
                    .is_some_and(|entry| entry.address.index == address.index)
            };
            let is_known = is_index_of(place.checked_sub(1)) || is_index_of(Some(place));
            if is_known { AbortCode::NoSubindex } else { AbortCode::NoObject }
        })
    }

    /// The place of an entry, if the device has it.
    pub fn place(&self, index: u16, subindex: u8) -> Option<usize> {
        self.find(ObjectAddress::new(index, subindex)).ok()
    }

    /// An entry.
    pub fn entry(&self, place: usize) -> &ObjectEntry {
        &self.entries[place]
    }

    /// Whether a PDO may map this data type as a placeholder.
    pub fn is_dummy(&self, index: u16) -> bool {
        self.dummies.contains(&index)
    }

    /// The bits of a number.
    pub fn bits(&self, place: usize) -> u64 {
        self.entries[place].value
    }

    /// The value of a number.
    pub fn number(&self, place: usize) -> i64 {
        let entry = &self.entries[place];
        entry.signed(entry.value) as i64
    }

    /// The value of a number, if the device has the object.
    pub fn number_at(&self, place: Option<usize>) -> Option<i64> {
        place.map(|place| self.number(place))
    }

    /// The value of a number as a real one, if the device has the object.
    pub fn real_at(&self, place: Option<usize>) -> Option<f64> {
        self.number_at(place).map(|number| number as f64)
    }

    /// Sets a number; what does not fit its length is cut off, so a position wraps.
    pub fn set(&mut self, place: usize, value: i64) {
        let entry = &mut self.entries[place];
        entry.value = value.cast_unsigned() & entry.mask();
    }

    /// Sets a number, if the device has the object.
    pub fn set_at(&mut self, place: Option<usize>, value: i64) {
        if let Some(place) = place {
            self.set(place, value);
        }
    }

    /// Sets a number to the nearest value that its type has, if the device has the object.
    pub fn set_real_at(&mut self, place: Option<usize>, value: f64) {
        let Some(place) = place else { return };
        let entry = &self.entries[place];
        let bits = 8 * entry.length.clamp(1, 8) as i32;
        let (low, high) = match entry.kind {
            ObjectKind::Signed => (-(2f64.powi(bits - 1)), 2f64.powi(bits - 1) - 1.0),
            _ => (0.0, 2f64.powi(bits) - 1.0),
        };
        self.set(place, value.round_ties_even().clamp(low, high) as i64);
    }

    /// Sets a value that every restart and "load" restores.
    pub fn set_factory(&mut self, place: usize, value: i64) {
        self.set(place, value);
        let entry = &mut self.entries[place];
        (entry.default, entry.saved) = (entry.value, entry.value);
    }

    /// Appends the bytes of an SDO transfer.
    pub fn append(&self, place: usize, value: &mut Vec<u8>) {
        let entry = &self.entries[place];
        match entry.kind {
            ObjectKind::Bytes => value.extend_from_slice(&entry.bytes),
            _ => value.extend(entry.value.to_le_bytes().into_iter().take(entry.length)),
        }
    }

    /// The number in the bytes of an SDO transfer, when its length and its range are right.
    pub fn decode(&self, place: usize, value: &[u8]) -> Result<i64, AbortCode> {
        let entry = &self.entries[place];
        if entry.kind == ObjectKind::Bytes {
            return if value.len() > entry.bytes.capacity() { Err(AbortCode::LengthTooHigh) } else { Ok(0) };
        }
        match value.len() {
            length if length > entry.length => return Err(AbortCode::LengthTooHigh),
            length if length < entry.length => return Err(AbortCode::LengthTooLow),
            _ => {}
        }
        let mut bytes = [0; 8];
        bytes[..value.len()].copy_from_slice(value);
        let bits = u64::from_le_bytes(bytes);
        entry.check_range(bits)?;
        Ok(entry.signed(bits) as i64)
    }

    /// Stores the bytes of an SDO transfer that [`Self::decode`] accepts.
    pub fn store(&mut self, place: usize, value: &[u8]) -> Result<(), AbortCode> {
        let number = self.decode(place, value)?;
        match self.entries[place].kind {
            ObjectKind::Bytes => {
                let bytes = &mut self.entries[place].bytes;
                bytes.clear();
                bytes.extend_from_slice(value);
            }
            _ => self.set(place, number),
        }
        Ok(())
    }

    /// Whether a PDO may write these bits: their range is right.
    pub fn accepts(&self, place: usize, bits: u64) -> bool {
        self.entries[place].check_range(bits).is_ok()
    }

    /// Saves every parameter, as "save" in object 1010 does.
    pub fn save(&mut self) {
        for entry in self.entries.iter_mut().filter(|entry| entry.is_saved) {
            entry.saved = entry.value;
        }
    }

    /// Makes the next restart restore the defaults, as "load" in object 1011 does.
    pub fn forget(&mut self) {
        for entry in &mut self.entries {
            entry.saved = entry.default;
        }
    }

    /// Restores the saved values or defaults of every entry with an index in `indices`, as a restart does.
    pub fn restore(&mut self, indices: std::ops::RangeInclusive<u16>) {
        for entry in self.entries.iter_mut().filter(|entry| indices.contains(&entry.address.index)) {
            entry.value = entry.saved;
        }
    }
}

/// Reads an entry. `count` is the highest sub-index, which sub-index 0 shows when the sheet gives it no value.
fn read_entry(entry: &eds::DictionaryEntry, node: u8, count: Option<u8>, is_constant: bool) -> ObjectEntry {
    let data_type = entry.data_type.unwrap_or(DataTypeCode::DOMAIN);
    let (kind, bits) = match data_type.kind() {
        ValueKind::Unsigned(bits) | ValueKind::Real(bits) => (ObjectKind::Unsigned, bits),
        ValueKind::Signed(bits) => (ObjectKind::Signed, bits),
        ValueKind::Text | ValueKind::Bytes | ValueKind::Other => (ObjectKind::Bytes, 0),
    };
    let encoded = entry.value().and_then(|value| value.encode(data_type, Some(node)));
    let encoded = encoded.unwrap_or_else(|| count.map_or_else(Vec::new, |count| vec![count]));
    let mut value = [0; 8];
    let mut bytes = Vec::new();
    if kind == ObjectKind::Bytes {
        bytes.reserve_exact(TEXT_CAPACITY.max(encoded.len()));
        bytes.extend_from_slice(&encoded);
    } else {
        value.iter_mut().zip(&encoded).for_each(|(to, from)| *to = *from);
    }
    let value = u64::from_le_bytes(value);
    let (low, high) = limits(entry, data_type, node);
    let is_writable = entry.access.is_writable() && !is_constant;
    ObjectEntry {
        address: entry.address,
        kind,
        length: usize::from(bits).div_ceil(8),
        is_readable: entry.access != AccessType::WriteOnly,
        is_writable,
        maps_to_rpdo: entry.is_mappable && is_writable && entry.access != AccessType::ReadWriteRead,
        maps_to_tpdo: entry.is_mappable
            && !matches!(entry.access, AccessType::WriteOnly | AccessType::ReadWriteWrite),
        is_saved: is_writable && !is_command(entry.address.index),
        low,
        high,
        default: value,
        saved: value,
        value,
        bytes,
    }
}

/// The range that the sheet gives, within that of the type. A real number has none here.
fn limits(entry: &eds::DictionaryEntry, data_type: DataTypeCode, node: u8) -> (i128, i128) {
    let Some((lowest, highest)) = data_type.range() else { return (i128::MIN, i128::MAX) };
    let limit = |value: &Option<eds::Value>| value.as_ref().and_then(|value| value.number(Some(node)));
    let low = limit(&entry.low).unwrap_or(lowest).max(lowest);
    let high = limit(&entry.high).unwrap_or(highest).min(highest);
    if low < high { (low, high) } else { (lowest, highest) }
}

/// Whether an object is a command or a set-point, which no device saves.
fn is_command(index: u16) -> bool {
    match index {
        0x1001..=0x1003 | 0x1010 | 0x1011 => true,
        0x6000..=0x9FFF => matches!(
            0x6000 + (index - 0x6000) % 0x800,
            0x6040 | 0x6042 | 0x6060 | 0x6071 | 0x607A | 0x60B0..=0x60B2 | 0x60C1 | 0x60FF
        ),
        _ => false,
    }
}
