//! The scan of a CAN bus.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use takt_rt::{BusState, Frame, Id, Nanoseconds};
use takt_wire::canopen::objects::DEVICE_TYPE;
use takt_wire::canopen::sdo::SdoRequest;

use super::Scanned;
use super::canopen;
use super::conclusion;
use super::device::{Answered, FoundDevice};
use super::heard::{Heard, HeardDrive, HeardNode};
use super::own_protocol::OwnProtocol;
use super::session::{ScanClient, ScanSession};
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
/// Before anything is asked. Drives that send heartbeats of their own do so several times in this time: some of them would take a question
/// for a command.
const LISTENING_FIRST_NS: Nanoseconds = 250_000_000;

/// What is asked on a CAN bus.
#[derive(Clone, Debug)]
pub struct BusScan {
    /// The node IDs that are asked. Devices that are only heard are found beyond them, too.
    pub nodes: RangeInclusive<u8>,
    /// How long an answer is awaited.
    pub wait_ns: Nanoseconds,
    /// How long to listen, at the least. A heartbeat usually comes once a second.
    pub listening_ns: Nanoseconds,
    /// True if nothing is sent at all.
    pub only_listens: bool,
    /// True if drives may be asked that lose their torque by the question.
    pub may_take_torque: bool,
    /// True if the bus carries CAN FD frames.
    pub has_fd: bool,
    /// The node IDs of the running controller that sends the questions, if one does: its drives are not asked.
    pub of_controller: Option<Vec<u8>>,
}

/// The procedure of a scan. It never fails: interrupted, it ends with what it has found so far.
pub fn scan_bus(scan: BusScan) -> Procedure<ScanClient, Scanned, Failure> {
    let session = ScanSession::new(ScanClient::new());
    let work = Scan { session: session.clone(), scan, done: 0, of: 0, left_out: BTreeMap::new() };
    Procedure::new(session, async move { Ok(work.carry_out().await) })
}

struct Scan {
    session: ScanSession,
    scan: BusScan,
    /// Questions that were asked, and all of them.
    done: u32,
    of: u32,
    /// What is to be said of each protocol in which not everybody was asked, because of other drives.
    left_out: BTreeMap<&'static str, String>,
}

impl Scan {
    async fn carry_out(mut self) -> Scanned {
        let mut devices = vec![];
        let protocols = self.session.heard(|heard| heard.protocols().to_vec());
        let asked: Vec<(usize, &'static dyn OwnProtocol)> =
            protocols.into_iter().enumerate().filter(|(_, protocol)| self.may_ask(*protocol)).collect();
        if !self.scan.only_listens {
            self.session.step("listen");
            self.session.pause(LISTENING_FIRST_NS).await;
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
            conclusion::add_heard(heard, &mut devices);
            conclusion::mark_duplicates(heard, &mut devices);
            devices.sort_by_key(|device| (device.node.is_none(), device.node));
            let mut remarks = conclusion::remarks(heard, self.session.now_ns());
            // That its own controller is active is no news.
            let is_news = self.scan.of_controller.is_none();
            remarks.extend(is_news.then(|| conclusion::active_master(heard)).flatten());
            remarks.extend(self.left_out.into_values());
            Scanned { devices, remarks, is_interrupted, bus_state: BusState::default() }
        })
    }

    /// Whose question may disturb another drive is asked last: the longer one listens, the more is known of the others.
    async fn ask_round(
        &mut self,
        asked: &[(usize, &'static dyn OwnProtocol)],
        devices: &mut Vec<FoundDevice>,
    ) {
        let (first, last): (Vec<_>, Vec<_>) =
            asked.iter().partition(|(_, protocol)| self.disturbs_nobody(*protocol));
        for (place, protocol) in first {
            self.ask_in(place, protocol, devices).await;
        }
        self.ask_canopen(devices).await;
        for (place, protocol) in last {
            self.ask_in(place, protocol, devices).await;
        }
    }

    /// Returns `true` if the question of a protocol is no command to any drive, whoever is on the bus.
    fn disturbs_nobody(&self, protocol: &dyn OwnProtocol) -> bool {
        let Some(question) = protocol.question(1) else { return true };
        let harms = |other: &&'static dyn OwnProtocol| other.is_harmed_by(question.id());
        protocol.consequence().is_none() && !self.session.heard(|heard| heard.protocols().iter().any(harms))
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

    /// Returns `true` if the question of a protocol may be asked on this bus.
    fn may_ask(&self, protocol: &dyn OwnProtocol) -> bool {
        let is_allowed = self.scan.may_take_torque || protocol.consequence().is_none();
        let may_be_sent = |question: Frame| self.scan.has_fd || !question.is_fd();
        is_allowed && protocol.question(1).is_some_and(may_be_sent)
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
            let Some(question) = protocol.question(node) else { break };
            let twin = protocol.shares_sdo_with(node);
            // It has shown that it is a CANopen node: the question would reach its SDO server.
            let is_of_node = |heard: &Heard, twin| heard.node(twin).is_some_and(HeardNode::is_there);
            let is_taken = twin.is_some_and(|twin| self.session.heard(|heard| is_of_node(heard, twin)));
            if !is_taken && !known.contains(&node) && self.reaches_nobody_else(place, protocol, question.id())
            {
                self.session.count_request(|heard| {
                    heard.own_request(place, node);
                    // Should it be there and quiet so far, its SDO server may reply to this.
                    twin.into_iter().for_each(|twin| heard.sdo_request(twin));
                });
                self.session.send_frame(question);
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

    /// Returns `true` if a question is one to nobody but the drives of its protocol.
    fn reaches_nobody_else(&mut self, place: usize, protocol: &dyn OwnProtocol, id: Id) -> bool {
        !self.would_be_taken(protocol.name(), id)
            && !self.session.heard(|heard| heard.is_command_to_other(place, id))
    }

    /// Returns `true` if a drive that is heard would take a question for a command. The first one of each protocol that is left out so is
    /// remembered.
    fn would_be_taken(&mut self, asker: &'static str, id: Id) -> bool {
        let Some(other) = self.session.heard(|heard| heard.would_take(id)) else { return false };
        self.left_out.entry(asker).or_insert_with(|| {
            format!(
                "not every node was asked by {asker}: a drive is heard that speaks {}, and the question (identifier {id:?}) could be a \
                 command to it",
                other.name()
            )
        });
        true
    }

    /// Asks every node that has not answered yet for its device type (1000), and reads what those tell that answer.
    async fn ask_canopen(&mut self, devices: &mut Vec<FoundDevice>) {
        self.session.step(canopen::PROTOCOL);
        let known = known_nodes(devices, Answered::Sdo);
        for node in self.canopen_nodes() {
            if self.session.is_interrupted() {
                break;
            }
            let question = SdoRequest::Upload { object: DEVICE_TYPE.address }.frame(node);
            // A request to such a node would be one to the drive that has answered in its own protocol, or is heard.
            if !known.contains(&node)
                && !self.is_own_drive(node)
                && !self.would_be_taken(canopen::PROTOCOL, question.id())
            {
                self.session.count_request(|heard| heard.sdo_request(node));
                self.session.send_frame(question);
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

    /// Returns `true` if the SDO identifiers of a node are those of a drive that has answered in its own protocol.
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
