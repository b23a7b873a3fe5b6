//! Reads an object dictionary from the sections of a file.

use super::compact_pdo;
use super::data_type::DataTypeCode;
use super::dictionary::{DeviceCommissioning, DeviceInfo, FileInfo, ObjectDictionary};
use super::entry::{self, check_keys};
use super::findings::Reporter;
use super::ini::{Document, Section};
use super::lists;
use super::mapping;
use super::number;
use super::objects;
use super::problem::{EdsProblem, EdsProblemKind};
use super::section_name::SectionName;
use crate::canopen::object::ObjectAddress;

/// The sections besides those of objects (CiA 306), as the standard spells them, and those of modular devices.
const SECTIONS: [&str; 15] = [
    "FileInfo",
    "DeviceInfo",
    "DeviceComissioning",
    "DeviceCommissioning",
    "DummyUsage",
    "Comments",
    "MandatoryObjects",
    "OptionalObjects",
    "ManufacturerObjects",
    "StandardDataTypes",
    "DynamicChannels",
    "SupportedModules",
    "ConnectedModules",
    "Tools",
    "NotSupported",
];

/// Bit rates that have their own key, in kbit/s.
const BIT_RATES: [u32; 8] = [10, 20, 50, 125, 250, 500, 800, 1000];

const DEVICE_KEYS: [&str; 28] = [
    "VendorName",
    "VendorNumber",
    "ProductName",
    "ProductNumber",
    "ProductVersion",
    "RevisionNumber",
    "OrderCode",
    "BaudRate_10",
    "BaudRate_20",
    "BaudRate_50",
    "BaudRate_100",
    "BaudRate_125",
    "BaudRate_250",
    "BaudRate_500",
    "BaudRate_800",
    "BaudRate_1000",
    "SimpleBootUpMaster",
    "SimpleBootUpSlave",
    "ExtendedBootUpMaster",
    "ExtendedBootUpSlave",
    "Granularity",
    "DynamicChannelsSupported",
    "GroupMessaging",
    "NrOfRXPDO",
    "NrOfTXPDO",
    "LSS_Supported",
    "LSS_Type",
    "CompactPDO",
];

/// Reads a text. The dictionary is `None` when the file describes no object.
pub(super) fn read(text: &str) -> (Option<ObjectDictionary>, Vec<EdsProblem>) {
    let mut reporter = Reporter::new(text);
    let document = Document::parse(text, &mut reporter);
    check_sections(&document, &mut reporter);
    let mut dictionary = ObjectDictionary {
        file: file(&document),
        device: device(&document, &mut reporter),
        commissioning: commissioning(&document, &mut reporter),
        dummies: dummies(&document, &mut reporter),
        comments: comments(&document),
        objects: objects::read(&document, &mut reporter),
    };
    if dictionary.objects.is_empty() {
        reporter.report(EdsProblemKind::NoObjects, 0..0);
        return (None, reporter.into_problems());
    }
    lists::check(&document, &mut dictionary, &mut reporter);
    compact_pdo::expand(&mut dictionary);
    mapping::check(&dictionary, &mut reporter);
    check_identity(&document, &dictionary, &mut reporter);
    (Some(dictionary), reporter.into_problems())
}

/// Warns of numbers in `[DeviceInfo]` that are not those of object 1018.
fn check_identity(document: &Document<'_>, dictionary: &ObjectDictionary, reporter: &mut Reporter) {
    let device = &dictionary.device;
    let Some(section) = document.section("DeviceInfo") else { return };
    for (key, stated, subindex) in
        [("VendorNumber", device.vendor_number, 1), ("ProductNumber", device.product_number, 2)]
    {
        let object = ObjectAddress::new(0x1018, subindex);
        let number = dictionary.number(object, None).and_then(|number| u32::try_from(number).ok());
        if let (Some(stated), Some(number), Some(pair)) = (stated, number, section.get(key))
            && stated != number
            && stated != 0
            && number != 0
        {
            let (key, object) = (pair.key.to_owned(), object.to_string());
            let kind = EdsProblemKind::TwoIdentities { key, stated, object, number };
            reporter.report(kind, pair.span.clone());
        }
    }
}

fn check_sections(document: &Document<'_>, reporter: &mut Reporter) {
    for section in document.sections() {
        let nearest = match SectionName::read(section.name) {
            SectionName::Malformed => None,
            SectionName::Other => {
                let is_known = SECTIONS.iter().any(|known| known.eq_ignore_ascii_case(section.name));
                let Some(nearest) = entry::misspelling_of(section.name, &SECTIONS).filter(|_| !is_known)
                else {
                    continue;
                };
                Some(nearest)
            }
            _ => continue,
        };
        let name = section.name.to_owned();
        reporter.report(EdsProblemKind::UnknownSection { name, nearest }, section.header.clone());
    }
}

fn text(section: Option<&Section<'_>>, key: &str) -> Option<String> {
    Some(section?.get(key)?.value.to_owned())
}

fn file(document: &Document<'_>) -> FileInfo {
    let section = document.section("FileInfo");
    FileInfo {
        name: text(section, "FileName"),
        version: text(section, "FileVersion"),
        revision: text(section, "FileRevision"),
        eds_version: text(section, "EDSVersion"),
        description: text(section, "Description"),
        created_by: text(section, "CreatedBy"),
        last_eds: text(section, "LastEDS"),
    }
}

fn device(document: &Document<'_>, reporter: &mut Reporter) -> DeviceInfo {
    let Some(section) = document.section("DeviceInfo") else { return DeviceInfo::default() };
    check_keys(section, &DEVICE_KEYS, reporter);
    let mut bit_rates = vec![];
    for kilobits in BIT_RATES {
        if optional_number(section, &format!("BaudRate_{kilobits}"), reporter).is_some_and(|value| value != 0)
        {
            bit_rates.push(1000 * kilobits);
        }
    }
    let mut number = |key| optional_number(section, key, reporter);
    let is_set = |value: Option<u32>| value.is_some_and(|value| value != 0);
    let short = |value: Option<u32>| value.and_then(|value| u16::try_from(value).ok());
    let byte = |value: Option<u32>| value.and_then(|value| u8::try_from(value).ok()).unwrap_or(0);
    DeviceInfo {
        vendor_name: text(Some(section), "VendorName"),
        vendor_number: number("VendorNumber"),
        product_name: text(Some(section), "ProductName"),
        product_number: number("ProductNumber"),
        revision_number: number("RevisionNumber"),
        order_code: text(Some(section), "OrderCode"),
        bit_rates,
        is_simple_boot_up_master: is_set(number("SimpleBootUpMaster")),
        is_simple_boot_up_slave: is_set(number("SimpleBootUpSlave")),
        granularity: byte(number("Granularity")),
        rpdo_count: short(number("NrOfRXPDO")),
        tpdo_count: short(number("NrOfTXPDO")),
        has_lss: is_set(number("LSS_Supported")),
        compact_pdo: byte(number("CompactPDO")),
    }
}

/// A number for information only: an invalid one is ignored with a warning.
fn optional_number(section: &Section<'_>, key: &str, reporter: &mut Reporter) -> Option<u32> {
    let pair = section.get(key)?;
    let number = number::read(pair.value).and_then(|parsed| parsed.number.at(None));
    let number = number.and_then(|number| u32::try_from(number).ok());
    if number.is_none() {
        let kind = EdsProblemKind::UnknownWord {
            key: pair.key.to_owned(),
            given: pair.value.to_owned(),
            repair: "it was ignored; allowed: a number of 32 bits",
        };
        reporter.report(kind, pair.span.clone());
    }
    number
}

fn commissioning(document: &Document<'_>, reporter: &mut Reporter) -> Option<DeviceCommissioning> {
    // The standard's own spelling comes first.
    let section =
        document.section("DeviceComissioning").or_else(|| document.section("DeviceCommissioning"))?;
    let node = entry::whole(section, "NodeID", None, reporter);
    if let Some(value) = node.filter(|node| !(1..=127).contains(node))
        && let Some(pair) = section.get("NodeID")
    {
        let kind = EdsProblemKind::OutOfRange { key: pair.key.to_owned(), value, allowed: "1 to 127" };
        reporter.report(kind, pair.span.clone());
    }
    Some(DeviceCommissioning {
        node: node.and_then(|node| u8::try_from(node).ok()),
        node_name: text(Some(section), "NodeName"),
        bit_rate: optional_number(section, "Baudrate", reporter)
            .map(|kilobits| kilobits.saturating_mul(1000)),
        network: optional_number(section, "NetNumber", reporter),
        network_name: text(Some(section), "NetworkName"),
        serial_number: optional_number(section, "LSS_SerialNumber", reporter),
    })
}

fn dummies(document: &Document<'_>, reporter: &mut Reporter) -> Vec<DataTypeCode> {
    let Some(section) = document.section("DummyUsage") else { return vec![] };
    let mut dummies = vec![];
    for pair in section.pairs() {
        let code = pair.key.to_ascii_lowercase();
        let code = code.strip_prefix("dummy").and_then(|digits| u16::from_str_radix(digits, 16).ok());
        if let Some(code) = code
            && optional_number(section, pair.key, reporter).is_some_and(|value| value != 0)
        {
            dummies.push(DataTypeCode(code));
        }
    }
    dummies
}

/// `Line1`, `Line2` …; the count in `Lines` is not used.
fn comments(document: &Document<'_>) -> Vec<String> {
    let Some(section) = document.section("Comments") else { return vec![] };
    let number_of =
        |key: &str| -> Option<u32> { key.to_ascii_lowercase().strip_prefix("line")?.parse().ok() };
    let mut lines: Vec<(u32, &str)> =
        section.pairs().iter().filter_map(|pair| Some((number_of(pair.key)?, pair.value))).collect();
    lines.sort_by_key(|(number, _)| *number);
    lines.into_iter().map(|(_, line)| line.to_owned()).collect()
}
