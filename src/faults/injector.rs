//! Injects the faults of a scenario into the ports of one run, and reports their events.

use std::fmt;
use std::sync::Arc;

use takt_rt::{NANOSECONDS_PER_SECOND, Nanoseconds, Snapshot};

use super::effect::Effect;
use super::injectable::Injectable;
use super::line::{LineFault, LineFaults};
use super::port::FaultyPort;
use super::scenario::{Scenario, ScenarioFault};
use super::trigger::{Trigger, TriggerTimes};
use super::window::FaultProgress;

/// Injects the faults of a scenario in one run.
#[derive(Debug)]
pub struct FaultInjector {
    scenario: Scenario,
    trigger_times: Arc<TriggerTimes>,
    progress: Vec<Arc<FaultProgress>>,
}

impl FaultInjector {
    /// An injector that has not begun.
    pub fn new(scenario: Scenario) -> Self {
        let progress = scenario.faults.iter().map(|_| Arc::default()).collect();
        Self { scenario, trigger_times: Arc::default(), progress }
    }

    /// Wraps the port of a bus in all of its faults. The first one of the file is nearest to the wire. What a serial line
    /// has beside is in [`FaultInjector::of_line`].
    pub fn wrap<P: Injectable + From<FaultyPort<P>>>(&self, bus: usize, port: P) -> P {
        let is_of_port = |fault: &ScenarioFault| fault.bus == bus && !matches!(fault.effect, Effect::Line(_));
        let own = self.progress().filter(|(fault, _)| is_of_port(fault));
        own.fold(port, |port, (fault, progress)| {
            let trigger_times = Arc::clone(&self.trigger_times);
            FaultyPort::new(port, fault, trigger_times, Arc::clone(progress)).into()
        })
    }

    /// The faults of the requests and replies on a serial line. A CAN bus has none.
    pub fn of_line(&self, bus: usize) -> LineFaults {
        let faults = self.progress().filter(|(fault, _)| fault.bus == bus);
        let of_line = faults.filter_map(|(fault, progress)| {
            let Effect::Line(effect) = fault.effect else { return None };
            let trigger_times = Arc::clone(&self.trigger_times);
            let (window, selection) = (fault.window, fault.selection.clone());
            Some(LineFault::new(effect, window, selection, trigger_times, Arc::clone(progress)))
        });
        LineFaults::new(of_line.collect())
    }

    /// Takes the snapshot of a cycle, for the triggers.
    pub fn observe(&self, snapshot: &Snapshot) {
        self.trigger_times.observe(snapshot);
    }

    /// The faults in the order of the file, with the progress of each.
    pub fn progress(&self) -> impl Iterator<Item = (&ScenarioFault, &Arc<FaultProgress>)> {
        self.scenario.faults.iter().zip(&self.progress)
    }
}

/// A change of a fault's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Transition {
    /// The fault has begun.
    Began,
    /// The fault has ended.
    Ended {
        /// Number of frames that it changed or sent.
        frames: u64,
    },
    /// The fault could not be injected.
    Impossible,
}

/// Reports each transition of each fault once.
#[derive(Debug, Default)]
pub struct FaultEvents {
    reported: Vec<(bool, bool)>,
}

/// An event of a fault, for people.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct FaultEvent<'a> {
    /// The fault.
    pub fault: &'a ScenarioFault,
    /// The transition.
    pub transition: Transition,
    /// Time since the axes were enabled, if they have been.
    pub since_enabled_s: Option<f64>,
}

impl FaultEvents {
    /// The events since the last call.
    pub fn next<'a>(&mut self, fault_injector: &'a FaultInjector) -> Vec<FaultEvent<'a>> {
        self.reported.resize(fault_injector.progress.len(), (false, false));
        let enabled_ns = fault_injector.trigger_times.at_ns(Trigger::Enabled);
        let since_enabled_s =
            |at_ns: Nanoseconds| Some(at_ns.checked_sub(enabled_ns?)? as f64 / NANOSECONDS_PER_SECOND as f64);
        let mut events = vec![];
        for ((fault, progress), (has_begun, has_ended)) in fault_injector.progress().zip(&mut self.reported) {
            if let Some(began_ns) = progress.began_ns().filter(|_| !*has_begun) {
                *has_begun = true;
                let transition =
                    if progress.is_impossible() { Transition::Impossible } else { Transition::Began };
                events.push(FaultEvent { fault, transition, since_enabled_s: since_enabled_s(began_ns) });
            }
            if let Some(ended_ns) = progress.ended_ns().filter(|_| !*has_ended) {
                *has_ended = true;
                let is_event = progress.began_ns() == Some(ended_ns) && progress.frames() == 0;
                if !is_event && !progress.is_impossible() {
                    let transition = Transition::Ended { frames: progress.frames() };
                    events.push(FaultEvent { fault, transition, since_enabled_s: since_enabled_s(ended_ns) });
                }
            }
        }
        events
    }
}

impl fmt::Display for FaultEvent<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.since_enabled_s {
            Some(seconds) => write!(f, "{seconds:.4} s after enabling: ")?,
            None => write!(f, "before enabling: ")?,
        }
        let ScenarioFault { kind, location, line, effect, .. } = self.fault;
        let (one, many) = match effect {
            Effect::Line(_) => ("request or reply", "requests and replies"),
            _ => ("frame", "frames"),
        };
        write!(f, "fault `{kind}` on {location} (line {line}) ")?;
        match self.transition {
            Transition::Began => write!(f, "has begun"),
            Transition::Ended { frames: 0 } => write!(f, "has ended"),
            Transition::Ended { frames: 1 } => write!(f, "has ended; it affected 1 {one}"),
            Transition::Ended { frames } => write!(f, "has ended; it affected {frames} {many}"),
            Transition::Impossible => write!(f, "is not possible here"),
        }
    }
}
