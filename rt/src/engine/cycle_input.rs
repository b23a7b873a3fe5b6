//! What a cycle begins with, and whether its set-points are ready in time.

use crate::bit_set::BitSet;
use crate::port::BusHealth;
use crate::time::Nanoseconds;

/// What a cycle begins with.
#[derive(Clone, Copy, Debug)]
pub struct CycleInput<'a> {
    /// The slot.
    pub slot: u64,
    /// Its start on the grid: the time that its set-points stand for.
    pub slot_start_ns: Nanoseconds,
    /// The time at which its set-points must be ready.
    pub set_points_due_ns: Nanoseconds,
    /// The time.
    pub now_ns: Nanoseconds,
    /// How long the computer has been suspended since the cycle before: the clock stood still then.
    pub suspended_ns: Nanoseconds,
    /// The state of each bus.
    pub buses: &'a [BusHealth],
    /// The buses on which own frames of an earlier cycle still wait for the wire.
    pub behind: BitSet,
}

/// The deadline of the set-points of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum Deadline {
    /// They were.
    Met,
    /// They would run into the next SYNC. Nothing leaves but what stops the drives, and the slot counts as missed.
    Missed,
}
