//! A motion under way.

use pyo3::prelude::*;
use takt::{AnyHandle, MotionError, MotionId};

use crate::error::{raise_command, raise_motion};
use crate::link::Link;
use crate::waiting::until;

/// A motion that has begun.
#[pyclass(module = "takt", frozen)]
pub struct Motion {
    link: Link,
    id: MotionId,
}

impl Motion {
    pub const fn new(link: Link, id: MotionId) -> Self {
        Self { link, id }
    }

    fn command(
        &self,
        py: Python<'_>,
        command: impl FnOnce(&AnyHandle, MotionId) -> Result<(), takt::CommandError> + Send,
    ) -> PyResult<()> {
        let controller = self.link.controller(py)?;
        let commanded = py.detach(|| command(controller, self.id));
        commanded.map_err(|error| raise_command(py, &self.link.axis_names(), &error))
    }
}

#[pymethods]
impl Motion {
    /// Waits until the axes are at rest at their targets. Ctrl-C stops them.
    #[pyo3(signature = (timeout=None))]
    pub fn wait(&self, py: Python<'_>, timeout: Option<f64>) -> PyResult<()> {
        let late = MotionError::NotInTime.to_string();
        let result =
            until(py, &self.link, timeout, &late, |arm, at_most| match arm.wait(self.id, at_most) {
                Err(MotionError::NotInTime) => None,
                result => Some(result),
            })?;
        result.map_err(|error| raise_motion(py, &self.link.axis_names(), &error))
    }

    /// Whether it has ended, however it has.
    #[getter]
    fn is_done(&self, py: Python<'_>) -> PyResult<bool> {
        Ok(self.link.controller(py)?.result_of(self.id).is_some())
    }

    /// Changes the speed along the path of a trajectory: 1 as it was written.
    fn set_speed(&self, py: Python<'_>, rate: f64) -> PyResult<()> {
        self.command(py, |arm, id| arm.set_speed(id, rate))
    }

    /// Brings the axes to rest on the path of a trajectory.
    fn pause(&self, py: Python<'_>) -> PyResult<()> {
        self.command(py, |arm, id| arm.pause(id))
    }

    /// Goes on with a trajectory that was paused.
    fn resume(&self, py: Python<'_>) -> PyResult<()> {
        self.command(py, |arm, id| arm.resume(id))
    }

    /// Of a trajectory: its time on the path, the time of its last point, and how fast it passes; None of any other motion.
    #[getter]
    fn progress(&self, py: Python<'_>) -> PyResult<Option<(f64, f64, f64)>> {
        let controller = self.link.controller(py)?;
        let progress = py.detach(|| controller.trajectory_progress(self.id));
        let progress = progress.map_err(|error| raise_command(py, &self.link.axis_names(), &error))?;
        Ok(progress.map(|progress| (progress.path_s, progress.of_s, progress.rate)))
    }

    fn __repr__(&self) -> String {
        match self.link.usable().map(|controller| controller.result_of(self.id)) {
            None => "<motion of a closed arm>".to_owned(),
            Some(None) => "<motion under way>".to_owned(),
            Some(Some(Ok(()))) => "<motion at its target>".to_owned(),
            Some(Some(Err(error))) => format!("<motion: {error}>"),
        }
    }
}
