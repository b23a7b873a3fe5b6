//! What the data sheet of one drive says, where the drives of a family differ.

use takt_rt::{Nanoseconds, OperationMode};
use takt_wire::canopen::object::{DataType, Object, ObjectAddress};
use takt_wire::quirks::NamedObject;

/// The data sheet of one drive, as far as its commissioning and its error codes need it.
pub trait DataSheet {
    /// Returns `true` if the drive has an object.
    fn has(&self, address: ObjectAddress) -> bool;

    /// The name of an object.
    fn name(&self, _address: ObjectAddress) -> Option<&str> {
        None
    }

    /// Returns `true` if the drive lets an object be written.
    fn is_writable(&self, address: ObjectAddress) -> bool;

    /// The type of an object that holds a whole number of at most 32 bits.
    fn data_type(&self, address: ObjectAddress) -> Option<DataType>;

    /// Returns `true` if the drive has a mode that its object 6502 may leave out.
    fn adds_mode(&self, mode: OperationMode) -> bool;

    /// The drive's own error codes in words, where they deviate from the standard.
    fn own_errors(&self) -> &[(u16, String)];

    /// What clears a fault of the drive, where it is known better than by the standard.
    fn own_cure(&self, _code: u16) -> Option<&'static str> {
        None
    }

    /// The objects of the drive that have a name or a unit other than the standard's.
    fn named(&self) -> &[NamedObject] {
        &[]
    }

    /// The object with the temperature of the drive in °C.
    fn temperature(&self) -> Option<Object> {
        None
    }

    /// Returns `true` if the drive has no inputs for the switches of homing.
    fn lacks_switches(&self) -> bool {
        false
    }

    /// Returns `true` if the drive does not answer SDO requests for objects that it lacks.
    fn is_silent_if_absent(&self) -> bool {
        false
    }

    /// How long the drive takes to store its parameters, if it is known.
    fn storing_ns(&self) -> Option<Nanoseconds>;

    /// How long the drive takes to answer an SDO request, at most, if it is known.
    fn sdo_reply_ns(&self) -> Option<Nanoseconds>;
}
