//! The kinds of fault and the keys of each.

use takt_rt::{Frame, Id};

use super::common::{self, Place};
use crate::canopen::nmt::{NmtCommand, NmtTarget};
use crate::config::read::entry::{Bounds, Entry};
use crate::config::read::section::Section;
use crate::config::{Axis, Config, Quantity, Travel};
use crate::faults::breakable::{Breakable, DriveTrouble};
use crate::faults::effect::{DelayPlace, Effect, ForeignFrames, FrameEffect, InterfaceEffect, Part};
use crate::faults::selection::Selection;
use crate::faults::window::Window;
use crate::sim::{Defect, DriveFault, SimulatedBus};

/// The word for a kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Word {
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
    Drive(Trouble),
}

/// The word for something that happens to a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
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
    Alarm,
    Emergency,
    Cause(DriveFault),
}

/// All of them.
pub const WORDS: [(&str, Word); 35] = [
    ("drop", Word::Drop),
    ("delay", Word::Delay),
    ("duplicate", Word::Duplicate),
    ("corrupt", Word::Corrupt),
    ("reorder", Word::Reorder),
    ("echo-loss", Word::EchoLoss),
    ("full-queue", Word::FullQueue),
    ("bus-off", Word::BusOff),
    ("error-passive", Word::ErrorPassive),
    ("interface-down", Word::InterfaceDown),
    ("foreign-sync", Word::ForeignSync),
    ("foreign-set-points", Word::ForeignSetPoints),
    ("foreign-nmt", Word::ForeignNmt),
    ("foreign-frame", Word::ForeignFrame),
    ("duplicate-node", Word::DuplicateNode),
    ("flood", Word::Flood),
    ("stall", Word::Drive(Trouble::Stall)),
    ("stuck-brake", Word::Drive(Trouble::StuckBrake)),
    ("load", Word::Drive(Trouble::Load)),
    ("encoder-jump", Word::Drive(Trouble::EncoderJump)),
    ("silent-node", Word::Drive(Trouble::SilentNode)),
    ("reboot", Word::Drive(Trouble::Reboot)),
    ("stuck-sdo", Word::Drive(Trouble::StuckSdo)),
    ("wrong-mapping", Word::Drive(Trouble::WrongMapping)),
    ("statusword", Word::Drive(Trouble::Statusword)),
    ("mode-display", Word::Drive(Trouble::ModeDisplay)),
    ("torque-off", Word::Drive(Trouble::TorqueOff)),
    ("alarm", Word::Drive(Trouble::Alarm)),
    ("emergency", Word::Drive(Trouble::Emergency)),
    ("over-current", Word::Drive(Trouble::Cause(DriveFault::OverCurrent))),
    ("over-voltage", Word::Drive(Trouble::Cause(DriveFault::OverVoltage))),
    ("under-voltage", Word::Drive(Trouble::Cause(DriveFault::UnderVoltage))),
    ("over-temperature", Word::Drive(Trouble::Cause(DriveFault::OverTemperature))),
    ("encoder-failure", Word::Drive(Trouble::Cause(DriveFault::Encoder))),
    ("battery", Word::Drive(Trouble::Cause(DriveFault::MultiTurnBattery))),
];

impl Word {
    /// As the file says it.
    pub fn name(self) -> &'static str {
        WORDS.iter().find(|(_, other)| *other == self).map_or("", |(name, _)| *name)
    }

    /// Whether it happens to an axis rather than to a bus.
    pub fn needs_axis(self) -> bool {
        matches!(self, Self::Drive(_) | Self::ForeignSetPoints | Self::DuplicateNode)
    }
}

/// What the keys of a fault say: when, which frames, what.
pub type Read = (Window, Selection, Effect);

/// Reads the keys of a kind.
pub fn read(section: &mut Section<'_>, word: Word, place: &Place<'_, '_>, config: &Config) -> Option<Read> {
    match word {
        Word::Drop => frames(section, place, config, |_| Some(FrameEffect::Drop)),
        Word::Delay => frames(section, place, config, |section| {
            let entry = section.require("by", "how much later they come: by = \"300 us\"")?;
            let by_ns = common::duration(&entry, config);
            let places = [("machine", DelayPlace::Machine), ("bus", DelayPlace::Bus)];
            let place = section.get("where").map_or(Some(DelayPlace::Machine), |entry| entry.choice(&places));
            Some(FrameEffect::Delay { by_ns: by_ns?, place: place? })
        }),
        Word::Duplicate => frames(section, place, config, |section| {
            let copies = section.get("copies").map_or(Some(1), |entry| entry.integer(1..9))?;
            Some(FrameEffect::Duplicate { copies: u8::try_from(copies).ok()? })
        }),
        Word::Corrupt => frames(section, place, config, |section| {
            let parts = [("payload", Part::Payload), ("identifier", Part::Identifier)];
            let part = section.get("part").map_or(Some(Part::Payload), |entry| entry.choice(&parts));
            let bits = section.get("bits").map_or(Some(1), |entry| entry.integer(1..65));
            Some(FrameEffect::Corrupt { bits: u8::try_from(bits?).ok()?, part: part? })
        }),
        Word::Reorder => frames(section, place, config, |_| Some(FrameEffect::Reorder)),
        Word::EchoLoss => sent_frames(section, place, config, FrameEffect::EchoLoss),
        Word::FullQueue => sent_frames(section, place, config, FrameEffect::FullQueue),
        Word::BusOff => interface(section, config, "restart", InterfaceEffect::BusOff),
        Word::ErrorPassive => interface(section, config, "for", InterfaceEffect::ErrorPassive),
        Word::InterfaceDown => interface(section, config, "for", InterfaceEffect::Down),
        Word::ForeignSync
        | Word::ForeignSetPoints
        | Word::ForeignNmt
        | Word::ForeignFrame
        | Word::DuplicateNode
        | Word::Flood => {
            let window = common::window(section, "for", config);
            let frames = foreign(section, word, place, config);
            Some((window?, Selection::default(), Effect::Foreign(frames?)))
        }
        Word::Drive(trouble) => drive(section, trouble, place, config),
    }
}

fn frames<'a>(
    section: &mut Section<'a>,
    place: &Place<'_, '_>,
    config: &Config,
    effect: impl FnOnce(&mut Section<'a>) -> Option<FrameEffect>,
) -> Option<Read> {
    let window = common::window(section, "for", config);
    let selection = common::selection(section, place, false);
    let effect = effect(section);
    Some((window?, selection?, Effect::Frames(effect?)))
}

fn sent_frames(
    section: &mut Section<'_>,
    place: &Place<'_, '_>,
    config: &Config,
    effect: FrameEffect,
) -> Option<Read> {
    let window = common::window(section, "for", config);
    let selection = common::selection(section, place, true);
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

/// Where another node's heartbeat usually lies.
const HEARTBEAT_NS: u64 = 100_000_000;
/// Faster than frames of eight bytes can follow each other at 1 Mbit/s: the bus is never free for others.
const FLOOD_NS: u64 = 100_000;

fn foreign(
    section: &mut Section<'_>,
    word: Word,
    place: &Place<'_, '_>,
    config: &Config,
) -> Option<ForeignFrames> {
    let every = |frame, period_ns| ForeignFrames::Frame { frame, period_ns: Some(period_ns) };
    match word {
        Word::ForeignSync => {
            let period_ns = common::period(section, config.cycle.period_ns, config)?;
            Some(every(Frame::of(Id::canopen(0x080, 0), []), period_ns))
        }
        Word::ForeignSetPoints => {
            let period_ns = common::period(section, config.cycle.period_ns, config)?;
            Some(ForeignFrames::SetPoints { id: Id::canopen(0x200, place.axis?.node), period_ns })
        }
        Word::DuplicateNode => {
            let period_ns = common::period(section, HEARTBEAT_NS, config)?;
            Some(ForeignFrames::DuplicateNode { node: place.axis?.node, period_ns })
        }
        Word::ForeignNmt => {
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
            let target = place.axis.map_or(NmtTarget::All, |axis| NmtTarget::Node(axis.node));
            Some(ForeignFrames::Frame { frame: command?.frame(target), period_ns: None })
        }
        Word::Flood => {
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

fn drive(section: &mut Section<'_>, kind: Trouble, place: &Place<'_, '_>, config: &Config) -> Option<Read> {
    let axis = place.axis?;
    let trouble = drive_trouble(section, kind, axis);
    // Without knowing whether it lasts, an end is not called unknown.
    let window = match trouble {
        Some(trouble) if trouble.is_event() => common::beginning(section, config),
        _ => common::window(section, "for", config),
    };
    let trouble = trouble?;
    if !place.is_simulated(config) {
        return None;
    }
    // Whether that drive can have it is best tried with one like it.
    let mut trial = SimulatedBus::new(config, axis.bus);
    if let (Err(error), Some(entry)) = (trial.trouble(axis.node, trouble, true), &place.entry) {
        let name = Word::Drive(kind).name();
        match particular(section, trouble) {
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
    Some((window?, Selection::default(), Effect::Drive { node: axis.node, trouble }))
}

/// The key, with its value, that decides whether a drive can have it: another one may suit the same axis.
fn particular<'a>(section: &mut Section<'a>, trouble: DriveTrouble) -> Option<(Entry<'a>, String)> {
    match trouble {
        DriveTrouble::Defect(Defect::Alarm { code }) => Some((section.get("code")?, format!("{code:#06x}"))),
        DriveTrouble::Defect(Defect::OtherObjectMapped) => {
            Some((section.get("contents")?, "\"other\"".to_owned()))
        }
        _ => None,
    }
}

fn drive_trouble(section: &mut Section<'_>, trouble: Trouble, axis: &Axis) -> Option<DriveTrouble> {
    let is_linear = matches!(axis.travel, Travel::Linear { .. });
    let word = |entry: Entry<'_>| u16::try_from(entry.integer(0..0x1_0000)?).ok();
    let defect = match trouble {
        Trouble::SilentNode => return Some(DriveTrouble::Silent),
        Trouble::Reboot => return Some(DriveTrouble::Reboot),
        Trouble::Cause(fault) => return Some(DriveTrouble::Cause(fault)),
        Trouble::Load => {
            let quantity = if is_linear { Quantity::FORCE } else { Quantity::TORQUE };
            let entry = section.require("torque", "the torque from outside: torque = \"40 Nm\"")?;
            return Some(DriveTrouble::LoadTorque(entry.quantity(quantity, Bounds::Finite)?));
        }
        Trouble::Stall => Defect::BlockedJoint,
        Trouble::StuckBrake => Defect::StuckBrake,
        Trouble::StuckSdo => Defect::SilentSdoServer,
        Trouble::TorqueOff => Defect::TorqueOff,
        Trouble::EncoderJump => {
            let quantity = if is_linear { Quantity::LENGTH } else { Quantity::ANGLE };
            let entry = section.require("by", "how far the position jumps: by = \"5 deg\"")?;
            Defect::EncoderJump { distance: entry.quantity(quantity, Bounds::Finite)? }
        }
        Trouble::WrongMapping => {
            let choices = [("other", Defect::OtherObjectMapped), ("short", Defect::ShortFeedback)];
            section.get("contents").map_or(Some(Defect::OtherObjectMapped), |entry| entry.choice(&choices))?
        }
        Trouble::Statusword => {
            let set = section.get("set").map_or(Some(0), word);
            let clear = section.get("clear").map_or(Some(0), word);
            Defect::Statusword { set: set?, clear: clear? }
        }
        Trouble::ModeDisplay => {
            let entry = section.require("mode", "the number of the mode that is shown: mode = 1")?;
            Defect::OperationModeDisplay { mode: i8::try_from(entry.integer(-128..128)?).ok()? }
        }
        Trouble::Alarm => {
            Defect::Alarm { code: section.require("code", "the error code: code = 0x3210").and_then(word)? }
        }
        Trouble::Emergency => Defect::Emergency {
            code: section.require("code", "the error code: code = 0x4210").and_then(word)?,
        },
    };
    Some(DriveTrouble::Defect(defect))
}
