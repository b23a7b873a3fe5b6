//! Serving a controller to other processes.

use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use takt::{Handle, ServeOptions};

use crate::error::raise;

/// Lets other processes observe and command a controller, until it is closed.
#[pyclass(module = "takt", frozen)]
pub struct Server(Mutex<Option<takt::Server>>);

impl Server {
    pub fn start(py: Python<'_>, handle: Handle, name: &str, options: ServeOptions) -> PyResult<Self> {
        let server = py.detach(|| takt::serve(handle, name, options));
        let server = server.map_err(|error| raise(py, "ArgumentError", &error.to_string(), &[]))?;
        Ok(Self(Mutex::new(Some(server))))
    }
}

#[pymethods]
impl Server {
    /// Ends it: the calls of the clients say that the controller has ended. The controller goes on.
    fn close(&self, py: Python<'_>) {
        py.detach(|| drop(self.0.lock().unwrap_or_else(PoisonError::into_inner).take()));
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, PyTuple>) {
        self.close(py);
    }
}
