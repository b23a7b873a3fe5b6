//! A scenario: faults in the order of their file.

use super::effect::Effect;
use super::selection::Selection;
use super::window::Window;

/// The faults of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scenario {
    /// The faults, in the order of the file.
    pub faults: Vec<ScenarioFault>,
}

/// One fault of a scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct ScenarioFault {
    /// Its kind, as the file names it: `drop`.
    pub kind: &'static str,
    /// Where it is injected, for people: `bus base`, `axis joint2`.
    pub location: String,
    /// The line of the file at which it begins, counted from 1.
    pub line: usize,
    /// The bus, an index into the configuration.
    pub bus: usize,
    /// When it is active.
    pub window: Window,
    /// The selected frames, or requests and replies. Only for [`Effect::Frames`] and [`Effect::Line`], except for the seed.
    pub selection: Selection,
    /// Its effect.
    pub effect: Effect,
}
