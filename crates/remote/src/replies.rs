//! What a client is answered in a packet.

use bitcode::{Decode, Encode};
use takt::command::{CommandError, LeaseError, MotionId, StreamError, TrajectoryProgress};

/// A reply on its way.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Answer {
    /// The number of the demand.
    pub number: u64,
    /// The slot of the newest state that the process of the controller knew then: what the reply tells is in it.
    pub slot: u64,
    /// The reply.
    pub reply: Reply,
}

/// The answer to a demand.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Reply {
    /// It is done, or has begun.
    Done,
    /// A motion has been asked for.
    Motion(MotionId),
    /// It has changed nothing.
    Refused(CommandError),
    /// Points were not taken.
    NotTaken(StreamError),
    /// How far a trajectory is; `None` if it is none under way.
    Progress(Option<TrajectoryProgress>),
    /// Why drives were not brought up again; `None` if they were, or are being brought up.
    BringUpFailure(Option<String>),
}

impl Answer {
    /// Its packet.
    pub fn packet(&self) -> Vec<u8> {
        bitcode::encode(self)
    }

    /// The answer of a packet; `None` if no controller of takt has sent it.
    pub fn of(packet: &[u8]) -> Option<Self> {
        bitcode::decode(packet).ok()
    }
}

impl Reply {
    /// The command was refused for the lease.
    pub const fn lease(error: LeaseError) -> Self {
        Self::Refused(CommandError::Lease(error))
    }
}
