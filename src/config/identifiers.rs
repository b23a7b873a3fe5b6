//! The identifiers of the frames between a drive and the controller.

use takt_rt::Id;
use takt_wire::bit_fields::FieldDevice;

use super::drive_family::DriveFamily;

/// Purpose of an identifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IdUse {
    /// Frames of the controller in the cycle.
    Request,
    /// Frames of the drive.
    Reply,
    /// Frames that the drive sends by itself and nobody reads.
    Heartbeat,
    /// Frames of the controller that set the drive up. Drives of one make may share them.
    Setup,
    /// Frames of a drive with another protocol, in either direction.
    Node,
}

impl DriveFamily {
    /// The identifiers of the frames of a drive with this node ID, and what they are for.
    pub(crate) fn frame_identifiers(&self, node: u8) -> Vec<(Id, IdUse)> {
        let Some(device) = self.description::<FieldDevice>() else {
            return self.identifiers(node).into_iter().map(|id| (id, IdUse::Node)).collect();
        };
        let requests = device.request_ids(node).into_iter().map(|id| (id, IdUse::Request));
        let setup = device.setup_ids(node).into_iter().map(|id| (id, IdUse::Setup));
        let heartbeat = device.heartbeat_id(node).map(|id| (id, IdUse::Heartbeat));
        requests.chain(setup).chain([(device.reply_id(node), IdUse::Reply)]).chain(heartbeat).collect()
    }
}
