//! The scan of a CAN bus.

use std::ops::RangeInclusive;

use takt_rt::Nanoseconds;

use super::Scanned;
use super::canopen;
use super::device::{Answered, FoundDevice};
use super::heard::{Heard, HeardDrive, HeardNode};
use super::own_protocol::OwnProtocol;
use super::session::{ScanClient, ScanSession};
use crate::canopen::objects::DEVICE_TYPE;
use crate::canopen::sdo::SdoRequest;
use crate::family::commission::Failure;
use crate::procedure::Procedure;

/// From one question to the next, so that replies and the traffic of others have room.
const SPACING_NS: Nanoseconds = 2_000_000;
/// Between two looks at the progress while it listens.
const LISTENING_STEP_NS: Nanoseconds = 20_000_000;
/// How often everybody is asked who has not answered.
const ROUNDS: usize = 2;
/// The highest node ID of CANopen.
const HIGHEST_NODE: u8 = 127;

/// More frames in a second than drives send that nobody commands: a third of what a bus of 1 Mbit/s carries.
const FLOODED_HZ: f64 = 3_000.0;

/// What is asked on a CAN bus.
#[derive(Clone, Debug)]
pub struct BusScan {
    /// The node IDs that are asked. Devices that are only heard are found beyond them, too.
    pub nodes: RangeInclusive<u8>,
    /// How long an answer is awaited.
    pub wait_ns: Nanoseconds,
    /// How long to listen, at the least. A heartbeat usually comes once a second.
    pub listening_ns: Nanoseconds,
    /// Whether nothing is sent at all.
    pub only_listens: bool,
    /// Whether drives may be asked that lose their torque by the question.
    pub may_take_torque: bool,
    /// Whether the bus carries CAN FD frames.
    pub has_fd: bool,
    /// The node IDs of the running controller that sends the questions, if one does: its drives are not asked.
    pub of_controller: Option<Vec<u8>>,
}

/// The procedure of a scan. It never fails: interrupted, it ends with what it has found so far.
pub fn scan_bus(scan: BusScan) -> Procedure<ScanClient, Scanned, Failure> {
    let session = ScanSession::new(ScanClient::new());
    let work = Scan { session: session.clone(), scan, done: 0, of: 0 };
    Procedure::new(session, async move { Ok(work.carry_out().await) })
}

struct Scan {
    session: ScanSession,
    scan: BusScan,
    /// Questions that were asked, and all of them.
    done: u32,
    of: u32,
}

impl Scan {
    async fn carry_out(mut self) -> Scanned {
        let mut devices = vec![];
        let protocols = self.session.heard(|heard| heard.protocols().to_vec());
        let asked: Vec<(usize, &'static dyn OwnProtocol)> =
            protocols.into_iter().enumerate().filter(|(_, protocol)| self.may_ask(*protocol)).collect();
        if !self.scan.only_listens {
            let own = asked.iter().map(|(_, protocol)| self.asked_nodes(*protocol).count());
            let questions = ROUNDS * (own.sum::<usize>() + self.canopen_nodes().count());
            self.of = u32::try_from(questions).unwrap_or(u32::MAX);
            self.ask_round(&asked, &mut devices).await;
        }
        self.listen().await;
        if !self.scan.only_listens {
            // Whoever was switched on with the scan has booted meanwhile.
            self.ask_round(&asked, &mut devices).await;
        }
        let is_interrupted = self.session.is_interrupted();
        self.session.heard(|heard| {
            add_heard(heard, &mut devices);
            mark_duplicates(heard, &mut devices);
            devices.sort_by_key(|device| (device.node.is_none(), device.node));
            let mut remarks = remarks(heard, self.session.now_ns());
            // That its own controller is active is no news.
            remarks.extend(self.scan.of_controller.is_none().then(|| active_master(heard)).flatten());
            Scanned { devices, remarks, is_interrupted }
        })
    }

    async fn ask_round(
        &mut self,
        asked: &[(usize, &'static dyn OwnProtocol)],
        devices: &mut Vec<FoundDevice>,
    ) {
        for (place, protocol) in asked {
            self.ask_in(*place, *protocol, devices).await;
        }
        self.ask_canopen(devices).await;
    }

    /// Listens for the rest of the time that was wished for.
    async fn listen(&self) {
        self.session.step("listen");
        let until_ns = self.scan.listening_ns;
        while self.session.now_ns() < until_ns && !self.session.is_interrupted() {
            let now_ns = self.session.now_ns();
            self.session.pause((until_ns - now_ns).min(LISTENING_STEP_NS)).await;
            if self.scan.only_listens {
                let part = |ns: Nanoseconds| u32::try_from(ns / 1_000_000).unwrap_or(u32::MAX);
                self.session.progress(part(self.session.now_ns().min(until_ns)), part(until_ns));
            }
        }
    }

    /// Whether the question of a protocol may be asked on this bus.
    fn may_ask(&self, protocol: &dyn OwnProtocol) -> bool {
        let is_allowed = self.scan.may_take_torque || protocol.consequence().is_none();
        is_allowed && (self.scan.has_fd || !protocol.question(1).is_fd())
    }

    /// The node IDs that may be asked.
    fn nodes(&self) -> impl Iterator<Item = u8> + use<> {
        let left_alone = self.scan.of_controller.clone().unwrap_or_default();
        self.scan.nodes.clone().filter(move |node| !left_alone.contains(node))
    }

    fn asked_nodes(&self, protocol: &dyn OwnProtocol) -> impl Iterator<Item = u8> + use<> {
        let own = protocol.nodes();
        self.nodes().filter(move |node| own.contains(node))
    }

    fn canopen_nodes(&self) -> impl Iterator<Item = u8> + use<> {
        self.nodes().filter(|node| (1..=HIGHEST_NODE).contains(node))
    }

    fn asked_one(&mut self) {
        self.done = self.done.saturating_add(1);
        self.session.progress(self.done, self.of);
    }

    /// Asks in the protocol of a vendor who has not answered yet, and reads what those tell that answer.
    async fn ask_in(
        &mut self,
        place: usize,
        protocol: &'static dyn OwnProtocol,
        devices: &mut Vec<FoundDevice>,
    ) {
        self.session.step(protocol.name());
        let known = known_nodes(devices, Answered::Own(protocol.name()));
        for node in self.asked_nodes(protocol) {
            if self.session.is_interrupted() {
                break;
            }
            let twin = protocol.shares_sdo_with(node);
            // It has shown that it is a CANopen node: the question would reach its SDO server.
            let is_of_node = |heard: &Heard, twin| heard.node(twin).is_some_and(HeardNode::is_there);
            let is_taken = twin.is_some_and(|twin| self.session.heard(|heard| is_of_node(heard, twin)));
            if !is_taken && !known.contains(&node) {
                self.session.count_request(|heard| {
                    heard.own_request(place, node);
                    // Should it be there and quiet so far, its SDO server may reply to this.
                    twin.into_iter().for_each(|twin| heard.sdo_request(twin));
                });
                self.session.send_frame(protocol.question(node));
                self.session.pause(SPACING_NS).await;
            }
            self.asked_one();
        }
        self.session.pause(self.scan.wait_ns).await;
        let replied: Vec<(u8, HeardDrive)> = self.session.heard(|heard| heard.drives_of(place).collect());
        for (node, heard) in replied.into_iter().filter(|(node, _)| !known.contains(node)) {
            if let Some(reply) = heard.reply
                && !self.session.is_interrupted()
            {
                devices.push(protocol.read(&self.session, node, reply).await);
            }
        }
    }

    /// Asks every node that has not answered yet for its device type (1000), and reads what those tell that answer.
    async fn ask_canopen(&mut self, devices: &mut Vec<FoundDevice>) {
        self.session.step("CANopen");
        let known = known_nodes(devices, Answered::Sdo);
        for node in self.canopen_nodes() {
            if self.session.is_interrupted() {
                break;
            }
            // A request to such a node would be one to the drive that has answered in its own protocol.
            if !known.contains(&node) && !self.is_own_drive(node) {
                self.session.count_request(|heard| heard.sdo_request(node));
                self.session.send_frame(SdoRequest::Upload { object: DEVICE_TYPE.address }.frame(node));
                self.session.pause(SPACING_NS).await;
            }
            self.asked_one();
        }
        self.session.pause(self.scan.wait_ns).await;
        let nodes: Vec<u8> = self.session.heard(|heard| {
            heard.nodes().filter(|(_, heard)| heard.has_answered()).map(|(node, _)| node).collect()
        });
        let asked: Vec<u8> = self.canopen_nodes().collect();
        let is_new = |node: &u8| asked.contains(node) && !known.contains(node);
        for node in nodes.into_iter().filter(is_new) {
            devices.push(match self.session.is_interrupted() {
                // It has answered, so that it is there.
                true => FoundDevice::new(Some(node), Answered::Sdo, canopen::KIND),
                false => canopen::read(&self.session, node, self.scan.wait_ns).await,
            });
        }
    }

    /// Whether the SDO identifiers of a node are those of a drive that has answered in its own protocol.
    fn is_own_drive(&self, node: u8) -> bool {
        self.session.heard(|heard| {
            heard.protocols().iter().enumerate().any(|(place, protocol)| {
                heard.drives_of(place).any(|(drive, _)| protocol.shares_sdo_with(drive) == Some(node))
            })
        })
    }
}

/// The node IDs of the devices that have answered so.
fn known_nodes(devices: &[FoundDevice], answered: Answered) -> Vec<u8> {
    devices.iter().filter(|device| device.answered == answered).filter_map(|device| device.node).collect()
}

/// Adds the devices that were heard alone.
fn add_heard(heard: &Heard, devices: &mut Vec<FoundDevice>) {
    for (place, protocol) in heard.protocols().iter().enumerate() {
        for (node, _) in heard.drives_of(place) {
            let is_known = devices
                .iter()
                .any(|device| device.node == Some(node) && device.answered == Answered::Own(protocol.name()));
            if !is_known {
                devices.push(protocol.overheard(node));
            }
        }
    }
    for (node, shown) in heard.nodes() {
        let place = devices.iter().position(|device| {
            device.node == Some(node) && matches!(device.answered, Answered::Sdo | Answered::Heard(_))
        });
        match place.and_then(|place| devices.get_mut(place)) {
            Some(device) => canopen::remark_heard(device, shown),
            None => devices.extend(canopen::heard_alone(node, shown)),
        }
    }
}

/// Remarks on devices that share a node ID.
fn mark_duplicates(heard: &Heard, devices: &mut [FoundDevice]) {
    for device in devices {
        let Some(node) = device.node else { continue };
        let is_double = match device.answered {
            Answered::Sdo => heard.node(node).is_some_and(HeardNode::answers_twice),
            Answered::Own(name) => heard.protocols().iter().enumerate().any(|(place, protocol)| {
                protocol.name() == name
                    && heard.drives_of(place).any(|(drive, heard)| drive == node && heard.answers_twice())
            }),
            Answered::Heard(_) | Answered::Modbus { .. } | Answered::Lss | Answered::OfController => false,
        };
        if is_double {
            device.remark(
                "two devices answer with this node ID, and what stands here may be of either: give one of them another ID",
            );
        }
    }
}

/// That another master is active, if one is.
fn active_master(heard: &Heard) -> Option<String> {
    let frames = heard.master_frames();
    (frames > 0).then(|| format!("a master is active: {frames} of its frames were heard"))
}

/// What is odd on the bus as a whole.
fn remarks(heard: &Heard, duration_ns: Nanoseconds) -> Vec<String> {
    let mut remarks = vec![];
    let rate = heard.frames() as f64 / (duration_ns.max(1) as f64 * 1e-9);
    if rate > FLOODED_HZ {
        remarks.push(format!(
            "the bus is flooded: {rate:.0} frames/s were heard, so that answers may be missing; `takt monitor --stats` shows who sends \
             them"
        ));
    }
    let others: Vec<String> = heard.others().map(|(id, frames)| format!("{id:?} ({frames})")).collect();
    if !others.is_empty() {
        remarks.push(format!(
            "frames that belong to nothing known here, by identifier: {}; `takt monitor` shows them",
            others.join(", ")
        ));
    }
    remarks
}
