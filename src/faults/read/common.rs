//! The keys that many kinds of fault have in common: where, when, which frames.

use std::ops::RangeInclusive;

use takt_rt::Nanoseconds;

use crate::config::read::entry::{Bounds, Entry};
use crate::config::read::section::Section;
use crate::config::{Axis, Config, Interface, Quantity};
use crate::faults::cue::Cue;
use crate::faults::selection::{Direction, FrameFunction, Selection};
use crate::faults::window::Window;

/// Later than this, or longer, is a slip of the unit.
const LONGEST_S: f64 = 86_400.0;
/// The largest identifier there is.
const IDS: i64 = 1 << 29;

/// Where a fault happens.
pub struct Place<'c, 'a> {
    pub bus: usize,
    /// The axis, if one is named.
    pub axis: Option<&'c Axis>,
    /// Where the file names it.
    pub entry: Option<Entry<'a>>,
}

impl Place<'_, '_> {
    pub fn show(&self, config: &Config) -> String {
        match self.axis {
            Some(axis) => format!("axis {}", axis.name),
            None => format!("bus {}", config.buses.get(self.bus).map_or("?", |bus| bus.name.as_str())),
        }
    }

    /// Whether its drives are simulated; if not, that is reported.
    pub fn is_simulated(&self, config: &Config) -> bool {
        let interface = config.buses.get(self.bus).map(|bus| &bus.interface);
        match (interface, &self.entry) {
            (Some(Interface::Simulated), _) => true,
            (Some(interface), Some(entry)) => {
                let allowed = "an axis on a simulated bus: only simulated drives can be broken".to_owned();
                entry.report_range(format!("an axis on {interface}"), allowed);
                false
            }
            _ => false,
        }
    }
}

/// `bus` and `axis`.
pub fn place<'c, 'a>(
    section: &mut Section<'a>,
    config: &'c Config,
    needs_axis: bool,
) -> Option<Place<'c, 'a>> {
    let axis_entry = if needs_axis {
        Some(section.require("axis", "the axis concerned: axis = \"joint1\"")?)
    } else {
        section.get("axis")
    };
    if let Some(entry) = axis_entry {
        let axis = named(&entry, &config.axes, |axis| &axis.name)?;
        return Some(Place { bus: axis.bus, axis: Some(axis), entry: Some(entry) });
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
    Some(Place { bus, axis: None, entry })
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

/// `when` and `at`, without an end.
pub fn beginning(section: &mut Section<'_>, config: &Config) -> Option<Window> {
    let cues = [
        ("start", Cue::Start),
        ("enabled", Cue::Enabled),
        ("moving", Cue::Moving),
        ("stopping", Cue::Stopping),
    ];
    let cue = section.get("when").map(|entry| entry.choice(&cues));
    let after_ns = section.get("at").map(|entry| duration(&entry, config));
    Some(Window {
        cue: cue.unwrap_or(Some(Cue::Enabled))?,
        after_ns: after_ns.unwrap_or(Some(0))?,
        lasts_ns: None,
    })
}

/// `when`, `at` and the length under `key`.
pub fn window(section: &mut Section<'_>, key: &'static str, config: &Config) -> Option<Window> {
    let beginning = beginning(section, config);
    let lasts_ns = section.get(key).map(|entry| duration(&entry, config));
    let lasts_ns = match lasts_ns {
        None => None,
        Some(lasts_ns) => Some(lasts_ns?),
    };
    Some(Window { lasts_ns, ..beginning? })
}

/// A duration, or a number of cycles (`"20 cycles"`).
pub fn duration(entry: &Entry<'_>, config: &Config) -> Option<Nanoseconds> {
    if !entry.is_bare_number()
        && let Some(cycles) = entry.text()?.strip_suffix("cycles").or(entry.text()?.strip_suffix("cycle"))
        && let Ok(cycles) = cycles.trim().parse::<u32>()
    {
        return Some(Nanoseconds::from(cycles) * config.cycle.period_ns);
    }
    entry.nanoseconds(0.0, LONGEST_S)
}

/// A rhythm; absent, it is `default_ns`.
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

/// A frame of a classic bus takes longer than this.
const SHORTEST_PERIOD_NS: Nanoseconds = 20_000;

/// `seed`
pub fn seed(section: &mut Section<'_>) -> Option<u64> {
    let seed = section.get("seed").map(|entry| entry.integer(0..i64::MAX));
    u64::try_from(seed.unwrap_or(Some(1))?).ok()
}

/// `id`, `function`, `direction`, `probability`, `count` and `seed`. What is only ever sent has no direction.
pub fn selection(section: &mut Section<'_>, place: &Place<'_, '_>, is_sent: bool) -> Option<Selection> {
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
        node: place.axis.map(|axis| axis.node),
        probability: probability.unwrap_or(Some(all.probability))?,
        count: match count {
            None => None,
            Some(count) => Some(u64::try_from(count?).ok()?),
        },
        seed: seed?,
    })
}

/// One identifier, or the first and the last of a range.
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
