//! An access to an object of a drive, for messages.

use takt_wire::canopen::object::Object;

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
    pub fn words(self, object: &Object) -> String {
        match self {
            Self::Read => format!("reading {object}"),
            Self::Write(value) => format!("writing {} to {object}", object.show(value)),
            Self::ReadBack(value) => format!("reading {object} back after writing {}", object.show(value)),
        }
    }
}
