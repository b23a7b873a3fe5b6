//! An arm: a controller in real time, and its owner.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyTuple};
use takt::config::Interface;
use takt::telemetry::RealtimeReport;
use takt::{Controller, IfOwned, Phase, RecordingDestination, SessionOptions, WaitError, schedule};

use crate::config::config;
use crate::error::{raise, raise_start};
use crate::events::Events;
use crate::group::Group;
use crate::link::{Link, duration, seconds};
use crate::owner::{Owned, Owner};
use crate::recording::{Recorder, Recording};

/// The drives are enabled within this time. It covers the power-up time of all drives.
const ENABLE_TIMEOUT: Duration = Duration::from_secs(60);
/// How long Ctrl-C waits during bring-up.
const SLICE: Duration = Duration::from_millis(50);

/// An arm that is enabled: its controller, and everything that it can be told.
#[pyclass(module = "takt", frozen, subclass, extends = Group)]
pub struct Arm {
    pub owner: Arc<Owner>,
    link: Link,
    recorder: Recorder,
    axes: usize,
}

impl Arm {
    /// An arm that owns this controller.
    pub fn owning(owned: Owned, recorder: Recorder) -> PyClassInitializer<Self> {
        let handle = match &owned {
            Owned::Real(controller) => controller.handle(),
            Owned::Virtual(controller) => controller.handle(),
        };
        let (link, axes) = (Link::new(handle.clone()), handle.axes().len());
        let arm = Self { owner: Owner::new(owned, link.clone()), link, recorder, axes };
        PyClassInitializer::from(Group::all(handle)).add_subclass(arm)
    }
}

/// What becomes of the telemetry: as the configuration says, nothing, or a file.
fn recorded(
    config: &mut takt::Config,
    record: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<RecordingDestination>> {
    let Some(record) = record else { return Ok(None) };
    if record.is_instance_of::<PyBool>() {
        config.telemetry.is_recorded = record.extract()?;
        return Ok(None);
    }
    let path: PathBuf = record.extract()?;
    Ok(Some(RecordingDestination::File(path)))
}

/// Waits until the drives are enabled. Ctrl-C ends that in control.
fn enabled(py: Python<'_>, controller: Controller) -> PyResult<Controller> {
    let begun_ns = controller.now_ns();
    loop {
        let waited = py.detach(|| controller.wait_for(Phase::Holding, SLICE));
        let passed = Duration::from_nanos(controller.now_ns().saturating_sub(begun_ns));
        match waited {
            Ok(()) => return Ok(controller),
            Err(WaitError::NotInTime) if passed < ENABLE_TIMEOUT => {}
            Err(_) => {
                let failure = py.detach(|| controller.into_failure());
                return Err(raise_start(py, &failure));
            }
        }
        if let Err(interrupted) = py.check_signals() {
            py.detach(|| drop(controller));
            return Err(interrupted);
        }
    }
}

#[pymethods]
impl Arm {
    /// Brings the drives up and enables them.
    #[new]
    #[pyo3(signature = (config, *, buses=None, simulated=false, record=None, require_realtime=false, take_over=false))]
    fn new(
        py: Python<'_>,
        config: Bound<'_, PyAny>,
        buses: Option<BTreeMap<String, String>>,
        simulated: bool,
        record: Option<&Bound<'_, PyAny>>,
        require_realtime: bool,
        take_over: bool,
    ) -> PyResult<PyClassInitializer<Self>> {
        let mut config = self::config(&config, buses, simulated)?;
        schedule::verify(&config).map_err(|error| raise(py, "ConfigError", &error.to_string(), &[]))?;
        if config.buses.iter().any(|bus| bus.interface != Interface::Simulated) {
            let warn = py.import("warnings")?.getattr("warn")?;
            let class = py.import("takt.errors")?.getattr("ConfigWarning")?;
            for warning in config.warnings() {
                warn.call1((warning.to_string(), &class, 2))?;
            }
        }
        let recorder = Recorder::default();
        let options = SessionOptions {
            recording: recorded(&mut config, record)?,
            is_realtime_required: require_realtime,
            each_cycle: Some(recorder.each_cycle()),
            if_owned: if take_over { IfOwned::TakeOver } else { IfOwned::Refuse },
            ..SessionOptions::default()
        };
        let begun = py.detach(|| Controller::begin(config, options));
        let controller = enabled(py, begun.map_err(|error| raise_start(py, &error))?)?;
        Ok(Self::owning(Owned::Real(controller), recorder))
    }

    /// Brings the axes to rest, disables and shuts down the drives. Closing it again does nothing.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.owner.close(py)
    }

    /// The present time on the clock of the arm, in seconds: `time.monotonic()`, or virtual time.
    #[getter]
    fn time(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(seconds(self.link.handle(py)?.now_ns()))
    }

    /// The names of the groups; none where all axes are one group.
    #[getter]
    fn groups(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        Ok(self.link.handle(py)?.groups().iter().map(|group| group.name.clone()).collect())
    }

    /// One group of several, by its name.
    fn group(slf: PyRef<'_, Self>, py: Python<'_>, name: &str) -> PyResult<Group> {
        slf.as_super().named(py, name)
    }

    /// The events from now on.
    fn events(&self, py: Python<'_>) -> PyResult<Events> {
        Ok(Events::new(self.link.clone(), self.link.handle(py)?.events()))
    }

    /// Records every cycle from now on, for no more than so many seconds.
    #[pyo3(signature = (at_most=600.0))]
    fn record(&self, py: Python<'_>, at_most: f64) -> PyResult<Recording> {
        let period_ns = u128::from(self.link.handle(py)?.machine().cycle_ns.max(1));
        let cycles = duration("at_most", at_most)?.as_nanos().div_ceil(period_ns);
        let cycles = usize::try_from(cycles).unwrap_or(usize::MAX);
        Ok(self.recorder.begin(self.link.clone(), (0..self.axes).collect(), cycles))
    }

    /// What the operating system has granted to the real-time thread, and what it has refused.
    #[getter]
    fn realtime<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let report = RealtimeReport::new(self.link.handle(py)?.realtime(), 0, 0);
        let fields = PyDict::new(py);
        fields.set_item("policy", report.policy)?;
        fields.set_item("priority", report.priority)?;
        fields.set_item("cpu", report.cpu)?;
        fields.set_item("memory_locked", report.memory_locked)?;
        fields.set_item("preempt_rt", report.preempt_rt)?;
        fields.set_item("refused", report.refused)?;
        fields.set_item("grant_with", report.grant_with)?;
        Ok(fields)
    }

    /// The recordings that could not be written. The motion goes on after them.
    #[getter]
    fn not_written(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        Ok(self.link.handle(py)?.not_written())
    }

    /// Whether the run has ended.
    #[getter]
    fn has_ended(&self, py: Python<'_>) -> PyResult<bool> {
        Ok(self.link.handle(py)?.has_ended())
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    /// Closes it. An exception that is under way goes before one of the shut-down.
    #[pyo3(signature = (*exception))]
    fn __exit__(&self, py: Python<'_>, exception: &Bound<'_, PyTuple>) -> PyResult<()> {
        let is_raised = exception.get_item(0).is_ok_and(|class| !class.is_none());
        match self.owner.close(py) {
            Err(error) if is_raised => {
                error.write_unraisable(py, None);
                Ok(())
            }
            closed => closed,
        }
    }
}
