//! What may be written to the parameters of a PDO, and when.
//!
//! The identifier may only change while the PDO is invalid. The mapping may only change while the PDO is invalid, if its
//! identifier can be written at all; its entries only while their count is 0.

use takt_rt::MappedObject;
use takt_wire::canopen::object::ObjectAddress;

use crate::object_dictionary::SimulatedDictionary;
use crate::sdo_reply::AbortCode;

use super::{ID, INVALID, MAX_OBJECTS};

/// Bit 29 of a COB-ID: a 29-bit identifier.
const EXTENDED: i64 = 1 << 29;
const MAX_BITS: u32 = 64;

/// Returns `true` if an object is a parameter of a PDO.
pub fn is_parameter(index: u16) -> bool {
    matches!(index, 0x1400..=0x1BFF)
}

/// Checks whether `value` may be written to a parameter of a PDO now.
///
/// # Errors
/// The abort code of the SDO transfer.
pub fn check_parameter(
    dictionary: &SimulatedDictionary,
    address: ObjectAddress,
    value: i64,
) -> Result<(), AbortCode> {
    if !is_parameter(address.index) {
        return Ok(());
    }
    let is_outbound = address.index >= 0x1800;
    let is_mapping = address.index & 0x0200 != 0;
    let communication = address.index & !0x0200;
    let mapping = address.index | 0x0200;
    let number = |index, subindex| dictionary.number_at(dictionary.place(index, subindex));
    let can_be_invalid =
        dictionary.place(communication, 1).is_some_and(|id| dictionary.entry(id).is_writable);
    let is_valid = number(communication, 1).unwrap_or(INVALID) & INVALID == 0;
    match (is_mapping, address.subindex) {
        (false, 1) => check_id(number(communication, 1).unwrap_or(INVALID), value),
        (false, 2) if (241..252).contains(&value) || !is_outbound && (252..254).contains(&value) => {
            Err(AbortCode::Value)
        }
        (false, _) => Ok(()),
        (true, _) if is_valid && can_be_invalid => Err(AbortCode::DeviceState),
        (true, 0) => check_count(dictionary, mapping, value),
        (true, _) if number(mapping, 0).unwrap_or(0) != 0 => Err(AbortCode::DeviceState),
        (true, _) if value == 0 => Ok(()),
        (true, _) => check_mapped(dictionary, value, is_outbound).map(|_| ()),
    }
}

fn check_id(present: i64, value: i64) -> Result<(), AbortCode> {
    let stays_valid = (present | value) & INVALID == 0;
    if stays_valid && (present ^ value) & ID != 0 {
        return Err(AbortCode::DeviceState);
    }
    if value & EXTENDED != 0 || value & INVALID == 0 && is_restricted(value & ID) {
        return Err(AbortCode::Value);
    }
    Ok(())
}

/// Identifiers that a PDO must not use (CiA 301, 7.3.5).
fn is_restricted(id: i64) -> bool {
    matches!(id, 0x000..=0x080 | 0x101..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x6FF | 0x701..=0x7FF)
}

fn check_count(dictionary: &SimulatedDictionary, mapping: u16, count: i64) -> Result<(), AbortCode> {
    if !(0..=MAX_OBJECTS as i64).contains(&count) {
        return Err(AbortCode::PdoTooLong);
    }
    let mut bits = 0;
    let last = ObjectAddress::new(mapping, count as u8);
    dictionary.find(last).map_err(|_| AbortCode::PdoTooLong)?;
    for subindex in 1..=count as u8 {
        let entry = dictionary.find(ObjectAddress::new(mapping, subindex))?;
        bits += check_mapped(dictionary, dictionary.number(entry), mapping >= 0x1A00)?;
    }
    if bits > MAX_BITS { Err(AbortCode::PdoTooLong) } else { Ok(()) }
}

/// Checks one mapping entry and returns its length in bits. An empty entry is not mappable.
fn check_mapped(dictionary: &SimulatedDictionary, value: i64, is_outbound: bool) -> Result<u32, AbortCode> {
    let mapped = MappedObject::from_parameter(value as u32);
    if dictionary.is_dummy(mapped.index) {
        return if is_outbound { Err(AbortCode::NotMappable) } else { Ok(mapped.bits.into()) };
    }
    let place = dictionary.find(ObjectAddress::new(mapped.index, mapped.subindex))?;
    let entry = dictionary.entry(place);
    let is_allowed = if is_outbound { entry.maps_to_tpdo } else { entry.maps_to_rpdo };
    if !is_allowed || usize::from(mapped.bits) != 8 * entry.length {
        return Err(AbortCode::NotMappable);
    }
    Ok(mapped.bits.into())
}
