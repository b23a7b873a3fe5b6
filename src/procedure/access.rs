//! An access to an object of a drive, for messages.

use takt_wire::canopen::object::Object;

use crate::words;
use crate::words::Words;

/// An access to an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Reading it.
    Read,
    /// Writing this value to it.
    Write(i64),
    /// Reading it back after this value was written.
    ReadBack(i64),
}

impl Access {
    /// The access in words, for `object`.
    pub fn words(self, object: &Object) -> Words {
        let name = object.to_string();
        match self {
            Self::Read => words!("reading {object}", object = name),
            Self::Write(value) => {
                words!("writing {value} to {object}", value = object.show(value), object = name)
            }
            Self::ReadBack(value) => words!(
                "reading {object} back after writing {value}",
                object = name,
                value = object.show(value)
            ),
        }
    }
}
