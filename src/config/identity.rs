//! The identity of a drive.

/// Expected identity of a drive; `None` accepts any value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Object 1000.
    pub device_type: Option<u32>,
    /// Object 1018:1.
    pub vendor: Option<u32>,
    /// Object 1018:2.
    pub product: Option<u32>,
    /// Object 1018:3.
    pub revision: Option<u32>,
}
