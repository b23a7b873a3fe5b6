//! Which frames are of interest.

use std::fmt;
use std::str::FromStr;

use takt_rt::Frame;

use super::decoded::{Decoded, ServiceKind};

/// Identifiers, as candump's filters: `181`, `180:780` (those that agree in the bits of the mask), `080~7FF` (those that do not).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdFilter {
    id: u32,
    mask: u32,
    is_extended: bool,
    is_inverted: bool,
}

/// A text that is no filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdFilterError;

impl fmt::Display for IdFilterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            "write an identifier in hexadecimal (181, or 00000181 with 29 bits), ID:MASK (180:780), or ID~MASK for all others",
        )
    }
}

impl std::error::Error for IdFilterError {}

const EVERY_BIT: u32 = 0x1FFF_FFFF;

impl FromStr for IdFilter {
    type Err = IdFilterError;

    fn from_str(text: &str) -> Result<Self, IdFilterError> {
        let number = |text: &str| {
            let is_number =
                (1..=8).contains(&text.len()) && text.bytes().all(|digit| digit.is_ascii_hexdigit());
            u32::from_str_radix(text, 16).ok().filter(|number| is_number && *number <= EVERY_BIT)
        };
        let (id, mask, is_inverted) = match text.split_once([':', '~']) {
            Some((id, mask)) => (id, number(mask).ok_or(IdFilterError)?, text.contains('~')),
            None => (text, EVERY_BIT, false),
        };
        let value = number(id).ok_or(IdFilterError)?;
        let is_extended = id.len() > 3 || value > 0x7FF;
        Ok(Self { id: value & mask, mask, is_extended, is_inverted })
    }
}

impl IdFilter {
    fn takes(&self, frame: &Frame) -> bool {
        let agrees = frame.id().value() & self.mask == self.id;
        (agrees && frame.id().is_extended() == self.is_extended) != self.is_inverted
    }
}

/// Which frames are of interest. A frame has to satisfy every part that is not empty.
#[derive(Clone, Debug, Default)]
pub struct FrameFilter {
    /// One of these identifiers. Those that exclude some must all be satisfied.
    pub ids: Vec<IdFilter>,
    /// From or to one of these nodes.
    pub nodes: Vec<u8>,
    /// Concerning one of these axes.
    pub axes: Vec<usize>,
    /// Of one of these kinds.
    pub kinds: Vec<ServiceKind>,
}

impl FrameFilter {
    /// Returns `true` if a frame is of interest.
    pub fn takes(&self, frame: &Frame, decoded: &Decoded) -> bool {
        let (excluding, including): (Vec<&IdFilter>, Vec<&IdFilter>) =
            self.ids.iter().partition(|filter| filter.is_inverted);
        let is_id = including.is_empty() || including.iter().any(|filter| filter.takes(frame));
        is_id
            && excluding.iter().all(|filter| filter.takes(frame))
            && (self.nodes.is_empty() || decoded.node.is_some_and(|node| self.nodes.contains(&node)))
            && (self.axes.is_empty() || decoded.axes.iter().any(|axis| self.axes.contains(axis)))
            && (self.kinds.is_empty() || self.kinds.contains(&decoded.service.kind()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::monitor::Service;
    use takt_rt::Id;

    fn takes(filters: &[&str], id: Id) -> bool {
        let ids = filters.iter().map(|text| text.parse().unwrap()).collect();
        let filter = FrameFilter { ids, ..FrameFilter::default() };
        filter.takes(&Frame::of(id, []), &Decoded::of(Service::Unknown, ""))
    }

    #[test]
    fn identifiers_are_named_one_by_one_or_by_a_mask_or_excluded() {
        let id = |id| Id::base(id).unwrap();
        assert!(takes(&[], id(0x181)));
        assert!(takes(&["181"], id(0x181)) && !takes(&["181"], id(0x182)));
        assert!(takes(&["180:780"], id(0x1FF)) && !takes(&["180:780"], id(0x281)));
        assert!(takes(&["080~7FF"], id(0x181)) && !takes(&["080~7FF"], id(0x080)));
        assert!(takes(&["181", "182"], id(0x182)) && !takes(&["080~7FF", "700~780"], id(0x701)));
        assert!(!takes(&["00000181"], id(0x181)) && takes(&["00000181"], Id::extended(0x181).unwrap()));
        for wrong in ["", "x", "181:", ":7FF", "123456789", "181/7FF", "+181"] {
            assert_eq!(wrong.parse::<IdFilter>(), Err(IdFilterError), "{wrong}");
        }
    }

    #[test]
    fn every_part_must_be_satisfied() {
        let decoded = Decoded { node: Some(3), axes: vec![1], ..Decoded::of(Service::Sync, "") };
        let frame = Frame::of(Id::canopen(0x080, 0), []);
        let takes = |filter: FrameFilter| filter.takes(&frame, &decoded);
        assert!(takes(FrameFilter {
            nodes: vec![3, 4],
            kinds: vec![ServiceKind::Sync],
            ..FrameFilter::default()
        }));
        assert!(!takes(FrameFilter {
            nodes: vec![3],
            kinds: vec![ServiceKind::Pdo],
            ..FrameFilter::default()
        }));
        assert!(!takes(FrameFilter { axes: vec![0], ..FrameFilter::default() }));
    }
}
