//! The state of an arm, or of a group of its axes, after a cycle.

use std::collections::BTreeMap;
use std::sync::Arc;

use pyo3::prelude::*;
use takt::config::mode_word;
use takt::rt::RequestTarget;
use takt::telemetry::phase_words;
use takt::{AnyHandle, AxisSnapshot, OperationMode, Phase};

use crate::array::{array, array_of_bools};
use crate::link::{Link, seconds};

/// The state after a cycle. Each array has a value for each axis; nan where a drive has not reported it. Whoever steps a simulation reads
/// one in each cycle: names and arrays are made when they are asked for.
#[pyclass(module = "takt", frozen)]
pub struct State {
    link: Link,
    /// The numbers of the axes.
    numbers: Arc<[usize]>,
    axes: Vec<AxisSnapshot>,
    /// The numbers of the groups, and the phase of each.
    phases: Vec<(usize, Phase)>,
    fault: Option<String>,
    slot: u64,
    at_ns: u64,
    now_ns: u64,
    missed_slots: u64,
}

impl State {
    /// The state of the axes with these numbers, which are those of the target.
    pub fn of(link: &Link, controller: &AnyHandle, numbers: &Arc<[usize]>, target: RequestTarget) -> Self {
        let mut state = Self {
            link: link.clone(),
            numbers: Arc::clone(numbers),
            axes: Vec::with_capacity(numbers.len()),
            phases: vec![],
            fault: None,
            slot: 0,
            at_ns: 0,
            now_ns: 0,
            missed_slots: 0,
        };
        let mut is_faulty = false;
        controller.look_at_state(|snapshot| {
            state.axes.extend(numbers.iter().filter_map(|number| snapshot.axes().get(*number)));
            let is_meant = |number: usize| match target {
                RequestTarget::All => true,
                RequestTarget::Group(group) => usize::from(group) == number,
            };
            for (number, group) in
                snapshot.groups().iter().enumerate().filter(|(number, _)| is_meant(*number))
            {
                state.phases.push((number, group.phase));
                is_faulty |= group.stop.is_some_and(|stop| !stop.is_requested());
            }
            (state.slot, state.at_ns) = (snapshot.slot, snapshot.at_ns);
            state.missed_slots = snapshot.missed_slots;
        });
        state.now_ns = controller.now_ns();
        if is_faulty {
            state.fault = controller.of(target).fault().map(|fault| fault.to_string());
        }
        state
    }

    fn numbers<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&AxisSnapshot) -> f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        array(py, self.axes.iter().map(of))
    }

    /// What a drive reports; a drive that has reported nothing has no position of 0.
    fn reported<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&AxisSnapshot) -> Option<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.numbers(py, |axis| of(axis).filter(|_| axis.is_heard).unwrap_or(f64::NAN))
    }

    fn age_of(&self, axis: &AxisSnapshot) -> f64 {
        axis.feedback_age_ns(self.now_ns).map_or(f64::INFINITY, seconds)
    }
}

#[pymethods]
impl State {
    /// The slot of the cycle.
    #[getter]
    const fn slot(&self) -> u64 {
        self.slot
    }

    /// When the cycle was: seconds on the clock of the arm.
    #[getter]
    fn time(&self) -> f64 {
        seconds(self.at_ns)
    }

    /// Slots that passed unused since the start, because the thread was late.
    #[getter]
    const fn missed_slots(&self) -> u64 {
        self.missed_slots
    }

    /// Where the joints are: rad or m.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.reported(py, |axis| Some(axis.position))
    }

    /// How fast they are: rad/s or m/s.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.reported(py, |axis| Some(axis.velocity))
    }

    /// The torques that the drives report: N·m or N.
    #[getter]
    fn torque<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.reported(py, |axis| axis.torque)
    }

    /// The set-points of the positions.
    #[getter]
    fn position_set<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.numbers(py, |axis| axis.position_set)
    }

    /// The set-points of the velocities.
    #[getter]
    fn velocity_set<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.numbers(py, |axis| axis.velocity_set)
    }

    /// The torques that are sent.
    #[getter]
    fn torque_set<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.numbers(py, |axis| axis.torque_set)
    }

    /// How far the joints are off their set-points.
    #[getter]
    fn following_error<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.reported(py, |axis| Some(axis.following_error))
    }

    /// The currents, as fractions of the rated ones.
    #[getter]
    fn current<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.reported(py, |axis| axis.current_per_mille.map(|current| f64::from(current) / 1000.0))
    }

    /// The temperatures of the drives: °C.
    #[getter]
    fn temperature<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.reported(py, |axis| axis.temperature.map(f64::from))
    }

    /// How old what each drive reports is, in seconds; infinite before its first report.
    #[getter]
    fn age<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.numbers(py, |axis| self.age_of(axis))
    }

    /// Whether what a drive reports is not from its last cycle.
    #[getter]
    fn is_stale<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array_of_bools(py, self.axes.iter().map(AxisSnapshot::is_stale))
    }

    /// What the axes are doing: "holding", "moving", …; where groups do different things, what the first does.
    #[getter]
    pub fn phase(&self) -> &'static str {
        self.phases.first().map_or("passive", |(_, phase)| phase_words(*phase))
    }

    /// What each group is doing.
    #[getter]
    fn phases(&self) -> BTreeMap<&str, &'static str> {
        self.phases.iter().map(|(group, phase)| (self.link.group_name(*group), phase_words(*phase))).collect()
    }

    /// The fault that has stopped the axes, in words; None while there is none.
    #[getter]
    fn fault(&self) -> Option<&str> {
        self.fault.as_deref()
    }

    /// The mode of operation of each axis, as the drives show it, or as it is commanded where they do not.
    #[getter]
    fn mode(&self) -> Vec<&'static str> {
        let word = |axis: &AxisSnapshot| {
            OperationMode::from_number(axis.mode.unwrap_or(axis.mode_set)).map_or("none", mode_word)
        };
        self.axes.iter().map(word).collect()
    }

    /// The state of each drive (CiA 402).
    #[getter]
    fn drive_state(&self) -> Vec<&'static str> {
        self.axes.iter().map(|axis| axis.drive_state.name()).collect()
    }

    /// The error code of each drive; 0 for none.
    #[getter]
    fn error_code(&self) -> Vec<u16> {
        self.axes.iter().map(|axis| axis.error_code).collect()
    }

    fn __repr__(&self) -> String {
        let mut text = format!("<state of slot {}: {}", self.slot, self.phase());
        for (name, axis) in self.link.names_of(&self.numbers).into_iter().zip(&self.axes) {
            text.push_str(&match (axis.is_heard, axis.is_stale()) {
                (false, _) => format!(", {name} unknown"),
                (true, false) => format!(", {name} {:+.4}", axis.position),
                (true, true) => {
                    format!(", {name} {:+.4} ({:.0} ms old)", axis.position, self.age_of(axis) * 1e3)
                }
            });
        }
        if let Some(fault) = &self.fault {
            text.push_str("; ");
            text.push_str(fault);
        }
        text + ">"
    }
}
