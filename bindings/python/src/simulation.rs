//! An arm of simulated drives in virtual time.

use pyo3::prelude::*;
use takt::{Config, VirtualController};

use crate::arm::Arm;
use crate::config::config;
use crate::error::{raise, raise_ended, raise_start};
use crate::link::duration;
use crate::owner::Owned;
use crate::recording::Recorder;
use crate::waiting::look_for_signals;

/// Cycles from one look at signals to the next.
const SLICE: u64 = 1000;

/// An arm of simulated drives whose time passes only in its calls, as fast as the computer can.
#[pyclass(module = "takt", frozen, extends = Arm)]
pub struct Simulation;

fn start(py: Python<'_>, config: &Config) -> PyResult<PyClassInitializer<Simulation>> {
    let recorder = Recorder::default();
    let started = py.detach(|| VirtualController::start(config, Some(recorder.each_cycle())));
    let controller = started.map_err(|error| raise_start(py, &error))?;
    Ok(Arm::owning(Owned::Virtual(controller), recorder).add_subclass(Simulation))
}

/// An arm of simulated drives in virtual time, whatever interfaces the configuration has.
#[pyfunction]
#[pyo3(signature = (config))]
pub fn simulate(py: Python<'_>, config: Bound<'_, PyAny>) -> PyResult<Py<Simulation>> {
    Py::new(py, Simulation::new(py, config)?)
}

#[pymethods]
impl Simulation {
    /// As `takt.simulate`.
    #[new]
    #[pyo3(signature = (config))]
    fn new(py: Python<'_>, config: Bound<'_, PyAny>) -> PyResult<PyClassInitializer<Self>> {
        start(py, &self::config(&config, None, false)?)
    }

    /// Lets this many cycles pass.
    #[pyo3(signature = (cycles=1))]
    fn step(slf: PyRef<'_, Self>, py: Python<'_>, cycles: u64) -> PyResult<()> {
        let arm = slf.as_super();
        let controller = arm.as_super().link.controller(py)?;
        let owner = &arm.owner;
        let mut left = cycles;
        while left > 0 {
            let slice = left.min(SLICE);
            if py.detach(|| owner.step(slice)) != Some(slice) {
                return Err(raise_ended(py));
            }
            left -= slice;
            look_for_signals(py, controller)?;
        }
        Ok(())
    }

    /// Lets a time pass, rounded up to whole cycles.
    fn run(slf: PyRef<'_, Self>, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let time = duration(py, "seconds", seconds)?;
        let period_ns = slf.as_super().as_super().link.controller(py)?.period_ns().max(1);
        let cycles = u64::try_from(time.as_nanos().div_ceil(period_ns.into()));
        let cycles =
            cycles.map_err(|_| raise(py, "ArgumentError", &format!("{seconds} s is too long"), &[]))?;
        Self::step(slf, py, cycles)
    }
}
