//! The data sheet of a drive and its simulation.

use takt::sim::erob;
use takt_wire::canopen::eds::{self, DictionaryEntry};
use takt_wire::canopen::object::ObjectAddress;

#[test]
fn every_entry_of_the_erob_file_agrees_with_the_simulated_drive() {
    let dictionary = eds::load("../../configs/eds/erob-canopen.eds".as_ref()).unwrap().dictionary;
    let entries: Vec<&DictionaryEntry> = dictionary.entries().collect();
    assert_eq!(entries.len(), erob::OBJECTS.len());
    for object in &erob::OBJECTS {
        let address = ObjectAddress::new(object.index, object.subindex);
        let entry = dictionary.entry(address).unwrap_or_else(|| panic!("{address} is missing"));
        assert_eq!((entry.data_type, entry.access), (Some(object.data_type), object.access), "{address}");
        assert_eq!(entry.is_mappable, object.is_mappable, "{address}");
        // A default that the file leaves open is unknown.
        if let Some(bytes) =
            entry.default.as_ref().map(|stated| stated.value.encode(object.data_type, Some(2)))
        {
            let default = object.default_of(2);
            let length = usize::from(object.data_type.bits().unwrap() / 8);
            assert_eq!(bytes.as_deref(), default.to_le_bytes().get(..length), "{address}");
        }
    }
}
