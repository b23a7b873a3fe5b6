//! Network management (CiA 301, 7.2.8): the master's commands, the NMT states, boot-up and heartbeat messages, and a
//! heartbeat consumer.

use std::fmt;

use takt_rt::{Frame, Id};

use super::{function_code, node_of};

/// A command of the NMT master (CiA 301, 7.2.8.2.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum NmtCommand {
    /// Enter operational: all services work.
    Start = 0x01,
    /// Enter stopped: only NMT and error control work; the SDO server does not answer.
    Stop = 0x02,
    /// Enter pre-operational: SDO works, PDOs do not.
    EnterPreOperational = 0x80,
    /// Reset the whole application.
    ResetNode = 0x81,
    /// Restore the stored communication parameters and boot.
    ResetCommunication = 0x82,
}

impl NmtCommand {
    /// Every command.
    pub const ALL: [Self; 5] =
        [Self::Start, Self::Stop, Self::EnterPreOperational, Self::ResetNode, Self::ResetCommunication];

    /// The frame of this command.
    pub fn frame(self, target: NmtTarget) -> Frame {
        let node = match target {
            NmtTarget::All => 0,
            NmtTarget::Node(node) => node,
        };
        Frame::of(Id::canopen(0, 0), [self as u8, node])
    }

    /// Decodes a command; `None` for other frames.
    pub fn decode(frame: &Frame) -> Option<(Self, NmtTarget)> {
        let (0, false, &[command, node]) = (frame.id().value(), frame.id().is_extended(), frame.payload())
        else {
            return None;
        };
        let command = Self::ALL.into_iter().find(|known| *known as u8 == command)?;
        match node {
            0 => Some((command, NmtTarget::All)),
            1..=0x7F => Some((command, NmtTarget::Node(node))),
            _ => None,
        }
    }
}

/// The addressee of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum NmtTarget {
    /// Every node on the bus.
    All,
    /// One node, 1 to 127.
    Node(u8),
}

/// The state of a node in its error control messages (CiA 301, 7.2.8.3.2.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum NmtState {
    /// The node has just booted and is now pre-operational.
    BootUp = 0x00,
    /// Only NMT and error control work.
    Stopped = 0x04,
    /// All services work.
    Operational = 0x05,
    /// SDO works, PDOs do not.
    PreOperational = 0x7F,
}

impl NmtState {
    /// Every state.
    pub const ALL: [Self; 4] = [Self::BootUp, Self::Stopped, Self::Operational, Self::PreOperational];
}

impl fmt::Display for NmtState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::BootUp => "boot-up",
            Self::Stopped => "stopped",
            Self::Operational => "operational",
            Self::PreOperational => "pre-operational",
        })
    }
}

/// A boot-up or heartbeat message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ErrorControl {
    /// The sender's node ID, 1 to 127.
    pub node: u8,
    /// The sender's state.
    pub state: NmtState,
}

impl ErrorControl {
    /// Decodes a message; `None` for other frames and unknown states. The top bit, which toggles in node guarding, is
    /// ignored.
    pub fn decode(frame: &Frame) -> Option<Self> {
        let node = node_of(frame, function_code::ERROR_CONTROL)?;
        let &[byte] = frame.payload() else { return None };
        let state = NmtState::ALL.into_iter().find(|state| *state as u8 == byte & 0x7F)?;
        Some(Self { node, state })
    }

    /// The frame of this message: a heartbeat.
    pub fn frame(self) -> Frame {
        Frame::of(Id::canopen(function_code::ERROR_CONTROL, self.node), [self.state as u8])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_encoded_as_in_the_standard() {
        assert_eq!(format!("{:?}", NmtCommand::ResetCommunication.frame(NmtTarget::Node(2))), "000#8202");
        assert_eq!(format!("{:?}", NmtCommand::Start.frame(NmtTarget::All)), "000#0100");
    }

    #[test]
    fn every_command_is_decoded_to_itself() {
        for command in NmtCommand::ALL {
            for target in [NmtTarget::All, NmtTarget::Node(1), NmtTarget::Node(127)] {
                assert_eq!(NmtCommand::decode(&command.frame(target)), Some((command, target)));
            }
        }
    }

    #[test]
    fn other_frames_are_not_decoded_as_commands() {
        let nmt = Id::canopen(0, 0);
        assert_eq!(NmtCommand::decode(&Frame::of(nmt, [0x03, 1])), None);
        assert_eq!(NmtCommand::decode(&Frame::of(nmt, [0x01, 128])), None);
        assert_eq!(NmtCommand::decode(&Frame::of(nmt, [0x01])), None);
        assert_eq!(NmtCommand::decode(&Frame::of(Id::extended(0).unwrap(), [0x01, 1])), None);
    }

    #[test]
    fn error_control_messages_are_decoded_to_node_and_state() {
        let read = |bytes: &[u8]| ErrorControl::decode(&Frame::data(Id::canopen(0x700, 2), bytes).unwrap());
        assert_eq!(read(&[0x00]), Some(ErrorControl { node: 2, state: NmtState::BootUp }));
        assert_eq!(read(&[0x85]), Some(ErrorControl { node: 2, state: NmtState::Operational }));
        assert_eq!(read(&[0x06]), None);
        assert_eq!(read(&[]), None);
        assert_eq!(read(&[5, 0]), None);
        assert_eq!(ErrorControl::decode(&Frame::of(Id::canopen(0x700, 0), [5])), None);
        assert_eq!(ErrorControl::decode(&Frame::of(Id::canopen(0x680, 0), [5])), None);
    }
}
