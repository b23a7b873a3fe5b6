//! Detects another master from the frames that are received before the first own frame is sent. No I/O: frames and times
//! go in, a verdict comes out.

use std::fmt;

use takt_rt::{Frame, FrameKind, Id, Nanoseconds};
use takt_wire::canopen::function_code;
use takt_wire::canopen::nmt::{NmtCommand, NmtTarget};

use crate::config::defaults;

/// Requests of an LSS master (CiA 305).
const LSS_REQUEST: u32 = 0x7E5;

/// The shortest listening time. The default heartbeat of takt (100 ms) comes three times in it, and so does SYNC at the
/// longest period of a cycle (100 ms).
const SHORTEST_NS: Nanoseconds = 300_000_000;
/// The longest listening time. A heartbeat that is configured to a minute is not awaited.
const LONGEST_NS: Nanoseconds = 2_000_000_000;
/// The listening time covers this many SYNC periods of the own configuration, and one and a half heartbeat periods.
const SYNC_PERIODS: u64 = 3;

/// A drive that the own configuration commands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommandedDrive {
    /// Its node ID.
    pub node: u8,
    /// The identifiers of its set-points.
    pub commands: Vec<Id>,
    /// The identifiers of its feedback, and of process data that it sends and nobody reads.
    pub feedback: Vec<Id>,
}

const NMT: Id = Id::canopen(function_code::NMT, 0);
/// The length of an NMT command.
const NMT_BYTES: usize = 2;
/// The highest node ID.
const HIGHEST_NODE: u8 = 127;

/// The traffic by which another master is recognised on a bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MasterTraffic {
    /// The node ID of this master.
    master: u8,
    /// The node IDs of the drives.
    drives: Vec<u8>,
    /// Identifiers of set-points, with the node ID of the drive that obeys them.
    set_points: Vec<(Id, u8)>,
    /// True if a drive replies by the identifier of NMT, as it may where no CANopen is on the bus.
    has_reply_by_nmt: bool,
    /// How long to listen.
    duration_ns: Nanoseconds,
}

impl MasterTraffic {
    /// Of a master with this node ID and these periods, and these drives.
    pub fn new(
        master: u8,
        sync_period_ns: Nanoseconds,
        heartbeat_ns: Option<Nanoseconds>,
        drives: &[CommandedDrive],
    ) -> Self {
        let mut set_points: Vec<(Id, u8)> = drives.iter().flat_map(|drive| rpdos(drive.node)).collect();
        for drive in drives {
            // A drive may send its feedback with an identifier that the pre-defined connection set gives to an RPDO.
            set_points.retain(|(id, _)| !drive.feedback.contains(id));
            set_points.extend(drive.commands.iter().map(|id| (*id, drive.node)));
        }
        let sync_ns = sync_period_ns.saturating_mul(SYNC_PERIODS);
        let heartbeat_ns = heartbeat_ns.map_or(0, |period_ns| period_ns.saturating_mul(3) / 2);
        Self {
            master,
            drives: drives.iter().map(|drive| drive.node).collect(),
            set_points,
            has_reply_by_nmt: drives.iter().any(|drive| drive.feedback.contains(&NMT)),
            duration_ns: sync_ns.max(heartbeat_ns).clamp(SHORTEST_NS, LONGEST_NS),
        }
    }

    /// Of an interface without a configuration, on which one node is addressed, or all of them.
    pub fn without_configuration(node: Option<u8>) -> Self {
        Self {
            master: defaults::MASTER_NODE,
            drives: node.into_iter().collect(),
            set_points: node.into_iter().flat_map(rpdos).collect(),
            has_reply_by_nmt: false,
            duration_ns: SHORTEST_NS,
        }
    }

    /// Of an interface without a configuration, where any node may be a drive that somebody commands. What no drive sends under the
    /// identifiers of the pre-defined connection set (CiA 301, 7.3.3) counts.
    pub fn of_any_node() -> Self {
        let drives: Vec<u8> = (1..=HIGHEST_NODE).filter(|node| *node != defaults::MASTER_NODE).collect();
        Self {
            master: defaults::MASTER_NODE,
            set_points: drives.iter().flat_map(|node| rpdos(*node)).collect(),
            drives,
            has_reply_by_nmt: false,
            duration_ns: SHORTEST_NS,
        }
    }

    /// The activity of another master that a frame shows; `None` for frames that a drive or a reader may send.
    pub fn judge(&self, frame: &Frame) -> Option<HeardMaster> {
        let id = frame.id();
        if frame.kind() != FrameKind::Data || id.is_extended() {
            return None;
        }
        let activity = if id == Id::canopen(function_code::SYNC, 0) {
            MasterActivity::Sync
        } else if id == NMT && self.has_reply_by_nmt && frame.payload().len() != NMT_BYTES {
            return None;
        } else if id == NMT {
            MasterActivity::Nmt(NmtCommand::decode(frame))
        } else if id.value() == LSS_REQUEST {
            MasterActivity::LayerSetting
        } else if id == Id::canopen(function_code::ERROR_CONTROL, self.master)
            && !self.drives.contains(&self.master)
        {
            MasterActivity::Heartbeat { node: self.master }
        } else if let Some((_, node)) = self.set_points.iter().find(|(known, _)| *known == id) {
            MasterActivity::SetPoints { node: *node }
        } else {
            let is_request_to = |node: &&u8| id == Id::canopen(function_code::SDO_REQUEST, **node);
            let node = *self.drives.iter().find(is_request_to).filter(|_| is_sdo_download(frame))?;
            MasterActivity::SdoWrite { node }
        };
        Some(HeardMaster { id, activity })
    }
}

fn rpdos(node: u8) -> impl Iterator<Item = (Id, u8)> {
    function_code::RPDO.into_iter().map(move |function| (Id::canopen(function, node), node))
}

/// Returns `true` if an SDO request writes (CiA 301, 7.2.4.3): client command specifier 0 and 1 (download), 6 (block download).
fn is_sdo_download(frame: &Frame) -> bool {
    frame.payload().first().is_some_and(|byte| matches!(byte >> 5, 0 | 1 | 6))
}

/// What only a master sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MasterActivity {
    /// SYNC.
    Sync,
    /// A network management command; `None` for one that CiA 301 does not know.
    Nmt(Option<(NmtCommand, NmtTarget)>),
    /// The heartbeat of a node that has the node ID of this master.
    Heartbeat {
        /// The node ID.
        node: u8,
    },
    /// Process data that a drive obeys.
    SetPoints {
        /// The node ID of the drive.
        node: u8,
    },
    /// A value that is written into a drive.
    SdoWrite {
        /// The node ID of the drive.
        node: u8,
    },
    /// A request of an LSS master.
    LayerSetting,
}

/// A frame that another master has sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct HeardMaster {
    /// The identifier of the frame.
    pub id: Id,
    /// What the frame means.
    pub activity: MasterActivity,
}

impl fmt::Display for HeardMaster {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.activity {
            MasterActivity::Sync => write!(f, "SYNC")?,
            MasterActivity::Nmt(None) => write!(f, "an NMT command")?,
            MasterActivity::Nmt(Some((command, target))) => {
                write!(f, "the NMT command `{}` to ", command_name(command))?;
                match target {
                    NmtTarget::All => write!(f, "all nodes")?,
                    NmtTarget::Node(node) => write!(f, "node {node}")?,
                }
            }
            MasterActivity::Heartbeat { node } => {
                write!(f, "the heartbeat of node {node}, which is the node ID of this master")?;
            }
            MasterActivity::SetPoints { node } => write!(f, "set-points for node {node}")?,
            MasterActivity::SdoWrite { node } => write!(f, "an SDO write to node {node}")?,
            MasterActivity::LayerSetting => write!(f, "a request of an LSS master")?,
        }
        write!(f, " (identifier {:?})", self.id)
    }
}

const fn command_name(command: NmtCommand) -> &'static str {
    match command {
        NmtCommand::Start => "start",
        NmtCommand::Stop => "stop",
        NmtCommand::EnterPreOperational => "enter pre-operational",
        NmtCommand::ResetNode => "reset node",
        NmtCommand::ResetCommunication => "reset communication",
    }
}

/// Listening on one bus, for longer than the pauses between the frames of another master.
#[derive(Clone, Debug)]
pub struct Listening {
    traffic: MasterTraffic,
    end_ns: Nanoseconds,
    heard: Option<HeardMaster>,
}

/// The result of listening so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// No other master was heard yet.
    Undecided,
    /// No other master is active.
    Free,
    /// Another master is active.
    Occupied(HeardMaster),
}

impl Listening {
    /// Begins to listen at this time.
    pub fn new(traffic: MasterTraffic, now_ns: Nanoseconds) -> Self {
        let end_ns = now_ns.saturating_add(traffic.duration_ns);
        Self { traffic, end_ns, heard: None }
    }

    /// Takes a frame from the bus. The first one of another master counts.
    pub fn receive(&mut self, frame: &Frame) {
        self.heard = self.heard.or_else(|| self.traffic.judge(frame));
    }

    /// The verdict at this time.
    pub fn verdict(&self, now_ns: Nanoseconds) -> Verdict {
        match self.heard {
            Some(heard) => Verdict::Occupied(heard),
            None if now_ns >= self.end_ns => Verdict::Free,
            None => Verdict::Undecided,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Nanoseconds = 1_000_000;

    /// A drive with one PDO in each direction, with the identifiers that CiA 301 gives them.
    fn drive(node: u8) -> CommandedDrive {
        let (commands, feedback) = (vec![Id::canopen(0x200, node)], vec![Id::canopen(0x180, node)]);
        CommandedDrive { node, commands, feedback }
    }

    /// Drives 1 to 3, commanded by this master.
    fn arm(master: u8) -> MasterTraffic {
        MasterTraffic::new(master, MS, Some(100 * MS), &[1, 2, 3].map(drive))
    }

    fn frame(id: u32, bytes: &[u8]) -> Frame {
        Frame::data(Id::base(id).unwrap(), bytes).unwrap()
    }

    fn heard(id: u32, bytes: &[u8]) -> Option<String> {
        arm(127).judge(&frame(id, bytes)).map(|heard| heard.to_string())
    }

    #[track_caller]
    fn is_a_master(id: u32, bytes: &[u8], words: &str) {
        assert_eq!(heard(id, bytes).as_deref(), Some(words));
    }

    #[test]
    fn what_only_a_master_sends_is_recognised_with_its_meaning() {
        is_a_master(0x080, &[], "SYNC (identifier 080)");
        is_a_master(0x080, &[7], "SYNC (identifier 080)");
        is_a_master(0x000, &[0x81, 0], "the NMT command `reset node` to all nodes (identifier 000)");
        is_a_master(0x000, &[0x01, 3], "the NMT command `start` to node 3 (identifier 000)");
        is_a_master(0x000, &[9], "an NMT command (identifier 000)");
        is_a_master(
            0x77F,
            &[5],
            "the heartbeat of node 127, which is the node ID of this master (identifier 77F)",
        );
        is_a_master(0x202, &[0x1F, 0, 0, 0, 0, 0], "set-points for node 2 (identifier 202)");
        is_a_master(0x503, &[0; 8], "set-points for node 3 (identifier 503)");
        is_a_master(0x601, &[0x2B, 0x40, 0x60, 0, 6, 0, 0, 0], "an SDO write to node 1 (identifier 601)");
        is_a_master(0x7E5, &[4, 1, 0, 0, 0, 0, 0, 0], "a request of an LSS master (identifier 7E5)");
    }

    #[test]
    fn what_a_drive_or_a_reader_sends_is_no_master() {
        for (id, bytes) in [
            (0x701, &[5][..]),                        // the heartbeat of a configured axis
            (0x70A, &[5]),                            // the heartbeat of a node that is no axis
            (0x181, &[0x37, 0x16, 0, 0]),             // feedback
            (0x581, &[0x60, 0x40, 0x60, 0, 0, 0, 0]), // an SDO response
            (0x081, &[0; 8]),                         // an emergency message
            (0x601, &[0x40, 0x41, 0x60, 0, 0, 0, 0]), // an SDO read
            (0x601, &[]),                             // no SDO request at all
            (0x62A, &[0x2B, 0x40, 0x60, 0, 6, 0, 0]), // an SDO write to a node that is no axis
            (0x20A, &[0; 8]),                         // process data of a node that is no axis
            (0x204, &[0; 8]),                         // set-points of an axis on the other bus
            (0x100, &[0; 6]),                         // the time of day
            (0x7E4, &[0; 8]),                         // the answer of an LSS device
        ] {
            assert_eq!(heard(id, bytes), None, "{id:03X}");
        }
        let traffic = arm(127);
        let sync = Id::base(0x080).unwrap();
        for other_kind in [
            Frame::remote(sync, 0).unwrap(),
            Frame::fd(sync, &[], true).unwrap(),
            Frame::data(Id::extended(0x080).unwrap(), &[]).unwrap(),
        ] {
            assert_eq!(traffic.judge(&other_kind), None, "{other_kind:?}");
        }
    }

    #[test]
    fn the_axis_that_has_the_node_id_of_the_master_is_no_master() {
        let boot_up = Frame::of(Id::canopen(0x700, 1), [0]);
        assert_eq!(arm(1).judge(&boot_up), None);
    }

    #[test]
    fn feedback_on_the_identifier_of_an_rpdo_is_no_set_point_and_set_points_may_have_any_identifier() {
        let own = Id::base(0x1F0).unwrap();
        let unusual = CommandedDrive { node: 4, commands: vec![own], feedback: vec![Id::canopen(0x200, 4)] };
        let traffic = MasterTraffic::new(127, MS, None, &[unusual]);
        assert_eq!(traffic.judge(&frame(0x204, &[0; 8])), None);
        let activity = MasterActivity::SetPoints { node: 4 };
        assert_eq!(traffic.judge(&frame(0x1F0, &[0; 8])), Some(HeardMaster { id: own, activity }));
    }

    #[test]
    fn without_a_configuration_the_node_that_is_addressed_counts() {
        let traffic = MasterTraffic::without_configuration(Some(5));
        assert!(traffic.judge(&frame(0x205, &[0; 6])).is_some());
        assert!(traffic.judge(&frame(0x77F, &[5])).is_some());
        assert!(traffic.judge(&frame(0x206, &[0; 6])).is_none());
        assert!(MasterTraffic::without_configuration(None).judge(&frame(0x205, &[0; 6])).is_none());
    }

    #[test]
    fn where_any_node_may_be_a_drive_the_set_points_and_the_writes_to_each_count() {
        let traffic = MasterTraffic::of_any_node();
        for (id, bytes) in
            [(0x080, &[][..]), (0x201, &[0; 6]), (0x57E, &[0; 8]), (0x67E, &[0x2F; 8]), (0x77F, &[5])]
        {
            assert!(traffic.judge(&frame(id, bytes)).is_some(), "{id:03X}");
        }
        for (id, bytes) in [(0x181, &[0; 8][..]), (0x601, &[0x40; 8]), (0x581, &[0x60; 8]), (0x701, &[5])] {
            assert!(traffic.judge(&frame(id, bytes)).is_none(), "{id:03X}");
        }
    }

    #[test]
    fn it_is_listened_long_enough_for_three_sync_and_one_heartbeat_but_not_for_a_minute() {
        let duration_ns = |period_ns, heartbeat_ns| {
            MasterTraffic::new(127, period_ns, heartbeat_ns, &[drive(1)]).duration_ns
        };
        assert_eq!(duration_ns(MS, Some(100 * MS)), 300 * MS);
        assert_eq!(duration_ns(MS, None), 300 * MS);
        assert_eq!(duration_ns(200 * MS, Some(100 * MS)), 600 * MS);
        assert_eq!(duration_ns(MS, Some(1_000 * MS)), 1_500 * MS);
        assert_eq!(duration_ns(MS, Some(60_000 * MS)), 2_000 * MS);
    }

    #[test]
    fn the_verdict_comes_with_the_first_frame_of_a_master_or_at_the_end_of_the_silence() {
        let begin = || Listening::new(arm(127), 5_000);
        let mut listening = begin();
        listening.receive(&frame(0x181, &[0; 8]));
        assert_eq!(listening.verdict(300_004_999), Verdict::Undecided);
        assert_eq!(listening.verdict(300_005_000), Verdict::Free);
        let mut listening = begin();
        listening.receive(&frame(0x201, &[0; 6]));
        listening.receive(&frame(0x080, &[]));
        let heard =
            HeardMaster { id: Id::base(0x201).unwrap(), activity: MasterActivity::SetPoints { node: 1 } };
        assert_eq!(listening.verdict(5_001), Verdict::Occupied(heard));
        assert_eq!(listening.verdict(u64::MAX), Verdict::Occupied(heard));
    }
}
