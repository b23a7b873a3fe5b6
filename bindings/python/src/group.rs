//! What an arm, or a group of its axes, can be told, and the axes themselves.

use std::sync::Arc;
use std::time::Duration;

use pyo3::prelude::*;
use takt::config::{MODES, mode_word};
use takt::rt::RequestTarget;
use takt::{
    AnyHandle, CommandError, MotionId, MoveOptions, OperationMode, Phase, StopCategory, TrajectoryPoint,
    WaitError,
};

use crate::array;
use crate::error::{raise, raise_command, raise_ended, raise_stopped};
use crate::link::{Link, duration};
use crate::motion::Motion;
use crate::state::State;
use crate::stream::Stream;
use crate::waiting::{longest, stop_and_wait, until};

/// An axis, as the configuration has it. rad, rad/s, rad/s², rad/s³ and N·m; m and N of a linear axis.
#[pyclass(module = "takt", frozen, get_all)]
pub struct Axis {
    name: String,
    position_min: f64,
    position_max: f64,
    velocity: f64,
    acceleration: f64,
    deceleration: f64,
    jerk: f64,
    torque: f64,
    modes: Vec<&'static str>,
}

#[pymethods]
impl Axis {
    fn __repr__(&self) -> String {
        let Self { name, position_min, position_max, velocity, .. } = self;
        format!("Axis({name:?}, position {position_min} to {position_max}, velocity {velocity})")
    }
}

/// Axes that move together.
#[pyclass(module = "takt", frozen, subclass)]
pub struct Group {
    pub link: Link,
    /// Whom commands are for.
    target: RequestTarget,
    name: String,
    /// The numbers of the axes.
    axes: Arc<[usize]>,
}

impl Group {
    /// All axes of a controller.
    pub fn all(link: Link, controller: &AnyHandle) -> Self {
        let target = RequestTarget::All;
        let (name, axes) = (controller.machine().name.clone(), controller.of(target).axis_numbers().into());
        Self { link, target, name, axes }
    }

    /// The group with this name.
    pub fn named(&self, py: Python<'_>, name: &str) -> PyResult<Self> {
        let controller = self.link.controller(py)?;
        let target = controller.group(name).map_err(|error| self.command_error(py, &error))?.target();
        let axes = controller.of(target).axis_numbers().into();
        Ok(Self { link: self.link.clone(), target, name: name.to_owned(), axes })
    }

    /// Its name, and what its axes are doing, for the text of an object.
    pub fn shown(&self, controller: &AnyHandle) -> (&str, &'static str) {
        (&self.name, State::of(&self.link, controller, &self.axes, self.target).phase())
    }

    fn axis_names(&self) -> Vec<&str> {
        self.link.names_of(&self.axes)
    }

    fn command_error(&self, py: Python<'_>, error: &CommandError) -> PyErr {
        raise_command(py, &self.axis_names(), error)
    }

    /// Does what may wait for a cycle or two, without the interpreter's lock.
    fn command<T: Send>(
        &self,
        py: Python<'_>,
        command: impl FnOnce(&AnyHandle, RequestTarget) -> Result<T, CommandError> + Send,
    ) -> PyResult<T> {
        let controller = self.link.controller(py)?;
        let commanded = py.detach(|| command(controller, self.target));
        commanded.map_err(|error| self.command_error(py, &error))
    }

    /// A motion that has begun, at its end if that is to be waited for.
    fn begun(&self, py: Python<'_>, id: MotionId, wait: bool, timeout: Option<f64>) -> PyResult<Motion> {
        let motion = Motion::new(self.link.clone(), id);
        if wait {
            motion.wait(py, timeout)?;
        }
        Ok(motion)
    }

    /// Waits until every axis is in a phase. A new fault ends the wait.
    fn wait_for_phase(
        &self,
        py: Python<'_>,
        phase: Phase,
        timeout: Option<f64>,
        words: &str,
    ) -> PyResult<()> {
        let reached = until(py, &self.link, timeout, words, |controller, at_most| {
            match controller.of(self.target).wait_for(phase, at_most) {
                Err(WaitError::NotInTime) => {
                    controller.of(self.target).fault().map(|stopped| Err(Some(stopped)))
                }
                Ok(()) => Some(Ok(())),
                Err(WaitError::Ended) => Some(Err(None)),
            }
        })?;
        reached.map_err(|fault| match fault {
            Some(stopped) => raise_stopped(py, &self.link.axis_names(), &stopped),
            None => raise_ended(py),
        })
    }

    fn axis_number(&self, py: Python<'_>, axis: &Bound<'_, PyAny>) -> PyResult<usize> {
        let names = self.axis_names();
        let place = match axis.extract::<String>() {
            Ok(name) => names.iter().position(|own| *own == name).ok_or(name),
            Err(_) => {
                let place: usize = axis.extract()?;
                if place < names.len() { Ok(place) } else { Err(place.to_string()) }
            }
        };
        let number = place.map(|place| self.axes.get(place).copied().unwrap_or(place));
        number.map_err(|given| {
            let words = format!("there is no axis {given}: the axes are: {}", names.join(", "));
            raise(py, "ArgumentError", &words, &[])
        })
    }
}

#[pymethods]
impl Group {
    /// The name in the configuration.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// The axes, in the order in which values are given and returned.
    #[getter]
    fn axes(&self, py: Python<'_>) -> PyResult<Vec<Axis>> {
        let controller = self.link.controller(py)?;
        let known = &controller.machine().axes;
        let of = |number: &usize| Some((known.get(*number)?, controller.axis_properties(*number)?));
        let axes = self.axes.iter().filter_map(of).map(|(named, axis)| Axis {
            name: named.name.clone(),
            position_min: axis.limits.position_min,
            position_max: axis.limits.position_max,
            velocity: axis.limits.velocity,
            acceleration: axis.limits.acceleration,
            deceleration: axis.limits.deceleration,
            jerk: axis.limits.jerk,
            torque: axis.limits.torque,
            modes: axis.modes.iter().map(|mode| mode_word(*mode)).collect(),
        });
        Ok(axes.collect())
    }

    /// The state after the newest complete cycle.
    #[getter]
    fn state(&self, py: Python<'_>) -> PyResult<State> {
        Ok(State::of(&self.link, self.link.controller(py)?, &self.axes, self.target))
    }

    /// Moves every axis to its target, where all come to rest at the same time.
    #[pyo3(name = "move", signature = (q, *, speed=1.0, acceleration=1.0, duration=0.0, wait=true, timeout=None))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn move_to(
        &self,
        py: Python<'_>,
        q: &Bound<'_, PyAny>,
        speed: f64,
        acceleration: f64,
        duration: f64,
        wait: bool,
        timeout: Option<f64>,
    ) -> PyResult<Motion> {
        longest(py, timeout)?;
        let target = array::vector("q", q)?;
        let options = MoveOptions {
            velocity_scale: speed,
            acceleration_scale: acceleration,
            minimum_duration_s: duration,
        };
        let id = self.command(py, |arm, whose| arm.of(whose).move_with(&target, options))?;
        self.begun(py, id, wait, timeout)
    }

    /// Moves through waypoints without stopping, to rest at the last one.
    #[pyo3(signature = (waypoints, *, wait=true, timeout=None))]
    fn move_through(
        &self,
        py: Python<'_>,
        waypoints: &Bound<'_, PyAny>,
        wait: bool,
        timeout: Option<f64>,
    ) -> PyResult<Motion> {
        longest(py, timeout)?;
        let waypoints: Vec<Vec<f64>> =
            array::table("waypoints", waypoints)?.rows().map(<[f64]>::to_vec).collect();
        let id = self.command(py, |arm, whose| arm.of(whose).move_through(&waypoints))?;
        self.begun(py, id, wait, timeout)
    }

    /// Carries out points with times, which are checked as a whole before anything moves.
    #[pyo3(signature = (times, q, qd=None, qdd=None, *, wait=true, timeout=None))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn execute(
        &self,
        py: Python<'_>,
        times: &Bound<'_, PyAny>,
        q: &Bound<'_, PyAny>,
        qd: Option<&Bound<'_, PyAny>>,
        qdd: Option<&Bound<'_, PyAny>>,
        wait: bool,
        timeout: Option<f64>,
    ) -> PyResult<Motion> {
        longest(py, timeout)?;
        let times = array::vector("times", times)?;
        let positions = array::table("q", q)?;
        let velocities = qd.map(|qd| array::table("qd", qd)).transpose()?;
        let accelerations = qdd.map(|qdd| array::table("qdd", qdd)).transpose()?;
        let tables = [("q", Some(&positions)), ("qd", velocities.as_ref()), ("qdd", accelerations.as_ref())];
        for (what, table) in tables {
            if let Some(table) = table.filter(|table| table.rows != times.len()) {
                let words = format!("{what} has {} points for {} times", table.rows, times.len());
                return Err(raise(py, "ArgumentError", &words, &[]));
            }
        }
        let mut points: Vec<TrajectoryPoint> = (times.iter().zip(positions.rows()))
            .map(|(time_s, q)| TrajectoryPoint {
                time_s: *time_s,
                positions: q.to_vec(),
                ..Default::default()
            })
            .collect();
        for (point, qd) in points.iter_mut().zip(velocities.iter().flat_map(array::Table::rows)) {
            point.velocities = qd.to_vec();
        }
        for (point, qdd) in points.iter_mut().zip(accelerations.iter().flat_map(array::Table::rows)) {
            point.accelerations = qdd.to_vec();
        }
        let id = self.command(py, |arm, whose| arm.of(whose).execute(&points))?;
        self.begun(py, id, wait, timeout)
    }

    /// Begins to follow a stream of points, until the stream is closed.
    fn follow(&self, py: Python<'_>) -> PyResult<Stream> {
        self.command(py, |arm, whose| arm.of(whose).begin_stream())?;
        Ok(Stream::new(self.link.clone(), self.target, Arc::clone(&self.axes)))
    }

    /// Waits for a motion: the same as its own `wait`.
    #[pyo3(signature = (motion, timeout=None))]
    fn wait(&self, py: Python<'_>, motion: &Motion, timeout: Option<f64>) -> PyResult<()> {
        motion.wait(py, timeout)
    }

    /// Asks for a stop of this category (IEC 60204-1), and returns at once, or when the axes are at rest.
    #[pyo3(signature = (category=2, *, wait=false, timeout=30.0))]
    fn stop(&self, py: Python<'_>, category: u8, wait: bool, timeout: Option<f64>) -> PyResult<()> {
        let category = match category {
            0 => StopCategory::Zero,
            1 => StopCategory::One,
            2 => StopCategory::Two,
            other => {
                let words = format!("there is no stop of category {other}: 0, 1 and 2 are there");
                return Err(raise(py, "ArgumentError", &words, &[]));
            }
        };
        let stopped = match wait {
            true => stop_and_wait(py, &self.link, self.target, category, timeout)?,
            false => self.link.controller(py)?.of(self.target).stop(category),
        };
        stopped.map_err(|error| self.command_error(py, &error))
    }

    /// Enables the axes again, and waits until they hold. It does nothing where they hold already.
    #[pyo3(signature = (timeout=30.0))]
    fn enable(&self, py: Python<'_>, timeout: Option<f64>) -> PyResult<()> {
        let controller = self.link.controller(py)?;
        longest(py, timeout)?;
        let is_enabled = controller.of(self.target).wait_for(Phase::Holding, Duration::ZERO).is_ok();
        if is_enabled && controller.of(self.target).fault().is_none() {
            return Ok(());
        }
        self.command(py, |arm, whose| arm.of(whose).enable())?;
        self.wait_for_phase(py, Phase::Holding, timeout, "the axes have not been enabled in time")
    }

    /// Brings the axes to rest and disables them, and waits for that.
    #[pyo3(signature = (timeout=30.0))]
    fn disable(&self, py: Python<'_>, timeout: Option<f64>) -> PyResult<()> {
        longest(py, timeout)?;
        self.command(py, |arm, whose| arm.of(whose).disable())?;
        self.wait_for_phase(py, Phase::Disabled, timeout, "the axes have not been disabled in time")
    }

    /// Clears the fault that has stopped the axes. They stay disabled.
    fn clear_fault(&self, py: Python<'_>) -> PyResult<()> {
        self.command(py, |arm, whose| arm.of(whose).reset_faults())
    }

    /// Changes the mode of operation of every axis, or of one.
    #[pyo3(signature = (mode, axis=None, *, timeout=5.0))]
    fn change_mode(
        &self,
        py: Python<'_>,
        mode: &str,
        axis: Option<&Bound<'_, PyAny>>,
        timeout: Option<f64>,
    ) -> PyResult<()> {
        longest(py, timeout)?;
        let mode = operation_mode(py, mode)?;
        let id = match axis {
            None => self.command(py, |arm, whose| arm.of(whose).change_mode(mode))?,
            Some(axis) => {
                let axis = self.axis_number(py, axis)?;
                self.command(py, |arm, _| arm.change_axis_mode(axis, mode))?
            }
        };
        Motion::new(self.link.clone(), id).wait(py, timeout)
    }

    /// Gives an axis in profile velocity a velocity, for as long as it is valid.
    #[pyo3(signature = (axis, velocity, *, valid_for=0.1))]
    fn drive_velocity(
        &self,
        py: Python<'_>,
        axis: &Bound<'_, PyAny>,
        velocity: f64,
        valid_for: f64,
    ) -> PyResult<Motion> {
        self.drive(py, axis, valid_for, |arm, axis, valid_for| arm.velocity(axis, velocity, valid_for))
    }

    /// Gives an axis in profile torque a torque, for as long as it is valid.
    #[pyo3(signature = (axis, torque, *, valid_for=0.1))]
    fn drive_torque(
        &self,
        py: Python<'_>,
        axis: &Bound<'_, PyAny>,
        torque: f64,
        valid_for: f64,
    ) -> PyResult<Motion> {
        self.drive(py, axis, valid_for, |arm, axis, valid_for| arm.torque(axis, torque, valid_for))
    }

    fn __repr__(&self) -> String {
        format!("<group {:?} of {}>", self.name, self.axis_names().join(", "))
    }
}

impl Group {
    fn drive(
        &self,
        py: Python<'_>,
        axis: &Bound<'_, PyAny>,
        valid_for: f64,
        drive: impl FnOnce(&AnyHandle, usize, Duration) -> Result<MotionId, CommandError> + Send,
    ) -> PyResult<Motion> {
        let axis = self.axis_number(py, axis)?;
        let valid_for = duration(py, "valid_for", valid_for)?;
        let id = self.command(py, |arm, _| drive(arm, axis, valid_for))?;
        Ok(Motion::new(self.link.clone(), id))
    }
}

fn operation_mode(py: Python<'_>, word: &str) -> PyResult<OperationMode> {
    MODES.iter().find(|(own, _)| *own == word).map(|(_, mode)| *mode).ok_or_else(|| {
        let known: Vec<&str> = MODES.iter().map(|(word, _)| *word).collect();
        let words = format!("there is no mode {word:?}: the modes are: {}", known.join(", "));
        raise(py, "ArgumentError", &words, &[])
    })
}
