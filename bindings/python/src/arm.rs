//! An arm: a controller in real time, and its owner.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyTuple};
use takt::config::Interface;
use takt::telemetry::RealtimeReport;
use takt::{
    AnyHandle, Controller, Handle, IfOwned, Phase, RecordingDestination, SessionOptions, WaitError, schedule,
};

use crate::config::config;
use crate::error::{raise, raise_command, raise_start};
use crate::events::Events;
use crate::group::Group;
use crate::link::{Link, duration, seconds};
use crate::owner::{Owned, Owner};
use crate::recording::{Recorder, Recording};
use crate::server::Server;

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
        let (link, group) = match &owned {
            Owned::Real(controller) => of_own(controller),
            Owned::Virtual(controller) => of_own(controller),
            Owned::Served(client) => with_all(Link::to_served(client.clone()), client.clone().into()),
        };
        let axes = link.axis_names().len();
        let arm = Self { owner: Owner::new(owned, link.clone()), link, recorder, axes };
        PyClassInitializer::from(group).add_subclass(arm)
    }
}

fn of_own(handle: &Handle) -> (Link, Group) {
    with_all(Link::to_own(handle.clone()), handle.clone().into())
}

fn with_all(link: Link, controller: AnyHandle) -> (Link, Group) {
    let group = Group::all(link.clone(), &controller);
    (link, group)
}

/// Connects to a controller that another process serves by a name.
#[pyfunction]
#[pyo3(signature = (name, *, take_over=false))]
pub fn connect(py: Python<'_>, name: &str, take_over: bool) -> PyResult<Py<Arm>> {
    let client = py.detach(|| takt_remote::connect(name));
    let client = client.map_err(|error| raise(py, "StartError", &error.to_string(), &[]))?;
    if take_over {
        let taken = py.detach(|| client.take_over());
        taken.map_err(|error| raise_command(py, &[], &error))?;
    }
    Py::new(py, Arm::owning(Owned::Served(client), Recorder::default()))
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
        Ok(seconds(self.link.controller(py)?.now_ns()))
    }

    /// The names of the groups; none where all axes are one group.
    #[getter]
    fn groups(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        Ok(self.link.controller(py)?.machine().groups.clone())
    }

    /// One group of several, by its name.
    fn group(slf: PyRef<'_, Self>, py: Python<'_>, name: &str) -> PyResult<Group> {
        slf.as_super().named(py, name)
    }

    /// The events from now on.
    fn events(&self, py: Python<'_>) -> PyResult<Events> {
        Ok(Events::new(self.link.clone(), self.link.controller(py)?.events()))
    }

    /// Records every cycle from now on, for no more than so many seconds.
    #[pyo3(signature = (at_most=600.0))]
    fn record(&self, py: Python<'_>, at_most: f64) -> PyResult<Recording> {
        let period_ns = u128::from(self.link.controller(py)?.period_ns().max(1));
        let cycles = duration(py, "at_most", at_most)?.as_nanos().div_ceil(period_ns);
        let cycles = usize::try_from(cycles).unwrap_or(usize::MAX);
        self.recorder.begin(py, self.link.clone(), (0..self.axes).collect(), cycles)
    }

    /// What the operating system has granted to the real-time thread, and what it has refused.
    #[getter]
    fn realtime<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let report = RealtimeReport::new(
            self.link.own(py, "knows what the system has granted to the real-time thread")?.realtime(),
            0,
            0,
        );
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
        Ok(self.link.own(py, "knows which recordings could not be written")?.not_written())
    }

    /// Whether the run has ended.
    #[getter]
    fn has_ended(&self, py: Python<'_>) -> PyResult<bool> {
        Ok(self.link.controller(py)?.has_ended())
    }

    /// The process that commands a controller of another process, and the seconds until another one may follow it.
    #[getter]
    fn lease(&self, py: Python<'_>) -> PyResult<Option<(u32, f64)>> {
        let holder = self.link.controller(py)?.lease();
        Ok(holder.map(|holder| (holder.process, holder.expires_in.as_secs_f64())))
    }

    /// Commands a controller of another process in place of whoever commands it.
    fn take_over(&self, py: Python<'_>) -> PyResult<()> {
        let controller = self.link.controller(py)?;
        let taken = py.detach(|| controller.take_over());
        taken.map_err(|error| raise_command(py, &self.link.axis_names(), &error))
    }

    /// Lets other processes observe and command the controller by a name.
    #[pyo3(signature = (name, *, mode=0o600, lease=1.0))]
    fn serve(&self, py: Python<'_>, name: &str, mode: u32, lease: f64) -> PyResult<Server> {
        let options =
            takt_remote::ServeOptions::default().with_mode(mode).with_lease(duration(py, "lease", lease)?);
        Server::start(py, self.link.clone(), name, options)
    }

    /// Lets another process command.
    fn release(&self, py: Python<'_>) -> PyResult<()> {
        let controller = self.link.controller(py)?;
        let released = py.detach(|| controller.release());
        released.map_err(|error| raise_command(py, &self.link.axis_names(), &error))
    }

    fn __repr__(slf: PyRef<'_, Self>) -> String {
        let (axes, group) = (slf.link.axis_names().join(", "), slf.as_super());
        match slf.link.usable() {
            None => format!("<closed arm of {axes}>"),
            Some(controller) => {
                let (name, phase) = group.shown(controller);
                let words = if controller.has_ended() { "ended" } else { phase };
                format!("<arm {name:?}, {words}: {axes}>")
            }
        }
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
