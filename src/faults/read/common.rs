//! The keys that many kinds of fault share: location, window, selection.

use std::ops::RangeInclusive;

use takt_rt::Nanoseconds;

use crate::config::bounds::Bounds;
use crate::config::read::entry::Entry;
use crate::config::read::section::Section;
use crate::config::{Axis, Config, Interface, Protocol, Quantity};
use crate::family;
use crate::faults::selection::{Direction, DriveIdentifiers, FrameFunction, Selection};
use crate::faults::trigger::Trigger;
use crate::faults::window::Window;

/// The longest duration; a longer one is a mistake in the unit.
const LONGEST_S: f64 = 86_400.0;
/// The number of identifiers, standard and extended.
const IDS: i64 = 1 << 29;

/// Where a fault is injected.
pub struct Location<'c, 'a> {
    pub bus: usize,
    /// The axis, if one is named.
    pub axis: Option<&'c Axis>,
    /// The entry of the file that names it.
    pub entry: Option<Entry<'a>>,
}

impl Location<'_, '_> {
    pub fn show(&self, config: &Config) -> String {
        match self.axis {
            Some(axis) => format!("axis {}", axis.name),
            None => format!("bus {}", config.buses.get(self.bus).map_or("?", |bus| bus.name.as_str())),
        }
    }

    /// Returns `true` if its drives are simulated; if not, that is reported.
    pub fn is_simulated(&self, config: &Config) -> bool {
        let interface = config.buses.get(self.bus).map(|bus| &bus.interface);
        match (interface, &self.entry) {
            (Some(Interface::Simulated), _) => true,
            (Some(interface), Some(entry)) => {
                let allowed = "an axis on a simulated bus: faults can only be injected into simulated drives"
                    .to_owned();
                entry.report_range(format!("an axis on {interface}"), allowed);
                false
            }
            _ => false,
        }
    }
}

/// Reads `bus` and `axis`.
pub fn location<'c, 'a>(
    section: &mut Section<'a>,
    config: &'c Config,
    needs_axis: bool,
) -> Option<Location<'c, 'a>> {
    let axis_entry = if needs_axis {
        Some(section.require("axis", "the axis concerned: axis = \"joint1\"")?)
    } else {
        section.get("axis")
    };
    if let Some(entry) = axis_entry {
        let axis = named(&entry, &config.axes, |axis| &axis.name)?;
        return Some(Location { bus: axis.bus, axis: Some(axis), entry: Some(entry) });
    }
    let entry = match config.buses.as_slice() {
        [_] => section.get("bus"),
        _ => Some(section.require("bus", "the bus, or the axis, concerned: bus = \"left\"")?),
    };
    let bus = match &entry {
        None => 0,
        Some(entry) => {
            let bus = named(entry, &config.buses, |bus| &bus.name)?;
            config.buses.iter().position(|other| other.name == bus.name)?
        }
    };
    Some(Location { bus, axis: None, entry })
}

fn named<'c, T>(entry: &Entry<'_>, all: &'c [T], name: impl Fn(&T) -> &String) -> Option<&'c T> {
    let given = entry.text()?;
    let found = all.iter().find(|one| name(one) == given);
    if found.is_none() {
        let known: Vec<&str> = all.iter().map(|one| name(one).as_str()).collect();
        entry.report_range(format!("{given:?}"), known.join(", "));
    }
    found
}

/// Reads `when` and `at`; the window has no end.
pub fn beginning(section: &mut Section<'_>, config: &Config) -> Option<Window> {
    let trigger_times = [
        ("start", Trigger::Start),
        ("enabled", Trigger::Enabled),
        ("moving", Trigger::Moving),
        ("stopping", Trigger::Stopping),
    ];
    let trigger = section.get("when").map(|entry| entry.choice(&trigger_times));
    let after_ns = section.get("at").map(|entry| duration(&entry, config));
    Some(Window {
        trigger: trigger.unwrap_or(Some(Trigger::Enabled))?,
        after_ns: after_ns.unwrap_or(Some(0))?,
        lasts_ns: None,
    })
}

/// Reads `when`, `at`, and the duration under `key`.
pub fn window(section: &mut Section<'_>, key: &'static str, config: &Config) -> Option<Window> {
    let beginning = beginning(section, config);
    let lasts_ns = section.get(key).map(|entry| duration(&entry, config));
    let lasts_ns = match lasts_ns {
        None => None,
        Some(lasts_ns) => Some(lasts_ns?),
    };
    Some(Window { lasts_ns, ..beginning? })
}

/// Reads a duration, or a number of cycles (`"20 cycles"`).
pub fn duration(entry: &Entry<'_>, config: &Config) -> Option<Nanoseconds> {
    if !entry.is_bare_number()
        && let Some(cycles) = entry.text()?.strip_suffix("cycles").or(entry.text()?.strip_suffix("cycle"))
        && let Ok(cycles) = cycles.trim().parse::<u32>()
    {
        return Some(Nanoseconds::from(cycles) * config.cycle.period_ns);
    }
    entry.nanoseconds(0.0..=LONGEST_S)
}

/// Reads `period`; the default is `default_ns`.
pub fn period(section: &mut Section<'_>, default_ns: Nanoseconds, config: &Config) -> Option<Nanoseconds> {
    let Some(entry) = section.get("period") else { return Some(default_ns) };
    let period_ns = duration(&entry, config)?;
    if period_ns < SHORTEST_PERIOD_NS {
        entry.report_range(
            Quantity::DURATION.show(period_ns as f64 * 1e-9),
            format!("{} or more", Quantity::DURATION.show(SHORTEST_PERIOD_NS as f64 * 1e-9)),
        );
        return None;
    }
    Some(period_ns)
}

/// A classic CAN frame takes longer than this.
const SHORTEST_PERIOD_NS: Nanoseconds = 20_000;

/// Reads `seed`.
pub fn seed(section: &mut Section<'_>) -> Option<u64> {
    let seed = section.get("seed").map(|entry| entry.integer(0..i64::MAX));
    u64::try_from(seed.unwrap_or(Some(1))?).ok()
}

/// By which identifiers the frames of an axis's drive are known.
fn identifiers(axis: &Axis) -> DriveIdentifiers {
    match axis.drive.protocol {
        Protocol::Canopen => {
            let other = family::of(&axis.drive).other_protocol(&axis.drive, axis.node);
            let own_protocol = other.map_or_else(Vec::new, |other| vec![other.request.id(), other.answer]);
            DriveIdentifiers::Node { own_protocol }
        }
        Protocol::BitFields | Protocol::Own(_) | Protocol::SerialLine => DriveIdentifiers::These(
            axis.drive.frame_identifiers(axis.node).into_iter().map(|(id, _)| id).collect(),
        ),
    }
}

/// Reads `id`, `function`, `direction`, `probability`, `count` and `seed`. With `is_sent` the direction is fixed.
pub fn selection(section: &mut Section<'_>, location: &Location<'_, '_>, is_sent: bool) -> Option<Selection> {
    let all = Selection::default();
    let ids = section.get("id").map(|entry| ids(&entry));
    let functions = [
        ("nmt", FrameFunction::Nmt),
        ("sync", FrameFunction::Sync),
        ("emergency", FrameFunction::Emergency),
        ("tpdo", FrameFunction::Tpdo),
        ("rpdo", FrameFunction::Rpdo),
        ("sdo", FrameFunction::Sdo),
        ("heartbeat", FrameFunction::Heartbeat),
    ];
    let function = section.get("function").map(|entry| entry.choice(&functions));
    let directions =
        [("sent", Direction::Sent), ("received", Direction::Received), ("both", Direction::Both)];
    let direction = match is_sent {
        true => Some(Some(Direction::Sent)),
        false => section.get("direction").map(|entry| entry.choice(&directions)),
    };
    let probability =
        section.get("probability").map(|entry| entry.quantity(Quantity::FRACTION, Bounds::Share));
    let count = section.get("count").map(|entry| entry.integer(1..1_000_000_000));
    let seed = seed(section);
    Some(Selection {
        direction: direction.unwrap_or(Some(all.direction))?,
        ids: ids.unwrap_or(Some(all.ids))?,
        function: match function {
            None => None,
            Some(function) => Some(function?),
        },
        node: location.axis.map(|axis| axis.node),
        identifiers: location.axis.map(identifiers).unwrap_or_default(),
        probability: probability.unwrap_or(Some(all.probability))?,
        count: match count {
            None => None,
            Some(count) => Some(u64::try_from(count?).ok()?),
        },
        seed: seed?,
    })
}

/// Reads one identifier, or the first and the last of a range.
fn ids(entry: &Entry<'_>) -> Option<RangeInclusive<u32>> {
    let id = |entry: &Entry<'_>| u32::try_from(entry.integer(0..IDS)?).ok();
    if !entry.is_list() {
        let id = id(entry)?;
        return Some(id..=id);
    }
    let list = entry.list()?;
    let [first, last] = list.as_slice() else {
        entry.report_range(
            format!("a list of {}", list.len()),
            "the first and the last identifier".to_owned(),
        );
        return None;
    };
    let (first, last) = (id(first)?, id(last)?);
    if first > last {
        entry.report_range(
            format!("{first:#05x} to {last:#05x}"),
            "the lower identifier comes first".to_owned(),
        );
        return None;
    }
    Some(first..=last)
}
