//! How drives that speak a protocol of their own are found on a CAN bus.

use std::fmt;
use std::ops::RangeInclusive;
use std::pin::Pin;

use takt_rt::{Frame, Id};

use super::device::FoundDevice;
use super::session::ScanSession;

/// What a drive tells of itself, while it is asked.
pub type Reading<'a> = Pin<Box<dyn Future<Output = FoundDevice> + 'a>>;

/// Whether a frame that has the identifier of a heartbeat looks like one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Likeness {
    /// Its bytes are those of a heartbeat.
    Alike,
    /// Its bytes are none that a heartbeat can have.
    Different,
}

/// A protocol of a family, as far as a scan needs it.
pub trait OwnProtocol: Sync + fmt::Debug {
    /// Its name for people.
    fn name(&self) -> &'static str;

    /// The node IDs that its drives may have.
    fn nodes(&self) -> RangeInclusive<u8>;

    /// The request to a node by which it is found. It moves nothing, and changes nothing that lasts. `None` where its drives are only heard.
    fn question(&self, node: u8) -> Option<Frame>;

    /// The node that a frame comes from, if it is a reply in this protocol.
    fn replying(&self, frame: &Frame) -> Option<u8>;

    /// The identifier of the reply to a frame, if it is a request of this protocol that only reads.
    fn reply_to_reading(&self, _frame: &Frame) -> Option<Id> {
        None
    }

    /// What the question does to a drive that has torque; `None` where it does nothing. A question that does something is sent only
    /// when the person at the machine has asked for that.
    fn consequence(&self) -> Option<&'static str> {
        None
    }

    /// The node that a frame is a heartbeat of, if its identifier is that of one. It may be a frame of somebody else all the same: identifiers
    /// of CANopen are among them.
    fn heartbeat(&self, _frame: &Frame) -> Option<(u8, Likeness)> {
        None
    }

    /// Returns `true` if an identifier belongs to a drive that is known by its heartbeats.
    fn has_identifier(&self, _node: u8, _id: Id) -> bool {
        false
    }

    /// Returns `true` if every drive of this protocol takes a frame of this identifier for a command, whatever its node ID is. Nobody is
    /// asked by it where such a drive is heard.
    fn is_harmed_by(&self, _id: Id) -> bool {
        false
    }

    /// Returns `true` if a drive takes frames of this identifier for commands.
    fn is_commanded_by(&self, _node: u8, _id: Id) -> bool {
        false
    }

    /// The CANopen node whose SDO has the identifiers of this one, if there is one.
    fn shares_sdo_with(&self, _node: u8) -> Option<u8> {
        None
    }

    /// Asks a drive that has answered what it tells of itself. `reply` is its answer to the question.
    fn read<'a>(&'a self, session: &'a ScanSession, node: u8, reply: Frame) -> Reading<'a>;

    /// What is known of a drive that was heard, and not asked.
    fn overheard(&self, node: u8) -> FoundDevice;
}
