//! The way to a controller, which all objects of an arm share.

use std::process;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use pyo3::prelude::*;
use takt::{AnyHandle, Handle};
use takt_remote::Client;

use crate::error::{raise, raise_argument};

/// How many forks are between the process that has loaded the package and this one. Python says of each, since to ask the operating system
/// for the number of the process in every call takes longer than most of the calls.
static FORKS: AtomicU64 = AtomicU64::new(0);

/// This process is a fork. Python calls it in the child of each.
#[pyfunction(name = "_after_fork")]
pub fn after_fork() {
    FORKS.fetch_add(1, Ordering::Relaxed);
}

/// A controller, and the process that may use it.
#[derive(Clone)]
pub struct Link {
    controller: AnyHandle,
    /// The same, if this program owns it.
    own: Option<Handle>,
    process: u32,
    /// The forks before this process.
    forks: u64,
    is_closed: Arc<AtomicBool>,
}

impl Link {
    /// To a controller of this process.
    pub fn to_own(handle: Handle) -> Self {
        Self { own: Some(handle.clone()), ..Self::to(handle.into()) }
    }

    /// To one of another process.
    pub fn to_served(client: Client) -> Self {
        Self::to(client.into())
    }

    fn to(controller: AnyHandle) -> Self {
        let forks = FORKS.load(Ordering::Relaxed);
        Self { controller, own: None, process: process::id(), forks, is_closed: Arc::default() }
    }

    /// The controller, in the process that has it or has connected to it. A fork has a copy of the memory, and none of the threads.
    pub fn controller(&self, py: Python<'_>) -> PyResult<&AnyHandle> {
        if !self.is_of_this_process() {
            let words = format!(
                "the controller is in process {}, and this is a fork of it; command it from there, or start workers by \
                 multiprocessing's \"spawn\"",
                self.process
            );
            return Err(raise(py, "EndedError", &words, &[]));
        }
        if self.is_closed.load(Ordering::Acquire) {
            return Err(raise(py, "EndedError", "the connection to the controller is closed", &[]));
        }
        Ok(&self.controller)
    }

    /// The controller, for what says nothing where there is none: the text of an object.
    pub fn usable(&self) -> Option<&AnyHandle> {
        let is_usable = self.is_of_this_process() && !self.is_closed.load(Ordering::Acquire);
        is_usable.then_some(&self.controller)
    }

    /// The same, for a thread of its own.
    pub fn shared(&self, py: Python<'_>) -> PyResult<AnyHandle> {
        self.controller(py)?;
        Ok(self.controller.clone())
    }

    /// The controller, for what only the program that runs it can do.
    pub fn own(&self, py: Python<'_>, what: &str) -> PyResult<&Handle> {
        self.controller(py)?;
        self.own.as_ref().ok_or_else(|| {
            let words =
                format!("only the program that runs the controller {what}, and this one is connected to it");
            raise(py, "OwnerError", &words, &[])
        })
    }

    /// Whether this program owns the controller.
    pub const fn is_own(&self) -> bool {
        self.own.is_some()
    }

    /// From now on nobody can use it.
    pub fn close(&self) {
        self.is_closed.store(true, Ordering::Release);
    }

    /// Whether the controller is in this process, or this process has connected to it.
    pub fn is_of_this_process(&self) -> bool {
        FORKS.load(Ordering::Relaxed) == self.forks
    }

    /// The names of all axes.
    pub fn axis_names(&self) -> Vec<&str> {
        self.controller.machine().axes.iter().map(|axis| axis.name.as_str()).collect()
    }

    /// The name of the group with this number. Where all axes are one group, it has the name of the machine.
    pub fn group_name(&self, number: usize) -> &str {
        let machine = self.controller.machine();
        machine.groups.get(number).unwrap_or(&machine.name)
    }

    /// The names of the axes with these numbers.
    pub fn names_of(&self, axes: &[usize]) -> Vec<&str> {
        let known = &self.controller.machine().axes;
        axes.iter().filter_map(|axis| known.get(*axis)).map(|axis| axis.name.as_str()).collect()
    }
}

/// A time of the program, in seconds.
pub fn duration(py: Python<'_>, what: &str, seconds: f64) -> PyResult<Duration> {
    Duration::try_from_secs_f64(seconds).map_err(|_| {
        raise_argument(py, &format!("{what} is a number of seconds from 0 on, and was given as {seconds}"))
    })
}

/// A time on the clock of the controller, in seconds.
pub fn seconds(ns: u64) -> f64 {
    Duration::from_nanos(ns).as_secs_f64()
}
