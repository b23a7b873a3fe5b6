//! Which axis and PDO a received identifier belongs to, found by one look into a table.

use crate::frame::{Frame, FrameKind, Id};
use crate::record::MAX_AXES;

/// What a received frame is to the engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Destination {
    /// Feedback: PDO `pdo` of axis `axis`.
    Feedback {
        /// The axis.
        axis: u8,
        /// Its feedback PDO, from 0.
        pdo: u8,
    },
    /// An emergency message of axis `axis`.
    Emergency {
        /// The axis.
        axis: u8,
    },
    /// The boot-up message or heartbeat of axis `axis`.
    ErrorControl {
        /// The axis.
        axis: u8,
    },
    /// Something that only the master of this bus may send, and somebody else did.
    Foreign,
    /// Process data that carries nothing new.
    Unused,
    /// Something that is not process data.
    Service,
}

const IDS: usize = 0x800;
const NOBODY: u16 = 0;
const FOREIGN: u16 = u16::MAX;
const ERROR_CONTROL: u8 = 5;
const UNUSED: u8 = 6;
const EMERGENCY: u8 = 7;

/// The table of one bus: for each 11-bit identifier `1 + axis · 8 + pdo`, with PDO 7 for emergencies, 6 for what
/// is not looked at, and 5 for error control.
#[derive(Clone, Debug)]
pub struct Dispatch {
    entries: [u16; IDS],
}

impl Default for Dispatch {
    fn default() -> Self {
        Self { entries: [NOBODY; IDS] }
    }
}

/// The identifier is in use already, or cannot be dispatched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdTaken {
    /// The identifier.
    pub id: Id,
}

impl core::error::Error for IdTaken {}

impl core::fmt::Display for IdTaken {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "identifier {:03X} is in use already, or cannot be dispatched", self.id.value())
    }
}

impl Dispatch {
    /// Enters a feedback PDO (0 to 3) of an axis (0 to 31).
    pub fn feedback(&mut self, id: Id, axis: u8, pdo: u8) -> Result<(), IdTaken> {
        self.enter(id, axis, pdo.min(ERROR_CONTROL - 1))
    }

    /// Enters the emergency message of an axis.
    pub fn emergency(&mut self, id: Id, axis: u8) -> Result<(), IdTaken> {
        self.enter(id, axis, EMERGENCY)
    }

    /// Enters the error control messages of an axis.
    pub fn error_control(&mut self, id: Id, axis: u8) -> Result<(), IdTaken> {
        self.enter(id, axis, ERROR_CONTROL)
    }

    /// Enters an identifier that nobody else may send under. One that is in use keeps its use.
    pub fn foreign(&mut self, id: Id) {
        if let Some(entry) = self.entries.get_mut(id.value() as usize).filter(|entry| **entry == NOBODY) {
            *entry = FOREIGN;
        }
    }

    /// Enters a message of an axis that is passed over.
    pub fn unused(&mut self, id: Id, axis: u8) -> Result<(), IdTaken> {
        self.enter(id, axis, UNUSED)
    }

    /// Forgets the process data of an axis.
    pub fn forget_process_data(&mut self, axis: u8) {
        let first = 1 + u16::from(axis) * 8;
        let of_axis = |entry: u16| entry.checked_sub(first).filter(|kind| *kind < 8);
        let is_process_data = |kind: u16| kind < u16::from(ERROR_CONTROL) || kind == u16::from(UNUSED);
        for entry in &mut self.entries {
            if of_axis(*entry).is_some_and(is_process_data) {
                *entry = NOBODY;
            }
        }
    }

    fn enter(&mut self, id: Id, axis: u8, kind: u8) -> Result<(), IdTaken> {
        let taken = IdTaken { id };
        if id.is_extended() || usize::from(axis) >= MAX_AXES {
            return Err(taken);
        }
        match self.entries.get_mut(id.value() as usize) {
            Some(entry) if *entry == NOBODY => {
                *entry = 1 + u16::from(axis) * 8 + u16::from(kind);
                Ok(())
            }
            _ => Err(taken),
        }
    }

    /// Where a frame goes. Process data, emergencies and error control are classic data frames with an 11-bit identifier
    /// (CiA 301, 7.3.3): a frame of another kind, such as a CAN FD frame with the identifier of a PDO, is none of these.
    pub fn destination(&self, frame: &Frame) -> Destination {
        let id = frame.id();
        if id.is_extended() || frame.kind() != FrameKind::Data {
            return Destination::Service;
        }
        match self.entries.get(id.value() as usize) {
            None | Some(&NOBODY) => Destination::Service,
            Some(&FOREIGN) => Destination::Foreign,
            Some(&entry) => {
                let (axis, pdo) = (((entry - 1) / 8) as u8, ((entry - 1) % 8) as u8);
                match pdo {
                    EMERGENCY => Destination::Emergency { axis },
                    ERROR_CONTROL => Destination::ErrorControl { axis },
                    UNUSED => Destination::Unused,
                    _ => Destination::Feedback { axis, pdo },
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_axis_and_pdo_is_found_by_its_identifier_alone() {
        let mut table = Dispatch::default();
        for axis in 0..32u8 {
            let node = axis + 1;
            table.emergency(Id::canopen(0x080, node), axis).unwrap();
            for pdo in 0..4u8 {
                table.feedback(Id::canopen(0x180 + 0x100 * u16::from(pdo), node), axis, pdo).unwrap();
            }
        }
        for axis in 0..32u8 {
            let node = axis + 1;
            let to = |function| table.destination(&Frame::of(Id::canopen(function, node), [0; 8]));
            assert_eq!(to(0x080), Destination::Emergency { axis });
            assert_eq!(to(0x280), Destination::Feedback { axis, pdo: 1 });
            assert_eq!(to(0x580), Destination::Service);
        }
    }

    #[test]
    fn one_identifier_has_one_owner() {
        let mut table = Dispatch::default();
        let id = Id::canopen(0x180, 1);
        table.feedback(id, 0, 0).unwrap();
        assert_eq!(table.feedback(id, 1, 0), Err(IdTaken { id }));
    }

    #[test]
    fn an_axis_whose_process_data_is_forgotten_keeps_its_other_messages_and_the_others_theirs() {
        let mut table = Dispatch::default();
        for axis in 0..3u8 {
            let node = axis + 1;
            table.emergency(Id::canopen(0x080, node), axis).unwrap();
            table.error_control(Id::canopen(0x700, node), axis).unwrap();
            table.feedback(Id::canopen(0x180, node), axis, 0).unwrap();
            table.unused(Id::canopen(0x280, node), axis).unwrap();
        }
        table.foreign(Id::canopen(0x200, 2));
        table.forget_process_data(1);
        let to = |function, node| table.destination(&Frame::of(Id::canopen(function, node), [0; 8]));
        assert_eq!([to(0x180, 2), to(0x280, 2)], [Destination::Service; 2]);
        assert_eq!(to(0x080, 2), Destination::Emergency { axis: 1 });
        assert_eq!(to(0x700, 2), Destination::ErrorControl { axis: 1 });
        assert_eq!(to(0x200, 2), Destination::Foreign);
        for (axis, node) in [(0, 1), (2, 3)] {
            assert_eq!(to(0x180, node), Destination::Feedback { axis, pdo: 0 });
            assert_eq!(to(0x280, node), Destination::Unused);
        }
    }

    #[test]
    fn remote_and_extended_frames_are_no_feedback() {
        let mut table = Dispatch::default();
        let id = Id::canopen(0x180, 1);
        table.feedback(id, 0, 0).unwrap();
        assert_eq!(table.destination(&Frame::remote(id, 8).unwrap()), Destination::Service);
        let extended = Frame::of(Id::extended(0x181).unwrap(), [0; 8]);
        assert_eq!(table.destination(&extended), Destination::Service);
    }

    #[test]
    fn a_flexible_data_rate_frame_is_neither_feedback_nor_a_foreign_master_on_any_identifier() {
        let mut table = Dispatch::default();
        table.feedback(Id::canopen(0x180, 1), 0, 0).unwrap();
        table.emergency(Id::canopen(0x080, 1), 0).unwrap();
        table.error_control(Id::canopen(0x700, 1), 0).unwrap();
        table.foreign(Id::canopen(0x200, 1));
        for (function, has_bit_rate_switch) in [0x180, 0x080, 0x700, 0x200]
            .into_iter()
            .flat_map(|function| [(function, false), (function, true)])
        {
            let frame = Frame::fd(Id::canopen(function, 1), &[1, 2, 3, 4], has_bit_rate_switch).unwrap();
            assert_eq!(table.destination(&frame), Destination::Service, "{frame:?}");
        }
    }
}
