//! The mode of operation of a drive, as far as it is the one that it is told.

use crate::control::ControlLaw;

/// How the mode of the drive and that of the axis' law stand to each other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) enum Mode {
    /// It is, or what it shows is a fault.
    #[default]
    Settled,
    /// It is told to change to that of another law, and has not shown it yet.
    Changing {
        /// The law that is to come into force.
        to: ControlLaw,
        /// What a loop of CST needs fed forward (N·m, N) to begin at the torque that holds the joint.
        holding: f64,
    },
}
