//! The kinds of fault and their keys.

use takt_rt::{Frame, Id, Nanoseconds};
use takt_wire::canopen::nmt::{NmtCommand, NmtTarget};

use super::common::{self, Location};
use crate::config::bounds::Bounds;
use crate::config::read::entry::Entry;
use crate::config::read::section::Section;
use crate::config::{Axis, Config, Quantity, Travel};
use crate::family;
use crate::faults::effect::{DelayPlace, Effect, ForeignFrames, FrameEffect, InterfaceEffect, Part};
use crate::faults::injectable::{DriveEffect, InjectError, Injectable, inject_on_line};
use crate::faults::selection::Selection;
use crate::faults::window::Window;
use takt_sim::{Defect, Disobedience, DriveFault, SimulatedLineDevices};

/// A kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    Drop,
    Delay,
    Duplicate,
    Corrupt,
    Reorder,
    EchoLoss,
    FullQueue,
    BusOff,
    ErrorPassive,
    InterfaceDown,
    ForeignSync,
    ForeignSetPoints,
    ForeignNmt,
    ForeignFrame,
    DuplicateNode,
    Flood,
    Drive(DriveFaultKind),
}

/// A kind of fault of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveFaultKind {
    Stall,
    StuckBrake,
    Load,
    EncoderJump,
    SilentNode,
    Reboot,
    StuckSdo,
    WrongMapping,
    Statusword,
    ModeDisplay,
    TorqueOff,
    Disobedience,
    Alarm,
    Emergency,
    Cause(DriveFault),
}

/// All kinds, by their names in the file.
pub const KINDS: [(&str, FaultKind); 36] = [
    ("drop", FaultKind::Drop),
    ("delay", FaultKind::Delay),
    ("duplicate", FaultKind::Duplicate),
    ("corrupt", FaultKind::Corrupt),
    ("reorder", FaultKind::Reorder),
    ("echo-loss", FaultKind::EchoLoss),
    ("full-queue", FaultKind::FullQueue),
    ("bus-off", FaultKind::BusOff),
    ("error-passive", FaultKind::ErrorPassive),
    ("interface-down", FaultKind::InterfaceDown),
    ("foreign-sync", FaultKind::ForeignSync),
    ("foreign-set-points", FaultKind::ForeignSetPoints),
    ("foreign-nmt", FaultKind::ForeignNmt),
    ("foreign-frame", FaultKind::ForeignFrame),
    ("duplicate-node", FaultKind::DuplicateNode),
    ("flood", FaultKind::Flood),
    ("stall", FaultKind::Drive(DriveFaultKind::Stall)),
    ("stuck-brake", FaultKind::Drive(DriveFaultKind::StuckBrake)),
    ("load", FaultKind::Drive(DriveFaultKind::Load)),
    ("encoder-jump", FaultKind::Drive(DriveFaultKind::EncoderJump)),
    ("silent-node", FaultKind::Drive(DriveFaultKind::SilentNode)),
    ("reboot", FaultKind::Drive(DriveFaultKind::Reboot)),
    ("stuck-sdo", FaultKind::Drive(DriveFaultKind::StuckSdo)),
    ("wrong-mapping", FaultKind::Drive(DriveFaultKind::WrongMapping)),
    ("statusword", FaultKind::Drive(DriveFaultKind::Statusword)),
    ("mode-display", FaultKind::Drive(DriveFaultKind::ModeDisplay)),
    ("torque-off", FaultKind::Drive(DriveFaultKind::TorqueOff)),
    ("disobedience", FaultKind::Drive(DriveFaultKind::Disobedience)),
    ("alarm", FaultKind::Drive(DriveFaultKind::Alarm)),
    ("emergency", FaultKind::Drive(DriveFaultKind::Emergency)),
    ("over-current", FaultKind::Drive(DriveFaultKind::Cause(DriveFault::OverCurrent))),
    ("over-voltage", FaultKind::Drive(DriveFaultKind::Cause(DriveFault::OverVoltage))),
    ("under-voltage", FaultKind::Drive(DriveFaultKind::Cause(DriveFault::UnderVoltage))),
    ("over-temperature", FaultKind::Drive(DriveFaultKind::Cause(DriveFault::OverTemperature))),
    ("encoder-failure", FaultKind::Drive(DriveFaultKind::Cause(DriveFault::Encoder))),
    ("battery", FaultKind::Drive(DriveFaultKind::Cause(DriveFault::MultiTurnBattery))),
];

impl FaultKind {
    /// The name in the file.
    pub fn name(self) -> &'static str {
        KINDS.iter().find(|(_, other)| *other == self).map_or("", |(name, _)| *name)
    }

    /// Returns `true` if it concerns an axis and not a bus.
    pub fn needs_axis(self) -> bool {
        matches!(self, Self::Drive(_) | Self::ForeignSetPoints | Self::DuplicateNode)
    }
}

/// The content of a fault: window, selection and effect.
pub type Read = (Window, Selection, Effect);

/// Reads the keys of a kind of fault.
pub fn read(
    section: &mut Section<'_>,
    kind: FaultKind,
    location: &Location<'_, '_>,
    config: &Config,
) -> Option<Read> {
    match kind {
        FaultKind::Drop => frames(section, location, config, |_| Some(FrameEffect::Drop)),
        FaultKind::Delay => frames(section, location, config, |section| {
            let by_ns = delay(section, config);
            let places = [("machine", DelayPlace::Machine), ("bus", DelayPlace::Bus)];
            let place = section.get("where").map_or(Some(DelayPlace::Machine), |entry| entry.choice(&places));
            Some(FrameEffect::Delay { by_ns: by_ns?, place: place? })
        }),
        FaultKind::Duplicate => frames(section, location, config, |section| {
            let copies = section.get("copies").map_or(Some(1), |entry| entry.integer(1..9))?;
            Some(FrameEffect::Duplicate { copies: u8::try_from(copies).ok()? })
        }),
        FaultKind::Corrupt => frames(section, location, config, |section| {
            let (bits, part) = corruption(section)?;
            Some(FrameEffect::Corrupt { bits, part })
        }),
        FaultKind::Reorder => frames(section, location, config, |_| Some(FrameEffect::Reorder)),
        FaultKind::EchoLoss => sent_frames(section, location, config, FrameEffect::EchoLoss),
        FaultKind::FullQueue => sent_frames(section, location, config, FrameEffect::FullQueue),
        FaultKind::BusOff => interface(section, config, "restart", InterfaceEffect::BusOff),
        FaultKind::ErrorPassive => interface(section, config, "for", InterfaceEffect::ErrorPassive),
        FaultKind::InterfaceDown => interface(section, config, "for", InterfaceEffect::Down),
        FaultKind::ForeignSync
        | FaultKind::ForeignSetPoints
        | FaultKind::ForeignNmt
        | FaultKind::ForeignFrame
        | FaultKind::DuplicateNode
        | FaultKind::Flood => {
            let window = common::window(section, "for", config);
            let frames = foreign(section, kind, location, config);
            Some((window?, Selection::default(), Effect::Foreign(frames?)))
        }
        FaultKind::Drive(effect) => drive(section, effect, location, config),
    }
}

/// Reads how much later something comes.
pub fn delay(section: &mut Section<'_>, config: &Config) -> Option<Nanoseconds> {
    let entry = section.require("by", "how much later they come: by = \"300 us\"")?;
    common::duration(&entry, config)
}

/// Reads how many bits are inverted, and where.
pub fn corruption(section: &mut Section<'_>) -> Option<(u8, Part)> {
    let parts = [("payload", Part::Payload), ("identifier", Part::Identifier)];
    let part = section.get("part").map_or(Some(Part::Payload), |entry| entry.choice(&parts));
    let bits = section.get("bits").map_or(Some(1), |entry| entry.integer(1..65));
    Some((u8::try_from(bits?).ok()?, part?))
}

fn frames<'a>(
    section: &mut Section<'a>,
    location: &Location<'_, '_>,
    config: &Config,
    effect: impl FnOnce(&mut Section<'a>) -> Option<FrameEffect>,
) -> Option<Read> {
    let window = common::window(section, "for", config);
    let selection = common::selection(section, location, false);
    let effect = effect(section);
    Some((window?, selection?, Effect::Frames(effect?)))
}

fn sent_frames(
    section: &mut Section<'_>,
    location: &Location<'_, '_>,
    config: &Config,
    effect: FrameEffect,
) -> Option<Read> {
    let window = common::window(section, "for", config);
    let selection = common::selection(section, location, true);
    Some((window?, selection?, Effect::Frames(effect)))
}

fn interface(
    section: &mut Section<'_>,
    config: &Config,
    length: &'static str,
    effect: InterfaceEffect,
) -> Option<Read> {
    let window = common::window(section, length, config)?;
    Some((window, Selection::default(), Effect::Interface(effect)))
}

/// A usual heartbeat period.
const HEARTBEAT_NS: u64 = 100_000_000;
/// Shorter than a frame of eight bytes at 1 Mbit/s: the bus is never free for other frames.
const FLOOD_NS: u64 = 100_000;

fn foreign(
    section: &mut Section<'_>,
    kind: FaultKind,
    location: &Location<'_, '_>,
    config: &Config,
) -> Option<ForeignFrames> {
    let every = |frame, period_ns| ForeignFrames::Frame { frame, period_ns: Some(period_ns) };
    match kind {
        FaultKind::ForeignSync => {
            let period_ns = common::period(section, config.cycle.period_ns, config)?;
            Some(every(Frame::of(Id::canopen(0x080, 0), []), period_ns))
        }
        FaultKind::ForeignSetPoints => {
            let period_ns = common::period(section, config.cycle.period_ns, config)?;
            Some(ForeignFrames::SetPoints { id: Id::canopen(0x200, location.axis?.node), period_ns })
        }
        FaultKind::DuplicateNode => {
            let period_ns = common::period(section, HEARTBEAT_NS, config)?;
            Some(ForeignFrames::DuplicateNode { node: location.axis?.node, period_ns })
        }
        FaultKind::ForeignNmt => {
            let commands = [
                ("start", NmtCommand::Start),
                ("stop", NmtCommand::Stop),
                ("pre-operational", NmtCommand::EnterPreOperational),
                ("reset-node", NmtCommand::ResetNode),
                ("reset-communication", NmtCommand::ResetCommunication),
            ];
            let command = section
                .require("command", "what it commands: command = \"stop\"")
                .and_then(|entry| entry.choice(&commands));
            let target = location.axis.map_or(NmtTarget::All, |axis| NmtTarget::Node(axis.node));
            Some(ForeignFrames::Frame { frame: command?.frame(target), period_ns: None })
        }
        FaultKind::Flood => {
            let id = section.get("id").map_or(Some(1), |entry| entry.integer(0..0x800));
            let period_ns = common::period(section, FLOOD_NS, config);
            let id = Id::base(u32::try_from(id?).ok()?).ok()?;
            Some(every(Frame::of(id, [0x55; 8]), period_ns?))
        }
        _ => {
            let id =
                section.require("id", "its identifier: id = 0x123").and_then(|entry| entry.integer(0..0x800));
            let data = section.get("data").map_or(Some(vec![]), |entry| bytes(&entry));
            let period_ns = section.get("period").is_some().then(|| common::period(section, 0, config));
            let period_ns = match period_ns {
                None => None,
                Some(period_ns) => Some(period_ns?),
            };
            let id = Id::base(u32::try_from(id?).ok()?).ok()?;
            Some(ForeignFrames::Frame { frame: Frame::data(id, &data?).ok()?, period_ns })
        }
    }
}

fn bytes(entry: &Entry<'_>) -> Option<Vec<u8>> {
    let list = entry.list()?;
    if list.len() > 8 {
        entry.report_range(format!("a list of {}", list.len()), "at most 8 bytes".to_owned());
        return None;
    }
    list.iter().map(|byte| u8::try_from(byte.integer(0..256)?).ok()).collect()
}

/// Reads the keys of a fault of a drive.
pub fn drive(
    section: &mut Section<'_>,
    kind: DriveFaultKind,
    location: &Location<'_, '_>,
    config: &Config,
) -> Option<Read> {
    let axis = location.axis?;
    let effect = drive_trouble(section, kind, axis);
    // When the effect is wrong, it is unknown whether it lasts; then `for` is not reported as an unknown key.
    let window = match effect {
        Some(effect) if effect.is_event() => common::beginning(section, config),
        _ => common::window(section, "for", config),
    };
    let effect = effect?;
    if !location.is_simulated(config) {
        return None;
    }
    if let (Err(error), Some(entry)) = (trial(axis, effect, config), &location.entry) {
        let name = FaultKind::Drive(kind).name();
        match particular(section, effect) {
            Some((particular, value)) => {
                let allowed = format!("what axis {:?} can have as {name:?}; {error}", axis.name);
                particular.report_range(value, allowed);
            }
            None => {
                let allowed = format!("an axis whose drive can have {name:?}; {error}");
                entry.report_range(format!("{:?}", axis.name), allowed);
            }
        }
        return None;
    }
    Some((window?, Selection::default(), Effect::Drive { node: axis.node, effect }))
}

/// A trial with a simulated drive of the same configuration shows whether it can have the effect.
fn trial(axis: &Axis, effect: DriveEffect, config: &Config) -> Result<(), InjectError> {
    if !config.is_serial_line(axis.bus) {
        return family::simulated_bus(config, axis.bus).inject(axis.node, effect, true);
    }
    let devices = family::of_line(config, axis.bus)
        .and_then(|family| family.simulated_axes_on_line(config, axis.bus))
        .ok_or(InjectError::NotSimulated)?;
    inject_on_line(&mut SimulatedLineDevices::new(devices), axis.node, effect, true)
}

/// The key, with its value, that the drive refuses: another value may be possible for the same axis.
fn particular<'a>(section: &mut Section<'a>, effect: DriveEffect) -> Option<(Entry<'a>, String)> {
    match effect {
        DriveEffect::Defect(Defect::Alarm { code }) => Some((section.get("code")?, format!("{code:#06x}"))),
        DriveEffect::Defect(Defect::OtherObjectMapped) => {
            Some((section.get("contents")?, "\"other\"".to_owned()))
        }
        _ => None,
    }
}

fn drive_trouble(section: &mut Section<'_>, effect: DriveFaultKind, axis: &Axis) -> Option<DriveEffect> {
    let is_linear = matches!(axis.travel, Travel::Linear { .. });
    let word = |entry: Entry<'_>| u16::try_from(entry.integer(0..0x1_0000)?).ok();
    let defect = match effect {
        DriveFaultKind::SilentNode => return Some(DriveEffect::Silent),
        DriveFaultKind::Reboot => return Some(DriveEffect::Reboot),
        DriveFaultKind::Cause(fault) => return Some(DriveEffect::Cause(fault)),
        DriveFaultKind::Load => {
            let quantity = if is_linear { Quantity::FORCE } else { Quantity::TORQUE };
            let entry = section.require("torque", "the torque from outside: torque = \"40 Nm\"")?;
            return Some(DriveEffect::LoadTorque(entry.quantity(quantity, Bounds::Finite)?));
        }
        DriveFaultKind::Stall => Defect::BlockedJoint,
        DriveFaultKind::StuckBrake => Defect::StuckBrake,
        DriveFaultKind::StuckSdo => Defect::SilentSdoServer,
        DriveFaultKind::TorqueOff => Defect::TorqueOff,
        DriveFaultKind::Disobedience => {
            let choices = [
                ("keeps-state", Disobedience::KeepsState),
                ("enables-itself", Disobedience::EnablesItself),
                ("local", Disobedience::IsLocal),
            ];
            let keeps_state = Some(Disobedience::KeepsState);
            Defect::Disobedience(section.get("how").map_or(keeps_state, |entry| entry.choice(&choices))?)
        }
        DriveFaultKind::EncoderJump => {
            let quantity = if is_linear { Quantity::LENGTH } else { Quantity::ANGLE };
            let entry = section.require("by", "how far the position jumps: by = \"5 deg\"")?;
            Defect::EncoderJump { distance: entry.quantity(quantity, Bounds::Finite)? }
        }
        DriveFaultKind::WrongMapping => {
            let choices = [("other", Defect::OtherObjectMapped), ("short", Defect::ShortFeedback)];
            section.get("contents").map_or(Some(Defect::OtherObjectMapped), |entry| entry.choice(&choices))?
        }
        DriveFaultKind::Statusword => {
            let set = section.get("set").map_or(Some(0), word);
            let clear = section.get("clear").map_or(Some(0), word);
            Defect::Statusword { set: set?, clear: clear? }
        }
        DriveFaultKind::ModeDisplay => {
            let entry = section.require("mode", "the number of the mode that is shown: mode = 1")?;
            Defect::OperationModeDisplay { mode: i8::try_from(entry.integer(-128..128)?).ok()? }
        }
        DriveFaultKind::Alarm => {
            Defect::Alarm { code: section.require("code", "the error code: code = 0x3210").and_then(word)? }
        }
        DriveFaultKind::Emergency => Defect::Emergency {
            code: section.require("code", "the error code: code = 0x4210").and_then(word)?,
        },
    };
    Some(DriveEffect::Defect(defect))
}
