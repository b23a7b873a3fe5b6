//! A node with an object dictionary, strict about what the standard forbids, and told by a test what to do wrong.

use std::collections::{BTreeMap, BTreeSet};

use takt::canopen::nmt::{ErrorControl, NmtCommand, NmtState, NmtTarget};
use takt::canopen::object::ObjectAddress;
use takt::canopen::sdo::{AbortCode, Expedited, Request, Response, Segment};
use takt_rt::{Command, DriveState, Frame, Id, controlword};

const INVALID: u32 = 1 << 31;

/// What a test wants to go wrong.
#[derive(Default)]
pub struct Flaws {
    /// Objects whose access is aborted.
    pub refused: BTreeMap<ObjectAddress, AbortCode>,
    /// Objects about which the drive says nothing.
    pub silent: BTreeSet<ObjectAddress>,
    /// Objects whose writing is acknowledged and forgotten.
    pub forgetful: BTreeSet<ObjectAddress>,
    /// How many replies are lost before the next one is sent.
    pub lost_replies: usize,
    /// The drive restarts when this object is written, so many times.
    pub restarts_at: Option<(ObjectAddress, usize)>,
    /// The drive obeys no controlword.
    pub is_stubborn: bool,
    /// The drive speaks the vendor's own protocol only.
    pub has_other_firmware: bool,
    /// The drive obeys no NMT command.
    pub is_deaf_to_nmt: bool,
}

pub struct ScriptedDrive {
    pub node: u8,
    pub nmt: NmtState,
    pub dictionary: BTreeMap<ObjectAddress, Vec<u8>>,
    pub state: DriveState,
    pub flaws: Flaws,
    /// Before this time it hears and says nothing.
    pub powered_up_at_ns: u64,
    /// Every object that was written, with its bytes.
    pub writes: Vec<(ObjectAddress, Vec<u8>)>,
    /// Statements of the standard that the master has violated.
    pub violations: Vec<String>,
    has_booted: bool,
    heartbeat_at_ns: u64,
    upload: Option<(Vec<u8>, bool)>,
    replies: Vec<Frame>,
}

pub fn at(index: u16, subindex: u8) -> ObjectAddress {
    ObjectAddress::new(index, subindex)
}

impl ScriptedDrive {
    /// An eRob as it is delivered.
    pub fn erob(node: u8) -> Self {
        let mut drive = Self {
            node,
            nmt: NmtState::PreOperational,
            dictionary: BTreeMap::new(),
            state: DriveState::SwitchOnDisabled,
            flaws: Flaws::default(),
            powered_up_at_ns: 0,
            writes: vec![],
            violations: vec![],
            has_booted: true,
            heartbeat_at_ns: 0,
            upload: None,
            replies: vec![],
        };
        drive.reset_communication();
        for (index, subindex, bytes) in [
            (0x1000, 0, 0x0042_0192_u32.to_le_bytes().to_vec()),
            (0x1008, 0, b"eRob80H120I-BM-18CN".to_vec()),
            (0x1018, 1, 0x5A65_726F_u32.to_le_bytes().to_vec()),
            (0x1018, 2, 0x2648_3052_u32.to_le_bytes().to_vec()),
            (0x1018, 3, 0x0002_0111_u32.to_le_bytes().to_vec()),
            (0x6040, 0, vec![0, 0]),
            (0x6041, 0, vec![0, 0]),
            (0x603F, 0, vec![0, 0]),
            (0x6060, 0, vec![0]),
            (0x6061, 0, vec![0]),
            (0x6064, 0, (-123_456_i32).to_le_bytes().to_vec()),
            (0x6065, 0, vec![0; 4]),
            (0x606C, 0, vec![0; 4]),
            (0x6071, 0, vec![9, 0]),
            (0x6075, 0, 6_300_u32.to_le_bytes().to_vec()),
            (0x6076, 0, 31_000_u32.to_le_bytes().to_vec()),
            (0x607A, 0, vec![0; 4]),
            (0x6081, 0, 10_000_u32.to_le_bytes().to_vec()),
            (0x6083, 0, 200_u32.to_le_bytes().to_vec()),
            (0x6084, 0, 200_u32.to_le_bytes().to_vec()),
            (0x6085, 0, 200_u32.to_le_bytes().to_vec()),
            (0x60B0, 0, vec![1; 4]),
            (0x60B1, 0, vec![1; 4]),
            (0x60B2, 0, vec![1; 2]),
            (0x60C2, 1, vec![0]),
            (0x60C2, 2, vec![0]),
            (0x60FF, 0, vec![7; 4]),
            (0x6502, 0, 909_u32.to_le_bytes().to_vec()),
        ] {
            drive.dictionary.insert(at(index, subindex), bytes);
        }
        drive
    }

    /// The communication parameters as they are after a reset.
    fn reset_communication(&mut self) {
        self.upload = None;
        for (index, subindex, bytes) in [
            (0x1005, 0, 0x80_u32.to_le_bytes().to_vec()),
            (0x1006, 0, vec![0; 4]),
            (0x1016, 1, vec![0; 4]),
            (0x1017, 0, vec![0; 2]),
            (0x1029, 1, vec![0]),
        ] {
            self.dictionary.insert(at(index, subindex), bytes);
        }
        for number in 0..4u16 {
            let off = if number == 0 { 0 } else { INVALID };
            for (communication, mapping, first) in [(0x1400, 0x1600, 0x200_u32), (0x1800, 0x1A00, 0x180)] {
                let cob_id = off | (first + 0x100 * u32::from(number) + u32::from(self.node));
                self.dictionary.insert(at(communication + number, 1), cob_id.to_le_bytes().to_vec());
                self.dictionary.insert(at(communication + number, 2), vec![255]);
                self.dictionary.insert(at(communication + number, 3), vec![0; 2]);
                self.dictionary.insert(at(communication + number, 5), vec![100, 0]);
                self.dictionary.insert(at(mapping + number, 0), vec![1]);
                for position in 1..=8 {
                    self.dictionary.insert(at(mapping + number, position), vec![0; 4]);
                }
            }
        }
    }

    pub fn set(&mut self, index: u16, subindex: u8, bytes: &[u8]) {
        self.dictionary.insert(at(index, subindex), bytes.to_vec());
    }

    pub fn number(&self, index: u16, subindex: u8) -> u64 {
        self.dictionary[&at(index, subindex)]
            .iter()
            .rev()
            .fold(0, |value, byte| value << 8 | u64::from(*byte))
    }

    fn is_powered_up(&self, now_ns: u64) -> bool {
        now_ns >= self.powered_up_at_ns
    }

    /// What it sends at this time.
    pub fn poll(&mut self, now_ns: u64) -> Vec<Frame> {
        if !self.is_powered_up(now_ns) {
            return vec![];
        }
        if !self.has_booted {
            self.boot();
        }
        let period_ns = self.number(0x1017, 0) * 1_000_000;
        if period_ns > 0 && now_ns >= self.heartbeat_at_ns && !self.flaws.has_other_firmware {
            self.heartbeat_at_ns = now_ns + period_ns;
            self.replies.push(ErrorControl { node: self.node, state: self.nmt }.frame());
        }
        std::mem::take(&mut self.replies)
    }

    /// Lets it power up only at `at_ns`.
    pub fn power_up_at(&mut self, at_ns: u64) {
        self.powered_up_at_ns = at_ns;
        self.has_booted = false;
    }

    fn boot(&mut self) {
        self.has_booted = true;
        self.reset_communication();
        self.nmt = NmtState::PreOperational;
        if !self.flaws.has_other_firmware {
            self.replies.push(ErrorControl { node: self.node, state: NmtState::BootUp }.frame());
        }
    }

    pub fn receive(&mut self, now_ns: u64, frame: &Frame) {
        if !self.is_powered_up(now_ns) {
            return;
        }
        if self.flaws.has_other_firmware {
            if frame.id().value() == 0x640 + u32::from(self.node) && frame.payload() == [0x00, 0x02] {
                let id = Id::base(0x5C0 + u32::from(self.node)).unwrap();
                self.replies.push(Frame::of(id, [0, 0, 0, 1, 0x3E]));
            }
            return;
        }
        if let Some((command, target)) = NmtCommand::decode(frame)
            && matches!(target, NmtTarget::All | NmtTarget::Node(_))
            && (target == NmtTarget::All || target == NmtTarget::Node(self.node))
        {
            self.obey(command);
        }
        match Request::decode(frame) {
            Some((node, request)) if node == self.node && self.nmt != NmtState::Stopped => {
                self.serve(request)
            }
            _ => {}
        }
    }

    fn obey(&mut self, command: NmtCommand) {
        if self.flaws.is_deaf_to_nmt {
            return;
        }
        match command {
            NmtCommand::Start => self.nmt = NmtState::Operational,
            NmtCommand::Stop => self.nmt = NmtState::Stopped,
            NmtCommand::EnterPreOperational => self.nmt = NmtState::PreOperational,
            NmtCommand::ResetNode | NmtCommand::ResetCommunication => self.boot(),
        }
        self.heartbeat_at_ns = 0;
    }

    fn reply(&mut self, response: Response) {
        if self.flaws.lost_replies > 0 {
            self.flaws.lost_replies -= 1;
            return;
        }
        if self.replies.iter().any(|frame| Response::decode(frame).is_some()) {
            self.violations.push("an SDO request came before the last one was answered".into());
        }
        self.replies.push(response.frame(self.node));
    }

    fn serve(&mut self, request: Request) {
        match request {
            Request::Upload { object } => self.upload(object),
            Request::UploadSegment { toggle } => self.upload_segment(toggle),
            Request::DownloadExpedited { object, data } => self.download(object, data.bytes().to_vec()),
            other => self.violations.push(format!("not expected in a bring-up: {other:?}")),
        }
    }

    fn upload(&mut self, object: ObjectAddress) {
        if self.flaws.silent.contains(&object) {
            return;
        }
        if let Some(code) = self.flaws.refused.get(&object).copied() {
            return self.reply(Response::Abort { object, code });
        }
        self.dictionary.insert(at(0x6041, 0), self.statusword().to_le_bytes().to_vec());
        let Some(bytes) = self.dictionary.get(&object).cloned() else {
            return self.reply(Response::Abort { object, code: AbortCode::ObjectDoesNotExist });
        };
        match Expedited::of(&bytes) {
            Some(data) => self.reply(Response::UploadExpedited { object, data }),
            None => {
                let size = Some(bytes.len() as u32);
                self.upload = Some((bytes, false));
                self.reply(Response::UploadSegmented { object, size });
            }
        }
    }

    fn upload_segment(&mut self, toggle: bool) {
        let Some((bytes, expected)) = self.upload.take() else {
            return self.violations.push("a segment was asked for outside a transfer".into());
        };
        if toggle != expected {
            self.violations.push("the toggle bit did not alternate".into());
        }
        let data = Segment::first_of(&bytes);
        let rest = bytes[data.bytes().len()..].to_vec();
        let is_last = rest.is_empty();
        if !is_last {
            self.upload = Some((rest, !expected));
        }
        self.reply(Response::UploadSegment { toggle, data, is_last });
    }

    fn download(&mut self, object: ObjectAddress, bytes: Vec<u8>) {
        if let Some((restarts_at, times)) = self.flaws.restarts_at
            && restarts_at == object
            && times > 0
        {
            self.flaws.restarts_at = Some((object, times - 1));
            return self.boot();
        }
        if self.flaws.silent.contains(&object) {
            return;
        }
        let refused = self.flaws.refused.get(&object).copied();
        if let Some(code) = refused.or_else(|| self.objection(object, &bytes)) {
            return self.reply(Response::Abort { object, code });
        }
        self.writes.push((object, bytes.clone()));
        self.check_mapping_rules(object, &bytes);
        if !self.flaws.forgetful.contains(&object) {
            self.take(object, bytes);
        }
        self.reply(Response::DownloadAccepted { object });
    }

    fn objection(&self, object: ObjectAddress, bytes: &[u8]) -> Option<AbortCode> {
        match self.dictionary.get(&object) {
            None => Some(AbortCode::ObjectDoesNotExist),
            Some(present) if present.len() != bytes.len() => Some(AbortCode::LengthMismatch),
            Some(_) => None,
        }
    }

    fn take(&mut self, object: ObjectAddress, bytes: Vec<u8>) {
        match object {
            _ if object == at(0x6060, 0) => self.set(0x6061, 0, &bytes),
            _ if object == at(0x6040, 0) && !self.flaws.is_stubborn => {
                let word = u16::from_le_bytes([bytes[0], bytes[1]]);
                let edge = word & controlword::FAULT_RESET != 0 && self.number(0x6040, 0) & 0x80 == 0;
                self.state = self.state.after(Command::decode(word), edge);
            }
            _ => {}
        }
        self.dictionary.insert(object, bytes);
    }

    /// With the bits that real units set without meaning anything by them.
    fn statusword(&self) -> u16 {
        0x1280 | self.state.statusword_bits()
    }

    fn check_mapping_rules(&mut self, object: ObjectAddress, bytes: &[u8]) {
        let (communication, is_mapping) = match object.index {
            0x1400..=0x1403 | 0x1800..=0x1803 => (object.index, false),
            0x1600..=0x1603 | 0x1A00..=0x1A03 => (object.index - 0x200, true),
            _ => return,
        };
        let is_valid = self.number(communication, 1) & u64::from(INVALID) == 0;
        if is_valid && (is_mapping || object.subindex != 1) {
            self.violations.push(format!("{object} was written while the PDO was valid"));
        }
        if is_mapping && object.subindex > 0 && self.number(object.index, 0) != 0 {
            self.violations.push(format!("{object} was written while the count was not zero"));
        }
        if !is_mapping && object.subindex == 1 && is_valid && bytes[3] & 0x80 == 0 {
            self.violations.push(format!("{object} was changed while the PDO was valid"));
        }
    }
}
