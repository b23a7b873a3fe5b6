//! Selects the frames that a fault affects.

use std::ops::RangeInclusive;

use takt_rt::{Frame, Id};
use takt_wire::canopen::function_code;

use takt_sim::random::Random;

/// The direction of a frame, seen from the controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Direction {
    /// From the controller.
    Sent,
    /// To the controller.
    Received,
    /// Either.
    #[default]
    Both,
}

/// The function of a frame by the pre-defined connection set (CiA 301, 7.3.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrameFunction {
    /// Network management, 000.
    Nmt,
    /// SYNC, 080.
    Sync,
    /// Emergency messages, 081 to 0FF.
    Emergency,
    /// TPDOs of the drives, 180, 280, 380 and 480.
    Tpdo,
    /// RPDOs of the drives, 200, 300, 400 and 500.
    Rpdo,
    /// SDO responses and requests, 580 and 600.
    Sdo,
    /// Boot-up, heartbeat and node guarding, 700.
    Heartbeat,
}

impl FrameFunction {
    /// Returns `true` if an identifier has this function.
    pub(crate) fn includes(self, id: u32) -> bool {
        let is_of = |functions: &[u16]| functions.iter().any(|function| id & !0x7F == u32::from(*function));
        match self {
            Self::Nmt => id == u32::from(function_code::NMT),
            Self::Sync => id == u32::from(function_code::SYNC),
            Self::Emergency => is_of(&[function_code::EMERGENCY]) && id != u32::from(function_code::SYNC),
            Self::Tpdo => is_of(&function_code::TPDO),
            Self::Rpdo => is_of(&function_code::RPDO),
            Self::Sdo => is_of(&[function_code::SDO_RESPONSE, function_code::SDO_REQUEST]),
            Self::Heartbeat => is_of(&[function_code::ERROR_CONTROL]),
        }
    }
}

/// By which identifiers the frames of a drive are known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DriveIdentifiers {
    /// Those that CANopen gives to its node ID (CiA 301, 7.3.3), and these of the vendor's own protocol beside them. Frames of that are shorter
    /// than those of SDO, which other nodes have with the same identifiers.
    Node {
        /// Of the vendor's own protocol.
        own_protocol: Vec<Id>,
    },
    /// These. The drive is no CANopen node.
    These(Vec<Id>),
}

impl Default for DriveIdentifiers {
    /// Those of a CANopen node.
    fn default() -> Self {
        Self::Node { own_protocol: vec![] }
    }
}

impl DriveIdentifiers {
    fn include(&self, frame: &Frame, node: u8) -> bool {
        let id = frame.id();
        match self {
            Self::Node { own_protocol } => {
                let is_of_node = id.value() >= 0x080 && id.value() & 0x7F == u32::from(node);
                !id.is_extended() && is_of_node || frame.payload().len() < 8 && own_protocol.contains(&id)
            }
            Self::These(ids) => ids.contains(&id),
        }
    }
}

/// Selects frames: a frame must meet all of these conditions. Of requests and replies on a serial line, which have no identifiers, the
/// direction and the address count, which is `node`.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// The direction.
    pub direction: Direction,
    /// The identifiers.
    pub ids: RangeInclusive<u32>,
    /// The function; `None` for any.
    pub function: Option<FrameFunction>,
    /// The node ID of the drive; `None` for any.
    pub node: Option<u8>,
    /// Which frames are those of the drive.
    pub identifiers: DriveIdentifiers,
    /// The probability of being selected, 0 to 1.
    pub probability: f64,
    /// The largest number of frames; the fault ends with the last one. `None`: no limit.
    pub count: Option<u64>,
    /// The seed of everything random in this fault.
    pub seed: u64,
}

impl Default for Selection {
    /// All frames.
    fn default() -> Self {
        Self {
            direction: Direction::Both,
            ids: 0..=0x1FFF_FFFF,
            function: None,
            node: None,
            identifiers: DriveIdentifiers::default(),
            probability: 1.0,
            count: None,
            seed: 1,
        }
    }
}

impl Selection {
    /// Returns `true` if a frame of this direction ([`Direction::Sent`] or [`Direction::Received`]) meets the conditions.
    pub(crate) fn includes(&self, frame: &Frame, direction: Direction) -> bool {
        let id = frame.id().value();
        let is_canopen = !frame.id().is_extended();
        (self.direction == Direction::Both || self.direction == direction)
            && self.ids.contains(&id)
            && self.function.is_none_or(|function| is_canopen && function.includes(id))
            && self.node.is_none_or(|node| self.identifiers.include(frame, node))
    }

    /// The same for a request to this address, or the reply to it, on a serial line.
    pub(crate) fn includes_message(&self, address: u8, direction: Direction) -> bool {
        (self.direction == Direction::Both || self.direction == direction)
            && self.node.is_none_or(|node| node == address)
    }
}

/// Picks frames, with probability and count.
#[derive(Clone, Debug)]
pub struct Selector {
    selection: Selection,
    random: Random,
    left: u64,
}

impl Selector {
    pub fn new(selection: Selection) -> Self {
        let random = Random::new(selection.seed, 0);
        let left = selection.count.unwrap_or(u64::MAX);
        Self { selection, random, left }
    }

    /// Returns `true` if this frame is selected.
    pub fn picks(&mut self, frame: &Frame, direction: Direction) -> bool {
        let is_included = self.selection.includes(frame, direction);
        self.picks_if(is_included)
    }

    /// Returns `true` if a request to this address, or the reply to it, is selected.
    pub fn picks_message(&mut self, address: u8, direction: Direction) -> bool {
        let is_included = self.selection.includes_message(address, direction);
        self.picks_if(is_included)
    }

    fn picks_if(&mut self, is_included: bool) -> bool {
        if self.left == 0 || !is_included {
            return false;
        }
        // An `f64` holds 53 bits exactly.
        let share = (self.random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
        let is_picked = share < self.selection.probability;
        if is_picked && self.selection.count.is_some() {
            self.left -= 1;
        }
        is_picked
    }

    /// Returns `true` if no further frame will be selected.
    pub fn is_exhausted(&self) -> bool {
        self.left == 0
    }

    /// A random number below `limit`; 0 for a limit of 0.
    pub fn below(&mut self, limit: usize) -> usize {
        self.random.within(0..limit as u64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(id: u32) -> Frame {
        Frame::of(Id::base(id).unwrap(), [])
    }

    fn picked(selection: Selection, frames: usize) -> Vec<bool> {
        let mut selector = Selector::new(selection);
        (0..frames).map(|_| selector.picks(&frame(0x181), Direction::Received)).collect()
    }

    #[test]
    fn every_condition_must_apply() {
        let selection = Selection {
            direction: Direction::Received,
            ids: 0x100..=0x1FF,
            function: Some(FrameFunction::Tpdo),
            node: Some(1),
            ..Selection::default()
        };
        assert!(selection.includes(&frame(0x181), Direction::Received));
        assert!(!selection.includes(&frame(0x181), Direction::Sent));
        assert!(!selection.includes(&frame(0x281), Direction::Received));
        assert!(!selection.includes(&frame(0x182), Direction::Received));
        assert!(!selection.includes(&frame(0x101), Direction::Received));
    }

    #[test]
    fn the_frames_of_the_vendors_own_protocol_belong_to_the_node_that_speaks_it() {
        let own = [0x642, 0x5C2].map(|id| Id::base(id).unwrap()).to_vec();
        let identifiers = DriveIdentifiers::Node { own_protocol: own };
        let of_2 = Selection { node: Some(2), identifiers, ..Selection::default() };
        let of_66 = Selection { node: Some(66), ..Selection::default() };
        let question = Frame::of(Id::base(0x642).unwrap(), [0, 2]);
        assert!(of_2.includes(&question, Direction::Sent));
        // The SDO frames of node 66 have the same identifiers, and eight bytes.
        let sdo = Frame::of(Id::base(0x642).unwrap(), [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]);
        assert!(!of_2.includes(&sdo, Direction::Sent) && of_66.includes(&sdo, Direction::Sent));
        assert!(of_2.includes(&frame(0x182), Direction::Received));
    }

    #[test]
    fn a_drive_that_is_no_canopen_node_has_the_frames_with_its_own_identifiers_alone() {
        let identifiers = DriveIdentifiers::These([0x001, 0x065].map(|id| Id::base(id).unwrap()).to_vec());
        let of_1 = Selection { node: Some(1), identifiers, ..Selection::default() };
        let reply = Frame::fd(Id::base(0x065).unwrap(), &[0; 16], true).unwrap();
        assert!(of_1.includes(&reply, Direction::Received) && of_1.includes(&frame(0x001), Direction::Sent));
        for other in [0x002, 0x066, 0x081, 0x181, 0x601] {
            assert!(!of_1.includes(&frame(other), Direction::Sent), "{other:03X}");
        }
    }

    #[test]
    fn every_function_is_recognised_by_its_identifiers() {
        use FrameFunction::*;
        let of = |id: u32| {
            [Nmt, Sync, Emergency, Tpdo, Rpdo, Sdo, Heartbeat]
                .into_iter()
                .filter(|f| f.includes(id))
                .collect()
        };
        let cases: [(u32, Vec<FrameFunction>); 8] = [
            (0x000, vec![Nmt]),
            (0x080, vec![Sync]),
            (0x085, vec![Emergency]),
            (0x385, vec![Tpdo]),
            (0x505, vec![Rpdo]),
            (0x605, vec![Sdo]),
            (0x705, vec![Heartbeat]),
            (0x100, vec![]),
        ];
        for (id, expected) in cases {
            let found: Vec<FrameFunction> = of(id);
            assert_eq!(found, expected, "{id:03X}");
        }
    }

    #[test]
    fn the_share_is_random_and_repeatable_with_the_same_seed() {
        let selection = Selection { probability: 0.3, ..Selection::default() };
        let first = picked(selection.clone(), 10_000);
        assert_eq!(first, picked(selection.clone(), 10_000));
        let hits = first.iter().filter(|is_picked| **is_picked).count();
        assert!((2_800..3_200).contains(&hits), "{hits}");
        assert_ne!(first, picked(Selection { seed: 2, ..selection }, 10_000));
    }

    #[test]
    fn a_count_is_not_exceeded() {
        let picked = picked(Selection { count: Some(3), ..Selection::default() }, 10);
        assert_eq!(picked.iter().filter(|is_picked| **is_picked).count(), 3);
    }
}
