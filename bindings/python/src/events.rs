//! The events of a controller.

use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use takt::telemetry::{Machine, event_words};
use takt::{EventKind, WaitError};

use crate::error::raise_ended;
use crate::link::{Link, seconds};
use crate::waiting::{Interrupted, until_interrupted};

/// Something that happened.
#[pyclass(module = "takt", frozen, get_all)]
pub struct Event {
    /// The slot in which it was seen.
    slot: u64,
    /// When: seconds on the clock of the arm.
    time: f64,
    /// Of what kind it is.
    kind: &'static str,
    /// The axis that it concerns.
    axis: Option<String>,
    /// The group that it concerns.
    group: Option<String>,
    /// It as a sentence.
    words: String,
}

#[pymethods]
impl Event {
    fn __str__(&self) -> &str {
        &self.words
    }

    fn __repr__(&self) -> String {
        format!("<{:.3} s: {}>", self.time, self.words)
    }
}

impl Event {
    fn of(machine: &Machine, event: &takt::Event) -> Self {
        let axis = match event.kind {
            EventKind::DriveState { axis, .. }
            | EventKind::Mode { axis, .. }
            | EventKind::Emergency { axis, .. } => Some(axis),
            EventKind::Stop(reason) => reason.axis(),
            EventKind::Rejected(rejected) => rejected.axis,
            _ => None,
        };
        let group = event.group.and_then(|group| machine.groups.get(usize::from(group)));
        Self {
            slot: event.slot,
            time: seconds(event.at_ns),
            kind: match event.kind {
                EventKind::PhaseChanged { .. } => "phase",
                EventKind::Stop(_) => "stop",
                EventKind::Stream { .. } => "stream",
                EventKind::MotionFinished { .. } => "motion_finished",
                EventKind::DriveState { .. } => "drive_state",
                EventKind::Mode { .. } => "mode",
                EventKind::Emergency { .. } => "emergency",
                EventKind::MissedSlots { .. } => "missed_slots",
                EventKind::Timing { .. } => "timing",
                EventKind::Rejected(_) => "rejected",
            },
            axis: axis.and_then(|axis| machine.axes.get(usize::from(axis))).map(|axis| axis.name.clone()),
            group: group.cloned(),
            words: event_words(event, machine).to_string(),
        }
    }
}

/// The events since a beginning. To iterate waits for each; `poll` does not wait.
#[pyclass(module = "takt", frozen)]
pub struct Events {
    link: Link,
    events: Mutex<takt::Events>,
}

impl Events {
    pub fn new(link: Link, events: takt::Events) -> Self {
        Self { link, events: Mutex::new(events) }
    }

    /// The next one; `None` when the controller has ended.
    fn next(&self, py: Python<'_>, timeout: Option<f64>) -> PyResult<Option<Event>> {
        let late = WaitError::NotInTime.to_string();
        // Who watches a controller of another process does not stop it by looking away.
        let interrupted = if self.link.is_own() { Interrupted::Stop } else { Interrupted::GoOn };
        until_interrupted(py, &self.link, timeout, &late, interrupted, |controller, at_most| {
            let mut events = self.events.lock().unwrap_or_else(PoisonError::into_inner);
            match events.wait(at_most) {
                Ok(event) => Some(Some(Event::of(controller.machine(), &event))),
                Err(WaitError::Ended) => Some(None),
                Err(WaitError::NotInTime) => None,
            }
        })
    }
}

#[pymethods]
impl Events {
    /// The events that have come. Does not wait.
    fn poll(&self, py: Python<'_>) -> PyResult<Vec<Event>> {
        let machine = self.link.controller(py)?.machine();
        Ok(py.detach(|| {
            let mut events = self.events.lock().unwrap_or_else(PoisonError::into_inner);
            let come: Vec<takt::Event> = events.by_ref().collect();
            come.iter().map(|event| Event::of(machine, event)).collect()
        }))
    }

    /// Waits for the next event.
    #[pyo3(signature = (timeout=None))]
    fn wait(&self, py: Python<'_>, timeout: Option<f64>) -> PyResult<Event> {
        self.next(py, timeout)?.ok_or_else(|| raise_ended(py))
    }

    /// Events that this observer has missed because it was more than 1024 behind.
    #[getter]
    fn missed(&self) -> u64 {
        self.events.lock().unwrap_or_else(PoisonError::into_inner).missed()
    }

    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Event>> {
        self.next(py, None)
    }

    fn __repr__(&self) -> &'static str {
        "<events: iterate to wait for each, poll() for those that have come>"
    }
}
