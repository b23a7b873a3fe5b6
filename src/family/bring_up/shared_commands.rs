//! Command frames that several axes share: one RPDO is received by the drives of all of them, and each maps its own part and passes
//! over the rest by dummies (CiA 301, 7.4.7.1).
//!
//! Axes share where their bus is told to (`command_frames`), they are of one group, and the data sheets of their drives say that they
//! can pass over such parts. Either each axis has its whole command in one frame with others, or the controlwords share frames and so
//! do the targets, whichever is shorter; if neither is shorter than a frame for each axis, nothing is shared.

use takt_rt::{MappedObject, TransmissionType};
use takt_wire::canopen::objects::PdoDirection;
use takt_wire::frame_time::{FrameShape, worst_case_bits};

use super::process_data::{PdoPlan, ProcessData, Reply, pdo_id};
use crate::config::{Axis, CommandFrames, Config, PdoMapping};
use crate::family;

const PDO_BITS: usize = 64;
/// Transmission types up to this one are synchronous (CiA 301, 7.5.2.36): the parts of a frame take effect at the same SYNC.
const LAST_SYNCHRONOUS: u8 = 240;

/// The process data of an axis, the first or only one of its node.
pub(super) fn process_data(axis: &Axis, config: &Config) -> ProcessData {
    let own = family::of(&axis.drive).process_data(axis);
    match shared_commands(axis, config) {
        Some(commands) => ProcessData { commands, ..own },
        None => own,
    }
}

fn shared_commands(axis: &Axis, config: &Config) -> Option<Vec<PdoPlan>> {
    let is_shared = |bus: &crate::config::Bus| bus.command_frames == CommandFrames::Shared;
    config.buses.get(axis.bus).filter(|bus| is_shared(bus))?;
    let is_own = |other: &Axis| (other.bus, other.node) == (axis.bus, axis.node);
    let group = config.group_of_axis(config.axes.iter().position(is_own)?);
    let of_group = config.axes.iter().enumerate().filter(|(index, other)| {
        other.bus == axis.bus && config.group_of_axis(*index) == group && may_share(other, config)
    });
    let members: Vec<&Axis> = of_group.map(|(_, other)| other).collect();
    let place = members.iter().position(|member| is_own(member))?;
    let layouts = [Layout::of(&members, whole_commands), Layout::of(&members, controlwords_and_targets)];
    let shortest = layouts.into_iter().flatten().min_by_key(Layout::bits)?;
    let unshared = members.iter().flat_map(|member| family::of(&member.drive).process_data(member).commands);
    let unshared_bits: u32 = unshared.map(|pdo| frame_bits(pdo.length())).sum();
    (shortest.bits() < unshared_bits).then(|| shortest.plans(&members, place))
}

fn frame_bits(bytes: usize) -> u32 {
    worst_case_bits(FrameShape::classic(bytes)).nominal
}

/// Returns `true` if the command of an axis may be in a frame with those of others: it is sent in every cycle, by a mapping of the
/// controller, and taken at SYNC.
fn may_share(axis: &Axis, config: &Config) -> bool {
    let is_of_node = |other: &&Axis| (other.bus, other.node) == (axis.bus, axis.node);
    axis.mapping == PdoMapping::Written
        && axis.other_modes.is_empty()
        && !axis.control.is_profile()
        && axis.transmission_type <= LAST_SYNCHRONOUS
        && config.axes.iter().filter(is_of_node).count() == 1
}

/// The command of an axis as parts, of which each is in another PDO; `None` if it cannot be parted so.
type Parts = Option<Vec<Vec<MappedObject>>>;

fn whole_commands(axis: &Axis) -> Parts {
    Some(vec![ProcessData::needed_commands(axis)])
}

fn controlwords_and_targets(axis: &Axis) -> Parts {
    let objects = ProcessData::needed_commands(axis);
    let (controlword, rest) = objects.split_first()?;
    Some(vec![vec![*controlword], rest.to_vec()])
}

/// Frames, and whose parts are in each.
struct Layout {
    frames: Vec<SharedFrame>,
}

struct SharedFrame {
    /// The number of the PDO in each drive, counted from 1.
    number: u8,
    /// The axes by their places, each with its part, in the order of the payload.
    parts: Vec<(usize, Vec<MappedObject>)>,
}

impl Layout {
    /// As many parts in each frame as fit. `None` if the drives cannot have it so.
    fn of(members: &[&Axis], parts_of: fn(&Axis) -> Parts) -> Option<Self> {
        let parts: Vec<Vec<Vec<MappedObject>>> =
            members.iter().map(|member| parts_of(member)).collect::<Option<_>>()?;
        let count = parts.iter().map(Vec::len).max()?;
        let mut frames: Vec<SharedFrame> = vec![];
        for (at, number) in (0..count).zip(1..) {
            let first_of_number = frames.len();
            for (place, parts) in parts.iter().enumerate() {
                let Some(part) = parts.get(at) else { continue };
                let open = frames.get_mut(first_of_number..)?.last_mut();
                let last = open.filter(|frame| frame.has_room_for(place, part, members));
                match last {
                    Some(frame) => frame.parts.push((place, part.clone())),
                    None => {
                        let frame = SharedFrame { number, parts: vec![(place, part.clone())] };
                        if !frame.is_possible(members) {
                            return None;
                        }
                        frames.push(frame);
                    }
                }
            }
        }
        Some(Self { frames })
    }

    fn bits(&self) -> u32 {
        self.frames.iter().map(|frame| frame_bits(frame.bits() / 8)).sum()
    }

    /// The PDOs of the axis at this place.
    fn plans(&self, members: &[&Axis], place: usize) -> Vec<PdoPlan> {
        self.frames.iter().filter_map(|frame| frame.plan(members, place)).collect()
    }
}

impl SharedFrame {
    fn bits(&self) -> usize {
        self.objects().map(|(_, object)| usize::from(object.bits)).sum()
    }

    /// Every object in it, with the place of its axis.
    fn objects(&self) -> impl Iterator<Item = (usize, MappedObject)> {
        self.parts.iter().flat_map(|(place, part)| part.iter().map(|object| (*place, *object)))
    }

    fn has_room_for(&self, place: usize, part: &[MappedObject], members: &[&Axis]) -> bool {
        let mut parts = self.parts.clone();
        parts.push((place, part.to_vec()));
        Self { number: self.number, parts }.is_possible(members)
    }

    /// Returns `true` if it fits a frame, and the drive of each axis can map its part and pass over the others.
    fn is_possible(&self, members: &[&Axis]) -> bool {
        let count = self.objects().count();
        let can_map = |place: usize| {
            let Some(axis) = members.get(place) else { return false };
            let family = family::of(&axis.drive);
            let mut others = self.objects().filter(|(owner, _)| *owner != place);
            family.mappable_objects(axis, self.number) >= count
                && others.all(|(_, object)| family.can_pass_over(axis, dummy(object)))
        };
        self.bits() <= PDO_BITS && self.parts.iter().all(|(place, _)| can_map(*place))
    }

    fn plan(&self, members: &[&Axis], place: usize) -> Option<PdoPlan> {
        let axis = members.get(place).filter(|_| self.parts.iter().any(|(owner, _)| *owner == place))?;
        let (first, _) = self.parts.first()?;
        let own = |(owner, object)| if owner == place { object } else { dummy(object) };
        Some(PdoPlan {
            number: self.number.into(),
            id: pdo_id(PdoDirection::Receive, self.number, members.get(*first)?.node),
            transmission_type: axis.transmission_type,
            objects: self.objects().map(own).collect(),
            transmission: TransmissionType::EveryCycle,
            axes: u8::try_from(self.parts.len()).unwrap_or(u8::MAX),
            reply: Reply::No,
        })
    }
}

/// What a drive maps in place of an object that is not its own: the unsigned type of that length.
fn dummy(object: MappedObject) -> MappedObject {
    let index = match object.bits {
        8 => 0x0005,
        16 => 0x0006,
        _ => 0x0007,
    };
    MappedObject::new(index, 0, object.bits)
}
