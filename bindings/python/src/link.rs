//! The way to a controller, which all objects of an arm share.

use std::process;
use std::time::Duration;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use takt::Handle;

use crate::error::raise;

/// A handle, and the process that it is of.
#[derive(Clone)]
pub struct Link {
    handle: Handle,
    process: u32,
}

impl Link {
    pub fn new(handle: Handle) -> Self {
        Self { handle, process: process::id() }
    }

    /// The handle, in the process that has the controller. A fork of it has a copy of the memory, and none of the threads.
    pub fn handle(&self, py: Python<'_>) -> PyResult<&Handle> {
        if self.is_of_this_process() {
            return Ok(&self.handle);
        }
        let words = format!(
            "the controller is in process {}, and this is a fork of it; command it from there, or start workers by \
             multiprocessing's \"spawn\"",
            self.process
        );
        Err(raise(py, "EndedError", &words, &[]))
    }

    /// Whether the controller is in this process.
    pub fn is_of_this_process(&self) -> bool {
        process::id() == self.process
    }

    /// The names of all axes.
    pub fn axis_names(&self) -> Vec<&str> {
        self.handle.axes().iter().map(|axis| axis.name.as_str()).collect()
    }

    /// The names of the axes with these numbers.
    pub fn names_of(&self, axes: &[usize]) -> Vec<&str> {
        axes.iter().filter_map(|axis| self.handle.axes().get(*axis)).map(|axis| axis.name.as_str()).collect()
    }
}

/// A time of the program, in seconds.
pub fn duration(what: &str, seconds: f64) -> PyResult<Duration> {
    Duration::try_from_secs_f64(seconds).map_err(|_| {
        PyValueError::new_err(format!("{what} is a number of seconds from 0 on, and is {seconds}"))
    })
}

/// A time on the clock of the controller, in seconds.
pub fn seconds(ns: u64) -> f64 {
    Duration::from_nanos(ns).as_secs_f64()
}
