//! From the text of a file to a checked [`Config`].
//!
//! `toml` gives the tree with the place of every key and value. It is read here key by key, not by derived `serde` code, which
//! ends at the first problem. Whoever sets up a machine needs all problems at once.

mod axis;
mod bus;
mod control;
pub(crate) mod entry;
mod group;
mod limits;
mod line;
mod machine;
mod program;
pub(crate) mod section;
mod stops;
mod travel;
mod urdf;

use toml::de::DeTable;

use super::configured_family::ConfiguredFamily;
use super::error::{ConfigError, Location, Problem};
use super::model::{Axis, CommandFrames, Config};
use super::problem_kind::ProblemKind;
use super::spot::Problems;
use section::Section;
use urdf::Description;

/// Which command phases count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PhaseChoice {
    /// That of the configuration.
    Given,
    /// Any.
    Any,
}

/// What the reader needs to know that is not a matter of reading.
pub(crate) struct Knowledge<'a> {
    /// Finds what `command_phase = "auto"` stands for in a configuration that is complete otherwise, by an analysis of the buses.
    /// The error says in words why there is no such phase.
    pub command_phase: fn(&Config) -> Result<u64, String>,
    /// Whether the bus with this index carries its traffic only if axes share command frames; with the command phase of the
    /// configuration, or with any.
    pub needs_shared_frames: fn(&Config, usize, PhaseChoice) -> bool,
    /// The values of configuration files (`dcf`) with which the bring-up of an axis refuses its drive.
    pub refused_values: fn(&Config, &Axis) -> Vec<ProblemKind>,
    /// The families that a drive may be of.
    pub families: &'a [&'static dyn ConfiguredFamily],
}

/// Reads and checks the text of a configuration. `source_name` is what messages call it.
pub(crate) fn parse(source_name: &str, text: &str, knowledge: &Knowledge<'_>) -> Result<Config, ConfigError> {
    document(source_name, text, |document, problems| read(document, problems, knowledge))
}

/// What `read` makes of a TOML document, or else every problem that it has reported.
pub(crate) fn document<T>(
    source_name: &str,
    text: &str,
    read: impl for<'a> FnOnce(&'a DeTable<'a>, &'a Problems) -> Option<T>,
) -> Result<T, ConfigError> {
    let refuse = |problems| ConfigError::of_text(source_name, text, problems);
    let (document, errors) = DeTable::parse_recoverable(text);
    if !errors.is_empty() {
        return Err(refuse(errors.iter().map(|error| syntax_problem(error, text)).collect()));
    }
    let problems = Problems::in_text(source_name, text);
    let found = read(document.get_ref(), &problems);
    let problems = problems.into_vec();
    match found {
        Some(found) if problems.is_empty() => Ok(found),
        _ => Err(refuse(problems)),
    }
}

fn syntax_problem(error: &toml::de::Error, text: &str) -> Problem {
    let kind = ProblemKind::Syntax { message: error.message().to_owned() };
    let span = error.span().unwrap_or(text.len()..text.len());
    Problem { kind, location: Location::Text { span, first_line: None } }
}

/// Reads every section, even after one has failed.
fn read<'a>(document: &'a DeTable<'a>, problems: &'a Problems, knowledge: &Knowledge<'_>) -> Option<Config> {
    let mut root = Section::new("", 0..0, document, problems);
    let name =
        root.require("name", "the name of the machine: name = \"arm6\"").and_then(|entry| entry.name());
    let urdf = Description::read(root.get("urdf"));
    let mut cycle = root.section("cycle");
    let missed_slots = stops::missed_slots(cycle.section("missed_slots"));
    let (cycle, automatic_phase) = machine::cycle(cycle);
    let stops = stops::stops(root.section("stops"));
    let stream_delay = machine::stream_delay(root.section("stream"));
    let realtime = machine::realtime(root.section("realtime"), cycle.period_ns);
    let master = machine::master(root.section("master"));
    let telemetry = machine::telemetry(root.section("telemetry"));
    let simulation = machine::simulation(root.section("simulation"), cycle.period_ns);

    root.require("bus", "at least one [[bus]]");
    let lines = line::names(document, knowledge.families);
    let buses = bus::buses(root.sections("bus"), cycle.period_ns, &lines);

    let mut defaults = root.section("defaults");
    let axis_defaults = defaults.get("axis").and_then(|entry| entry.table());
    defaults.finish();
    root.require("axis", "at least one [[axis]]");
    let axes =
        root.sections("axis").into_iter().map(|section| section.with_defaults(axis_defaults)).collect();
    let machine = axis::Machine {
        buses: &buses,
        cycle_ns: cycle.period_ns,
        master_node: master.node,
        families: knowledge.families,
        urdf: &urdf,
    };
    let axes = axis::axes(axes, &machine);

    let groups = group::groups(root.sections("group"), &axes, problems);
    let program = program::program(root.section("program"), &axes, &groups);
    root.finish();

    let dcf_spans: Vec<_> = axes.iter().map(axis::ReadAxis::dcf).collect();
    let automatic_frames: Vec<bool> = buses.iter().map(|bus| bus.has_automatic_frames).collect();
    let axes: Option<Vec<_>> = axes.into_iter().map(|axis| axis.axis).collect();
    let master = master.complete(axes.as_deref().unwrap_or_default(), cycle.period_ns);
    let mut config = Config {
        name: name?.to_owned(),
        cycle,
        missed_slots,
        stops,
        stream_delay,
        realtime,
        master,
        buses: buses.into_iter().map(|bus| bus.bus).collect::<Option<_>>()?,
        axes: axes?,
        groups: groups.into_iter().map(group::ReadGroup::group).collect::<Option<_>>()?,
        program,
        telemetry,
        simulation,
    };
    // Once everything else that counts is known.
    let phase = if automatic_phase.is_some() { PhaseChoice::Any } else { PhaseChoice::Given };
    for bus in (0..config.buses.len()).filter(|_| problems.is_empty()) {
        let is_automatic = automatic_frames.get(bus).copied().unwrap_or_default();
        if is_automatic
            && (knowledge.needs_shared_frames)(&config, bus, phase)
            && let Some(bus) = config.buses.get_mut(bus)
        {
            bus.command_frames = CommandFrames::Shared;
        }
    }
    if let Some(automatic_phase) = automatic_phase.filter(|_| problems.is_empty()) {
        match (knowledge.command_phase)(&config) {
            Ok(command_phase_ns) => config.cycle.command_phase_ns = command_phase_ns,
            Err(cause) => automatic_phase.report(ProblemKind::NoCommandPhase { cause }),
        }
    }
    if problems.is_empty() {
        for (axis, span) in config.axes.iter().zip(dcf_spans) {
            for kind in (knowledge.refused_values)(&config, axis) {
                problems.report(kind, span.clone());
            }
        }
    }
    Some(config)
}
