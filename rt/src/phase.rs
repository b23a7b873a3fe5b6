//! What the group is doing, as observers see it. The engine's own state has more: see `engine::state`.

/// What the group was doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
#[repr(u8)]
pub enum Phase {
    /// No set-points are sent: the drives are being brought up, or are not to be touched.
    #[default]
    Passive = 0,
    /// Set-points follow the actual positions; no torque.
    Disabled = 1,
    /// The drives are on their way to operation enabled.
    Enabling = 2,
    /// Enabled and standing still.
    Holding = 3,
    /// Enabled and on a trajectory.
    Moving = 4,
    /// Enabled and following a stream of set-points from outside.
    Streaming = 5,
    /// Decelerating.
    Stopping = 6,
    /// The drives are on their way to ready to switch on.
    Disabling = 7,
}

impl Phase {
    /// Every phase, in the order of their numbers.
    pub const ALL: [Self; 8] = [
        Self::Passive,
        Self::Disabled,
        Self::Enabling,
        Self::Holding,
        Self::Moving,
        Self::Streaming,
        Self::Stopping,
        Self::Disabling,
    ];
}
