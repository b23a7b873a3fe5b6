//! The data sheet of a drive and its simulation.

use takt_rt::MappedObject;
use takt_wire::canopen::object::ObjectAddress;

use super::bench::{Bench, NODE, parameters};

#[test]
fn objects_that_the_erob_file_lacks_do_not_exist() {
    let sheet = parameters(NODE).sheet;
    for index in [0x1011, 0x1015, 0x1019, 0x605A, 0x605C, 0x605D, 0x6063, 0x6072, 0x607E, 0x60FE, 0x6007] {
        assert!(sheet.object(index).is_none(), "{index:04X}");
    }
    for (index, subindex) in [(0x1018, 4), (0x1800, 4), (0x1800, 6)] {
        assert!(sheet.entry(ObjectAddress::new(index, subindex)).is_none(), "{index:04X}:{subindex}");
    }
}

#[test]
fn default_mappings_of_the_erob_file_contain_mappable_objects_of_the_right_length() {
    let sheet = parameters(NODE).sheet;
    let is_mapping = |index: u16| matches!(index, 0x1600..=0x1603 | 0x1A00..=0x1A03);
    let mut count = 0;
    for mapping in
        sheet.entries().filter(|entry| is_mapping(entry.address.index) && entry.address.subindex > 0)
    {
        let value = mapping.value().and_then(|value| value.number(None)).unwrap_or(0) as u32;
        if value == 0 {
            continue;
        }
        let object = MappedObject::new((value >> 16) as u16, (value >> 8) as u8, value as u8);
        let entry = sheet.entry(ObjectAddress::new(object.index, object.subindex)).unwrap();
        assert!(entry.is_mappable, "{object:?}");
        assert_eq!(entry.data_type.unwrap().bits(), Some(object.bits), "{object:?}");
        count += 1;
    }
    assert_eq!(count, 10);
}

#[test]
fn cob_id_defaults_contain_the_node_id() {
    let mut bench = Bench::new();
    for (index, subindex, value) in [(0x1400, 1, 0x205), (0x1801, 1, 0x8000_0285), (0x1014, 0, 0x85)] {
        assert_eq!(bench.read(index, subindex), Ok(value), "{index:04X}");
    }
}
