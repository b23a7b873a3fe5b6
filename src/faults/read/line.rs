//! The kinds of fault that a serial line can have, and their keys.

use super::common::{self, Location};
use super::kind::{self, FaultKind, Read};
use crate::config::read::entry::Entry;
use crate::config::read::section::Section;
use crate::config::{Config, ProblemKind};
use crate::faults::effect::{Effect, LineEffect};
use crate::faults::selection::Selection;

/// Keys of faults on frames that mean nothing on a serial line: a request has no identifier, and a reply no time stamp.
const KEYS_OF_FRAMES: [&str; 3] = ["id", "function", "where"];

/// Reads the keys of a kind of fault on a serial line. A kind that has no meaning there is refused at `entry`, which names it.
pub fn read(
    section: &mut Section<'_>,
    entry: &Entry<'_>,
    kind: FaultKind,
    location: &Location<'_, '_>,
    config: &Config,
) -> Option<Read> {
    if let Some(why) = no_meaning(kind) {
        let allowed = format!(
            "a fault that a serial line can have: \"drop\", \"delay\", \"corrupt\", \"interface-down\", or one of a \
             drive; {why}"
        );
        entry.report_range(format!("{:?} on a serial line", kind.name()), allowed);
        // The keys are right where this kind is, so they are not called unknown as well.
        let _ = kind::read(section, kind, location, config);
        return None;
    }
    match kind {
        FaultKind::Drop => messages(section, location, config, |_| Some(LineEffect::Drop)),
        FaultKind::Delay => messages(section, location, config, |section| {
            Some(LineEffect::Delay { by_ns: kind::delay(section, config)? })
        }),
        FaultKind::Corrupt => messages(section, location, config, |section| {
            let (bits, part) = kind::corruption(section)?;
            Some(LineEffect::Corrupt { bits, part })
        }),
        FaultKind::InterfaceDown => {
            let window = common::window(section, "for", config)?;
            Some((window, Selection::default(), Effect::Line(LineEffect::Gone)))
        }
        FaultKind::Drive(effect) => kind::drive(section, effect, location, config),
        _ => None,
    }
}

/// Why a kind of fault has no meaning on a serial line; `None` if it has one.
const fn no_meaning(kind: FaultKind) -> Option<&'static str> {
    match kind {
        FaultKind::Drop
        | FaultKind::Delay
        | FaultKind::Corrupt
        | FaultKind::InterfaceDown
        | FaultKind::Drive(_) => None,
        FaultKind::Duplicate => {
            Some("nothing is sent twice there: only a CAN controller repeats a frame by itself")
        }
        FaultKind::Reorder => Some("there is one request at a time, and its reply after it"),
        FaultKind::EchoLoss => Some("nobody confirms there what was sent"),
        FaultKind::FullQueue => Some("no frames wait there to be sent"),
        FaultKind::BusOff | FaultKind::ErrorPassive => {
            Some("it has no CAN controller that counts errors; \"interface-down\" takes the whole line away")
        }
        FaultKind::ForeignSync
        | FaultKind::ForeignSetPoints
        | FaultKind::ForeignNmt
        | FaultKind::ForeignFrame
        | FaultKind::DuplicateNode
        | FaultKind::Flood => Some("it has one master, and carries no CAN frames"),
    }
}

fn messages<'a>(
    section: &mut Section<'a>,
    location: &Location<'_, '_>,
    config: &Config,
    effect: impl FnOnce(&mut Section<'a>) -> Option<LineEffect>,
) -> Option<Read> {
    let window = common::window(section, "for", config);
    let mut is_right = true;
    for key in KEYS_OF_FRAMES {
        if section.get(key).is_some() {
            let spot = section.spot(key);
            spot.report(ProblemKind::NotOnALine { key: spot.key.clone() });
            is_right = false;
        }
    }
    let selection = common::selection(section, location, false);
    let effect = effect(section);
    Some((window?, selection?, Effect::Line(effect?))).filter(|_| is_right)
}
