//! The exceptions of `takt.errors`, with the words of the library's errors and their fields as attributes.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyString;
use takt::{
    CommandError, ConfigError, LeaseError, MotionError, Refused, StartFailure, Stopped, StreamError,
    TrajectoryError, WaitError,
};

static ERRORS: PyOnceLock<Py<PyModule>> = PyOnceLock::new();

/// A field of an exception.
pub enum Field {
    None,
    Number(f64),
    Count(usize),
    Text(String),
}

impl Field {
    fn object<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(match self {
            Self::None => py.None().into_bound(py),
            Self::Number(number) => number.into_pyobject(py)?.into_any(),
            Self::Count(count) => count.into_pyobject(py)?.into_any(),
            Self::Text(text) => PyString::new(py, text).into_any(),
        })
    }
}

impl<T: Into<Self>> From<Option<T>> for Field {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::None, Into::into)
    }
}

impl From<usize> for Field {
    fn from(count: usize) -> Self {
        Self::Count(count)
    }
}

impl From<f64> for Field {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<String> for Field {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

/// An exception of this class, with these words and attributes.
pub fn raise(py: Python<'_>, class: &str, words: &str, fields: &[(&str, Field)]) -> PyErr {
    let made = || {
        let errors = ERRORS.get_or_try_init(py, || py.import("takt.errors").map(Bound::unbind))?;
        let error = errors.bind(py).getattr(class)?.call1((words,))?;
        for (name, field) in fields {
            error.setattr(*name, field.object(py)?)?;
        }
        Ok(error)
    };
    made().map_or_else(|error| error, PyErr::from_value)
}

/// A configuration that cannot be used: each problem at its line.
pub fn raise_config(py: Python<'_>, error: &ConfigError) -> PyErr {
    raise(py, "ConfigError", format!("{error:?}").trim_end(), &[])
}

/// A controller that could not be started.
pub fn raise_start(py: Python<'_>, error: &StartFailure) -> PyErr {
    raise(py, "StartError", format!("{error:?}").trim_end(), &[])
}

/// A command does not fit.
pub fn raise_argument(py: Python<'_>, words: &str) -> PyErr {
    raise(py, "ArgumentError", words, &[])
}

/// The controller has ended.
pub fn raise_ended(py: Python<'_>) -> PyErr {
    raise(py, "EndedError", &WaitError::Ended.to_string(), &[])
}

/// A wait that took too long.
pub fn raise_timeout(py: Python<'_>, words: &str) -> PyErr {
    raise(py, "TimeoutError", words, &[])
}

/// A command that was not executed. `axes` are the names of those that it was for.
pub fn raise_command(py: Python<'_>, axes: &[&str], error: &CommandError) -> PyErr {
    let words = error.naming(axes);
    match error {
        CommandError::OutsideLimits { axis, value, lowest, highest } => {
            let fields = [
                ("axis", axis.clone().into()),
                ("value", (*value).into()),
                ("lowest", (*lowest).into()),
                ("highest", (*highest).into()),
            ];
            raise(py, "LimitError", &words, &fields)
        }
        CommandError::Trajectory(error) => raise_trajectory(py, axes, error),
        CommandError::Count { .. }
        | CommandError::NoSuchAxis { .. }
        | CommandError::NoSuchGroup { .. }
        | CommandError::SeveralGroups { .. }
        | CommandError::Question(_)
        | CommandError::Rate(_) => raise_argument(py, &words),
        CommandError::Refused(refused) => raise_refused(py, refused),
        CommandError::Lease(error) => raise_lease(py, *error),
        CommandError::NoReply { .. } => raise_timeout(py, &words),
        CommandError::Ended => raise_ended(py),
        _ => raise(py, "CommandError", &words, &[]),
    }
}

/// Another process commands, or this one may only observe.
fn raise_lease(py: Python<'_>, error: LeaseError) -> PyErr {
    let process = match error {
        LeaseError::Held { process, .. } | LeaseError::TakenOver { process } => Some(process as usize),
        _ => None,
    };
    raise(py, "LeaseError", &error.to_string(), &[("process", process.into())])
}

fn raise_refused(py: Python<'_>, refused: &Refused) -> PyErr {
    raise(py, "RefusedError", &refused.to_string(), &[])
}

fn raise_trajectory(py: Python<'_>, axes: &[&str], error: &TrajectoryError) -> PyErr {
    let axis = error.axis().and_then(|axis| axes.get(axis)).map(|name| (*name).to_owned());
    let mut fields = vec![("point", Field::from(error.point())), ("axis", axis.into())];
    if let TrajectoryError::Limit { broken, time_s, value, limit, .. } = error {
        fields.extend([
            ("quantity", broken.to_string().into()),
            ("time", (*time_s).into()),
            ("value", (*value).into()),
            ("limit", (*limit).into()),
        ]);
    }
    raise(py, "TrajectoryError", &error.naming(axes), &fields)
}

/// A motion that has not reached its targets.
pub fn raise_motion(py: Python<'_>, axes: &[&str], error: &MotionError) -> PyErr {
    let words = error.to_string();
    match error {
        MotionError::Stopped(stopped) => raise_stopped(py, axes, stopped),
        MotionError::Refused(refused) => raise_refused(py, refused),
        // The stop was asked for before the motion had begun.
        MotionError::Overtaken => {
            let fields =
                [("rule", "requested".to_owned().into()), ("category", Field::None), ("axis", Field::None)];
            raise(py, "StoppedError", &words, &fields)
        }
        MotionError::Replaced => raise(py, "ReplacedError", &words, &[]),
        MotionError::NotInTime => raise_timeout(py, &words),
        MotionError::Ended => raise_ended(py),
        _ => raise(py, "MotionError", &words, &[]),
    }
}

/// A group that has stopped. `axes` are the names of all axes.
pub fn raise_stopped(py: Python<'_>, axes: &[&str], stopped: &Stopped) -> PyErr {
    let axis = stopped.reason.axis().and_then(|axis| axes.get(usize::from(axis)));
    let fields = [
        ("rule", stopped.reason.rule().key().to_owned().into()),
        ("category", (stopped.reason.category as usize).into()),
        ("axis", axis.map(|axis| (*axis).to_owned()).into()),
    ];
    raise(py, "StoppedError", &stopped.to_string(), &fields)
}

/// Points of a stream that were not taken. `axes` are the names of those that they are for.
pub fn raise_stream(py: Python<'_>, axes: &[&str], error: &StreamError) -> PyErr {
    let words = error.naming(axes);
    match error {
        StreamError::Refused { point, axis, .. } => {
            let name = axes.get(*axis).map(|name| (*name).to_owned());
            raise(py, "StreamError", &words, &[("point", (*point).into()), ("axis", name.into())])
        }
        StreamError::Count { .. } => raise_argument(py, &words),
        StreamError::Lease(error) => raise_lease(py, *error),
        StreamError::NoReply { .. } => raise_timeout(py, &words),
        StreamError::Ended => raise_ended(py),
        _ => raise(py, "StreamError", &words, &[]),
    }
}
