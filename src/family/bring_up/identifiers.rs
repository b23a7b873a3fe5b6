//! The identifiers of the PDOs of further axes in a node.
//!
//! The pre-defined connection set of a node (CiA 301, 7.3.3) has four PDOs in each direction, which are those of its first axis.
//! The PDOs of a further axis have the identifiers of the drive's data sheet where they are free, or else those of the node that its
//! first axis does not use, or else those of a node that is not on the bus. Those never run out: there are eight for each of the
//! 94 and more node IDs that no axis has, and no axis needs more than eight.

use takt_rt::Id;
use takt_wire::canopen::objects::PdoDirection;

use super::process_data::{PdoPlan, ProcessData, pdo_id};
use super::shared_commands;
use crate::config::{Axis, Config, PdoMapping};
use crate::family;

/// PDOs in each direction that the pre-defined connection set has for a node.
const PREDEFINED: u8 = 4;
/// The identifiers of the PDOs in the pre-defined connection set.
const PDO_IDS: std::ops::RangeInclusive<u32> = 0x181..=0x57F;
const HIGHEST_NODE: u8 = 126;

impl ProcessData {
    /// Returns the process data of an axis of a configuration. If the drive's own mapping is used, it is known only after the drive has
    /// reported it ([`ProcessData::as_reported`]).
    pub fn of(axis: &Axis, config: &Config) -> Self {
        if axis.drive.node_axis == 1 {
            return shared_commands::process_data(axis, config);
        }
        let mut taken = Taken::by_first_axes(axis.bus, config);
        let further = config.axes.iter().filter(|other| other.bus == axis.bus && other.drive.node_axis > 1);
        for other in further {
            let data = taken.assign(other, family::of(&other.drive).process_data(other));
            if (other.node, other.drive.node_axis) == (axis.node, axis.drive.node_axis) {
                return data;
            }
        }
        family::of(&axis.drive).process_data(axis)
    }
}

/// What is taken on a bus.
struct Taken {
    ids: Vec<Id>,
    /// The nodes of the configuration. The pre-defined identifiers of each are for itself alone.
    nodes: Vec<u8>,
}

impl Taken {
    fn by_first_axes(bus: usize, config: &Config) -> Self {
        let axes = || config.axes.iter().filter(|axis| axis.bus == bus);
        let mut taken = Self { ids: vec![], nodes: axes().map(|axis| axis.node).collect() };
        for first in axes().filter(|axis| axis.drive.node_axis == 1) {
            // A drive with a mapping of its own may have PDOs beyond those that are planned.
            if first.mapping == PdoMapping::AsStored {
                taken.ids.extend(predefined(PdoDirection::Receive, first.node));
                taken.ids.extend(predefined(PdoDirection::Transmit, first.node));
            }
            let data = shared_commands::process_data(first, config);
            taken.ids.extend(data.all().map(|pdo| pdo.id));
        }
        taken
    }

    fn assign(&mut self, axis: &Axis, data: ProcessData) -> ProcessData {
        let mut each = |direction, plans: Vec<PdoPlan>| -> Vec<PdoPlan> {
            plans.into_iter().map(|plan| PdoPlan { id: self.take(axis, direction, &plan), ..plan }).collect()
        };
        ProcessData {
            commands: each(PdoDirection::Receive, data.commands),
            feedback: each(PdoDirection::Transmit, data.feedback),
            unused: each(PdoDirection::Transmit, data.unused),
        }
    }

    fn take(&mut self, axis: &Axis, direction: PdoDirection, plan: &PdoPlan) -> Id {
        let of_sheet = family::of(&axis.drive).pdo_id(axis, direction, plan.number);
        let absent = (1..=HIGHEST_NODE).rev().filter(|node| !self.nodes.contains(node));
        let mut candidates = of_sheet
            .into_iter()
            .chain(predefined(direction, axis.node))
            .chain(absent.flat_map(|node| predefined(direction, node)));
        let id = candidates.find(|id| self.is_free(*id, axis.node)).unwrap_or(plan.id);
        self.ids.push(id);
        id
    }

    /// Returns `true` if a PDO of this node may have an identifier.
    fn is_free(&self, id: Id, node: u8) -> bool {
        let owner = (id.value() & 0x7F) as u8;
        PDO_IDS.contains(&id.value())
            && !id.is_extended()
            && !self.ids.contains(&id)
            && (owner == node || !self.nodes.contains(&owner))
    }
}

fn predefined(direction: PdoDirection, node: u8) -> impl Iterator<Item = Id> {
    (1..=PREDEFINED).map(move |number| pdo_id(direction, number, node))
}
