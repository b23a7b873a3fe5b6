//! The order in which devices accept a configuration.

use std::collections::BTreeMap;

use super::Download;
use crate::canopen::eds::ObjectDictionary;
use crate::canopen::object::ObjectAddress;
use crate::canopen::objects::{PDO_INVALID, PdoDirection, PdoParameters};

/// Sorts the writes by index. The PDOs come after the rest of the communication profile, one by one.
pub(super) fn ordered(downloads: Vec<Download>, dictionary: &ObjectDictionary, node: u8) -> Vec<Download> {
    let mut plain = BTreeMap::new();
    let mut pdos: BTreeMap<u16, Vec<Download>> = BTreeMap::new();
    for download in downloads {
        match communication_parameter(download.object.index) {
            Some(communication) => pdos.entry(communication).or_default().push(download),
            None => {
                plain.insert(download.object, download);
            }
        }
    }
    let behind = plain.split_off(&ObjectAddress::new(0x1400, 0));
    let pdos = pdos.into_iter().flat_map(|(communication, downloads)| {
        Pdo::new(communication, downloads, dictionary, node).in_order()
    });
    plain.into_values().chain(pdos).chain(behind.into_values()).collect()
}

/// The index of the communication parameter of the PDO that an object belongs to.
fn communication_parameter(index: u16) -> Option<u16> {
    match index {
        0x1400..=0x15FF | 0x1800..=0x19FF => Some(index),
        0x1600..=0x17FF | 0x1A00..=0x1BFF => Some(index - 0x200),
        _ => None,
    }
}

/// The writes of one PDO.
struct Pdo {
    parameters: PdoParameters,
    /// The COB-ID at the end; `None` if it is not known.
    cob_id: Option<u32>,
    values: BTreeMap<ObjectAddress, Vec<u8>>,
}

impl Pdo {
    fn new(communication: u16, downloads: Vec<Download>, dictionary: &ObjectDictionary, node: u8) -> Self {
        let (direction, first, first_id) = match communication {
            0x1400..=0x15FF => (PdoDirection::Receive, 0x1400, 0x200),
            _ => (PdoDirection::Transmit, 0x1800, 0x180),
        };
        let place = communication - first;
        let parameters = PdoParameters::at(direction, place + 1);
        let mut values: BTreeMap<_, _> =
            downloads.into_iter().map(|download| (download.object, download.data)).collect();
        let address = parameters.cob_id().address;
        let configured =
            values.remove(&address).and_then(|data| Some(u32::from_le_bytes(data.try_into().ok()?)));
        let described = || u32::try_from(dictionary.number(address, Some(node))?).ok();
        // The pre-defined connection set, in which only the first PDO is certainly valid.
        let predefined = || {
            let id = first_id + 0x100 * u32::from(place) + u32::from(node);
            (place < 4).then_some(if place == 0 { id } else { id | PDO_INVALID })
        };
        Self { parameters, cob_id: configured.or_else(described).or_else(predefined), values }
    }

    /// Invalid; no mapping; the mapping and its count; the rest; valid.
    fn in_order(mut self) -> Vec<Download> {
        let parameters = self.parameters;
        let switch =
            |cob_id: u32| Download { object: parameters.cob_id().address, data: cob_id.to_le_bytes().into() };
        let mut order: Vec<Download> = vec![];
        order.extend(self.cob_id.map(|cob_id| switch(cob_id | PDO_INVALID)));
        order.extend(self.mapping());
        order.extend(self.values.into_iter().map(|(object, data)| Download { object, data }));
        order.extend(self.cob_id.map(switch));
        order
    }

    fn mapping(&mut self) -> Vec<Download> {
        let count = self.parameters.mapped_count().address;
        // The mapping parameter has the higher index.
        let entries = self.values.split_off(&count);
        if entries.is_empty() {
            return vec![];
        }
        let highest = entries.keys().map(|object| object.subindex).max().unwrap_or(0);
        let mapped = entries.get(&count).and_then(|data| data.first().copied()).unwrap_or(highest);
        let write = |object, data| Download { object, data };
        let mut order = vec![write(count, vec![0])];
        let counted = entries.into_iter().filter(|(object, _)| (1..=mapped).contains(&object.subindex));
        order.extend(counted.map(|(object, data)| write(object, data)));
        if mapped > 0 {
            order.push(write(count, vec![mapped]));
        }
        order
    }
}
