//! Which frames a fault concerns.

use std::ops::RangeInclusive;

use takt_rt::Frame;

use crate::sim::random::Random;

/// Which way a frame goes, seen from the controller.
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

/// What a frame is for, by the pre-defined connection set (CiA 301, 7.3.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameFunction {
    /// Network management, 000.
    Nmt,
    /// 080.
    Sync,
    /// Emergency messages, 081 to 0FF.
    Emergency,
    /// What drives report, 180, 280, 380 and 480.
    Tpdo,
    /// What drives are commanded, 200, 300, 400 and 500.
    Rpdo,
    /// Requests and replies, 580 and 600.
    Sdo,
    /// Boot-up, heartbeat and guarding, 700.
    Heartbeat,
}

impl FrameFunction {
    /// Whether an identifier serves this function.
    pub const fn includes(self, id: u32) -> bool {
        match self {
            Self::Nmt => id == 0x000,
            Self::Sync => id == 0x080,
            Self::Emergency => matches!(id, 0x081..=0x0FF),
            Self::Tpdo => matches!(id & !0x7F, 0x180 | 0x280 | 0x380 | 0x480),
            Self::Rpdo => matches!(id & !0x7F, 0x200 | 0x300 | 0x400 | 0x500),
            Self::Sdo => matches!(id & !0x7F, 0x580 | 0x600),
            Self::Heartbeat => matches!(id & !0x7F, 0x700),
        }
    }
}

/// Which frames a fault concerns: those to which all of this applies.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// Which way they go.
    pub direction: Direction,
    /// Their identifiers.
    pub ids: RangeInclusive<u32>,
    /// What they are for; `None` for anything.
    pub function: Option<FrameFunction>,
    /// The node whose number is in their identifier; `None` for any.
    pub node: Option<u8>,
    /// How probable each of them is to be concerned, 0 to 1.
    pub probability: f64,
    /// How many of them at most; the fault ends with the last. `None` for any number.
    pub count: Option<u64>,
    /// Seed of everything random about the fault.
    pub seed: u64,
}

impl Default for Selection {
    /// All of them.
    fn default() -> Self {
        Self {
            direction: Direction::Both,
            ids: 0..=0x1FFF_FFFF,
            function: None,
            node: None,
            probability: 1.0,
            count: None,
            seed: 1,
        }
    }
}

impl Selection {
    /// Whether a frame that goes this way ([`Direction::Sent`] or [`Direction::Received`]) is a candidate.
    pub fn includes(&self, frame: &Frame, direction: Direction) -> bool {
        let id = frame.id().value();
        let is_canopen = !frame.id().is_extended();
        (self.direction == Direction::Both || self.direction == direction)
            && self.ids.contains(&id)
            && self.function.is_none_or(|function| is_canopen && function.includes(id))
            && self.node.is_none_or(|node| is_canopen && id >= 0x080 && id & 0x7F == u32::from(node))
    }
}

/// Picks frames, one after the other.
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

    /// Whether this frame is concerned.
    pub fn picks(&mut self, frame: &Frame, direction: Direction) -> bool {
        if self.left == 0 || !self.selection.includes(frame, direction) {
            return false;
        }
        // 53 bits are what an `f64` holds exactly.
        let share = (self.random.next() >> 11) as f64 / (1u64 << 53) as f64;
        let is_picked = share < self.selection.probability;
        if is_picked && self.selection.count.is_some() {
            self.left -= 1;
        }
        is_picked
    }

    /// Whether there will be no further one.
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
    use takt_rt::Id;

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
    fn every_function_has_its_identifiers() {
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
    fn a_share_is_picked_and_the_same_one_with_the_same_seed() {
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
