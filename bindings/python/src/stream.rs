//! A stream: points of any rate, stamped with the time that they are meant for.

use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use takt::rt::PositionPoint;
use takt::{
    AxisPoint, CommandError, Handle, MotionError, Snapshot, StopCategory, StreamError, StreamHandle,
    StreamState, WaitError,
};

use crate::array::{self, Table};
use crate::error::{raise, raise_command, raise_ended, raise_motion, raise_stopped, raise_stream};
use crate::group::Commanded;
use crate::link::{Link, duration, seconds};
use crate::waiting::until;

/// Slower than this an axis is at rest: rad/s or m/s. The last of a motion fades in the rounding of its numbers.
const AT_REST: f64 = 1e-9;

/// Every stop within the limits is shorter.
const STANDSTILL_S: f64 = 30.0;

/// A stream that a group follows.
#[pyclass(module = "takt", frozen)]
pub struct Stream {
    link: Link,
    commanded: Commanded,
    stream: StreamHandle,
    axes: Vec<usize>,
}

/// The parts of a point, or of points, each a row for each point.
struct Parts {
    rows: usize,
    q: Option<Table>,
    qd: Option<Table>,
    qdd: Option<Table>,
    torque: Option<Table>,
    kp: Option<Vec<f64>>,
    kd: Option<Vec<f64>>,
}

/// What a point may say beside its positions, as it was given.
struct Given<'a, 'py> {
    q: Option<&'a Bound<'py, PyAny>>,
    qd: Option<&'a Bound<'py, PyAny>>,
    qdd: Option<&'a Bound<'py, PyAny>>,
    torque: Option<&'a Bound<'py, PyAny>>,
    kp: Option<&'a Bound<'py, PyAny>>,
    kd: Option<&'a Bound<'py, PyAny>>,
}

impl Given<'_, '_> {
    /// `rows` reads a value for each axis, in each of one or more points.
    fn read(
        &self,
        axes: usize,
        rows: impl Fn(&str, &Bound<'_, PyAny>) -> PyResult<Table>,
    ) -> PyResult<Parts> {
        let read =
            |what: &str, given: Option<&Bound<'_, PyAny>>| given.map(|given| rows(what, given)).transpose();
        let gains = |what: &str, given: Option<&Bound<'_, PyAny>>| {
            given.map(|given| array::vector_or_one(what, given, axes)).transpose()
        };
        let (q, qd, qdd) = (read("q", self.q)?, read("qd", self.qd)?, read("qdd", self.qdd)?);
        let torque = read("torque", self.torque)?;
        let parts = [("q", &q), ("qd", &qd), ("qdd", &qdd), ("torque", &torque)];
        let count = parts.iter().find_map(|(_, table)| table.as_ref()).map_or(0, |table| table.rows);
        for (what, table) in parts {
            if let Some(table) = table.as_ref().filter(|table| (table.rows, table.columns) != (count, axes)) {
                return Err(pyo3::exceptions::PyValueError::new_err(format!(
                    "{what} has the shape ({}, {}) for {count} points of {axes} axes",
                    table.rows, table.columns
                )));
            }
        }
        Ok(Parts { rows: count, q, qd, qdd, torque, kp: gains("kp", self.kp)?, kd: gains("kd", self.kd)? })
    }
}

impl Parts {
    /// What a point says of an axis; `None` where the parts do not belong together.
    fn point(&self, row: usize, axis: usize) -> Option<AxisPoint> {
        let of = |table: &Option<Table>| {
            table.as_ref().and_then(|table| table.values.get(row * table.columns + axis)).copied()
        };
        let gain = |gains: &Option<Vec<f64>>| gains.as_ref().and_then(|gains| gains.get(axis)).copied();
        let (q, qd, qdd, torque) = (of(&self.q), of(&self.qd), of(&self.qdd), of(&self.torque));
        let (kp, kd) = (gain(&self.kp), gain(&self.kd));
        match (q, qd, qdd, torque, kp.or(kd)) {
            (Some(position), velocity, acceleration, torque, None) => {
                let motion = PositionPoint { position, velocity, acceleration };
                Some(AxisPoint::motion(motion).with_torque(torque.unwrap_or(0.0)))
            }
            (Some(position), velocity, acceleration, torque, Some(_)) => {
                let motion = PositionPoint { position, velocity, acceleration };
                let soft = AxisPoint::motion(motion).with_torque(torque.unwrap_or(0.0));
                Some(soft.with_impedance(kp.unwrap_or(0.0), kd.unwrap_or(0.0)))
            }
            (None, Some(velocity), None, None, None) => Some(AxisPoint::Velocity(velocity)),
            (None, None, None, Some(torque), None) => Some(AxisPoint::Torque(torque)),
            (None, ..) => None,
        }
    }

    fn points(&self, py: Python<'_>, axes: usize) -> PyResult<Vec<Vec<AxisPoint>>> {
        let row = |row| (0..axes).map(|axis| self.point(row, axis)).collect::<Option<Vec<_>>>();
        (0..self.rows).map(row).collect::<Option<_>>().filter(|_| self.rows > 0).ok_or_else(|| {
            let words =
                "a point has positions, with or without the rest; or velocities alone; or torques alone";
            raise(py, "ArgumentError", words, &[])
        })
    }
}

impl Stream {
    pub const fn new(link: Link, commanded: Commanded, stream: StreamHandle, axes: Vec<usize>) -> Self {
        Self { link, commanded, stream, axes }
    }

    fn names(&self) -> Vec<&str> {
        self.link.names_of(&self.axes)
    }

    /// Points are for a group that follows them.
    fn check_followed(&self, py: Python<'_>, handle: &Handle) -> PyResult<()> {
        if self.stream.report().state != StreamState::Idle {
            return Ok(());
        }
        match self.commanded.fault(handle) {
            Some(stopped) => Err(raise_stopped(py, &self.link.axis_names(), &stopped)),
            None if handle.has_ended() => Err(raise_ended(py)),
            None => {
                let words = "the axes no longer follow the stream: a stop or another motion has ended it; begin a new one";
                Err(raise(py, "StreamError", words, &[]))
            }
        }
    }

    /// A stamp in nanoseconds of the controller's clock.
    fn stamp(&self, handle: &Handle, t: Option<f64>) -> PyResult<u64> {
        match t {
            None => Ok(handle.now_ns()),
            Some(t) => Ok(duration("t", t)?.as_nanos() as u64),
        }
    }

    fn handed(&self, py: Python<'_>, result: Result<(), StreamError>) -> PyResult<()> {
        result.map_err(|error| raise_stream(py, &self.names(), &error))
    }

    /// Stops the axes and waits until they hold, or are off.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        match self.commanded.stop(self.link.handle(py)?, StopCategory::Two) {
            Ok(()) => self.commanded.wait_until_still(py, &self.link, &self.axes, Some(STANDSTILL_S)),
            // The end of the run has stopped them.
            Err(CommandError::Ended) => Ok(()),
            Err(error) => Err(raise_command(py, &self.names(), &error)),
        }
    }
}

#[pymethods]
impl Stream {
    /// Hands over a point that is meant for the time `t`, or for now.
    #[pyo3(signature = (q=None, qd=None, t=None, *, qdd=None, torque=None, kp=None, kd=None))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn push(
        &self,
        py: Python<'_>,
        q: Option<&Bound<'_, PyAny>>,
        qd: Option<&Bound<'_, PyAny>>,
        t: Option<f64>,
        qdd: Option<&Bound<'_, PyAny>>,
        torque: Option<&Bound<'_, PyAny>>,
        kp: Option<&Bound<'_, PyAny>>,
        kd: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let handle = self.link.handle(py)?;
        let row = |what: &str, given: &Bound<'_, PyAny>| {
            let values = array::vector(what, given)?;
            Ok(Table { rows: 1, columns: values.len(), values })
        };
        let parts = Given { q, qd, qdd, torque, kp, kd }.read(self.axes.len(), row)?;
        let points = parts.points(py, self.axes.len())?;
        self.check_followed(py, handle)?;
        let at_ns = self.stamp(handle, t)?;
        let handed = py.detach(|| points.iter().try_for_each(|point| self.stream.push(at_ns, point)));
        self.handed(py, handed)
    }

    /// Hands over points at equal intervals, the first of which is meant for `t0`, or for now. They take the place of every earlier
    /// point from there on.
    #[pyo3(signature = (t0, dt, q=None, qd=None, *, qdd=None, torque=None, kp=None, kd=None))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn push_chunk(
        &self,
        py: Python<'_>,
        t0: Option<f64>,
        dt: f64,
        q: Option<&Bound<'_, PyAny>>,
        qd: Option<&Bound<'_, PyAny>>,
        qdd: Option<&Bound<'_, PyAny>>,
        torque: Option<&Bound<'_, PyAny>>,
        kp: Option<&Bound<'_, PyAny>>,
        kd: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let handle = self.link.handle(py)?;
        let interval = duration("dt", dt)?;
        let parts = Given { q, qd, qdd, torque, kp, kd }.read(self.axes.len(), array::table)?;
        let points = parts.points(py, self.axes.len())?;
        self.check_followed(py, handle)?;
        let from_ns = self.stamp(handle, t0)?;
        let handed = py.detach(|| self.stream.push_chunk(from_ns, interval, &points));
        self.handed(py, handed)
    }

    /// What it is doing: "awaited", "following", "dry", "idle".
    #[getter]
    fn state(&self, py: Python<'_>) -> PyResult<&'static str> {
        self.link.handle(py)?;
        Ok(self.stream.report().state.name())
    }

    /// How far the set-points are behind the stamps now, in seconds.
    #[getter]
    fn lag(&self, py: Python<'_>) -> PyResult<f64> {
        self.link.handle(py)?;
        Ok(self.stream.lag().as_secs_f64())
    }

    /// The points that have come, that came too late for their time, and that were lost.
    #[getter]
    fn counts(&self, py: Python<'_>) -> PyResult<(u64, u64, u64)> {
        self.link.handle(py)?;
        let counts = self.stream.report().counts;
        Ok((counts.points, counts.late_points, counts.lost_points))
    }

    /// Waits until the last point has been followed, and ends the stream: the axes hold.
    #[pyo3(signature = (timeout=None))]
    fn finish(&self, py: Python<'_>, timeout: Option<f64>) -> PyResult<()> {
        let late = "the points of the stream have not run out in time";
        let is_at_rest = |state: &Snapshot| {
            let mut axes = self.axes.iter().filter_map(|axis| state.axes().get(*axis));
            axes.all(|axis| axis.velocity_set.abs() < AT_REST)
        };
        let is_over = until(py, &self.link, timeout, late, |handle, at_most| {
            let over = handle.wait_until(at_most, |state| match self.stream.report().state {
                StreamState::Following => None,
                StreamState::Dry => is_at_rest(state).then_some(()),
                StreamState::Idle | StreamState::Awaited | StreamState::Callback => Some(()),
            });
            match over {
                Err(WaitError::NotInTime) => None,
                over => Some(over),
            }
        })?;
        let handle = self.link.handle(py)?;
        if let Some(stopped) = self.commanded.fault(handle) {
            return Err(raise_stopped(py, &self.link.axis_names(), &stopped));
        }
        if is_over.is_err() {
            return Err(raise_motion(py, &self.names(), &MotionError::Ended));
        }
        if self.stream.report().state == StreamState::Idle { Ok(()) } else { self.stop(py) }
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    /// Waits for the last point; after an exception the axes stop at once.
    #[pyo3(signature = (*exception))]
    fn __exit__(&self, py: Python<'_>, exception: &Bound<'_, PyTuple>) -> PyResult<()> {
        let is_raised = exception.get_item(0).is_ok_and(|class| !class.is_none());
        if !is_raised {
            return self.finish(py, None);
        }
        // The exception is what its owner is to see, whatever becomes of the stop.
        let _ = self.stop(py);
        Ok(())
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let handle = self.link.handle(py)?;
        let age = Duration::from_nanos(self.stream.report().counts.lag_ns);
        Ok(format!(
            "<stream {}, {age:?} behind, at {:.3} s>",
            self.stream.report().state.name(),
            seconds(handle.now_ns())
        ))
    }
}
