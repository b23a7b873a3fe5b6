//! The drives on a bus: those of a configuration, those that the user names, and the others, of which nothing is known.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use takt_rt::{Frame, Id, MappedObject};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::pdo_configuration::PdoConfiguration;

use super::field_frames::FieldMember;
use super::process_data::configured;
use takt::config::{Config, DriveFamily, PdoMapping};
use takt::family::bring_up::ProcessData;
use takt::family::commission::TargetDrive;
use takt::family::{self, FrameWords, cia402};

/// A drive that is named without a configuration.
#[derive(Clone, Debug)]
pub struct NamedDrive {
    /// Its node ID; `None` for every node that nobody else names.
    pub node: Option<u8>,
    /// What it is.
    pub drive: DriveFamily,
}

/// A drive on the bus.
pub struct Member {
    /// The number of its axis in the configuration.
    pub axis: Option<usize>,
    /// Node ID, units and words.
    pub target: TargetDrive,
    /// How it is spoken to.
    pub spoken: Spoken,
}

/// How a drive is spoken to.
pub enum Spoken {
    /// By CANopen, with these PDOs by the configuration.
    Canopen(Vec<PdoConfiguration>),
    /// By a protocol of its own.
    Own(FrameWords),
    /// By frames of bit fields.
    Fields(Box<FieldMember>),
}

impl Member {
    fn of_node(node: u8, drive: &DriveFamily) -> Option<Self> {
        let target = TargetDrive::unconfigured(node, drive.clone()).ok()?;
        let spoken = match drive.protocol.own_identifiers() {
            Some(_) => Spoken::Own(target.family().frame_words(target.clone())),
            None => Spoken::Canopen(vec![]),
        };
        Some(Self { axis: None, target, spoken })
    }

    /// Returns `true` if a frame is one of the drive's own protocol, and whether it goes to the drive.
    pub fn own_direction(&self, frame: &Frame) -> Option<bool> {
        let own =
            self.target.drive.protocol.own_identifiers().filter(|own| self.target.node <= own.last_node)?;
        let (id, node) = (frame.id(), self.target.node);
        if id == own.request_id(node) { Some(true) } else { (id == own.reply_id(node)).then_some(false) }
    }
}

/// The drives on a bus.
pub struct Members {
    members: Vec<Member>,
    /// What a node is that nobody names.
    usual: DriveFamily,
    /// Nodes that were met and are no members.
    met: BTreeMap<u8, Member>,
    /// Drives that a protocol of their own gives away, by their node IDs.
    given_away: BTreeMap<u8, Member>,
    /// The families with a protocol of their own that need no configuration.
    own_protocols: Vec<DriveFamily>,
}

impl Members {
    /// The drives of a bus of a configuration.
    pub fn of(config: &Config, bus: usize) -> Self {
        let on_bus = config.axes.iter().enumerate().filter(|(_, axis)| axis.bus == bus);
        let members = on_bus.filter_map(|(number, axis)| {
            let target = TargetDrive::of(axis).ok()?;
            let family = family::of(&axis.drive);
            let spoken = if let Some(fields) = FieldMember::of(axis) {
                Spoken::Fields(Box::new(fields))
            } else if axis.drive.protocol.own_identifiers().is_some() {
                Spoken::Own(family.frame_words(target.clone()))
            } else if axis.mapping == PdoMapping::AsStored && !axis.drive.has_fixed_process_data {
                // The drive tells its mapping at bring-up.
                Spoken::Canopen(vec![])
            } else {
                Spoken::Canopen(configured(&ProcessData::of(axis, config)))
            };
            Some(Member { axis: Some(number), target, spoken })
        });
        Self::with(members.collect(), None)
    }

    /// Drives that the user names.
    pub fn named(drives: &[NamedDrive]) -> Self {
        let members = drives.iter().filter_map(|named| Member::of_node(named.node?, &named.drive));
        let usual = drives.iter().find(|named| named.node.is_none()).map(|named| named.drive.clone());
        Self::with(members.collect(), usual)
    }

    fn with(members: Vec<Member>, usual: Option<DriveFamily>) -> Self {
        let unconfigured = family::all().into_iter().filter_map(|family| family.unconfigured());
        let own_protocols = unconfigured.filter(|drive| drive.protocol.own_identifiers().is_some()).collect();
        Self {
            members,
            usual: usual.unwrap_or_else(cia402::undescribed),
            met: BTreeMap::new(),
            given_away: BTreeMap::new(),
            own_protocols,
        }
    }

    /// All drives that are named.
    pub fn iter(&self) -> impl Iterator<Item = &Member> {
        self.members.iter()
    }

    /// All drives that are named.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut Member> {
        self.members.iter_mut()
    }

    /// The drive with this node ID. Where a node has several axes, it is that of this object.
    pub fn canopen(&mut self, node: u8, object: Option<ObjectAddress>) -> Option<&Member> {
        let node_axis = object.map_or(1, node_axis);
        let is_node =
            |member: &&Member| member.target.node == node && matches!(member.spoken, Spoken::Canopen(_));
        let of_axis = |member: &&Member| is_node(member) && member.target.drive.node_axis == node_axis;
        let place = self.members.iter().position(|member| of_axis(&member));
        let place = place.or_else(|| self.members.iter().position(|member| is_node(&member)));
        if let Some(place) = place {
            return self.members.get(place);
        }
        if !self.met.contains_key(&node) {
            let canopen = if self.usual.protocol.own_identifiers().is_some() {
                cia402::undescribed()
            } else {
                self.usual.clone()
            };
            self.met.insert(node, Member::of_node(node, &canopen)?);
        }
        self.met.get(&node)
    }

    /// The drive whose own protocol gives it away: frames that no CANopen node sends under these identifiers.
    pub fn by_own_protocol(&mut self, frame: &Frame) -> Option<&mut Member> {
        let (node, drive) = self.own_protocols.iter().find_map(|drive| {
            let own = drive.protocol.own_identifiers()?;
            let is_of = |id: Id| id == frame.id();
            let node = (1..=own.last_node)
                .find(|node| is_of(own.request_id(*node)) || is_of(own.reply_id(*node)))?;
            Some((node, drive.clone()))
        })?;
        Some(match self.given_away.entry(node) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(room) => room.insert(Member::of_node(node, &drive)?),
        })
    }
}

/// The axis of a node that an object belongs to, counted from 1 (CiA 402-2, multi-axis devices).
fn node_axis(object: ObjectAddress) -> u8 {
    let is_of = |axis: &u8| {
        let own = MappedObject::new(object.index, object.subindex, 0).as_of_first_axis(*axis);
        (0x6000..=0x67FF).contains(&own.index)
    };
    (1..=takt_rt::MAX_NODE_AXES).find(is_of).unwrap_or(1)
}
