//! Requests and replies in words. A reply says nothing of its own: the request before it tells what it is.

use takt_rt::Frame;
use takt_wire::erob_can::entries;
use takt_wire::erob_can::frame::{ReceivedRequest, Reply, replying_node};
use takt_wire::erob_can::parameter::Access;

use crate::family::commission::TargetDrive;
use crate::family::erob::selection;
use crate::family::erob_can::session::ErobCanSession;

/// The words for the frames on the bus of a drive.
pub struct Words {
    target: TargetDrive,
    /// The last request on the bus.
    asked: Option<ReceivedRequest>,
}

impl Words {
    pub const fn new(target: TargetDrive) -> Self {
        Self { target, asked: None }
    }

    /// Describes a frame; the frames come in their order.
    pub fn of(&mut self, frame: &Frame) -> String {
        if let Some(request) = ReceivedRequest::decode(frame) {
            self.asked = Some(request);
            return self.at_node(request.node, self.request(&request));
        }
        let Some(node) = replying_node(frame) else { return "of another protocol".to_owned() };
        let asked = self.asked.take_if(|asked| asked.node == node);
        let words = match (Reply::decode(frame.payload()), asked) {
            (None, _) => "no reply of this protocol".to_owned(),
            (Some(reply), None) => format!("{reply:?}, to no request that was seen"),
            (Some(reply), Some(request)) => self.reply(&request, reply),
        };
        self.at_node(node, words)
    }

    fn at_node(&self, node: u8, words: String) -> String {
        if node == self.target.node { words } else { format!("node {node}: {words}") }
    }

    fn request(&self, request: &ReceivedRequest) -> String {
        let name = entries::describe(request.address);
        match (request.value, entries::find(request.address)) {
            (Some(value), _) => format!("set {name} to {}", self.value(request, value)),
            (None, Some(entry)) if entry.access == Access::Command => format!("command {name}"),
            (None, _) => format!("read {name}"),
        }
    }

    fn reply(&self, request: &ReceivedRequest, reply: Reply) -> String {
        let name = entries::describe(request.address);
        match reply {
            Reply::Value(value) => format!("{name} is {}", self.value(request, value)),
            Reply::Done => format!("{name} accepted"),
            Reply::Failed(None) => format!("{name} refused"),
            Reply::Failed(Some(code)) => format!("{name} refused: {code}"),
        }
    }

    fn value(&self, request: &ReceivedRequest, value: i32) -> String {
        let entry = entries::find(request.address);
        let words = |entry| selection::words::<ErobCanSession>(&self.target, entry, value.into());
        entry.map_or_else(|| value.to_string(), words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DriveFamily;
    use takt_wire::erob_can::error_code::ErrorCode;
    use takt_wire::erob_can::frame::Request;

    #[test]
    fn a_reply_is_described_by_the_request_before_it() {
        let drive = DriveFamily::of_family(&super::super::super::FACTS);
        let mut words = Words::new(TargetDrive::unconfigured(1, drive).unwrap());
        let read = Request::Read(entries::ACTUAL_POSITION.address).frame(1);
        let write = Request::Write(entries::OPERATING_MODE.address, 2).frame(1);
        assert_eq!(words.of(&read), "read actual position (0x0002)");
        let value = words.of(&Reply::Value(131_072).frame(1));
        assert!(value.starts_with("actual position (0x0002) is 131072 count = 1.57"), "{value}");
        assert_eq!(words.of(&write), "set operating mode (0x004E) to 2 (velocity control)");
        assert_eq!(
            words.of(&Reply::Failed(Some(ErrorCode::ENABLED)).frame(1)),
            "operating mode (0x004E) refused: error 0x0016, not allowed while the motor is enabled"
        );
        assert_eq!(words.of(&Reply::Done.frame(1)), "Done, to no request that was seen");
        assert_eq!(
            words.of(&Request::Command(entries::SAVE.address).frame(7)),
            "node 7: command save parameters (0x00E8)"
        );
    }
}
