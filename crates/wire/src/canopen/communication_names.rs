//! The names of the objects of the communication profile (CiA 301, 7.5.2) that no family has in its table: texts, and the parameters of
//! PDOs.

use super::object::ObjectAddress;
use super::objects::{DEVICE_NAME, HARDWARE_VERSION, PDO_INVALID, PdoDirection, SOFTWARE_VERSION};
use takt_rt::MappedObject;

/// The name of an object; `None` for others.
pub fn name(address: ObjectAddress) -> Option<String> {
    let text = match address {
        DEVICE_NAME => "device name",
        HARDWARE_VERSION => "hardware version",
        SOFTWARE_VERSION => "software version",
        ObjectAddress { index: 0x1018, subindex: 0 } => "identity, number of entries",
        address => return pdo_parameter(address),
    };
    Some(text.to_owned())
}

fn pdo_parameter(address: ObjectAddress) -> Option<String> {
    let (direction, is_mapping) = match address.index {
        0x1400..=0x15FF => (PdoDirection::Receive, false),
        0x1600..=0x17FF => (PdoDirection::Receive, true),
        0x1800..=0x19FF => (PdoDirection::Transmit, false),
        0x1A00..=0x1BFF => (PdoDirection::Transmit, true),
        _ => return None,
    };
    let pdo = format!("{}{}", direction.word(), (address.index & 0x1FF) + 1);
    let parameter = match (is_mapping, address.subindex) {
        (true, 0) => "number of mapped objects".to_owned(),
        (true, place) => format!("mapped object {place}"),
        (false, 0) => "number of entries".to_owned(),
        (false, 1) => "COB-ID".to_owned(),
        (false, 2) => "transmission type".to_owned(),
        (false, 3) => "inhibit time".to_owned(),
        (false, 5) => "event timer".to_owned(),
        (false, 6) => "SYNC start value".to_owned(),
        (false, place) => format!("entry {place}"),
    };
    Some(format!("{pdo} {parameter}"))
}

/// The object that the value of a mapping parameter names; `None` for other objects.
pub fn mapped_object(address: ObjectAddress, value: i64) -> Option<MappedObject> {
    let is_mapping = matches!(address.index, 0x1600..=0x17FF | 0x1A00..=0x1BFF) && address.subindex > 0;
    u32::try_from(value).ok().filter(|_| is_mapping).map(MappedObject::from_parameter)
}

/// What the COB-ID of a PDO means; `None` for other objects.
pub fn cob_id(address: ObjectAddress, value: i64) -> Option<String> {
    let is_pdo = matches!(address.index, 0x1400..=0x15FF | 0x1800..=0x19FF) && address.subindex == 1;
    let value = u32::try_from(value).ok().filter(|_| is_pdo)?;
    let id = format!("{:03X}", value & 0x1FFF_FFFF);
    Some(if value & PDO_INVALID == 0 { format!("identifier {id}") } else { format!("off, identifier {id}") })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_of_pdos_have_the_number_of_their_pdo() {
        let named = |index, subindex| name(ObjectAddress::new(index, subindex));
        assert_eq!(named(0x1800, 1).as_deref(), Some("TPDO1 COB-ID"));
        assert_eq!(named(0x1603, 0).as_deref(), Some("RPDO4 number of mapped objects"));
        assert_eq!(named(0x1008, 0).as_deref(), Some("device name"));
        assert_eq!(named(0x6040, 0), None);
        let address = ObjectAddress::new(0x1800, 1);
        assert_eq!(cob_id(address, 0x8000_0185).as_deref(), Some("off, identifier 185"));
        assert_eq!(cob_id(ObjectAddress::new(0x1800, 2), 1), None);
        let mapped = mapped_object(ObjectAddress::new(0x1A00, 2), 0x6064_0020);
        assert_eq!(mapped, Some(MappedObject::new(0x6064, 0, 32)));
    }
}
