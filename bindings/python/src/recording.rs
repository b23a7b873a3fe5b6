//! Recordings of every cycle, as arrays. They are filled by the logger's thread of the library, or of a controller of another process by
//! a thread that waits for its cycles; neither knows anything of Python.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use takt::rt::{AxisRecord, CycleRecord};
use takt::telemetry::EachCycle;
use takt::{AnyHandle, AxisSnapshot, Snapshot, WaitError};

use crate::array::{array, array_of_rows};
use crate::link::{Link, seconds};
use crate::waiting::until;

/// A part of the record of an axis.
type Quantity = fn(&AxisRecord) -> f64;

/// What is kept of an axis, by its name.
const QUANTITIES: [(&str, Quantity); 9] = [
    ("position", |axis| axis.position),
    ("velocity", |axis| axis.velocity.into()),
    ("torque", |axis| axis.torque.into()),
    ("position_set", |axis| axis.position_set),
    ("velocity_set", |axis| axis.velocity_set.into()),
    ("acceleration_set", |axis| axis.acceleration_set.into()),
    ("torque_set", |axis| axis.torque_set.into()),
    ("following_error", |axis| axis.following_error.into()),
    ("age", |axis| axis.feedback_age.into()),
];
/// The pause between two looks at what the logger has written.
const LOOK: Duration = Duration::from_millis(2);
/// How long a recording of a controller of another process waits for a cycle before it looks whether it has ended.
const SILENCE: Duration = Duration::from_millis(50);

/// The quantities, as a state has them. What it has not is nan.
const SHOWN: [fn(&AxisSnapshot) -> f64; QUANTITIES.len()] = [
    |axis| axis.position,
    |axis| axis.velocity,
    |axis| axis.torque.unwrap_or(f64::NAN),
    |axis| axis.position_set,
    |axis| axis.velocity_set,
    |_| f64::NAN,
    |axis| axis.torque_set,
    |axis| axis.following_error,
    |axis| axis.feedback_age.into(),
];

/// Hands the records of the cycles to the recordings that are made at present.
#[derive(Clone, Default)]
pub struct Recorder(Arc<Taps>);

#[derive(Default)]
struct Taps {
    /// Whether there is one.
    any: AtomicBool,
    tapes: Mutex<Vec<Weak<Tape>>>,
}

impl Recorder {
    /// What the logger is to call.
    pub fn each_cycle(&self) -> EachCycle {
        let taps = Arc::clone(&self.0);
        Box::new(move |record| taps.write(record))
    }

    /// A recording of these axes, of at most so many cycles, from the next cycle on.
    pub fn begin(&self, py: Python<'_>, link: Link, axes: Vec<usize>, at_most: usize) -> PyResult<Recording> {
        let tape = Arc::new(Tape { axes, at_most, columns: Mutex::default() });
        let after = link.controller(py)?.state().slot;
        lock(&self.0.tapes).push(Arc::downgrade(&tape));
        self.0.any.store(true, Ordering::Release);
        if !link.is_own() {
            let watched = link.shared(py)?;
            let (recorder, of) = (self.clone(), Arc::downgrade(&tape));
            let watch = move || recorder.watch(&watched, &of, after);
            thread::Builder::new().name("takt-record".into()).spawn(watch)?;
        }
        Ok(Recording { link, tape, after, recorder: self.clone() })
    }

    /// Writes each cycle of a controller that hands over no records, until the recording ends. A cycle that this thread sleeps through is
    /// not in it.
    fn watch(&self, controller: &AnyHandle, tape: &Weak<Tape>, mut after: u64) {
        while lock(&self.0.tapes).iter().any(|own| own.ptr_eq(tape)) {
            match controller.cycle_after(after, SILENCE) {
                Ok(state) => {
                    after = state.slot;
                    let Some(tape) = tape.upgrade() else { return };
                    tape.write_state(&state);
                }
                Err(WaitError::NotInTime) => {}
                Err(WaitError::Ended) => return,
            }
        }
    }

    fn end(&self, tape: &Arc<Tape>) {
        let mut tapes = lock(&self.0.tapes);
        tapes.retain(|own| !own.ptr_eq(&Arc::downgrade(tape)) && own.strong_count() > 0);
        // The thread that writes may have looked before, and be about to write.
        lock(&tape.columns).has_ended = true;
        self.0.any.store(!tapes.is_empty(), Ordering::Release);
    }
}

impl Taps {
    fn write(&self, record: &CycleRecord) {
        if self.any.load(Ordering::Acquire) {
            lock(&self.tapes).iter().filter_map(Weak::upgrade).for_each(|tape| tape.write(record));
        }
    }
}

/// What has been recorded.
struct Tape {
    axes: Vec<usize>,
    at_most: usize,
    columns: Mutex<Columns>,
}

#[derive(Default)]
struct Columns {
    times: Vec<f64>,
    slots: Vec<u64>,
    /// Of each quantity, a row for each cycle.
    values: [Vec<f64>; QUANTITIES.len()],
    /// Nothing more is written.
    has_ended: bool,
}

impl Tape {
    fn write(&self, record: &CycleRecord) {
        let (of, timing) = (QUANTITIES.map(|(_, of)| of), &record.timing);
        self.add(timing.slot, timing.slot_start_ns, record.axes(), of);
    }

    fn write_state(&self, state: &Snapshot) {
        self.add(state.slot, state.at_ns, state.axes(), SHOWN);
    }

    fn add<T>(&self, slot: u64, at_ns: u64, axes: &[T], of: [fn(&T) -> f64; QUANTITIES.len()]) {
        let mut columns = lock(&self.columns);
        if columns.has_ended || columns.times.len() >= self.at_most {
            return;
        }
        columns.times.push(seconds(at_ns));
        columns.slots.push(slot);
        for (values, of) in columns.values.iter_mut().zip(of) {
            values.extend(self.axes.iter().filter_map(|axis| axes.get(*axis)).map(of));
        }
    }

    fn is_full(&self) -> bool {
        lock(&self.columns).times.len() >= self.at_most
    }
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Every cycle of a time, as arrays.
#[pyclass(module = "takt", frozen)]
pub struct Recording {
    link: Link,
    tape: Arc<Tape>,
    /// The slot behind which it begins.
    after: u64,
    recorder: Recorder,
}

impl Recording {
    fn quantity<'py>(&self, py: Python<'py>, number: usize) -> PyResult<Bound<'py, PyAny>> {
        let columns = py.detach(|| lock(&self.tape.columns).values.get(number).cloned().unwrap_or_default());
        array_of_rows(py, &columns, self.tape.axes.len())
    }
}

#[pymethods]
impl Recording {
    /// Ends it, when everything up to now has been written down.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        let now = self.link.controller(py)?.state().slot;
        let late = "the logger is far behind: the recording lacks its last cycles";
        until(py, &self.link, Some(5.0), late, |controller, at_most| {
            // In virtual time no cycle may have passed at all.
            let is_written = now <= self.after
                || self.tape.is_full()
                || controller.has_ended()
                || lock(&self.tape.columns).slots.last().is_some_and(|slot| *slot >= now);
            if !is_written {
                thread::sleep(LOOK.min(at_most));
            }
            is_written.then_some(())
        })?;
        self.recorder.end(&self.tape);
        Ok(())
    }

    /// The beginning of each cycle: seconds on the clock of the arm.
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let times = py.detach(|| lock(&self.tape.columns).times.clone());
        array(py, times.into_iter())
    }

    /// Where the joints were.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.quantity(py, 0)
    }

    /// How fast they were.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.quantity(py, 1)
    }

    /// The torques that the drives reported.
    #[getter]
    fn torque<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.quantity(py, 2)
    }

    /// The set-points of the positions.
    #[getter]
    fn position_set<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.quantity(py, 3)
    }

    /// The set-points of the velocities.
    #[getter]
    fn velocity_set<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.quantity(py, 4)
    }

    /// The set-points of the accelerations.
    #[getter]
    fn acceleration_set<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.quantity(py, 5)
    }

    /// The torques that were sent.
    #[getter]
    fn torque_set<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.quantity(py, 6)
    }

    /// How far the joints were off their set-points.
    #[getter]
    fn following_error<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.quantity(py, 7)
    }

    /// Cycles since the feedback of each axis; 0 for feedback of the same cycle.
    #[getter]
    fn age<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.quantity(py, 8)
    }

    /// All arrays by their names, as `numpy.savez` takes them.
    fn arrays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let arrays = PyDict::new(py);
        arrays.set_item("time", self.time(py)?)?;
        for (number, (name, _)) in QUANTITIES.iter().enumerate() {
            arrays.set_item(*name, self.quantity(py, number)?)?;
        }
        Ok(arrays)
    }

    /// Whether it has as many cycles as it may have.
    #[getter]
    fn is_full(&self) -> bool {
        self.tape.is_full()
    }

    fn __len__(&self) -> usize {
        lock(&self.tape.columns).times.len()
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*exception))]
    fn __exit__(&self, py: Python<'_>, exception: &Bound<'_, PyTuple>) -> PyResult<()> {
        if exception.get_item(0).is_ok_and(|class| !class.is_none()) {
            self.recorder.end(&self.tape);
            return Ok(());
        }
        self.stop(py)
    }

    fn __repr__(&self) -> String {
        format!("<recording of {} cycles>", self.__len__())
    }
}
