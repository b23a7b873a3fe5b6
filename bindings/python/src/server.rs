//! Serving a controller to other processes.

use std::mem;
use std::sync::{Mutex, MutexGuard, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use takt_remote::ServeOptions;

use crate::error::raise;
use crate::link::Link;

/// Lets other processes observe and command a controller, until it is closed.
#[pyclass(module = "takt", frozen)]
pub struct Server {
    server: Mutex<Option<takt_remote::Server>>,
    link: Link,
    name: String,
}

impl Server {
    pub fn start(py: Python<'_>, link: Link, name: &str, options: ServeOptions) -> PyResult<Self> {
        let handle = link.own(py, "serves it")?.clone();
        let server = py.detach(|| takt_remote::serve(handle, name, options));
        let server = server.map_err(|error| raise(py, "ArgumentError", &error.to_string(), &[]))?;
        Ok(Self { server: Mutex::new(Some(server)), link, name: name.to_owned() })
    }

    fn lock(&self) -> MutexGuard<'_, Option<takt_remote::Server>> {
        self.server.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends it. A fork has none of its threads, and leaves it alone.
    fn end(&self) {
        let server = self.lock().take();
        if self.link.is_of_this_process() {
            drop(server);
        } else {
            mem::forget(server);
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.end();
    }
}

#[pymethods]
impl Server {
    /// Ends it: the calls of the clients say that the controller has ended. The controller goes on.
    fn close(&self, py: Python<'_>) {
        py.detach(|| self.end());
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, PyTuple>) {
        self.close(py);
    }

    fn __repr__(&self) -> String {
        let state = if self.lock().is_some() { "served" } else { "closed" };
        format!("<controller {state} as {:?}>", self.name)
    }
}
