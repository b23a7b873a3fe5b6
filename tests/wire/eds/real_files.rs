//! Complete files.

use takt::canopen::eds::{self, DictionaryEntry, Loaded, ObjectType};
use takt::canopen::object::ObjectAddress;
use takt::canopen::objects::PdoDirection;
use takt::internals::sim::erob;

fn load(name: &str) -> Loaded {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    eds::load(&path).unwrap_or_else(|findings| panic!("{:?}", miette::Report::new(findings)))
}

fn lengths(loaded: &Loaded, direction: PdoDirection) -> Vec<usize> {
    let pdos = loaded.dictionary.pdos(Some(1));
    pdos.iter().filter(|pdo| pdo.direction == direction).map(|pdo| pdo.length()).collect()
}

#[test]
fn the_yz_aim_file_has_its_objects_entries_and_pdo_lengths() {
    let loaded = load("tests/eds/yz-aim.eds");
    assert_eq!(loaded.warnings.problems(), [], "nothing is wrong with it");
    assert_eq!(loaded.dictionary.objects.len(), 55);
    assert_eq!(loaded.dictionary.entries().count(), 109);
    assert_eq!(lengths(&loaded, PdoDirection::Receive), [7, 8, 7, 4]);
    assert_eq!(lengths(&loaded, PdoDirection::Transmit), [6, 6, 8, 6]);
    assert_eq!(loaded.dictionary.comments.len(), 5);
}

#[test]
fn the_yz_aim_identifiers_depend_on_the_node_id() {
    let dictionary = load("configs/eds/yz-aim.eds").dictionary;
    let ids = |node| -> Vec<u32> {
        dictionary.pdos(Some(node)).iter().filter_map(|pdo| Some(pdo.id?.value())).collect()
    };
    assert_eq!(ids(5), [0x205, 0x305, 0x405, 0x505, 0x185, 0x285, 0x385, 0x485]);
    let unknown = dictionary.pdos(None);
    assert!(
        unknown.iter().all(|pdo| pdo.id.is_none() && pdo.is_valid),
        "without a node they are valid all the same"
    );
}

#[test]
fn the_erob_file_is_valid_and_has_the_default_mapping_of_the_drive() {
    let loaded = load("configs/eds/erob-canopen.eds");
    assert_eq!(loaded.warnings.problems(), []);
    let dictionary = &loaded.dictionary;
    assert_eq!(dictionary.number(ObjectAddress::new(0x1000, 0), None), Some(0x0042_0192));
    assert_eq!(dictionary.number(ObjectAddress::new(0x1018, 1), None), Some(0x5A65_726F));
    assert_eq!(dictionary.device.product_number, Some(0x2648_3052));
    assert_eq!(lengths(&loaded, PdoDirection::Receive), [2, 6, 6, 0]);
    assert_eq!(lengths(&loaded, PdoDirection::Transmit), [2, 6, 6, 0]);
    let valid: Vec<u32> = dictionary
        .pdos(Some(2))
        .iter()
        .filter(|pdo| pdo.is_valid)
        .filter_map(|pdo| Some(pdo.id?.value()))
        .collect();
    assert_eq!(valid, [0x202, 0x182]);
    assert_eq!(dictionary.object(0x60C1).map(|object| object.object_type), Some(ObjectType::Array));
    assert!(dictionary.object(0x6072).is_none() && dictionary.object(0x1011).is_none());
}

#[test]
fn every_entry_of_the_erob_file_agrees_with_the_simulated_drive() {
    let dictionary = load("configs/eds/erob-canopen.eds").dictionary;
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
