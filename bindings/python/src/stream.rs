//! A stream: points of any rate, stamped with the time that they are meant for.

use std::sync::Arc;
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use takt::rt::{PositionPoint, RequestTarget};
use takt::{
    AnyHandle, AxisPoint, CommandError, MotionError, Snapshot, StopCategory, StreamError, StreamState,
    WaitError,
};

use crate::array::{self, Table};
use crate::error::{raise_argument, raise_command, raise_motion, raise_stopped, raise_stream};
use crate::link::{Link, duration, seconds};
use crate::waiting::{stop_and_wait, until};

/// Slower than this an axis is at rest: rad/s or m/s. The last of a motion fades in the rounding of its numbers.
const AT_REST: f64 = 1e-9;

/// Every stop within the limits is shorter.
const STANDSTILL_S: f64 = 30.0;

/// A stream that a group follows.
#[pyclass(module = "takt", frozen)]
pub struct Stream {
    link: Link,
    target: RequestTarget,
    axes: Arc<[usize]>,
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
        py: Python<'_>,
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
            let words = match table {
                Some(Table { rows: 1, columns, .. }) if count == 1 && *columns != axes => {
                    format!("{what} has {columns} values for {axes} axes")
                }
                Some(Table { rows, columns, .. }) if (*rows, *columns) != (count, axes) => {
                    format!("{what} has the shape ({rows}, {columns}) for {count} points of {axes} axes")
                }
                _ => continue,
            };
            return Err(raise_argument(py, &words));
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

    /// One point, for each of so many axes.
    fn row(&self, py: Python<'_>, row: usize, axes: usize) -> PyResult<Vec<AxisPoint>> {
        let mut points = Vec::with_capacity(axes);
        points.extend((0..axes).map_while(|axis| self.point(row, axis)));
        if row < self.rows && points.len() == axes {
            return Ok(points);
        }
        let words = "a point has positions, with or without the rest; or velocities alone; or torques alone";
        Err(raise_argument(py, words))
    }
}

impl Stream {
    pub const fn new(link: Link, target: RequestTarget, axes: Arc<[usize]>) -> Self {
        Self { link, target, axes }
    }

    fn names(&self) -> Vec<&str> {
        self.link.names_of(&self.axes)
    }

    /// A stamp in nanoseconds of the controller's clock.
    fn stamp(&self, py: Python<'_>, controller: &AnyHandle, what: &str, t: Option<f64>) -> PyResult<u64> {
        match t {
            None => Ok(controller.now_ns()),
            Some(t) => Ok(u64::try_from(duration(py, what, t)?.as_nanos()).unwrap_or(u64::MAX)),
        }
    }

    /// A stream that a fault has ended raises the fault.
    fn handed(
        &self,
        py: Python<'_>,
        controller: &AnyHandle,
        result: Result<(), StreamError>,
    ) -> PyResult<()> {
        result.map_err(|error| match (error, controller.of(self.target).fault()) {
            (StreamError::NotStreaming, Some(stopped)) => {
                raise_stopped(py, &self.link.axis_names(), &stopped)
            }
            (error, _) => raise_stream(py, &self.names(), &error),
        })
    }

    /// Stops the axes and waits until they hold, or are off.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        match stop_and_wait(py, &self.link, self.target, StopCategory::Two, Some(STANDSTILL_S))? {
            // The end of the run has stopped them.
            Ok(()) | Err(CommandError::Ended) => Ok(()),
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
        let controller = self.link.controller(py)?;
        let row = |what: &str, given: &Bound<'_, PyAny>| {
            let values = array::vector(what, given)?;
            Ok(Table { rows: 1, columns: values.len(), values })
        };
        let parts = Given { q, qd, qdd, torque, kp, kd }.read(py, self.axes.len(), row)?;
        let point = parts.row(py, 0, self.axes.len())?;
        let at_ns = self.stamp(py, controller, "t", t)?;
        let handed = py.detach(|| controller.of(self.target).stream().push(at_ns, &point));
        self.handed(py, controller, handed)
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
        let controller = self.link.controller(py)?;
        let interval = duration(py, "dt", dt)?;
        let parts = Given { q, qd, qdd, torque, kp, kd }.read(py, self.axes.len(), array::table)?;
        // A chunk without points is refused as a point without parts is.
        let rows = 0..parts.rows.max(1);
        let points = rows.map(|row| parts.row(py, row, self.axes.len())).collect::<PyResult<Vec<_>>>()?;
        let from_ns = self.stamp(py, controller, "t0", t0)?;
        let handed = py.detach(|| controller.of(self.target).stream().push_chunk(from_ns, interval, &points));
        self.handed(py, controller, handed)
    }

    /// What it is doing: "awaited", "following", "dry", "idle".
    #[getter]
    fn state(&self, py: Python<'_>) -> PyResult<&'static str> {
        Ok(self.link.controller(py)?.of(self.target).stream().report().state.name())
    }

    /// How far the set-points are behind the stamps now, in seconds.
    #[getter]
    fn lag(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(seconds(self.link.controller(py)?.of(self.target).stream().report().counts.lag_ns))
    }

    /// The points that have come, that came too late for their time, and that were lost.
    #[getter]
    fn counts(&self, py: Python<'_>) -> PyResult<(u64, u64, u64)> {
        let counts = self.link.controller(py)?.of(self.target).stream().report().counts;
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
        let is_over = until(py, &self.link, timeout, late, |controller, at_most| {
            let over = controller.wait_until(at_most, |state| {
                let is_over = match controller.of(self.target).stream().report().state {
                    StreamState::Following => false,
                    StreamState::Dry => is_at_rest(state),
                    StreamState::Idle | StreamState::Awaited | StreamState::Callback => true,
                };
                is_over.then_some(())
            });
            match over {
                Err(WaitError::NotInTime) => None,
                over => Some(over),
            }
        })?;
        let controller = self.link.controller(py)?;
        if let Some(stopped) = controller.of(self.target).fault() {
            return Err(raise_stopped(py, &self.link.axis_names(), &stopped));
        }
        if is_over.is_err() {
            return Err(raise_motion(py, &self.names(), &MotionError::Ended));
        }
        match controller.of(self.target).stream().report().state {
            StreamState::Idle => Ok(()),
            _ => self.stop(py),
        }
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

    fn __repr__(&self) -> String {
        let Some(controller) = self.link.usable() else { return "<stream of a closed arm>".to_owned() };
        let report = controller.of(self.target).stream().report();
        let lag = Duration::from_nanos(report.counts.lag_ns);
        format!("<stream {}, {lag:?} behind the stamps>", report.state.name())
    }
}
