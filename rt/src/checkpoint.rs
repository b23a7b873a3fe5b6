//! The state of an engine and of a stream as bytes, so that a replay can begin in the middle of a run.
//!
//! The bytes are for the version of this crate that has made them. The real-time thread makes none: this takes an allocator, and
//! needs the feature `checkpoint`.

/// Why a state cannot be taken over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CheckpointError {
    /// The bytes are none of this version.
    Unreadable,
    /// They are of a machine with other axes, groups or buses, or with another period.
    OtherMachine,
}

impl core::error::Error for CheckpointError {}

impl core::fmt::Display for CheckpointError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Unreadable => "the state of the engine is damaged, or of another version of takt",
            Self::OtherMachine => {
                "the state of the engine is of a machine with other axes, groups or buses, or with another period"
            }
        })
    }
}

impl From<bitcode::Error> for CheckpointError {
    fn from(_: bitcode::Error) -> Self {
        Self::Unreadable
    }
}
