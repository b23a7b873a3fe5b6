//! Why a question to a device on a bus is not sent.

use takt_rt::Frame;

/// Why a running controller does not send a question to a device on one of its buses. Nothing was sent.
#[derive(Clone, Debug, PartialEq, bitcode::Encode, bitcode::Decode, thiserror::Error)]
#[non_exhaustive]
pub enum QuestionError {
    /// There is no such bus.
    #[error("there is no bus {bus}: the controller has {buses} buses")]
    NoSuchBus {
        /// The number of the bus.
        bus: usize,
        /// The number of buses.
        buses: usize,
    },
    /// The frame may do more than read.
    #[error(
        "{frame:?} is no question that only reads, and a running controller sends no other frames for its clients"
    )]
    NotReading {
        /// The frame.
        frame: Frame,
    },
    /// The identifiers are those of a drive of the configuration.
    #[error("{frame:?} would reach the drive of {axis}, which is asked by its controller alone")]
    OwnDrive {
        /// The frame.
        frame: Frame,
        /// The name of the axis.
        axis: String,
    },
}
