//! A node with an object dictionary. It reports violations of the standard, and a test can give it flaws.

use std::collections::{BTreeMap, BTreeSet};

use takt_rt::{Command, DriveState, Frame, Id, controlword};
use takt_wire::canopen::nmt::{ErrorControl, NmtCommand, NmtState, NmtTarget};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::sdo::{AbortCode, Expedited, SdoRequest, SdoResponse, Segment};

const INVALID: u32 = 1 << 31;

/// The flaws that a test can set.
#[derive(Default)]
pub struct Flaws {
    /// Objects whose access is aborted.
    pub refused: BTreeMap<ObjectAddress, AbortCode>,
    /// Objects whose requests get no reply.
    pub silent: BTreeSet<ObjectAddress>,
    /// Objects whose download is acknowledged but not stored.
    pub not_stored: BTreeSet<ObjectAddress>,
    /// The number of replies that are lost before the next one is sent.
    pub lost_replies: usize,
    /// The drive restarts when this object is written, this many times.
    pub restarts_at: Option<(ObjectAddress, usize)>,
    /// The drive ignores controlwords.
    pub ignores_controlwords: bool,
    /// The drive uses the vendor's own protocol only.
    pub uses_vendor_protocol: bool,
    /// The drive ignores NMT commands.
    pub ignores_nmt: bool,
}

pub struct ScriptedDrive {
    pub node: u8,
    pub nmt: NmtState,
    pub dictionary: BTreeMap<ObjectAddress, Vec<u8>>,
    pub state: DriveState,
    pub flaws: Flaws,
    /// Before this time it neither sends nor receives.
    pub powered_up_at_ns: u64,
    /// Every object that was written, with its bytes.
    pub writes: Vec<(ObjectAddress, Vec<u8>)>,
    /// The rules of the standard that the master has violated.
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
    /// An eRob with factory settings.
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

    /// Sets the communication parameters to their values after a reset.
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

    /// Returns the frames that are due at this time.
    pub fn poll(&mut self, now_ns: u64) -> Vec<Frame> {
        if !self.is_powered_up(now_ns) {
            return vec![];
        }
        if !self.has_booted {
            self.boot();
        }
        let period_ns = self.number(0x1017, 0) * 1_000_000;
        if period_ns > 0 && now_ns >= self.heartbeat_at_ns && !self.flaws.uses_vendor_protocol {
            self.heartbeat_at_ns = now_ns + period_ns;
            self.replies.push(ErrorControl { node: self.node, state: self.nmt }.frame());
        }
        std::mem::take(&mut self.replies)
    }

    /// Delays the boot-up to `at_ns`.
    pub fn power_up_at(&mut self, at_ns: u64) {
        self.powered_up_at_ns = at_ns;
        self.has_booted = false;
    }

    fn boot(&mut self) {
        self.has_booted = true;
        self.reset_communication();
        self.nmt = NmtState::PreOperational;
        if !self.flaws.uses_vendor_protocol {
            self.replies.push(ErrorControl { node: self.node, state: NmtState::BootUp }.frame());
        }
    }

    pub fn receive(&mut self, now_ns: u64, frame: &Frame) {
        if !self.is_powered_up(now_ns) {
            return;
        }
        if self.flaws.uses_vendor_protocol {
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
            self.apply_nmt(command);
        }
        match SdoRequest::decode(frame) {
            Some((node, request)) if node == self.node && self.nmt != NmtState::Stopped => {
                self.serve(request)
            }
            _ => {}
        }
    }

    fn apply_nmt(&mut self, command: NmtCommand) {
        if self.flaws.ignores_nmt {
            return;
        }
        match command {
            NmtCommand::Start => self.nmt = NmtState::Operational,
            NmtCommand::Stop => self.nmt = NmtState::Stopped,
            NmtCommand::EnterPreOperational => self.nmt = NmtState::PreOperational,
            NmtCommand::ResetNode => {
                self.state = DriveState::SwitchOnDisabled;
                self.boot();
            }
            NmtCommand::ResetCommunication => self.boot(),
        }
        self.heartbeat_at_ns = 0;
    }

    fn reply(&mut self, response: SdoResponse) {
        if self.flaws.lost_replies > 0 {
            self.flaws.lost_replies -= 1;
            return;
        }
        if self.replies.iter().any(|frame| SdoResponse::decode(frame).is_some()) {
            self.violations.push("an SDO request came before the last one was answered".into());
        }
        self.replies.push(response.frame(self.node));
    }

    fn serve(&mut self, request: SdoRequest) {
        match request {
            SdoRequest::Upload { object } => self.upload(object),
            SdoRequest::UploadSegment { toggle } => self.upload_segment(toggle),
            SdoRequest::DownloadExpedited { object, data } => self.download(object, data.bytes().to_vec()),
            other => self.violations.push(format!("not expected in a bring-up: {other:?}")),
        }
    }

    fn upload(&mut self, object: ObjectAddress) {
        if self.flaws.silent.contains(&object) {
            return;
        }
        if let Some(code) = self.flaws.refused.get(&object).copied() {
            return self.reply(SdoResponse::Abort { object, code });
        }
        self.dictionary.insert(at(0x6041, 0), self.statusword().to_le_bytes().to_vec());
        let Some(bytes) = self.dictionary.get(&object).cloned() else {
            return self.reply(SdoResponse::Abort { object, code: AbortCode::ObjectDoesNotExist });
        };
        match Expedited::of(&bytes) {
            Some(data) => self.reply(SdoResponse::UploadExpedited { object, data }),
            None => {
                let size = Some(bytes.len() as u32);
                self.upload = Some((bytes, false));
                self.reply(SdoResponse::UploadSegmented { object, size });
            }
        }
    }

    fn upload_segment(&mut self, toggle: bool) {
        let Some((bytes, expected)) = self.upload.take() else {
            return self.violations.push("a segment was requested outside a transfer".into());
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
        self.reply(SdoResponse::UploadSegment { toggle, data, is_last });
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
        if let Some(code) = refused.or_else(|| self.abort_code(object, &bytes)) {
            return self.reply(SdoResponse::Abort { object, code });
        }
        self.writes.push((object, bytes.clone()));
        self.check_mapping_rules(object, &bytes);
        if !self.flaws.not_stored.contains(&object) {
            self.store(object, bytes);
        }
        self.reply(SdoResponse::DownloadAccepted { object });
    }

    fn abort_code(&self, object: ObjectAddress, bytes: &[u8]) -> Option<AbortCode> {
        match self.dictionary.get(&object) {
            None => Some(AbortCode::ObjectDoesNotExist),
            Some(present) if present.len() != bytes.len() => Some(AbortCode::LengthMismatch),
            Some(_) => None,
        }
    }

    fn store(&mut self, object: ObjectAddress, bytes: Vec<u8>) {
        match object {
            _ if object == at(0x6060, 0) => self.set(0x6061, 0, &bytes),
            _ if object == at(0x6040, 0) && !self.flaws.ignores_controlwords => {
                let word = u16::from_le_bytes([bytes[0], bytes[1]]);
                let edge = word & controlword::FAULT_RESET != 0 && self.number(0x6040, 0) & 0x80 == 0;
                self.state = self.state.after(Command::decode(word), edge);
            }
            _ => {}
        }
        self.dictionary.insert(object, bytes);
    }

    /// Contains the bits that real units set without a meaning.
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
