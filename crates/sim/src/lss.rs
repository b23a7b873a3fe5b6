//! A simulated device with LSS (CiA 305) for node ID and bit rate, and no other service.

use std::collections::VecDeque;

use takt_rt::{BusHealth, BusPort, Frame, Nanoseconds, ReceiveBatch, Received};
use takt_wire::canopen::lss::{BitTiming, Inquiry, LssAddress, LssMode, LssRequest, LssResponse, LssResult};
use takt_wire::canopen::nmt::{ErrorControl, NmtState};

/// The node ID of an unconfigured device.
const NO_NODE: u8 = 0xFF;
/// The value of `lowest_bit` that begins an LSS fastscan.
const SCAN_BEGINS: u8 = 0x80;

/// The settings of the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Settings {
    node: Option<u8>,
    bit_timing: BitTiming,
}

/// How a device treats requests for which CiA 305 leaves room.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LssStack {
    /// A device in configuration state ignores fastscan requests.
    #[default]
    Standard,
    /// As CANopenNode 4: a device in configuration state replies to every fastscan request, whatever identity it asks
    /// for. The two identify services are missing.
    CanOpenNode,
}

/// A simulated LSS device.
#[derive(Clone, Copy, Debug)]
pub struct LssDevice {
    address: LssAddress,
    mode: LssMode,
    /// The settings in use.
    active: Settings,
    /// The settings that were configured but are not in use yet.
    pending: Settings,
    /// The settings that were stored for the next power-up.
    stored: Settings,
    /// Number of matching values of a selection, and of an identification, in their order so far.
    selected: u8,
    identified: u8,
    /// The identity part that the fastscan checks next.
    scan_part: u8,
    /// True if it supports the store service.
    pub can_store: bool,
    /// Its treatment of fastscan requests.
    pub stack: LssStack,
    /// True if it boots when it has got a node ID, as CiA 305 demands.
    pub boots: bool,
}

impl LssDevice {
    /// A device with this identity and a stored node ID.
    pub fn new(address: LssAddress, node: Option<u8>) -> Self {
        let settings = Settings { node, bit_timing: BitTiming::Kilobits1000 };
        Self {
            address,
            mode: LssMode::Waiting,
            active: settings,
            pending: settings,
            stored: settings,
            selected: 0,
            identified: 0,
            scan_part: 0,
            can_store: true,
            stack: LssStack::Standard,
            boots: true,
        }
    }

    /// Its node ID; `None` while it is unconfigured.
    pub fn node(&self) -> Option<u8> {
        self.active.node
    }

    /// The bit rate in use.
    pub fn bit_timing(&self) -> BitTiming {
        self.active.bit_timing
    }

    /// Its LSS state.
    pub fn mode(&self) -> LssMode {
        self.mode
    }

    /// Cuts and restores the supply: the stored settings take effect, and the device boots if it has a node ID.
    pub fn power_cycle(&mut self) -> Option<Frame> {
        let Self { can_store, stack, boots, .. } = *self;
        *self = Self { can_store, stack, boots, ..Self::new(self.address, None).with(self.stored) };
        self.boot_up()
    }

    fn with(self, settings: Settings) -> Self {
        Self { active: settings, pending: settings, stored: settings, ..self }
    }

    /// Receives a frame of the master and returns the response.
    pub fn receive(&mut self, frame: &Frame) -> Option<Frame> {
        let request = LssRequest::decode(frame)?;
        let is_canopen_node = self.stack == LssStack::CanOpenNode;
        let answer = match request {
            LssRequest::SwitchGlobal(mode) => return self.switch(mode),
            LssRequest::SwitchSelective { part, value } => self.select(part, value)?,
            LssRequest::IdentifyRemote { .. } | LssRequest::IdentifyUnconfigured if is_canopen_node => {
                return None;
            }
            LssRequest::FastScan { .. } if is_canopen_node && self.mode == LssMode::Configuration => {
                LssResponse::Identified
            }
            LssRequest::IdentifyRemote { part, value } => self.identify(part, value)?,
            LssRequest::IdentifyUnconfigured if self.active.node.is_none() => {
                LssResponse::IdentifiedUnconfigured
            }
            LssRequest::FastScan { value, lowest_bit, part, next } => {
                self.scan(value, lowest_bit, part, next)?
            }
            LssRequest::IdentifyUnconfigured => return None,
            _ if self.mode == LssMode::Waiting => return None,
            LssRequest::ConfigureNode(node) => LssResponse::NodeConfigured(self.configure_node(node)),
            LssRequest::ConfigureBitTiming(BitTiming::Automatic) => {
                LssResponse::BitTimingConfigured(LssResult::REFUSED)
            }
            LssRequest::ConfigureBitTiming(timing) => {
                self.pending.bit_timing = timing;
                LssResponse::BitTimingConfigured(LssResult::OK)
            }
            LssRequest::ActivateBitTiming { .. } => {
                self.active.bit_timing = self.pending.bit_timing;
                return None;
            }
            LssRequest::Store if self.can_store => {
                self.stored = self.pending;
                LssResponse::Stored(LssResult::OK)
            }
            LssRequest::Store => LssResponse::Stored(LssResult::REFUSED),
            LssRequest::Inquire(inquiry) => LssResponse::Inquired(inquiry, self.identity_part(inquiry)),
        };
        Some(answer.frame())
    }

    fn identity_part(&self, inquiry: Inquiry) -> u32 {
        match inquiry {
            Inquiry::Vendor => self.address.vendor,
            Inquiry::Product => self.address.product,
            Inquiry::Revision => self.address.revision,
            Inquiry::Serial => self.address.serial,
            Inquiry::Node => self.active.node.unwrap_or(NO_NODE).into(),
        }
    }

    /// Changes the LSS state. An unconfigured device that got a node ID boots when it leaves configuration state.
    fn switch(&mut self, mode: LssMode) -> Option<Frame> {
        self.mode = mode;
        self.selected = 0;
        if mode == LssMode::Configuration || self.active.node.is_some() {
            return None;
        }
        self.active.node = self.pending.node;
        self.boots.then(|| self.boot_up()).flatten()
    }

    fn boot_up(&self) -> Option<Frame> {
        Some(ErrorControl { node: self.active.node?, state: NmtState::BootUp }.frame())
    }

    fn select(&mut self, part: u8, value: u32) -> Option<LssResponse> {
        let is_right =
            self.mode == LssMode::Waiting && self.address.values().get(usize::from(part)) == Some(&value);
        self.selected = match part {
            0 if is_right => 1,
            part if is_right && part == self.selected => self.selected + 1,
            _ => 0,
        };
        if self.selected < 4 {
            return None;
        }
        self.selected = 0;
        self.mode = LssMode::Configuration;
        Some(LssResponse::Switched)
    }

    fn identify(&mut self, part: u8, value: u32) -> Option<LssResponse> {
        let LssAddress { vendor, product, revision, serial } = self.address;
        let is_right = match part {
            0 => vendor == value,
            1 => product == value,
            2 => revision >= value,
            3 => revision <= value,
            4 => serial >= value,
            _ => serial <= value,
        };
        self.identified = match part {
            0 if is_right => 1,
            part if is_right && part == self.identified => self.identified + 1,
            _ => 0,
        };
        (self.identified == 6).then_some(LssResponse::Identified)
    }

    fn scan(&mut self, value: u32, lowest_bit: u8, part: u8, next: u8) -> Option<LssResponse> {
        if self.active.node.is_some() || self.pending.node.is_some() || self.mode == LssMode::Configuration {
            return None;
        }
        if lowest_bit == SCAN_BEGINS {
            self.scan_part = 0;
            return Some(LssResponse::Identified);
        }
        let own = self.address.values().get(usize::from(part)).copied()?;
        let counted = u32::MAX.checked_shl(lowest_bit.into())?;
        if part != self.scan_part || (own ^ value) & counted != 0 {
            return None;
        }
        if lowest_bit == 0 {
            self.scan_part = next;
            if next < part {
                self.mode = LssMode::Configuration;
            }
        }
        Some(LssResponse::Identified)
    }

    fn configure_node(&mut self, node: u8) -> LssResult {
        self.pending.node = match node {
            1..=127 => Some(node),
            NO_NODE => None,
            _ => return LssResult::REFUSED,
        };
        LssResult::OK
    }
}

/// A bus with only LSS devices, which answer at once.
#[derive(Debug, Default)]
pub struct LssBus {
    devices: Vec<LssDevice>,
    answers: VecDeque<Received>,
    health: BusHealth,
}

impl LssBus {
    /// A bus with these devices.
    pub fn new(devices: impl IntoIterator<Item = LssDevice>) -> Self {
        Self { devices: devices.into_iter().collect(), ..Self::default() }
    }

    /// The devices.
    pub fn devices(&self) -> &[LssDevice] {
        &self.devices
    }
}

impl BusPort for LssBus {
    fn send(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        for frame in frames {
            let answers = self.devices.iter_mut().filter_map(|device| device.receive(frame));
            self.answers.extend(answers.map(|frame| Received { frame, at_ns: now_ns }));
        }
        self.health.tx_frames += frames.len() as u64;
        frames.len()
    }

    fn receive(&mut self, _now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        while let Some(answer) = self.answers.pop_front() {
            if batch.try_push(answer).is_err() {
                self.answers.push_front(answer);
                return;
            }
            self.health.rx_frames += 1;
        }
    }

    fn unconfirmed(&mut self, _now_ns: Nanoseconds) -> usize {
        0
    }

    fn health(&mut self) -> BusHealth {
        self.health
    }
}
