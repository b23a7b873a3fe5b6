//! What a client is answered in a packet.

use bitcode::{Decode, Encode};
use takt::command::{CommandError, Reply, StreamError};

/// A reply on its way.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Answer {
    /// The number of the demand.
    pub number: u64,
    /// The slot of the newest state that the process of the controller knew then: what the reply tells is in it.
    pub slot: u64,
    /// The reply.
    pub reply: Replied,
}

/// The answer to a demand.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Replied {
    /// To a command.
    Command(Result<Reply, CommandError>),
    /// To points of a stream.
    Points(Result<(), StreamError>),
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
