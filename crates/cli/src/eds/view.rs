//! What is printed of a dictionary: every value resolved for one node.

use serde::Serialize;
use takt_wire::canopen::eds::{
    DictionaryEntry, DictionaryObject, Number, ObjectDictionary, ObjectList, Value,
};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::objects::PdoDirection;
use takt_wire::canopen::pdo_configuration::PdoConfiguration;

use super::problem::PrintedProblem;

/// Everything that is printed.
#[derive(Serialize)]
pub struct View {
    pub file: FilePicture,
    pub device: DevicePicture,
    pub identity: IdentityPicture,
    /// The node that `$NODEID` stands for; `None` where it is not known.
    pub node: Option<u8>,
    pub node_name: Option<String>,
    pub objects: Vec<ObjectView>,
    pub pdos: Vec<PdoView>,
    pub comments: Vec<String>,
    pub warnings: Vec<PrintedProblem>,
}

#[derive(Serialize)]
pub struct FilePicture {
    pub name: Option<String>,
    pub version: Option<String>,
    pub revision: Option<String>,
    pub description: Option<String>,
    pub created_by: Option<String>,
    pub last_eds: Option<String>,
    /// True if it configures a device (a DCF).
    pub is_configuration: bool,
}

#[derive(Serialize)]
pub struct DevicePicture {
    pub vendor_name: Option<String>,
    pub product_name: Option<String>,
    pub order_code: Option<String>,
    pub bit_rates: Vec<u32>,
    pub granularity: u8,
    pub has_lss: bool,
}

/// Objects 1000 and 1018, or what `[DeviceInfo]` says where they do not.
#[derive(Serialize)]
pub struct IdentityPicture {
    pub device_type: Option<u32>,
    pub vendor: Option<u32>,
    pub product: Option<u32>,
    pub revision: Option<u32>,
}

#[derive(Serialize)]
pub struct ObjectView {
    pub index: u16,
    pub name: String,
    pub object_type: &'static str,
    pub list: &'static str,
    pub line: Option<usize>,
    pub entries: Vec<EntryView>,
}

#[derive(Serialize)]
pub struct EntryView {
    pub subindex: u8,
    pub name: String,
    pub data_type: Option<String>,
    pub access: &'static str,
    pub is_mappable: bool,
    pub default: Option<ValueView>,
    pub configured: Option<ValueView>,
    pub low: Option<ValueView>,
    pub high: Option<ValueView>,
    pub denotation: Option<String>,
    /// True if numbers of this entry are read in hexadecimal.
    #[serde(skip)]
    pub is_pattern: bool,
}

/// A value: as a number or text where it can be one.
#[derive(Clone, Serialize)]
#[serde(untagged)]
pub enum ValueView {
    Number(i64),
    Unsigned(u64),
    Real(f64),
    Text(String),
}

#[derive(Serialize)]
pub struct PdoView {
    pub direction: &'static str,
    pub number: u16,
    pub id: Option<u32>,
    pub is_valid: bool,
    pub transmission_type: Option<u8>,
    pub inhibit_time_100us: Option<u16>,
    pub event_timer_ms: Option<u16>,
    pub bytes: usize,
    pub objects: Vec<MappedPicture>,
}

#[derive(Serialize)]
pub struct MappedPicture {
    pub index: u16,
    pub subindex: u8,
    pub bits: u8,
    pub name: Option<String>,
}

impl View {
    pub fn of(dictionary: &ObjectDictionary, node: Option<u8>, warnings: Vec<PrintedProblem>) -> Self {
        let (file, device) = (&dictionary.file, &dictionary.device);
        let number = |index, subindex| {
            u32::try_from(dictionary.number(ObjectAddress::new(index, subindex), node)?).ok()
        };
        Self {
            file: FilePicture {
                name: file.name.clone(),
                version: file.version.clone(),
                revision: file.revision.clone(),
                description: file.description.clone(),
                created_by: file.created_by.clone(),
                last_eds: file.last_eds.clone(),
                is_configuration: dictionary.is_configuration(),
            },
            device: DevicePicture {
                vendor_name: device.vendor_name.clone(),
                product_name: device.product_name.clone(),
                order_code: device.order_code.clone(),
                bit_rates: device.bit_rates.clone(),
                granularity: device.granularity,
                has_lss: device.has_lss,
            },
            identity: IdentityPicture {
                device_type: number(0x1000, 0),
                vendor: number(0x1018, 1).or(device.vendor_number),
                product: number(0x1018, 2).or(device.product_number),
                revision: number(0x1018, 3).or(device.revision_number),
            },
            node,
            node_name: dictionary.commissioning.as_ref().and_then(|made_for| made_for.node_name.clone()),
            objects: dictionary.objects.iter().map(|object| ObjectView::of(object, node)).collect(),
            pdos: dictionary.pdos(node).iter().map(|pdo| PdoView::of(pdo, dictionary)).collect(),
            comments: dictionary.comments.clone(),
            warnings,
        }
    }
}

impl ObjectView {
    fn of(object: &DictionaryObject, node: Option<u8>) -> Self {
        Self {
            index: object.index,
            name: object.name.clone(),
            object_type: object.object_type.word(),
            list: match object.list {
                ObjectList::Mandatory => "mandatory",
                ObjectList::Optional => "optional",
                ObjectList::Manufacturer => "manufacturer",
            },
            line: object.line,
            entries: object.entries.iter().map(|entry| EntryView::of(entry, node)).collect(),
        }
    }
}

impl EntryView {
    fn of(entry: &DictionaryEntry, node: Option<u8>) -> Self {
        let view = |value: &Value| ValueView::of(value, node);
        let index = entry.address.index;
        let is_long = entry.data_type.and_then(|data_type| data_type.bits()) == Some(32);
        let is_identifier = matches!(
            index,
            0x1000 | 0x1002 | 0x1005 | 0x1012 | 0x1014 | 0x1016 | 0x1018 | 0x1200..=0x12FF | 0x1400..=0x1BFF
        );
        Self {
            subindex: entry.address.subindex,
            name: entry.name.clone(),
            data_type: entry.data_type.map(|data_type| data_type.to_string()),
            access: entry.access.word(),
            is_mappable: entry.is_mappable,
            default: entry.default.as_ref().map(|stated| view(&stated.value)),
            configured: entry.configured.as_ref().map(|stated| view(&stated.value)),
            low: entry.low.as_ref().map(view),
            high: entry.high.as_ref().map(view),
            denotation: entry.denotation.clone(),
            is_pattern: is_identifier && is_long,
        }
    }
}

impl ValueView {
    fn of(value: &Value, node: Option<u8>) -> Self {
        match value {
            Value::Number(number) => Self::of_number(*number, node),
            Value::Real(real) => Self::Real(*real),
            Value::Text(text) => Self::Text(text.clone()),
            Value::Bytes(bytes) => {
                let pairs: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
                Self::Text(pairs.join(" "))
            }
        }
    }

    fn of_number(number: Number, node: Option<u8>) -> Self {
        let Some(value) = number.at(node) else {
            return Self::Text(match number.constant {
                0 => "$NODEID".to_owned(),
                constant => format!("$NODEID+0x{constant:X}"),
            });
        };
        match (i64::try_from(value), u64::try_from(value)) {
            (Ok(value), _) => Self::Number(value),
            (_, Ok(value)) => Self::Unsigned(value),
            _ => Self::Text(value.to_string()),
        }
    }

    /// For people.
    pub fn show(&self, is_pattern: bool) -> String {
        match self {
            Self::Number(value) if is_pattern && *value >= 0 => format!("0x{value:08X}"),
            Self::Number(value) => value.to_string(),
            Self::Unsigned(value) => value.to_string(),
            Self::Real(value) => value.to_string(),
            Self::Text(text) => text.clone(),
        }
    }
}

impl PdoView {
    fn of(pdo: &PdoConfiguration, dictionary: &ObjectDictionary) -> Self {
        let objects = pdo.objects.iter().map(|mapped| {
            let entry = dictionary.entry(ObjectAddress::new(mapped.index, mapped.subindex));
            MappedPicture {
                index: mapped.index,
                subindex: mapped.subindex,
                bits: mapped.bits,
                name: entry.map(|entry| entry.name.clone()),
            }
        });
        Self {
            direction: match pdo.direction {
                PdoDirection::Receive => "RPDO",
                PdoDirection::Transmit => "TPDO",
            },
            number: pdo.number,
            id: pdo.id.map(|id| id.value()),
            is_valid: pdo.is_valid,
            transmission_type: pdo.transmission_type,
            inhibit_time_100us: pdo.inhibit_time_100us,
            event_timer_ms: pdo.event_timer_ms,
            bytes: pdo.length(),
            objects: objects.collect(),
        }
    }
}
