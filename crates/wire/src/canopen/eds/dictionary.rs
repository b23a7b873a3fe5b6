//! The checked content of a file: a device and its object dictionary.

use std::fmt;
use std::ops::Range;

use super::data_type::DataTypeCode;
use super::value::Value;
use crate::canopen::object::ObjectAddress;
use crate::canopen::objects::{PDO_INVALID, PdoDirection, PdoParameters};
use crate::canopen::pdo_configuration::PdoConfiguration;

/// A device and its objects.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectDictionary {
    /// `[FileInfo]`
    pub file: FileInfo,
    /// `[DeviceInfo]`
    pub device: DeviceInfo,
    /// `[DeviceComissioning]` of a DCF, in either spelling.
    pub commissioning: Option<DeviceCommissioning>,
    /// `[DummyUsage]`: the data types that may be mapped as placeholders.
    pub dummies: Vec<DataTypeCode>,
    /// `[Comments]`, line by line.
    pub comments: Vec<String>,
    /// The objects in the order of their indices.
    pub objects: Vec<DictionaryObject>,
}

/// The origin of the file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileInfo {
    /// `FileName`
    pub name: Option<String>,
    /// `FileVersion`
    pub version: Option<String>,
    /// `FileRevision`
    pub revision: Option<String>,
    /// `EDSVersion`
    pub eds_version: Option<String>,
    /// `Description`
    pub description: Option<String>,
    /// `CreatedBy`
    pub created_by: Option<String>,
    /// `LastEDS`: the EDS that a DCF was made of.
    pub last_eds: Option<String>,
}

/// Identity and features of the device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceInfo {
    /// `VendorName`
    pub vendor_name: Option<String>,
    /// `VendorNumber`, object 1018:1.
    pub vendor_number: Option<u32>,
    /// `ProductName`
    pub product_name: Option<String>,
    /// `ProductNumber`, object 1018:2.
    pub product_number: Option<u32>,
    /// `RevisionNumber`, object 1018:3.
    pub revision_number: Option<u32>,
    /// `OrderCode`
    pub order_code: Option<String>,
    /// The supported bit rates in bit/s.
    pub bit_rates: Vec<u32>,
    /// `SimpleBootUpMaster`
    pub is_simple_boot_up_master: bool,
    /// `SimpleBootUpSlave`
    pub is_simple_boot_up_slave: bool,
    /// `Granularity`: mapped objects are multiples of this many bits; 0 when the mapping cannot be changed.
    pub granularity: u8,
    /// `NrOfRXPDO`
    pub rpdo_count: Option<u16>,
    /// `NrOfTXPDO`
    pub tpdo_count: Option<u16>,
    /// `LSS_Supported`
    pub has_lss: bool,
    /// `CompactPDO`: bit n for sub-index n+1 of communication parameters that the file does not describe.
    pub compact_pdo: u8,
}

/// The settings of the device in the network, in a DCF.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceCommissioning {
    /// `NodeID`, 1 to 127.
    pub node: Option<u8>,
    /// `NodeName`
    pub node_name: Option<String>,
    /// `Baudrate` in bit/s.
    pub bit_rate: Option<u32>,
    /// `NetNumber`
    pub network: Option<u32>,
    /// `NetworkName`
    pub network_name: Option<String>,
    /// `LSS_SerialNumber`
    pub serial_number: Option<u32>,
}

/// The type of an object (CiA 301, table 42).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ObjectType {
    /// 0
    Null,
    /// 2: a large amount of data, such as a program.
    Domain,
    /// 5: the definition of a data type.
    DefType,
    /// 6: the definition of a record type.
    DefStruct,
    /// 7: one value.
    Variable,
    /// 8: values of the same type.
    Array,
    /// 9: values of different types.
    Record,
}

impl ObjectType {
    const CODES: [(u8, Self); 7] = [
        (0, Self::Null),
        (2, Self::Domain),
        (5, Self::DefType),
        (6, Self::DefStruct),
        (7, Self::Variable),
        (8, Self::Array),
        (9, Self::Record),
    ];

    pub(super) fn from_code(code: i128) -> Option<Self> {
        Self::CODES.iter().find(|(known, _)| i128::from(*known) == code).map(|(_, object_type)| *object_type)
    }

    pub(super) fn from_word(word: &str) -> Option<Self> {
        let of = |(_, object_type): &(u8, Self)| *object_type;
        Self::CODES.iter().map(of).find(|object_type| object_type.word().eq_ignore_ascii_case(word))
    }

    /// Returns `true` if it has sub-objects.
    pub const fn has_sub_objects(self) -> bool {
        matches!(self, Self::Array | Self::Record | Self::DefStruct)
    }

    /// Its name in the standard.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Null => "NULL",
            Self::Domain => "DOMAIN",
            Self::DefType => "DEFTYPE",
            Self::DefStruct => "DEFSTRUCT",
            Self::Variable => "VAR",
            Self::Array => "ARRAY",
            Self::Record => "RECORD",
        }
    }
}

/// SDO access to an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AccessType {
    /// Read (`ro`).
    ReadOnly,
    /// Write (`wo`).
    WriteOnly,
    /// Read and write (`rw`).
    ReadWrite,
    /// Read and write; mappable to a TPDO (`rwr`).
    ReadWriteRead,
    /// Read and write; mappable to an RPDO (`rww`).
    ReadWriteWrite,
    /// Read; the value never changes (`const`).
    Constant,
}

impl AccessType {
    const WORDS: [(&'static str, Self); 6] = [
        ("ro", Self::ReadOnly),
        ("wo", Self::WriteOnly),
        ("rw", Self::ReadWrite),
        ("rwr", Self::ReadWriteRead),
        ("rww", Self::ReadWriteWrite),
        ("const", Self::Constant),
    ];

    pub(super) fn from_word(word: &str) -> Option<Self> {
        Self::WORDS.iter().find(|(known, _)| known.eq_ignore_ascii_case(word)).map(|(_, access)| *access)
    }

    /// Its name in the standard.
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, known)| *known == self).map_or("ro", |(word, _)| word)
    }

    /// Returns `true` if it can be written.
    pub const fn is_writable(self) -> bool {
        !matches!(self, Self::ReadOnly | Self::Constant)
    }
}

/// The list that contains an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ObjectList {
    /// `[MandatoryObjects]`
    Mandatory,
    /// `[OptionalObjects]`
    Optional,
    /// `[ManufacturerObjects]`
    Manufacturer,
}

/// An object of the dictionary.
#[derive(Clone, Debug, PartialEq)]
pub struct DictionaryObject {
    /// Its index.
    pub index: u16,
    /// Its name.
    pub name: String,
    /// Its type.
    pub object_type: ObjectType,
    /// The list that contains it; if none does, the list of its index range.
    pub list: ObjectList,
    /// Its values in the order of their sub-indices. A variable has only sub-index 0.
    pub entries: Vec<DictionaryEntry>,
    /// The line of its section, counted from 1; `None` without a section.
    pub line: Option<usize>,
}

/// One value of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct DictionaryEntry {
    /// Index and sub-index.
    pub address: ObjectAddress,
    /// Its name.
    pub name: String,
    /// Its data type; `None` if neither the file nor the standard defines it.
    pub data_type: Option<DataTypeCode>,
    /// SDO access to it.
    pub access: AccessType,
    /// `DefaultValue`
    pub default: Option<LocatedValue>,
    /// `ParameterValue`: the value that a DCF configures.
    pub configured: Option<LocatedValue>,
    /// `LowLimit`
    pub low: Option<Value>,
    /// `HighLimit`
    pub high: Option<Value>,
    /// `PDOMapping`: whether a PDO can map it.
    pub is_mappable: bool,
    /// `ObjFlags`, bit 0: the configured value must not be written.
    pub is_write_refused: bool,
    /// `Denotation`: the name given by the configuration tool.
    pub denotation: Option<String>,
}

/// A value and its position in the file.
#[derive(Clone, Debug, PartialEq)]
pub struct LocatedValue {
    /// The value.
    pub value: Value,
    /// The line, counted from 1.
    pub line: usize,
    /// The bytes of the file, decoded to UTF-8.
    pub span: Range<usize>,
}

impl DictionaryEntry {
    /// The configured value, otherwise the default.
    pub fn value(&self) -> Option<&Value> {
        self.configured.as_ref().or(self.default.as_ref()).map(|stated| &stated.value)
    }
}

impl ObjectDictionary {
    /// Finds an object.
    pub fn object(&self, index: u16) -> Option<&DictionaryObject> {
        let place = self.objects.binary_search_by_key(&index, |object| object.index).ok()?;
        self.objects.get(place)
    }

    /// Finds a value of an object.
    pub fn entry(&self, address: ObjectAddress) -> Option<&DictionaryEntry> {
        let object = self.object(address.index)?;
        object.entries.iter().find(|entry| entry.address == address)
    }

    /// Every value of every object.
    pub fn entries(&self) -> impl Iterator<Item = &DictionaryEntry> {
        self.objects.iter().flat_map(|object| &object.entries)
    }

    /// The number that a device with this node ID holds after power-up or configuration, as far as the file says.
    pub fn number(&self, address: ObjectAddress, node: Option<u8>) -> Option<i128> {
        self.entry(address)?.value()?.number(node)
    }

    /// The node ID that the file was made for.
    pub fn commissioned_node(&self) -> Option<u8> {
        self.commissioning.as_ref()?.node
    }

    /// Returns `true` if the file configures a device.
    pub fn is_configuration(&self) -> bool {
        self.commissioning.is_some() || self.entries().any(|entry| entry.configured.is_some())
    }

    /// The PDOs of a device with this node ID, in the order of their indices.
    pub fn pdos(&self, node: Option<u8>) -> Vec<PdoConfiguration> {
        let directions =
            [(PdoDirection::Receive, 0x1400..=0x15FF), (PdoDirection::Transmit, 0x1800..=0x19FF)];
        let mut pdos = vec![];
        for (direction, range) in directions {
            let first = *range.start();
            for object in self.objects.iter().filter(|object| range.contains(&object.index)) {
                let number = object.index - first + 1;
                let parameters = PdoParameters::at(direction, number);
                let read = |address| u32::try_from(self.number(address, node)?).ok();
                let mut pdo = PdoConfiguration::read(direction, number, parameters, read);
                if let Some(pdo) = &mut pdo {
                    // Bit 31 does not depend on the node ID.
                    let cob_id = parameters.cob_id().address;
                    let of_any_node = self.number(cob_id, node.or(Some(1)));
                    pdo.is_valid = of_any_node.is_some_and(|cob_id| cob_id & i128::from(PDO_INVALID) == 0);
                }
                pdos.extend(pdo);
            }
        }
        pdos
    }
}

impl fmt::Display for ObjectType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.word())
    }
}
