//! Which axis and PDO a received frame belongs to: found by one look into a table for an 11-bit identifier, by a search in a short
//! sorted list for a 29-bit one. Where several drives reply by one identifier, a byte of their frames tells them apart.

use arrayvec::ArrayVec;

use crate::capacity::MAX_AXES;
use crate::frame::{Frame, FrameFormat, FrameKind, Id};
use crate::sender_byte::SenderByte;

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
/// The most 29-bit identifiers of a bus: three for each axis.
const EXTENDED_IDS: usize = 3 * MAX_AXES;
const NOBODY: u16 = 0;
const FOREIGN: u16 = 0x3FFF;
const SHARED: u16 = 0x3FFE;
/// CAN FD frames are meant, not classic ones.
const FD: u16 = 0x4000;
const ERROR_CONTROL: u8 = 5;
const UNUSED: u8 = 6;
const EMERGENCY: u8 = 7;

/// The table of one bus. The entry of an identifier is `1 + axis · 8 + pdo`, with PDO 7 for emergencies, 6 for what is not looked
/// at, and 5 for error control.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Dispatch {
    /// The entry of each 11-bit identifier.
    base: [u16; IDS],
    /// The 29-bit identifiers that have an entry, in ascending order.
    extended: ArrayVec<(u32, u16), EXTENDED_IDS>,
    /// The drives that share an identifier.
    shared: ArrayVec<SharedId, MAX_AXES>,
}

/// One of several drives that reply by the same identifier.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
struct SharedId {
    id: Id,
    sender: SenderByte,
    entry: u16,
}

impl Default for Dispatch {
    fn default() -> Self {
        Self { base: [NOBODY; IDS], extended: ArrayVec::new(), shared: ArrayVec::new() }
    }
}

/// The identifier is in use already, or cannot be dispatched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
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
    /// Enters the feedback frame of an axis (0 to 31) with a number (0 to 3). Several axes may have the same identifier where a byte tells their frames
    /// apart: in the same place, and with another value for each.
    pub fn feedback(
        &mut self,
        id: Id,
        format: FrameFormat,
        sender: Option<SenderByte>,
        (axis, number): (u8, u8),
    ) -> Result<(), IdTaken> {
        let entry = entry_of(id, axis, number.min(ERROR_CONTROL - 1))? | format_bit(format);
        match sender {
            None => self.enter(id, entry),
            Some(sender) => self.share(SharedId { id, sender, entry }),
        }
    }

    /// Enters the emergency message of an axis.
    pub fn emergency(&mut self, id: Id, axis: u8) -> Result<(), IdTaken> {
        self.enter(id, entry_of(id, axis, EMERGENCY)?)
    }

    /// Enters the error control messages of an axis.
    pub fn error_control(&mut self, id: Id, axis: u8) -> Result<(), IdTaken> {
        self.enter(id, entry_of(id, axis, ERROR_CONTROL)?)
    }

    /// Enters an identifier that nobody else may send under. One that is in use keeps its use, and so does one that finds no room.
    pub fn foreign(&mut self, id: Id, format: FrameFormat) {
        let _ = self.enter(id, FOREIGN | format_bit(format));
    }

    /// Enters a message of an axis that is passed over.
    pub fn unused(&mut self, id: Id, axis: u8) -> Result<(), IdTaken> {
        self.enter(id, entry_of(id, axis, UNUSED)?)
    }

    /// Forgets the process data of an axis.
    pub fn forget_process_data(&mut self, axis: u8) {
        let first = 1 + u16::from(axis) * 8;
        let is_forgotten = |entry: u16| {
            let kind = (entry & !FD).checked_sub(first).filter(|kind| *kind < 8);
            kind.is_some_and(|kind| kind < u16::from(ERROR_CONTROL) || kind == u16::from(UNUSED))
        };
        for entry in self.base.iter_mut().filter(|entry| is_forgotten(**entry)) {
            *entry = NOBODY;
        }
        self.extended.retain(|(_, entry)| !is_forgotten(*entry));
        self.shared.retain(|shared| !is_forgotten(shared.entry));
        let shared = &self.shared;
        let is_empty = |id: u32, is_extended: bool, entry: u16| {
            let is_it = |other: &SharedId| other.id.value() == id && other.id.is_extended() == is_extended;
            entry & !FD == SHARED && !shared.iter().any(is_it)
        };
        for (id, entry) in (0..).zip(&mut self.base) {
            if is_empty(id, false, *entry) {
                *entry = NOBODY;
            }
        }
        self.extended.retain(|(id, entry)| !is_empty(*id, true, *entry));
    }

    /// Enters what has no entry yet.
    fn enter(&mut self, id: Id, entry: u16) -> Result<(), IdTaken> {
        let taken = IdTaken { id };
        if !id.is_extended() {
            let place = self.base.get_mut(id.value() as usize).filter(|place| **place == NOBODY);
            *place.ok_or(taken)? = entry;
            return Ok(());
        }
        match self.extended.binary_search_by_key(&id.value(), |(id, _)| *id) {
            Ok(_) => Err(taken),
            Err(place) => self.extended.try_insert(place, (id.value(), entry)).map_err(|_| taken),
        }
    }

    fn share(&mut self, new: SharedId) -> Result<(), IdTaken> {
        let taken = IdTaken { id: new.id };
        let entry = SHARED | new.entry & FD;
        let mut others = self.shared.iter().filter(|other| other.id == new.id);
        let place = |sender: SenderByte| (sender.at, sender.mask);
        let is_told_apart = |other: &SharedId| {
            place(other.sender) == place(new.sender) && other.sender.value != new.sender.value
        };
        if self.shared.is_full() || !others.all(is_told_apart) {
            return Err(taken);
        }
        if self.entry(new.id) != entry {
            self.enter(new.id, entry)?;
        }
        self.shared.try_push(new).map_err(|_| taken)
    }

    fn entry(&self, id: Id) -> u16 {
        let found = if id.is_extended() {
            let place = self.extended.binary_search_by_key(&id.value(), |(id, _)| *id);
            place.ok().and_then(|place| self.extended.get(place)).map(|(_, entry)| entry)
        } else {
            self.base.get(id.value() as usize)
        };
        found.copied().unwrap_or(NOBODY)
    }

    /// Where a frame goes. A frame of another kind than the one that was entered, such as a remote frame, or a CAN FD frame with the
    /// identifier of a CANopen PDO (CiA 301, 7.3.3), is none of these.
    #[inline]
    pub fn destination(&self, frame: &Frame) -> Destination {
        let id = frame.id();
        if id.is_extended() || frame.kind() != FrameKind::Data {
            return self.rare_destination(frame);
        }
        // Process data in classic frames with a short identifier of their own are found at once.
        match self.base.get(id.value() as usize) {
            None | Some(&NOBODY) => Destination::Service,
            Some(&entry) if entry < SHARED => destination_of(entry),
            Some(_) => self.rare_destination(frame),
        }
    }

    #[cold]
    fn rare_destination(&self, frame: &Frame) -> Destination {
        let format = match frame.kind() {
            FrameKind::Data => 0,
            FrameKind::Fd | FrameKind::FdBitRateSwitch => FD,
            FrameKind::Remote => return Destination::Service,
        };
        let entry = self.entry(frame.id());
        if entry == NOBODY || entry & FD != format {
            return Destination::Service;
        }
        match entry & !FD {
            FOREIGN => Destination::Foreign,
            SHARED => self.shared_destination(frame),
            entry => destination_of(entry),
        }
    }

    /// Where a frame goes whose identifier several drives share.
    fn shared_destination(&self, frame: &Frame) -> Destination {
        let is_sender =
            |shared: &&SharedId| shared.id == frame.id() && shared.sender.has_sent(frame.payload());
        let found = self.shared.iter().find(is_sender);
        found.map_or(Destination::Service, |shared| destination_of(shared.entry & !FD))
    }
}

fn entry_of(id: Id, axis: u8, kind: u8) -> Result<u16, IdTaken> {
    if usize::from(axis) < MAX_AXES {
        Ok(1 + u16::from(axis) * 8 + u16::from(kind))
    } else {
        Err(IdTaken { id })
    }
}

const fn format_bit(format: FrameFormat) -> u16 {
    match format {
        FrameFormat::Classic => 0,
        FrameFormat::Fd | FrameFormat::FdBitRateSwitch => FD,
    }
}

const fn destination_of(entry: u16) -> Destination {
    let place = entry.wrapping_sub(1);
    let (axis, pdo) = ((place / 8) as u8, (place % 8) as u8);
    match pdo {
        ..ERROR_CONTROL => Destination::Feedback { axis, pdo },
        ERROR_CONTROL => Destination::ErrorControl { axis },
        UNUSED => Destination::Unused,
        _ => Destination::Emergency { axis },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::Pdo;
    use crate::pdo::Mapping;

    fn pdo(id: Id) -> Pdo {
        Pdo::classic(id, Mapping::default())
    }

    fn shared(id: Id, at: u8, value: u8) -> Pdo {
        Pdo { sender: Some(SenderByte::whole(at, value)), ..pdo(id) }
    }

    fn enter(table: &mut Dispatch, pdo: &Pdo, axis: u8, number: u8) -> Result<(), IdTaken> {
        table.feedback(pdo.id, pdo.format, pdo.sender, (axis, number))
    }

    #[test]
    fn every_axis_and_pdo_is_found_by_its_identifier_alone() {
        let mut table = Dispatch::default();
        for axis in 0..32u8 {
            let node = axis + 1;
            table.emergency(Id::canopen(0x080, node), axis).unwrap();
            for number in 0..4u8 {
                let id = Id::canopen(0x180 + 0x100 * u16::from(number), node);
                enter(&mut table, &pdo(id), axis, number).unwrap();
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
        enter(&mut table, &pdo(id), 0, 0).unwrap();
        assert_eq!(enter(&mut table, &pdo(id), 1, 0), Err(IdTaken { id }));
    }

    #[test]
    fn an_axis_whose_process_data_is_forgotten_keeps_its_other_messages_and_the_others_theirs() {
        let mut table = Dispatch::default();
        for axis in 0..3u8 {
            let node = axis + 1;
            table.emergency(Id::canopen(0x080, node), axis).unwrap();
            table.error_control(Id::canopen(0x700, node), axis).unwrap();
            enter(&mut table, &pdo(Id::canopen(0x180, node)), axis, 0).unwrap();
            table.unused(Id::canopen(0x280, node), axis).unwrap();
        }
        table.foreign(Id::canopen(0x200, 2), FrameFormat::Classic);
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
        enter(&mut table, &pdo(id), 0, 0).unwrap();
        assert_eq!(table.destination(&Frame::remote(id, 8).unwrap()), Destination::Service);
        let extended = Frame::of(Id::extended(0x181).unwrap(), [0; 8]);
        assert_eq!(table.destination(&extended), Destination::Service);
    }

    #[test]
    fn a_flexible_data_rate_frame_is_neither_feedback_nor_a_foreign_master_on_any_identifier() {
        let mut table = Dispatch::default();
        enter(&mut table, &pdo(Id::canopen(0x180, 1)), 0, 0).unwrap();
        table.emergency(Id::canopen(0x080, 1), 0).unwrap();
        table.error_control(Id::canopen(0x700, 1), 0).unwrap();
        table.foreign(Id::canopen(0x200, 1), FrameFormat::Classic);
        for (function, has_bit_rate_switch) in [0x180, 0x080, 0x700, 0x200]
            .into_iter()
            .flat_map(|function| [(function, false), (function, true)])
        {
            let frame = Frame::fd(Id::canopen(function, 1), &[1, 2, 3, 4], has_bit_rate_switch).unwrap();
            assert_eq!(table.destination(&frame), Destination::Service, "{frame:?}");
        }
    }

    #[test]
    fn as_many_29_bit_identifiers_as_there_is_room_for_are_found_in_whatever_order_they_were_entered() {
        let mut table = Dispatch::default();
        let id = |number: u32| Id::extended(number.wrapping_mul(0x0345_6789) & 0x1FFF_FFFF).unwrap();
        let axis = |number: u32| (number % 32) as u8;
        for number in 0..EXTENDED_IDS as u32 {
            enter(&mut table, &pdo(id(number)), axis(number), 1).unwrap();
        }
        for number in 0..EXTENDED_IDS as u32 {
            let destination = table.destination(&Frame::of(id(number), [0; 8]));
            assert_eq!(destination, Destination::Feedback { axis: axis(number), pdo: 1 });
            assert_eq!(table.emergency(id(number), 0), Err(IdTaken { id: id(number) }));
        }
        let one_more = id(1_000);
        assert_eq!(enter(&mut table, &pdo(one_more), 0, 0), Err(IdTaken { id: one_more }));
        assert_eq!(table.destination(&Frame::of(one_more, [])), Destination::Service);
        // An 11-bit identifier with the same number is another one.
        enter(&mut table, &pdo(Id::base(0).unwrap()), 3, 0).unwrap();
        let base = Frame::of(Id::base(0).unwrap(), []);
        assert_eq!(table.destination(&base), Destination::Feedback { axis: 3, pdo: 0 });
    }

    #[test]
    fn a_drive_of_flexible_data_rate_is_heard_with_and_without_bit_rate_switch_and_not_by_classic_frames() {
        let mut table = Dispatch::default();
        let (reply, command) = (Id::base(0x064).unwrap(), Id::base(0x001).unwrap());
        enter(&mut table, &Pdo { format: FrameFormat::Fd, ..pdo(reply) }, 2, 0).unwrap();
        table.foreign(command, FrameFormat::FdBitRateSwitch);
        for has_bit_rate_switch in [false, true] {
            let to = |id| table.destination(&Frame::fd(id, &[0; 16], has_bit_rate_switch).unwrap());
            assert_eq!(to(reply), Destination::Feedback { axis: 2, pdo: 0 });
            assert_eq!(to(command), Destination::Foreign);
        }
        for id in [reply, command] {
            assert_eq!(table.destination(&Frame::of(id, [0; 8])), Destination::Service);
        }
    }

    #[test]
    fn drives_are_told_apart_by_a_part_of_a_byte_whatever_its_other_bits_are() {
        let id = Id::base(0x011).unwrap();
        let low = |value| Pdo { sender: Some(SenderByte { at: 0, mask: 0x0F, value }), ..pdo(id) };
        let mut table = Dispatch::default();
        enter(&mut table, &low(1), 0, 0).unwrap();
        enter(&mut table, &low(2), 1, 0).unwrap();
        let to = |byte| table.destination(&Frame::of(id, [byte, 0x80]));
        for state in [0x00, 0x10, 0xE0] {
            assert_eq!(to(state | 1), Destination::Feedback { axis: 0, pdo: 0 });
            assert_eq!(to(state | 2), Destination::Feedback { axis: 1, pdo: 0 });
            assert_eq!(to(state | 3), Destination::Service, "nobody's");
        }
        let taken = Err(IdTaken { id });
        assert_eq!(enter(&mut table, &shared(id, 0, 3), 2, 0), taken, "other bits of the byte");
        assert_eq!(enter(&mut table, &low(2), 2, 0), taken, "two drives would be one");
    }

    #[test]
    fn drives_that_reply_by_one_identifier_are_told_apart_by_a_byte() {
        for id in [Id::base(0x064).unwrap(), Id::extended(0x064).unwrap()] {
            let mut table = Dispatch::default();
            for axis in 0..4u8 {
                enter(&mut table, &shared(id, 0, axis + 1), axis, 0).unwrap();
            }
            let to = |table: &Dispatch, payload: &[u8]| table.destination(&Frame::data(id, payload).unwrap());
            for axis in 0..4u8 {
                assert_eq!(to(&table, &[axis + 1, 0x80]), Destination::Feedback { axis, pdo: 0 });
            }
            assert_eq!(to(&table, &[9, 0x80]), Destination::Service, "nobody's");
            assert_eq!(to(&table, &[]), Destination::Service, "it has no such byte");
            let taken = Err(IdTaken { id });
            assert_eq!(enter(&mut table, &shared(id, 0, 2), 5, 0), taken, "two drives would be one");
            assert_eq!(enter(&mut table, &shared(id, 1, 9), 5, 0), taken, "another place");
            assert_eq!(enter(&mut table, &pdo(id), 5, 0), taken, "all of its frames");
            let fd = Pdo { format: FrameFormat::Fd, ..shared(id, 0, 9) };
            assert_eq!(enter(&mut table, &fd, 5, 0), taken, "another kind of frame");
            table.forget_process_data(1);
            assert_eq!(to(&table, &[2]), Destination::Service);
            assert_eq!(to(&table, &[3]), Destination::Feedback { axis: 2, pdo: 0 });
            for axis in [0, 2, 3] {
                table.forget_process_data(axis);
            }
            enter(&mut table, &pdo(id), 5, 0).unwrap();
        }
    }
}
