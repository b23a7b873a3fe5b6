//! The object dictionary of a simulated device: its objects as an electronic data sheet describes them, their
//! values, and the non-volatile memory.

use takt_wire::canopen::eds;
use takt_wire::canopen::eds::{AccessType, DataTypeCode, ObjectType, ValueKind};
use takt_wire::canopen::object::ObjectAddress;

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
    /// True if SDO can read it.
    pub is_readable: bool,
    /// True if SDO can write it.
    pub is_writable: bool,
    /// True if an RPDO can map it.
    pub maps_to_rpdo: bool,
    /// True if a TPDO can map it.
    pub maps_to_tpdo: bool,
    /// True if a restart keeps its value after "save".
    pub is_saved: bool,
    low: i128,
    high: i128,
    default: i64,
    saved: i64,
    /// The only values that it takes; empty: every one within its range.
    choices: Vec<i64>,
    bytes: Vec<u8>,
    /// Bits of 64 that its type does not use, and the range of its type.
    unused_bits: u32,
    type_range: (i64, i64),
}

impl ObjectEntry {
    /// An entry of this type that can be read, with the value 0.
    fn new(address: ObjectAddress, data_type: DataTypeCode) -> Self {
        let (kind, bits) = match data_type.kind() {
            ValueKind::Unsigned(bits) | ValueKind::Real(bits) => (ObjectKind::Unsigned, bits),
            ValueKind::Signed(bits) => (ObjectKind::Signed, bits),
            ValueKind::Text | ValueKind::Bytes | ValueKind::Other => (ObjectKind::Bytes, 0),
        };
        let length = usize::from(bits).div_ceil(8);
        let unused_bits = 64 - 8 * length.clamp(1, 8) as u32;
        let type_range = match kind {
            ObjectKind::Signed => (i64::MIN >> unused_bits, i64::MAX >> unused_bits),
            _ => (0, i64::try_from(u64::MAX >> unused_bits).unwrap_or(i64::MAX)),
        };
        Self {
            address,
            kind,
            length,
            is_readable: true,
            is_writable: false,
            maps_to_rpdo: false,
            maps_to_tpdo: false,
            is_saved: false,
            low: i128::MIN,
            high: i128::MAX,
            default: 0,
            saved: 0,
            choices: vec![],
            bytes: vec![],
            unused_bits,
            type_range,
        }
    }

    /// The number in these bits, of which those beyond its length are cut off.
    fn fit(&self, bits: i64) -> i64 {
        let aligned = bits << self.unused_bits;
        match self.kind {
            ObjectKind::Signed => aligned >> self.unused_bits,
            _ => (aligned.cast_unsigned() >> self.unused_bits).cast_signed(),
        }
    }

    /// The nearest whole number that its type has.
    fn nearest(&self, value: f64) -> i64 {
        let (lowest, highest) = self.type_range;
        (value.round_ties_even() as i64).clamp(lowest, highest)
    }

    fn check_range(&self, number: i64) -> Result<(), AbortCode> {
        if !self.choices.is_empty() && !self.choices.contains(&number) {
            return Err(AbortCode::Value);
        }
        let number = match self.kind {
            ObjectKind::Signed => i128::from(number),
            _ => i128::from(number.cast_unsigned()),
        };
        match number {
            number if number > self.high => Err(AbortCode::ValueTooHigh),
            number if number < self.low => Err(AbortCode::ValueTooLow),
            _ => Ok(()),
        }
    }
}

/// The objects of a device in the order of their addresses. Every entry has a place, by which it is found at once.
#[derive(Clone, Debug, Default)]
pub struct SimulatedDictionary {
    entries: Vec<ObjectEntry>,
    /// The numbers of the entries; one without a sign has the bits of its value.
    numbers: Vec<i64>,
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
                // The error history counts the errors in it, of which there are none.
                let is_count = object.object_type.has_sub_objects()
                    && entry.address.subindex == 0
                    && object.index != 0x1003;
                read_entry(entry, node, is_count.then_some(highest), is_constant(entry.address))
            }));
        }
        let mut own = Self::with(entries, sheet.dummies.iter().map(|code| code.0).collect());
        own.take_identity(&sheet.device);
        own
    }

    fn with(mut entries: Vec<ObjectEntry>, dummies: Vec<u16>) -> Self {
        entries.sort_by_key(|entry| entry.address);
        let numbers = entries.iter().map(|entry| entry.default).collect();
        Self { entries, numbers, dummies }
    }

    /// The identity of the device, where object 1018 has no default: the file says it in `[DeviceInfo]` as well.
    fn take_identity(&mut self, device: &eds::DeviceInfo) {
        let stated = [device.vendor_number, device.product_number, device.revision_number];
        for (subindex, number) in (1..).zip(stated) {
            if let (Some(place), Some(number)) = (self.place(0x1018, subindex), number)
                && self.number(place) == 0
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

    /// Returns `true` if a PDO may map this data type as a placeholder.
    pub fn is_dummy(&self, index: u16) -> bool {
        self.dummies.contains(&index)
    }

    /// The value of a number.
    pub fn number(&self, place: usize) -> i64 {
        self.numbers[place]
    }

    /// The value of a number as a real one.
    pub fn real(&self, place: usize) -> f64 {
        self.numbers[place] as f64
    }

    /// The value of a number, if the device has the object.
    pub fn number_at(&self, place: Option<usize>) -> Option<i64> {
        place.map(|place| self.number(place))
    }

    /// The value of a number as a real one, if the device has the object.
    pub fn real_at(&self, place: Option<usize>) -> Option<f64> {
        place.map(|place| self.real(place))
    }

    /// The value that a restart restores.
    pub fn saved(&self, place: usize) -> i64 {
        self.entries[place].saved
    }

    /// Sets a number; what does not fit its length is cut off, so a position wraps.
    pub fn set(&mut self, place: usize, value: i64) {
        self.numbers[place] = self.entries[place].fit(value);
    }

    /// Sets a number, if the device has the object.
    pub fn set_at(&mut self, place: Option<usize>, value: i64) {
        if let Some(place) = place {
            self.set(place, value);
        }
    }

    /// Sets a number to the nearest value that its type has.
    pub fn set_real(&mut self, place: usize, value: f64) {
        self.numbers[place] = self.entries[place].nearest(value);
    }

    /// Sets a number to the nearest value that its type has, if the device has the object.
    pub fn set_real_at(&mut self, place: Option<usize>, value: f64) {
        if let Some(place) = place {
            self.set_real(place, value);
        }
    }

    /// Sets a number to the nearest value within its range, if the device has the object.
    pub fn set_within_at(&mut self, place: Option<usize>, value: f64) {
        let Some(place) = place else { return };
        let entry = &self.entries[place];
        let nearest = i128::from(entry.nearest(value));
        self.numbers[place] = nearest.min(entry.high).max(entry.low) as i64;
    }

    /// Sets a value that every restart and "load" restores.
    pub fn set_factory(&mut self, place: usize, value: i64) {
        self.set(place, value);
        let entry = &mut self.entries[place];
        (entry.default, entry.saved) = (self.numbers[place], self.numbers[place]);
    }

    /// Sets the defaults that follow from the node ID to those of another one.
    pub fn set_node(&mut self, sheet: &eds::ObjectDictionary, node: u8) {
        for entry in sheet.entries() {
            let number = |node| entry.value().and_then(|value| value.number(Some(node)));
            let Some(place) = self.place(entry.address.index, entry.address.subindex) else { continue };
            if let Some(default) = number(node)
                && number(1) != number(2)
            {
                self.set_factory(place, default as i64);
            }
        }
    }

    /// Lets a number take these values only.
    pub fn set_choices(&mut self, place: usize, choices: &[i64]) {
        self.entries[place].choices = choices.to_vec();
    }

    /// From now on no entry is saved that is one of these.
    pub fn set_unsaved(&mut self, is_unsaved: impl Fn(ObjectAddress) -> bool) {
        for entry in &mut self.entries {
            entry.is_saved &= !is_unsaved(entry.address);
        }
    }

    /// Narrows the range of a number.
    pub fn set_range(&mut self, place: usize, [low, high]: [i64; 2]) {
        let entry = &mut self.entries[place];
        (entry.low, entry.high) = (low.into(), high.into());
    }

    /// Appends the bytes of an SDO transfer.
    pub fn append(&self, place: usize, value: &mut Vec<u8>) {
        let entry = &self.entries[place];
        match entry.kind {
            ObjectKind::Bytes => value.extend_from_slice(&entry.bytes),
            _ => value.extend(self.numbers[place].to_le_bytes().into_iter().take(entry.length)),
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
        let number = entry.fit(i64::from_le_bytes(bytes));
        entry.check_range(number)?;
        Ok(number)
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

    /// The number in the bits of a PDO, when its range is right.
    pub fn accepted(&self, place: usize, bits: u64) -> Option<i64> {
        let entry = &self.entries[place];
        let number = entry.fit(bits.cast_signed());
        entry.check_range(number).is_ok().then_some(number)
    }

    /// Saves every parameter, as "save" in object 1010 does.
    pub fn save(&mut self) {
        for (entry, number) in self.entries.iter_mut().zip(&self.numbers) {
            if entry.is_saved {
                entry.saved = *number;
            }
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
        for (entry, number) in self.entries.iter().zip(&mut self.numbers) {
            if indices.contains(&entry.address.index) {
                *number = entry.saved;
            }
        }
    }
}

/// Reads an entry. `count` is the highest sub-index, which sub-index 0 shows when the sheet gives it no value.
fn read_entry(entry: &eds::DictionaryEntry, node: u8, count: Option<u8>, is_constant: bool) -> ObjectEntry {
    let data_type = entry.data_type.unwrap_or(DataTypeCode::DOMAIN);
    let encoded = entry.value().and_then(|value| value.encode(data_type, Some(node)));
    let encoded = encoded.unwrap_or_else(|| count.map_or_else(Vec::new, |count| vec![count]));
    let own = ObjectEntry::new(entry.address, data_type);
    let mut value = [0; 8];
    let mut bytes = Vec::new();
    if own.kind == ObjectKind::Bytes {
        bytes.reserve_exact(TEXT_CAPACITY.max(encoded.len()));
        bytes.extend_from_slice(&encoded);
    } else {
        value.iter_mut().zip(&encoded).for_each(|(to, from)| *to = *from);
    }
    let default = own.fit(i64::from_le_bytes(value));
    let (low, high) = limits(entry, data_type, node);
    let is_writable = entry.access.is_writable() && !is_constant;
    ObjectEntry {
        is_readable: entry.access != AccessType::WriteOnly,
        is_writable,
        maps_to_rpdo: entry.is_mappable && is_writable && entry.access != AccessType::ReadWriteRead,
        maps_to_tpdo: entry.is_mappable
            && !matches!(entry.access, AccessType::WriteOnly | AccessType::ReadWriteWrite),
        is_saved: is_writable && !is_command(entry.address.index),
        low,
        high,
        default,
        saved: default,
        bytes,
        ..own
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

/// Returns `true` if an object is a command or a set-point, which no device saves.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(index: u16, data_type: DataTypeCode) -> ObjectEntry {
        ObjectEntry::new(ObjectAddress::new(index, 0), data_type)
    }

    const POSITION: usize = 0;
    const VELOCITY: usize = 1;
    const VOLTAGE: usize = 2;
    const TARGET_POSITION: usize = 3;
    const PROFILE_VELOCITY: usize = 4;

    fn dictionary() -> SimulatedDictionary {
        let [u16, u32] = [DataTypeCode::UNSIGNED16, DataTypeCode::UNSIGNED32];
        let [i16, i32] = [DataTypeCode(0x03), DataTypeCode(0x04)];
        let entries = vec![
            entry(0x6064, i32),
            ObjectEntry { low: -30_000, high: 30_000, ..entry(0x606C, i16) },
            entry(0x6079, u16),
            ObjectEntry { is_writable: true, ..entry(0x607A, i32) },
            ObjectEntry { is_writable: true, is_saved: true, default: 10, saved: 10, ..entry(0x6081, u32) },
        ];
        SimulatedDictionary::with(entries, vec![])
    }

    fn bytes(dictionary: &SimulatedDictionary, place: usize) -> Vec<u8> {
        let mut bytes = vec![];
        dictionary.append(place, &mut bytes);
        bytes
    }

    #[test]
    fn a_restore_brings_back_saved_parameters_but_not_set_points() {
        let mut dictionary = dictionary();
        dictionary.set(PROFILE_VELOCITY, 77);
        dictionary.set(TARGET_POSITION, 88);
        dictionary.save();
        dictionary.set(PROFILE_VELOCITY, 1);
        dictionary.restore(0..=0xFFFF);
        assert_eq!((dictionary.number(PROFILE_VELOCITY), dictionary.number(TARGET_POSITION)), (77, 0));
        dictionary.forget();
        dictionary.restore(0..=0xFFFF);
        assert_eq!(dictionary.number(PROFILE_VELOCITY), 10);
    }

    #[test]
    fn signed_values_keep_their_sign_and_wrap_when_they_are_set() {
        let mut dictionary = dictionary();
        dictionary.set(VELOCITY, -5);
        assert_eq!((dictionary.number(VELOCITY), bytes(&dictionary, VELOCITY)), (-5, vec![0xFB, 0xFF]));
        assert_eq!(dictionary.decode(VELOCITY, &[0xFB, 0xFF]), Ok(-5));
        assert_eq!(dictionary.accepted(VELOCITY, 0xFFFB), Some(-5));
        dictionary.set(VOLTAGE, -5);
        assert_eq!(dictionary.number(VOLTAGE), 0xFFFB);
        dictionary.set(POSITION, i64::from(i32::MAX) + 1);
        assert_eq!(dictionary.number(POSITION), i64::from(i32::MIN));
    }

    #[test]
    fn real_values_end_at_the_limits_of_their_type_or_of_their_range() {
        let mut dictionary = dictionary();
        let mut set = |place, value| {
            dictionary.set_real(place, value);
            let by_type = dictionary.number(place);
            dictionary.set_within_at(Some(place), value);
            (by_type, dictionary.number(place))
        };
        assert_eq!(set(VELOCITY, 1e9), (32_767, 30_000));
        assert_eq!(set(VELOCITY, -30_001.0), (-30_001, -30_000));
        assert_eq!(set(VELOCITY, 2.5), (2, 2));
        assert_eq!(set(VOLTAGE, -1.0), (0, 0));
        assert_eq!(set(POSITION, -1e12), (i32::MIN.into(), i32::MIN.into()));
    }

    #[test]
    fn a_value_out_of_its_range_is_refused_by_sdo_and_by_pdo() {
        let dictionary = dictionary();
        assert_eq!(dictionary.decode(VELOCITY, &30_001i16.to_le_bytes()), Err(AbortCode::ValueTooHigh));
        assert_eq!(dictionary.decode(VELOCITY, &(-30_001i16).to_le_bytes()), Err(AbortCode::ValueTooLow));
        assert_eq!(dictionary.accepted(VELOCITY, 30_001), None);
        assert_eq!(dictionary.decode(VELOCITY, &[0; 3]), Err(AbortCode::LengthTooHigh));
        assert_eq!(dictionary.decode(VELOCITY, &[0; 1]), Err(AbortCode::LengthTooLow));
    }
}
