//! Error control of a drive.

/// Error control of a drive (CiA 301, 7.2.8).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorControl {
    /// It sends heartbeats (object 1017).
    Heartbeat {
        /// Their period, where it cannot be written.
        fixed_ms: Option<u16>,
    },
    /// It has no heartbeat, and replies to node guarding (objects 100C and 100D).
    Guarding {
        /// Its guard time, where it cannot be written.
        fixed_guard_time_ms: Option<u16>,
        /// Its life-time factor, where it cannot be written.
        fixed_life_time_factor: Option<u8>,
    },
    /// It has neither.
    None,
}
