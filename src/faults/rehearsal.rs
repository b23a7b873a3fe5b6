//! A scenario on its stage: the ports it is played on, the cues, and what there is to tell.

use std::fmt;
use std::sync::Arc;

use takt_rt::{NANOSECONDS_PER_SECOND, Nanoseconds, Snapshot};

use super::cue::{Cue, Cues};
use super::port::FaultyPort;
use super::scenario::{Fault, Scenario};
use super::window::Course;
use crate::bus::port::Port;

/// A scenario that is being played in one run.
#[derive(Debug)]
pub struct Rehearsal {
    scenario: Scenario,
    cues: Arc<Cues>,
    courses: Vec<Arc<Course>>,
}

impl Rehearsal {
    /// A rehearsal that has not begun.
    pub fn new(scenario: Scenario) -> Self {
        let courses = scenario.faults.iter().map(|_| Arc::default()).collect();
        Self { scenario, cues: Arc::default(), courses }
    }

    /// The port of a bus with all of its faults; the first one of the file is nearest to the wire.
    pub fn wrap(&self, bus: usize, port: Port) -> Port {
        let own = self.courses().filter(|(fault, _)| fault.bus == bus);
        own.fold(port, |port, (fault, course)| {
            let cues = Arc::clone(&self.cues);
            Port::Faulty(Box::new(FaultyPort::new(port, fault, cues, Arc::clone(course))))
        })
    }

    /// Takes the state of the group after a cycle, for the cues.
    pub fn observe(&self, snapshot: &Snapshot) {
        self.cues.observe(snapshot);
    }

    /// The faults in the order of the file, and how each has gone so far.
    pub fn courses(&self) -> impl Iterator<Item = (&Fault, &Arc<Course>)> {
        self.scenario.faults.iter().zip(&self.courses)
    }
}

/// What has happened to a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// It has begun.
    Began,
    /// It is over.
    Ended {
        /// Frames that it has broken or made.
        frames: u64,
    },
    /// It could not be done.
    Impossible,
}

/// Tells each turn of each fault once.
#[derive(Debug, Default)]
pub struct Tidings {
    told: Vec<(bool, bool)>,
}

/// One of them, as people read it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tiding<'a> {
    /// The fault.
    pub fault: &'a Fault,
    /// What has happened to it.
    pub turn: Turn,
    /// When, since the axes were enabled, if they have been.
    pub since_enabled_s: Option<f64>,
}

impl Tidings {
    /// What has happened since the last call.
    pub fn next<'a>(&mut self, rehearsal: &'a Rehearsal) -> Vec<Tiding<'a>> {
        self.told.resize(rehearsal.courses.len(), (false, false));
        let enabled_ns = rehearsal.cues.at_ns(Cue::Enabled);
        let since_enabled_s =
            |at_ns: Nanoseconds| Some(at_ns.checked_sub(enabled_ns?)? as f64 / NANOSECONDS_PER_SECOND as f64);
        let mut news = vec![];
        for ((fault, course), (has_begun, has_ended)) in rehearsal.courses().zip(&mut self.told) {
            if let Some(began_ns) = course.began_ns().filter(|_| !*has_begun) {
                *has_begun = true;
                let turn = if course.is_impossible() { Turn::Impossible } else { Turn::Began };
                news.push(Tiding { fault, turn, since_enabled_s: since_enabled_s(began_ns) });
            }
            if let Some(ended_ns) = course.ended_ns().filter(|_| !*has_ended) {
                *has_ended = true;
                let is_event = course.began_ns() == Some(ended_ns) && course.frames() == 0;
                if !is_event && !course.is_impossible() {
                    let turn = Turn::Ended { frames: course.frames() };
                    news.push(Tiding { fault, turn, since_enabled_s: since_enabled_s(ended_ns) });
                }
            }
        }
        news
    }
}

impl fmt::Display for Tiding<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.since_enabled_s {
            Some(seconds) => write!(f, "{seconds:.4} s after enabling: ")?,
            None => write!(f, "before enabling: ")?,
        }
        let Fault { kind, place, line, .. } = self.fault;
        write!(f, "fault `{kind}` on {place} (line {line}) ")?;
        match self.turn {
            Turn::Began => write!(f, "has begun"),
            Turn::Ended { frames: 0 } => write!(f, "is over"),
            Turn::Ended { frames: 1 } => write!(f, "is over; it concerned 1 frame"),
            Turn::Ended { frames } => write!(f, "is over; it concerned {frames} frames"),
            Turn::Impossible => write!(f, "is not possible here"),
        }
    }
}
