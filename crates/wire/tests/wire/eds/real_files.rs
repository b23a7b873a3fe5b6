//! Complete files.

use takt_wire::canopen::eds::{self, Loaded, ObjectType};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::objects::PdoDirection;

/// A file of the repository.
fn load(name: &str) -> Loaded {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(name);
    eds::load(&path).unwrap_or_else(|findings| panic!("{findings:?}"))
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
