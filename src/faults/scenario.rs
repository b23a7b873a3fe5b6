//! A scenario: faults in the order of their file.

use super::effect::Effect;
use super::selection::Selection;
use super::window::Window;

/// What is to go wrong in a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scenario {
    /// The faults, in the order of the file.
    pub faults: Vec<Fault>,
}

/// One fault.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Its kind, as the file says it: `drop`.
    pub kind: &'static str,
    /// What it happens to, for people: `bus base`, `axis joint2`.
    pub place: String,
    /// The line of the file in which it begins, counted from 1.
    pub line: usize,
    /// The bus, an index into the configuration.
    pub bus: usize,
    /// From when to when.
    pub window: Window,
    /// Which frames; concerns [`Effect::Frames`] only, but for the seed.
    pub selection: Selection,
    /// What happens.
    pub effect: Effect,
}
